//! What the history holds of a plate's strokes, as pictures and reports want it.

use std::path::Path;

use platen_history::{Archive, Error, Filter, Stroke};
use platen_model::Verdict;
use platen_plant::PlateFile;
use platen_shape::Blank;

use crate::picture::StripPoint;
use crate::result::{OutlineRecord, ResultRecord, TemplateRecord};
use platen_model::units::mm;

/// The strokes of a run's plate up to this one, oldest first; this one from its record, since the history may not have it yet.
///
/// # Errors
/// The history's.
pub fn strokes_until(
    archive: &Archive,
    run_id: u32,
    record: &ResultRecord,
) -> Result<Vec<StripPoint>, Error> {
    let this = archive.stroke(run_id)?;
    let all = archive.strokes(&Filter { plate: Some(this.plate), ..Filter::default() })?;
    let earlier = all.iter().filter(|stroke| stroke.run_id < run_id).map(of_stroke);
    Ok(earlier.chain([of_record(&this, record)]).collect())
}

/// What stands below a stroke in the strip and in tables.
pub fn label(stroke: &Stroke) -> String {
    let number = if stroke.baseline { "blank".to_owned() } else { stroke.key.stroke.to_string() };
    let again = if stroke.key.attempt > 0 { format!(".{}", stroke.key.attempt) } else { String::new() };
    let trial = if stroke.dry_run { " trial" } else { "" };
    format!("{number}{again}{trial}")
}

/// A stroke of the strip, from its figures on record.
pub fn of_stroke(stroke: &Stroke) -> StripPoint {
    let figure = |name: &str| stroke.figures.get(name).copied();
    StripPoint {
        label: label(stroke),
        gap_mm: figure("gap.max").map(mm),
        uncertainty_mm: figure("gap.uncertainty").map(mm),
        sense: figure("sense").map_or(0, |sense| sense.clamp(-1.0, 1.0).round() as i8),
        verdict: verdict(stroke),
    }
}

/// The judgement on record; none is no measurement.
pub fn verdict(stroke: &Stroke) -> Verdict {
    use platen_model::Verdict as Kept;
    match stroke.verdict {
        Some(Kept::Pass) => Verdict::Pass,
        Some(Kept::Fail) => Verdict::Fail,
        Some(Kept::CannotTell) => Verdict::CannotTell,
        Some(Kept::NotMeasured) | None => Verdict::NotMeasured,
    }
}

/// A stroke of the strip, from its document.
pub fn of_record(stroke: &Stroke, record: &ResultRecord) -> StripPoint {
    let worst = worst_board(record);
    StripPoint {
        label: label(stroke),
        gap_mm: worst.map(|board| board.max_gap_mm),
        uncertainty_mm: worst.map(|board| board.uncertainty_mm),
        sense: worst.map_or(0, |board| board.sense),
        verdict: record.verdict,
    }
}

/// The board with the most gap per limit, as in the press's registers.
pub fn worst_board(record: &ResultRecord) -> Option<&TemplateRecord> {
    let share = |board: &TemplateRecord| board.max_gap_mm.abs() / board.limit_mm.max(f64::MIN_POSITIVE);
    let boards = record.reference_lines.iter().flat_map(|line| &line.templates);
    boards.max_by(|a, b| share(a).total_cmp(&share(b)))
}

/// What a result document has of a plate for its later strokes.
#[derive(Debug, Default, serde::Deserialize)]
pub struct Kept {
    /// Where the plate rested.
    pub supports: Option<String>,
    outline: Option<OutlineRecord>,
}

impl Kept {
    /// The outline of the blank that its (u, v) refer to, where a scan of it told one.
    pub fn blank(&self) -> Option<Blank> {
        self.outline.as_ref().and_then(OutlineRecord::blank)
    }
}

/// Reads that of a document; nothing is known from one that cannot be read.
pub fn kept(document: &Path) -> Kept {
    let text = std::fs::read(document).unwrap_or_default();
    serde_json::from_slice(&text).unwrap_or_default()
}

/// Whether the plate rests on other supports than it did `before`; what is not known is not called a change.
pub fn moved(before: Option<&str>, plate: &PlateFile) -> bool {
    before.zip(plate.plate.supports.as_deref()).is_some_and(|(before, now)| before != now)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plate_on_other_supports_is_flagged_and_only_then() {
        let plate = |supports: &str| {
            let text = format!(
                "[plate]\nid = \"A\"\nwidth_mm = 3000.0\nheight_mm = 2000.0\nthickness_mm = 30.0\n{supports}"
            );
            PlateFile::parse("plate.toml", &text).unwrap()
        };
        let trestles = plate("supports = \"trestles\"");
        assert!(moved(Some("bed"), &trestles));
        assert!(!moved(Some("trestles"), &trestles));
        assert!(!moved(None, &trestles) && !moved(Some("bed"), &plate("")));
    }

    #[test]
    fn supports_and_blank_are_read_from_the_document_and_nothing_from_one_that_is_gone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("result.json");
        std::fs::write(&path, r#"{"schema": "platen.result/1", "supports": "bed", "grid": [1, 2]}"#).unwrap();
        assert_eq!(kept(&path).supports.as_deref(), Some("bed"));
        assert!(kept(&path).blank().is_none());
        let gone = kept(&folder.path().join("gone.json"));
        assert!(gone.supports.is_none() && gone.blank().is_none());
    }
}
