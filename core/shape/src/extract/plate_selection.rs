//! Selection of the plate among the candidate faces, by area and by the sides of the smallest rectangle around each.
//!
//! In: the faces of all components, some of them in several pieces. Out: the one candidate of the plate's size, or a
//! [`Refusal`] when none or several fit. Own; Masuda et al. leave the selection open.

use super::occlusion::FacePiece;
use super::refusal::Refusal;
use crate::{PlateSpec, Vec3};

/// Area of the plate's visible face in parts of W x H. Below, too much of the face is hidden; above, it is another
/// plate. The face's own area differs from W x H by less than one part in a hundred.
const AREA: std::ops::Range<f64> = 0.5..1.1;

/// Sides of the smallest rectangle around the face, in the plane, in parts of W and H. A plate bent to R 3 m over 5 m
/// spans 0.89 of its length; an object in front of an edge reduces it further.
const SIDE: std::ops::Range<f64> = 0.82..1.06;

/// The widest spacing of samples on the plate, metres, at which its corners are located to some millimetres.
const WIDEST_SPACING: f64 = 0.025;

/// Least area, in parts of W x H, of a face that is reported as one of another size.
const NOTABLE: f64 = 0.15;

/// Bounds where several faces fit, as logarithms of a ratio of areas. The plate's own face differs from W x H by less
/// than `OWN_AREA` (the rim of a face is lost over some cells); a face of another size differs from the plate's by more
/// than `OTHER_AREA`.
const OWN_AREA: f64 = 0.1;
const OTHER_AREA: f64 = 0.08;

/// Share of hidden ends below which a face counts as seen whole.
const WHOLE: f64 = 0.05;

/// A face lies behind the plate when the plate hides at least the part `BEHIND` of the face's rectangle, and at least
/// `BEHIND_OF_MISSING` of the part of the rectangle in which less of the face is seen than of the plate in its own (the
/// rim of every face is lost over some cells). An object that stands on a table hides more.
const BEHIND: f64 = 0.1;
const BEHIND_OF_MISSING: f64 = 0.5;

/// Pieces that form one face.
#[derive(Debug, Clone)]
pub(super) struct Candidate {
    /// Indices into the list of pieces.
    pub(super) pieces: Vec<usize>,
    area: f64,
    /// Side of the square of the face that a cell stands for, metres.
    spacing: f64,
    /// Largest share of hidden ends among its pieces.
    hidden: f64,
    centre: Vec3,
    rectangle: Rectangle,
}

impl Candidate {
    fn of(pieces: &[FacePiece], members: Vec<usize>) -> Self {
        let points: Vec<Vec3> = members.iter().flat_map(|&i| pieces[i].outline.iter().copied()).collect();
        let centre = points.iter().sum::<Vec3>() / points.len().max(1) as f64;
        let area = members.iter().map(|&i| pieces[i].area).sum::<f64>();
        let n_cells: usize = members.iter().map(|&i| pieces[i].n_cells).sum();
        let spacing = (area / n_cells.max(1) as f64).sqrt();
        let hidden = members.iter().map(|&i| pieces[i].hidden).fold(0.0, f64::max);
        Self { pieces: members, area, spacing, hidden, centre, rectangle: Rectangle::around(&points, centre) }
    }

    /// Returns true when area and sides are those of the plate.
    pub(super) fn fits(&self, spec: &PlateSpec) -> bool {
        let expected = sides(spec);
        AREA.contains(&(self.area / (spec.width * spec.height)))
            && (0..2).all(|k| SIDE.contains(&(self.rectangle.sides[k] / expected[k])))
    }

    /// Returns the part of its rectangle in which the face is seen.
    fn filled(&self) -> f64 {
        self.area / (self.rectangle.sides[0] * self.rectangle.sides[1])
    }

    /// Returns true when this face, next to the plate's, is not the plate: it has another size and either is seen whole
    /// or lies behind the plate, which hides the rest of it (a table).
    fn is_another_than(&self, plate: &Self) -> bool {
        let has_other_size = (self.area / plate.area).ln().abs() > OTHER_AREA;
        let missing = 1.0 - self.filled() / plate.filled();
        let behind = self.rectangle.share_behind(&plate.rectangle);
        has_other_size && (self.hidden < WHOLE || behind > BEHIND.max(BEHIND_OF_MISSING * missing))
    }
}

fn sides(spec: &PlateSpec) -> [f64; 2] {
    [spec.width.max(spec.height), spec.width.min(spec.height)]
}

