//! One lattice line (a row or a column of the lattice) where it crosses an edge, as an observation of the edge.
//!
//! The observation is interval-censored: the edge lies between the last sample on the face and the first sample beyond
//! it. A mixed pixel is a sample whose beam meets the plate and the background at once; its footprint is the radius of
//! the beam's spot. Four effects narrow the interval:
//!
//! - **Mixed pixels.** The edge is within one footprint of the beam of a mixed pixel. A beam that is not mixed has its
//!   centre on its own side of the edge, most likely a footprint away from it; a quarter of the mixed beams is mixed
//!   too little to be detected. Of three or more mixed pixels in a row, those farther from the first than the spot
//!   is wide see another edge, that of a strip of background.
//! - **Visible side face.** Where the plate's side face is visible, the beams are mixed at its silhouette. The distance
//!   of the silhouette from the edge follows from thickness and bevel (`side_face`). The more obliquely the side face is
//!   seen the darker it is, and the nearer to the face beams are detected as mixed. A beam on a side face of a few
//!   millimetres has a range behind the face's continuation in proportion to its distance from the edge; on a bevel the
//!   ratio is that of the flank or root face it meets. Such a range is a direct observation of the edge.
//! - **Last cell of the face.** The last cell assigned to the face may itself lie on the side face, within the noise.
//!   The ranges of this cell and of the first cell not assigned both enter; otherwise the selection would bias the edge
//!   outwards.
//! - **Range of a single mixed pixel.** It determines the share of either side in the echo, hence the position of the
//!   edge in the footprint (`contrast`).
//!
//! In: a projected crossing in its developed strip. Out: its [`EdgeLikelihood`]. All distances are positive inwards
//! (into the plate), in metres. Own; Masuda et al. take the boundary samples as the edge.

use super::Sampling;
use super::beam_shape::BeamShape;
use super::contrast::{self, Contrasts, Mixing};
use super::developed_strip::DevelopedStrip;
use super::edge_likelihood::{Bound, EdgeLikelihood, EdgeObservation, SharedObservation};
use super::height_field::LEAST_COSINE;
use super::projected_crossing::ProjectedCrossing;
use super::side_face::SideFace;
use crate::Vec3;
use crate::extract::{Beyond, PlaneSet};

/// Standard deviation of an interval's ends, in parts of the angle between beams: from the pointing of the beam and the
/// shape of the footprint.
pub(super) const SOFTNESS: f64 = 0.03;

/// Relative standard deviation between the footprint at one edge and that of all edges: the footprint is not quite
/// round.
pub(super) const FOOTPRINT_SPREAD: f64 = 0.3;

/// Noise of the smooth face near its edges, in parts of the noise of a sample.
const FACE_NOISE: f64 = 0.03;

/// A beam is on the side face when its distance outside of the edge is less than `SIDE_SLACK` times the visible width
/// of the side face. `SIDE_SLOPE` is the tangent of the angle by which a cut may be out of square.
const SIDE_SLACK: f64 = 1.1;
const SIDE_SLOPE: f64 = 0.1;

/// Number of standard deviations of its range by which the last cell of the face may lie farther out on the side face.
const LAST_BOUND: f64 = 4.0;

/// Widest footprint at an edge, in parts of the estimated half footprint: both halves, wider by their spread.
const WIDEST: f64 = 2.0 * (1.0 + FOOTPRINT_SPREAD);

/// Largest difference of the scatter of mixed pixels that moves no edge, in radii of the beam.
const NEAR_SPREAD: f64 = 0.02;

/// Properties of the beams.
#[derive(Debug, Clone, Copy)]
pub(super) struct BeamModel {
    /// Half the angle that a beam sees, radians.
    pub(super) footprint: f64,
    pub(super) shape: BeamShape,
    /// Standard deviation of an interval's ends, in parts of the angle between beams.
    pub(super) softness: f64,
    /// Contrasts of the planes of the background.
    pub(super) contrasts: Contrasts,
    /// Scatter of the places of an edge by its mixed pixels, in radii of the beam.
    pub(super) mixed_spread: f64,
}

impl BeamModel {
    /// Builds a model of beams with the usual softness.
    pub(super) fn of(footprint: f64, shape: BeamShape, contrasts: Contrasts) -> Self {
        Self { footprint, shape, softness: SOFTNESS, contrasts, mixed_spread: contrast::spread(Vec::new()) }
    }

