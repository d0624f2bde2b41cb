//! Side face of the plate beside an edge: square, or a double-V bevel of two flanks and a root face.
//!
//! In: thickness, face inset and root face of the plate file. Out, for each lattice line ([`Sight`]): the distance
//! outside of the edge, on the face's continuation, of a beam whose range is a given amount behind that continuation;
//! the distance of the plate's silhouette; and the visible width of the side face weighted by its echo.
//!
//! Across the edge the side face is a polyline in (o, z), where o is the distance outside of the face's edge and z the
//! depth below the face. Its corners are (0, 0), (inset, flank), (inset, flank + root face), (0, thickness). Per unit
//! of range a beam covers the depth c and the distance s inwards. A beam that ends on the side face, at a range e
//! behind the face's continuation, has z = c e and met the continuation x = o + s e outside of the edge. On each strip
//! of the polyline o is linear in z, hence dx/de = s + c do/dz. A square side face has o = 0. The echo of a strip
//! relative to that of the face is the ratio of the cosines of their incidence (Lambert's law). Own.

use crate::{PlateSpec, Vec3};

/// Accuracy to which the direction of an edge is known, radians: a side face visible under a smaller angle is taken as
/// hidden.
const DIRECTION: f64 = 0.02;

/// Strips of a bevelled side face.
const STRIPS: usize = 3;

/// Side face of a plate, the same along all edges.
#[derive(Debug, Clone, Copy)]
pub(super) struct SideFace {
    /// (o, z) at the lower end of each strip, metres.
    ends: [[f64; 2]; STRIPS],
    thickness: f64,
    /// Tangent of the angle between the uppermost strip and the face's normal.
    slope: f64,
}

impl SideFace {
    /// Returns the side face that a plate file describes.
    pub(super) fn of(spec: &PlateSpec) -> Self {
        let (thickness, inset) = (spec.thickness, spec.face_inset);
        let Some(flank) = spec.flank_depth() else {
            return Self { ends: [[0.0, thickness]; STRIPS], thickness, slope: 0.0 };
        };
        let ends = [[inset, flank], [inset, flank + spec.root_face], [0.0, thickness]];
        Self { ends, thickness, slope: inset / flank }
    }

    /// Returns true when the side face below the edge at `point` is seen; the edge is then located by the ranges on the
    /// side face. `normal` and `inward` are unit vectors of the face.
    pub(super) fn is_seen(&self, point: Vec3, normal: Vec3, inward: Vec3) -> bool {
        let height = -normal.dot(&point);
        inward.dot(&point) + self.slope * height > height * DIRECTION
    }

    /// Returns the side face as the beam to `point` on the edge meets it.
    pub(super) fn seen_by(&self, point: Vec3, normal: Vec3, inward: Vec3) -> Sight {
        let beam = point.normalize();
        let (per_range, depth_per_range) = (inward.dot(&beam), -normal.dot(&beam));
        let (inwards, height) = (inward.dot(&point), -normal.dot(&point));
        let mut pieces = [Piece { from: f64::INFINITY, outside: 0.0, per_range: 0.0 }; STRIPS];
        let (mut silhouette, mut echo_width, mut start) = (0.0, 0.0, [0.0; 2]);
        for (k, (piece, end)) in pieces.iter_mut().zip(self.ends).enumerate() {
            let [[from_out, from_depth], [out, depth]] = [start, end];
            // The beam through (out, depth) meets the face's plane at height / (height + depth) of its way.
            let outside = (inwards * depth + out * height) / (height + depth);
            if k > 0 && outside <= silhouette {
                // Turned away from the scanner, as are all strips that follow, or of no height.
                continue;
            }
            let (along, down) = (out - from_out, depth - from_depth);
            let cosine = (per_range * down + depth_per_range * along) / along.hypot(down);
            echo_width += (outside - silhouette) * (cosine / depth_per_range).clamp(0.0, 1.0);
            silhouette = f64::max(silhouette, outside);
            let from = from_depth / depth_per_range;
            let slope = along / down;
            *piece = Piece {
                from,
                outside: from_out + from * per_range,
                per_range: per_range + slope * depth_per_range,
            };
            start = end;
        }
        let seen = silhouette > DIRECTION * self.thickness;
        let [silhouette, echo_width] = [silhouette, echo_width].map(|width| if seen { width } else { 0.0 });
        Sight { silhouette, echo_width, pieces }
    }
}

/// A visible strip of the side face.
#[derive(Debug, Clone, Copy)]
struct Piece {
    /// Range behind the face's continuation at which the strip begins, and the distance outside of the edge there,
    /// metres.
    from: f64,
    outside: f64,
    /// Distance outside per range.
    per_range: f64,
}

/// Side face as one beam meets it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sight {
    /// Distance outside of the edge, on the face's continuation, at which the plate ends; 0 where its side face is
    /// hidden.
    pub(super) silhouette: f64,
    /// Width, on the face's continuation, over which a surface as bright as the face returns the echo of the visible
    /// side face, and at most the visible width.
    pub(super) echo_width: f64,
    pieces: [Piece; STRIPS],
}

