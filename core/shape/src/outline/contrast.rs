//! Contrast of plate and background, and the position of an edge within a mixed pixel, by the linear mixing model.
//!
//! 1. **Linear mixing.** The range of a mixed pixel is the mean of the ranges of both sides, weighted by their echoes.
//!    It determines the odds of the background, that is, its echo over that of the face: C s / (1 - s). Here s is the
//!    part of the beam's power beyond the edge, and C the contrast: the echo of the background alone over that of the
//!    face alone.
//! 2. **Position in the beam.** Given the contrast, the range of one mixed pixel gives s, and s the position of the
//!    edge in the beam (`beam_shape`).
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
//! Limits: the position of the edge by the range of a mixed pixel assumes two surfaces. Where a side face is visible as
//! a third one only the detection limit is used, with the echo of the side face (`lattice_line`).

use platen_numerics::median::robust_deviation;

use super::beam_shape::{self, BeamShape};
use super::edge_likelihood::SharedObservation;
use super::height_field::LEAST_COSINE;
use crate::Vec3;
use crate::extract::{BACKGROUND_PLANES, Beyond, Crossing, detection_limit};

/// Standard deviation of the position of an edge in a beam over the square of the log odds: what the beam's shape and
/// radius leave open.
const PLACE_SPREAD: f64 = 0.01;

/// Least standard deviation of the position by one pixel, in radii: a wrong beam shape shifts all pixels of a row
/// alike, however little they scatter. With half this value corners of 40 plates of mill scale are up to 2.5 mm off
/// instead of 1.8 mm.
const LEAST_SPREAD: f64 = 0.2;

/// Prior of the logarithm of the ratio of the reflectivities of background and plate: mean and standard deviation. It
/// covers walls of reflectivity 0.8 and floors of 0.3 behind plates of 0.1 to 0.6.
const PRIOR: (f64, f64) = (0.7, 0.7);

/// Standard deviation of the logarithm of a contrast between two edges before the same plane: planes are not evenly
/// bright.
const BETWEEN_EDGES: f64 = 0.1;

/// Precision that an edge must add to a contrast to be used, in parts of the prior's precision.
const LEAST_ADDED: f64 = 1e-3;

/// Expected scatter of these positions between mixed pixels, in radii, and the number of pixels whose weight this
/// expectation has.
const SCATTER: (f64, f64) = (0.2, 10.0);

/// Largest scatter of a receiver that mixes linearly, in radii: edges of 24 random scenes have 0.04 to 0.13. Ranges
/// anywhere between the two surfaces give a scatter of at least 0.33 where all beams have the edge at one place, and
/// more elsewhere.
const MOST_SCATTER: f64 = 0.25;

/// Scatter that stands for pixels without information, in radii.
pub(super) const UNINFORMATIVE: f64 = 10.0;

/// Least jump of the range from the face to the background at which mixed pixels are distinguished from both, metres.
const LEAST_JUMP: f64 = 0.05;

/// Largest part of the jump by which a mixed pixel must differ from a surface to be detected.
const MOST_LIMIT: f64 = 0.45;

/// Log odds of the plate up to which it is detected before a background of unknown contrast: 1.2 % of the echo.
const USUAL_LIMIT: f64 = 4.4;

/// Logarithms of the ratio of the reflectivities of each background plane and the plate.
#[derive(Debug, Clone, Copy)]
pub(super) struct Contrasts([f64; BACKGROUND_PLANES]);

