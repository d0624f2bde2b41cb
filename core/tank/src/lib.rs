//! Development of a tank's zones to plates: blank, target, templates and trim lines of each plate.
//!
//! A zone is a ring of equal plates on a surface of revolution: course of a cylinder, cone, sphere between two polar
//! angles, knuckle of a torus. [`Tank::load`] reads the zones, [`Plate::of`] develops one, [`plate_file`] writes the
//! plate file and [`blank_list`] the list for the mill. Lengths are in metres, on the mid-surface unless stated
//! otherwise; angles in radians.
//!
//! Limits: blanks are rectangles with u across the ring and v along its meridian; openings, crowns and the weld
//! preparation are not laid out.

mod files;
mod membrane;
mod plate;
mod read;
mod surface;

pub use files::{blank_list, plate_file};
pub use membrane::Membrane;
pub use plate::{Check, Plate};
pub use surface::Revolution;

use platen_model::{Facing, RadiusOf, Steel};

/// Density of steel, kg/m^3.
const DENSITY: f64 = 7850.0;

/// A tank file.
#[derive(Debug, Clone, PartialEq)]
pub struct Tank {
    /// Name.
    pub name: String,
    /// Surface to which the file's radii refer.
    pub radius_of: RadiusOf,
    /// Face that the scanner sees.
    pub scanned_face: Facing,
    /// Gap between two plates of a ring before welding.
    pub root_gap: f64,
    /// Material on each edge of a blank, cut off along the trim line after bending.
    pub allowance: f64,
    /// Supports of the plates during a scan.
    pub supports: Option<String>,
    /// Steel of the plates.
    pub steel: Option<Steel>,
    /// Largest blank; `None` where any size is available.
    pub mill: Option<Mill>,
    /// Rules of the templates.
    pub rules: Vec<Rule>,
    /// Zones, from one end of the tank to the other.
    pub zones: Vec<Zone>,
}

/// Largest blank of the mill.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mill {
    /// Shorter side.
    pub width: f64,
    /// Longer side.
    pub length: f64,
    /// Mass, kg.
    pub mass: Option<f64>,
}

/// Rule for templates: length of the board, largest gap, and their source.
#[derive(Debug, Clone, PartialEq)]
pub struct Rule {
    /// Name by which zones refer to it.
    pub name: String,
    /// Length of the board and largest gap; `None` until a person with access to the document has entered them. A rule
    /// without them gives no verdict.
    pub limit: Option<[f64; 2]>,
    /// Document and clause.
    pub clause: String,
    /// Edition of the document.
    pub edition: Option<String>,
    /// Person who read the document and entered the figures.
    pub typed_by: Option<String>,
}

impl Rule {
    /// Returns the origin of the rule in words, as verdicts print it.
    #[must_use]
    pub fn source(&self) -> String {
        let edition = self.edition.as_ref().map(|edition| format!(", edition {edition}"));
        let by = self.typed_by.as_ref().map(|by| format!(", typed in by {by}"));
        [Some(self.clause.clone()), edition, by].into_iter().flatten().collect()
    }
}

/// A ring of equal plates.
#[derive(Debug, Clone, PartialEq)]
pub struct Zone {
    /// Name, also the plates' name.
    pub name: String,
    /// Number of the plate file, by which the press identifies its target.
    pub recipe: u16,
    /// Mid-surface.
    pub surface: Revolution,
    /// Thickness.
    pub thickness: f64,
    /// Number of plates around the ring.
    pub plates: u32,
    /// Rule of its templates, by its index in [`Tank::rules`].
    pub rule: Option<usize>,
}
