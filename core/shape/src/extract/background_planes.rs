//! Background planes (table, floor, walls) beside a component, by sequential RANSAC (Fischler and Bolles 1981).
//!
//! In: the measured cells off the component, classified by `mixed_pixels`. Out: up to [`PLANES`] planes, the cells on
//! them, and corrected classes: cells on a narrow strip of background become sound.
//!
//! **Problem.** A strip of background may be visible over one or two cells beyond an edge, such as a table or the foot
//! of a wall. Its cells have neighbours of another range on both sides, as a mixed pixel has, and are therefore
//! classified as mixed. The plane of the strip distinguishes the two, if more of it is visible elsewhere beside the
//! component.
//!
//! **Method.**
//!
//! - A plane n . x = 1 has the inverse range n . d along the unit direction d. This is linear in n, so that a plane is
//!   fitted by linear least squares at any incidence. A plane through three cells is refined by fits to the cells near
//!   it (locally optimised RANSAC: Chum, Matas and Kittler 2003).
//! - A cell on a plane is not a mixed pixel, whatever the ranges of its neighbours. There are two exceptions. About one
//!   mixed pixel in a hundred has the range of a plane by chance (more before a plane whose continuation is close
//!   behind the edge): a mixed pixel stays mixed if it is alone on a plane that holds few of them. It also stays mixed
//!   if there are mixed pixels in front of the plane on both sides of this cell: along an edge parallel to a row some
//!   beams return the range of the background.
//! - A mixed pixel behind the plane of a strip next to it sees the far edge of the strip, not that of the plate. It
//!   becomes sound.
//! - A plane that is seen edge-on is discarded: the cells of one row of a round wall also lie in a plane, through the
//!   scanner.
//!
//! **Strips visible nowhere else.** The plane of such a strip is searched among the mixed pixels. Along a dithered edge
//! (one that crosses many lattice lines) the mixing changes from line to line: mixed pixels of the edge lie on no
//! common plane, cells filled by a strip do.
//!
//! **Strips narrower than a beam.** No cell lies on them. For each end of the face the planes are listed that may lie
//! between the face and its background; whether a strip of them is visible there is decided per edge
//! (`outline/background_strip`).
//!
//! Limits: a strip that is visible nowhere else stays mixed along an edge that hardly crosses the lattice, since mixed
//! pixels of such an edge can also lie on a plane. Uneven ground is represented by several planes. Own.

use nalgebra::{Cholesky, Const, Matrix3};
use platen_numerics::random::Random;

use super::mixed_pixels::{Pixel, STEEPEST};
use super::patch::{PlaneBehind, PlaneSet};
use super::range_noise::Noise;
use super::window::Window;
use crate::Vec3;

/// Largest number of cells from which a plane is determined, and least number of them on it.
const ENOUGH: usize = 1024;
const LEAST_CELLS: usize = 24;

/// Largest number of planes, and number of triples of cells tried for each.
pub(crate) const PLANES: usize = 6;
const TRIALS: usize = 300;

/// Number of cells before and behind the first cell of a triple among which the second and third are drawn.
const NEAR: usize = 32;

/// Largest departure of a cell from a plane, in standard deviations, and largest variance of the plane there, in units
/// of that of a cell.
const BOUND: f64 = 5.0;
const MOST_LEVERAGE: f64 = 9.0;

/// Largest scatter of the cells on a flat plane, in units of the standard deviation of a cell.
const MOST_SCATTER: f64 = 1.5;

/// Cosine of the incidence up to which a plane is taken as seen edge-on: a row of a round wall also lies in a plane,
/// through the scanner.
const EDGE_ON: f64 = 0.1;

/// Largest number of cells from a mixed pixel to the strip whose far edge it sees: `NEAREST` in any direction, `FAR` to
/// both sides along its row or its column.
const NEAREST: usize = 2;
const FAR: usize = 12;

/// A plane of a strip holds at least one in this many mixed pixels; of the planes beside 40 plates without a strip 3 %
/// do.
const FEW: usize = 20;

/// The plane of a strip that is visible nowhere else holds at least one in this many mixed pixels.
const MANY: usize = 8;

/// Number of columns and of rows of the lattice that an edge must cross to be dithered, that is, to lie at random
/// between them.
pub(crate) const DITHERED: u32 = 6;

/// Planes of the background and the cells on them.
#[derive(Debug, Clone)]
pub(super) struct Background {
    planes: Vec<BackgroundPlane>,
    numbers: Vec<Option<u8>>,
}

impl Background {
    /// Returns the plane on which a cell lies; `next` is the cell behind it along its row or column.
    pub(super) fn at(&self, index: usize, next: Option<usize>) -> Option<PlaneBehind> {
        let number = self.numbers[index]?;
        let vector = self.planes[usize::from(number)].vector;
        let narrow = next.is_none_or(|next| self.numbers[next] != Some(number));
        Some(PlaneBehind { number, distance: (1.0 / vector.norm()) as f32, narrow })
    }

