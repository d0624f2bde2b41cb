//! Closed-form bent plates with thickness and exact material map.
//!
//! A plate is a blank (a rectangle with a thickness), a [`Shape`] of its mid-surface and a [`Pose`]: together
//! the [`PlateState`], which is what a description file holds, what a [`Stroke`] changes and what the simulated
//! press sends to whoever asks. [`Plate`] is the prepared geometry of one state: where every material point
//! (u, v) of the original rectangle lies, on the mid-surface, on either face and on the sides.
//!
//! ## Material law
//! Flat plates, cylinders, cones, curvature steps and parallel bend bands are developable: the map is isometric
//! on the mid-surface, exactly. Spheres, tori and crossed bend bands are not: there the material points lie where
//! the membrane energy of an elastic sheet (plane stress, Poisson's ratio 0.3, free edges) is least. Either way
//! the shape itself is exact.
//!
//! ## The cut
//! A blank may be cut off its rectangle by millimetres (`corners_off_mm`, `bows_mm`). (u, v) stay metric on the steel: a place (a, b) of
//! the ordered rectangle is then material point [`Plate::material`]`(a, b)`. A tape laid from corner (0,0) along the first edge reads u as
//! long as that corner is not moved and the next one only along u.
//!
//! Frames and units: (u, v) in [0, width] x [0, height], metres; the local frame has its origin in the middle of
//! the mid-surface, x along u there and z along the upper normal; the pose takes it to the scanner frame. Documents are in
//! millimetres and degrees. Curvature is positive when the centre lies above the plate.
//! This crate shares no code with the product: what it says is the truth that the product is judged by.

mod cone;
mod cutting_error;
mod error;
mod material;
mod plate;
mod profile;
mod protocol;
mod shape;
mod state;
mod stroke;
mod surface;
mod swept_surface;

pub use error::PlateError;
pub use plate::{Curvature, Plate, Side};
pub use protocol::{Reply, Request};
pub use shape::{Band, CurvatureStep, Shape};
pub use state::{Blank, PlateState, Pose};
pub use stroke::{Handling, Plan, Programme, Stroke};
pub use surface::Jet;

/// A point or vector in space, metres.
pub type Vec3 = nalgebra::Vector3<f64>;
