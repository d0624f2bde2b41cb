//! Contrast of plate and background, and the position of an edge within a mixed pixel, by the linear mixing model.
//!
//! 1. **Linear mixing.** The range of a mixed pixel is the mean of the ranges of both sides, weighted by their echoes.
//!    It determines the odds of the background, that is, its echo over that of the face: C s / (1 - s). Here s is the
//!    part of the beam's power beyond the edge, and C the contrast: the echo of the background alone over that of the
//!    face alone.
//! 2. **Position in the beam.** Given the contrast, the range of one mixed pixel gives s, and s the position of the
//!    edge in the beam. The position used is midway between that in a Gaussian beam and that in a beam truncated at its
//!    radius (1/e^2).
//! 3. **One unknown per plane.** The ratio of the reflectivities is one unknown for each plane of the background and is
//!    found together with the edge. All mixed pixels before a plane share it; it is determined by those at the ends of
//!    their row, where the beam sees nearly one side only. Along the plane the contrast follows from it by the cosines
//!    of the incidence on the face and on the plane (Lambert's law) and the square of the ranges.
//! 4. **Sharing between edges.** The edges before a plane share its contrast. Each is fitted with the results of the
//!    others as its prior (belief propagation, exact for normal distributions on a tree).
//! 5. **Receivers that do not mix linearly.** The scatter of the mixed pixels about their edge is estimated with the
//!    edge and sets their weight. They have no weight where their ranges lie anywhere between the two surfaces.
//! 6. **Detection limit.** A beam that sees so little of one side that its range stays within the detection limit is
//!    not detected as mixed. Where the background is brighter than the face (C > 1) that side is the face: pixels are
//!    detected as mixed farther inside of the edge than outside.
//!
//! In: one lattice line. Out: [`Mixing`], for the likelihood of that line. Own.
//!
//! Limits: the power of a beam near its rim differs between instruments; a beam with wings is detected as mixed farther
//! inside.
//! The jump of the range is that at the first cell beyond the edge. At grazing incidence it is some per cent smaller
//! than at the mixed pixel, and the contrast of a bright plane comes out too large.

use platen_numerics::median::robust_deviation;

use super::edge_likelihood::SharedObservation;
use super::height_field::LEAST_COSINE;
use crate::Vec3;
use crate::extract::{BACKGROUND_PLANES, Beyond, Crossing, DETECTION_LIMIT};

/// Position of an edge in a beam from the log odds l of the power beyond it, in radii: l / (A + B l^2). A Gaussian beam
/// has A = 3.19 and B = 0.034, a beam truncated at its radius A = 3.52 and B = 0.080 (each within 0.01 up to l = 5).
/// The values here are midway.
const PLACE: (f64, f64) = (3.35, 0.057);

/// Standard deviation of that position over l^2: half the difference of the two beam shapes, and the effect of an error
/// of the radius.
const PLACE_SPREAD: f64 = 0.01;

/// Least standard deviation of the position by one pixel, in radii: a wrong beam shape shifts all pixels of a row
/// alike, however little they scatter. With half this value corners of 40 plates of mill scale are up to 2.5 mm off
/// instead of 1.8 mm.
const LEAST_SPREAD: f64 = 0.2;

/// Log odds beyond which a pixel gives no further information.
const MOST_ODDS: f64 = 5.0;

/// Prior of the logarithm of the ratio of the reflectivities of background and plate: mean and standard deviation. It
/// covers walls of reflectivity 0.8 and floors of 0.3 behind plates of 0.1 to 0.6.
const PRIOR: (f64, f64) = (0.7, 0.7);

/// Standard deviation of the logarithm of a contrast between two edges before the same plane: planes are not evenly
/// bright.
const BETWEEN_EDGES: f64 = 0.1;

/// Precision that an edge must add to a contrast to be used, in parts of the prior's precision.
const LEAST_TOLD: f64 = 1e-3;

/// Expected scatter of these positions between mixed pixels, in radii, and the number of pixels whose weight this
/// expectation has.
const SCATTER: (f64, f64) = (0.2, 10.0);

/// Largest scatter of a receiver that mixes linearly, in radii: edges of 40 random scenes have 0.05 to 0.23. Ranges
/// anywhere between the two surfaces give a scatter of 0.48 where all beams have the edge at one place, and more
/// elsewhere.
const MOST_SCATTER: f64 = 0.33;

/// Scatter that stands for pixels without information, in radii.
pub(super) const NOTHING_TOLD: f64 = 10.0;

/// Least jump of the range from the face to the background at which mixed pixels are distinguished from both, metres.
const LEAST_JUMP: f64 = 0.05;

/// Largest part of the jump by which a mixed pixel must differ from a surface to be detected.
const MOST_LIMIT: f64 = 0.45;

/// Least part of the radius up to which a beam is detected as mixed.
const LEAST_SEEN: f64 = 0.05;

/// Logarithms of the ratio of the reflectivities of each background plane and the plate.
#[derive(Debug, Clone, Copy)]
pub(super) struct Contrasts([f64; BACKGROUND_PLANES]);

