//! Contrast of the plate and what lies behind it: where an edge crosses a mixed pixel, by linear mixing.
//!
//! 1. Linear mixing model: the range of a mixed pixel is the mean of both sides weighted by their echoes. It tells the odds of the background, its echo
//!    over that of the face: C s / (1 - s), where s is the part of the beam's power beyond the edge and C the contrast, the echo of the background alone over
//!    that of the face alone.
//! 2. So the range of one mixed pixel gives s, and s where in the beam the edge is, given the contrast: between where it is in a Gaussian beam, and in one
//!    truncated at its radius (1/e^2).
//! 3. The contrast, as the ratio of the reflectivities, is one unknown for each plane of the background, found together with the edge: the mixed pixels of one plane share it, those at the
//!    ends of their row, where the beam sees nearly one side only, tell it. Along the plane it follows the cosines of the incidence on the face and on the
//!    plane (Lambert's law) and the square of the ranges.
//! 4. The edges before a plane share its contrast: each is fitted with what the others tell as its prior (belief propagation, exact for normal
//!    distributions on a tree).
//! 5. A receiver need not mix linearly: how far the mixed pixels of an edge scatter about it is estimated with it, and they count by that; not at all
//!    where their ranges lie anywhere between the two surfaces.
//! 6. A beam that sees so little of one side that its range stays within the detection limit is not found mixed. Where the background outshines the face
//!    (C > 1) that side is the face: pixels are found mixed farther inside of the edge than outside.
//!
//! In: one lattice line; out: [`Mixing`], what its likelihood needs. Own. Limits: how much power a beam has near its rim differs between instruments; a beam with
//! wings is found mixed farther inside.

use platen_numerics::median::robust_deviation;

use super::edge_likelihood::SharedObservation;
use super::height_field::LEAST_COSINE;
use crate::Vec3;
use crate::extract::{BACKGROUND_PLANES, Beyond, Crossing, DETECTION_LIMIT};

/// Place of an edge in a beam by the log odds l of the power beyond it, in radii: l / (A + B l^2). A Gaussian beam has A = 3.19, B = 0.034, one truncated at its radius
/// 3.52 and 0.080 (each within 0.01 up to l = 5); these are midway.
const PLACE: (f64, f64) = (3.35, 0.057);

/// Standard deviation of that place by the shape of the beam, over l^2: half the difference of both, and that by an error of the radius.
const PLACE_SPREAD: f64 = 0.01;

/// Least standard deviation of the place by one pixel, in radii: the shape of the beam has all pixels of a row off alike, however little they scatter.
/// With half of it corners of 40 plates of mill scale are up to 2.5 mm off instead of 1.8.
const LEAST_SPREAD: f64 = 0.2;

/// Log odds beyond which a pixel tells no more.
const MOST_ODDS: f64 = 5.0;

/// Prior of the logarithm of the ratio of the reflectivities of background and plate: mean and standard deviation. Walls of 0.8 and floors of 0.3 behind plates
/// of 0.1 to 0.6.
const PRIOR: (f64, f64) = (0.7, 0.7);

/// Standard deviation of the logarithm of a contrast from one edge to another: planes are not evenly bright.
const BETWEEN_EDGES: f64 = 0.1;

/// Part of the prior's precision above which an edge tells a contrast.
const LEAST_TOLD: f64 = 1e-3;

/// Scatter of such places from one mixed pixel to the other that is expected, in radii, and how many pixels it counts for.
const SCATTER: (f64, f64) = (0.2, 10.0);

/// Largest scatter of a receiver that mixes linearly, in radii: edges of 40 random scenes have 0.05 to 0.23. Ranges anywhere between the two surfaces scatter by 0.48
/// where all beams have the edge at one place, by more elsewhere.
const MOST_SCATTER: f64 = 0.33;

/// Scatter that stands for pixels which tell nothing, in radii.
pub(super) const NOTHING_TOLD: f64 = 10.0;

/// Least jump of the range from the face to the background whose mixed pixels are told from both, metres.
const LEAST_JUMP: f64 = 0.05;

/// Largest part of the jump at which a mixed pixel is told from a surface.
const MOST_LIMIT: f64 = 0.45;

/// Least part of the radius at which a beam is found mixed.
const LEAST_SEEN: f64 = 0.05;

/// Logarithms of the ratio of the reflectivities of each background plane and the plate.
#[derive(Debug, Clone, Copy)]
pub(super) struct Contrasts([f64; BACKGROUND_PLANES]);

impl Contrasts {
    /// Returns true when no edge moves by more than a hundredth of the beam's radius between these and others.
    pub(super) fn are_near(&self, other: &Self) -> bool {
        self.0.iter().zip(&other.0).all(|(one, other)| (one - other).abs() < 0.01 * PLACE.0)
    }

