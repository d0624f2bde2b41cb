//! Selection of the plate among the candidate faces, by area and by the sides of the smallest rectangle around each.
//!
//! Masuda et al. leave the selection open.

use super::occlusion::FacePiece;
use super::refusal::Refusal;
use crate::{PlateSpec, Vec3};

/// Area of the plate's visible face in parts of W x H: below, too much of it is hidden; above, it is another plate. The face's own area differs from W x H by less than one part in a hundred.
const AREA: std::ops::Range<f64> = 0.5..1.1;

/// Sides of the smallest rectangle around the face, in the plane, in parts of W and H. A plate bent to R 3 m over 5 m
/// spans 0.89 of its length; something in front of an edge takes more.
const SIDE: std::ops::Range<f64> = 0.82..1.06;

/// The widest spacing of samples on the plate, metres, at which its corners are located to some millimetres.
const WIDEST_SPACING: f64 = 0.025;

/// A face from this part of W x H on is reported as one of another size.
const NOTABLE: f64 = 0.15;

/// Pieces that form one face.
#[derive(Debug, Clone)]
pub(super) struct Candidate {
    /// Indices into the list of pieces.
    pub(super) pieces: Vec<usize>,
    area: f64,
    /// Side of the square of the face that a cell stands for, metres.
    spacing: f64,
    centre: Vec3,
    /// Longer and shorter side of the smallest rectangle around it, metres.
    sides: [f64; 2],
}

impl Candidate {
    fn of(pieces: &[FacePiece], members: Vec<usize>) -> Self {
        let points: Vec<Vec3> = members.iter().flat_map(|&i| pieces[i].outline.iter().copied()).collect();
        let centre = points.iter().sum::<Vec3>() / points.len().max(1) as f64;
        let area = members.iter().map(|&i| pieces[i].area).sum::<f64>();
        let n_cells: usize = members.iter().map(|&i| pieces[i].n_cells).sum();
        let spacing = (area / n_cells.max(1) as f64).sqrt();
        Self { pieces: members, area, spacing, centre, sides: smallest_rectangle(&points, centre) }
    }

    /// Returns true when area and sides are those of the plate.
    pub(super) fn fits(&self, spec: &PlateSpec) -> bool {
        let expected = sides(spec);
        AREA.contains(&(self.area / (spec.width * spec.height)))
            && (0..2).all(|k| SIDE.contains(&(self.sides[k] / expected[k])))
    }
}

fn sides(spec: &PlateSpec) -> [f64; 2] {
    [spec.width.max(spec.height), spec.width.min(spec.height)]
}

/// Joins pieces that continue each other.
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

/// Selects the one candidate that fits the plate. `step` is the angle between beams, radians.
///
/// # Errors
/// [`Refusal`] when none or several do, or its samples lie too far apart.
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
            Err(Refusal::SeveralPlates { count: fitting.len(), first: first.centre, second: second.centre })
        }
    }
}

/// Refuses samples that lie `spacing` apart on the plate, metres, where that is too far.
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
        // The rim of a face is lost over some cells: one of few cells seems smaller than it is.
        Some(face) if face.area > NOTABLE * plate => match check_spacing(face.spacing, step) {
            Err(too_coarse) => too_coarse,
            Ok(()) => Refusal::WrongSize {
                at: face.centre,
                found_mm: face.sides.map(|s| s * 1000.0),
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

/// Returns the sides, longer first, of the smallest rectangle around points in their principal plane.
fn smallest_rectangle(points: &[Vec3], centre: Vec3) -> [f64; 2] {
    let covariance =
        points.iter().map(|p| (p - centre) * (p - centre).transpose()).sum::<nalgebra::Matrix3<f64>>();
    let eigen = covariance.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let axis = |k: usize| eigen.eigenvectors.column(order[k]).into_owned();
    let (e1, e2) = (axis(0), axis(1));
    let plane: Vec<(f64, f64)> =
        points.iter().map(|p| ((p - centre).dot(&e1), (p - centre).dot(&e2))).collect();
    let extent = |angle: f64| {
        let (sin, cos) = angle.sin_cos();
        let along = |f: &dyn Fn(&(f64, f64)) -> f64| {
            let (low, high) =
                plane.iter().map(f).fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(x), h.max(x)));
            high - low
        };
        let a = along(&|p| p.0 * cos + p.1 * sin);
        let b = along(&|p| p.1 * cos - p.0 * sin);
        [a.max(b), a.min(b)]
    };
    // One degree is enough: the sides are compared with a tolerance of several parts in a hundred.
    let turns = (0..90).map(|degrees| extent(f64::from(degrees).to_radians()));
    turns.min_by(|a, b| (a[0] * a[1]).total_cmp(&(b[0] * b[1]))).unwrap_or([0.0; 2])
}