impl Contrasts {
    /// Returns true when no edge moves by more than a hundredth of the beam's radius between these and others.
    pub(super) fn are_near(&self, other: &Self) -> bool {
        self.0.iter().zip(&other.0).all(|(one, other)| beam_shape::STEEPEST * (one - other).abs() < 0.01)
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
    pub(super) fn combined<'a>(edges: impl Iterator<Item = &'a Self>) -> Self {
        let prior = PRIOR.1.powi(-2);
        let mut sums = [(prior, prior * PRIOR.0); BACKGROUND_PLANES];
        for edge in edges {
            for ((precision, weighted), (mean, spread)) in sums.iter_mut().zip(&edge.0) {
                let added = spread.powi(-2) - prior;
                if added > LEAST_ADDED * prior {
                    let mean = (spread.powi(-2) * mean - prior * PRIOR.0) / added;
                    let weight = 1.0 / (1.0 / added + BETWEEN_EDGES * BETWEEN_EDGES);
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
        return UNINFORMATIVE;
    }
    ((n * scatter * scatter + weight * expected * expected) / (n + weight)).sqrt()
}

/// Returns the distance outside of the edge of a plate up to which a beam is detected as mixed before a background of
/// unknown contrast, in parts of its radius; `echo` is that of the plate there, in parts of the face's.
pub(super) fn seen_before_unknown(shape: BeamShape, echo: f64) -> f64 {
    shape.seen(USUAL_LIMIT + echo.max(f64::MIN_POSITIVE).ln())
}

/// Linear mixing along one lattice line before a background plane.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mixing {
    /// Number of the plane.
    plane: usize,
    /// Part of the logarithm of the contrast that is due to incidence and range.
    by_geometry: f64,
    /// Largest log odds of the face and of the background at which a pixel is detected as mixed.
    most_odds: [f64; 2],
    /// Logarithm of the odds of the background in a single mixed pixel.
    odds: Option<f64>,
}

impl Mixing {
    /// Determines the mixing of a crossing. `None` without a background plane, or where not all cells of the crossing
    /// were measured.
    pub(super) fn of(crossing: &Crossing) -> Option<Self> {
        let jump = f64::from(crossing.excess);
        let plane = crossing
            .background
            .filter(|_| crossing.complete && crossing.beyond == Beyond::Behind && jump > LEAST_JUMP)?;
        let range = crossing.inside.norm();
        let on_face = crossing.normal.dot(&-crossing.inside) / range;
        let on_plane = f64::from(plane.distance) / (range + jump);
        let [on_face, on_plane] = [on_face, on_plane].map(|cosine| cosine.max(LEAST_COSINE));
        let limits = crossing.noise.map(|noise| detection_limit(f64::from(noise), jump).min(MOST_LIMIT));
        let is_single = |[near, far]: [Vec3; 2]| near == far && far != crossing.outside;
        let single = crossing.mixed.filter(|pixels| is_single(pixels.ends));
        // At grazing incidence the continuation of the face recedes from cell to cell, hence the jump at the pixel.
        let part = single.and_then(|pixels| Some(f64::from(pixels.excess) / f64::from(pixels.jump?)));
        Some(Self {
            plane: usize::from(plane.number),
            by_geometry: (on_plane / on_face).ln() - 2.0 * (1.0 + jump / range).ln(),
            most_odds: limits.map(|limit| ((1.0 - limit) / limit).ln()),
            odds: part.filter(|part| *part > 0.0 && *part < 1.0).map(|part| (part / (1.0 - part)).ln()),
        })
    }

    /// Returns the same without the odds of a mixed pixel, for a silhouette that is not the edge of the face.
    pub(super) fn without_odds(self) -> Self {
        Self { odds: None, ..self }
    }

    /// Returns the distances inside and outside of the edge of a plate up to which a beam is detected as mixed, in parts
    /// of its radius; `echo` is that of the plate there, in parts of the face's.
    pub(super) fn seen(&self, shape: BeamShape, contrasts: &Contrasts, echo: f64) -> [f64; 2] {
        let contrast = contrasts.0[self.plane] + self.by_geometry - echo.max(f64::MIN_POSITIVE).ln();
        let [face, background] = self.most_odds;
        [face + contrast, background - contrast].map(|odds| shape.seen(odds))
    }

    /// Returns true when a single mixed pixel determines the position of the edge.
    pub(super) fn has_odds(&self) -> bool {
        self.odds.is_some()
    }

    /// Returns the position of the edge in the beam of a single mixed pixel, in radii, and the derivative by the log
    /// odds.
    pub(super) fn place(&self, shape: BeamShape, contrasts: &Contrasts) -> Option<(f64, f64)> {
        self.odds.map(|odds| shape.place(odds - self.by_geometry - contrasts.0[self.plane]))
    }

    /// Returns the position of the edge by a single mixed pixel at `at`, linearised about these contrasts. `radius` is
    /// that of the beam on the face, metres, `spread` the scatter of such positions, in radii.
    pub(super) fn edge(
        &self,
        at: f64,
        radius: f64,
        shape: BeamShape,
        contrasts: &Contrasts,
        spread: f64,
    ) -> Option<SharedObservation> {
        let contrast = contrasts.0[self.plane];
        let log_odds = self.odds? - self.by_geometry - contrast;
        let (place, slope) = shape.place(log_odds);
        let by_place = PLACE_SPREAD * log_odds * log_odds;
        Some(SharedObservation {
            place: at + radius * (place + slope * contrast),
            soft: radius * (spread * spread + LEAST_SPREAD * LEAST_SPREAD + by_place * by_place).sqrt(),
            radius,
            number: self.plane,
            factor: radius * slope,
        })
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::beam_shape::SHAPES;
    use super::super::beam_shape::tests::power_beyond;
    use super::*;
    use crate::extract::{MixedPixels, PlaneBehind, PlaneSet};

    const JUMP: f64 = 2.0;
    const RANGE: f64 = 8.0;

    fn pixels(ends: [Vec3; 2], excess: f64) -> MixedPixels {
        MixedPixels { ends, excess: excess as f32, jump: Some(JUMP as f32) }
    }

    /// Returns a crossing straight below the scanner, before a plane 2 m behind it; `background` is the part of that
    /// plane in the echo of the mixed pixel.
    pub(crate) fn crossing(background: f64) -> Crossing {
        let at = |y: f64| Vec3::new(0.0, y, -RANGE);
        Crossing {
            sample: 0,
            step: [0, -1],
            cells: 2,
            inside: at(5e-3),
            outside: at(-5e-3),
            normal: Vec3::z(),
            mixed: Some(pixels([at(0.0); 2], background * JUMP)),
            surely_mixed: None,
            strips: PlaneSet::default(),
            complete: true,
            excess: JUMP as f32,
            noise: [1e-3; 2],
            background: Some(PlaneBehind { number: 2, distance: (RANGE + JUMP) as f32, narrow: false }),
            beyond: Beyond::Behind,
        }
    }

    /// Returns the mixing of a pixel in whose echo both surfaces have the same part.
    pub(crate) fn half() -> Mixing {
        Mixing::of(&crossing(0.5)).unwrap()
    }

    /// Returns the contrasts of planes whose echo is `times` that of the face at the same incidence.
    fn contrasts(times: f64) -> Contrasts {
        Contrasts::of(&[times.ln() + 2.0 * (1.0 + JUMP / RANGE).ln(); BACKGROUND_PLANES])
    }

    /// Edges that determine the contrast of the first plane only.
    #[test]
    fn edges_share_the_contrast_of_a_plane() {
        let own = 0.2_f64;
        let edge = |mean: f64| {
            let precision = own.powi(-2) + PRIOR.1.powi(-2);
            let mean = (mean * own.powi(-2) + PRIOR.0 * PRIOR.1.powi(-2)) / precision;
            let mut planes = [PRIOR; BACKGROUND_PLANES];
            planes[0] = (mean, precision.powf(-0.5));
            ContrastDistribution(planes)
        };
        let edges = [edge(-1.0), edge(-1.4)];
        let of = ContrastDistribution::combined(edges.iter());
        // Both with the spread between edges, and the prior.
        let both = 2.0 / (own * own + BETWEEN_EDGES * BETWEEN_EDGES);
        let precision = both + PRIOR.1.powi(-2);
        let (mean, spread) = of.planes()[0];
        assert!((mean - (both * -1.2 + PRIOR.1.powi(-2) * PRIOR.0) / precision).abs() < 1e-12, "{mean}");
        assert!((spread - precision.powf(-0.5)).abs() < 1e-12, "{spread}");
        assert!((of.planes()[1].0 - PRIOR.0).abs() < 1e-12 && (of.planes()[1].1 - PRIOR.1).abs() < 1e-12);
    }

    #[test]
    fn one_mixed_pixel_locates_the_edge() {
        for times in [0.5, 1.0, 8.0_f64] {
            for edge in [-0.8, -0.3, 0.0, 0.5, 0.8] {
                let beyond = power_beyond(1.0, -edge);
                let part = times * beyond / (times * beyond + 1.0 - beyond);
                let mixing = Mixing::of(&crossing(part)).unwrap();
                let found = mixing.edge(0.0, 1.0, BeamShape::numbered(0), &contrasts(times), 0.2).unwrap();
                let at = found.place - found.factor * contrasts(times).0[found.number];
                assert!((at - edge).abs() < 2e-3, "{times} {edge}: {at}");
            }
        }
    }

    #[test]
    fn beams_before_what_outshines_the_face_are_found_mixed_farther_inside_than_outside() {
        let seen = |times: f64, noise: f32| {
            let crossing = Crossing { noise: [noise; 2], ..crossing(0.5) };
            Mixing::of(&crossing).unwrap().seen(BeamShape::numbered(0), &contrasts(times), 1.0)
        };
        let [inside, outside] = seen(1.0, 1e-3);
        assert!((inside - outside).abs() < 1e-6 && inside > 0.9, "{inside} {outside}");
        let [inside, outside] = seen(10.0, 2e-3);
        // A limit of 24 mm in 2 m: odds of 82, a tenth of that where the background is ten times as bright.
        let place = |odds: f64| BeamShape::numbered(0).place(odds.ln()).0;
        let odds = 0.988_f64 / 0.012;
        assert!((outside - place(odds / 10.0)).abs() < 1e-6, "{outside}");
        assert!((inside - place(odds * 10.0)).abs() < 1e-6, "{inside}");
        assert!(seen(10.0, 4e-3)[1] < outside, "with more noise less is found");
        let [dark, bright] = seen(0.1, 2e-3);
        assert!((dark - outside).abs() < 1e-6 && (bright - inside).abs() < 1e-6, "{dark} {bright}");
    }

    #[test]
    fn a_quiet_background_shows_less_of_the_face_in_a_beam() {
        let seen = |noise: [f32; 2]| {
            let crossing = Crossing { noise, ..crossing(0.5) };
            Mixing::of(&crossing).unwrap().seen(BeamShape::numbered(0), &contrasts(1.0), 1.0)
        };
        let [alike, quiet] = [[2e-3, 2e-3], [2e-3, 0.5e-3]].map(seen);
        assert!(quiet[0] == alike[0] && quiet[1] > alike[1], "{alike:?} {quiet:?}");
    }

    #[test]
    fn ranges_anywhere_between_the_surfaces_have_no_weight() {
        assert!((spread(Vec::new()) - SCATTER.0).abs() < 1e-12);
        let exact = spread(vec![0.0; 90]);
        // Ten pixels in a hundred have the expected scatter, the others none.
        assert!((exact - (0.1 * SCATTER.0 * SCATTER.0).sqrt()).abs() < 1e-12, "{exact}");
        let odds = |k: i32| (f64::from(k) / f64::from(1000 - k)).ln();
        let anywhere = (1..1000).map(|k| BeamShape::numbered(SHAPES - 1).place(odds(k)).0);
        let uniform: Vec<f64> = anywhere.map(f64::abs).collect();
        assert!((robust_deviation(uniform.clone()).unwrap() - 0.330).abs() < 1e-3);
        assert_eq!(spread(uniform), UNINFORMATIVE);
    }

    #[test]
    fn only_a_single_mixed_pixel_before_a_plane_has_odds() {
        let of = |crossing: Crossing| Mixing::of(&crossing);
        let known = crossing(0.5);
        assert!(of(Crossing { background: None, ..known }).is_none());
        assert!(of(Crossing { complete: false, ..known }).is_none());
        assert!(of(Crossing { beyond: Beyond::Nothing, ..known }).is_none());
        let has_odds = |crossing: Crossing| of(crossing).is_some_and(|mixing| mixing.has_odds());
        assert!(has_odds(known));
        assert!(!has_odds(crossing(1.01)));
        assert!(!has_odds(Crossing { mixed: None, ..known }));
        let several = pixels([known.inside, known.outside], 0.5);
        assert!(!has_odds(Crossing { mixed: Some(several), ..known }));
    }
}