    /// Takes as many as there are planes.
    pub(super) fn of(logarithms: &[f64]) -> Self {
        Self(std::array::from_fn(|plane| logarithms[plane]))
    }

    /// Returns them in the order of the planes.
    pub(super) fn logarithms(&self) -> &[f64] {
        &self.0
    }
}

/// Independent normal distributions of these logarithms: mean and standard deviation of each.
#[derive(Debug, Clone, Copy)]
pub(super) struct ContrastDistribution([(f64, f64); BACKGROUND_PLANES]);

impl ContrastDistribution {
    /// Before any mixed pixel is seen.
    pub(super) const PRIOR: Self = Self([PRIOR; BACKGROUND_PLANES]);

    /// Takes means and standard deviations in the order of the planes.
    pub(super) fn of(contrasts: &Contrasts, spread: impl Fn(usize) -> f64) -> Self {
        Self(std::array::from_fn(|plane| (contrasts.0[plane], spread(plane))))
    }

    /// Combines the prior with what edges tell that were fitted with that prior.
    pub(super) fn told_by<'a>(edges: impl Iterator<Item = &'a Self>) -> Self {
        let prior = PRIOR.1.powi(-2);
        let mut sums = [(prior, prior * PRIOR.0); BACKGROUND_PLANES];
        for edge in edges {
            for ((precision, weighted), (mean, spread)) in sums.iter_mut().zip(&edge.0) {
                let told = spread.powi(-2) - prior;
                if told > LEAST_TOLD * prior {
                    let mean = (spread.powi(-2) * mean - prior * PRIOR.0) / told;
                    let weight = 1.0 / (1.0 / told + BETWEEN_EDGES * BETWEEN_EDGES);
                    *precision += weight;
                    *weighted += weight * mean;
                }
            }
        }
        Self(sums.map(|(precision, weighted)| (weighted / precision, precision.powf(-0.5))))
    }

    /// Returns mean and standard deviation in the order of the planes.
    pub(super) fn planes(&self) -> &[(f64, f64)] {
        &self.0
    }

    /// Returns the contrasts that are expected.
    pub(super) fn mean(&self) -> Contrasts {
        self.off(0.0)
    }

    /// Returns the contrasts that all are so many standard deviations above the mean.
    pub(super) fn off(&self, deviations: f64) -> Contrasts {
        Contrasts(self.0.map(|(mean, spread)| mean + deviations * spread))
    }
}

/// Estimates how far the places of an edge by its mixed pixels scatter, in radii of the beam, from the sizes of its distances from them: a receiver need not mix
/// linearly. Returns the scatter expected without any.
pub(super) fn spread(sizes: Vec<f64>) -> f64 {
    let (expected, weight) = SCATTER;
    let n = sizes.len() as f64;
    let scatter = robust_deviation(sizes).unwrap_or(0.0);
    if scatter > MOST_SCATTER {
        return NOTHING_TOLD;
    }
    ((n * scatter * scatter + weight * expected * expected) / (n + weight)).sqrt()
}

/// Returns the place of an edge in a beam, in radii from its middle, by the log odds of the power beyond it, and the slope of it.
fn place_in_beam(log_odds: f64) -> (f64, f64) {
    let (a, b) = PLACE;
    let l = log_odds.clamp(-MOST_ODDS, MOST_ODDS);
    let by = a + b * l * l;
    (l / by, (a - b * l * l) / (by * by))
}

/// Linear mixing along one lattice line before a background plane.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mixing {
    /// Number of the plane.
    plane: usize,
    /// Logarithm of the contrast by incidence and range.
    by_geometry: f64,
    /// Largest log odds of either surface at which a pixel is found mixed.
    most_odds: f64,
    /// Logarithm of the odds of the background in a single mixed pixel.
    odds: Option<f64>,
}

impl Mixing {
    /// Measures the mixing of a crossing all of whose cells were measured; `None` without a background plane. `noise` is that of ranges, metres.
    pub(super) fn of(crossing: &Crossing, noise: f64) -> Option<Self> {
        let jump = f64::from(crossing.excess);
        let plane = crossing
            .background
            .filter(|_| crossing.complete && crossing.beyond == Beyond::Behind && jump > LEAST_JUMP)?;
        let range = crossing.inside.norm();
        let on_face = crossing.normal.dot(&-crossing.inside) / range;
        let on_plane = f64::from(plane.distance) / (range + jump);
        let [on_face, on_plane] = [on_face, on_plane].map(|cosine| cosine.max(LEAST_COSINE));
        let limit = (DETECTION_LIMIT * noise / jump).min(MOST_LIMIT);
        let is_single = |[near, far]: [Vec3; 2]| near == far && far != crossing.outside;
        let single = crossing.mixed.filter(|pixels| is_single(pixels.ends));
        let part = single.map(|pixels| f64::from(pixels.excess) / jump);
        Some(Self {
            plane: usize::from(plane.number),
            by_geometry: (on_plane / on_face).ln() - 2.0 * (1.0 + jump / range).ln(),
            most_odds: ((1.0 - limit) / limit).ln(),
            odds: part.filter(|part| *part > 0.0 && *part < 1.0).map(|part| (part / (1.0 - part)).ln()),
        })
    }

