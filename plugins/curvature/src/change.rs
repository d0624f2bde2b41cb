//! What a stroke bent.

use platen_sdk::{NodeState, PlateGrid, Report};
use platen_shape::Surface;
use platen_shape::surface::Curvature;
use platen_shape::task::Figure;

use crate::bands::{self, Band};
use crate::{EXPANDED, Nodes, Options, figure, place};

/// Quantiles of chi squared with three degrees of freedom: 95 % and 25 %.
const CHI_SQUARED: [f64; 2] = [7.815, 1.213];

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
    let surprise: Vec<f64> = (0..PlateGrid::NODES).map(|i| surprise(&change[i], sigma(i))).collect();
    let scale = scale((0..PlateGrid::NODES).filter(|&i| known(i)).map(|i| surprise[i]).collect());
    let label: Vec<i8> = (0..PlateGrid::NODES)
        .map(|i| {
            let changed = known(i) && surprise[i] > CHI_SQUARED[0] * scale;
            if changed { change[i].strongest().signum() as i8 } else { 0 }
        })
        .collect();
    let least = (options.min_patch / grid.cell()).ceil() as usize;
    let patches: Vec<Vec<usize>> =
        PlateGrid::patches(&label).into_iter().filter(|patch| patch.len() >= least).collect();

    let unchanged = |i: usize| if known(i) { NodeState::Unchanged } else { NodeState::Unseen };
    let mut state: Vec<NodeState> = (0..PlateGrid::NODES).map(unchanged).collect();
    patches.iter().flatten().for_each(|&i| state[i] = NodeState::Seen);

    // Where nothing changed, chance makes patches too. Of the many places that a map has they are the worst ones, whose
    // angles come to one and a half times the uncertainty of a place that was not picked.
    let beyond_doubt = |band: &Band| band.sense * band.angle > 2.0 * band.uncertainty;
    let bands = patches.iter().map(|patch| bands::measure(surfaces, grid, patch, &change));
    let mut bands: Vec<Band> = bands.filter(beyond_doubt).collect();
    bands.sort_by(|a, b| b.angle.abs().total_cmp(&a.angle.abs()));
    let mut lod: Vec<f64> = (0..PlateGrid::NODES)
        .filter(|&i| known(i))
        .map(|i| EXPANDED * scale.sqrt() * sigma(i)[0].max(sigma(i)[1]))
        .collect();
    lod.sort_by(f64::total_cmp);
    let median_lod = lod.get(lod.len() / 2).copied().unwrap_or(0.0);

    let findings = &mut report.findings;
    findings.figures.push(figure("curvature.lod", median_lod, "1/m"));
    let changed = state.iter().filter(|s| **s == NodeState::Seen).count();
    findings.figures.push(figure("curvature.changed_share", changed as f64 / lod.len().max(1) as f64, "1"));
    findings.figures.extend(bands.iter().enumerate().flat_map(|(k, band)| figures(k + 1, band)));
    findings.says.extend(bands.iter().map(|band| sentence(band, &options.against)));
    if bands.is_empty() {
        let against = &options.against;
        findings
            .says
            .push(format!("nothing bent by more than {median_lod:.3} 1/m (against the {against} scan)"));
    }
    let values = change.iter().map(Curvature::strongest).collect();
    report.fields.push(grid.scalar("curvature_change", "1/m", values, state));
}

/// How far a change lies beyond its noise: chi squared with three degrees of freedom when nothing changed.
fn surprise(change: &Curvature, sigma: [f64; 3]) -> f64 {
    [change.u, change.v, change.uv].iter().zip(sigma).map(|(c, s)| (c / s).powi(2)).sum()
}

/// How much less the change scatters than stated, as a share of the variance.
///
/// The splines' covariances count what smoothing takes away from the plate's own shape; between two scans of a shape that
/// stayed, that is the same both times and cancels. How much it is cannot be told from the splines, but from the
/// quieter part of the plate (B. Efron, Large-scale simultaneous hypothesis testing: the choice of a null hypothesis,
/// JASA 99, 2004): the first quartile, so that a change of up to half of the plate hardly matters. Never above 1: a
/// plate that is less quiet than stated has changed, or wants calibrating.
fn scale(mut surprise: Vec<f64>) -> f64 {
    let quartile = surprise.len() / 4;
    if surprise.is_empty() {
        return 1.0;
    }
    let (_, quiet, _) = surprise.select_nth_unstable_by(quartile, f64::total_cmp);
    (*quiet / CHI_SQUARED[1]).min(1.0)
}

fn figures(number: usize, band: &Band) -> [Figure; 4] {
    let named = |what: &str| format!("bend.{number}.{what}");
    let (uncertainty, at) = (Some(band.uncertainty), Some(band.centre));
    [
        Figure { uncertainty, at, ..figure(named("angle"), band.angle, "rad") },
        figure(named("direction"), band.direction, "rad"),
        figure(named("length"), band.length, "m"),
        figure(named("width"), band.width, "m"),
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