impl Sight {
    /// Returns the distance outside of the edge of a beam whose range is `excess` behind the face's continuation, and
    /// its derivative by `excess`.
    pub(super) fn outside(&self, excess: f64) -> (f64, f64) {
        let [first, ..] = &self.pieces;
        let piece = self.pieces.iter().rev().find(|piece| piece.from <= excess).unwrap_or(first);
        (piece.outside + (excess - piece.from) * piece.per_range, piece.per_range)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spec(face_inset: f64, root_face: f64) -> PlateSpec {
        PlateSpec {
            width: 3.0,
            height: 2.5,
            thickness: 0.036,
            face_inset,
            root_face,
            u_axis: None,
            region: None,
        }
    }

    /// Returns the sight of an edge along y from `height` above the face; `inwards` is the distance from the scanner to
    /// the edge, positive for a near edge.
    fn sight(side: &SideFace, inwards: f64, height: f64) -> Sight {
        side.seen_by(Vec3::new(inwards, 0.0, -height), Vec3::z(), Vec3::x())
    }

    /// Casts beams from the scanner at points of the side face and compares with the closed form.
    fn check(side: &SideFace, inwards: f64, points: &[[f64; 2]]) {
        let height = 3.6;
        let sight = sight(side, inwards, height);
        for &[out, depth] in points {
            let on_side = Vec3::new(inwards - out, 0.0, -height - depth);
            let share = height / (height + depth);
            let (excess, met) = (on_side.norm() * (1.0 - share), on_side.x * share);
            let (outside, per_range) = sight.outside(excess);
            // Beams are taken as parallel over the side face: an error of one part in a hundred, depth over height.
            let allowed = 0.01 * outside;
            assert!(
                (outside - (inwards - met)).abs() < allowed,
                "{out} {depth}: {outside} {}",
                inwards - met
            );
            assert!(per_range > 0.0 && outside < sight.silhouette + allowed, "{out} {depth}: {sight:?}");
        }
    }

    #[test]
    fn beams_on_a_bevel_are_placed_by_the_strip_they_meet() {
        let side = SideFace::of(&spec(0.009, 0.004));
        let flank = [[0.0045, 0.008], [0.009, 0.016]];
        let root = [[0.009, 0.018], [0.009, 0.02]];
        // At a near edge, at 59 degrees of incidence, all strips are visible; at a lateral one and at a far one of
        // small incidence the upper flank alone.
        check(&side, 6.0, &[flank.as_slice(), &root, &[[0.0045, 0.028], [0.0, 0.036]]].concat());
        check(&side, 0.0, &flank);
        check(&side, -1.0, &flank);
        assert!((sight(&side, 0.0, 3.6).silhouette - 0.009).abs() < 1e-4);
        let far = (Vec3::new(-4.0, 0.0, -3.6), Vec3::z(), Vec3::x());
        assert_eq!(side.seen_by(far.0, far.1, far.2).silhouette, 0.0);
        assert!(!side.is_seen(far.0, far.1, far.2));
        assert!(side.is_seen(Vec3::new(-1.0, 0.0, -3.6), far.1, far.2));
        assert!(!SideFace::of(&spec(0.0, 0.0)).is_seen(Vec3::new(-1.0, 0.0, -3.6), far.1, far.2));
        // Without a root face the flanks meet.
        check(&SideFace::of(&spec(0.0104, 0.0)), 6.0, &[[0.0052, 0.009], [0.0052, 0.027]]);
    }

    #[test]
    fn the_echo_of_a_side_face_is_that_of_its_incidence() {
        let square = SideFace::of(&spec(0.0, 0.0));
        // At 4.8 degrees to the side face and at 85.2 to the face, of which it is 12 times as dark.
        let seen = sight(&square, 0.3, 3.6);
        assert!((seen.echo_width - seen.silhouette / 12.0).abs() < 1e-15, "{seen:?}");
        let bright = sight(&square, 6.0, 3.6);
        assert_eq!(bright.echo_width, bright.silhouette);
        // From above, the flank of a bevel of 29.4 degrees alone.
        let flank = sight(&SideFace::of(&spec(0.009, 0.004)), 0.0, 3.6);
        assert!(
            (flank.echo_width / flank.silhouette - 0.009 / 0.009_f64.hypot(0.016)).abs() < 1e-12,
            "{flank:?}"
        );
        assert_eq!(sight(&square, -1.0, 3.6).echo_width, 0.0);
    }

    #[test]
    fn a_square_side_face_shifts_by_the_inward_part_of_the_range() {
        let side = SideFace::of(&spec(0.0, 0.0));
        check(&side, 6.0, &[[0.0, 0.01], [0.0, 0.036]]);
        let seen = sight(&side, 6.0, 3.6);
        let sine = 6.0_f64 / 6.0_f64.hypot(3.6);
        assert!((seen.outside(0.02).0 - 0.02 * sine).abs() < 1e-15);
        assert!((seen.silhouette - 6.0 * 0.036 / 3.636).abs() < 1e-15);
    }
}
