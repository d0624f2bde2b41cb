//! Change of curvature between two scans: test against noise, and bend bands.

use platen_model::{Figure, NodeState, Report};
use platen_sdk::PlateGrid;
use platen_shape::surface::Curvature;
use platen_shape::{EXPANDED, Surface};

use crate::bands::{self, Band};
use crate::{Nodes, Options, place};

/// Median of chi squared with three degrees of freedom.
const MEDIAN: f64 = 2.366;

/// 95 % quantile of three times F with 3 and 40 degrees of freedom. It is larger than that of chi squared, 7.81,
/// because the scale is estimated from the few tens of independent places of the pair.
const DETECTED: f64 = 8.52;

/// Adds the field, the bands and the sentences of the change between two scans, `[now, before]`.
pub(crate) fn add(
    report: &mut Report,
    now: &Nodes,
    before: &Nodes,
    surfaces: [&Surface; 2],
    options: &Options,
) {
    let grid = now.grid;
    let change: Vec<Curvature> =
        now.curvature.iter().zip(&before.curvature).map(|(now, before)| *now - *before).collect();
    let sigma = |i: usize| [0, 1, 2].map(|k| now.sigma[i][k].hypot(before.sigma[i][k]));
    let known = |i: usize| now.known[i] && before.known[i];
    let chi_squared: Vec<f64> = (0..PlateGrid::NODES).map(|i| chi_squared(&change[i], sigma(i))).collect();
    let quiet = (0..PlateGrid::NODES).filter(|&i| known(i)).map(|i| chi_squared[i]);
    let scale = null_scale(quiet.collect());
    let label: Vec<i8> = (0..PlateGrid::NODES)
        .map(|i| {
            let changed = known(i) && chi_squared[i] > DETECTED * scale;
            if changed { change[i].strongest().signum() as i8 } else { 0 }
        })
        .collect();
    let least = (options.min_patch / grid.cell()).ceil() as usize;
    let patches: Vec<Vec<usize>> =
        PlateGrid::connected_components(&label).into_iter().filter(|patch| patch.len() >= least).collect();

    let bands = bands(surfaces, grid, &patches, &change);
    let unchanged = |i: usize| if known(i) { NodeState::Unchanged } else { NodeState::Unseen };
    let mut state: Vec<NodeState> = (0..PlateGrid::NODES).map(unchanged).collect();
    bands.iter().flat_map(|band| &band.nodes).for_each(|&i| state[i] = NodeState::Seen);

    let mut lod: Vec<f64> = (0..PlateGrid::NODES)
        .filter(|&i| known(i))
        .map(|i| EXPANDED * scale.sqrt() * sigma(i)[0].max(sigma(i)[1]))
        .collect();
    lod.sort_by(f64::total_cmp);
    let median_lod = lod.get(lod.len() / 2).copied().unwrap_or(0.0);

    let findings = &mut report.findings;
    findings.figures.push(Figure::new("curvature.lod", median_lod, "1/m"));
    let share = |n: usize| n as f64 / lod.len().max(1) as f64;
    let above = label.iter().filter(|label| **label != 0).count();
    let changed = bands.iter().map(|band| band.nodes.len()).sum();
    findings.figures.push(Figure::new("curvature.above_lod", share(above), "1"));
    findings.figures.push(Figure::new("curvature.changed_share", share(changed), "1"));
    findings.figures.extend(bands.iter().enumerate().flat_map(|(k, band)| figures(k + 1, band)));
    findings.says.extend(bands.iter().map(|band| sentence(band, &options.against)));
    let against = &options.against;
    if lod.is_empty() {
        let trusted = options.trusted;
        findings.says.push(format!(
            "cannot tell what bent: no curvature is known to {trusted:.3} 1/m (against the {against} scan)"
        ));
    } else if bands.is_empty() {
        findings
            .says
            .push(format!("nothing bent by more than {median_lod:.3} 1/m (against the {against} scan)"));
    }
    let values = change.iter().map(Curvature::strongest).collect();
    report.fields.push(grid.scalar("curvature_change", "1/m", values, state));
}

/// Returns the significant bands among the patches, strongest first.
fn bands(
    surfaces: [&Surface; 2],
    grid: PlateGrid,
    patches: &[Vec<usize>],
    change: &[Curvature],
) -> Vec<Band> {
    let mut all: Vec<Band> =
        patches.iter().map(|patch| bands::measure(surfaces, grid, patch, change)).collect();
    all.retain(Band::is_significant);
    all.sort_by(|a, b| b.angle.abs().total_cmp(&a.angle.abs()));
    let mut bands: Vec<Band> = Vec::new();
    for band in all {
        if !bands.iter().any(|stronger| stronger.overshoots_into(&band)) {
            bands.push(band);
        }
    }
    bands
}

/// Returns the scale of the empirical null distribution: the variance of the change relative to the stated one, from
/// the median over the plate (Efron 2004).
///
/// A spline's covariance includes the smoothing bias, which is largest in curvature. Between two scans of an unchanged
/// shape most of the bias is equal and cancels. The rest depends on the smoothing of each scan and is estimated from
/// the pair. The scale is never above 1: a plate with a larger median has changed over half of its area, or needs a
/// calibration.
fn null_scale(mut chi_squared: Vec<f64>) -> f64 {
    if chi_squared.is_empty() {
        return 1.0;
    }
    let middle = chi_squared.len() / 2;
    let (_, median, _) = chi_squared.select_nth_unstable_by(middle, f64::total_cmp);
    (*median / MEDIAN).min(1.0)
}

/// Returns the test statistic of a change: chi squared with three degrees of freedom when nothing changed.
fn chi_squared(change: &Curvature, sigma: [f64; 3]) -> f64 {
    [change.u, change.v, change.uv].iter().zip(sigma).map(|(c, s)| (c / s).powi(2)).sum()
}

fn figures(number: usize, band: &Band) -> [Figure; 4] {
    let named = |what: &str| format!("bend.{number}.{what}");
    [
        Figure::new(named("angle"), band.angle, "rad").uncertainty(band.uncertainty).at(band.centre),
        Figure::new(named("direction"), band.direction, "rad"),
        Figure::new(named("length"), band.length, "m"),
        Figure::new(named("width"), band.width, "m"),
    ]
}

fn sentence(band: &Band, against: &str) -> String {
    let way = if band.angle > 0.0 { "towards" } else { "away from" };
    format!(
        "bent by {:.2} deg {way} the scanner over {:.0} x {:.0} mm round {} (against the {against} scan)",
        band.angle.to_degrees().abs(),
        band.length * 1000.0,
        band.width * 1000.0,
        place(band.centre)
    )
}