    /// Returns the range of a plane along the beam of a cell, metres. `None` where the beam does not meet it.
    pub(super) fn range(&self, plane: &PlaneBehind, cell: &BackgroundCell) -> Option<f64> {
        let inverse = self.planes[usize::from(plane.number)].vector.dot(&cell.direction);
        (inverse > 0.0).then(|| 1.0 / inverse)
    }

    /// Returns the numbers of the flat planes that, if they extend so far, are in front of the background cell `behind`
    /// and behind `place`, a place on the beam of another cell.
    pub(super) fn between(&self, place: BackgroundCell, behind: BackgroundCell) -> impl Iterator<Item = u8> {
        let is_between = move |plane: &BackgroundPlane| {
            plane.scatter < MOST_SCATTER && plane.depth(&place) < -BOUND && plane.depth(&behind) > BOUND
        };
        (0..).zip(&self.planes).filter(move |(_, plane)| is_between(plane)).map(|(number, _)| number)
    }

    /// Returns true when a cell is behind one of these planes.
    pub(super) fn is_behind(&self, planes: PlaneSet, cell: &BackgroundCell) -> bool {
        planes.numbers().any(|number| self.planes[usize::from(number)].depth(cell) > BOUND)
    }
}

/// Marks as sound the mixed pixels that lie on a plane beside the component, and those at the far edge of a strip of
/// such a plane. Returns the planes and the cells on them.
pub(super) fn mark_sound(window: &Window, noise: &Noise, pixels: &mut [Pixel]) -> Background {
    let off = off_component(window, pixels);
    let cell = |index: usize| BackgroundCell::of(window, noise, index);
    let of = |class: Pixel| -> Vec<BackgroundCell> {
        off.iter().filter(|index| pixels[**index] == class).map(|index| cell(*index)).collect()
    };
    let planes = find(of(Pixel::Sound), &of(Pixel::Mixed));
    let mut on: Vec<Option<u8>> = vec![None; pixels.len()];
    let depth = |plane: u8, cell: &BackgroundCell| planes[usize::from(plane)].depth(cell);
    for index in &off {
        on[*index] =
            (0..).zip(&planes).find(|(_, plane)| plane.holds(&cell(*index))).map(|(number, _)| number);
    }
    for index in by_chance(window, pixels, &off, &on) {
        on[index] = None;
    }
    let is_strip = |index: &usize| {
        let mixed = |at: usize| (pixels[at] == Pixel::Mixed).then(|| cell(at));
        mixed(*index).is_some_and(|cell| match on[*index] {
            // Between mixed pixels of the edge a cell has the range of the plane by chance.
            Some(plane) => {
                let is_before = |at: usize| mixed(at).is_some_and(|other| depth(plane, &other) < -BOUND);
                !lies_between(window, *index, [NEAREST, 0], is_before)
            }
            None => {
                let is_before = |at: usize| on[at].is_some_and(|plane| depth(plane, &cell) > BOUND);
                any_within(window, *index, [NEAREST; 2], [NEAREST; 2], is_before)
                    || lies_between(window, *index, [FAR, NEAREST], is_before)
            }
        })
    };
    let strip: Vec<usize> = off.iter().copied().filter(is_strip).collect();
    strip.into_iter().for_each(|index| pixels[index] = Pixel::Sound);
    Background { planes, numbers: on }
}

/// Returns the mixed pixels that are alone on a plane that holds few of them.
fn by_chance(window: &Window, pixels: &[Pixel], off: &[usize], on: &[Option<u8>]) -> Vec<usize> {
    let mixed: Vec<usize> = off.iter().copied().filter(|index| pixels[*index] == Pixel::Mixed).collect();
    let mut held = [0; PLANES];
    mixed.iter().filter_map(|index| on[*index]).for_each(|plane| held[usize::from(plane)] += 1);
    let is_few = |plane: u8| FEW * held[usize::from(plane)] < mixed.len();
    let is_alone = |index: usize| {
        !any_within(window, index, [1; 2], [1; 2], |other| other != index && on[other] == on[index])
    };
    mixed.iter().copied().filter(|index| on[*index].is_some_and(is_few) && is_alone(*index)).collect()
}

