//! Advice document of one stroke, `advice.json` beside its result, in metres and radians as at the plugin boundary.
//!
//! It contains the input of the advisor, the advice, and the outcome of the stroke compared with the advice before it.

use std::path::{Path, PathBuf};

use platen_model::units::mm;
use platen_model::{Advice, Bend, CannotAdvise, Language, NextBend, PlateHistory, Step, StrokeKey};
use serde::{Deserialize, Serialize};

/// Version of the document.
pub const ADVICE_SCHEMA: &str = "platen.advice-record/1";
/// File name in the folder of a stroke.
pub const ADVICE_FILE: &str = "advice.json";

/// Advice after one stroke.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AdviceRecord {
    /// [`ADVICE_SCHEMA`].
    pub schema: String,
    /// Row of the record.
    pub run_id: u32,
    /// The stroke that it follows.
    pub key: StrokeKey,
    /// It follows a scan of the blank.
    pub baseline: bool,
    /// Place where it was shown: `shadow` (not at all) or `screen`.
    pub show: String,
    /// Class of the plate: plates of one class share what is learned about the press.
    pub class: PlateClass,
    /// Input of the advisor.
    pub history: PlateHistory,
    /// Output of the advisor; null when it failed.
    pub advice: Option<Advice>,
    /// Reason why it failed.
    pub failed: Option<String>,
    /// Comparison of the stroke that it follows with the advice before it; null without such advice, and where the
    /// stroke made no bend.
    pub score: Option<Score>,
    /// Reason why nothing was advised before that stroke; null where advice was given.
    #[serde(default)]
    pub unadvised: Option<CannotAdvise>,
    /// Time from the result to the advice, milliseconds.
    pub elapsed_ms: f64,
}

/// Class of a plate: strokes of one plate are evidence for another of the same class.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlateClass {
    /// Die set at the press.
    pub die: Option<u16>,
    /// Thickness, metres.
    pub thickness: f64,
    /// Grade of the steel.
    pub grade: Option<String>,
    /// Kind of the target, and the side to which it bends.
    pub target: String,
}

impl PlateClass {
    /// Largest difference of thickness within a class, metres.
    const THICKNESS: f64 = 1e-3;

    /// Returns the class in words.
    #[must_use]
    pub fn words(&self) -> String {
        let die = self.die.map(|die| format!(", die {die}")).unwrap_or_default();
        let grade = self.grade.as_ref().map(|grade| format!(", {grade}")).unwrap_or_default();
        format!("{}, {:.0} mm{grade}{die}", self.target, 1e3 * self.thickness)
    }

    /// Returns whether strokes of one of the two are evidence for the other.
    #[must_use]
    pub fn is_like(&self, other: &Self) -> bool {
        (self.die, &self.grade, &self.target) == (other.die, &other.grade, &other.target)
            && (self.thickness - other.thickness).abs() <= Self::THICKNESS
    }
}

/// Comparison of a stroke with the advice before it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// The bend that it made.
    pub made: Bend,
    /// Distance of the bend from the advised line, metres.
    pub off_line: f64,
    /// Advised angle.
    pub advised_angle: f64,
    /// Its 95 % interval if the stroke is made as advised; null in documents older than this field.
    #[serde(default)]
    pub advised_95: Option<[f64; 2]>,
    /// Expected angle for the reported depth at that place; null without a reported depth.
    pub expected_angle: Option<f64>,
    /// Half width of its 95 % interval, radians.
    pub expected_to: Option<f64>,
    /// Predicted largest gap under the templates after a stroke as advised, metres: lower end, expected, upper end.
    pub foretold_gap: [f64; 3],
    /// Largest gap as measured, metres.
    pub gap: Option<f64>,
    /// The stroke was pressed as advised: within 30 mm of where a bend for that line is expected, and to a depth within
    /// three standard deviations of the ram.
    pub followed: bool,
}

