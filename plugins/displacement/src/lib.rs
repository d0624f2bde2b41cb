//! Comparison `displacement`: how every place of the plate moved since the stroke before.
//!
//! After a stroke the plate has moved as a whole and has no part that is sure to be still, so a displacement means
//! nothing without its alignment, which is therefore named in every sentence. The rigid motion that the alignment
//! takes away is reported.
//!
//! | `alignment` | the plate before is moved so that |
//! |---|---|
//! | `unchanged` | the largest part that kept its shape lies where it lay: many local fits vote, the best is refined by iterated reweighting (Tukey) |
//! | `corners` | the four corners fit best |
//! | `supports` | the places that rest on the press's supports, `[[support]]` of the plate file, fit best |
//! | `none` | nothing: for a plate on fixed supports under a fixed scanner |
//!
//! A place is *unchanged* when its displacement along the normal is below the level of detection,
//! LoD = 1.96 sqrt(s1^2 + s2^2 + s_corr^2 + s_align^2): s1 and s2 from the splines' covariances, without what smoothing
//! takes from a shape, which is the same in both scans; s_corr from the plant's null pairs; s_align from the alignment, where
//! a place had no say in it. By chance 5 % of a plate that kept its shape lies above it. So places above the LoD that hang
//! together are a change only when they cover `min_patch` and one of them lies beyond 3.86 standard deviations (1.97 LoD), which
//! happens on one unchanged plate in twenty (two-sided, Bonferroni over 441 independent places).
//!
//! ```toml
//! [[comparison]]
//! plugin = "displacement"
//! [comparison.options]
//! against = "before"
//! alignment = "unchanged"
//! ```
//!
//! | key | meaning |
//! |---|---|
//! | `against` | `before`, the stroke before, or `baseline`, the blank |
//! | `alignment` | see above |
//! | `min_patch` | smallest patch of change, square metres; a bend band covers far more, chance patches of a null pair 0.03 to 0.04 |
//!
//! Figures: `displacement.rms` along the normal and `displacement.sigma`, the root mean square of its stated deviation, whose
//! difference on null pairs is what a calibration is about; `displacement.lod`, the median over the plate, and
//! `displacement.above_lod`, the share above it before patches are judged; `displacement.changed_share`, `displacement.max` with its place; `displacement.plate_rotation` and
//! `displacement.plate_translation` that the alignment took away.
//!
//! Fields: `displacement` (3 components, scanner frame) and `displacement_normal` (towards the scanner), metres.

mod align;
mod detect;
mod grid;

use platen_model::{Figure, Findings};
use platen_model::{NodeState, Report};
use platen_sdk::{Comparison, Error, ErrorKind, Info, Inputs, Job, PlateGrid, Result};
use platen_shape::Surface;

use align::{Alignment, Motion};
use grid::Nodes;

platen_sdk::options! {
    /// Options of `displacement`.
    pub struct Options {
        /// Which earlier scan to compare with.
        against: String = "before", choices ["before", "baseline"];
        /// How the plate's own movement is taken away.
        alignment: String = "unchanged", choices ["unchanged", "corners", "supports", "none"];
        /// Smallest connected area that counts as changed, square metres.
        min_patch: f64 = 0.1, unit "m2", min 0.0, max 10.0;
    }
}

struct Displacement(Options);

impl Comparison for Displacement {
    const INFO: Info = Info::new(
        c"displacement",
        c"Displacement",
        c"How every place of the plate moved since the stroke before, its own movement as a whole taken away.",
        c"1.0.0",
    );
    type Options = Options;

    fn new(options: Options) -> Result<Self> {
        Ok(Self(options))
    }

    fn compare(&mut self, job: &Job<'_>, inputs: &Inputs) -> Result<Report> {
        compare(&self.0, inputs, &|| job.check())
    }
}

/// `check` fails when the job was cancelled.
fn compare(options: &Options, inputs: &Inputs, check: &dyn Fn() -> Result<()>) -> Result<Report> {
    let Some(earlier) = inputs.earlier(&options.against)? else {
        let says = vec![format!("no {} scan: displacement is not known", options.against)];
        return Ok(Report::new(Findings { says, ..Findings::default() }, Vec::new()));
    };
    let nodes = Nodes::new(&inputs.now, earlier);
    let few = |motion| (motion, vec![0.0; PlateGrid::NODES]);
    let (motion, says) = match options.alignment.as_str() {
        "corners" => few(align::corners(&nodes)),
        "supports" => few(on_supports(inputs, earlier)?),
        "none" => few(Motion::none()),
        _ => align::unchanged(check, &nodes)?,
    };
    let alignment = Alignment { motion, says, name: &options.alignment };
    let changes = detect::changes(&nodes, &alignment, inputs.task.sigma_correlated, options.min_patch);
    Ok(report(&nodes, &alignment, &changes, inputs.task.supports_changed, &options.against))
}

