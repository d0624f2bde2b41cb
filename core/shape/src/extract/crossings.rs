//! Boundary crossings: the places where rows and columns of the lattice leave the face, and the objects beyond.
//!
//! In: the cells of the face, the mixed pixels, the noise. Out, per crossing: the last point inside and the first point
//! outside, the mixed pixels between them, and the range beyond relative to the face's continuation (`local_quadric`).
//! The crossings are the observations for the outline.
//!
//! A cell beside the face may see so little of the background that it is classified neither as a mixed pixel (by its
//! neighbours) nor as a cell of the face (by its range). The face does not end at such a cell: the edge is up to a
//! footprint farther out.

use std::collections::BTreeMap;

use super::background_planes::{Background, BackgroundCell};
use super::local_quadric::LocalQuadric;
use super::mixed_pixels::{DETECTION_LIMIT, Pixel};
use super::patch::{Beyond, Crossing, MixedPixels, PlaneSet};
use super::range_noise::Noise;
use super::window::Window;
use crate::Vec3;

/// Widest gap along a row or a column behind which the face may continue, cells.
const WIDEST_GAP: usize = 48;

/// Number of cells beyond the face at which the local fit is evaluated. A row that runs along an edge meets many mixed
/// pixels before it leaves the plate; the first of them suffice.
const FAR: usize = 12;

/// Largest distance from the face at which a range is compared with the face's continuation, cells.
const FIT_FAR: usize = 3;

/// A beam whose range is behind the face's continuation by less than this, metres, and by less than the detection limit
/// of a mixed pixel sees little of the background. It is not an end of the face, although its neighbours do not
/// indicate a mixed pixel.
const MOST_HARDLY_MIXED: f64 = 0.015;

/// A range in front of the face's continuation by more than this many standard deviations belongs to an object that
/// hides the face.
const FRONT_BOUND: f64 = 4.0;

/// Returns all crossings of the face's cells, by cell, in the order up, down, previous column, next column, and the
/// length over which the region of interest cuts the face, metres. `number` gives the index of a cell of the face among
/// the samples.
pub(super) fn find(scene: &Scene, number: impl Fn(usize) -> u32) -> (Vec<Crossing>, f64) {
    let Scene { window, face, .. } = *scene;
    let mut fits: BTreeMap<(usize, usize), Option<LocalQuadric>> = BTreeMap::new();
    let mut crossings = Vec::new();
    let mut cut = 0.0;
    let inside = |i: usize| face.get(i).is_some_and(|f| *f);
    // Cells whose four neighbours are on the face have no crossing.
    let is_rim = |i: &usize| {
        let i = *i;
        let n_rows = window.n_rows;
        face[i]
            && !(inside(i + 1)
                && inside(i.wrapping_sub(1))
                && inside(i + n_rows)
                && inside(i.wrapping_sub(n_rows)))
    };
    for index in (0..face.len()).filter(is_rim) {
        for step in [(0, -1), (0, 1), (-1, 0), (1, 0)] {
            let Some(first) = scene.beside(index, step, 1) else { continue };
            if face[first] {
                continue;
            }
            let tile = LocalQuadric::tile(window, index);
            let fit = fits.entry(tile).or_insert_with(|| LocalQuadric::fit(window, scene.noise, face, tile));
            let crossing = fit.as_ref().and_then(|fit| {
                let end = scene.end_of_face(fit, index, step)?;
                scene.crossing(fit, index, step, end, number(index))
            });
            match crossing {
                Some((crossing, false)) => crossings.push(crossing),
                // An edge crosses rows and columns: each crossing stands for half a step.
                Some((crossing, true)) => cut += 0.5 * (crossing.outside - crossing.inside).norm(),
                None => {}
            }
        }
    }
    (crossings, cut)
}

/// End of the face on a row or a column.
#[derive(Debug, Clone, Copy)]
enum End {
    /// The first sound cell, this many steps away.
    Sound(usize),
    /// Mixed pixels only, the last of them this many steps away.
    Mixed(usize),
    /// No return.
    Nothing,
}

/// A mixed pixel beside the face.
struct MixedCell {
    cell: BackgroundCell,
    /// Point where its beam meets the continuation of the face.
    on_face: Vec3,
    /// Its range minus that of the continuation, metres.
    excess: f32,
    /// Range of the background's plane along its beam minus that of the continuation, metres.
    jump: Option<f32>,
}

