//! Footprint of the beam at an edge, estimated from the mixed pixels by counting, then by maximum likelihood.
//!
//! The footprint is half the angle, in radians, over which a beam sees both sides of an edge. In: the lattice lines of
//! the edges.
//!
//! 1. Start value: the number of mixed pixels per lattice line ([`counted`]).
//! 2. Maximum likelihood at one edge ([`at_edge`]), from two kinds of evidence: which pixels are mixed, and the
//!    position of the edge in each of them by its range (`contrast`).
//!
//! The footprint is a property of the scanner. An edge with a far larger one than the others has a strip of background
//! beside it; at one with a far smaller one it was not found, and that of the others is used. Own.

use std::ops::Range;

use platen_numerics::normal_distribution::cdf;

use super::edge_likelihood::{HIDDEN_PART, OUTLIER_PART};
use super::lattice_line::{BeamModel, FOOTPRINT_SPREAD, LatticeLine, SOFTNESS};

/// Least scatter of the positions of an edge by its mixed pixels, in radii of the beam.
const LEAST_SCATTER: f64 = 0.03;

/// Density of the log odds of a mixed pixel that is an outlier.
const OUTLIER_DENSITY: f64 = 0.1;

/// Density of the standard normal distribution at its middle.
const NORMAL_DENSITY: f64 = 0.398_942_28;

/// Number of lines that determine the number of mixed pixels per line to a tenth.
const LEAST_LINES: usize = 100;

/// Largest footprint of an edge relative to the median of the edges, and the reciprocal of the least. On 32 plates edges without a strip have 0.93 to
/// 1.1 of the median, edges beside strips 1.1 to 2.5.
const MOST_OF_OTHERS: f64 = 1.4;

/// Returns true when enough lines are suited to estimate the footprint at their edge.
pub(super) fn is_shown(lines: &[LatticeLine]) -> bool {
    lines.iter().filter(|line| line.shows_footprint()).count() >= LEAST_LINES
}

/// Estimates the footprint from the number of mixed pixels: the lower median of the edges that have enough suitable
/// lines, or all edges together where none has. Returns 0 where there are too few lines in all. `angle` is that between
/// beams, radians.
pub(super) fn counted(edges: &[&[LatticeLine]], angle: f64) -> f64 {
    let each = edges.iter().map(|lines| by_number(lines.iter(), angle)).filter(|one| *one > 0.0);
    lower_median(each).unwrap_or_else(|| by_number(edges.iter().copied().flatten(), angle))
}

/// Returns the footprints that an edge may have, given those found at all edges.
pub(super) fn usual(found: impl Iterator<Item = f64>) -> Range<f64> {
    let median = lower_median(found).unwrap_or(0.0);
    median / MOST_OF_OTHERS..median * MOST_OF_OTHERS
}

/// Returns the lower median (of two values the lesser): cells wrongly taken for mixed pixels can only widen a
/// footprint.
fn lower_median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len().saturating_sub(1) / 2).copied()
}

/// Estimates the footprint from the number of mixed pixels per line.
fn by_number<'a>(lines: impl Iterator<Item = &'a LatticeLine>, angle: f64) -> f64 {
    /// A line that approaches an edge by less than a third of a step per cell may not have reached its far side.
    const MOST_CELLS: f64 = 3.0;
    let (mut n, mut mixed, mut expected) = (0, 0.0, 0.0);
    for line in lines.filter(|l| l.shows_footprint() && l.per_radian * angle < MOST_CELLS * l.per_step) {
        n += 1;
        mixed += line.mixed.map_or(0.0, |(low, high)| (high - low) / line.per_step + 1.0);
        expected += 2.0 * (1.0 - HIDDEN_PART) * line.per_radian / line.per_step;
    }
    if n >= LEAST_LINES { mixed / expected } else { 0.0 }
}