/// The plate lies on its supports as it lay.
fn on_supports(inputs: &Inputs, earlier: &Surface) -> Result<Motion> {
    let supports: Vec<[f64; 2]> = inputs.task.supports.iter().map(|support| support.at).collect();
    let nodes = Nodes::at(&inputs.now, earlier, &supports);
    let in_sight = nodes.seen.iter().filter(|seen| **seen).count();
    if in_sight < 3 {
        let given = nodes.seen.len();
        let message = format!(
            "alignment supports: {in_sight} of the {given} supports given are in sight, 3 are needed"
        );
        return Err(Error::new(ErrorKind::Config, message).hint("add [[support]] to the plate file"));
    }
    Ok(align::places(&nodes))
}

fn report(
    nodes: &Nodes,
    alignment: &Alignment<'_>,
    changes: &detect::Changes,
    supports_changed: bool,
    against: &str,
) -> Report {
    let changed = changes.state.iter().filter(|s| **s == NodeState::Seen).count();
    // What changed beyond doubt, else all that was seen.
    let counts = |state: NodeState| state == NodeState::Seen || changed == 0 && state != NodeState::Unseen;
    let largest = (0..PlateGrid::NODES)
        .filter(|&i| counts(changes.state[i]))
        .max_by(|&a, &b| changes.normal[a].abs().total_cmp(&changes.normal[b].abs()));
    let seen = changes.state.iter().filter(|s| **s != NodeState::Unseen).count();
    let share = changed as f64 / seen.max(1) as f64;

    let mut says = Vec::new();
    let how = format!("against the {against} scan, aligned by {}", alignment.name);
    match largest.filter(|_| changed > 0) {
        Some(i) => says.push(format!(
            "changed over {:.0} % of the plate, most {:+.1} mm at u {:.0}, v {:.0} mm ({how})",
            share * 100.0,
            changes.normal[i] * 1000.0,
            nodes.grid.at(i)[0] * 1000.0,
            nodes.grid.at(i)[1] * 1000.0,
        )),
        None => says.push(format!("nothing changed above {:.2} mm ({how})", changes.median_lod * 1000.0)),
    }
    if supports_changed {
        says.push(
            "the plate rests on other supports than before: part of the change may be its own weight".into(),
        );
    }

    let figure = |name: &str, value: f64, unit: &str| Figure {
        name: name.into(),
        value,
        unit: unit.into(),
        uncertainty: None,
        at: None,
    };
    let mean_square = |square: &dyn Fn(usize) -> f64| {
        let of_seen = (0..PlateGrid::NODES).filter(|&i| changes.state[i] != NodeState::Unseen);
        of_seen.map(square).sum::<f64>() / seen.max(1) as f64
    };
    let mut figures = vec![
        figure("displacement.rms", mean_square(&|i| changes.normal[i].powi(2)).sqrt(), "m"),
        figure("displacement.sigma", mean_square(&|i| changes.sigma[i].powi(2)).sqrt(), "m"),
        figure("displacement.above_lod", changes.above_lod, "1"),
        figure("displacement.changed_share", share, "1"),
        figure("displacement.lod", changes.median_lod, "m"),
        figure("displacement.plate_rotation", alignment.motion.angle(), "rad"),
        figure("displacement.plate_translation", alignment.motion.translation_at(nodes.centre()).norm(), "m"),
    ];
    if let Some(i) = largest {
        figures.push(Figure {
            uncertainty: Some(changes.lod[i]),
            at: Some(nodes.grid.at(i)),
            ..figure("displacement.max", changes.normal[i], "m")
        });
    }

    let field = |name: &str, components: usize, values: Vec<f64>| {
        nodes.grid.field(name, "m", components, values, changes.state.clone())
    };
    let vectors = changes.vectors.iter().flat_map(|d| [d.x, d.y, d.z]).collect();
    let fields =
        vec![field("displacement", 3, vectors), field("displacement_normal", 1, changes.normal.clone())];
    Report::new(Findings { verdict: None, says, figures, templates: Vec::new() }, fields)
}

platen_sdk::export!(comparison Displacement);

#[cfg(test)]
mod tests;
