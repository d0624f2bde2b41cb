//! Shape of a beam: position of an edge in a beam from the power on either side of it.
//!
//! The power of a beam falls off as a Gaussian. How far out a receiver detects it differs between instruments: the
//! models here are Gaussian beams truncated at 1 to 1.5 times the 1/e^2 radius (beyond 1.5 lies 1 % of the power). The
//! positions are in parts of the radius at which the beam ends, the footprint, so that the shape changes nothing but
//! the law between power and position.
//!
//! A beam of a few rays, as simulators have it, mixes in steps. Its positions scatter more than those of a smooth beam,
//! by which it is recognised (`edge`), and it has no faint rim: it is detected as mixed wherever one ray sees the other
//! side. Taken for a smooth beam it moves an edge by up to a tenth of its radius.
//!
//! In: log odds of the power beyond an edge. Out: the position of the edge, and its derivative. The integral over the
//! beam is tabulated, within 0.002 of the radius. Siegman, "Lasers" (1986), section 17.1, for the Gaussian beam. Own.

use std::sync::LazyLock;

use platen_numerics::normal_distribution::cdf;

/// Number of shapes, from the beam truncated at its 1/e^2 radius to that truncated at [`WIDEST`] times it.
pub(super) const SHAPES: usize = 9;
const WIDEST: f64 = 1.5;

/// Entries of a table per unit of the log odds, and the log odds at its end.
const PER_ODDS: usize = 8;
const MOST_ODDS: usize = 12;
const ENTRIES: usize = PER_ODDS * MOST_ODDS + 1;

/// Number of the shape that stands in where the mixed pixels do not determine it, and the precision of the prior about
/// it, in shapes^-2: that of a standard deviation of half of all shapes.
const USUAL: usize = 3;
const PRIOR: f64 = 0.0625;

/// Strips from the middle of a beam to its rim over which its power is summed.
const STRIPS: usize = 4000;

/// Largest derivative of a position by the log odds, in radii.
pub(super) const STEEPEST: f64 = 0.285;

/// Positions of the edge by the log odds, from 0 upwards, for every shape.
static TABLES: LazyLock<[[f64; ENTRIES]; SHAPES]> = LazyLock::new(|| {
    std::array::from_fn(|k| tabulate(1.0 + (WIDEST - 1.0) * k as f64 / (SHAPES - 1) as f64))
});

/// Least part of the radius up to which a beam is detected as mixed.
const LEAST_SEEN: f64 = 0.05;

/// Shape of a beam.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct BeamShape {
    positions: &'static [f64; ENTRIES],
    is_of_few_rays: bool,
}

impl BeamShape {
    /// Returns the shape of a smooth beam with a number below [`SHAPES`].
    pub(super) fn numbered(number: usize) -> Self {
        Self { positions: &TABLES[number], is_of_few_rays: false }
    }

    /// Returns the shape of a beam of a few rays, whose mixing goes in steps about that of the narrowest smooth beam.
    pub(super) fn of_few_rays() -> Self {
        Self { positions: &TABLES[0], is_of_few_rays: true }
    }

    /// Returns the shape of largest posterior probability, given the logarithm of the likelihood by shape: the vertex
    /// of the parabola through both ends and the middle.
    ///
    /// # Errors
    /// Those of the likelihood.
    pub(super) fn most_likely<E>(mut likelihood: impl FnMut(Self) -> Result<f64, E>) -> Result<Self, E> {
        const HALF: f64 = (SHAPES / 2) as f64;
        let mut posterior = |shape: usize| {
            let off = shape as f64 - USUAL as f64;
            Ok(likelihood(Self::numbered(shape))? - 0.5 * PRIOR * off * off)
        };
        let [low, middle, high] = [posterior(0)?, posterior(SHAPES / 2)?, posterior(SHAPES - 1)?];
        let bend = 2.0 * middle - low - high;
        let vertex = if bend > 0.0 { 0.5 * (high - low) / bend } else { (high - low).signum() };
        Ok(Self::numbered((HALF * (1.0 + vertex.clamp(-1.0, 1.0))).round() as usize))
    }

    /// Returns the distance from an edge up to which a beam is detected as mixed, in radii; that of a smooth beam is where
    /// the power beyond the edge has these log odds. A few rays have no faint rim: one of them is enough.
    pub(super) fn seen(self, log_odds: f64) -> f64 {
        if self.is_of_few_rays { 1.0 } else { self.place(log_odds).0.max(LEAST_SEEN) }
    }

