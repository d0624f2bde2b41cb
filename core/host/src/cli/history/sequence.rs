//! Command `platen history sequence`: figures of a plate's bending sequence.

use std::path::PathBuf;

use clap::Args;
use platen_engine::pipeline;
use platen_engine::plugin::Surfaces;
use platen_model::Task;
use platen_plant::PluginUse;
use platen_report::sequence::{Bend, Sequence, SequenceStroke, Summary};
use platen_shape::Surface;

use super::open;
use crate::cli::{CliError, Common, output};
use crate::progress;

#[derive(Debug, Args)]
#[command(after_help = "Example:\n  platen history sequence config/plant-north.toml 12\n\n\
                        feed: distance across the straight lines from the strongest bend of the previous stroke. re-hit: a bend on an \
                        earlier one. overshoot: gap under a template that is bent too far. energy left: elastic energy from the \
                        measured to the target's curvature, as a share of the first stroke's. Formulas: platen_report::sequence.")]
pub(super) struct Command {
    /// Plant file
    plant: PathBuf,
    /// The plate's number in the history
    plate: u32,
}

pub(super) fn run(common: &Common, command: &Command) -> Result<(), CliError> {
    let (plant, archive) = open(&command.plant)?;
    let curvature = pipeline::comparison(&common.catalogue(), &PluginUse::by_default("curvature"))?;
    let compare = |task: &Task, before: &Surface, now: &Surface| {
        let surfaces = Surfaces { now, before: Some(before), baseline: None };
        curvature.compare(task, surfaces).map_err(|error| error.to_string())
    };
    let sequence = Sequence::of(&archive, &plant, command.plate, &compare, &progress::phase)?;
    progress::done();
    if common.json {
        return output::json(&sequence);
    }
    let mut rows = Vec::new();
    for stroke in &sequence.strokes {
        let bends = stroke.bends.as_deref().unwrap_or_default();
        rows.push(row(stroke, bends.first()));
        for bend in bends.iter().skip(1) {
            let mut more = vec![String::new(); 8];
            more.extend(bend_cells(bend));
            rows.push(more);
        }
    }
    output::titled(
        "stroke | die | force kN | ram mm | gap mm | overshoot mm | energy left | beyond | bend deg | at u, v mm | direction | feed mm | note",
        rows,
    )?;
    summary(&sequence.summary)
}

fn row(stroke: &SequenceStroke, bend: Option<&Bend>) -> Vec<String> {
    let percent = |share: Option<f64>| share.map(|s| format!("{:.1} %", 100.0 * s)).unwrap_or_default();
    let mut cells = vec![
        stroke.stroke.clone(),
        stroke.die_set.map(|die| die.to_string()).unwrap_or_default(),
        output::number(stroke.force_kn, 0),
        output::number(stroke.ram_depth_mm, 1),
        output::number(stroke.gap_mm, 1),
        output::number(stroke.overshoot_mm, 1),
        percent(stroke.energy_left_share),
        percent(stroke.beyond_share),
    ];
    match bend {
        Some(bend) => cells.extend(bend_cells(bend)),
        None => {
            let why =
                if stroke.bends.is_some() { "no bend beyond doubt" } else { "no two surfaces to compare" };
            cells.extend(["", "", "", "", why].map(str::to_owned));
        }
    }
    cells
}

fn bend_cells(bend: &Bend) -> [String; 5] {
    let uncertainty = bend.uncertainty_deg.map(|deg| format!(" +- {deg:.2}")).unwrap_or_default();
    let rehit = bend.rehit_of.as_ref().map(|stroke| format!("re-hit of {stroke}"));
    let back = (bend.bent_back == Some(true)).then(|| "bent back".to_owned());
    [
        format!("{:+.2}{uncertainty}", bend.angle_deg),
        format!("{:.0}, {:.0}", bend.at_mm[0], bend.at_mm[1]),
        format!("{:.0}", bend.direction_deg),
        output::number(bend.feed_mm, 0),
        [rehit, back].into_iter().flatten().collect::<Vec<_>>().join(", "),
    ]
}

fn summary(summary: &Summary) -> Result<(), CliError> {
    let Summary { strokes, not_measured, bends, rehits, bent_back, overshoots, minutes, .. } = summary;
    let passed = match summary.strokes_to_pass {
        Some(count) => format!("passed after {count}"),
        None => "has not passed".to_owned(),
    };
    output::line(&format!(
        "{strokes} strokes in {minutes:.1} min ({not_measured} not measured), {passed}; {bends} bends, {rehits} re-hits, {bent_back} bent back"
    ))?;
    let most = summary.overshoot_max_mm.map(|mm| format!(", at most {mm:.1} mm")).unwrap_or_default();
    let feed = summary.feed_mean_mm.map(|mm| format!("; mean feed {mm:.0} mm")).unwrap_or_default();
    let left =
        summary.energy_left_share.map(|s| format!("; energy left {:.1} %", 100.0 * s)).unwrap_or_default();
    let dies: Vec<String> = summary.die_sets.iter().map(u16::to_string).collect();
    let dies = if dies.is_empty() { "unknown".to_owned() } else { dies.join(", ") };
    output::line(&format!("bent too far after {overshoots} strokes{most}{feed}{left}; die sets: {dies}"))
}
