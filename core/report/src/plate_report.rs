//! Report of one plate: one HTML file that prints on A4, with every stroke, its pictures and its uncertainties.
//!
//! It is made from the recorded documents and the pictures beside them, without scripts and links, so that the file
//! alone can be sent and archived. "Not measured" and "cannot tell" are written out, never left blank. Every text that
//! comes from a person or a press is escaped.

use std::path::{Path, PathBuf};

use maud::{DOCTYPE, Markup, PreEscaped, html};

use platen_history::{Archive, Error as HistoryError, Filter, PlateRecord, Stroke};
use platen_model::Verdict;

use crate::advice::{self, AdviceRecord};
use crate::history_view;
use crate::output_folder::{self, FilesError};
use crate::picture::{self, Caption, StripPoint, View};
use crate::result::{CalibrationRecord, ResultRecord};

const STYLE: &str = include_str!("plate_report/style.css");

/// Failure to make a report.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// Unreadable history.
    #[error(transparent)]
    History(#[from] HistoryError),
    /// Plate without strokes.
    #[error("no stroke of plate {0} is on record; `platen history list` shows the plates")]
    NoStrokes(u32),
    /// Unwritable file.
    #[error(transparent)]
    Files(#[from] FilesError),
}

struct Entry<'a> {
    stroke: &'a Stroke,
    /// Result document, or the reason why there is none.
    document: Result<ResultRecord, String>,
    point: StripPoint,
}

/// Writes the report of a plate as `plate-N.html` into `folder`.
///
/// # Errors
/// [`ReportError`].
pub fn write(archive: &Archive, plant: &str, plate: u32, folder: &Path) -> Result<PathBuf, ReportError> {
    let text = report(archive, plant, plate)?;
    Ok(output_folder::put(folder, &format!("plate-{plate}.html"), text.as_bytes())?)
}

/// Returns the report of a plate of the history as HTML.
///
/// # Errors
/// [`ReportError`].
pub fn report(archive: &Archive, plant: &str, plate: u32) -> Result<String, ReportError> {
    let strokes = archive.strokes(&Filter { plate: Some(plate), ..Filter::default() })?;
    let entries: Vec<Entry<'_>> = strokes.iter().map(Entry::of).collect();
    let Some(last) = entries.last() else { return Err(ReportError::NoStrokes(plate)) };
    let plate_record = archive.plates()?.into_iter().find(|record| record.plate == plate);
    let newest =
        entries.iter().rev().find_map(|entry| entry.document.as_ref().ok().map(|record| (entry, record)));
    let name = newest.map_or_else(|| format!("plate {plate}"), |(_, record)| record.plate.clone());
    let markup = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width";
                title { "Plate " (name) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                header {
                    div {
                        h1 { "Plate " (name) }
                        p { (part(plate_record.as_ref())) }
                        p.quiet { (plant) ", after stroke " (last.point.label) ", " (time(last.stroke)) }
                    }
                    (chip(last.point.verdict))
                }
                @match newest {
                    Some((entry, record)) => { (summary(&entries, entry, record)) }
                    None => { p.warning { "Not measured: no stroke of this plate has a result." } }
                }
                h2 { "Strokes" }
                (table(&entries))
                @if let Some((_, record)) = newest { h2 { "Shape checks after the last measured stroke" } (checks(record)) }
                h2 { "Every stroke" }
                @for entry in &entries { (stroke(entry)) }
                (footer(newest.map(|(_, record)| record)))
            }
        }
    };
    Ok(markup.into_string())
}

impl<'a> Entry<'a> {
    fn of(stroke: &'a Stroke) -> Self {
        let missing = || stroke.reason.clone().unwrap_or_else(|| "no document is on record".to_owned());
        let document = stroke.document.as_deref().ok_or_else(missing).and_then(|path| {
            let text = std::fs::read(path).map_err(|e| format!("{}: {e}", path.display()))?;
            serde_json::from_slice::<ResultRecord>(&text).map_err(|e| format!("{}: {e}", path.display()))
        });
        let mut point = history_view::of_stroke(stroke);
        if let Ok(record) = &document {
            // The host writes the report before the press's acknowledge is in the history.
            point = history_view::of_record(stroke, record);
        }
        Self { stroke, document, point }
    }