impl Score {
    /// Returns whether the angle lies in the interval that is predicted for the reported depth.
    #[must_use]
    pub fn angle_inside(&self) -> Option<bool> {
        let (expected, to) = self.expected_angle.zip(self.expected_to)?;
        Some((self.made.angle.abs() - expected).abs() <= to)
    }

    /// Returns whether the gap lies in the predicted interval; `None` if the advice was not followed.
    #[must_use]
    pub fn gap_inside(&self) -> Option<bool> {
        let [low, _, high] = self.foretold_gap;
        self.gap.filter(|_| self.followed).map(|gap| (low..=high).contains(&gap))
    }
}

impl AdviceRecord {
    /// Reads the advice beside a result document; `None` where there is none.
    ///
    /// # Errors
    /// The reason as a sentence, if the file exists but cannot be read.
    pub fn beside(document: &Path) -> Result<Option<Self>, String> {
        let path = path_beside(document);
        let text = match std::fs::read(&path) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(format!("{}: {error}", path.display())),
        };
        serde_json::from_slice(&text).map(Some).map_err(|error| format!("{}: {error}", path.display()))
    }

    /// Writes the document to the folder of its stroke.
    ///
    /// # Errors
    /// The reason as a sentence with the path.
    pub fn write(&self, folder: &Path) -> Result<PathBuf, String> {
        let text = serde_json::to_vec_pretty(self).map_err(|error| error.to_string())?;
        let path = folder.join(ADVICE_FILE);
        crate::output_folder::replace(&path, &text).map_err(|error| error.to_string())?;
        Ok(path)
    }
}

/// Returns an advice as sentences; the first states the next action.
#[must_use]
pub fn words(advice: &Advice) -> Vec<String> {
    let mut words = match &advice.step {
        Step::Bend(next) => bend("press", next),
        Step::TurnOver(next) => bend("turn the plate over and press", next),
        Step::Place { at, direction } => vec![format!(
            "press around u {:.0}, v {:.0} mm, along {:.0} deg from u towards v",
            mm(at[0]),
            mm(at[1]),
            direction.to_degrees()
        )],
        Step::Done => vec!["enough: every template is within its limit".to_owned()],
        Step::Cannot { reason } => vec![format!("cannot advise: {}", reason.texts().of(Language::En))],
    };
    if let Some([few, many]) = advice.strokes_left.filter(|left| left[1] > 0) {
        words.push(format!("{few} to {many} strokes left"));
    }
    words.extend(advice.says.iter().map(|says| says.en.clone()));
    words.extend(advice.model.as_ref().map(|model| {
        format!(
            "learned from {} like plates and {} strokes of this one: offset {:.2} mm, slope {:.1} mm/rad; the ram repeats to {:.2} mm",
            model.like_plates,
            model.strokes_learned,
            mm(model.offset),
            mm(model.slope),
            mm(model.ram_sigma)
        )
    }));
    words
}

fn bend(what: &str, next: &NextBend) -> Vec<String> {
    let [[u1, v1], [u2, v2]] = next.line.map(|at| at.map(mm));
    let line = format!(
        "{what} along the line from u {u1:.0}, v {v1:.0} to u {u2:.0}, v {v2:.0} mm: {:.2} deg ({:.2} to {:.2})",
        next.angle.to_degrees(),
        next.angle_95[0].to_degrees(),
        next.angle_95[1].to_degrees()
    );
    let depth = next.depth.map(|depth| {
        let most =
            next.depth_not_beyond.map_or_else(String::new, |most| format!(", not beyond {:.1} mm", mm(most)));
        format!("depth {:.1} mm{most}", mm(depth))
    });
    let [low, gap, high] = next.gap_after.map(mm);
    let then = format!(
        "then {gap:.1} mm open under {} ({low:.1} to {high:.1}), limit {:.1} mm",
        next.template,
        mm(next.limit)
    );
    [Some(line), depth, Some(then)].into_iter().flatten().collect()
}

/// Returns the path of the advice beside a result document.
fn path_beside(document: &Path) -> PathBuf {
    document.with_file_name(ADVICE_FILE)
}
