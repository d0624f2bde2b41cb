//! Background planes: table, floor and walls beside a component, by sequential RANSAC (Fischler and Bolles 1981) over its sound cells.
//!
//! A strip of background that shows one or two cells wide beyond an edge, a table or the foot of a wall, has cells with neighbours of another range on
//! both sides, as a mixed pixel has. Where its plane shows wider elsewhere beside the component, that tells them:
//!
//! - A plane n . x = 1 has the inverse range n . d along the unit direction d: linear in n, a fit by linear least squares at any incidence.
//! - A cell on a plane is no mixed pixel, though its neighbours be others; a mixed pixel meets the range of a plane by chance in one of a hundred, more often
//!   before a plane whose continuation is close behind the edge. A plane of a strip holds many of them; alone on one that holds few, it is there by chance.
//!   One with mixed pixels before the plane to both sides stays mixed: along an edge parallel to a row some beams return the background's range.
//! - A mixed pixel behind the plane of a strip next to it sees the far edge of the strip and not that of the plate.
//! - A plane seen edge-on is none: the cells of one row of a round wall lie in a plane through the scanner, too.
//!
//! A strip whose plane shows wider nowhere has a plane of its own: along an edge that crosses the lattice (a dithered one) the mixing changes from line to line, so that its mixed pixels
//! lie on no common plane, while those that a strip fills do.
//!
//! A strip narrower than a beam has no cell of its own. For each end of the face the planes are given that may be in front of what lies behind it; whether a strip of them
//! shows there is told by the edge (`outline/background_strip`).
//!
//! Limits: a strip whose plane shows nowhere else stays mixed along an edge that hardly crosses the lattice, whose mixed pixels can lie on a plane, too; uneven
//! ground is several planes. Own.

use nalgebra::{Cholesky, Const, Matrix3};
use platen_numerics::random::Random;

use super::mixed_pixels::{Pixel, STEEPEST};
use super::patch::{PlaneBehind, PlaneSet};
use super::range_noise::Noise;
use super::window::Window;
use crate::Vec3;

/// Cells from which a plane is taken, at most, and fewest of them on it.
const ENOUGH: usize = 1024;
const LEAST_CELLS: usize = 24;

/// Planes at most, and triples that are tried for each.
pub(crate) const PLANES: usize = 6;
const TRIALS: usize = 300;

/// The second and third cell of a triple are among so many before and behind the first.
const NEAR: usize = 32;

/// Largest departure from a plane, in standard deviations, and largest variance of a plane there, in that of a cell.
const BOUND: f64 = 5.0;
const MOST_LEVERAGE: f64 = 9.0;

/// Largest scatter of the cells on a plane that is flat, in the standard deviation of a cell.
const MOST_SCATTER: f64 = 1.5;

/// Largest cosine of the incidence of a plane that no scanner sees: a row of a round wall lies in a plane through the scanner, too.
const EDGE_ON: f64 = 0.1;

/// Cells from a mixed pixel to the strip at whose far edge it is: in any direction, and to both sides along its row or its column.
const NEAREST: usize = 2;
const FAR: usize = 12;

/// A plane of a strip holds one of so many mixed pixels at least; of the planes beside 40 plates without a strip 3 % do.
const FEW: usize = 20;

/// The plane of a strip that shows nowhere else holds one of so many mixed pixels at least.
const MANY: usize = 8;

/// Columns and rows of the lattice that an edge must cross to be dithered, that is, to lie at random between them.
pub(crate) const DITHERED: u32 = 6;

/// Planes of the background and the cells on them.
#[derive(Debug, Clone)]
pub(super) struct Background {
    planes: Vec<BackgroundPlane>,
    numbers: Vec<Option<u8>>,
}

impl Background {
    /// Returns the plane that holds a cell.
    pub(super) fn at(&self, index: usize) -> Option<PlaneBehind> {
        let number = self.numbers[index]?;
        let vector = self.planes[usize::from(number)].vector;
        Some(PlaneBehind { number, distance: (1.0 / vector.norm()) as f32 })
    }

    /// Returns the numbers of the flat planes that, if they reach so far, are in front of a cell of the background and behind a place on the beam of another.
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

/// Marks the mixed pixels that lie on a plane beside the component, and those at the far edge of a strip of it, as sound. Returns the planes and the cells on them.
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
            // Amid mixed pixels of the edge a cell only happens to have the range of the plane.
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

/// Returns the mixed pixels that are alone on a plane which holds few of them.
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

/// Returns the classified cells off the component and off what may be its continuation.
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

/// Returns true when a condition holds somewhere to both sides of a cell, along its row or its column, in arms of a length and half a width.
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

/// Returns true when a condition holds for a cell of a box, given by its columns and rows before and behind a cell.
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

    /// Returns true when the plane of this vector holds the cell.
    fn is_on(&self, plane: &Vec3) -> bool {
        (self.inverse - plane.dot(&self.direction)).abs() <= BOUND * self.sigma
    }
}

/// A plane n . x = 1 and its uncertainty.
#[derive(Debug, Clone)]
struct BackgroundPlane {
    vector: Vec3,
    information: Cholesky<f64, Const<3>>,
    /// Scatter about it in the standard deviation of a cell, at least 1.
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

    /// Returns true when a cell is on the plane and the plane is known well enough there.
    fn holds(&self, cell: &BackgroundCell) -> bool {
        self.leverage(cell) <= MOST_LEVERAGE && self.depth(cell).abs() <= BOUND
    }

    /// Returns the variance of the plane at a cell, in that of the cell.
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

    /// Returns how far a cell is behind the plane, in standard deviations of both.
    fn depth(&self, cell: &BackgroundCell) -> f64 {
        let sigma = cell.sigma * (self.scatter * self.scatter + self.leverage(cell)).sqrt();
        (self.vector.dot(&cell.direction) - cell.inverse) / sigma
    }
}

/// Finds the planes of the sound cells, the one with most of them first, then those of strips among the mixed.
fn find(mut sound: Vec<BackgroundCell>, mixed: &[BackgroundCell]) -> Vec<BackgroundPlane> {
    let mut random = Random::new(1);
    let mut planes = Vec::new();
    let every = sound.len().div_ceil(ENOUGH).max(1);
    while planes.len() < PLANES {
        let few: Vec<BackgroundCell> = sound.iter().step_by(every).copied().collect();
        let first = most_common(&few, &mut random)
            .and_then(|plane| BackgroundPlane::fit(&sound, |cell| cell.is_on(&plane)));
        // The strips that it predicts make a plane sharp there.
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

/// Finds the plane of a strip that shows nowhere else: many mixed pixels that are on no plane yet lie on it.
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

/// Returns the plane through three cells that holds most of them; RANSAC.
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
