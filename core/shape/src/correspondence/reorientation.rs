//! Reorientation test: comparison of the curvature maps of two scans under all symmetries of the rectangle.
//!
//! In: the surfaces of two scans of one plate. Out: the turn by which the plate was put back between them, or none.
//!
//! The names of the corners follow from the previous scan by direction: u runs along the edge that still has the
//! direction in which u ran before. They are wrong for a plate that was put back after half a turn (a square one after
//! a quarter turn), or with its other face up. Under the correct names the scans differ only by the bends of the
//! stroke.
//!
//! Curvature requires no alignment. As long as strokes only add bends, another naming cannot fit better by chance,
//! since it leaves at least the bends of the stroke unexplained.
//!
//! Limits: a plate with the same curvature under a symmetry (flat, a whole cylinder) cannot be tested; only the names
//! differ then. Curvatures below about 0.01 1/m are lost in the scanner's cyclic range error, which bends every scan
//! differently.

use nalgebra::Matrix2;

use crate::Surface;

/// Number of places along each side at which curvatures are compared.
const PLACES: usize = 24;

/// Share of each side left out along the edges, where curvature is least certain.
const MARGIN: f64 = 0.05;

/// Standard deviation of a curvature due to the scanner's error, 1/m: a cyclic range error of amplitude 0.3 mm and
/// period 1.5 m on the plate has curvatures of up to 5e-3 1/m.
const SCANNER_SIGMA: f64 = 5e-3;

/// Sum of three squared differences, in standard deviations, from which a place counts as wholly changed: far beyond
/// chance.
const CHANGED: f64 = 40.0;

/// Least share of the plate that another naming must explain in addition to the given one.
const GAIN: f64 = 0.05;

/// Largest unexplained share under another naming, in parts of that under the given one.
const SHARE: f64 = 0.5;

/// Relative difference of sides below which they may be taken for each other: as much as a cut blank may differ from
/// its file.
const SQUARE: f64 = 0.01;

/// Kind of turn between two scans.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reorientation {
    /// A quarter turn either way; square plates only.
    Quarter,
    /// Half a turn.
    Half,
    /// The plate's other face is up.
    Over,
}

impl std::fmt::Display for Reorientation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Quarter => "by a quarter turn",
            Self::Half => "by half a turn",
            Self::Over => "with its other face up",
        })
    }
}

/// Returns the turn under which `now` matches the plate of the previous scan, if that fits and the given orientation
/// does not.
#[must_use]
pub fn reorientation(now: &Surface, before: &Surface) -> Option<Reorientation> {
    let left = |names: &Matrix2<f64>| unexplained(now, before, names);
    let given = left(&Matrix2::identity());
    let square = (now.width() - now.height()).abs() < SQUARE * now.width();
    let (kept, swapped) = (Matrix2::new(1.0, 0.0, 0.0, 1.0), Matrix2::new(0.0, 1.0, 1.0, 0.0));
    let signs = [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]];
    let others = [(true, kept), (square, swapped)]
        .into_iter()
        .filter(|(possible, _)| *possible)
        .flat_map(|(_, axes)| signs.map(|[u, v]| Matrix2::new(u, 0.0, 0.0, v) * axes))
        .skip(1);
    let (best, names) = others.map(|names| (left(&names), names)).min_by(|(a, _), (b, _)| a.total_cmp(b))?;
    let fits_better = given - best > GAIN && best < SHARE * given;
    fits_better.then(|| match (names.determinant() > 0.0, names[(0, 0)] == 0.0) {
        (false, _) => Reorientation::Over,
        (true, true) => Reorientation::Quarter,
        (true, false) => Reorientation::Half,
    })
}

