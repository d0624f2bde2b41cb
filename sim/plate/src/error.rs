//! What can be wrong with a plate's description.

/// Why a state cannot be built or a stroke cannot be applied.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PlateError {
    /// The description contradicts itself: change the document.
    #[error("plate.{key}: {found} is not possible; {advice}")]
    Description {
        /// Key of the document.
        key: &'static str,
        /// What stands there.
        found: f64,
        /// What to write instead.
        advice: &'static str,
    },
    /// A stroke that this model cannot apply: change the programme.
    #[error("stroke at {at_mm} mm, axis {axis_deg} deg: {reason}")]
    Stroke {
        /// Where it was to be applied.
        at_mm: f64,
        /// Direction of its die.
        axis_deg: f64,
        /// Why not.
        reason: &'static str,
    },
    /// A target that strokes cannot reach.
    #[error("no programme bends a plate to {target}; choose cylinder, sphere or torus")]
    Target {
        /// Name of the shape.
        target: &'static str,
    },
}