    /// Returns true when the ranges of mixed pixels determine the position of the edge.
    pub(super) fn mixes_linearly(&self) -> bool {
        self.mixed_spread < contrast::UNINFORMATIVE
    }

    /// Returns true when these beams and `other`, of the same shape and softness, locate an edge at the same position.
    pub(super) fn is_near(&self, other: &Self) -> bool {
        self.footprint == other.footprint
            && self.contrasts.are_near(&other.contrasts)
            && (self.mixed_spread - other.mixed_spread).abs() < NEAR_SPREAD
    }
}

/// One lattice line where it crosses an edge, in the edge's developed strip. Distances inwards, metres.
#[derive(Debug, Clone, Copy)]
pub(super) struct LatticeLine {
    pub(super) along: f64,
    /// Column and row of the last cell of the face.
    pub(super) place: [u32; 2],
    pub(super) low: f64,
    pub(super) high: f64,
    /// Lowest and highest mixed pixel.
    pub(super) mixed: Option<(f64, f64)>,
    /// Planes of the background of which a strip may be visible here, and the plane visible beyond the edge.
    pub(super) strips: PlaneSet,
    pub(super) background: Option<u8>,
    /// True when only one cell lies on that plane.
    pub(super) narrow: bool,
    /// Mixing of the plate with a plane of the background. Where the side face is seen it is that of the silhouette,
    /// which does not determine the edge of the face.
    mixing: Option<Mixing>,
    complete: bool,
    beyond: Beyond,
    /// Distance inwards on the face per radian of footprint.
    pub(super) per_radian: f64,
    /// The same per angle between beams.
    pub(super) per_angle: f64,
    /// Distance inwards per lattice step.
    pub(super) per_step: f64,
    /// Distance of the plate's silhouette outside of the edge, on the face's continuation; 0 where the side face is
    /// hidden.
    side: f64,
    /// Width of the side face weighted by its echo ([`Sight::echo_width`](super::side_face::Sight::echo_width)).
    side_echo: f64,
    /// Noise of the smooth face near its edges, inwards.
    face_noise: f64,
    /// The nearest cell off the face, its distance outside of the edge if it lies on the side face, and the noise of
    /// that distance.
    off: f64,
    on_side: f64,
    off_noise: f64,
    /// The last cell of the face; its distance and noise likewise.
    cell: f64,
    behind: f64,
    cell_noise: f64,
}

impl LatticeLine {
    /// Places a crossing in its strip. `slope` is that of the edge in the strip's plane, by the place along it.
    pub(super) fn new(
        strip: &DevelopedStrip,
        slope: impl Fn(f64) -> f64,
        settled: &ProjectedCrossing,
        side_face: &SideFace,
        Sampling { angle, noise, .. }: Sampling,
    ) -> Self {
        let crossing = &settled.crossing;
        let [inside, outside] = [crossing.inside, crossing.outside].map(|p| strip.flatten(p));
        let mixed = crossing.mixed.map(|pixels| pixels.ends.map(|p| strip.flatten(p).y));
        let along = 0.5 * (inside.x + outside.x);
        let (beam, normal) = (crossing.inside.normalize(), crossing.normal);
        let inward = strip.inward(along, slope(along));
        let per_radian = inwards_per_radian(crossing.inside, normal, inward);
        let sight = side_face.seen_by(crossing.inside, normal, inward);
        let (off, excess) = match (mixed, crossing.mixed) {
            (Some([near, _]), Some(pixels)) => (near, pixels.excess),
            _ => (inside.y.min(outside.y), crossing.excess),
        };
        let (on_side, off_per_range) = sight.outside(f64::from(excess));
        let (behind, cell_per_range) = sight.outside(settled.residual);
        Self {
            along,
            place: settled.place,
            low: inside.y.min(outside.y),
            high: inside.y.max(outside.y),
            mixed: mixed.map(|[a, b]| (a.min(b), a.max(b))),
            strips: crossing.strips,
            background: crossing.background.map(|plane| plane.number),
            narrow: crossing.background.is_some_and(|plane| plane.narrow),
            mixing: Mixing::of(crossing)
                .map(|mixing| if sight.silhouette == 0.0 { mixing } else { mixing.without_odds() }),
            complete: crossing.complete,
            beyond: crossing.beyond,
            per_radian,
            per_angle: angle * per_radian,
            per_step: (inside.y - outside.y).abs() / f64::from(crossing.cells.max(1)),
            side: sight.silhouette,
            side_echo: sight.echo_width,
            face_noise: FACE_NOISE * noise * inward.dot(&beam).abs(),
            off,
            on_side,
            off_noise: noise * off_per_range.abs(),
            cell: strip.flatten(settled.cell).y,
            behind,
            cell_noise: noise * cell_per_range.abs(),
        }
    }

