//! `[calibration]`: what `platen calibrate` found about the scanner, and how long that holds.

use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::document::Reported;
use crate::{TomlTable, Unit};

/// Where the calibration stands and when it holds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CalibrationUse {
    /// The file that `platen calibrate` writes.
    pub file: PathBuf,
    /// A calibration older than this is not valid any more; `None`: it never ages.
    pub max_age: Option<Duration>,
    /// The scanner is cold until it has been in reach for this long.
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

/// A time as a text with its unit, or in `unit` where it names none.
fn time<'d>(table: &mut TomlTable<'d>, key: &str, unit: Unit) -> crate::TomlKey<'d, Duration> {
    table.string(key).try_map(|text| {
        let value = unit.read(&text)?;
        Duration::try_from_secs_f64(unit.to(value, Unit::SECOND))
            .map_err(|_| format!("found {text:?}, must be at least 0"))
    })
}