/// Joins pieces that continue each other to candidates.
pub(super) fn candidates(pieces: &[FacePiece]) -> Vec<Candidate> {
    let mut group: Vec<usize> = (0..pieces.len()).collect();
    for a in 0..pieces.len() {
        for b in 0..a {
            if group[a] != group[b] && pieces[a].continues_in(&pieces[b]) {
                let (from, into) = (group[a].max(group[b]), group[a].min(group[b]));
                group.iter_mut().filter(|g| **g == from).for_each(|g| *g = into);
            }
        }
    }
    let members = |g: usize| (0..pieces.len()).filter(|&i| group[i] == g).collect::<Vec<_>>();
    (0..pieces.len()).map(members).filter(|m| !m.is_empty()).map(|m| Candidate::of(pieces, m)).collect()
}

/// Selects the one candidate that fits the plate, or the one nearest to its size where the others are distinguished
/// from it. `step` is the angle between beams, radians.
///
/// # Errors
/// [`Refusal`] when none or several fit, or the samples lie too far apart.
pub(super) fn select<'a>(
    candidates: &'a [Candidate],
    spec: &PlateSpec,
    step: f64,
) -> Result<&'a Candidate, Refusal> {
    let fitting: Vec<_> = candidates.iter().filter(|c| c.fits(spec)).collect();
    match fitting.as_slice() {
        [one] => check_spacing(one.spacing, step).map(|()| *one),
        [] => Err(why_none(candidates, spec, step)),
        [first, second, ..] => {
            let off = |c: &Candidate| (c.area / (spec.width * spec.height)).ln().abs();
            let nearest = fitting.iter().copied().fold(*first, |a, b| if off(b) < off(a) { b } else { a });
            let is_only = |c: &&Candidate| std::ptr::eq(*c, nearest) || c.is_another_than(nearest);
            if off(nearest) < OWN_AREA && fitting.iter().all(is_only) {
                return check_spacing(nearest.spacing, step).map(|()| nearest);
            }
            Err(Refusal::SeveralPlates { count: fitting.len(), first: first.centre, second: second.centre })
        }
    }
}

/// Refuses a spacing of the samples on the plate, metres, that is too wide.
pub(super) fn check_spacing(spacing: f64, step: f64) -> Result<(), Refusal> {
    if spacing <= WIDEST_SPACING {
        return Ok(());
    }
    Err(Refusal::TooCoarse {
        spacing_mm: 1000.0 * spacing,
        widest_mm: 1000.0 * WIDEST_SPACING,
        step_deg: (step * WIDEST_SPACING / spacing).to_degrees(),
    })
}

fn why_none(candidates: &[Candidate], spec: &PlateSpec, step: f64) -> Refusal {
    let plate = spec.width * spec.height;
    let closeness = |c: &&Candidate| (c.area / plate).ln().abs();
    let nearest = candidates.iter().min_by(|a, b| closeness(a).total_cmp(&closeness(b)));
    match nearest {
        // The rim of a face is lost over some cells: a face of few cells seems smaller than it is.
        Some(face) if face.area > NOTABLE * plate => match check_spacing(face.spacing, step) {
            Err(too_coarse) => too_coarse,
            Ok(()) => Refusal::WrongSize {
                at: face.centre,
                found_mm: face.rectangle.sides.map(|s| s * 1000.0),
                expected_mm: sides(spec).map(|s| s * 1000.0),
            },
        },
        _ => Refusal::NoPlate {
            largest_m2: candidates.iter().map(|c| c.area).fold(0.0, f64::max),
            expected_m2: plate,
            region: spec.region.is_some(),
        },
    }
}

/// The smallest rectangle around points in their principal plane.
#[derive(Debug, Clone, Copy)]
struct Rectangle {
    /// Middle of the rectangle.
    middle: Vec3,
    /// Unit vectors along the sides.
    along: [Vec3; 2],
    /// Longer and shorter side, metres.
    sides: [f64; 2],
}

