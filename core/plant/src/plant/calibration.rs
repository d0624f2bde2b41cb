//! Table `[calibration]`: the file written by `platen calibrate`, and its validity.

use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::document::Reported;
use crate::{TomlTable, Unit};

/// Calibration file and its validity.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CalibrationUse {
    /// File that `platen calibrate` writes.
    pub file: PathBuf,
    /// Age beyond which the calibration is invalid; `None` for no limit.
    pub max_age: Option<Duration>,
    /// Time for which the scanner must have been in reach before it counts as warm.
    pub warm_up: Duration,
}

impl CalibrationUse {
    pub(super) fn read(mut table: TomlTable<'_>, plant_folder: &Path) -> Result<Self, Reported> {
        let file = table.name("file").map(|file| plant_folder.join(file)).required();
        let max_age = time(&mut table, "max_age", Unit::DAY).optional();
        let warm_up = time(&mut table, "warm_up", Unit::MINUTE).or(Duration::ZERO);
        table.finish();
        Ok(Self { file: file?, max_age: max_age?, warm_up: warm_up? })
    }
}

/// Reads a time: a text with its unit, or in `unit` without one.
fn time<'d>(table: &mut TomlTable<'d>, key: &str, unit: Unit) -> crate::TomlKey<'d, Duration> {
    table.string(key).try_map(|text| {
        let value = unit.read(&text)?;
        Duration::try_from_secs_f64(unit.to(value, Unit::SECOND))
            .map_err(|_| format!("found {text:?}, must be at least 0"))
    })
}
