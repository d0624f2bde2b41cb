//! Errors of the outline.

use platen_numerics::spline_fit::Undetermined;

/// Reason why the outline of a plate's face could not be located.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of a variant names its fields")]
pub enum OutlineError {
    /// The longest boundary loop is too short to be the plate's.
    #[error(
        "the longest boundary of the plate's face is about {found_mm:.0} mm long, the plate's is {expected_mm:.0} mm; \
         clear what hides the plate"
    )]
    Loop { found_mm: f64, expected_mm: f64 },
    /// No four corners joined by straight edges.
    #[error("{found} corners of the plate were found, 4 are needed; clear what hides its corners")]
    Corners { found: usize },
    /// An edge is hidden.
    #[error(
        "{seen_percent:.0} % of one edge of the plate is seen, too little to locate it; clear what hides it, or tilt it where it \
         mirrors the beam"
    )]
    Edge { seen_percent: f64 },
    /// The face has too few samples to be smoothed.
    #[error("outline: {0}; scan again with the plate in full view")]
    Face(#[from] Undetermined),
    /// The hint does not distinguish the corners.
    #[error(
        "the u axis hint lies {angle_deg:.0} degrees from the nearest edge of the plate; turn it to within 35 degrees of \
         the edge along which u grows"
    )]
    Hint { angle_deg: f64 },
    /// A side has the wrong length, and one of the edges that determine it is hidden.
    #[error(
        "{seen_percent:.0} % of one edge of the plate is seen, too little to measure the plate's {side}: it comes out at \
         {found_mm:.0} mm, {expected_mm:.0} mm by the plate file; clear what hides it, or tilt it where it mirrors the beam"
    )]
    Hidden { seen_percent: f64, side: &'static str, found_mm: f64, expected_mm: f64 },
    /// A side differs from the plate file.
    #[error(
        "the plate's {side} measures {found_mm:.0} mm on its mid-surface, {expected_mm:.0} mm by the plate file; check \
         the recipe and the u axis hint"
    )]
    WrongSize { side: &'static str, found_mm: f64, expected_mm: f64 },
}