impl Rectangle {
    fn around(points: &[Vec3], centre: Vec3) -> Self {
        let covariance =
            points.iter().map(|p| (p - centre) * (p - centre).transpose()).sum::<nalgebra::Matrix3<f64>>();
        let eigen = covariance.symmetric_eigen();
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        let [e1, e2] = [0, 1].map(|k| eigen.eigenvectors.column(order[k]).into_owned());
        let turned = |degrees: i32| {
            let (sin, cos) = f64::from(degrees).to_radians().sin_cos();
            let along = [e1 * cos + e2 * sin, e2 * cos - e1 * sin];
            let spans = along.map(|axis| {
                let places = points.iter().map(|p| (p - centre).dot(&axis));
                places.fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(x), high.max(x)))
            });
            let middle = centre + (0..2).map(|k| along[k] * (0.5 * (spans[k].0 + spans[k].1))).sum::<Vec3>();
            let [a, b] = spans.map(|(low, high)| (high - low).max(0.0));
            if a < b {
                Self { middle, along: [along[1], along[0]], sides: [b, a] }
            } else {
                Self { middle, along, sides: [a, b] }
            }
        };
        // One degree is enough: the sides are compared with a tolerance of several parts in a hundred.
        let area = |r: &Self| r.sides[0] * r.sides[1];
        (1..90).map(turned).fold(turned(0), |best, next| if area(&next) < area(&best) { next } else { best })
    }

    /// Returns the part of this rectangle that `front` hides from the scanner.
    fn share_behind(&self, front: &Self) -> f64 {
        const PARTS: usize = 16;
        let place =
            |i: usize, k: usize| self.along[k] * (self.sides[k] * ((i as f64 + 0.5) / PARTS as f64 - 0.5));
        let hidden = |point: &Vec3| {
            let normal = front.along[0].cross(&front.along[1]);
            let part = normal.dot(&front.middle) / normal.dot(point);
            let off = point * part - front.middle;
            (0.0..1.0).contains(&part)
                && (0..2).all(|k| off.dot(&front.along[k]).abs() < 0.5 * front.sides[k])
        };
        let points = (0..PARTS).flat_map(|i| (0..PARTS).map(move |j| (i, j)));
        let n = points.filter(|(i, j)| hidden(&(self.middle + place(*i, 0) + place(*j, 1)))).count();
        n as f64 / (PARTS * PARTS) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPEC: PlateSpec = PlateSpec {
        width: 3.0,
        height: 2.5,
        thickness: 0.036,
        face_inset: 0.0,
        root_face: 0.0,
        u_axis: None,
        region: None,
    };

    /// Returns a level face around `centre` with the given sides; `part` of it is seen.
    fn face(centre: [f64; 3], [a, b]: [f64; 2], part: f64, hidden: f64) -> Candidate {
        let centre = Vec3::from(centre);
        let corners = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]];
        let points = corners.map(|[x, y]| centre + Vec3::new(a * x, b * y, 0.0));
        let rectangle = Rectangle::around(&points, centre);
        Candidate { pieces: vec![0], area: part * a * b, spacing: 0.008, hidden, centre, rectangle }
    }

    fn selected(candidates: &[Candidate]) -> Result<[f64; 3], Refusal> {
        select(candidates, &SPEC, 1e-3).map(|c| c.centre.into())
    }

    #[test]
    fn a_smaller_stack_seen_whole_is_another_plate() {
        let plate = face([6.0, 0.0, -3.5], [3.0, 2.5], 0.98, 0.0);
        let at = plate.centre.into();
        let stack = |part, hidden| face([6.0, 4.0, -3.5], [2.78, 2.32], part, hidden);
        assert_eq!(selected(&[stack(1.0, 0.0), plate.clone()]).ok(), Some(at));
        // A stack that is hidden in part may be the plate; so may one of the same size.
        assert!(matches!(selected(&[stack(1.0, 0.2), plate.clone()]), Err(Refusal::SeveralPlates { .. })));
        let same = face([6.0, 4.0, -3.5], [3.0, 2.5], 0.95, 0.0);
        assert!(matches!(selected(&[same, plate]), Err(Refusal::SeveralPlates { .. })));
    }

    #[test]
    fn a_table_behind_the_plate_is_not_the_plate() {
        let plate = face([6.0, 0.0, -3.5], [3.0, 2.5], 0.96, 0.0);
        let at = plate.centre.into();
        // Half a metre below; the plate hides a part of it.
        let table = |y, part| face([6.2, y, -4.0], [2.9, 2.4], part, 0.5);
        assert_eq!(selected(&[table(0.0, 0.55), plate.clone()]).ok(), Some(at));
        // Beside the plate: another object hides the table.
        assert!(matches!(selected(&[table(4.0, 0.55), plate.clone()]), Err(Refusal::SeveralPlates { .. })));
        // The plate itself is hidden in part: no face has its size.
        let hidden = face([6.0, 0.0, -3.5], [3.0, 2.5], 0.8, 0.2);
        assert!(matches!(selected(&[table(0.0, 0.55), hidden]), Err(Refusal::SeveralPlates { .. })));
    }
}