/// Returns the share of the plate whose curvature differs when a place x of `now`, counted from the middle, is taken
/// for the place `names` x of the previous scan. Under names that mirror, the other face is seen, on which every
/// curvature has the opposite sign.
fn unexplained(now: &Surface, before: &Surface, names: &Matrix2<f64>) -> f64 {
    let side = names.determinant();
    let along = |k: usize| (1.0 - 2.0 * MARGIN) * (2.0 * (k as f64 + 0.5) / PLACES as f64 - 1.0);
    let at = |surface: &Surface, x: f64, y: f64| {
        [0.5 * surface.width() * (1.0 + x), 0.5 * surface.height() * (1.0 + y)]
    };
    let scanner = 2.0 * SCANNER_SIGMA * SCANNER_SIGMA;
    let (mut sum, mut n) = (0.0, 0_u32);
    for k in 0..PLACES * PLACES {
        let here = nalgebra::Vector2::new(along(k % PLACES), along(k / PLACES));
        let there = names * here;
        let [u, v] = at(now, here.x, here.y);
        let [u_then, v_then] = at(before, there.x, there.y);
        if !now.mask().seen(u, v) || !before.mask().seen(u_then, v_then) {
            continue;
        }
        let (is, was) = (now.curvature(u, v), before.curvature(u_then, v_then));
        let form = Matrix2::new(was.u, was.uv, was.uv, was.v);
        let expected = names.transpose() * form * names * side;
        let sigma = now.sigma_curvature(u, v);
        let sigma_then = before.sigma_curvature(u_then, v_then);
        let spread = Matrix2::new(sigma_then[0], sigma_then[2], sigma_then[2], sigma_then[1]).map(|s| s * s);
        let spread = names.abs().transpose() * spread * names.abs();
        let off = [
            (is.u - expected[(0, 0)], sigma[0], spread[(0, 0)]),
            (is.v - expected[(1, 1)], sigma[1], spread[(1, 1)]),
            (is.uv - expected[(0, 1)], sigma[2], spread[(0, 1)]),
        ];
        let surprise: f64 = off.iter().map(|(d, now, then)| d * d / (now * now + then + scanner)).sum();
        sum += (surprise / CHANGED).min(1.0);
        n += 1;
    }
    sum / f64::from(n.max(1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec3;
    use crate::surface::{Mask, SplineFit, UniformKnots};
    use platen_numerics::random::Random;

    const SIDE: f64 = 2.0;

    /// Amplitude of the scanner's cyclic error along the normal and its period on the plate, metres.
    const CYCLIC: [f64; 2] = [0.3e-3, 1.5];

    /// Builds a plate of 2 m by `height`, bent along u by bands of 0.03 rad around the places given. `names` map (u, v)
    /// to the material place scanned there, counted from the middle; names that mirror show the other face.
    fn plate(height: f64, bands: &[f64], names: Matrix2<f64>, seed: u64) -> Surface {
        let n = 2000_usize;
        let h = SIDE / n as f64;
        let mut profile = vec![(0.0, 0.0, 0.0_f64)];
        for i in 0..n {
            let (x, z, angle) = profile[i];
            let curvature = |u: f64| {
                bands.iter().map(|at| if (u - at).abs() < 0.1 { 0.03 / 0.2 } else { 0.0 }).sum::<f64>()
            };
            let next = angle + h * curvature((i as f64 + 0.5) * h);
            profile.push((x + h * next.cos(), z + h * next.sin(), next));
        }
        // The phases of an odd and an even seed are those of one error under half a turn.
        let wave = std::f64::consts::TAU / CYCLIC[1];
        let phase = if seed.is_multiple_of(2) { std::f64::consts::PI - wave * SIDE - 1.0 } else { 1.0 };
        let mut noise = Random::new(seed);
        let mut fit = SplineFit::new(UniformKnots::new(0.0, SIDE, 32), UniformKnots::new(0.0, height, 24));
        let side = names.determinant();
        for i in 0..20_000 {
            let at = [(f64::from(i % 160) + 0.5) / 160.0, (f64::from(i / 160) + 0.5) / 125.0];
            let there = names * nalgebra::Vector2::new(2.0 * at[0] - 1.0, 2.0 * at[1] - 1.0);
            let (u, v) = (0.5 * SIDE * (1.0 + there.x), 0.5 * height * (1.0 + there.y));
            let (x, z, angle) = profile[((u / h).round() as usize).min(n)];
            let cyclic = CYCLIC[0] * (wave * at[0] * SIDE + phase).sin();
            let off = 0.2e-3 * noise.normal() + cyclic;
            let p = Vec3::new(x - off * angle.sin(), v, z + off * angle.cos());
            // Seen from the other face, the plate is turned over about its v direction.
            let p = Vec3::new(p.x * side, p.y, p.z * side);
            fit.add(at[0] * SIDE, at[1] * height, p.into(), 1.0 / (0.2e-3_f64).powi(2));
        }
        let mut mask = Mask::unseen(SIDE, height, SIDE);
        mask.mark(0.0, 0.0);
        Surface::new(fit.solve([0.0, 0.0, 1.0]).expect("determined"), 0.04, mask)
    }

    fn names(m: [f64; 4]) -> Matrix2<f64> {
        Matrix2::new(m[0], m[1], m[2], m[3])
    }

    #[test]
    fn a_stroke_is_no_turn() {
        for (height, then, now) in [
            (SIDE, vec![], vec![]),
            (1.5, vec![], vec![]),
            (SIDE, vec![], vec![0.5]),
            (SIDE, vec![0.5], vec![0.5, 1.5]),
            (1.5, vec![0.5], vec![0.5, 1.5]),
            (1.5, vec![0.4, 0.6], vec![0.4, 0.6, 0.8, 1.2]),
        ] {
            let [before, after] = [(then.clone(), 1), (now.clone(), 2)]
                .map(|(bands, seed)| plate(height, &bands, Matrix2::identity(), seed));
            assert_eq!(reorientation(&after, &before), None, "{then:?} {now:?}");
        }
    }

    #[test]
    fn every_turn_of_a_bent_plate_is_detected() {
        let (then, now) = (&[0.4, 0.7][..], &[0.4, 0.7, 1.0][..]);
        for (height, m, expected) in [
            (1.5, [-1.0, 0.0, 0.0, -1.0], Reorientation::Half),
            (SIDE, [-1.0, 0.0, 0.0, -1.0], Reorientation::Half),
            (SIDE, [0.0, 1.0, -1.0, 0.0], Reorientation::Quarter),
            (SIDE, [0.0, -1.0, 1.0, 0.0], Reorientation::Quarter),
            (1.5, [-1.0, 0.0, 0.0, 1.0], Reorientation::Over),
            (SIDE, [0.0, 1.0, 1.0, 0.0], Reorientation::Over),
        ] {
            let before = plate(height, then, Matrix2::identity(), 3);
            let after = plate(height, now, names(m), 4);
            assert_eq!(reorientation(&after, &before), Some(expected), "{height} {m:?}");
        }
    }
}
