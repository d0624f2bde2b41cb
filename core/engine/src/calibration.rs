//! Calibration of a scanner: its correlated and systematic errors, the file that `platen calibrate` writes, and the
//! conditions under which it is valid (age, warm-up).

use std::path::{Path, PathBuf};
use std::time::Duration;

use jiff::Timestamp;
use platen_model::units::{metres, mm};
use platen_plant::plant::CalibrationUse;
use platen_plant::{Document, Error as PlantError, Reported, TomlTable};

/// Largest plausible standard deviation, millimetres: above it a plate was bent or the scanner moved.
const LARGEST_SIGMA_MM: f64 = 20.0;

/// Largest difference between the clocks of two computers that counts as none, seconds.
const CLOCK_SLACK_S: f64 = 60.0;

/// Errors of one scanner at its place.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// Time of the calibration.
    pub made: Timestamp,
    /// Its scanner: maker, model, serial number.
    pub instrument: String,
    /// Plate or artefact that was scanned.
    pub plate: String,
    /// Number of scans.
    pub scans: usize,
    /// Correlated error of a pair of scans, one sigma, metres.
    pub sigma_correlated: f64,
    /// Systematic error of a gap, one sigma, metres; known only from an artefact of known shape.
    pub sigma_true: Option<f64>,
}

/// Reason why a plant's calibration is invalid.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the message of a variant names its fields")]
pub enum Invalid {
    /// No file, or a faulty one.
    #[error("calibration: {0}; run platen calibrate")]
    Absent(#[from] PlantError),
    /// Older than allowed.
    #[error("calibration: {} is {age_d:.0} days old, {limit_d:.0} are allowed; run platen calibrate", .file.display())]
    TooOld { file: PathBuf, age_d: f64, limit_d: f64 },
    /// Made after now: the clock is wrong, or was when the calibration was made.
    #[error("calibration: {} was made at {made}, which is to come; check the clock of this computer, or run platen calibrate", .file.display())]
    Future { file: PathBuf, made: Timestamp },
    /// The scanner is warming up.
    #[error("calibration: the scanner is still warming up, {left_min:.0} minutes are left")]
    Cold { left_min: f64 },
}

impl Calibration {
    /// Reads a calibration file.
    ///
    /// # Errors
    /// Every fault of the file.
    pub fn load(path: &Path) -> Result<Self, PlantError> {
        let document = Document::load(path)?;
        let read = Self::read(document.root());
        Ok(document.finish(read)?)
    }

    fn read(mut root: TomlTable<'_>) -> Result<Self, Reported> {
        let table = root.table("calibration").required();
        root.finish();
        let mut table = table?;
        let made = table.string("made").try_map(|text| {
            text.parse::<Timestamp>()
                .map_err(|_| format!("found {text:?}, expected a time like 2026-05-04T10:00:00Z"))
        });
        let made = made.required();
        let instrument = table.string("instrument").required();
        let plate = table.name("plate").required();
        let scans = table.integer("scans").at_least(1).required();
        let correlated =
            table.number("sigma_correlated_mm").in_range(0.0..=LARGEST_SIGMA_MM).map(metres).required();
        let systematic =
            table.number("sigma_true_mm").in_range(0.0..=LARGEST_SIGMA_MM).map(metres).optional();
        table.finish();
        Ok(Self {
            made: made?,
            instrument: instrument?,
            plate: plate?,
            scans: usize::try_from(scans?).unwrap_or(usize::MAX),
            sigma_correlated: correlated?,
            sigma_true: systematic?,
        })
    }

