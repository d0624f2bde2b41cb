//! Rim of the beam: faint or sharp, by the number of mixed pixels with a weak echo of the background.
//!
//! - The power of a laser beam falls off towards its rim. Among the mixed pixels of an edge there are then some that see
//!   little of the background: their echo of it lies between the detection limit and three times that.
//! - A beam that consists of a few rays, as in some simulators, sees a ray of the background or none. Such weak echoes
//!   are missing, and its pixels are mixed up to the rim, however bright both surfaces are. Taken for a beam with a
//!   faint rim it moves an edge by up to a tenth of its radius.
//!
//! In: the lattice lines of fitted edges. Out: whether the rim is sharp. Of 24 scenes each, Gaussian beams truncated at
//! their 1/e^2 radius have 0.2 to 1.3 of the expected number in 21, wider ones 0.7 to 1.3 in 23; with 13 rays 15 scenes
//! have none. Own.

use super::lattice_line::{BeamModel, LatticeLine};

/// Largest part of the expected number of weak echoes that is found where the rim is sharp.
const MOST_FOUND: f64 = 0.25;

/// Least expected number on which a decision can rest.
const LEAST_EXPECTED: f64 = 4.0;

/// Returns true when the mixed pixels on the lines of edges, each fitted with a beam, show a sharp rim.
pub(super) fn is_sharp<'a>(edges: impl Iterator<Item = (&'a [LatticeLine], BeamModel)>) -> bool {
    let weak = edges.flat_map(|(lines, beam)| lines.iter().filter_map(move |line| line.weak_echo(beam)));
    let (expected, found) = weak
        .fold((0.0, 0.0), |(all, n), (expected, is_weak)| (all + expected, n + f64::from(u8::from(is_weak))));
    expected > LEAST_EXPECTED && found < MOST_FOUND * expected
}

#[cfg(test)]
mod tests {
    use super::super::beam_shape::BeamShape;
    use super::super::contrast::ContrastDistribution;
    use super::super::contrast::tests::crossing;
    use super::super::lattice_line::tests::mixed_line;
    use super::*;

    /// Lines with one mixed pixel each, whose echo of the background is evenly distributed over the beam from the
    /// detection limit, or from the least share of a ray, to all of it.
    #[test]
    fn a_rim_without_weak_echoes_is_sharp() {
        let beam = BeamModel::of(6e-4, BeamShape::numbered(0), ContrastDistribution::PRIOR.mean());
        let lines = |least: f64, n: usize| -> Vec<LatticeLine> {
            let part = |k: usize| least + (0.99 - least) * (k as f64 / n as f64).powi(3);
            (0..n).map(|k| mixed_line(&crossing(part(k)))).collect()
        };
        let is_sharp = |lines: &[LatticeLine]| is_sharp(std::iter::once((lines, beam)));
        assert!(!is_sharp(&lines(0.0065, 400)));
        assert!(is_sharp(&lines(0.06, 400)));
        // Too few lines decide nothing.
        assert!(!is_sharp(&lines(0.06, 20)));
    }
}