    /// Returns the numbers of columns and of rows over which lines extend.
    pub(super) fn extent<'a>(lines: impl IntoIterator<Item = &'a Self>) -> [u32; 2] {
        let (low, high) = lines.into_iter().fold(([u32::MAX; 2], [0; 2]), |(low, high), line| {
            ([0, 1].map(|k| low[k].min(line.place[k])), [0, 1].map(|k| high[k].max(line.place[k])))
        });
        [0, 1].map(|k| high[k].saturating_sub(low[k]))
    }

    /// Returns true when the plate ends here in front of a background, its side face is hidden and every cell up to the
    /// background was measured. Such lines serve to estimate the footprint.
    pub(super) fn shows_footprint(&self) -> bool {
        self.complete && self.beyond == Beyond::Behind && self.side == 0.0
    }

    /// Returns true when an edge at `at` is within `slack` of the interval.
    pub(super) fn is_near(&self, at: f64, slack: f64) -> bool {
        self.low - slack < at && at < self.high + slack
    }

    /// Returns the distances inside and outside of the edge up to which a beam is detected as mixed, in parts of its
    /// radius.
    pub(super) fn seen_parts(&self, beam: BeamModel) -> [f64; 2] {
        self.mixing.map_or([1.0; 2], |mixing| mixing.seen(beam.shape, &beam.contrasts, 1.0))
    }

    /// Returns the distance outside of the silhouette up to which a beam is detected as mixed, metres. `seen` is the
    /// radius of the beam, `outside_face` that distance outside of an edge without a side face.
    ///
    /// The less of the plate's echo comes from the side face, the nearer to the edge a beam must be. By linear mixing
    /// this distance is a convex function of the width of the side face. It is bounded from below by its tangent at no
    /// width and by its limit, a side face wider than the beam; their maximum is taken.
    fn seen_outside_silhouette(&self, beam: BeamModel, seen: f64, outside_face: f64) -> f64 {
        if self.side == 0.0 {
            return outside_face;
        }
        let echo = self.side_echo / self.side;
        let outside_side_face = match self.mixing {
            Some(mixing) => mixing.seen(beam.shape, &beam.contrasts, echo)[1],
            None => contrast::seen_before_unknown(beam.shape, echo),
        };
        (outside_face - (self.side - self.side_echo)).max(seen * outside_side_face)
    }

    /// Returns the position of the edge in the beam of its single mixed pixel, in radii, and the derivative by the log
    /// odds.
    pub(super) fn place_in_pixel(&self, beam: BeamModel) -> Option<(f64, f64)> {
        self.mixing?.place(beam.shape, &beam.contrasts)
    }

    /// Returns true when it has a single mixed pixel that determines the position of the edge, given the contrast.
    pub(super) fn has_odds(&self) -> bool {
        self.mixing.is_some_and(|mixing| mixing.has_odds())
    }

    /// Returns the position of the edge by its single mixed pixel.
    pub(super) fn edge_in_pixel(&self, beam: BeamModel) -> Option<SharedObservation> {
        let (at, _) = self.mixed?;
        let radius = beam.footprint * self.per_radian;
        self.mixing.filter(|_| radius > 0.0)?.edge(at, radius, beam.shape, &beam.contrasts, beam.mixed_spread)
    }

    /// Returns the number of mixed pixels that see the far edge of a strip of background instead of the plate's edge:
    /// of three or more in a row, those farther from the first than a footprint is wide.
    fn others(&self, beam: BeamModel) -> u32 {
        let Some((lowest, highest)) = self.mixed else { return 0 };
        let width = WIDEST * beam.footprint * self.per_radian;
        let are_three = highest - lowest > 1.5 * self.per_step;
        if width > 0.0 && are_three { ((highest - width - lowest) / self.per_step).ceil() as u32 } else { 0 }
    }

    /// Returns the likelihood of an edge position given this line.
    pub(super) fn likelihood(&self, beam: BeamModel) -> EdgeLikelihood {
        let soft = norm(beam.softness * self.per_angle, self.face_noise);
        let seen = beam.footprint * self.per_radian;
        let [seen_inside, outside_face] = self.seen_parts(beam).map(|part| part * seen);
        let seen_outside = self.seen_outside_silhouette(beam, seen, outside_face);
        let shared = self.edge_in_pixel(beam);
        let of = |terms| EdgeLikelihood { along: self.along, terms, shared };
        let last = EdgeObservation::Last { cell: self.cell, behind: self.behind }.within(self.cell_noise);
        if self.beyond == Beyond::SideFace {
            // The interval is that of two standard deviations to both sides of the crease.
            let soft = norm(soft, 0.25 * (self.high - self.low));
            return of([EdgeObservation::At(0.5 * (self.low + self.high)).within(soft), last]);
        }
        let on_side = self.on_side;
        // Where the side face is a few beams wide, each of these beams may be taken for a mixed pixel.
        if self.side > 0.0
            && self.beyond == Beyond::Behind
            && (self.mixed.is_none() || on_side > -3.0 * self.off_noise)
            && on_side < SIDE_SLACK * self.side + 3.0 * self.off_noise
        {
            let soft = norm(norm(soft, self.off_noise), SIDE_SLOPE * on_side);
            return of([EdgeObservation::At(self.off + on_side).within(soft), last]);
        }
        let mut above = Bound { sure: self.low, likely: self.low };
        // A beam within a footprint of the edge sees beyond the plate if the side face is narrower than that. The last
        // cell of the face may lie on the side face, as far out as its range is behind the face.
        let outside = (self.behind.max(0.0) + LAST_BOUND * self.cell_noise).min(self.side).min(seen);
        let mut below =
            Bound { sure: self.high + outside, likely: self.high - (seen_inside - self.side).max(0.0) };
        if self.beyond == Beyond::Behind {
            above.sure += self.side;
            above.likely += self.side + seen_outside;
        }
        if let Some((lowest, highest)) = self.mixed {
            let others = self.others(beam);
            let lowest = lowest + f64::from(others) * self.per_step;
            let (least, most) = (highest + self.side - seen_inside, lowest + self.side + seen_outside);
            above = Bound { sure: above.sure.max(least), likely: above.likely.max(least) };
            if others > 0 {
                above.likely = above.likely.max(lowest - self.per_step + self.side + seen);
            }
            below = Bound { sure: below.sure.min(most), likely: below.likely.min(most) };
        } else if self.side > seen && self.cell_noise > 0.0 {
            return of([EdgeObservation::Above(above).within(soft), last]);
        }
        of([EdgeObservation::Above(above), EdgeObservation::Below(below)]
            .map(|observation| observation.within(soft)))
    }
}

