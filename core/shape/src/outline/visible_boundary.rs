//! Visible part of the boundary loop: the crossings along it where the plate itself ends.
//!
//! A crossing is the place between two neighbouring samples where the face ends. In: the loop of `boundary_loop` and
//! the crossings of the patch. Out: the crossings along the loop and their points in the mean plane, counter-clockwise,
//! for `corners` and `edge`. Crossings where a nearer object hides the edge are left out.

use nalgebra::Vector2;
use platen_numerics::median::median;

use super::OutlineError;
use super::boundary_loop::Grid;
use super::corners::Corner;
use super::plane::Plane;
use crate::extract::{Beyond, Crossing, Patch};
use crate::{PlateSpec, Vec3};

/// Least length of the plate's loop, counted in lattice steps, in parts of the plate's circumference.
const LOOP_PART: f64 = 0.6;

/// Places on the loop where the plate visibly ends, counter-clockwise seen from the scanner.
pub(super) struct VisibleBoundary<'a> {
    /// Crossings of each place.
    crossings: Vec<Vec<&'a Crossing>>,
    /// Middle of the crossings of each place, in space and in the plane.
    points: Vec<Vec3>,
    pub(super) flat: Vec<Vector2<f64>>,
    pub(super) plane: Plane,
    /// Spacing of the samples, metres.
    pub(super) step: f64,
}

impl<'a> VisibleBoundary<'a> {
    /// Collects the crossings along the longest loop.
    ///
    /// # Errors
    /// [`OutlineError::Loop`] when there is no loop of the plate's length.
    pub(super) fn of(patch: &'a Patch, spec: &PlateSpec) -> Result<Self, OutlineError> {
        let step = spacing(patch);
        let circumference = 2.0 * (spec.width + spec.height);
        let grid = Grid::of(patch);
        let cells = grid.longest_loop(LOOP_PART * circumference / step);
        if (cells.len() as f64) * step < LOOP_PART * circumference {
            let (found_mm, expected_mm) = (cells.len() as f64 * step * 1000.0, circumference * 1000.0);
            return Err(OutlineError::Loop { found_mm, expected_mm });
        }
        let place = grid.places(&cells);
        let mut crossings = vec![Vec::new(); cells.len()];
        for crossing in patch.crossings.iter().filter(|c| c.beyond != Beyond::InFront) {
            if let Some(&place) = place.get(&crossing.sample) {
                crossings[place as usize].push(crossing);
            }
        }
        crossings.retain(|c| !c.is_empty());
        let middle = |of: &Vec<&Crossing>| {
            of.iter().map(|c| 0.5 * (c.inside + c.outside)).sum::<Vec3>() / of.len() as f64
        };
        let mut points: Vec<Vec3> = crossings.iter().map(middle).collect();
        let origin = points.iter().sum::<Vec3>() / points.len().max(1) as f64;
        let plane = Plane::new(origin, crossings.iter().flatten().map(|c| c.normal).sum());
        let mut flat: Vec<_> = points.iter().map(|p| plane.project(*p)).collect();
        let area: f64 = (0..flat.len()).map(|i| flat[i].perp(&flat[(i + 1) % flat.len()])).sum();
        if area < 0.0 {
            crossings.reverse();
            points.reverse();
            flat.reverse();
        }
        Ok(Self { crossings, points, flat, plane, step })
    }

    /// Returns the crossings of the places from one to another.
    pub(super) fn between(&self, from: usize, to: usize) -> impl Iterator<Item = &'a Crossing> {
        let n = self.crossings.len();
        let count = (to + n - from) % n;
        (0..count).flat_map(move |i| self.crossings[(from + i) % n].iter().copied())
    }

    /// Lifts a corner from the plane to about the height of the loop next to it.
    pub(super) fn lift(&self, corner: &Corner) -> Vec3 {
        self.points[corner.at] + self.plane.lift_direction(corner.point - self.flat[corner.at])
    }
}

/// Returns the spacing of the samples on the plate: the side of the square that a sample stands for, metres.
fn spacing(patch: &Patch) -> f64 {
    let widths = patch.crossings.iter().filter(|c| c.beyond != Beyond::SideFace);
    median(widths.map(|c| (c.outside - c.inside).norm()).collect()).unwrap_or_else(|| {
        let ranges = patch.samples.iter().map(|s| s.point.norm()).sum::<f64>();
        ranges / patch.samples.len().max(1) as f64 * (patch.azimuth_step * patch.elevation_step).sqrt()
    })
}
