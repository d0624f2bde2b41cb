//! Closed-form bent plates with thickness and an exact material map: the ground truth of the simulators.
//!
//! A plate consists of a blank (a rectangle with a thickness), a [`Shape`] of its mid-surface and a [`Pose`]. The three
//! form the [`PlateState`], which is stored in description files, modified by a [`Stroke`] and served by the simulated
//! press. [`Plate`] is the geometry prepared from one state. It maps every material point (u, v) of the original
//! rectangle to a point of the mid-surface, of the two faces and of the four sides.
//!
//! ## Shapes and material map
//! Flat plates, cylinders, cones, curvature steps and parallel bend bands are developable: their map is an exact
//! isometry of the mid-surface. Spheres, tori and crossed bend bands are not; their material points minimise the
//! membrane energy of an elastic sheet (plane stress, Poisson's ratio 0.3, free edges) by a Ritz series (module
//! `material`). The shape itself is exact in both cases. Curves of given curvature are integrated as Chebyshev series
//! (module `profile`).
//!
//! ## Forming
//! Strokes are kinematic: a stroke bends a strip by a given angle and a given share of it springs back. There is no
//! moment-curvature law and no contact model. Oblique strokes have no closed form and are refused.
//!
//! ## Cutting errors
//! A blank may deviate from its rectangle by millimetres (`corners_off_mm`, `bows_mm`). (u, v) remain lengths on the
//! steel: the point (a, b) of the ordered rectangle is material point [`Plate::material`]`(a, b)`. A tape laid from
//! corner (0,0) along the first edge shows u as long as that corner does not move and the next one moves only along u.
//!
//! ## Edges
//! Edges are square or have a double-V bevel (`face_inset_mm`, `root_face_mm`), the same along all four sides. Width
//! and height are those of the mid-surface; both faces end inside of it.
//!
//! ## Frames and units
//! (u, v) in [0, width] x [0, height], metres. The local frame has its origin in the middle of the mid-surface, x along
//! u there and z along the upper normal; the pose maps it to the scanner frame. Documents are in millimetres and
//! degrees. Curvature is positive when the centre of curvature lies above the plate.
//!
//! This crate shares no code with the product, so that an error in one of the two is not hidden by the other.

mod bevel;
mod cone;
mod cutting_error;
mod error;
mod fibre;
mod material;
mod plate;
mod profile;
mod protocol;
mod shape;
mod state;
mod stroke;
mod surface;
mod swept_surface;

pub use bevel::Strip;
pub use error::PlateError;
pub use fibre::{FibreSteel, FibreStrip, Press};
pub use plate::{Curvature, Plate, Side};
pub use protocol::{Reply, Request};
pub use shape::{Band, CurvatureStep, Shape};
pub use state::{Blank, PlateState, Pose};
pub use stroke::{Handling, Plan, Programme, Stroke};
pub use surface::Jet;

/// Point or vector in space, metres.
pub type Vec3 = nalgebra::Vector3<f64>;
