//! Comparison `curvature`: change of curvature between two scans, and the curvature missing to the target.
//!
//! Curvature needs no alignment: the curvature at a material point does not depend on the motion of the plate as a
//! whole between two strokes. The change of curvature is therefore the primary map of the effect of a stroke. The
//! target's curvature minus the plate's is the map of the bend that is still missing.
//!
//! As in Masuda et al., "Point-based shape monitoring of plate bending for large-scale storage tanks", the B-spline
//! surfaces of two strokes (section 4.4) are compared at equal (u, v). The level of detection, the bend angles and the
//! comparison with a target are this project's own.
//!
//! # Method
//!
//! *Level of detection* (LoD) of a single curvature, 95 %:
//!
//! ```text
//! LoD = 1.96 sqrt(s^2 + s_corr^2),    s_corr = s_position (2 pi / L)^2
//! ```
//!
//! with s from the spline's covariance and s_corr from the correlated error of a position, assumed to be a wave of
//! length L (`wavelength`).
//!
//! *Test of a change.* The change at a place has three components: along u, along v, twist. The place is *unchanged* if
//! the sum of (change / s)^2 over the components is below its 95 % quantile under no change, with s^2 from both splines
//! and s_corr. Before the test s is scaled down to the scatter of the quieter half of the plate (empirical null
//! distribution; Efron, "Large-scale simultaneous hypothesis testing: the choice of a null hypothesis", JASA 99, 2004).
//!
//! *Bend bands.* Connected changed places of one sense form a band. Its bend angle is the integral of the change of
//! curvature across the band (Simpson's rule), from beyond one foot of the band to beyond the other, averaged along the
//! band. By chance 5 % of an unchanged plate lies above the level of detection. Therefore three kinds of patches count
//! as unchanged: a patch smaller than `min_patch`, a patch that bends by less than twice its uncertainty, and the
//! spline's overshoot beside a stronger band.
//!
//! # Example
//!
//! ```toml
//! [[comparison]]
//! plugin = "curvature"
//! [comparison.options]
//! against = "before"
//! ```
//!
//! # Options
//!
//! | key | unit | default | range | meaning |
//! |---|---|---|---|---|
//! | `against` | | `before` | `before`, `baseline` | earlier scan: the stroke before, or the blank |
//! | `min_patch` | m2 | 0.02 | 0 to 10 | smallest connected area that counts as changed |
//! | `wavelength` | m | 1.0 | 0.05 to 100 | length of a period of the scanner's correlated error |
//! | `trusted` | 1/m | 0.05 | 0.0001 to 10 | places whose curvature is less certain than this (95 %) count as not seen |
//!
//! # Fields
//!
//! Fields are of the mid-surface, and positive if the centre of curvature lies on the scanner's side.
//!
//! | field | unit | present | meaning |
//! |---|---|---|---|
//! | `kappa_u`, `kappa_v`, `kappa_uv` | 1/m | always | curvature along u, along v, twist |
//! | `kappa_max`, `kappa_min`, `gaussian` | 1/m, 1/m2 | always | principal curvatures, Gaussian curvature |
//! | `curvature_change` | 1/m | with an earlier scan | change in the direction in which it is largest |
//! | `curvature_deficit` | 1/m | with a target | positive where the plate must bend more, neutral where it is bent enough |
//! | `gaussian_missing` | 1/m2 | sphere, torus | Gaussian curvature that the plate must still gain by stretching |
//! | `strain_u`, `strain_v`, `strain_uv` | 1 | sphere, torus | membrane strain of the mid-surface |
//!
//! # Figures
//!
//! | figure | unit | meaning |
//! |---|---|---|
//! | `curvature.lod` | 1/m | median level of detection |
//! | `curvature.above_lod`, `curvature.changed_share` | 1 | share of the plate above the LoD; share in bands |
//! | `bend.N.angle`, `.direction`, `.length`, `.width` | rad, rad, m, m | band N: angle with its place, direction of the straight lines, size |
//! | `curvature.deficit_max`, `curvature.deficit_min`, `curvature.enough` | 1/m, 1/m, 1 | significant extremes; share of the plate that is bent enough |
//! | `gaussian.missing`, `gaussian.wanted`, `gaussian.missing_share` | 1 | Gaussian curvature integrated over what was seen (steradians); the share is 1 for a plate that only bent |
//! | `strain.max`, `strain.min` | 1 | largest stretch and largest shortening in any direction |
//!
//! # Limits and errors
//!
//! Curvature near the edge of the plate is uncertain; see `trusted`. Refused are an earlier scan of a plate of another
//! size and a target with an impossible radius.

mod bands;
mod change;
mod deficit;
mod strain;