impl Contrasts {
    /// Returns true when no edge moves by more than a hundredth of the beam's radius between these and others.
    pub(super) fn are_near(&self, other: &Self) -> bool {
        self.0.iter().zip(&other.0).all(|(one, other)| (one - other).abs() < 0.01 * PLACE.0)
    }

    /// Copies the first logarithms, one for each plane.
    pub(super) fn of(logarithms: &[f64]) -> Self {
        Self(std::array::from_fn(|plane| logarithms[plane]))
    }

    /// Returns the logarithms in the order of the planes.
    pub(super) fn logarithms(&self) -> &[f64] {
        &self.0
    }
}

/// Independent normal distributions of these logarithms: mean and standard deviation of each.
#[derive(Debug, Clone, Copy)]
pub(super) struct ContrastDistribution([(f64, f64); BACKGROUND_PLANES]);

impl ContrastDistribution {
    /// Distribution before any mixed pixel is seen.
    pub(super) const PRIOR: Self = Self([PRIOR; BACKGROUND_PLANES]);

    /// Builds the distribution from means and from standard deviations by the number of the plane.
    pub(super) fn of(contrasts: &Contrasts, spread: impl Fn(usize) -> f64) -> Self {
        Self(std::array::from_fn(|plane| (contrasts.0[plane], spread(plane))))
    }

    /// Combines the prior with the results of edges that were fitted with that prior, each less the prior itself.
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

    /// Returns the contrasts that are all `deviations` standard deviations above the mean.
    pub(super) fn off(&self, deviations: f64) -> Contrasts {
        Contrasts(self.0.map(|(mean, spread)| mean + deviations * spread))
    }
}

/// Estimates the scatter of the edge positions by the mixed pixels, in radii of the beam, from the absolute distances
/// of these positions from the edge: a receiver need not mix linearly. Returns the expected scatter when there are no
/// distances.
pub(super) fn spread(sizes: Vec<f64>) -> f64 {
    let (expected, weight) = SCATTER;
    let n = sizes.len() as f64;
    let scatter = robust_deviation(sizes).unwrap_or(0.0);
    if scatter > MOST_SCATTER {
        return NOTHING_TOLD;
    }
    ((n * scatter * scatter + weight * expected * expected) / (n + weight)).sqrt()
}

/// Returns the position of an edge in a beam, in radii from its middle, from the log odds of the power beyond the edge,
/// and the derivative by these log odds.
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
    /// Part of the logarithm of the contrast that is due to incidence and range.
    by_geometry: f64,
    /// Largest log odds of either surface at which a pixel is detected as mixed.
    most_odds: f64,
    /// Logarithm of the odds of the background in a single mixed pixel.
    odds: Option<f64>,
}

impl Mixing {
    /// Determines the mixing of a crossing. `None` without a background plane, or where not all cells of the crossing
    /// were measured. `noise` is that of the ranges, metres.
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

    /// Returns the same without the odds of a mixed pixel, for a silhouette that is not the edge of the face.
    pub(super) fn without_odds(self) -> Self {
        Self { odds: None, ..self }
    }

    /// Returns the distances inside and outside of the edge up to which a beam is detected as mixed, in parts of its
    /// radius.
    pub(super) fn seen(&self, contrasts: &Contrasts) -> [f64; 2] {
        let contrast = contrasts.0[self.plane] + self.by_geometry;
        [self.most_odds + contrast, self.most_odds - contrast]
            .map(|odds| place_in_beam(odds).0.clamp(LEAST_SEEN, 1.0))
    }

    /// Returns true when a single mixed pixel determines the position of the edge.
    pub(super) fn tells(&self) -> bool {
        self.odds.is_some()
    }

    /// Returns the position of the edge by a single mixed pixel at `at`, linearised about these contrasts. `radius` is
    /// that of the beam on the face, metres, `spread` the scatter of such positions, in radii.
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
pub(super) mod tests {
    use platen_numerics::normal_distribution::cdf;

    use super::*;
    use crate::extract::{MixedPixels, PlaneBehind, PlaneSet};

    const JUMP: f64 = 2.0;
    const RANGE: f64 = 8.0;

    /// Returns a crossing straight below the scanner, before a plane 2 m behind it; `background` is the part of that
    /// plane in the echo of the mixed pixel.
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
            background: Some(PlaneBehind { number: 2, distance: (RANGE + JUMP) as f32, narrow: false }),
            beyond: Beyond::Behind,
        }
    }

    /// Returns the mixing of a pixel in whose echo both surfaces have the same part.
    pub(crate) fn half() -> Mixing {
        Mixing::of(&crossing(0.5), 1e-3).unwrap()
    }

    /// Returns the contrasts of planes whose echo is `times` that of the face at the same incidence.
    fn contrasts(times: f64) -> Contrasts {
        Contrasts::of(&[times.ln() + 2.0 * (1.0 + JUMP / RANGE).ln(); BACKGROUND_PLANES])
    }

    /// Edges that determine the contrast of the first plane only.
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

    /// Returns the part of the power of a Gaussian beam truncated at `most` radii beyond a line `off` its middle, by
    /// strips of equal width.
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
        // A limit of 24 mm in 2 m: odds of 82, a tenth of that where the background is ten times as bright.
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
        // Ten pixels in a hundred have the expected scatter, the others none.
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
