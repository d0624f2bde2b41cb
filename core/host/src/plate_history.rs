//! History of a plate, collected from the record for the advisor plugin.
//!
//! It contains the strokes with the depth of the press and the bends that they made, the die, and the parameters
//! learned from similar plates.

use std::collections::BTreeSet;

use platen_advice::bend_lines::BendLines;
use platen_advice::learner::like_plates;
use platen_advice::press_law::PressLaw;
use platen_advice::{Order, Settings, Situation, expected_angle};
use platen_history::{Archive, Filter, Stroke};
use platen_model::{
    Bend, CannotAdvise, Die, LikePlates, NextBend, PlateHistory, PressModel, PressedStroke, Report, Steel,
    Step, StrokeData, StrokeKey, Target, TargetShape, Task, TemplateFinding, Verdict, WantedBend,
};
use platen_plant::press::Input;
use platen_plant::{AdviceUse, PlantFile, PlateFile};
use platen_report::advice::{ADVICE_SCHEMA, AdviceRecord, PlateClass, Score};
use platen_report::bend_figures::{BendFigures, bend_figures};
use platen_report::output_folder;
use platen_shape::{Surface, TargetSurface};

/// Largest distance of a bend from the advised line, metres, and largest relative difference of depth for a stroke that
/// was meant as advised. Only such a stroke gives the position of the die and the scatter of the ram.
const MEANT: (f64, f64) = (0.1, 0.25);
/// Largest distance of a bend from its place, metres, and largest difference of depth, in standard deviations of the
/// ram and at least in metres, for a stroke that was pressed as advised. Only then does the advised interval of the gap
/// apply to the stroke.
const FOLLOWED: (f64, f64, f64) = (0.03, 3.0, 0.3e-3);
/// Number of newest plates that are searched for similar ones.
const LOOKED_THROUGH: usize = 200;
/// Yield strength of the depth law for a plate without a steel, as the shipped advisor assumes it, pascals.
const YIELD: f64 = 440e6;

/// A plate as just measured.
#[derive(Debug)]
pub(crate) struct MeasuredPlate {
    pub(crate) run_id: u32,
    pub(crate) key: StrokeKey,
    pub(crate) baseline: bool,
    pub(crate) data: StrokeData,
    pub(crate) steel: Option<Steel>,
    pub(crate) task: Task,
    pub(crate) templates: Vec<TemplateFinding>,
    /// Bends since the previous scan; `None` if no comparison reported them.
    pub(crate) bends: Option<Vec<Bend>>,
}

impl MeasuredPlate {
    /// Collects the data of a measurement that the advisor needs.
    pub(crate) fn new(
        (run_id, key): (u32, StrokeKey),
        data: &StrokeData,
        plate: &PlateFile,
        task: &Task,
        reports: &[&Report],
    ) -> Self {
        let found = reports.iter().flat_map(|report| &report.findings.templates);
        let slim = |found: &TemplateFinding| TemplateFinding {
            gap: Vec::new(),
            contacts: Vec::new(),
            ..found.clone()
        };
        let with_bends = reports
            .iter()
            .find(|report| report.findings.figures.iter().any(|figure| figure.name == "curvature.above_lod"));
        Self {
            run_id,
            key,
            baseline: data.baseline,
            data: data.clone(),
            steel: plate.steel.clone(),
            task: task.clone(),
            templates: found.map(slim).collect(),
            bends: with_bends.map(|report| bends(report)),
        }
    }
}

/// Returns the bends of a report of `curvature`, the largest first.
fn bends(report: &Report) -> Vec<Bend> {
    let bend = |found: BendFigures| Bend {
        at: found.at,
        direction: found.direction,
        angle: found.angle,
        sigma: found.uncertainty.unwrap_or(0.0) / platen_shape::EXPANDED,
    };
    let mut bends: Vec<Bend> = bend_figures(&report.findings.figures).into_iter().map(bend).collect();
    bends.sort_by(|a, b| b.angle.abs().total_cmp(&a.angle.abs()));
    bends
}