use platen_model::{Field, Findings, NodeState, Report};
use platen_sdk::{Comparison, Error, ErrorKind, Info, Inputs, Job, PlateGrid, Result};
use platen_shape::surface::Curvature;
use platen_shape::{EXPANDED, Surface, TargetSurface};

platen_sdk::options! {
    /// Options of `curvature`.
    pub struct Options {
        /// Earlier scan to compare with.
        against: String = "before", choices ["before", "baseline"];
        /// Smallest connected area that counts as changed, square metres.
        min_patch: f64 = 0.02, unit "m2", min 0.0, max 10.0;
        /// Period of the scanner's correlated error.
        wavelength: f64 = 1.0, unit "m", min 0.05, max 100.0;
        /// Largest uncertainty (95 %) of a curvature that still counts as seen.
        trusted: f64 = 0.05, unit "1/m", min 0.0001, max 10.0;
    }
}

struct Bending(Options);

impl Comparison for Bending {
    const INFO: Info = Info::new(
        c"curvature",
        c"Curvature",
        c"Curvature of the plate, how a stroke changed it, and what is missing to the target.",
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

/// Curvature at every node, with its uncertainty.
#[derive(Debug)]
struct Nodes {
    grid: PlateGrid,
    curvature: Vec<Curvature>,
    /// Standard deviations: along u, along v, of the twist.
    sigma: Vec<[f64; 3]>,
    /// Whether the node was seen and is certain enough.
    known: Vec<bool>,
}

impl Nodes {
    fn new(surface: &Surface, sigma_correlated: f64, trusted: f64) -> Self {
        let grid = PlateGrid::new(surface);
        let sigma = grid.map(|u, v| surface.sigma_curvature(u, v).map(|s| s.hypot(sigma_correlated)));
        let seen = grid.map(|u, v| surface.mask().seen(u, v));
        let certain = |s: &[f64; 3]| s.iter().all(|s| EXPANDED * s <= trusted);
        let known = seen.iter().zip(&sigma).map(|(seen, sigma)| *seen && certain(sigma)).collect();
        Self { grid, curvature: grid.map(|u, v| surface.curvature(u, v)), sigma, known }
    }

    fn fields(&self) -> Vec<Field> {
        let state: Vec<NodeState> = self.known.iter().copied().map(NodeState::from).collect();
        let field = |name: &str, unit: &str, take: fn(&Curvature) -> f64| {
            self.grid.scalar(name, unit, self.curvature.iter().map(take).collect(), state.clone())
        };
        vec![
            field("kappa_u", "1/m", |k| k.u),
            field("kappa_v", "1/m", |k| k.v),
            field("kappa_uv", "1/m", |k| k.uv),
            field("kappa_max", "1/m", |k| k.max),
            field("kappa_min", "1/m", |k| k.min),
            field("gaussian", "1/m2", |k| k.gaussian),
        ]
    }
}

/// Compares the plate with its target and an earlier scan. `check` fails when the job was cancelled.
fn compare(options: &Options, inputs: &Inputs, check: &dyn Fn() -> Result<()>) -> Result<Report> {
    let (task, now) = (&inputs.task, &inputs.now);
    // The correlated error belongs to a pair of scans; a single scan has half its variance.
    let correlated = task.sigma_correlated / 2.0_f64.sqrt();
    let correlated = correlated * (std::f64::consts::TAU / options.wavelength).powi(2);
    let nodes = Nodes::new(now, correlated, options.trusted);
    check()?;
    let mut report = Report::new(Findings::default(), nodes.fields());

    if let Some(target) = &task.target {
        let target = TargetSurface::new(target, task.width, task.height, task.thickness)
            .map_err(|e| Error::new(ErrorKind::Config, e.to_string()))?;
        deficit::add(&mut report, &nodes, &target);
        if deficit::is_doubly_curved(&nodes, &target) {
            strain::add(&mut report, &nodes, now);
        }
    }
    check()?;
    match inputs.earlier(&options.against)? {
        Some(earlier) => {
            let before = Nodes::new(earlier, correlated, options.trusted);
            check()?;
            change::add(&mut report, &nodes, &before, [now, earlier], options);
            if task.supports_changed {
                let says =
                    "the plate rests on other supports than before: part of the change may be its own weight";
                report.findings.says.push(says.into());
            }
        }
        None => {
            report.findings.says.push(format!("no {} scan: nothing is known of a change", options.against))
        }
    }
    Ok(report)
}

/// Formats a place as `u 1500, v 900 mm`.
fn place([u, v]: [f64; 2]) -> String {
    format!("u {:.0}, v {:.0} mm", u * 1000.0, v * 1000.0)
}

platen_sdk::export!(comparison Bending);

#[cfg(test)]
mod tests;
