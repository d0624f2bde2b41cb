//! Clock of the host at a measurement.

use serde::{Deserialize, Serialize};

/// State of the clock that gave the times of a stroke.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ClockRecord {
    /// Whether a time server disciplines it.
    pub synchronised: bool,
    /// Largest error, estimated by the kernel; null while the clock is not synchronised.
    pub error_bound_ms: Option<f64>,
}

impl ClockRecord {
    /// Describes the state in words.
    pub fn words(&self) -> String {
        match self.error_bound_ms {
            Some(bound) => format!("synchronised within {bound:.1} ms"),
            None => "not synchronised".to_owned(),
        }
    }
}