impl MixedCell {
    /// Returns the place on the face's continuation as a cell.
    fn face(&self) -> BackgroundCell {
        self.cell.with_range(self.on_face.norm())
    }

    /// Joins the mixed pixels of a row or a column, the nearest to the face first.
    fn joined<'a>(mut pixels: impl DoubleEndedIterator<Item = &'a Self>) -> Option<MixedPixels> {
        let near = pixels.next()?;
        let far = pixels.next_back().unwrap_or(near);
        Some(MixedPixels { ends: [near.on_face, far.on_face], excess: near.excess, jump: near.jump })
    }
}

/// A face and the cells beside it.
pub(super) struct Scene<'a> {
    pub(super) window: &'a Window,
    pub(super) noise: &'a Noise,
    pub(super) background_noise: &'a Noise,
    pub(super) face: &'a [bool],
    pub(super) pixels: &'a [Pixel],
    pub(super) background: &'a Background,
    /// Depth of the upper flank of a bevelled edge, metres.
    pub(super) flank_depth: Option<f64>,
}

impl Scene<'_> {
    fn beside(&self, index: usize, step: (isize, isize), far: usize) -> Option<usize> {
        let column = (index / self.window.n_rows).checked_add_signed(step.0 * far as isize)?;
        let row = (index % self.window.n_rows).checked_add_signed(step.1 * far as isize)?;
        (column < self.window.n_columns && row < self.window.n_rows)
            .then_some(column * self.window.n_rows + row)
    }

    /// Returns the end of the face. `None` where the face continues behind a gap of cells that are mixed, unclassified
    /// or without return, or where only cells follow that are hardly behind the face.
    fn end_of_face(&self, fit: &LocalQuadric, index: usize, step: (isize, isize)) -> Option<End> {
        let sigma = f64::from(self.noise.at(index));
        let hardly = -FRONT_BOUND * sigma..(DETECTION_LIMIT * sigma).min(MOST_HARDLY_MIXED);
        let is_hardly_mixed = |at: usize, far: usize| {
            self.window.cells[at].inside
                && self.excess(fit, at, far, index, step).is_some_and(|excess| hardly.contains(&excess))
                && self.crease(fit, index, step, far).is_none()
        };
        let (mut last_mixed, mut hardly_mixed) = (None, false);
        for far in 1..=WIDEST_GAP {
            let Some(at) = self.beside(index, step, far) else { break };
            if self.face[at] {
                return None;
            }
            match self.pixels[at] {
                Pixel::Sound if far <= FAR && is_hardly_mixed(at, far) => hardly_mixed = true,
                Pixel::Sound if far <= FAR => return Some(End::Sound(far)),
                Pixel::Mixed if far <= FAR => last_mixed = Some(far),
                _ => {}
            }
        }
        (last_mixed.is_some() || !hardly_mixed).then(|| last_mixed.map_or(End::Nothing, End::Mixed))
    }

    /// Measures a crossing. Also returns whether the face continues beyond the region of interest.
    fn crossing(
        &self,
        fit: &LocalQuadric,
        index: usize,
        step: (isize, isize),
        end: End,
        sample: u32,
    ) -> Option<(Crossing, bool)> {
        let (x, y) = self.window.place_of(index);
        let on_face = |t: f64| fit.at(self.window, x + t * step.0 as f64, y + t * step.1 as f64);
        let (far, measured) = match end {
            End::Sound(far) | End::Mixed(far) => (far, self.beside(index, step, far)),
            End::Nothing => (1, None),
        };
        let (mut beyond, mut from, mut to) = (Beyond::Nothing, 0.0, far as f64);
        let (mut cut, mut excess) = (false, 0.0);
        if let Some(first) = measured {
            excess = self.excess(fit, first, far.min(FIT_FAR), index, step)?;
            let bound = FRONT_BOUND * f64::from(self.noise.at(index));
            cut = !self.window.cells[first].inside && excess.abs() <= bound;
            beyond = if excess < -bound { Beyond::InFront } else { Beyond::Behind };
            if let Some(crease) = self.crease(fit, index, step, far).filter(|_| beyond == Beyond::Behind) {
                (from, to) = crease;
                beyond = Beyond::SideFace;
            }
        }
        let cells = (1..=far).filter_map(|k| self.beside(index, step, k).map(|at| (k, at)));
        let cell = |at| BackgroundCell::of(self.window, self.noise, at);
        let background = measured.and_then(|at| self.background.at(at, self.beside(index, step, far + 1)));
        let mixed_cell = |(far, at): (usize, usize)| {
            let excess = self.excess(fit, at, far.min(FIT_FAR), index, step)?;
            let cell = cell(at);
            let range = background.and_then(|plane| self.background.range(&plane, &cell));
            let jump = range.map(|range| (excess + range - f64::from(self.window.cells[at].range_m)) as f32);
            Some(MixedCell { cell, on_face: on_face(far as f64)?.point, excess: excess as f32, jump })
        };
        let mixed = cells.clone().filter(|(_, at)| self.pixels[*at] == Pixel::Mixed);
        let mixed = mixed.map(mixed_cell).collect::<Option<Vec<_>>>()?;
        let before = |end| mixed.iter().flat_map(move |pixel| self.background.between(pixel.face(), end));
        let strips: PlaneSet = measured.map(cell).into_iter().flat_map(before).collect();
        let is_sure = |pixel: &&MixedCell| !self.background.is_behind(strips, &pixel.cell);
        let (inside, outside) = (on_face(from)?, on_face(to)?);
        let own = self.noise.at(index);
        let crossing = Crossing {
            sample,
            step: [step.0 as i8, step.1 as i8],
            cells: if beyond == Beyond::SideFace { 0 } else { far as u16 },
            inside: inside.point,
            outside: outside.point,
            normal: inside.normal,
            mixed: MixedCell::joined(mixed.iter()),
            surely_mixed: MixedCell::joined(mixed.iter().filter(is_sure)),
            strips,
            complete: cells.clone().all(|(_, at)| self.pixels[at] != Pixel::Unknown),
            excess: excess as f32,
            noise: [own, measured.map_or(own, |at| self.background_noise.at(at).min(own))],
            background,
            beyond,
        };
        Some((crossing, cut))
    }

    /// Returns the range of the cell `at` minus that of the face's continuation `far` steps from `index`, metres.
    fn excess(
        &self,
        fit: &LocalQuadric,
        at: usize,
        far: usize,
        index: usize,
        step: (isize, isize),
    ) -> Option<f64> {
        let (x, y) = self.window.place_of(index);
        let far = far as f64;
        let predicted = fit.at(self.window, x + far * step.0 as f64, y + far * step.1 as f64)?;
        Some(f64::from(self.window.cells[at].range_m) - predicted.range)
    }

    /// Locates the crease between the face and a side face, as an interval in steps from `index`.
    ///
    /// The ranges on a side face are behind the face's continuation in proportion to the distance from the common edge.
    /// Three sound cells in a row must show this; on a bevelled edge they must lie on the upper flank.
    fn crease(
        &self,
        fit: &LocalQuadric,
        index: usize,
        step: (isize, isize),
        far: usize,
    ) -> Option<(f64, f64)> {
        if far != 1 {
            return None;
        }
        let mut excess = [0.0; 3];
        for (k, value) in excess.iter_mut().enumerate() {
            let at = self.beside(index, step, k + 1)?;
            if self.pixels[at] != Pixel::Sound || self.face[at] {
                return None;
            }
            *value = self.excess(fit, at, k + 1, index, step)?;
        }
        let sigma = f64::from(self.noise.at(index));
        let slope = 0.5 * (excess[2] - excess[0]);
        let bend = excess[0] - 2.0 * excess[1] + excess[2];
        let start = 1.0 - excess[0] / slope;
        let straight = bend.abs() <= 4.0 * 6.0_f64.sqrt() * sigma + 0.1 * slope;
        if slope < 3.0 * sigma || !straight || !(-2.5..=1.2).contains(&start) {
            return None;
        }
        if let Some(flank) = self.flank_depth {
            let (x, y) = self.window.place_of(index);
            let edge = fit.at(self.window, x, y)?;
            if -edge.normal.dot(&edge.point.normalize()) * excess[2] > flank + 3.0 * sigma {
                return None;
            }
        }
        let half_width = 2.0 * sigma / slope;
        Some((start - half_width, start + half_width))
    }
}