/// Returns the classified cells that belong neither to the component nor to a possible continuation of it.
fn off_component(window: &Window, pixels: &[Pixel]) -> Vec<usize> {
    let header = &window.header;
    let strides = [(1, header.elevation_step), (window.n_rows, header.azimuth_step)];
    let continues = |index: usize| {
        let range = window.cells[index].range_m;
        strides.iter().any(|(stride, step)| {
            (1..=NEAREST).any(|far| {
                let bound = STEEPEST * range * (far as f64 * step) as f32;
                let is_own = |at: usize| window.own[at] && (window.cells[at].range_m - range).abs() <= bound;
                let far = far * stride;
                index.checked_sub(far).is_some_and(is_own)
                    || (index + far < pixels.len() && is_own(index + far))
            })
        })
    };
    let is_off = |index: &usize| pixels[*index] != Pixel::Unknown && !window.own[*index];
    (0..pixels.len())
        .filter(|index| is_off(index) && !(pixels[*index] == Pixel::Sound && continues(*index)))
        .collect()
}

/// Returns true when a condition holds somewhere on both sides of a cell, along its row or its column, in arms of the
/// given length and half width.
fn lies_between(
    window: &Window,
    index: usize,
    [length, half]: [usize; 2],
    is: impl Fn(usize) -> bool,
) -> bool {
    let any = |columns, rows| any_within(window, index, columns, rows, &is);
    (any([length, 0], [half; 2]) && any([0, length], [half; 2]))
        || (any([half; 2], [length, 0]) && any([half; 2], [0, length]))
}

/// Returns true when a condition holds for a cell of a box, given by the numbers of columns and rows before and behind
/// a cell.
fn any_within(
    window: &Window,
    index: usize,
    [left, right]: [usize; 2],
    [up, down]: [usize; 2],
    is: impl Fn(usize) -> bool,
) -> bool {
    let (column, row) = (index / window.n_rows, index % window.n_rows);
    let columns = column.saturating_sub(left)..(column + right + 1).min(window.n_columns);
    let rows = row.saturating_sub(up)..(row + down + 1).min(window.n_rows);
    columns.flat_map(|column| rows.clone().map(move |row| column * window.n_rows + row)).any(is)
}

/// A measured cell off the component, as an observation of a plane.
#[derive(Debug, Clone, Copy)]
pub(super) struct BackgroundCell {
    /// Column and row.
    place: [u32; 2],
    direction: Vec3,
    /// Inverse range, 1/m, and its standard deviation.
    inverse: f64,
    sigma: f64,
}

impl BackgroundCell {
    pub(super) fn of(window: &Window, noise: &Noise, index: usize) -> Self {
        let inverse = f64::from(window.inverse[index]);
        let sigma = f64::from(noise.at(index)) * inverse * inverse;
        let place = [index / window.n_rows, index % window.n_rows].map(|number| number as u32);
        Self { place, direction: Vec3::from(window.points[index]) * inverse, inverse, sigma }
    }

    /// Returns the cell with another range, metres.
    pub(super) fn with_range(self, range: f64) -> Self {
        Self { inverse: 1.0 / range, ..self }
    }

    /// Returns true when the cell lies on the plane of this vector.
    fn is_on(&self, plane: &Vec3) -> bool {
        (self.inverse - plane.dot(&self.direction)).abs() <= BOUND * self.sigma
    }
}

/// A plane n . x = 1 and its uncertainty.
#[derive(Debug, Clone)]
struct BackgroundPlane {
    vector: Vec3,
    information: Cholesky<f64, Const<3>>,
    /// Scatter of the cells about the plane, in units of the standard deviation of a cell, at least 1.
    scatter: f64,
}

impl BackgroundPlane {
    /// Fits a plane to those cells for which `belongs` is true by least squares; `None` where they lie on a line.
    fn fit<'a>(
        cells: impl IntoIterator<Item = &'a BackgroundCell>,
        belongs: impl Fn(&BackgroundCell) -> bool,
    ) -> Option<Self> {
        let cells: Vec<&BackgroundCell> = cells.into_iter().filter(|cell| belongs(cell)).collect();
        let (mut information, mut rhs) = (Matrix3::zeros(), Vec3::zeros());
        for cell in &cells {
            let row = cell.direction / cell.sigma;
            information += row * row.transpose();
            rhs += row * (cell.inverse / cell.sigma);
        }
        let information = information.cholesky()?;
        let vector = information.solve(&rhs);
        let off =
            |cell: &&BackgroundCell| ((cell.inverse - vector.dot(&cell.direction)) / cell.sigma).powi(2);
        let square: f64 = cells.iter().map(off).sum();
        let scatter = (square / cells.len() as f64).sqrt().max(1.0);
        Some(Self { vector, information, scatter })
    }

    /// Fits a plane to the cells on it, starting from a plane near it. The cells on a plane through three of them are a
    /// biased choice, which tilts a first fit in their favour; hence a second fit.
    fn fit_near(cells: &[BackgroundCell], plane: Vec3) -> Option<Self> {
        let first = Self::fit(cells, |cell| cell.is_on(&plane))?;
        Self::fit(cells, |cell| cell.is_on(&first.vector))
    }

    /// Returns true when a cell is on the plane and the plane is known well enough there.
    fn holds(&self, cell: &BackgroundCell) -> bool {
        self.leverage(cell) <= MOST_LEVERAGE && self.depth(cell).abs() <= BOUND
    }

    /// Returns the variance of the plane at a cell, in units of that of the cell.
    fn leverage(&self, cell: &BackgroundCell) -> f64 {
        let row = cell.direction / cell.sigma;
        row.dot(&self.information.solve(&row)) * self.scatter * self.scatter
    }

    /// Returns the cosine of the incidence on the plane at a cell on it.
    fn cosine(&self, cell: &BackgroundCell) -> f64 {
        cell.inverse / self.vector.norm()
    }

    /// Returns true when a cell shows that the plane is not seen edge-on.
    fn is_seen(&self, cells: &[BackgroundCell]) -> bool {
        cells.iter().any(|cell| self.holds(cell) && self.cosine(cell) > EDGE_ON)
    }

    /// Returns the distance of a cell behind the plane, in standard deviations of both.
    fn depth(&self, cell: &BackgroundCell) -> f64 {
        let sigma = cell.sigma * (self.scatter * self.scatter + self.leverage(cell)).sqrt();
        (self.vector.dot(&cell.direction) - cell.inverse) / sigma
    }
}

