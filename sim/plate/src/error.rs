//! Errors of plate descriptions and strokes.

/// Error of building a state or applying a stroke, by the person who must act.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PlateError {
    /// Invalid value in a description: change the document.
    #[error("plate.{key}: {found} is not allowed; {advice}")]
    Description {
        /// Key in the document.
        key: &'static str,
        /// Value found.
        found: f64,
        /// Allowed values.
        advice: &'static str,
    },
    /// Stroke that this model cannot apply: change the programme.
    #[error("stroke at {at_mm} mm, axis {axis_deg} deg: {reason}")]
    Stroke {
        /// Position of the die, from the plate's middle.
        at_mm: f64,
        /// Direction of the die.
        axis_deg: f64,
        /// Reason.
        reason: &'static str,
    },
    /// Target that parallel strokes cannot reach.
    #[error("no programme bends a plate to {target}; choose cylinder, sphere or torus")]
    Target {
        /// Name of the shape.
        target: &'static str,
    },
}