    /// Returns the advice after the stroke as sentences, if it was shown.
    fn advice(&self) -> Option<Vec<String>> {
        let record = AdviceRecord::beside(self.stroke.document.as_deref()?).ok()??;
        // The host writes the report before the advice, so an existing file may be from an earlier host.
        let shown = record.show != "shadow" && record.run_id == self.stroke.run_id;
        record.advice.filter(|_| shown).map(|advice| advice::words(&advice))
    }

    /// Returns a picture from the folder of the document.
    fn picture(&self, name: &str) -> Option<Markup> {
        let path = self
            .stroke
            .document
            .as_deref()?
            .with_file_name(format!("{}.svg", output_folder::file_name(name)));
        let svg = std::fs::read_to_string(path).ok().filter(|svg| svg.starts_with("<svg"))?;
        Some(PreEscaped(svg))
    }

    /// Returns the map of the remaining deviation: of curvature if it was compared, else of height.
    fn remaining(&self) -> Option<Markup> {
        self.picture("curvature_deficit").or_else(|| self.picture("deviation"))
    }

    /// Returns the map of the stroke's change.
    fn change(&self) -> Option<Markup> {
        self.picture("curvature_change").or_else(|| self.picture("displacement_normal"))
    }

    fn worst_section(&self) -> Option<Markup> {
        let template = history_view::worst_template(self.document.as_ref().ok()?)?;
        self.picture(&format!("section-{}", template.name))
    }
}

fn chip(verdict: Verdict) -> Markup {
    let words = verdict.words();
    html! { span class={ "verdict " (words.replace(' ', "_")) } { (words.to_uppercase()) } }
}

fn part(record: Option<&PlateRecord>) -> String {
    let Some(record) = record else { return String::new() };
    let part = record.part_id.map(|id| format!("part {id}, ")).unwrap_or_default();
    let name = record.part_name.as_ref().map(|name| format!("{name}, ")).unwrap_or_default();
    format!("{part}{name}number {} of this history, press {}", record.plate, record.press)
}

/// Formats the time of a stroke in UTC, to the second.
fn time(stroke: &Stroke) -> String {
    stroke.accepted.strftime("%F %T UTC").to_string()
}

