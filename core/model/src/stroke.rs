//! Identity of a stroke, and the data that the press reports about it.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Identity of a measurement. Each is scanned at most once.
///
/// A stroke number recurs in the same session after the press's counter has wrapped; the `run_id` of a
/// [`Publication`](crate::Publication) never recurs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct StrokeKey {
    /// Plant number of the press.
    pub press: u16,
    /// Session: a number that the press changes when it restarts or the part changes; 0 if it has none.
    pub session: u16,
    /// Number of the stroke.
    pub stroke: u16,
    /// 0 for the first measurement of a stroke.
    pub attempt: u16,
}

impl fmt::Display for StrokeKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "press {} session {} stroke {}", self.press, self.session, self.stroke)?;
        if self.attempt > 0 { write!(f, " attempt {}", self.attempt) } else { Ok(()) }
    }
}

/// Data of the press about a stroke. `None` means: not in this press's registers, not plausible, or 0 where 0 stands
/// for "none" (thickness, force, ram, die).
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct StrokeData {
    /// Number of the target shape.
    pub recipe_id: Option<u16>,
    /// State of the press: 0 unknown, 1 manual, 2 automatic, 3 down, 4 dwell, 5 up, 6 fault.
    pub press_state: Option<u16>,
    /// Number of the plate.
    pub part_id: Option<u32>,
    /// Name of the plate.
    pub part_name: Option<String>,
    /// Number of the bend line in the recipe.
    pub bend_index: Option<u16>,
    /// Thickness of the plate, metres.
    pub thickness: Option<f64>,
    /// Largest force of the stroke, newtons.
    pub force: Option<f64>,
    /// Deepest position of the ram, metres.
    pub ram_depth: Option<f64>,
    /// Feed position of the plate, metres.
    pub plate_x: Option<f64>,
    /// Feed position of the plate, metres.
    pub plate_y: Option<f64>,
    /// Feed rotation of the plate, radians.
    pub plate_rot: Option<f64>,
    /// Temperature of the plate, degrees Celsius.
    pub temperature: Option<f64>,
    /// Time of the press controller at the trigger.
    pub plc_time: Option<Timestamp>,
    /// Die set in use.
    pub die_id: Option<u16>,
    /// Code of the crew, where the plant file has `[crews]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub crew: Option<u16>,
    /// The scan is the one before the plate's first stroke.
    pub baseline: bool,
    /// The stroke is a trial: it is measured, and recorded as a trial.
    pub dry_run: bool,
}

/// Time in UTC as seconds and milliseconds, which fit registers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Timestamp {
    /// Seconds since 1970-01-01.
    pub unix_s: u32,
    /// Milliseconds of that second.
    pub ms: u16,
}
