//! Reference lines of the result document, and the templates on them.

use serde::{Deserialize, Serialize};

use platen_model::units::{mm, mm_pair};
use platen_model::{Report, Seat, TemplateFinding, Verdict};
use platen_plant::PlateFile;
use platen_shape::Surface;
use platen_shape::evaluate;
use platen_shape::measure::Measurement;

/// Reference line.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct LineRecord {
    /// Name.
    pub name: String,
    /// Points every 50 mm.
    pub points: Vec<PointRecord>,
    /// Templates on it.
    pub templates: Vec<TemplateRecord>,
}

/// Point of a reference line.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct PointRecord {
    /// Along u.
    pub u_mm: f64,
    /// Along v.
    pub v_mm: f64,
    /// On the scanned face, scanner frame.
    pub position_m: [f64; 3],
    /// False where the surface is interpolated across unseen area.
    pub seen: bool,
}

/// Template laid on a reference line.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct TemplateRecord {
    /// Name.
    pub name: String,
    /// Seat of the verdict.
    pub seat: Seat,
    /// Whether the template rocks.
    pub rocks: bool,
    /// Largest gap.
    pub max_gap_mm: f64,
    /// Its expanded uncertainty (95 %).
    pub uncertainty_mm: f64,
    /// Its place (u, v).
    pub max_gap_at_mm: [f64; 2],
    /// Places (u, v) of contact.
    pub contacts_mm: Vec<[f64; 2]>,
    /// Position of the template's first end along the line.
    pub start_mm: f64,
    /// Chord of the template.
    pub chord_mm: f64,
    /// Gaps at equal steps from the template's first end to its last.
    pub gap_mm: Vec<f64>,
    /// Height of the face at these steps above the chord between the template's end points on the face, towards the
    /// scanner.
    pub height_mm: Vec<f64>,
    /// Whether the plate was seen at these steps.
    pub seen: Vec<bool>,
    /// Largest gap that passes.
    pub limit_mm: f64,
    /// -1 not bent enough, 0 within, 1 bent too far.
    pub sense: i8,
    /// Verdict of the template.
    pub verdict: Verdict,
    /// Sentence for the operator.
    pub says: String,
}

pub(super) fn record(measurement: &Measurement, plate: &PlateFile, reports: &[&Report]) -> Vec<LineRecord> {
    let point = |p: &evaluate::Place| PointRecord {
        u_mm: mm(p.u),
        v_mm: mm(p.v),
        position_m: p.position.into(),
        seen: p.seen,
    };
    let line = |line: &platen_model::ReferenceLine| {
        let places =
            evaluate::reference_line(&measurement.surface, &measurement.location, line.from, line.to);
        let templates = reports.iter().flat_map(|report| &report.findings.templates);
        LineRecord {
            name: line.name.clone(),
            points: places.iter().map(point).collect(),
            templates: templates
                .filter(|t| t.line == line.name)
                .map(|t| template(t, line, plate, &measurement.surface))
                .collect(),
        }
    };
    plate.reference_lines.iter().map(line).collect()
}

fn template(
    finding: &TemplateFinding,
    line: &platen_model::ReferenceLine,
    plate: &PlateFile,
    surface: &Surface,
) -> TemplateRecord {
    let chord = plate.templates.iter().find(|t| t.name == finding.name).map_or(0.0, |t| t.chord);
    let places = places(finding, line, chord);
    TemplateRecord {
        name: finding.name.clone(),
        seat: finding.seat,
        rocks: finding.rocks,
        max_gap_mm: mm(finding.max_gap),
        uncertainty_mm: mm(finding.uncertainty),
        max_gap_at_mm: mm_pair(finding.max_gap_at),
        contacts_mm: finding.contacts.iter().map(|contact| mm_pair(contact.at)).collect(),
        start_mm: mm(finding.start),
        chord_mm: mm(chord),
        gap_mm: finding.gap.iter().copied().map(mm).collect(),
        height_mm: heights(surface, &places),
        seen: places.iter().map(|[u, v]| surface.mask().seen(*u, *v)).collect(),
        limit_mm: mm(finding.limit),
        sense: finding.sense,
        verdict: finding.verdict,
        says: finding.says.clone(),
    }
}

/// Returns the places (u, v) of a template's gaps.
fn places(finding: &TemplateFinding, line: &platen_model::ReferenceLine, chord: f64) -> Vec<[f64; 2]> {
    let length = line.length();
    let last = finding.gap.len().saturating_sub(1).max(1) as f64;
    let at = |k: usize| (finding.start + chord * k as f64 / last) / length;
    let on_line = |share: f64| [0, 1].map(|i| line.from[i] + share * (line.to[i] - line.from[i]));
    (0..finding.gap.len()).map(|k| on_line(at(k))).collect()
}

/// Returns the heights of the face above the straight line from the first point to the last, millimetres.
fn heights(surface: &Surface, places: &[[f64; 2]]) -> Vec<f64> {
    let [Some(first), Some(last), Some(middle)] =
        [places.first(), places.last(), places.get(places.len() / 2)]
    else {
        return Vec::new();
    };
    let face = |[u, v]: &[f64; 2]| surface.face(*u, *v);
    let chord = face(last) - face(first);
    if chord.norm() == 0.0 {
        return Vec::new();
    }
    let along = chord.normalize();
    let normal = surface.normal(middle[0], middle[1]);
    let up = (normal - along * normal.dot(&along)).normalize();
    places.iter().map(|place| mm((face(place) - face(first)).dot(&up))).collect()
}