/// Returns the surface from which the strokes of a run's plate are counted: that of the blank, else that of its first
/// measured stroke.
pub(crate) fn origin(archive: &Archive, run_id: u32) -> Option<Surface> {
    let blank = archive.baseline(run_id).ok().flatten();
    let first = || {
        let plate = archive.stroke(run_id).ok()?.plate;
        let strokes = archive.strokes(&Filter { plate: Some(plate), ..Filter::default() }).ok()?;
        strokes.into_iter().find(|stroke| stroke.run_id < run_id && is_measured(stroke))
    };
    let document = blank.or_else(first)?.document?;
    output_folder::surface_beside(&document).ok()
}

fn is_measured(stroke: &Stroke) -> bool {
    !stroke.dry_run && stroke.verdict.is_some_and(|verdict| verdict != Verdict::NotMeasured)
}

/// Collects the history up to a measured stroke, with the score of the advice before it. The advice itself is still to
/// be filled in.
///
/// # Errors
/// The record cannot be read.
pub(crate) fn gather(
    archive: &Archive,
    plant: &PlantFile,
    wanted: &AdviceUse,
    measured: &MeasuredPlate,
) -> Result<AdviceRecord, String> {
    let failed = |e: platen_history::Error| e.to_string();
    let die = die(plant, &measured.data);
    let class = PlateClass {
        die: die.as_ref().map(|die| die.id),
        thickness: measured.task.thickness,
        grade: measured.steel.as_ref().and_then(|steel| steel.grade.clone()),
        target: measured.task.target.as_ref().map(kind).unwrap_or_default(),
    };
    let before = archive.before(measured.run_id).map_err(failed)?.filter(|_| !measured.baseline);
    let earlier = match before.as_ref().and_then(|before| before.document.as_ref()) {
        Some(document) => AdviceRecord::beside(document)?,
        None => None,
    };
    let mut strokes = earlier.as_ref().map_or_else(Vec::new, |earlier| earlier.history.strokes.clone());
    let mut score = None;
    if let Some(before) = &before {
        let stroke = pressed(archive, plant, measured, before, earlier.as_ref()).map_err(failed)?;
        score = earlier.as_ref().and_then(|earlier| scored(archive, earlier, measured, &stroke));
        strokes.push(stroke);
    }
    let like = like(archive, wanted.like_plates, measured, &class, die.as_ref());
    Ok(AdviceRecord {
        schema: ADVICE_SCHEMA.into(),
        run_id: measured.run_id,
        key: measured.key,
        baseline: measured.baseline,
        show: wanted.show.name().into(),
        class,
        history: PlateHistory {
            task: measured.task.clone(),
            templates: measured.templates.clone(),
            die,
            steel: measured.steel.clone(),
            strokes,
            like,
            may_turn_over: wanted.turn_over,
            tells_depth: plant.press.as_ref().is_none_or(|press| press.map.input(Input::RamDepth).is_some()),
        },
        advice: None,
        failed: None,
        score,
        unadvised: earlier.as_ref().and_then(unadvised),
        elapsed_ms: 0.0,
    })
}

/// Returns the die with the number that the press reports; if it reports none, the only die of the plant file.
fn die(plant: &PlantFile, data: &StrokeData) -> Option<Die> {
    match (data.die_id, &plant.dies[..]) {
        (Some(id), dies) => dies.iter().find(|die| die.id == id).cloned(),
        (None, [one]) => Some(one.clone()),
        (None, _) => None,
    }
}

fn kind(target: &Target) -> String {
    let shape = match target.shape {
        TargetShape::Flat => "flat",
        TargetShape::Cylinder { .. } => "cylinder",
        TargetShape::Cone { .. } => "cone",
        TargetShape::Sphere { .. } => "sphere",
        TargetShape::Torus { .. } => "torus",
    };
    format!("{shape}, {:?}", target.scanned_face).to_lowercase()
}

