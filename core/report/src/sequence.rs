//! Bending sequence of a plate as figures for the comparison of crews: order and place of bends, overshoot, re-hits,
//! energy left.
//!
//! | figure | definition |
//! |---|---|
//! | bend: place, angle, direction, length, width | comparison `curvature` between the surfaces of two strokes in a row; significant bands only |
//! | feed | distance from the previous bend, across this one's straight lines |
//! | re-hit | a bend that lies on an earlier one: straight lines within 20 degrees, overlapping along, and across them the middle of each within the other's width |
//! | bent back | a bend against the sense of the target |
//! | overshoot | gap under the worst template where its sense is "bent too far", else 0 |
//! | beyond | share of the seen area whose curvature exceeds the target's by more than 8 g / c^2, the equivalent of the limit g of a template of chord c |
//! | energy left | [`platen_shape::BendingEnergy`]: elastic energy from the measured to the target's curvature, and its share of the first stroke's |
//!
//! Force, ram depth and die set are data of the press. Unknown values are null, never 0.

use std::f64::consts::PI;

use jiff::Timestamp;
use serde::Serialize;

use platen_history::{Archive, Error as HistoryError, Filter, Stroke};
use platen_model::units::{mm, mm_pair};
use platen_model::{Figure, Report, Task, Verdict};
use platen_plant::{PlantFile, PlateFile};
use platen_shape::{BendingEnergy, Surface, TargetSurface};

use crate::bend_figures::{BendFigures, bend_figures};
use crate::picture::PictureScale;
use crate::{history_view, output_folder};

/// Failure to evaluate a sequence.
#[derive(Debug, thiserror::Error)]
pub enum SequenceError {
    /// Unreadable history.
    #[error(transparent)]
    History(#[from] HistoryError),
    /// Plate without strokes.
    #[error("no stroke of plate {0} is on record; `platen history list` shows the plates")]
    NoStrokes(u32),
    /// Failed comparison.
    #[error("{0}")]
    Comparison(String),
}

/// Sequence of one plate.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Sequence {
    /// Its number in the history.
    pub plate: u32,
    /// Its strokes, oldest first.
    pub strokes: Vec<SequenceStroke>,
    /// Totals of the plate.
    pub summary: Summary,
}

/// Stroke of a sequence.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SequenceStroke {
    /// Run id, the key of its record.
    pub run_id: u32,
    /// Its number, or `blank`.
    pub stroke: String,
    /// Time of the press's request.
    pub accepted: Timestamp,
    /// Verdict.
    pub verdict: Verdict,
    /// Die set.
    pub die_set: Option<u16>,
    /// Largest force.
    pub force_kn: Option<f64>,
    /// Deepest position of the ram.
    pub ram_depth_mm: Option<f64>,
    /// Worst gap under a template.
    pub gap_mm: Option<f64>,
    /// Its expanded uncertainty (95 %).
    pub gap_uncertainty_mm: Option<f64>,
    /// Gap where the template's sense is "bent too far", else 0.
    pub overshoot_mm: Option<f64>,
    /// Bends of the stroke, strongest first; null where it or the previous stroke was not measured.
    pub bends: Option<Vec<Bend>>,
    /// Elastic energy left to the target.
    pub energy_left_j: Option<f64>,
    /// Energy left as a share of that after the first recorded stroke.
    pub energy_left_share: Option<f64>,
    /// Share of the seen area bent beyond the target.
    pub beyond_share: Option<f64>,
}

/// Bend: the band that a stroke has bent.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Bend {
    /// Centre of the band.
    pub at_mm: [f64; 2],
    /// Bend angle across the band, positive towards the scanner.
    pub angle_deg: f64,
    /// Its expanded uncertainty (95 %).
    pub uncertainty_deg: Option<f64>,
    /// Direction of its straight lines, from u towards v.
    pub direction_deg: f64,
    /// Extent along the straight lines.
    pub length_mm: f64,
    /// Extent across the straight lines.
    pub width_mm: f64,
    /// Distance across its straight lines from the strongest bend of the previous stroke.
    pub feed_mm: Option<f64>,
    /// Stroke whose bend it lies on.
    pub rehit_of: Option<String>,
    /// Whether it bends against the target; null without a target or where the target is flat.
    pub bent_back: Option<bool>,
}

