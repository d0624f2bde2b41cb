//! Comparison `displacement`: movement of every material point between two scans, after alignment.
//!
//! As in Masuda et al., "Point-based shape monitoring of plate bending for large-scale storage tanks", the B-spline
//! surfaces of two strokes (section 4.4) are compared at equal (u, v). After a stroke the plate has moved as a whole,
//! and no part of it is certain to be at rest. A displacement therefore depends on its alignment. Every sentence of the
//! report states the alignment, and the rigid motion that it removes is reported. Alignment and level of detection are
//! this project's own.
//!
//! # Method
//!
//! *Alignment.* The earlier plate is moved rigidly, by weighted least squares (Gauss-Newton) over material points:
//!
//! | `alignment` | motion |
//! |---|---|
//! | `unchanged` | robust: the largest part that kept its shape coincides. Of many local fits the one with the most inliers starts iteratively reweighted least squares with Tukey's biweight (Huber, Ronchetti, "Robust Statistics", 2nd ed., 4.8), its scale that of the shorth of the residuals |
//! | `corners` | least squares of the four corners |
//! | `supports` | least squares of the places on the press's supports, `[[support]]` of the plate file |
//! | `none` | identity: for a plate on fixed supports under a fixed scanner |
//!
//! *Level of detection* (LoD), 95 %. A place is *unchanged* if its displacement along the normal is below
//!
//! ```text
//! LoD = 1.96 sqrt(s1^2 + s2^2 + s_corr^2 + s_align^2)
//! ```
//!
//! where
//!
//! - s1 and s2 come from the splines' covariances without their smoothing bias, which is equal in both scans;
//! - s_corr comes from the plant's null pairs or, until there are any, from the range error of the scanner's data
//!   sheet;
//! - s_align comes from the covariance of the alignment, and is smaller where the place itself determines the
//!   alignment.
//!
//! *Patches.* By chance 5 % of an unchanged plate lies above the LoD. Connected places above it count as a change only
//! if they cover `min_patch` and one of them exceeds 3.86 standard deviations (1.97 LoD). This happens on one unchanged
//! plate in twenty (two-sided, Bonferroni over 441 independent places). For the part s_corr, whose waves are long, the
//! limit is 3.14 (30 places).
//!
//! # Example
//!
//! ```toml
//! [[comparison]]
//! plugin = "displacement"
//! [comparison.options]
//! against = "before"
//! alignment = "unchanged"
//! ```
//!
//! # Options
//!
//! | key | unit | default | range | meaning |
//! |---|---|---|---|---|
//! | `against` | | `before` | `before`, `baseline` | earlier scan: the stroke before, or the blank |
//! | `alignment` | | `unchanged` | `unchanged`, `corners`, `supports`, `none` | see above |
//! | `min_patch` | m2 | 0.1 | 0 to 10 | smallest patch of change; a bend band covers far more, chance patches of a null pair 0.03 to 0.04 |
//!
//! # Fields and figures
//!
//! | field | unit | meaning |
//! |---|---|---|
//! | `displacement` | m | vector, scanner frame |
//! | `displacement_normal` | m | component along the normal, towards the scanner |
//!
//! | figure | unit | meaning |
//! |---|---|---|
//! | `displacement.rms`, `displacement.sigma` | m | root mean square along the normal, and of its stated standard deviation; a calibration on null pairs estimates their difference |
//! | `displacement.lod`, `displacement.above_lod` | m, 1 | median level of detection; share of the plate above it |
//! | `displacement.changed_share`, `displacement.max` | 1, m | share in patches of change; largest displacement with its place |
//! | `displacement.plate_rotation`, `displacement.plate_translation` | rad, m | rigid motion that the alignment removed |
//!
//! # Limits and errors
//!
//! Without an earlier scan the report contains no figures. Refused are an earlier scan of a plate of another size, and
//! `supports` with fewer than three supports in sight.

mod align;
mod detect;
mod nodes;

use platen_model::{Figure, Findings, NodeState, Report};
use platen_sdk::{Comparison, Error, ErrorKind, Info, Inputs, Job, PlateGrid, Result};
use platen_shape::Surface;

use align::{Alignment, Motion};
use nodes::Nodes;

platen_sdk::options! {
    /// Options of `displacement`.
    pub struct Options {
        /// Earlier scan to compare with.
        against: String = "before", choices ["before", "baseline"];
        /// Alignment of the earlier plate, which removes the movement of the plate as a whole.
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
        c"How every place of the plate moved since the stroke before, after removal of the movement as a whole.",
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

/// Compares the plate with an earlier scan. `check` fails when the job was cancelled.
fn compare(options: &Options, inputs: &Inputs, check: &dyn Fn() -> Result<()>) -> Result<Report> {
    let Some(earlier) = inputs.earlier(&options.against)? else {
        let says = vec![format!("no {} scan: displacement is not known", options.against)];
        return Ok(Report::new(Findings { says, ..Findings::default() }, Vec::new()));
    };
    let nodes = Nodes::new(&inputs.now, earlier, inputs.task.sigma_correlated);
    let unweighted = |motion| (motion, vec![0.0; PlateGrid::NODES]);
    let (motion, weights) = match options.alignment.as_str() {
        "corners" => unweighted(align::corners(&nodes)),
        "supports" => unweighted(on_supports(inputs, earlier)?),
        "none" => unweighted(Motion::none()),
        _ => align::unchanged(check, &nodes)?,
    };
    let alignment = Alignment { motion, weights, name: &options.alignment };
    let changes = detect::changes(&nodes, &alignment, options.min_patch);
    Ok(report(&nodes, &alignment, &changes, inputs.task.supports_changed, &options.against))
}

/// Aligns the places on the supports.
fn on_supports(inputs: &Inputs, earlier: &Surface) -> Result<Motion> {
    let supports: Vec<[f64; 2]> = inputs.task.supports.iter().map(|support| support.at).collect();
    let nodes = Nodes::at(&inputs.now, earlier, &supports, inputs.task.sigma_correlated);
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
    // Counts the significant changes; without any, all seen nodes.
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

    let mean_square = |square: &dyn Fn(usize) -> f64| {
        let of_seen = (0..PlateGrid::NODES).filter(|&i| changes.state[i] != NodeState::Unseen);
        of_seen.map(square).sum::<f64>() / seen.max(1) as f64
    };
    let mut figures = vec![
        Figure::new("displacement.rms", mean_square(&|i| changes.normal[i].powi(2)).sqrt(), "m"),
        Figure::new("displacement.sigma", mean_square(&|i| changes.sigma[i].powi(2)).sqrt(), "m"),
        Figure::new("displacement.above_lod", changes.above_lod, "1"),
        Figure::new("displacement.changed_share", share, "1"),
        Figure::new("displacement.lod", changes.median_lod, "m"),
        Figure::new("displacement.plate_rotation", alignment.motion.angle(), "rad"),
        Figure::new(
            "displacement.plate_translation",
            alignment.motion.translation_at(nodes.centre()).norm(),
            "m",
        ),
    ];
    if let Some(i) = largest {
        let largest = Figure::new("displacement.max", changes.normal[i], "m");
        figures.push(largest.uncertainty(changes.lod[i]).at(nodes.grid.at(i)));
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