fn summary(entries: &[Entry<'_>], entry: &Entry<'_>, record: &ResultRecord) -> Markup {
    let plate = &record.plate_file;
    let caption = Caption { plate: &record.plate, stroke: record.stroke, verdict: record.verdict };
    let points: Vec<StripPoint> = entries.iter().map(|entry| entry.point.clone()).collect();
    let strip = picture::strip(&points, &caption, &plate.scale, View::FILE).ok().map(PreEscaped);
    let templates: Vec<String> = record
        .reference_lines
        .iter()
        .flat_map(|line| line.templates.iter().map(move |template| (line, template)))
        .map(|(line, t)| {
            format!(
                "{} on line {}: {:.0} mm, gap at most {:.1} mm",
                t.name, line.name, t.chord_mm, t.limit_mm
            )
        })
        .collect();
    html! {
        @if record.scan.simulated { p.warning { "Simulated scan: no real plate was measured." } }
        @for sentence in record.says.iter().take(2) { p.says { (sentence) } }
        @if let Some(next) = &record.next { p.says { (next.says()) } }
        dl {
            dt { "Size" } dd { (format!("{:.0} \u{d7} {:.0} \u{d7} {:.0} mm", plate.width_mm, plate.height_mm, plate.thickness_mm)) }
            dt { "Target" } dd { (plate.target.as_deref().unwrap_or("none: nothing can be judged")) }
            dt { "Templates" } dd { @if templates.is_empty() { "none: nothing can be judged" } @for template in &templates { div { (template) } } }
            @if let Some(outline) = &record.outline { dt { "Outline" } dd { (outline.words()) } }
            dt { "Rests on" } dd { (record.supports.as_deref().unwrap_or("not recorded")) }
            dt { "Scanner" } dd {
                (record.scan.instrument) (format!("; {:.0} % of the plate seen", record.quality.coverage * 100.0))
                (format!(", a sample every {:.1} mm, noise {:.2} mm", record.quality.lattice_step_mm, record.quality.noise_mm))
            }
            dt { "Calibration" } dd { (calibration(&record.calibration)) }
            @if let Some(advice) = entry.advice() { dt { "Advice for the next stroke" } dd { @for words in &advice { div { (words) } } } }
            dt { "Software" } dd { (record.software) ", " (record.schema) }
        }
        div.pictures {
            @if let Some(map) = entry.remaining() { figure.wide { (map) } } @else { p { "The map of this stroke is missing." } }
            @if let Some(section) = entry.worst_section() { figure { (section) } }
            @if let Some(strip) = strip { figure { (strip) } }
        }
    }
}

fn calibration(state: &CalibrationRecord) -> String {
    let null_pairs = match (&state.assumption, state.sigma_correlated_mm) {
        (Some(assumption), sigma) => {
            return format!(
                "{assumption}; it stands for {sigma:.2} mm between two scans in levels of detection, templates and stations"
            );
        }
        (None, 0.0) => "no null pairs scanned: changes may be called real a little too often".to_owned(),
        (None, sigma) => format!("correlated error {sigma:.2} mm (one sigma, from null pairs)"),
    };
    let artefact = match state.sigma_true_mm {
        None => {
            "not calibrated on an artefact: uncertainties do not include the scanner's own bias".to_owned()
        }
        Some(sigma) => format!("bias against an artefact {sigma:.2} mm (one sigma)"),
    };
    format!("{null_pairs}; {artefact}")
}

fn table(entries: &[Entry<'_>]) -> Markup {
    html! {
        table {
            thead { tr {
                th { "stroke" } th { "time" } th { "verdict" } th.n { "worst gap, mm" } th.n { "at u, v, mm" }
                th.n { "seen" } th { "finding" }
            } }
            @for entry in entries { tr {
                td { (entry.point.label) }
                td.t { (entry.stroke.accepted.strftime("%m-%d %H:%M").to_string()) }
                td { (chip(entry.point.verdict)) }
                td.n { (gap(&entry.point)) }
                @match &entry.document {
                    Ok(record) => {
                        td.n { (worst_place(record)) }
                        td.n { (format!("{:.0} %", record.quality.coverage * 100.0)) }
                        td { (record.says.first().map_or("", String::as_str)) }
                    }
                    Err(why) => { td.n { "\u{2013}" } td.n { "\u{2013}" } td { (why) } }
                }
            } }
        }
        p.quiet { "\u{b1}: expanded uncertainty, 95 %. A gap passes or fails a limit only by more than its uncertainty; otherwise the verdict is \u{201c}cannot tell\u{201d}." }
    }
}

fn gap(point: &StripPoint) -> String {
    match point.gap_mm {
        Some(gap) => picture::Units::Millimetre.with_uncertainty(gap, point.uncertainty_mm),
        None => "not measured".to_owned(),
    }
}

fn worst_place(record: &ResultRecord) -> String {
    history_view::worst_template(record).map_or_else(
        || "\u{2013}".to_owned(),
        |template| format!("{:.0}, {:.0}", template.max_gap_at_mm[0], template.max_gap_at_mm[1]),
    )
}

fn checks(record: &ResultRecord) -> Markup {
    let rows = record.shape_checks.rows();
    let half = rows.len().div_ceil(2);
    html! {
        div.columns {
            @for rows in rows.chunks(half) {
                table {
                    thead { tr { th { "check" } th.n { "value" } th.n { "\u{b1}" } th { "" } } }
                    @for (name, check, unit) in rows {
                        @let digits = if *unit == "mm" { 1 } else { 3 };
                        tr {
                            td { (name) @if !check.seen { " (corner not seen)" } }
                            td.n { (format!("{:.digits$}", check.value)) }
                            td.n { (format!("{:.digits$}", check.uncertainty)) }
                            td { (if *unit == "deg" { "\u{b0}" } else { unit }) }
                        }
                    }
                }
            }
        }
    }
}

fn stroke(entry: &Entry<'_>) -> Markup {
    html! {
        section.stroke {
            h3 {
                "Stroke " (entry.point.label) (chip(entry.point.verdict))
                span.quiet { (time(entry.stroke)) ", run " (entry.stroke.run_id) }
            }
            @match &entry.document {
                Ok(record) => {
                    @for sentence in &record.says { p { (sentence) } }
                    div.pictures {
                        @for picture in [entry.remaining(), entry.change(), entry.worst_section()].into_iter().flatten() {
                            figure { (picture) }
                        }
                    }
                }
                Err(why) => { p.says { "Not measured: " (why) } }
            }
        }
    }
}

fn footer(record: Option<&ResultRecord>) -> Markup {
    html! {
        footer {
            p {
                "Positions (u, v) are those of the plate's mid-surface, from the marked corner (0, 0). Colours and heights have the same scale in every "
                "picture of this plate: steps of 1, 2, 5, 10, 20 and 50 times the smallest limit of its templates"
                @if let Some(record) = record { (format!(" ({:.1} mm)", record.plate_file.scale.limit_mm)) }
                ". Gray areas are below the level of detection, hatched areas were not seen. Measured by "
                (concat!("platen ", env!("CARGO_PKG_VERSION"))) ", which only measures: it neither starts nor releases motion."
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use platen_history::{Accepted, Finished, History};
    use platen_model::StrokeKey;

    use super::*;

    /// Returns a history of one plate with these strokes, none of them with a document.
    fn archive(folder: &Path, verdicts: &[Option<Verdict>], name: &str) -> Archive {
        let path = folder.join("history.sqlite");
        let now = jiff::Timestamp::UNIX_EPOCH;
        let mut history = History::open(&path, 1, now).unwrap();
        for (number, verdict) in (1..).zip(verdicts) {
            let key = StrokeKey { press: 1, session: 1, stroke: number, attempt: 0 };
            let run_id = u32::from(number);
            let accepted = Accepted {
                key,
                run_id,
                part_id: Some(7),
                part_name: Some(name.to_owned()),
                recipe: None,
                baseline: false,
                dry_run: false,
                data: "{}".into(),
            };
            history.accept(&accepted, now).unwrap();
            let Some(verdict) = *verdict else { continue };
            let finished = Finished {
                key,
                run_id,
                seq: number,
                verdict,
                reason: Some(format!("302: <{name}>")),
                figures: Default::default(),
                publication: "{}".into(),
            };
            history.finish(&finished, now).unwrap();
        }
        drop(history);
        Archive::open(&path).unwrap()
    }

    #[test]
    fn a_stroke_without_result_is_called_not_measured() {
        let folder = tempfile::tempdir().unwrap();
        let archive = archive(folder.path(), &[Some(Verdict::NotMeasured), None], "C9");
        let text = report(&archive, "North hall", 1).unwrap();
        assert!(text.contains("Not measured: no stroke of this plate has a result."));
        assert_eq!(text.matches("class=\"verdict not_measured\"").count(), 1 + 2 + 2, "head, table, strokes");
        assert!(!text.contains(">PASS<") && !text.contains("0.0 \u{b1}"));
    }

    #[test]
    fn texts_of_people_and_presses_are_escaped() {
        let folder = tempfile::tempdir().unwrap();
        let evil = "<script>alert(1)</script>";
        let archive = archive(folder.path(), &[Some(Verdict::NotMeasured)], evil);
        let text = report(&archive, evil, 1).unwrap();
        assert!(!text.contains("<script"), "{text}");
        assert!(text.contains("&lt;script&gt;"));
    }

    #[test]
    fn a_plate_without_strokes_has_no_report() {
        let folder = tempfile::tempdir().unwrap();
        let archive = archive(folder.path(), &[None], "C9");
        let error = report(&archive, "North hall", 4).unwrap_err();
        assert_eq!(
            error.to_string(),
            "no stroke of plate 4 is on record; `platen history list` shows the plates"
        );
    }

    #[test]
    fn the_report_stands_alone() {
        let folder = tempfile::tempdir().unwrap();
        let archive = archive(folder.path(), &[Some(Verdict::NotMeasured)], "C9");
        let path = write(&archive, "North hall", 1, folder.path()).unwrap();
        assert_eq!(path.file_name().unwrap(), "plate-1.html");
        let text = std::fs::read_to_string(path).unwrap();
        for link in ["http:", "https:", "src=", "<link", "@import", "url("] {
            assert!(!text.contains(link), "{link}");
        }
    }
}
