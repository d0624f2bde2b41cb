//! Comparison `curvature`: what the stroke bent, and where the plate still has to bend.
//!
//! Curvature needs no alignment: however the plate moved as a whole between two strokes, its curvature at a material place
//! is its own. So the change of curvature is the first map of what a stroke did, and the target's curvature minus
//! the plate's is what is still to do.
//!
//! Level of detection, 95 %. One curvature: 1.96 sqrt(s^2 + s_corr^2), s from the spline's covariance. The change has
//! three numbers (along u, along v, twist): a place is *unchanged* when the sum of (change / s)^2, s^2 from both splines and
//! s_corr, lies below the 95 % quantile of what it is by chance, after s was scaled down to the scatter of the quieter half
//! of the plate. s_corr is the correlated error of a position, taken as a wave of length L:
//! s_position (2 pi / L)^2.
//!
//! Changed places that hang together, and have one sense, are a band. Its bend angle is the change of curvature summed
//! on lines across it, to beyond its foot, and averaged along it. A patch smaller than `min_patch`, one that bends by less than
//! twice its uncertainty, and the spline's swing beside a stronger band count as unchanged: by chance 5 % of a plate that
//! kept its shape lies above the level of detection.
//!
//! ```toml
//! [[comparison]]
//! plugin = "curvature"
//! [comparison.options]
//! against = "before"
//! ```
//!
//! | key | meaning |
//! |---|---|
//! | `against` | `before`, the stroke before, or `baseline`, the blank |
//! | `min_patch` | smallest patch of change, square metres |
//! | `wavelength` | length over which the scanner's correlated error swings, metres |
//! | `trusted` | places whose curvature is less certain than this count as not seen, 1/m |
//!
//! Fields, mid-surface, positive when the centre lies on the scanner's side, 1/m: `kappa_u`, `kappa_v`, `kappa_uv` (twist),
//! `kappa_max`, `kappa_min` (principal), `gaussian` (1/m2); with an earlier scan `curvature_change`, the
//! change in the direction in which it is strongest; with a target `curvature_deficit`, positive where the plate has to
//! bend more, neutral where it is enough; with a sphere or torus `gaussian_missing` (1/m2), for which the plate still has to
//! stretch, and what it stretched already, the membrane strain of the mid-surface (`strain_u`, `strain_v`, `strain_uv`).
//!
//! Figures: `curvature.lod`, the shares `curvature.above_lod` and `curvature.changed_share`; `bend.N.angle` with its place,
//! `bend.N.direction` of the straight lines, `bend.N.length` and `bend.N.width`; `curvature.deficit_max`,
//! `curvature.deficit_min` and `curvature.enough`, the share that is done; `gaussian.missing` and `gaussian.wanted`, the
//! Gaussian curvature integrated over what was seen (steradians), and `gaussian.missing_share`, 1 for any plate that only
//! bent; `strain.max` and `strain.min`, the largest stretch and squeeze in any direction.

mod bands;
mod change;
mod deficit;
mod strain;

use platen_model::{Field, NodeState, Report};
use platen_model::{Figure, Findings};
use platen_sdk::{Comparison, Error, ErrorKind, Info, Inputs, Job, PlateGrid, Result};
use platen_shape::surface::Curvature;
use platen_shape::{EXPANDED, Surface, TargetSurface};

platen_sdk::options! {
    /// Options of `curvature`.
    pub struct Options {
        /// Which earlier scan to compare with.
        against: String = "before", choices ["before", "baseline"];
        /// Smallest connected area that counts as changed, square metres.
        min_patch: f64 = 0.02, unit "m2", min 0.0, max 10.0;
        /// Length over which the scanner's correlated error swings.
        wavelength: f64 = 1.0, unit "m", min 0.05, max 100.0;
        /// Least certain curvature that still counts as seen (95 %).
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

/// Curvature at every node with what is known of it.
#[derive(Debug)]
struct Nodes {
    grid: PlateGrid,
    curvature: Vec<Curvature>,
    /// One sigma along u, along v, of the twist.
    sigma: Vec<[f64; 3]>,
    /// Seen, and certain enough.
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
        let known = |known: &bool| if *known { NodeState::Seen } else { NodeState::Unseen };
        let state: Vec<NodeState> = self.known.iter().map(known).collect();
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

/// `check` fails when the job was cancelled.
fn compare(options: &Options, inputs: &Inputs, check: &dyn Fn() -> Result<()>) -> Result<Report> {
    let (task, now) = (&inputs.task, &inputs.now);
    // A single scan has its share of what pairs of scans show.
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

fn figure(name: impl Into<String>, value: f64, unit: &str) -> Figure {
    Figure { name: name.into(), value, unit: unit.into(), uncertainty: None, at: None }
}

/// `u 1500, v 900 mm`.
fn place([u, v]: [f64; 2]) -> String {
    format!("u {:.0}, v {:.0} mm", u * 1000.0, v * 1000.0)
}

platen_sdk::export!(comparison Bending);

#[cfg(test)]
mod tests;
