//! Cross section of the beam: rays with weights that stand for it.

use std::f64::consts::{PI, TAU};
use std::sync::LazyLock;

/// Cross section of the beam.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Beam {
    /// Gaussian, truncated at the radius of 1/e^2 of its intensity.
    Truncated,
    /// Gaussian with power beyond that radius, truncated at one and a half of it. Only cells next to an edge of the
    /// scene are mixed, whatever the step.
    Winged,
    /// Thirteen rays in fixed directions: the middle, six at 0.45 of the radius and six at 0.9. The mixing goes in
    /// steps, as that of the independent simulator from which the sample plates come.
    FewRays,
}

/// Ray of a beam: x, y in units of its 1/e^2 radius, weight.
pub(crate) type BeamRay = (f64, f64, f64);

/// Rays of a Gaussian beam.
const RAYS: usize = 61;

/// The outermost rays, whose convex hull holds all others: a straight edge that divides the rays divides these. For
/// speed only: `platen demo`.
pub(crate) const RIM: usize = 13;

/// Radius at which a beam with wings is truncated, in 1/e^2 radii: 1 % of the power lies beyond.
const WINGED_RADIUS: f64 = 1.5;

/// Radii of the rings of [`Beam::FewRays`].
const RINGS: [f64; 2] = [0.45, 0.9];

static TRUNCATED: LazyLock<[BeamRay; RAYS]> = LazyLock::new(|| gaussian(1.0));
static WINGED: LazyLock<[BeamRay; RAYS]> = LazyLock::new(|| gaussian(WINGED_RADIUS));
static FEW: LazyLock<[BeamRay; RIM]> = LazyLock::new(few);

impl Beam {
    /// Returns the rays, the outermost last.
    pub(crate) fn rays(self) -> &'static [BeamRay] {
        match self {
            Self::Truncated => &*TRUNCATED,
            Self::Winged => &*WINGED,
            Self::FewRays => &*FEW,
        }
    }

    /// Returns the angle by which the rays of a cell's beam are turned. That of a Gaussian beam differs from cell to
    /// cell, so that the steps between its rays do not add up along an edge.
    pub(crate) fn turned(self, column: u32, row: usize) -> f64 {
        if self == Self::FewRays {
            return 0.0;
        }
        let part = 0.618_033_988_749_895 * row as f64 + 0.414_213_562_373_095 * f64::from(column);
        TAU * part.fract()
    }
}

/// Samples a Gaussian beam truncated at a radius in equal areas on Vogel's spiral (1979). No two rays have the same
/// distance from an edge, so the power beyond the edge changes in small steps, whatever its direction.
fn gaussian(truncated: f64) -> [BeamRay; RAYS] {
    let golden_angle = PI * (3.0 - 5.0_f64.sqrt());
    std::array::from_fn(|k| ray(truncated * ((k as f64 + 0.5) / RAYS as f64).sqrt(), golden_angle * k as f64))
}

/// Returns the rays of [`Beam::FewRays`].
fn few() -> [BeamRay; RIM] {
    std::array::from_fn(|k| match k.checked_sub(1) {
        None => ray(0.0, 0.0),
        Some(k) => ray(RINGS[k / 6], TAU * (k % 6) as f64 / 6.0),
    })
}

/// Returns a ray of a Gaussian beam.
fn ray(radius: f64, angle: f64) -> BeamRay {
    let (sin, cos) = angle.sin_cos();
    (radius * cos, radius * sin, (-2.0 * radius * radius).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the part of the power of a truncated Gaussian beam beyond a line `off` its middle, by strips of equal
    /// width.
    fn beyond(truncated: f64, off: f64) -> f64 {
        const STRIPS: i32 = 400;
        let width = 2.0 * truncated / f64::from(STRIPS);
        let place = |k: i32| (f64::from(k) + 0.5) * width - truncated;
        let strip = |x: f64| {
            let inside = (0..STRIPS).map(place).filter(|y| x * x + y * y < truncated * truncated);
            inside.map(|y| (-2.0 * (x * x + y * y)).exp()).sum::<f64>()
        };
        let sum = |from: f64| (0..STRIPS).map(place).filter(|x| *x > from).map(strip).sum::<f64>();
        sum(off) / sum(-truncated)
    }

    #[test]
    fn the_rim_reaches_farthest_in_every_direction() {
        for angle in (0..720).map(|k| f64::from(k).to_radians() / 2.0) {
            let reach = |(x, y, _): &BeamRay| x * angle.cos() + y * angle.sin();
            let farthest = |rays: &[BeamRay]| rays.iter().map(reach).fold(f64::NEG_INFINITY, f64::max);
            let (inner, rim) = Beam::Truncated.rays().split_at(RAYS - RIM);
            assert!(farthest(inner) < farthest(rim), "{angle}");
        }
    }

    /// In each direction: the largest error of one beam, and the mean error of a hundred turned ones. The bounds of few
    /// rays are those of a beam of which a ray is a sixth of the power.
    #[test]
    fn the_power_beyond_an_edge_is_that_of_a_gaussian_beam() {
        let offs: Vec<f64> = (-9..=9).map(|k| 0.1 * f64::from(k)).collect();
        for (beam, truncated, bounds) in [
            (Beam::Truncated, 1.0, [0.1, 0.005]),
            (Beam::Winged, WINGED_RADIUS, [0.1, 0.005]),
            (Beam::FewRays, 1.0, [0.2, 0.2]),
        ] {
            let rays = beam.rays();
            let whole: f64 = rays.iter().map(|(_, _, weight)| weight).sum();
            let (mut most, mut mean) = (0.0_f64, 0.0_f64);
            for off in offs.iter().map(|off| off * truncated) {
                let exact = beyond(truncated, off);
                let error = |row: usize| {
                    let (sin, cos) = beam.turned(7, row).sin_cos();
                    let is_beyond = |(x, y, _): &&BeamRay| x * cos + y * sin > off;
                    let power: f64 = rays.iter().filter(is_beyond).map(|(_, _, weight)| weight).sum();
                    power / whole - exact
                };
                most = (0..100).map(error).fold(most, |most, error| most.max(error.abs()));
                mean = mean.max((0..100).map(error).sum::<f64>().abs() / 100.0);
            }
            println!("{beam:?}: {most:.3} at most, {mean:.4} in the mean");
            assert!(most < bounds[0] && mean < bounds[1], "{most} {mean}");
        }
    }
}
