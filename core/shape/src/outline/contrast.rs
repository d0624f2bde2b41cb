//! Radiometric bias of an edge by the contrast of the face and what lies behind it, from the ranges of its mixed pixels.
//!
//! 1. Linear mixing model: the range of a mixed pixel is the mean of both sides weighted by their echoes, so that it tells the background's share b of the
//!    beam's echo.
//! 2. The beams meet an edge that crosses rows and columns at random. Half of the mixed ones see more of the background than of the face, and theirs
//!    is b > C / (1 + C), where C is the contrast, the echo of the background over that of the face: the median of b gives C, without a law of intensities.
//! 3. A beam that sees so little of one side that its range stays within the detection limit is not found mixed. Where the background outshines the face
//!    (C > 1) that side is the face: pixels are found mixed farther inside of the edge than outside, and the edge, located in their middle, too far inwards.
//!    The part of the footprint that is missed grows with C and with the detection limit over the jump of the range.
//!
//! In: lattice lines; out: [`Contrast`]. Own; the scale of 3 is found by simulation, with Gaussian beams truncated at their 1/e^2 radius. Limits: a beam with wings is
//! found mixed farther inside. Its edges are left too far inwards by 0.07 of half the footprint on average, by about 0.2 where C is 4 and more (263 edges of 120 random
//! scenes; `platen bench accuracy --family wings`).

use platen_numerics::median::median;

use super::lattice_line::LatticeLine;

/// Fewest mixed pixels whose median tells the contrast.
const LEAST_PIXELS: usize = 20;

/// Detection limit of a mixed pixel beside a surface, in standard deviations of a range: the bound of second differences of
/// `extract::mixed_pixels`, rounded.
const DETECTION_LIMIT: f64 = 12.0;

/// An edge is found too far inwards by the first times t (C - 1 / C), where t is the detection limit in parts of the jump, at most by the second, in
/// parts of half the footprint: by regression over 382 edges of 200 random scenes (seeds from 18001), plates of 0.1 to 0.6. Where the face outshines
/// what lies behind it, they are off by 0.01 outwards, those of an independent simulator by 0.06 inwards: nothing is taken off.
const MISSED: f64 = 2.0;
const MOST_MISSED: f64 = 0.4;

/// Standard deviation of what is left, in the same parts: that of these edges beyond the scatter of their lines; and where no contrast is known, per
/// logarithm of one over the cosine of the incidence: a face is the darker the more obliquely it is seen.
const SPREAD: f64 = 0.065;
const UNKNOWN_SPREAD: f64 = 0.1;

/// Radiometric bias of an edge, in parts of half the footprint on the face.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Contrast {
    /// Distance by which the edge is found too far inwards; `None` where no contrast is known.
    inwards: Option<f64>,
}

impl Contrast {
    /// Estimates it from the lines of an edge. `noise` is that of ranges, metres; without `dithered` the beams do not meet the edge at random.
    pub(super) fn of(lines: &[LatticeLine], dithered: bool, noise: f64) -> Self {
        let mixed = lines.iter().filter(|line| line.shows_footprint()).filter_map(|line| line.mixing);
        let (parts, jumps): (Vec<f64>, Vec<f64>) = mixed.map(|of| (of.background, of.jump)).unzip();
        let are_told = dithered && parts.len() >= LEAST_PIXELS;
        let medians = median(parts).zip(median(jumps)).filter(|_| are_told);
        let inwards = medians.map(|(part, jump)| {
            let contrast = part / (1.0 - part);
            let missed = MISSED * (DETECTION_LIMIT * noise / jump) * (contrast - contrast.recip());
            missed.clamp(0.0, MOST_MISSED)
        });
        Self { inwards }
    }

    /// Returns the distance by which the edge is found too far inwards and its standard deviation, in parts of half the footprint, where a
    /// face is seen at an incidence of this cosine.
    pub(super) fn inwards(self, cosine: f64) -> [f64; 2] {
        self.inwards
            .map_or_else(|| [0.0, -UNKNOWN_SPREAD * cosine.min(1.0).ln()], |inwards| [inwards, SPREAD])
    }
}

#[cfg(test)]
mod tests {
    use super::super::lattice_line::Mixing;
    use super::super::lattice_line::tests::open_line;
    use super::*;

    /// Lines of an edge before a background so many times as bright as the face, 2 m behind it, whose beams see all parts of it alike.
    fn edge(contrast: f64) -> Vec<LatticeLine> {
        let part = |k: usize| (k as f64 + 0.5) / 100.0;
        let mixing =
            |seen: f64| Mixing { background: contrast * seen / (contrast * seen + 1.0 - seen), jump: 2.0 };
        let line = |k: usize| {
            let mut line = open_line(None);
            line.mixing = Some(mixing(part(k)));
            line
        };
        (0..100).map(line).collect()
    }

    fn inwards(contrast: f64, noise: f64) -> f64 {
        Contrast::of(&edge(contrast), true, noise).inwards(0.2)[0]
    }

    #[test]
    fn an_edge_before_what_outshines_it_is_found_too_far_inwards() {
        let (one, five) = (inwards(1.0, 2e-3), inwards(5.0, 2e-3));
        // 12 mm of noise in 2 m, by five times less a fifth.
        assert!(one.abs() < 1e-3 && (five / (2.0 * 0.012 * 4.8) - 1.0).abs() < 0.1, "{one} {five}");
        assert_eq!(inwards(0.2, 2e-3), 0.0);
        assert!(inwards(5.0, 1e-3) < 0.6 * five, "with less noise less is missed");
        assert_eq!(inwards(50.0, 1e-2), MOST_MISSED);
    }

    #[test]
    fn without_mixed_pixels_at_random_only_the_incidence_tells_the_spread() {
        let few = Contrast::of(&edge(5.0)[..LEAST_PIXELS - 1], true, 2e-3);
        assert_eq!(few, Contrast::of(&edge(5.0), false, 2e-3));
        assert_eq!(few.inwards(1.0), [0.0, 0.0]);
        let [inwards, sigma] = few.inwards((-1.35_f64).exp());
        assert!(inwards == 0.0 && (sigma - 0.135).abs() < 1e-9, "{sigma}");
        assert_eq!(Contrast::of(&edge(5.0), true, 2e-3).inwards(1.0)[1], SPREAD);
    }
}
