//! Reference lines and the boards that lie on them.

use serde::Serialize;

use platen_plant::PlateFile;
use platen_shape::evaluate;
use platen_shape::measure::Measurement;
use platen_shape::task::{Seat, TemplateFinding, Verdict};

use super::{mm, mm_pair};
use crate::plugin::Report;

/// One reference line.
#[derive(Debug, Clone, Serialize)]
pub struct LineRecord {
    /// Name.
    pub name: String,
    /// Every 50 mm.
    pub points: Vec<PointRecord>,
    /// Boards on it.
    pub templates: Vec<TemplateRecord>,
}

/// One point of a line.
#[derive(Debug, Clone, Serialize)]
pub struct PointRecord {
    /// Along u.
    pub u_mm: f64,
    /// Along v.
    pub v_mm: f64,
    /// On the scanned face, scanner frame.
    pub position_m: [f64; 3],
    /// False where the surface was bridged.
    pub seen: bool,
}

/// How one board lies.
#[derive(Debug, Clone, Serialize)]
pub struct TemplateRecord {
    /// Name.
    pub name: String,
    /// Seat that was judged.
    pub seat: Seat,
    /// The board rocks.
    pub rocks: bool,
    /// Largest gap.
    pub max_gap_mm: f64,
    /// Expanded (95 %).
    pub uncertainty_mm: f64,
    /// Where it is.
    pub max_gap_at_mm: [f64; 2],
    /// Where the board touches.
    pub contacts_mm: Vec<[f64; 2]>,
    /// At equal steps from the board's first end to its last.
    pub gap_mm: Vec<f64>,
    /// Largest gap that passes.
    pub limit_mm: f64,
    /// -1 not bent enough, 0 within, 1 bent too far.
    pub sense: i8,
    /// Judgement.
    pub verdict: Verdict,
    /// Sentence for the operator.
    pub says: String,
}

pub(super) fn record(measurement: &Measurement, plate: &PlateFile, reports: &[&Report]) -> Vec<LineRecord> {
    let line = |line: &platen_plant::plate::ReferenceLine| {
        let places =
            evaluate::reference_line(&measurement.surface, &measurement.location, line.from, line.to);
        let templates = reports.iter().flat_map(|report| &report.findings.templates);
        LineRecord {
            name: line.name.clone(),
            points: places
                .iter()
                .map(|p| PointRecord {
                    u_mm: mm(p.u),
                    v_mm: mm(p.v),
                    position_m: p.position.into(),
                    seen: p.seen,
                })
                .collect(),
            templates: templates.filter(|t| t.line == line.name).map(template).collect(),
        }
    };
    plate.reference_lines.iter().map(line).collect()
}

fn template(finding: &TemplateFinding) -> TemplateRecord {
    TemplateRecord {
        name: finding.name.clone(),
        seat: finding.seat,
        rocks: finding.rocks,
        max_gap_mm: mm(finding.max_gap),
        uncertainty_mm: mm(finding.uncertainty),
        max_gap_at_mm: mm_pair(finding.max_gap_at),
        contacts_mm: finding.contacts.iter().map(|contact| mm_pair(contact.at)).collect(),
        gap_mm: finding.gap.iter().copied().map(mm).collect(),
        limit_mm: mm(finding.limit),
        sense: finding.sense,
        verdict: finding.verdict,
        says: finding.says.clone(),
    }
}