/// Returns the stroke that was just measured, in the form of the record.
fn pressed(
    archive: &Archive,
    plant: &PlantFile,
    measured: &MeasuredPlate,
    before: &Stroke,
    earlier: Option<&AdviceRecord>,
) -> Result<PressedStroke, platen_history::Error> {
    // Another stroke in between also made a bend, so the depth cannot be assigned to one of the two.
    let between = has_other_strokes_between(archive, plant, measured, before)?;
    let bends = measured.bends.clone().filter(|_| earlier.is_some());
    // On other supports the plate's own weight changes the bends.
    let reported = measured.data.ram_depth.filter(|_| !between && !measured.task.supports_changed);
    let stroke = PressedStroke {
        run_id: i64::from(measured.run_id),
        stroke: measured.key.stroke,
        wanted: None,
        depth: reported,
        force: measured.data.force,
        not_measured: bends.is_none(),
        missed_before: between,
        bends: bends.unwrap_or_default(),
    };
    let advised = earlier.filter(|earlier| earlier.show != "shadow" && !between).and_then(next_bend);
    let wanted = advised.filter(|next| is_meant(next, &measured.task, &stroke));
    let wanted = wanted.map(|next| WantedBend { at: middle(next), angle: next.angle, depth: next.depth });
    Ok(PressedStroke { wanted, ..stroke })
}

/// Returns whether a plate was pressed between two measurements: by a stroke that was not measured, or by one that only
/// the counter of the press shows, for example while the host was stopped. In another session the counter cannot be
/// compared.
fn has_other_strokes_between(
    archive: &Archive,
    plant: &PlantFile,
    measured: &MeasuredPlate,
    before: &Stroke,
) -> Result<bool, platen_history::Error> {
    let (from, to) = (before.key, measured.key);
    let mut others = Vec::new();
    for run_id in before.run_id + 1..measured.run_id {
        match archive.stroke(run_id) {
            Ok(stroke) => others.push(stroke),
            Err(platen_history::Error::NoSuchRun { .. }) => {}
            Err(why) => return Err(why),
        }
    }
    others.retain(|stroke| (stroke.key.session, stroke.key.stroke) != (to.session, to.stroke));
    if others.iter().any(|stroke| stroke.plate == before.plate && !stroke.dry_run && !stroke.baseline) {
        return Ok(true);
    }
    let map = plant.press.as_ref().map(|press| &press.map).filter(|map| map.counts_strokes());
    let Some(map) = map.filter(|_| from.session == to.session) else { return Ok(false) };
    let known: BTreeSet<u16> =
        others.iter().map(|stroke| stroke.key.stroke).filter(|it| *it != from.stroke).collect();
    Ok(map.counter.distance(from.stroke, to.stroke) > 1 + known.len() as u32)
}

fn next_bend(record: &AdviceRecord) -> Option<&NextBend> {
    match &record.advice.as_ref()?.step {
        Step::Bend(next) => Some(next),
        _ => None,
    }
}

fn unadvised(record: &AdviceRecord) -> Option<CannotAdvise> {
    match record.advice.as_ref()?.step {
        Step::Cannot { reason } => Some(reason),
        _ => None,
    }
}

fn middle(next: &NextBend) -> [f64; 2] {
    [0, 1].map(|k| 0.5 * (next.line[0][k] + next.line[1][k]))
}

/// Returns whether the operator meant the advised bend.
fn is_meant(next: &NextBend, task: &Task, stroke: &PressedStroke) -> bool {
    let near = stroke.bends.first().zip(BendLines::of_task(task)).is_some_and(|(bend, lines)| {
        (lines.coordinate(bend.at) - lines.coordinate(middle(next))).abs() <= MEANT.0
    });
    let as_deep = match (stroke.depth, next.depth) {
        (Some(reported), Some(advised)) => (reported / advised - 1.0).abs() <= MEANT.1,
        _ => true,
    };
    near && as_deep
}