    /// Returns the same without what a mixed pixel tells: of a silhouette that is not the edge of the face.
    pub(super) fn without_odds(self) -> Self {
        Self { odds: None, ..self }
    }

    /// Returns the parts of the beam's radius inside and outside of the edge up to which it is found mixed.
    pub(super) fn seen(&self, contrasts: &Contrasts) -> [f64; 2] {
        let contrast = contrasts.0[self.plane] + self.by_geometry;
        [self.most_odds + contrast, self.most_odds - contrast]
            .map(|odds| place_in_beam(odds).0.clamp(LEAST_SEEN, 1.0))
    }

    /// Returns true for a single mixed pixel.
    pub(super) fn tells(&self) -> bool {
        self.odds.is_some()
    }

    /// Returns the place of the edge by a single mixed pixel at `at`, of a beam of this radius on the face, linear about these contrasts; such places
    /// scatter by `spread`, in radii.
    pub(super) fn edge(
        &self,
        at: f64,
        radius: f64,
        contrasts: &Contrasts,
        spread: f64,
    ) -> Option<SharedObservation> {
        let contrast = contrasts.0[self.plane];
        self.odds.map(|odds| {
            let log_odds = odds - self.by_geometry - contrast;
            let (place, slope) = place_in_beam(log_odds);
            let by_place = PLACE_SPREAD * log_odds * log_odds;
            SharedObservation {
                place: at + radius * (place + slope * contrast),
                soft: radius * (spread * spread + LEAST_SPREAD * LEAST_SPREAD + by_place * by_place).sqrt(),
                radius,
                number: self.plane,
                factor: radius * slope,
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use platen_numerics::normal_distribution::cdf;

    use super::*;
    use crate::extract::{MixedPixels, PlaneBehind, PlaneSet};

    const JUMP: f64 = 2.0;
    const RANGE: f64 = 8.0;

    /// A crossing straight below the scanner, before a plane 2 m behind it whose echo is part of a mixed pixel's.
    fn crossing(background: f64) -> Crossing {
        let at = |y: f64| Vec3::new(0.0, y, -RANGE);
        Crossing {
            sample: 0,
            step: [0, -1],
            cells: 2,
            inside: at(5e-3),
            outside: at(-5e-3),
            normal: Vec3::z(),
            mixed: Some(MixedPixels { ends: [at(0.0); 2], excess: (background * JUMP) as f32 }),
            surely_mixed: None,
            strips: PlaneSet::default(),
            complete: true,
            excess: JUMP as f32,
            background: Some(PlaneBehind { number: 2, distance: (RANGE + JUMP) as f32 }),
            beyond: Beyond::Behind,
        }
    }

    /// Contrasts of planes whose echo is so many times that of the face, seen as squarely.
    fn contrasts(times: f64) -> Contrasts {
        Contrasts::of(&[times.ln() + 2.0 * (1.0 + JUMP / RANGE).ln(); BACKGROUND_PLANES])
    }

    /// Edges that tell the first plane's contrast and that of no other.
    #[test]
    fn edges_tell_each_other_the_contrast_of_a_plane() {
        let own = 0.2_f64;
        let told = |mean: f64| {
            let precision = own.powi(-2) + PRIOR.1.powi(-2);
            let mean = (mean * own.powi(-2) + PRIOR.0 * PRIOR.1.powi(-2)) / precision;
            let mut planes = [PRIOR; BACKGROUND_PLANES];
            planes[0] = (mean, precision.powf(-0.5));
            ContrastDistribution(planes)
        };
        let edges = [told(-1.0), told(-1.4)];
        let of = ContrastDistribution::told_by(edges.iter());
        // Both with the spread between edges, and the prior.
        let both = 2.0 / (own * own + BETWEEN_EDGES * BETWEEN_EDGES);
        let precision = both + PRIOR.1.powi(-2);
        let (mean, spread) = of.planes()[0];
        assert!((mean - (both * -1.2 + PRIOR.1.powi(-2) * PRIOR.0) / precision).abs() < 1e-12, "{mean}");
        assert!((spread - precision.powf(-0.5)).abs() < 1e-12, "{spread}");
        assert!((of.planes()[1].0 - PRIOR.0).abs() < 1e-12 && (of.planes()[1].1 - PRIOR.1).abs() < 1e-12);
    }

    /// Part of the power of a Gaussian beam truncated at `most` radii beyond a line `off` its middle, by strips of equal width.
    fn beyond(most: f64, off: f64) -> f64 {
        const STRIPS: i32 = 1000;
        let strip = |k: i32| {
            let x = most * (f64::from(2 * k + 1) / f64::from(STRIPS) - 1.0);
            // Half the chord there, and the power along it.
            let chord = (most * most - x * x).sqrt();
            (x, (-2.0 * x * x).exp() * (cdf(2.0 * chord) - 0.5))
        };
        let sum = |from: f64| (0..STRIPS).map(strip).filter(|(x, _)| *x > from).map(|(_, p)| p).sum::<f64>();
        sum(off) / sum(f64::NEG_INFINITY)
    }

    #[test]
    fn one_mixed_pixel_locates_the_edge_midway_between_a_gaussian_beam_and_a_truncated_one() {
        for times in [0.5, 1.0, 8.0_f64] {
            for edge in [-0.8, -0.3, 0.0, 0.5, 0.8] {
                let [gaussian, truncated] = [4.0, 1.0].map(|most| {
                    let beyond = beyond(most, -edge);
                    let part = times * beyond / (times * beyond + 1.0 - beyond);
                    let mixing = Mixing::of(&crossing(part), 1e-3).unwrap();
                    let found = mixing.edge(0.0, 1.0, &contrasts(times), 0.2).unwrap();
                    let at = found.place - found.factor * contrasts(times).0[found.number];
                    (at - edge) * edge.signum()
                });
                assert!(gaussian.abs() < 0.06 && truncated.abs() < 0.12, "{edge}: {gaussian} {truncated}");
                assert!(edge == 0.0 || gaussian < 0.0 && truncated > 0.0, "{edge}: {gaussian} {truncated}");
            }
        }
    }

    #[test]
    fn beams_before_what_outshines_the_face_are_found_mixed_farther_inside_than_outside() {
        let seen =
            |times: f64, noise: f64| Mixing::of(&crossing(0.5), noise).unwrap().seen(&contrasts(times));
        assert_eq!(seen(1.0, 1e-3), [1.0; 2]);
        let [inside, outside] = seen(10.0, 2e-3);
        // 24 mm of noise in 2 m: odds of 82, a tenth of them where the background is ten times as bright.
        let expected = place_in_beam((0.988_f64 / 0.012 / 10.0).ln()).0;
        assert!(inside == 1.0 && (outside - expected).abs() < 1e-6, "{outside}");
        assert!(seen(10.0, 4e-3)[1] < outside, "with more noise less is found");
        let [dark, bright] = seen(0.1, 2e-3);
        assert!((dark - outside).abs() < 1e-6 && bright == inside, "{dark}");
    }

    #[test]
    fn ranges_anywhere_between_the_surfaces_tell_nothing() {
        assert!((spread(Vec::new()) - SCATTER.0).abs() < 1e-12);
        let exact = spread(vec![0.0; 90]);
        // The scatter of one in ten.
        assert!((exact - (0.1 * SCATTER.0 * SCATTER.0).sqrt()).abs() < 1e-12, "{exact}");
        let anywhere =
            (1..1000).map(|k| f64::from(k) / 1000.0).map(|part| place_in_beam((part / (1.0 - part)).ln()).0);
        let uniform: Vec<f64> = anywhere.map(f64::abs).collect();
        assert!((robust_deviation(uniform.clone()).unwrap() - 0.476).abs() < 1e-3);
        assert_eq!(spread(uniform), NOTHING_TOLD);
    }

    #[test]
    fn only_a_single_mixed_pixel_before_a_plane_tells() {
        let of = |crossing: Crossing| Mixing::of(&crossing, 1e-3);
        let known = crossing(0.5);
        assert!(of(Crossing { background: None, ..known }).is_none());
        assert!(of(Crossing { complete: false, ..known }).is_none());
        assert!(of(Crossing { beyond: Beyond::Nothing, ..known }).is_none());
        let tells = |crossing: Crossing| of(crossing).is_some_and(|mixing| mixing.tells());
        assert!(tells(known));
        assert!(!tells(crossing(1.01)));
        assert!(!tells(Crossing { mixed: None, ..known }));
        let several = MixedPixels { ends: [known.inside, known.outside], excess: 0.5 };
        assert!(!tells(Crossing { mixed: Some(several), ..known }));
    }
}
