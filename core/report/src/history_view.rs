//! Conversion of recorded strokes for pictures and reports: labels, points of the strip, worst template, earlier
//! documents.

use std::path::Path;

use platen_history::{Archive, Error, Filter, Stroke};
use platen_model::Verdict;
use platen_model::units::{metres, mm};
use platen_plant::PlateFile;
use platen_shape::Blank;

use crate::picture::StripPoint;
use crate::result::{OutlineRecord, ResultRecord, TemplateRecord};

/// Returns the strokes of a run's plate up to this one, oldest first. This one is taken from its record, since the
/// history may not contain it yet.
///
/// # Errors
/// The history cannot be read.
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

/// Returns the label of a stroke in the strip and in tables: number or `blank`, attempt, `trial`.
pub fn label(stroke: &Stroke) -> String {
    let number = if stroke.baseline { "blank".to_owned() } else { stroke.key.stroke.to_string() };
    let again = if stroke.key.attempt > 0 { format!(".{}", stroke.key.attempt) } else { String::new() };
    let trial = if stroke.dry_run { " trial" } else { "" };
    format!("{number}{again}{trial}")
}

/// Returns a stroke as a point of the strip, from its recorded figures.
pub fn of_stroke(stroke: &Stroke) -> StripPoint {
    let figure = |name: &str| stroke.figures.get(name).copied();
    StripPoint {
        label: label(stroke),
        gap_mm: figure("gap.max").map(mm),
        uncertainty_mm: figure("gap.uncertainty").map(mm),
        sense: figure("sense").map_or(0, |sense| sense.clamp(-1.0, 1.0).round() as i8),
        verdict: stroke.verdict.unwrap_or(Verdict::NotMeasured),
    }
}

/// Returns a stroke as a point of the strip, from its document.
pub fn of_record(stroke: &Stroke, record: &ResultRecord) -> StripPoint {
    let worst = worst_template(record);
    StripPoint {
        label: label(stroke),
        gap_mm: worst.map(|template| template.max_gap_mm),
        uncertainty_mm: worst.map(|template| template.uncertainty_mm),
        sense: worst.map_or(0, |template| template.sense),
        verdict: record.verdict,
    }
}

/// Returns the template with the largest gap per limit, as in the press's registers.
pub fn worst_template(record: &ResultRecord) -> Option<&TemplateRecord> {
    let share = |t: &TemplateRecord| t.max_gap_mm.abs() / t.limit_mm.max(f64::MIN_POSITIVE);
    let templates = record.reference_lines.iter().flat_map(|line| &line.templates);
    templates.max_by(|a, b| share(a).total_cmp(&share(b)))
}

/// Part of a result document that later strokes of the plate use.
#[derive(Debug, Default, serde::Deserialize)]
pub struct EarlierDocument {
    /// Supports of the plate.
    pub supports: Option<String>,
    outline: Option<OutlineRecord>,
    #[serde(default)]
    scan: EarlierScan,
}

#[derive(Debug, Default, serde::Deserialize)]
struct EarlierScan {
    range_error_mm: Option<f64>,
}

impl EarlierDocument {
    /// Returns the range error that the driver stated, one sigma, metres.
    pub fn range_error(&self) -> Option<f64> {
        self.scan.range_error_mm.map(metres)
    }

    /// Returns the outline of the blank to which (u, v) refer, where a scan of the blank gave one.
    pub fn blank(&self) -> Option<Blank> {
        self.outline.as_ref().and_then(OutlineRecord::blank)
    }
}

/// Reads an earlier document; an unreadable one gives an empty record.
pub fn read_document(document: &Path) -> EarlierDocument {
    let text = std::fs::read(document).unwrap_or_default();
    serde_json::from_slice(&text).unwrap_or_default()
}

/// Returns whether the plate rests on other supports than `before`; false where either is unknown.
pub fn supports_changed(before: Option<&str>, plate: &PlateFile) -> bool {
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
        assert!(supports_changed(Some("bed"), &trestles));
        assert!(!supports_changed(Some("trestles"), &trestles));
        assert!(!supports_changed(None, &trestles) && !supports_changed(Some("bed"), &plate("")));
    }

    #[test]
    fn supports_and_blank_are_read_from_the_document_and_nothing_from_one_that_is_gone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("result.json");
        std::fs::write(&path, r#"{"schema": "platen.result/1", "supports": "bed", "grid": [1, 2]}"#).unwrap();
        assert_eq!(read_document(&path).supports.as_deref(), Some("bed"));
        assert!(read_document(&path).blank().is_none());
        let missing = read_document(&folder.path().join("gone.json"));
        assert!(missing.supports.is_none() && missing.blank().is_none());
    }
}