/// Totals of a sequence.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// Number of strokes without the blank.
    pub strokes: usize,
    /// Number of strokes not measured.
    pub not_measured: usize,
    /// Number of bends.
    pub bends: usize,
    /// Number of bends on earlier ones.
    pub rehits: usize,
    /// Number of bends against the target.
    pub bent_back: usize,
    /// Number of strokes after which a template was "bent too far".
    pub overshoots: usize,
    /// Largest overshoot.
    pub overshoot_max_mm: Option<f64>,
    /// Mean feed.
    pub feed_mean_mm: Option<f64>,
    /// Energy left after the last stroke, as a share of that after the first recorded one.
    pub energy_left_share: Option<f64>,
    /// Number of strokes until the first pass.
    pub strokes_to_pass: Option<usize>,
    /// Time from the first to the last stroke.
    pub minutes: f64,
    /// Die sets used, in the order of their first use.
    pub die_sets: Vec<u16>,
}

impl Sequence {
    /// Evaluates the sequence of a recorded plate. `curvature` runs the comparison of that name between the surfaces
    /// before and after a stroke; `progress` receives the name of each stroke.
    ///
    /// # Errors
    /// [`SequenceError`].
    pub fn of(
        archive: &Archive,
        plant: &PlantFile,
        plate: u32,
        curvature: &dyn Fn(&Task, &Surface, &Surface) -> Result<Report, String>,
        progress: &dyn Fn(&str),
    ) -> Result<Self, SequenceError> {
        let recorded = archive.strokes(&Filter { plate: Some(plate), ..Filter::default() })?;
        if recorded.is_empty() {
            return Err(SequenceError::NoStrokes(plate));
        }
        let mut before: Option<Surface> = None;
        let mut strokes: Vec<SequenceStroke> = Vec::new();
        for stroke in &recorded {
            progress(&format!("stroke {}", history_view::label(stroke)));
            let file = stroke.recipe.and_then(|recipe| PlateFile::load(&plant.plate_path(recipe)).ok());
            let now =
                stroke.document.as_deref().and_then(|document| output_folder::surface_beside(document).ok());
            let mut row = SequenceStroke::of(stroke);
            if let (Some(now), Some(file)) = (&now, &file) {
                row.add_forming(now, file);
                if let Some(before) = &before {
                    let report = curvature(&file.task(0.0, None, false), before, now);
                    let report = report.map_err(SequenceError::Comparison)?;
                    row.bends = Some(bends(&report.findings.figures, file, &strokes));
                }
            }
            before = now;
            strokes.push(row);
        }
        let first = strokes.iter().find_map(|row| row.energy_left_j).filter(|energy| *energy > 0.0);
        for row in &mut strokes {
            row.energy_left_share = row.energy_left_j.zip(first).map(|(left, first)| left / first);
        }
        Ok(Self { plate, summary: Summary::of(&strokes, &recorded), strokes })
    }
}

impl SequenceStroke {
    fn of(stroke: &Stroke) -> Self {
        let press = stroke.press_data();
        let point = history_view::of_stroke(stroke);
        Self {
            run_id: stroke.run_id,
            stroke: point.label,
            accepted: stroke.accepted,
            verdict: point.verdict,
            die_set: press.die_id,
            force_kn: press.force.map(|newtons| newtons / 1e3),
            ram_depth_mm: press.ram_depth.map(mm),
            gap_mm: point.gap_mm,
            gap_uncertainty_mm: point.uncertainty_mm,
            overshoot_mm: point.gap_mm.map(|gap| if point.sense > 0 { gap.abs() } else { 0.0 }),
            bends: None,
            energy_left_j: None,
            energy_left_share: None,
            beyond_share: None,
        }
    }

    fn add_forming(&mut self, surface: &Surface, file: &PlateFile) {
        let target = target(file);
        let tolerance = PictureScale::of(file).tolerance_per_m();
        let forming = target.and_then(|target| BendingEnergy::new(surface, &target, tolerance));
        self.energy_left_j = forming.map(|forming| forming.energy);
        self.beyond_share = forming.map(|forming| forming.beyond_share);
    }
}

