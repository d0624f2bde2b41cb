//! Doubtful edges: plausibility check of an edge's length on the mid-surface against the cut length.
//!
//! Bending does not stretch the mid-surface. An edge is doubtful if its length there differs from the cut length by
//! more than the error of a cut and the strain of a doubly curved plate explain. In: dimension checks, surface, cut
//! lengths. Out: the doubtful edges, lengths in metres. Own.
//!
//! The check is necessary because a far edge at grazing incidence may be located at the wrong one of several places,
//! each with a small standard deviation; no confidence interval shows this. In 300 simulated random scenes (seeds 1
//! to 300) the check finds seven of the eleven with a corner more than 2 mm off, and none of the 257 with all corners
//! within 1 mm.
//!
//! Limits: an edge that is off as a whole is not distinguished from a plate that was cut so; two edges that are off to
//! the same side are not detected. On double curvature the allowed strain hides some errors.

use super::dimension_checks::{Check, ShapeChecks};
use crate::{Corner, Outline, Surface};

/// Largest error of a cut in the length of an edge, and largest expanded uncertainty of a corner that counts as seen,
/// metres.
pub const CUT_ERROR: f64 = 2e-3;

/// Number of places on a side over which the Gaussian curvature is averaged.
const PLACES: usize = 8;

/// An edge whose length is not explained, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdgeDoubt {
    /// Number of the edge, in the order v = 0, u = W, v = H, u = 0.
    pub edge: usize,
    /// Length on the mid-surface.
    pub length: f64,
    /// Standard deviation of `length`.
    pub sigma: f64,
    /// Cut length, less the insets of bevels at both ends.
    pub cut: f64,
}

impl EdgeDoubt {
    /// Returns true when the edge runs from or to a corner, in the order (0,0), (W,0), (W,H), (0,H).
    fn has_corner(&self, corner: usize) -> bool {
        corner == self.edge || corner == (self.edge + 1) % 4
    }
}

/// Returns the edges whose lengths differ from the cut lengths
/// ([`Blank::face_edge_lengths`](crate::Blank::face_edge_lengths)), metres, by more than is explained.
///
/// A plate of Gaussian curvature K and sides a and b is strained in its plane by about K b^2 / 24 along the edges of
/// length a (least membrane energy; Timoshenko, Woinowsky-Krieger, "Theory of plates and shells", compatibility of
/// strains). This strain is allowed.
#[must_use]
pub fn edge_doubts(checks: &ShapeChecks, surface: &Surface, cut: [f64; 4]) -> Vec<EdgeDoubt> {
    let size = [surface.width(), surface.height()];
    let at = |i: usize, length: f64| length * (i as f64 + 0.5) / PLACES as f64;
    let places = (0..PLACES * PLACES).map(|i| (at(i / PLACES, size[0]), at(i % PLACES, size[1])));
    let seen: Vec<f64> = places
        .filter(|(u, v)| surface.mask().seen(*u, *v))
        .map(|(u, v)| surface.curvature(u, v).gaussian)
        .collect();
    let gaussian = seen.iter().sum::<f64>() / seen.len().max(1) as f64;
    unexplained(checks.edges.map(|edge| edge.mid), gaussian, size, cut)
}

/// Returns, per corner, whether it was seen: it was not extrapolated, its uncertainty does not exceed the error of a cut,
/// and neither of its edges is doubtful.
#[must_use]
pub fn corners_seen(outline: &Outline, doubts: &[EdgeDoubt]) -> [bool; 4] {
    let is_doubtful = |k: usize| doubts.iter().any(|doubt| doubt.has_corner(k));
    std::array::from_fn(|k| is_located(&outline.corners[k]) && !is_doubtful(k))
}

fn is_located(corner: &Corner) -> bool {
    corner.seen && corner.uncertainty() <= CUT_ERROR
}

fn unexplained(edges: [Check; 4], gaussian: f64, [w, h]: [f64; 2], cut: [f64; 4]) -> Vec<EdgeDoubt> {
    let doubt = |edge: usize| {
        let (Check { value: length, sigma, .. }, cut) = (edges[edge], cut[edge]);
        let across = if edge.is_multiple_of(2) { h } else { w };
        let explained = CUT_ERROR + gaussian.abs() * across * across / 24.0 * cut;
        ((length - cut).abs() > explained).then_some(EdgeDoubt { edge, length, sigma, cut })
    };
    (0..4).filter_map(doubt).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_length_that_neither_cut_nor_strain_explains_is_doubtful() {
        let edges = |by_mm: [f64; 4]| {
            let cut = [3.0, 2.5, 3.0, 2.5];
            [0, 1, 2, 3].map(|k| Check { value: cut[k] + 1e-3 * by_mm[k], sigma: 2e-4, seen: true })
        };
        let doubtful = |by_mm, gaussian| {
            let doubts = unexplained(edges(by_mm), gaussian, [3.0, 2.5], [3.0, 2.5, 3.0, 2.5]);
            doubts.iter().map(|doubt| doubt.edge).collect::<Vec<usize>>()
        };
        assert!(doubtful([1.9, -1.9, 0.0, 1.9], 0.0).is_empty());
        assert_eq!(doubtful([1.9, -2.1, 0.0, 2.1], 0.0), [1, 3]);
        // A sphere of R 11 m: edges of 3 m may be 6.5 mm shorter.
        assert_eq!(doubtful([-8.4, 0.0, -8.6, 0.0], 1.0 / 121.0), [2]);
    }

    #[test]
    fn the_face_of_a_bevelled_plate_is_smaller_than_the_plate_and_not_in_doubt() {
        let blank = crate::Blank::rectangle(3.0, 2.5);
        let edges = [2.982, 2.482, 2.982, 2.482].map(|value| Check { value, sigma: 2e-4, seen: true });
        assert!(unexplained(edges, 0.0, [3.0, 2.5], blank.face_edge_lengths(9e-3)).is_empty());
        assert_eq!(unexplained(edges, 0.0, [3.0, 2.5], blank.edge_lengths()).len(), 4);
    }

    #[test]
    fn a_corner_known_worse_than_a_cut_was_not_seen() {
        let corner = |sigma| Corner { point: crate::Vec3::zeros(), sigma, contrast: [0.0; 2], seen: true };
        assert!(is_located(&corner([1.01e-3, 1e-4])));
        assert!(!is_located(&corner([1e-4, 1.03e-3])));
        assert!(!is_located(&Corner { seen: false, ..corner([1e-4; 2]) }));
    }

    #[test]
    fn a_doubtful_edge_has_two_corners() {
        let doubt = |edge| EdgeDoubt { edge, length: 3.0, sigma: 0.0, cut: 3.1 };
        let corners = |edge: usize| [0, 1, 2, 3].map(|corner| doubt(edge).has_corner(corner));
        assert_eq!(corners(1), [false, true, true, false]);
        assert_eq!(corners(3), [true, false, false, true]);
    }
}
