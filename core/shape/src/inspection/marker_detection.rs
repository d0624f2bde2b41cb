//! Marker detection: dark discs painted on the plate, located by their intensity (Masuda et al., marker experiment).
//!
//! In: samples, fitted surface, expected place (u, v). Out: the middle of the disc on the scanned face, metres, with
//! its standard deviation.
//!
//! Every beam near the expected place is intersected with the tangent plane of the fitted surface there, so that noise
//! of the range does not move a disc. The middle of the disc is that of the circle whose rim best separates dark cells
//! from bright ones. The uncertainty follows from the size of the cells relative to the disc: a cell locates the rim to
//! its own width.

use nalgebra::Matrix3;
use platen_numerics::median::median;

use crate::{Patch, Surface, Vec3};

/// Share of the median intensity around it below which a cell is dark: paint returns a seventh of the power that mill
/// scale returns, and the ratio of intensities is at most the root of that of powers.
const DARK: f64 = 0.7;

/// Least number of dark cells of a disc: dropouts and rust affect one or two cells.
const LEAST_CELLS: usize = 6;

/// Share of the largest spot's cells above which a second spot makes the detection ambiguous.
const RIVAL: f64 = 0.5;

/// Largest ratio of a disc's longest to its shortest spread.
const ROUND: f64 = 2.0;

/// A detected disc and its offset from the expected place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DetectedMarker {
    /// Middle, on the scanned face, metres, scanner frame.
    pub centre: Vec3,
    /// Offset from the expected place along u and along v of the surface there, metres.
    pub offset: [f64; 2],
    /// Standard deviation of the middle along any direction in the surface, metres, due to the cells' spacing.
    pub sigma: f64,
    /// Number of dark cells.
    pub cells: usize,
    /// Intensity of the disc as a share of that of the plate around it.
    pub contrast: f64,
}

/// Reason why no disc was detected.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NoMarker {
    /// The place was not seen.
    #[error("not seen")]
    Unseen,
    /// No dark cells there.
    #[error("no dark disc")]
    Bright,
    /// Two spots, or one that is not a disc.
    #[error("dark, but not one round disc")]
    Ambiguous,
}

/// Place of a beam in the tangent plane at the expected place.
struct Cell {
    at: [f64; 2],
    lattice: [u32; 2],
    intensity: f64,
}

/// Detects the disc that is expected at (u, v), within `reach` metres of that place.
///
/// # Errors
/// [`NoMarker`].
pub fn detect_marker(
    patch: &Patch,
    surface: &Surface,
    [u, v]: [f64; 2],
    reach: f64,
) -> Result<DetectedMarker, NoMarker> {
    let (middle, normal) = (surface.face(u, v), surface.normal(u, v));
    let along_u = surface.derivatives(u, v).u.normalize();
    let along_v = normal.cross(&along_u);
    let near = patch.samples.iter().filter(|sample| (sample.point - middle).norm() < reach);
    let cells: Vec<Cell> = near
        .map(|sample| {
            let met = sample.point * (middle.dot(&normal) / sample.point.dot(&normal)) - middle;
            Cell {
                at: [met.dot(&along_u), met.dot(&along_v)],
                lattice: [sample.column, sample.row],
                intensity: f64::from(sample.intensity),
            }
        })
        .collect();
    let plate = median(cells.iter().map(|cell| cell.intensity).collect()).ok_or(NoMarker::Unseen)?;
    let mut spots = spots(&cells, DARK * plate);
    spots.sort_by_key(|spot| std::cmp::Reverse(spot.len()));
    let spot = spots.first().filter(|spot| spot.len() >= LEAST_CELLS).ok_or(NoMarker::Bright)?;
    let rival = spots.get(1).is_some_and(|second| second.len() as f64 > RIVAL * spot.len() as f64);
    let dark = median(spot.iter().map(|i| cells[*i].intensity).collect()).unwrap_or(0.0);
    let (centre, spread) = moments(spot.iter().map(|i| cells[*i].at));
    if rival || spread[1] > ROUND * spread[0] {
        return Err(NoMarker::Ambiguous);
    }
    let darkness = |cell: &Cell| ((plate - cell.intensity) / (plate - dark)).clamp(0.0, 1.0);
    let first = Circle { centre, radius: spread[0] + spread[1] };
    let step = (std::f64::consts::PI / spot.len() as f64).sqrt() * first.radius;
    let round: Vec<([f64; 2], f64)> = cells
        .iter()
        .filter(|cell| distance(cell.at, centre) < 2.0 * first.radius)
        .map(|cell| (cell.at, darkness(cell)))
        .collect();
    let Circle { centre: offset, radius } = first.fitted(&round, 0.5 * step);
    let centre = middle + along_u * offset[0] + along_v * offset[1];
    let across = [0, 1].map(|k| {
        let places = spot.iter().map(|i| cells[*i].lattice[k]);
        places.clone().max().unwrap_or(0) - places.min().unwrap_or(0) + 1
    });
    let sigma = sampled(radius, across);
    Ok(DetectedMarker { centre, offset, sigma, cells: spot.len(), contrast: dark / plate })
}