/// Returns whether a stroke whose bend lies `off_line` from the advised line was pressed as advised.
fn has_followed(advice: &AdviceRecord, next: &NextBend, off_line: f64, reported: Option<f64>) -> bool {
    let (off_mark, ram) = advice
        .advice
        .as_ref()
        .and_then(|advice| advice.model)
        .map_or((0.0, 0.0), |model| (model.off_mark, model.ram_sigma));
    let (place, sigmas, depth) = FOLLOWED;
    let as_deep = reported
        .zip(next.depth)
        .is_none_or(|(reported, advised)| (reported - advised).abs() <= (sigmas * ram).max(depth));
    (off_line - off_mark).abs() <= place && as_deep
}

/// Compares a stroke with the advice before it.
fn scored(
    archive: &Archive,
    earlier: &AdviceRecord,
    measured: &MeasuredPlate,
    stroke: &PressedStroke,
) -> Option<Score> {
    let next = next_bend(earlier)?;
    let made = *stroke.bends.first()?;
    let task = &measured.task;
    let lines = BendLines::of_task(task)?;
    let x = lines.coordinate(made.at);
    let expected = stroke.depth.and_then(|depth| {
        let blank = origin(archive, measured.run_id)?;
        let situation = Situation::of_surfaces(&earlier.history, &blank, Some(&blank)).ok()?;
        let curvature = target(task)?.curvature(0.0, 0.0).strongest().abs();
        let settings = Settings {
            largest: curvature * 0.3,
            strain: f64::INFINITY,
            order: Order::Onward,
            guard: true,
            learns: true,
        };
        expected_angle(&settings, &earlier.history, &situation, x, depth)
    });
    let gap = measured.templates.iter().map(|found| found.max_gap.abs()).reduce(f64::max);
    let off_line = x - lines.coordinate(middle(next));
    Some(Score {
        made,
        off_line,
        advised_angle: next.angle,
        advised_95: Some(next.angle_95),
        expected_angle: expected.map(|it| it[0]),
        expected_to: expected.map(|it| it[1].hypot(platen_shape::EXPANDED * made.sigma)),
        foretold_gap: next.gap_after,
        gap,
        followed: has_followed(earlier, next, off_line, stroke.depth),
    })
}

fn target(task: &Task) -> Option<TargetSurface> {
    TargetSurface::new(task.target.as_ref()?, task.width, task.height, task.thickness).ok()
}

/// Returns the press parameters learned from the newest similar plates; `None` without one.
fn like(
    archive: &Archive,
    most: usize,
    measured: &MeasuredPlate,
    class: &PlateClass,
    die: Option<&Die>,
) -> Option<LikePlates> {
    let die = die?;
    let steel = measured.steel.clone();
    let steel = steel.unwrap_or(Steel { grade: None, yield_strength: YIELD, heat: None });
    let law = PressLaw::new(die, &steel, measured.task.thickness);
    let this = archive.stroke(measured.run_id).ok()?.plate;
    let plates = archive.plates().ok()?;
    let plates = plates.iter().rev().filter(|plate| plate.plate != this).take(LOOKED_THROUGH);
    let models = plates.filter_map(|plate| last_model(archive, plate.plate, class));
    like_plates(&law, &models.take(most).collect::<Vec<_>>())
}

/// Returns the parameters that the last advice on a plate learned, if the plate is similar to this class and the advice
/// learned any.
fn last_model(archive: &Archive, plate: u32, class: &PlateClass) -> Option<PressModel> {
    let strokes = archive.strokes(&Filter { plate: Some(plate), ..Filter::default() }).ok()?;
    let document = strokes.into_iter().rev().filter(is_measured).find_map(|stroke| stroke.document)?;
    let record =
        AdviceRecord::beside(&document).ok().flatten().filter(|record| record.class.is_like(class))?;
    record.advice?.model.filter(|model| model.strokes_learned > 0)
}
