//! Where rows and columns of the lattice leave the face.

use std::collections::BTreeMap;

use super::local::LocalFace;
use super::noise::Noise;
use super::window::Window;
use crate::patch::{Beyond, Crossing};

/// How far along a row or a column the first sound cell beyond the face is looked for, cells. A row that runs along an
/// edge meets many mixed pixels before it is off the plate.
const FAR: usize = 48;

/// Continuing the local fit further than this would say nothing.
const FIT_FAR: usize = 3;

/// A range in front of the face's continuation by this many standard deviations belongs to something that hides it.
const FRONT_BOUND: f64 = 4.0;

/// All crossings of the cells of `face`, by cell, in the order up, down, back, next. `number` gives the place of a cell
/// of the face among the samples. Also the length over which the region of interest cuts the face, metres.
pub(super) fn find(
    window: &Window,
    noise: &Noise,
    face: &[bool],
    mixed: &[bool],
    number: impl Fn(usize) -> u32,
) -> (Vec<Crossing>, f64) {
    let mut fits: BTreeMap<(usize, usize), Option<LocalFace>> = BTreeMap::new();
    let mut crossings = Vec::new();
    let mut cut = 0.0;
    let scene = Scene { window, noise, face, mixed };
    for index in (0..face.len()).filter(|&i| face[i]) {
        for step in [(0, -1), (0, 1), (-1, 0), (1, 0)] {
            let Some(first) = scene.beside(index, step, 1) else { continue };
            if face[first] {
                continue;
            }
            let Some(end) = scene.end_of_face(index, step) else { continue };
            let tile = LocalFace::tile(window, index);
            let fit = fits.entry(tile).or_insert_with(|| LocalFace::fit(window, face, tile));
            let crossing = fit.as_ref().and_then(|fit| scene.crossing(fit, index, step, end, number(index)));
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

/// What lies beyond the last cell of the face on a row or a column.
#[derive(Debug, Clone, Copy)]
enum End {
    /// The first sound cell, so many steps away.
    Sound(usize),
    /// Nothing came back.
    Nothing,
}

struct Scene<'a> {
    window: &'a Window,
    noise: &'a Noise,
    face: &'a [bool],
    mixed: &'a [bool],
}

impl Scene<'_> {
    fn beside(&self, index: usize, step: (isize, isize), far: usize) -> Option<usize> {
        let column = (index / self.window.n_rows).checked_add_signed(step.0 * far as isize)?;
        let row = (index % self.window.n_rows).checked_add_signed(step.1 * far as isize)?;
        (column < self.window.n_columns && row < self.window.n_rows)
            .then_some(column * self.window.n_rows + row)
    }

    /// `None` where the face goes on behind a gap of cells without return or of mixed ones.
    fn end_of_face(&self, index: usize, step: (isize, isize)) -> Option<End> {
        for far in 1..=FAR {
            let Some(at) = self.beside(index, step, far) else { return Some(End::Nothing) };
            if self.face[at] {
                return None;
            }
            if self.window.cells[at].valid && !self.mixed[at] {
                return Some(End::Sound(far));
            }
        }
        Some(End::Nothing)
    }

    /// The crossing, and whether the face goes on beyond the region of interest.
    fn crossing(
        &self,
        fit: &LocalFace,
        index: usize,
        step: (isize, isize),
        end: End,
        sample: u32,
    ) -> Option<(Crossing, bool)> {
        let (x, y) = self.window.place(index);
        let on_face = |t: f64| fit.at(self.window, x + t * step.0 as f64, y + t * step.1 as f64);
        let mut cut = false;
        let (beyond, from, to) = match end {
            End::Nothing => (Beyond::Nothing, 0.0, 1.0),
            End::Sound(far) => {
                let first = self.beside(index, step, far)?;
                let excess = self.excess(fit, first, far.min(FIT_FAR), index, step)?;
                let sigma = f64::from(self.noise.at(index));
                cut = !self.window.cells[first].inside && excess.abs() <= FRONT_BOUND * sigma;
                if excess < -FRONT_BOUND * sigma {
                    (Beyond::InFront, 0.0, far as f64)
                } else if let Some((from, to)) = self.crease(fit, index, step, far) {
                    (Beyond::SideFace, from, to)
                } else {
                    (Beyond::Behind, 0.0, far as f64)
                }
            }
        };
        let (inside, outside) = (on_face(from)?, on_face(to)?);
        let crossing = Crossing {
            sample,
            step: [step.0 as i8, step.1 as i8],
            inside: inside.point,
            outside: outside.point,
            normal: inside.normal,
            beyond,
        };
        Some((crossing, cut))
    }

    /// Range of the cell `at` behind the face's continuation `far` steps from `index`.
    fn excess(
        &self,
        fit: &LocalFace,
        at: usize,
        far: usize,
        index: usize,
        step: (isize, isize),
    ) -> Option<f64> {
        let (x, y) = self.window.place(index);
        let far = far as f64;
        let predicted = fit.at(self.window, x + far * step.0 as f64, y + far * step.1 as f64)?;
        Some(f64::from(self.window.cells[at].range_m) - predicted.range)
    }

    /// Where the face meets a side face: its ranges fall behind the face's continuation in proportion to the way
    /// from the common edge. Needs three sound cells in a row that do so.
    fn crease(&self, fit: &LocalFace, index: usize, step: (isize, isize), far: usize) -> Option<(f64, f64)> {
        if far != 1 {
            return None;
        }
        let mut excess = [0.0; 3];
        for (k, value) in excess.iter_mut().enumerate() {
            let at = self.beside(index, step, k + 1)?;
            if !self.window.cells[at].valid || self.mixed[at] || self.face[at] {
                return None;
            }
            *value = self.excess(fit, at, k + 1, index, step)?;
        }
        let sigma = f64::from(self.noise.at(index));
        let slope = 0.5 * (excess[2] - excess[0]);
        let bend = excess[0] - 2.0 * excess[1] + excess[2];
        let start = 1.0 - excess[0] / slope;
        let straight = bend.abs() <= 4.0 * 6.0_f64.sqrt() * sigma + 0.1 * slope;
        if slope < 3.0 * sigma || !straight || !(-1.0..=1.2).contains(&start) {
            return None;
        }
        let half_width = 2.0 * sigma / slope;
        Some((start - half_width, start + half_width))
    }
}