/// Returns the standard deviation of the middle of a disc that is `cells` columns and rows of the lattice wide, mean
/// over directions.
///
/// Columns are a apart and rows b. Along a row the rim is known to a / sqrt 12 at either end, and there are 2 radius /
/// b rows; likewise along columns. Over a round rim the sum of both variances is a b (a + b) / (12 pi radius).
fn sampled(radius: f64, cells: [u32; 2]) -> f64 {
    let [a, b] = cells.map(|n| 2.0 * radius / f64::from(n));
    (0.5 * a * b * (a + b) / (12.0 * std::f64::consts::PI * radius)).sqrt()
}

/// Returns the connected sets of dark cells on the lattice.
fn spots(cells: &[Cell], below: f64) -> Vec<Vec<usize>> {
    let mut left: Vec<usize> = (0..cells.len()).filter(|i| cells[*i].intensity < below).collect();
    let touch = |a: usize, b: usize| {
        let [p, q] = [cells[a].lattice, cells[b].lattice];
        p[0].abs_diff(q[0]) <= 1 && p[1].abs_diff(q[1]) <= 1
    };
    let mut spots = Vec::new();
    while let Some(first) = left.pop() {
        let mut spot = vec![first];
        let mut next = 0;
        while let Some(&here) = spot.get(next) {
            next += 1;
            let (joins, apart) = left.iter().partition(|other| touch(here, **other));
            left = apart;
            let joins: Vec<usize> = joins;
            spot.extend(joins);
        }
        spots.push(spot);
    }
    spots
}

/// A circle in the tangent plane.
#[derive(Debug, Clone, Copy)]
struct Circle {
    centre: [f64; 2],
    radius: f64,
}

impl Circle {
    /// Fits the circle inside which cells are dark: least squares of their darkness against 1 / (1 + exp((distance -
    /// radius) / blur)) by the Gauss-Newton method.
    fn fitted(mut self, cells: &[([f64; 2], f64)], blur: f64) -> Self {
        /// Number of steps, more than sufficient: steps shrink by half or more.
        const ROUNDS: usize = 12;
        for _ in 0..ROUNDS {
            let (mut normal, mut right) = (Matrix3::zeros(), Vec3::zeros());
            for (at, darkness) in cells {
                let away = distance(*at, self.centre).max(1e-9);
                let expected = 1.0 / (1.0 + ((away - self.radius) / blur).exp());
                let slope = expected * (1.0 - expected) / blur;
                let [x, y] = [0, 1].map(|k| (at[k] - self.centre[k]) / away);
                let row = Vec3::new(x, y, 1.0) * slope;
                normal += row * row.transpose();
                right += row * (darkness - expected);
            }
            let Some(step) = normal.cholesky().map(|factor| factor.solve(&right)) else { return self };
            // A step is limited to the blur, beyond which the slopes are not valid.
            let step = step * (blur / step.norm().max(blur));
            self.centre = [self.centre[0] + step.x, self.centre[1] + step.y];
            self.radius += step.z;
        }
        self
    }
}

