//! Why a face has no outline.

use crate::surface::Undetermined;

/// Why the outline of a plate's face could not be told.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum OutlineError {
    /// The longest boundary loop is too short to be the plate's.
    #[error(
        "the longest boundary of the plate's face is about {found_mm:.0} mm long, the plate's is {expected_mm:.0} mm; \
         clear what hides the plate"
    )]
    Loop {
        /// Millimetres.
        found_mm: f64,
        /// Millimetres.
        expected_mm: f64,
    },
    /// There are not four corners that straight edges join.
    #[error("{found} corners of the plate can be told, not four; clear what hides its corners")]
    Corners {
        /// Corner candidates with straight edges on both sides.
        found: usize,
    },
    /// An edge is hidden.
    #[error(
        "{seen_percent:.0} % of one edge of the plate is seen, too little to tell where it is; clear what hides it, or tilt it \
         where it mirrors the beam"
    )]
    Edge {
        /// Part of the edge that was seen, percent.
        seen_percent: f64,
    },
    /// The face has too few samples to be smoothed.
    #[error("outline: {0}; scan again with the plate in full view")]
    Face(#[from] Undetermined),
    /// The hint does not tell the corners apart.
    #[error(
        "the u axis hint lies {angle_deg:.0} degrees from the nearest edge of the plate; turn it to within 35 degrees of \
         the edge along which u grows"
    )]
    Hint {
        /// Angle to the nearest edge, degrees.
        angle_deg: f64,
    },
    /// A side comes out wrong where an edge beside it is hidden.
    #[error(
        "{seen_percent:.0} % of one edge of the plate is seen, too little to tell the plate's {side}: it comes out at \
         {found_mm:.0} mm, the plate file says {expected_mm:.0} mm; clear what hides it, or tilt it where it mirrors the beam"
    )]
    Hidden {
        /// Part of the edge that was seen, percent.
        seen_percent: f64,
        /// `width` or `height`.
        side: &'static str,
        /// Millimetres.
        found_mm: f64,
        /// Millimetres.
        expected_mm: f64,
    },
    /// A side differs from the plate file.
    #[error(
        "the plate's {side} measures {found_mm:.0} mm on its mid-surface, the plate file says {expected_mm:.0} mm; check \
         the recipe and the u axis hint"
    )]
    WrongSize {
        /// `width` or `height`.
        side: &'static str,
        /// Millimetres.
        found_mm: f64,
        /// Millimetres.
        expected_mm: f64,
    },
}
