//! One stroke: who it is, what the press said about it, what came of it.

use std::collections::BTreeMap;
use std::fmt;

use platen_plant::press::Measure;
use serde::{Deserialize, Serialize};

use crate::Code;

/// Identity of a measurement. Each is scanned at most once.
///
/// A stroke number can come back after a full turn of the press's counter in the same session; `run_id` of
/// [`Publication`] never does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct StrokeKey {
    /// Plant number of the press.
    pub press: u16,
    /// Number that the press changes when it restarts or the part changes; 0 where it has none.
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

/// What the press says about a stroke. `None`: not in this press's registers, not plausible, or 0 where that says
/// that the press has none (thickness, force, ram, die).
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
    /// A scan of the plate before its first stroke.
    pub baseline: bool,
    /// A trial: measured and recorded as one.
    pub dry_run: bool,
}

/// A moment in UTC, as two registers' worth of seconds and milliseconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Timestamp {
    /// Seconds since 1970-01-01.
    pub unix_s: u32,
    /// Milliseconds of that second.
    pub ms: u16,
}

/// What is said about the plate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// It has its target shape.
    Pass,
    /// It has not.
    Fail,
    /// Measured, but too uncertain to judge.
    CannotTell,
    /// Nothing can be said, and why.
    NotMeasured(Code),
}

/// The figures of a measurement, in metres, radians, seconds and shares of one. A figure that is not there was not
/// measured and goes out as the field's invalid value, never as 0.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Figures {
    /// By name.
    pub values: BTreeMap<Measure, f64>,
    /// At the configured stations, in their order.
    pub stations: Vec<Option<f64>>,
}

/// What the host found out about a stroke.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Measurement {
    /// The judgement.
    pub verdict: Verdict,
    /// The figures; empty when nothing was measured.
    pub figures: Figures,
    /// When it was scanned.
    pub scanned_at: Option<Timestamp>,
    /// What to look at although the result stands.
    pub warning: Option<Code>,
}

impl Measurement {
    /// No figures, and why.
    pub fn not_measured(code: Code) -> Self {
        Self {
            verdict: Verdict::NotMeasured(code),
            figures: Figures::default(),
            scanned_at: None,
            warning: None,
        }
    }
}

/// A result as it stands in the registers: written once, and written again word for word after a restart.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Publication {
    /// The stroke it belongs to.
    pub key: StrokeKey,
    /// Key of the record, never used twice by one installation.
    pub run_id: u32,
    /// Count of published results; the commit word.
    pub seq: u16,
    /// Recipe that the result was judged by.
    pub recipe_id: Option<u16>,
    /// The result itself.
    pub measurement: Measurement,
}