    /// Returns the calibration as the text of a TOML file.
    pub fn to_toml(&self) -> String {
        // JSON string literals are valid TOML basic strings.
        let text = |text: &str| serde_json::Value::from(text).to_string();
        let mut file = format!(
            "# Written by platen calibrate. One sigma, of a position between two scans and of a template's gap.\n\
             [calibration]\nmade = \"{}\"\ninstrument = {}\nplate = {}\nscans = {}\nsigma_correlated_mm = {:.4}\n",
            self.made,
            text(&self.instrument),
            text(&self.plate),
            self.scans,
            mm(self.sigma_correlated)
        );
        if let Some(sigma) = self.sigma_true {
            file += &format!("sigma_true_mm = {:.4}\n", mm(sigma));
        }
        file
    }
}

/// Returns the plant's calibration if it is valid at `now`, with the scanner connected for the time `in_reach`.
///
/// # Errors
/// The reason why it is invalid.
pub fn in_force(wanted: &CalibrationUse, now: Timestamp, in_reach: Duration) -> Result<Calibration, Invalid> {
    let calibration = Calibration::load(&wanted.file)?;
    let age = now.duration_since(calibration.made).as_secs_f64();
    if age < -CLOCK_SLACK_S {
        return Err(Invalid::Future { file: wanted.file.clone(), made: calibration.made });
    }
    let days = |seconds: f64| seconds / 86_400.0;
    match wanted.max_age.map(|limit| limit.as_secs_f64()) {
        Some(limit) if age > limit => {
            return Err(Invalid::TooOld {
                file: wanted.file.clone(),
                age_d: days(age),
                limit_d: days(limit),
            });
        }
        _ => {}
    }
    match wanted.warm_up.checked_sub(in_reach) {
        Some(left) if !left.is_zero() => Err(Invalid::Cold { left_min: (left.as_secs_f64() / 60.0).ceil() }),
        _ => Ok(calibration),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn calibration() -> Calibration {
        Calibration {
            made: "2026-05-04T10:00:00Z".parse().unwrap(),
            instrument: "a \"maker\", 7".into(),
            plate: "CAL".into(),
            scans: 5,
            sigma_correlated: 0.0375e-3,
            sigma_true: Some(0.125e-3),
        }
    }

    fn wanted(folder: &Path, days: Option<u64>, minutes: u64) -> CalibrationUse {
        let max_age = days.map(|days| Duration::from_secs(days * 86_400));
        CalibrationUse { file: folder.join("cal.toml"), max_age, warm_up: Duration::from_secs(60 * minutes) }
    }

    #[test]
    fn a_file_comes_back_and_every_fault_of_one_is_reported() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cal.toml");
        for calibration in [calibration(), Calibration { sigma_true: None, ..calibration() }] {
            std::fs::write(&path, calibration.to_toml()).unwrap();
            assert_eq!(Calibration::load(&path).unwrap(), calibration);
        }
        let text = calibration().to_toml().replace("0.0375", "-1").replace("2026-05-04T10:00:00Z", "May");
        std::fs::write(&path, text).unwrap();
        let faults = Calibration::load(&path).unwrap_err().to_string();
        assert!(
            faults.contains("cal.toml:3:8: calibration.made") && faults.contains("sigma_correlated_mm"),
            "{faults}"
        );
    }

    #[test]
    fn a_calibration_holds_until_it_is_too_old_and_only_on_a_warm_scanner() {
        let folder = tempfile::tempdir().unwrap();
        let now: Timestamp = "2026-05-14T10:00:00Z".parse().unwrap();
        let hour = Duration::from_secs(3600);
        let says = |wanted: &CalibrationUse, in_reach| {
            in_force(wanted, now, in_reach).map(|c| c.scans).map_err(|e| e.to_string())
        };
        assert!(says(&wanted(folder.path(), None, 0), hour).unwrap_err().contains("run platen calibrate"));
        std::fs::write(folder.path().join("cal.toml"), calibration().to_toml()).unwrap();
        assert_eq!(says(&wanted(folder.path(), None, 0), Duration::ZERO), Ok(5));
        assert_eq!(says(&wanted(folder.path(), Some(11), 30), hour), Ok(5));
        assert!(
            says(&wanted(folder.path(), Some(9), 0), hour)
                .unwrap_err()
                .contains("10 days old, 9 are allowed")
        );
        let mut early = wanted(folder.path(), None, 0);
        early.file = folder.path().join("early.toml");
        let made = "2026-05-15T10:00:00Z".parse().unwrap();
        std::fs::write(&early.file, Calibration { made, ..calibration() }.to_toml()).unwrap();
        assert!(says(&early, hour).unwrap_err().contains("which is to come; check the clock"));
        let cold = says(&wanted(folder.path(), None, 30), Duration::from_secs(61)).unwrap_err();
        assert!(cold.contains("warming up, 29 minutes"), "{cold}");
    }
}