/// Returns the distance inwards on the face by which a beam to `point` moves when it turns, per radian. `normal` and
/// `inward` are unit vectors there. Where an edge is bridged the face may turn away from the beams; it then counts as
/// seen at grazing incidence ([`LEAST_COSINE`]).
pub(super) fn inwards_per_radian(point: Vec3, normal: Vec3, inward: Vec3) -> f64 {
    let beam = point.normalize();
    // A beam turned by an angle in the direction e meets the face r (e - beam (n e) / (n beam)) away: the
    // inward part of that, over all e across the beam, is the length of this vector.
    let lever = inward - normal * (inward.dot(&beam) / normal.dot(&beam).min(-LEAST_COSINE));
    point.norm() * (lever - beam * lever.dot(&beam)).norm()
}

/// Returns the length of (a, b) without the range checks of `hypot`.
fn norm(a: f64, b: f64) -> f64 {
    (a * a + b * b).sqrt()
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::beam_shape::tests::power_beyond;
    use super::super::contrast::ContrastDistribution;
    use super::*;

    /// Returns a line without mixed pixels at a side face that is visible over 1.35 mm beside the edge and recedes by
    /// 50 mm per millimetre; the half footprint is 1.6 mm.
    fn line(behind: f64) -> LatticeLine {
        LatticeLine {
            along: 0.0,
            place: [0; 2],
            low: -4e-3,
            high: 1.7e-3,
            mixed: None,
            strips: PlaneSet::default(),
            background: None,
            narrow: false,
            mixing: None,
            complete: true,
            beyond: Beyond::Behind,
            per_radian: 10.0,
            per_angle: 6e-3,
            per_step: 5.7e-3,
            side: 1.35e-3,
            side_echo: 1.35e-3,
            face_noise: FACE_NOISE * 1.4e-5,
            off: -4e-3,
            on_side: 0.05,
            off_noise: 1.4e-5,
            cell: 1.7e-3,
            behind,
            cell_noise: 1.4e-5,
        }
    }

    /// Returns the same line where the side face is hidden, with these mixed pixels.
    pub(crate) fn open_line(mixed: Option<(f64, f64)>) -> LatticeLine {
        LatticeLine { side: 0.0, mixed, ..line(0.0) }
    }

    /// Returns the same line with one mixed pixel that determines the position of the edge.
    pub(crate) fn one_pixel_line(at: f64) -> LatticeLine {
        LatticeLine { mixing: Some(super::super::contrast::tests::half()), ..open_line(Some((at, at))) }
    }

    /// Exact: the three shares of a beam by a sum over a fine grid, and the distance by bisection.
    #[test]
    fn a_dark_side_face_is_detected_less_far_from_the_silhouette() {
        let (shape, contrasts) = (BeamShape::numbered(0), ContrastDistribution::PRIOR.mean());
        let beam = BeamModel::of(1e-4, shape, contrasts);
        let open = one_pixel_line(0.0);
        let radius = beam.footprint * open.per_radian;
        let face_alone = open.seen_parts(beam)[1];
        // Plate over background in the beam.
        let odds = |outside: f64, width: f64, echo: f64| {
            let [plate, face] = [outside, outside + width].map(|off| power_beyond(1.0, off));
            (face + echo * (plate - face)) / (1.0 - plate)
        };
        let limit = odds(face_alone, 0.0, 1.0);
        for (width, echo) in
            [(0.3, 1.0), (0.3, 0.05), (0.3, 0.5), (0.8, 0.05), (0.8, 0.3), (2.5, 0.05), (2.5, 0.5)]
        {
            let side = width * radius;
            let line = LatticeLine { side, side_echo: echo * side, ..open };
            let found = line.seen_outside_silhouette(beam, radius, face_alone * radius) / radius;
            let (mut low, mut high) = (-1.0, 1.0);
            for _ in 0..16 {
                let middle = 0.5 * (low + high);
                *(if odds(middle, width, echo) > limit { &mut low } else { &mut high }) = middle;
            }
            assert!(found < low + 4e-3 && found > low - 0.03, "{width} {echo}: {found} {low}");
        }
    }

    /// Returns the likelihood of an edge `far` inside of the last cell of the face, over that at the cell, with 0.7 mm
    /// of noise.
    fn inside(line: &LatticeLine, far: f64) -> f64 {
        let of = line.likelihood(BeamModel::of(
            1.6e-4,
            BeamShape::numbered(0),
            ContrastDistribution::PRIOR.mean(),
        ));
        of.value(line.high + far, &[]) / of.value(line.high, &[])
    }

    /// Three mixed pixels in a row 5.7 mm apart; a spot 3.2 mm wide explains one of them.
    #[test]
    fn mixed_pixels_of_another_edge_behind_a_strip_do_not_count() {
        let line = LatticeLine { low: -21.1e-3, ..open_line(Some((-15.4e-3, -4e-3))) };
        let of = line.likelihood(BeamModel::of(
            1.6e-4,
            BeamShape::numbered(0),
            ContrastDistribution::PRIOR.mean(),
        ));
        for elsewhere in [-15e-3, -9.7e-3, 0.0] {
            assert!(
                of.value(-4e-3, &[]) > 10.0 * of.value(elsewhere, &[]),
                "{} {}",
                of.value(-4e-3, &[]),
                of.value(elsewhere, &[])
            );
        }
    }

    #[test]
    fn a_last_cell_whose_range_is_that_of_the_face_is_not_on_the_side_face() {
        assert!(inside(&line(0.0), 1e-3) < 0.1, "{}", inside(&line(0.0), 1e-3));
        // A cell whose range is as far behind as the side face may be on it.
        assert!(inside(&line(1.2e-3), 1e-3) > 0.3, "{}", inside(&line(1.2e-3), 1e-3));
    }
}