/// Finds the planes of the sound cells, the one with most cells first, then those of strips among the mixed pixels.
fn find(mut sound: Vec<BackgroundCell>, mixed: &[BackgroundCell]) -> Vec<BackgroundPlane> {
    let mut random = Random::new(1);
    let mut planes = Vec::new();
    let every = sound.len().div_ceil(ENOUGH).max(1);
    while planes.len() < PLANES {
        let few: Vec<BackgroundCell> = sound.iter().step_by(every).copied().collect();
        let first = most_common(&few, &mut random).and_then(|plane| BackgroundPlane::fit_near(&sound, plane));
        // The strips that the plane predicts determine it more accurately there.
        let Some(plane) =
            first.and_then(|plane| BackgroundPlane::fit(sound.iter().chain(mixed), |cell| plane.holds(cell)))
        else {
            break;
        };
        let is_seen = plane.is_seen(&sound);
        sound.retain(|cell| !plane.holds(cell));
        if is_seen {
            planes.push(plane);
        }
    }
    while planes.len() < PLANES
        && let Some(plane) = find_among_mixed(mixed, &planes, &mut random)
    {
        planes.push(plane);
    }
    planes
}

/// Finds the plane of a strip that is visible nowhere else: one on which many mixed pixels lie that are on no other
/// plane.
fn find_among_mixed(
    mixed: &[BackgroundCell],
    planes: &[BackgroundPlane],
    random: &mut Random,
) -> Option<BackgroundPlane> {
    let is_new = |cell: &&BackgroundCell| !planes.iter().any(|plane| plane.holds(cell));
    let rest: Vec<BackgroundCell> = mixed.iter().filter(is_new).copied().collect();
    let common = most_common(&rest, random)?;
    let plane = BackgroundPlane::fit(&rest, |cell| cell.is_on(&common))?;
    let on: Vec<&BackgroundCell> = rest.iter().filter(|cell| plane.holds(cell)).collect();
    let is_crossed = |axis: usize| {
        let places = || on.iter().map(|cell| cell.place[axis]);
        places().max().zip(places().min()).is_some_and(|(last, first)| last - first >= DITHERED)
    };
    let are_many = MANY * on.len() >= mixed.len() && is_crossed(0) && is_crossed(1);
    (are_many && plane.scatter < MOST_SCATTER && plane.is_seen(&rest)).then_some(plane)
}

/// Returns the plane through three cells that holds the most cells (RANSAC).
fn most_common(cells: &[BackgroundCell], random: &mut Random) -> Option<Vec3> {
    if cells.len() < LEAST_CELLS {
        return None;
    }
    let (mut most, mut best) = (LEAST_CELLS - 1, None);
    for _ in 0..TRIALS {
        let first = random.below(cells.len());
        let mut near = || &cells[(first + random.below(2 * NEAR)).saturating_sub(NEAR).min(cells.len() - 1)];
        let (a, b, c) = (&cells[first], near(), near());
        let directions = Matrix3::from_columns(&[a.direction, b.direction, c.direction]).transpose();
        let Some(inverse) = directions.try_inverse() else { continue };
        let plane = inverse * Vec3::new(a.inverse, b.inverse, c.inverse);
        let count = cells.iter().filter(|cell| cell.is_on(&plane)).count();
        if count > most {
            (most, best) = (count, Some(plane));
        }
    }
    best
}

#[cfg(test)]
mod tests;