    /// Returns the position of an edge in a beam, in radii from its middle, from the log odds of the power beyond the
    /// edge, and the derivative by these log odds.
    #[inline]
    pub(super) fn place(self, log_odds: f64) -> (f64, f64) {
        let table = self.positions;
        let entry = (log_odds.abs() * PER_ODDS as f64).min((ENTRIES - 2) as f64);
        let below = (entry as u32 as usize).min(ENTRIES - 2);
        let step = table[below + 1] - table[below];
        let place = table[below] + (entry - below as f64) * step;
        (place.copysign(log_odds), PER_ODDS as f64 * step)
    }
}

/// Tabulates the positions for a Gaussian beam truncated at `extent` times its 1/e^2 radius.
fn tabulate(extent: f64) -> [f64; ENTRIES] {
    // The power beyond the inner side of each strip, from the rim inwards.
    let mut sum = 0.0;
    let beyond: Vec<f64> = (0..STRIPS)
        .rev()
        .map(|strip| {
            let x = extent * (strip as f64 + 0.5) / STRIPS as f64;
            let chord = (extent * extent - x * x).sqrt();
            sum += (-2.0 * x * x).exp() * (2.0 * cdf(2.0 * chord) - 1.0);
            sum
        })
        .collect();
    std::array::from_fn(|entry| {
        let log_odds = entry as f64 / PER_ODDS as f64;
        let wanted = 2.0 * sum / (1.0 + log_odds.exp());
        let strips = beyond.partition_point(|power| *power < wanted);
        let outer = if strips == 0 { 0.0 } else { beyond[strips - 1] };
        let inner = beyond[strips.min(STRIPS - 1)];
        let part = if inner > outer { (wanted - outer) / (inner - outer) } else { 0.0 };
        1.0 - (strips as f64 + part) / STRIPS as f64
    })
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Returns the part of the power of a beam truncated at `extent` radii beyond a line `off` its middle, in radii, by
    /// a sum over a fine square grid.
    pub(crate) fn power_beyond(extent: f64, off: f64) -> f64 {
        const SIDE: i32 = 1000;
        let place = |k: i32| extent * (f64::from(2 * k + 1) / f64::from(SIDE) - 1.0);
        let (mut whole, mut beyond) = (0.0, 0.0);
        for x in (0..SIDE).map(place) {
            let chord = (0..SIDE).map(place).filter(|y| x * x + y * y < extent * extent);
            let power: f64 = chord.map(|y| (-2.0 * (x * x + y * y)).exp()).sum();
            whole += power;
            beyond += if x > off { power } else { 0.0 };
        }
        beyond / whole
    }

    #[test]
    fn the_power_beyond_an_edge_gives_its_position() {
        for (shape, extent) in [(0, 1.0), (4, 1.25), (8, 1.5)] {
            for off in [0.0, 0.3, 0.6, 0.8, 0.95] {
                let beyond = power_beyond(extent, -off * extent);
                let log_odds = (beyond / (1.0 - beyond)).ln();
                let (place, slope) = BeamShape::numbered(shape).place(log_odds);
                assert!((place - off).abs() < 2e-3, "{extent} {off}: {place}");
                assert!((0.0..=STEEPEST).contains(&slope), "{extent} {off}: {slope}");
                assert!((BeamShape::numbered(shape).place(-log_odds).0 + place).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn a_smooth_beam_is_detected_by_its_power_and_one_of_few_rays_up_to_its_rim() {
        let (smooth, stepped) = (BeamShape::numbered(0), BeamShape::of_few_rays());
        assert!(smooth.seen(2.0) < smooth.seen(5.0) && smooth.seen(5.0) < 1.0);
        assert_eq!(smooth.seen(0.0), LEAST_SEEN);
        assert_eq!([0.0, 2.0, 5.0].map(|odds| stepped.seen(odds)), [1.0; 3]);
        assert_eq!(stepped.place(2.0), smooth.place(2.0));
    }

    #[test]
    fn no_odds_reach_beyond_the_rim() {
        for shape in (0..SHAPES).map(BeamShape::numbered) {
            let (place, slope) = shape.place(f64::INFINITY);
            assert!((0.98..=1.0).contains(&place) && slope >= 0.0, "{place} {slope}");
        }
    }

    #[test]
    fn the_most_likely_shape_is_the_vertex_of_a_parabola() {
        let number = |shape: BeamShape| (0..SHAPES).find(|k| BeamShape::numbered(*k) == shape).unwrap();
        let of = |likelihood: &dyn Fn(f64) -> f64| {
            number(BeamShape::most_likely(|shape| Ok::<_, ()>(likelihood(number(shape) as f64))).unwrap())
        };
        assert_eq!(of(&|k| -100.0 * (k - 6.0).powi(2)), 6);
        assert_eq!(of(&|k| -100.0 * k), 0);
        assert_eq!(of(&|k| 100.0 * k * k), 8);
        assert_eq!(of(&|_| 0.0), USUAL);
    }
}
