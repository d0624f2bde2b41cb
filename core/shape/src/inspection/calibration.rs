//! Calibration of a scanner: estimators of the errors that are not in the covariance of a fit.
//!
//! Errors correlated over decimetres (range bias, lattice, pose) do not average out in a fit. There are two estimators:
//!
//! - Pairs of scans of an unchanged plate ([`Pooled`]). They differ by more than their stated deviations. The excess,
//!   pooled over the plate and over pairs, is the correlated part of the level of detection.
//! - An artefact of known shape ([`artefact_gaps`], [`covering`]). Errors that repeat in every scan cancel in pairs of
//!   scans; on an artefact they appear as gaps under templates whose true gap is zero.
//!
//! All lengths in metres.

use crate::target_surface::Placement;
use crate::{EXPANDED, Surface, TargetSurface};

/// Differences whose true value is zero, pooled with their stated variances.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Pooled {
    shown: f64,
    stated: f64,
    n: usize,
}

impl Pooled {
    /// Adds one difference and its stated standard deviation.
    pub fn add(&mut self, difference: f64, sigma: f64) {
        self.shown += difference * difference;
        self.stated += sigma * sigma;
        self.n += 1;
    }

    /// Returns the standard deviation of the differences in excess of the stated ones; 0 where there is no excess.
    #[must_use]
    pub fn excess(&self) -> f64 {
        ((self.shown - self.stated).max(0.0) / self.n.max(1) as f64).sqrt()
    }
}

/// A gap whose true value is zero, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArtefactGap {
    /// Gap as measured, signed.
    pub gap: f64,
    /// Its stated standard deviation.
    pub sigma: f64,
}

/// Share of the gaps that their expanded uncertainty covers.
const COVERED: f64 = 0.95;

/// Returns the systematic error, one standard deviation, with which the expanded uncertainty covers 95 % of the gaps.
///
/// A scanner's range error is periodic: under templates as long as half a wave it appears twice, under those as long as
/// a whole wave not at all. The gaps therefore do not scatter like normal errors of their root mean square.
#[must_use]
pub fn covering(gaps: &[ArtefactGap]) -> f64 {
    let mut lacking: Vec<f64> =
        gaps.iter().map(|g| ((g.gap / EXPANDED).powi(2) - g.sigma * g.sigma).max(0.0).sqrt()).collect();
    lacking.sort_by(f64::total_cmp);
    let last = (COVERED * lacking.len() as f64).ceil() as usize;
    last.checked_sub(1).map_or(0.0, |last| lacking[last])
}

/// Number of lines in each direction, and of templates on each line.
const TEMPLATES: usize = 9;

/// Number of places along each side by which the artefact is registered.
const PLACES: usize = 41;

/// Returns the gaps in the middle of templates of length `chord`, balanced on their ends, on an artefact that has its
/// target's shape. Their true value is zero.
///
/// `sigma_correlated` is that of a pair of scans; a single scan has its share of it, as in the uncertainty of a
/// template. The templates lie along u and along v all over the plate, where it was seen.
#[must_use]
pub fn artefact_gaps(
    artefact: &Surface,
    shape: &TargetSurface,
    chord: f64,
    sigma_correlated: f64,
) -> Vec<ArtefactGap> {
    let (w, h) = (artefact.width(), artefact.height());
    let seen = |[u, v]: [f64; 2]| artefact.mask().seen(u, v);
    let at = |k: usize| [(k % PLACES) as f64, (k / PLACES) as f64].map(|x| x / (PLACES - 1) as f64);
    let places = (0..PLACES * PLACES).map(at).map(|[x, y]| [w * x, h * y]).filter(|place| seen(*place));
    let placement = Placement::best(artefact, shape, places);

    let between = |k: usize, from: f64, to: f64| from + (to - from) * (k as f64 + 0.5) / TEMPLATES as f64;
    let mut gaps = Vec::new();
    for (length, across, along_u) in [(w, h, true), (h, w, false)] {
        for k in (0..TEMPLATES * TEMPLATES).filter(|_| chord <= length) {
            let centre = between(k % TEMPLATES, 0.5 * chord, length - 0.5 * chord);
            let line = between(k / TEMPLATES, 0.0, across);
            let place = |s: f64| if along_u { [s, line] } else { [line, s] };
            let terms = [(centre - 0.5 * chord, 0.5), (centre, -1.0), (centre + 0.5 * chord, 0.5)]
                .map(|(s, w)| (place(s), w));
            if !terms.iter().all(|(at, _)| seen(*at)) {
                continue;
            }
            let gap: f64 = terms.iter().map(|(at, w)| w * placement.deviation(artefact, shape, *at)).sum();
            let squares: f64 = terms.iter().map(|(_, w)| w * w).sum();
            let correlated = sigma_correlated * (0.5 * squares).sqrt();
            let sigma = artefact.sigma_of_heights(&terms).hypot(correlated);
            gaps.push(ArtefactGap { gap, sigma });
        }
    }
    gaps
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_excess_is_what_was_not_stated() {
        let mut pooled = Pooled::default();
        for k in 0..1000 {
            let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
            pooled.add(sign * 5e-3, 3e-3);
        }
        assert!((pooled.excess() - 4e-3).abs() < 1e-12);
        let mut quiet = Pooled::default();
        quiet.add(1e-3, 3e-3);
        assert_eq!(quiet.excess(), 0.0);
    }

    #[test]
    fn nineteen_of_twenty_gaps_are_covered() {
        let gaps: Vec<ArtefactGap> =
            (1..=100).map(|k| ArtefactGap { gap: 1e-5 * f64::from(k), sigma: 1e-4 }).collect();
        let sigma = covering(&gaps);
        let covered = |g: &&ArtefactGap| g.gap <= EXPANDED * g.sigma.hypot(sigma) * (1.0 + 1e-12);
        assert_eq!(gaps.iter().filter(covered).count(), 95);
        // Gaps explained by noise are not a systematic error.
        assert_eq!(covering(&gaps[..19]), 0.0);
        assert_eq!(covering(&[]), 0.0);
    }
}