/// Returns the bends of a stroke, the largest first, each with its relation to the bends of earlier strokes.
fn bends(figures: &[Figure], file: &PlateFile, earlier: &[SequenceStroke]) -> Vec<Bend> {
    let last = earlier.iter().rev().find_map(|stroke| stroke.bends.as_ref()?.first());
    let bend = |found: BendFigures| {
        let mut bend = Bend {
            at_mm: mm_pair(found.at),
            angle_deg: found.angle.to_degrees(),
            uncertainty_deg: found.uncertainty.map(f64::to_degrees),
            direction_deg: found.direction.to_degrees(),
            length_mm: mm(found.length?),
            width_mm: mm(found.width?),
            feed_mm: None,
            rehit_of: None,
            bent_back: bent_back(file, found.at, found.direction, found.angle),
        };
        bend.feed_mm = last.map(|last| bend.apart(last.at_mm)[0]);
        bend.rehit_of = earlier
            .iter()
            .find(|stroke| stroke.bends.iter().flatten().any(|other| bend.lies_on(other)))
            .map(|stroke| stroke.stroke.clone());
        Some(bend)
    };
    let mut bends: Vec<Bend> = bend_figures(figures).into_iter().map_while(bend).collect();
    bends.sort_by(|a, b| b.angle_deg.abs().total_cmp(&a.angle_deg.abs()));
    bends
}

fn target(file: &PlateFile) -> Option<TargetSurface> {
    file.target.and_then(|target| TargetSurface::of_plate(&target, &file.plate).ok())
}

/// Returns whether a bend is against the target; `None` where the target is straight across it.
fn bent_back(file: &PlateFile, [u, v]: [f64; 2], direction: f64, angle: f64) -> Option<bool> {
    let target = target(file)?;
    let (sin, cos) = direction.sin_cos();
    let wanted = target.curvature(u, v).along([-sin, cos]);
    // 1e-6 1/m: a radius of a thousand kilometres counts as straight.
    (wanted.abs() > 1e-6).then_some(wanted * angle < 0.0)
}

/// Largest angle between the straight lines of a bend and its re-hit, degrees.
const SAME_DIRECTION_DEG: f64 = 20.0;

impl Bend {
    /// Returns the distances of a place (u, v) from the centre, across and along the straight lines.
    fn apart(&self, place_mm: [f64; 2]) -> [f64; 2] {
        let (sin, cos) = self.direction_deg.to_radians().sin_cos();
        let [du, dv] = [0, 1].map(|k| place_mm[k] - self.at_mm[k]);
        [(cos * dv - sin * du).abs(), (cos * du + sin * dv).abs()]
    }

    /// Returns whether a place (u, v) lies on the band.
    pub fn holds(&self, place_mm: [f64; 2]) -> bool {
        let [across, along] = self.apart(place_mm);
        across <= 0.5 * self.width_mm && along <= 0.5 * self.length_mm
    }

    fn lies_on(&self, other: &Self) -> bool {
        let turn = (self.direction_deg - other.direction_deg).to_radians().rem_euclid(PI);
        let [across, along] = self.apart(other.at_mm);
        turn.min(PI - turn).to_degrees() < SAME_DIRECTION_DEG
            && across < 0.5 * self.width_mm.min(other.width_mm)
            && along < 0.5 * (self.length_mm + other.length_mm)
    }
}