/// Estimates the footprint at an edge of known position by maximum likelihood, in two nested grid searches about `all`,
/// the footprint of all edges.
///
/// The likelihood has two factors per line: which pixels are mixed and which are not, and the log odds of a mixed pixel,
/// by its range. `beam` contains the other properties of the beams. Returns the footprint and the logarithm of its
/// likelihood.
pub(super) fn at_edge(
    lines: &[LatticeLine],
    edge: impl Fn(f64) -> f64,
    all: f64,
    beam: BeamModel,
) -> (f64, f64) {
    /// Steps to each side and their size, in parts of `all`: coarse ones first, then finer ones about the best.
    const SEARCH: [(i32, f64); 2] = [(5, 0.16), (7, 0.02)];
    /// Lines whose likelihoods are multiplied before a logarithm is taken: each is above 10^-7.
    const TOGETHER: usize = 16;
    let showing: Vec<Observed> = lines
        .iter()
        .filter(|line| line.shows_footprint())
        .map(|line| Observed {
            line,
            edge: edge(line.along),
            seen: line.seen_parts(beam),
            pixel: line.place_in_pixel(beam),
        })
        .collect();
    let scatter = (beam.mixed_spread * beam.mixed_spread + LEAST_SCATTER * LEAST_SCATTER).sqrt();
    let fits = |footprint: f64| {
        let off = (footprint / all - 1.0) / FOOTPRINT_SPREAD;
        let together = |lines: &[Observed]| {
            lines.iter().map(|line| line.likelihood(footprint, scatter)).product::<f64>()
        };
        showing.chunks(TOGETHER).map(|lines| together(lines).ln()).sum::<f64>() - 0.5 * off * off
    };
    SEARCH.iter().fold((all, 0.0), |(from, _), (steps, size)| {
        let trials = (-steps..=*steps).map(|k| from + all * size * f64::from(k));
        let trials = trials.map(|footprint| (footprint, fits(footprint)));
        trials.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((from, 0.0))
    })
}

/// A lattice line and what does not depend on the footprint.
struct Observed<'a> {
    line: &'a LatticeLine,
    edge: f64,
    /// Distances inside and outside of the edge up to which a beam is detected as mixed, in parts of its radius.
    seen: [f64; 2],
    /// Position of the edge in the beam of a single mixed pixel, in radii, and its derivative by the log odds.
    pixel: Option<(f64, f64)>,
}

impl Observed<'_> {
    /// Returns the likelihood of a footprint; `scatter` is that of the positions in mixed pixels, in radii.
    fn likelihood(&self, footprint: f64, scatter: f64) -> f64 {
        let Self { line, edge, seen: [inside, outside], pixel } = *self;
        let radius = footprint * line.per_radian;
        let within = |off: f64| {
            if off > edge { radius * inside - (off - edge) } else { radius * outside - (edge - off) }
        };
        let is_mixed = |off: f64| (1.0 - HIDDEN_PART) * cdf(within(off) / (SOFTNESS * line.per_angle));
        let sound = (1.0 - is_mixed(line.high)) * (1.0 - is_mixed(line.low));
        let Some((low, high)) = line.mixed else { return sound };
        let by_odds = pixel.map_or(1.0, |(place, slope)| {
            let off = ((edge - low) / radius - place) / scatter;
            OUTLIER_PART * OUTLIER_DENSITY + NORMAL_DENSITY * (-0.5 * off * off).exp() * slope / scatter
        });
        sound * (is_mixed(low) + OUTLIER_PART) * (is_mixed(high) + OUTLIER_PART) * by_odds
    }
}

#[cfg(test)]
mod tests {
    use super::super::lattice_line::tests::open_line;
    use super::*;

    /// Lines of an edge whose side face is hidden; every second line has `mixed` mixed pixels.
    fn edge(mixed: f64) -> Vec<LatticeLine> {
        let per_step = open_line(None).per_step;
        let of = |k: usize| k.is_multiple_of(2).then_some((0.0, (mixed - 1.0) * per_step));
        (0..200).map(|k| open_line(of(k))).collect()
    }

    #[test]
    fn an_edge_of_false_mixed_pixels_does_not_make_the_footprint_wider() {
        let [narrow, wide] = [1.0, 4.0].map(edge);
        let of = |edges: &[&[LatticeLine]]| counted(edges, 6e-4);
        let alone = of(&[&narrow]);
        assert!(alone > 0.0 && of(&[&wide]) > 3.9 * alone);
        assert_eq!(of(&[&narrow, &wide]), alone);
        assert_eq!(of(&[&wide, &narrow, &narrow]), alone);
        let found = [1.0, 1.1, 4.0].map(|times| times * alone);
        assert!((found[1]..found[2]).contains(&usual(found.into_iter()).end));
    }
}