/// Returns the mean of places, and their standard deviations along the shortest and the longest axis.
fn moments(places: impl Iterator<Item = [f64; 2]> + Clone) -> ([f64; 2], [f64; 2]) {
    let n = places.clone().count().max(1) as f64;
    let mean = [0, 1].map(|k| places.clone().map(|at| at[k]).sum::<f64>() / n);
    let moment =
        |i: usize, k: usize| places.clone().map(|at| (at[i] - mean[i]) * (at[k] - mean[k])).sum::<f64>() / n;
    let (a, b, c) = (moment(0, 0), moment(0, 1), moment(1, 1));
    let spread = (0.25 * (a - c).powi(2) + b * b).sqrt();
    (mean, [0.5 * (a + c) - spread, 0.5 * (a + c) + spread].map(|variance| variance.max(0.0).sqrt()))
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Sample;
    use crate::surface::{Mask, SplineFit, UniformKnots};
    use platen_numerics::random::Random;

    /// A level plate of 1 m x 1 m, 6 m in front of the scanner and 3 m below it.
    const CORNER: [f64; 3] = [5.5, -0.5, -3.0];

    fn surface() -> Surface {
        let mut fit = SplineFit::new(UniformKnots::new(0.0, 1.0, 8), UniformKnots::new(0.0, 1.0, 8));
        for i in 0..2500 {
            let (u, v) = ((f64::from(i % 50) + 0.5) / 50.0, (f64::from(i / 50) + 0.5) / 50.0);
            fit.add(u, v, [CORNER[0] + u, CORNER[1] + v, CORNER[2] - 0.02], 1e6);
        }
        let mut mask = Mask::unseen(1.0, 1.0, 1.0);
        mask.mark(0.5, 0.5);
        Surface::new(fit.solve([0.0, 0.0, 1.0]).expect("determined"), 0.04, mask)
    }

    /// Returns a scan of that plate with 1 mm of noise and with spots painted around (u, v), each with its radius.
    fn scan(spots: &[([f64; 2], f64)]) -> Patch {
        let mut noise = Random::new(5);
        let mut samples = Vec::new();
        for column in 0..400 {
            for row in 0..300 {
                let (azimuth, elevation) = (0.0005 * (column as f64 - 200.0), -0.6 + 0.0005 * (row as f64));
                let ray = Vec3::new(
                    azimuth.cos() * elevation.cos(),
                    azimuth.sin() * elevation.cos(),
                    elevation.sin(),
                );
                let p = ray * (CORNER[2] / ray.z);
                let (u, v) = (p.x - CORNER[0], p.y - CORNER[1]);
                if !(0.0..=1.0).contains(&u) || !(0.0..=1.0).contains(&v) {
                    continue;
                }
                let dark = spots.iter().any(|(at, radius)| distance([u, v], *at) < *radius);
                let intensity = if dark { 400.0 } else { 1000.0 } * (1.0 + 0.02 * noise.normal());
                let point = p + ray * (1e-3 * noise.normal());
                samples.push(Sample { point, column, row, sigma: 1e-3, intensity: intensity as u16 });
            }
        }
        Patch { samples, azimuth_step: 0.0005, elevation_step: 0.0005, noise: 1e-3, ..Patch::default() }
    }

    #[test]
    fn a_disc_is_found_to_a_fraction_of_a_cell() {
        let at = [0.503, 0.481];
        let patch = scan(&[(at, 0.02)]);
        let disc = detect_marker(&patch, &surface(), [0.5, 0.49], 0.08).expect("painted");
        let error = [disc.offset[0] - 0.003, disc.offset[1] + 0.009];
        assert!(error[0].hypot(error[1]) < 0.4e-3, "{disc:?}");
        assert!((disc.contrast - 0.4).abs() < 0.03 && disc.cells > 20, "{disc:?}");
        let place = Vec3::new(CORNER[0] + at[0], CORNER[1] + at[1], CORNER[2]);
        assert!((disc.centre - place).norm() < 1e-3, "{disc:?}");
    }

    #[test]
    fn discs_lie_as_near_as_the_cells_allow() {
        let surface = surface();
        let (mut square, mut stated, discs) = (0.0, 0.0, 40);
        for k in 0..discs {
            // Anywhere within a cell.
            let at = [0.5 + 0.0137 * f64::from(k % 7), 0.47 + 0.0119 * f64::from(k / 7)];
            let disc = detect_marker(&scan(&[(at, 0.02)]), &surface, at, 0.08).expect("painted");
            square += disc.offset[0].hypot(disc.offset[1]).powi(2);
            stated += 2.0 * disc.sigma.powi(2);
        }
        let ratio = (square / stated).sqrt();
        println!("{:.3} mm rms, stated {:.3}", 1e3 * (square / 40.0).sqrt(), 1e3 * (stated / 40.0).sqrt());
        assert!((0.6..1.4).contains(&ratio), "observed over stated {ratio}");
    }

    #[test]
    fn what_is_no_disc_is_not_taken_for_one() {
        let surface = surface();
        let look = |spots: &[([f64; 2], f64)]| detect_marker(&scan(spots), &surface, [0.5, 0.5], 0.08).err();
        assert_eq!(look(&[]), Some(NoMarker::Bright));
        assert_eq!(look(&[([0.2, 0.2], 0.02)]), Some(NoMarker::Bright));
        assert_eq!(look(&[([0.47, 0.5], 0.015), ([0.54, 0.5], 0.015)]), Some(NoMarker::Ambiguous));
        let streak: Vec<([f64; 2], f64)> =
            (0..10).map(|k| ([0.45 + 0.01 * f64::from(k), 0.5], 0.008)).collect();
        assert_eq!(look(&streak), Some(NoMarker::Ambiguous));
        assert_eq!(detect_marker(&Patch::default(), &surface, [0.5, 0.5], 0.08), Err(NoMarker::Unseen));
    }
}