impl Summary {
    fn of(strokes: &[SequenceStroke], recorded: &[Stroke]) -> Self {
        let bends = || strokes.iter().filter_map(|stroke| stroke.bends.as_ref()).flatten();
        let real = strokes.iter().zip(recorded).filter(|(_, stroke)| !stroke.baseline);
        let real: Vec<&SequenceStroke> = real.map(|(stroke, _)| stroke).collect();
        let overshoots: Vec<f64> =
            real.iter().filter_map(|stroke| stroke.overshoot_mm).filter(|mm| *mm > 0.0).collect();
        let feeds: Vec<f64> =
            strokes.iter().filter_map(|stroke| stroke.bends.as_ref()?.first()?.feed_mm).collect();
        let mut die_sets = Vec::new();
        for die in real.iter().filter_map(|stroke| stroke.die_set) {
            if !die_sets.contains(&die) {
                die_sets.push(die);
            }
        }
        let seconds = |row: &SequenceStroke| row.accepted.as_millisecond() as f64 / 1e3;
        let span = strokes.first().zip(strokes.last()).map_or(0.0, |(a, b)| seconds(b) - seconds(a));
        Self {
            strokes: real.len(),
            not_measured: real.iter().filter(|stroke| stroke.verdict == Verdict::NotMeasured).count(),
            bends: bends().count(),
            rehits: bends().filter(|bend| bend.rehit_of.is_some()).count(),
            bent_back: bends().filter(|bend| bend.bent_back == Some(true)).count(),
            overshoots: overshoots.len(),
            overshoot_max_mm: overshoots.into_iter().max_by(f64::total_cmp),
            feed_mean_mm: (!feeds.is_empty()).then(|| feeds.iter().sum::<f64>() / feeds.len() as f64),
            energy_left_share: strokes.iter().rev().find_map(|stroke| stroke.energy_left_share),
            strokes_to_pass: real.iter().position(|stroke| stroke.verdict == Verdict::Pass).map(|k| k + 1),
            minutes: span / 60.0,
            die_sets,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bend(at_mm: [f64; 2], direction_deg: f64) -> Bend {
        Bend {
            at_mm,
            angle_deg: 1.0,
            uncertainty_deg: None,
            direction_deg,
            length_mm: 2000.0,
            width_mm: 100.0,
            feed_mm: None,
            rehit_of: None,
            bent_back: None,
        }
    }

    #[test]
    fn a_rehit_lies_on_an_earlier_bend_in_its_direction() {
        let first = bend([1000.0, 1250.0], 90.0);
        assert!(bend([1045.0, 1250.0], 90.0).lies_on(&first));
        assert!(bend([1000.0, 1250.0], 75.0).lies_on(&first), "a little askew");
        assert!(!bend([1060.0, 1250.0], 90.0).lies_on(&first), "beside it, though they overlap");
        assert!(!bend([1000.0, 1250.0], 60.0).lies_on(&first), "across it");
        assert!(!bend([1000.0, 3300.0], 90.0).lies_on(&first), "beyond its end");
        // 178 and 2 degrees are one direction.
        assert!(bend([1000.0, 1250.0], 178.0).lies_on(&bend([1000.0, 1250.0], 2.0)));
    }

    #[test]
    fn a_place_lies_on_a_bend_within_its_length_and_width() {
        let across = bend([1000.0, 1250.0], 90.0);
        assert!(across.holds([1045.0, 300.0]) && across.holds([960.0, 2200.0]));
        assert!(!across.holds([1055.0, 1250.0]) && !across.holds([1000.0, 2260.0]));
    }

    #[test]
    fn a_feed_is_measured_across_the_bend() {
        let [across, along] = bend([1300.0, 1250.0], 90.0).apart([1000.0, 850.0]);
        assert!((across - 300.0).abs() < 1e-9 && (along - 400.0).abs() < 1e-9);
    }

    fn figure(name: &str, value: f64, at: Option<[f64; 2]>) -> Figure {
        Figure { name: name.into(), value, unit: "m".into(), uncertainty: Some(0.001), at }
    }

    #[test]
    fn bends_are_read_strongest_first_with_their_sense_against_the_target() {
        let text = include_str!("../../../config/plates/plate-009.toml");
        let file = PlateFile::parse("plate-009.toml", text).unwrap();
        let one = |number: usize, angle: f64, u: f64| {
            let name = |part: &str| format!("bend.{number}.{part}");
            [
                figure(&name("angle"), angle, Some([u, 1.25])),
                figure(&name("direction"), std::f64::consts::FRAC_PI_2, None),
                figure(&name("length"), 2.4, None),
                figure(&name("width"), 0.1, None),
            ]
        };
        let found = bends(&[one(1, 0.01, 1.0), one(2, -0.02, 2.0)].concat(), &file, &[]);
        assert_eq!(found.len(), 2);
        assert_eq!((found[0].at_mm, found[0].bent_back), ([2000.0, 1250.0], Some(true)));
        assert_eq!((found[1].at_mm, found[1].bent_back), ([1000.0, 1250.0], Some(false)));
        assert!((found[1].angle_deg - 0.01_f64.to_degrees()).abs() < 1e-12);
    }
}
