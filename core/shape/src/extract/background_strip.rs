//! Mixed pixels that are none: cells of a strip of background one or two cells wide, told by the range of the background.
//!
//! A table that shows beside the plate, or the foot of a wall, has cells with neighbours of another range on both sides, as a
//! mixed pixel has. Two planes in inverse range tell them:
//!
//! - Where the background is wide enough its cells are sound; a plane through those nearby predicts it, and a cell that it predicts belongs to
//!   it. A beam that is mixed along an edge parallel to a row passes through all ranges as smoothly, but not through those of the plane.
//! - Where it is nowhere wide, the strip's own cells lie on a plane (RANSAC, Fischler and Bolles 1981) that no incidence makes too steep; mixed
//!   pixels along an edge pass from the plate's range to that behind it within a footprint.
//!
//! Limit: a strip within one row or column stays mixed, as its cells lie on no one plane. Own.

use nalgebra::{Matrix3, Vector3};
use platen_numerics::random::Random;

use super::mixed_pixels::Pixel;
use super::range_noise::Noise;
use super::window::Window;

/// Cells on each side that enter a plane, and fewest of them.
const REACH: usize = 6;
const LEAST_CELLS: usize = 8;

/// Steepest surface, metres of range per metre across the beam: that of an incidence of 76 degrees.
const STEEPEST: f32 = 4.0;

/// The same of a plane through mixed pixels: reach, fewest of them, incidence of 81 degrees; pairs that are tried. The plane holds at least half of
/// the mixed pixels nearby.
const STRIP_REACH: usize = 12;
const STRIP_CELLS: usize = 20;
const STRIP_STEEPEST: f32 = 6.0;
const TRIALS: usize = 32;

/// Largest departure from the plane, in standard deviations, and largest variance of the plane there, in that of a cell.
const BOUND: f64 = 5.0;
const MOST_LEVERAGE: f64 = 1.0;

/// Largest scatter about the plane, in the noise of the plate: what is darker or farther away is noisier.
const MOST_NOISE: f64 = 2.0;

/// Rounds: a strip is followed by so many times the reach.
const ROUNDS: usize = 8;

/// Marks the mixed pixels that continue a surface off the component as sound.
pub(super) fn mark_sound(window: &Window, noise: &Noise, pixels: &mut [Pixel]) {
    let mut planes = Planes { window, noise, near: Vec::new() };
    let mut mixed: Vec<usize> = (0..pixels.len()).filter(|index| pixels[*index] == Pixel::Mixed).collect();
    for &index in &mixed {
        if pixels[index] == Pixel::Mixed && planes.hold_a_strip(pixels, index) {
            pixels[index] = Pixel::Sound;
            planes.near.iter().for_each(|cell| pixels[cell.index] = Pixel::Sound);
        }
    }
    mixed.retain(|index| pixels[*index] == Pixel::Mixed);
    for _ in 0..ROUNDS {
        let (strip, rest): (Vec<usize>, Vec<usize>) =
            mixed.iter().partition(|index| planes.predict(pixels, **index));
        if strip.is_empty() {
            break;
        }
        strip.iter().for_each(|index| pixels[*index] = Pixel::Sound);
        mixed = rest;
    }
}

/// Planes in inverse range through cells near one of a window.
struct Planes<'a> {
    window: &'a Window,
    noise: &'a Noise,
    near: Vec<Beside>,
}

impl Planes<'_> {
    /// Returns true when the plane through the sound cells around a cell, of about its range, predicts it.
    fn predict(&mut self, pixels: &[Pixel], index: usize) -> bool {
        // A sound cell amid a row or a column of mixed ones, at an edge parallel to it, tells too little.
        let is_mixed = |at: usize| pixels[at] == Pixel::Mixed;
        if [1, self.window.n_rows].iter().any(|step| is_mixed(index - step) && is_mixed(index + step)) {
            return false;
        }
        self.collect(pixels, index, (Pixel::Sound, REACH, STEEPEST));
        self.near.len() >= LEAST_CELLS && is_predicted(&self.near, self.sigma(index))
    }

    /// Returns true when a cell lies on a plane with other mixed pixels nearby; leaves those in `near`.
    fn hold_a_strip(&mut self, pixels: &[Pixel], index: usize) -> bool {
        self.collect(pixels, index, (Pixel::Mixed, 1, STRIP_STEEPEST));
        if self.near.is_empty() {
            return false;
        }
        self.collect(pixels, index, (Pixel::Mixed, STRIP_REACH, STRIP_STEEPEST));
        let least = STRIP_CELLS.max(self.near.len() / 2);
        let sigma = self.sigma(index);
        let Some(slope) = self.slope_of_most(index, least) else { return false };
        self.near.retain(|cell| cell.is_on(slope, sigma));
        is_predicted(&self.near, sigma)
    }

    /// Returns the slope of the plane through a cell that holds most of those in `near`, and at least so many: RANSAC, from pairs of them.
    fn slope_of_most(&self, index: usize, least: usize) -> Option<[f64; 2]> {
        let (near, sigma) = (&self.near, self.sigma(index));
        if near.len() < least {
            return None;
        }
        // Inverse range per cell on the steepest surface.
        let (across, down) = (self.window.header.azimuth_step, self.window.header.elevation_step);
        let steepest = f64::from(STRIP_STEEPEST) * f64::from(self.window.inverse[index]);
        let mut random = Random::new(index as u64);
        let mut best: Option<(usize, [f64; 2])> = None;
        for _ in 0..TRIALS {
            let (a, b) = (&near[random.below(near.len())], &near[random.below(near.len())]);
            let area = a.x * b.y - a.y * b.x;
            let slope = [(a.off * b.y - b.off * a.y) / area, (a.x * b.off - b.x * a.off) / area];
            if area == 0.0 || (slope[0] / across).hypot(slope[1] / down) > steepest {
                continue;
            }
            let count = near.iter().filter(|cell| cell.is_on(slope, sigma)).count();
            if best.is_none_or(|(known, _)| count > known) {
                best = Some((count, slope));
            }
        }
        best.filter(|(count, _)| *count >= least).map(|(_, slope)| slope)
    }

    /// Collects the cells of a class around a cell, up to `reach` columns and rows off, that one surface no steeper than `steepest` may hold with it.
    fn collect(&mut self, pixels: &[Pixel], index: usize, (class, reach, steepest): (Pixel, usize, f32)) {
        self.near.clear();
        let window = self.window;
        let n_rows = window.n_rows;
        let (column, row) = (index / n_rows, index % n_rows);
        let range = window.cells[index].range_m;
        let (across, down) = (window.header.azimuth_step as f32, window.header.elevation_step as f32);
        let farthest = (steepest * range).powi(2);
        let rows = row.saturating_sub(reach)..(row + reach + 1).min(n_rows);
        for c in column.saturating_sub(reach)..(column + reach + 1).min(window.n_columns) {
            for r in rows.clone() {
                let at = c * n_rows + r;
                let (x, y) = (c as f32 - column as f32, r as f32 - row as f32);
                let apart = x * across * x * across + y * down * y * down;
                let deeper = window.cells[at].range_m - range;
                if pixels[at] == class
                    && at != index
                    && !window.own[at]
                    && deeper * deeper <= farthest * apart
                {
                    let off = f64::from(window.inverse[at] - window.inverse[index]);
                    self.near.push(Beside { index: at, x: x.into(), y: y.into(), off });
                }
            }
        }
    }

    /// Returns the standard deviation of the inverse range of a cell.
    fn sigma(&self, index: usize) -> f64 {
        f64::from(self.noise.at(index)) * f64::from(self.window.inverse[index]).powi(2)
    }
}

/// A cell beside another one.
#[derive(Debug, Clone, Copy)]
struct Beside {
    index: usize,
    /// Columns and rows to it.
    x: f64,
    y: f64,
    /// Its inverse range minus that of the other.
    off: f64,
}

impl Beside {
    /// Returns true when the plane of this slope through the other cell predicts this one.
    fn is_on(&self, [x, y]: [f64; 2], expected: f64) -> bool {
        (self.off - x * self.x - y * self.y).abs() <= BOUND * expected
    }
}

/// Returns true when the least-squares plane through the cells around a cell predicts that one; `expected` is its standard deviation.
fn is_predicted(near: &[Beside], expected: f64) -> bool {
    let (mut moments, mut rhs, mut square) = (Matrix3::zeros(), Vector3::zeros(), 0.0);
    for cell in near {
        // Departures from the cell's own inverse range: the plane at the cell is the error of the prediction.
        let basis = Vector3::new(1.0, cell.x, cell.y);
        moments += basis * basis.transpose();
        rhs += basis * cell.off;
        square += cell.off * cell.off;
    }
    let Some(factor) = moments.cholesky() else { return false };
    let plane = factor.solve(&rhs);
    let leverage = factor.inverse()[(0, 0)];
    let residual = ((square - plane.dot(&rhs)).max(0.0) / (near.len() - 3) as f64).sqrt();
    let sigma = residual.max(expected);
    residual <= MOST_NOISE * expected
        && leverage <= MOST_LEVERAGE
        && plane.x.abs() <= BOUND * sigma * (1.0 + leverage).sqrt()
}

#[cfg(test)]
mod tests {
    use platen_numerics::random::Random;
    use platen_scan::ScanHeader;

    use super::super::mixed_pixels;
    use super::*;
    use crate::Vec3;

    const STEP: f64 = 9e-4;
    const NOISE: f64 = 3e-4;

    /// A level plate 3.5 m below the scanner, a table `below` it and the floor; `places` gives, by row, the columns at which the
    /// plate and the table end. A beam sees a quarter of a step around its middle.
    fn scene(below: f64, places: impl Fn(f64) -> [f64; 2]) -> (Window, Vec<Option<bool>>) {
        let header = ScanHeader {
            n_rows: 80,
            n_columns: 80,
            azimuth_step: STEP,
            elevation_start: -0.42,
            elevation_step: STEP,
            ..ScanHeader::default()
        };
        let beam = |column: usize, row: usize| {
            let (azimuth, elevation) = (STEP * column as f64, -0.42 - STEP * row as f64);
            Vec3::new(elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin())
        };
        let mut random = Random::new(7);
        let noise: Vec<f64> = (0..80 * 80).map(|_| NOISE * random.normal()).collect();
        let part = |at: f64, end: f64| ((at - end) / 0.5 + 0.5).clamp(0.0, 1.0);
        let share = |column: usize, row: usize| places(row as f64).map(|end| part(column as f64, end));
        let window = Window::of_ranges(header, |column, row| {
            let [plate, table] = share(column, row);
            let down = -beam(column, row).z;
            let (near, middle, far) = (3.5 / down, (3.5 + below) / down, 4.6 / down);
            let range = plate * near + (1.0 - plate) * (table * middle + (1.0 - table) * far);
            ((range + noise[column * 80 + row]) as f32, plate == 1.0)
        });
        let kinds = (0..80 * 80).map(|index| {
            let [plate, table] = share(index / 80, index % 80);
            let is_whole = [plate, table].iter().all(|part| *part == 0.0 || *part == 1.0);
            let is_mixed = [plate, table].iter().any(|part| (0.1..0.9).contains(part));
            (is_whole || is_mixed).then_some(is_mixed)
        });
        (window, kinds.collect())
    }

    /// Counts the cells of the table that are taken for mixed, and the mixed ones taken for sound, each beside all.
    fn wrong(window: &Window, kinds: &[Option<bool>]) -> [[usize; 2]; 2] {
        let noise = Noise::estimate(window, &window.own);
        let mut pixels = mixed_pixels::classify(window, &noise);
        mark_sound(window, &noise, &mut pixels);
        let mut counts = [[0; 2]; 2];
        let inner = |index: usize| [index / 80, index % 80].iter().all(|place| (4..76).contains(place));
        for index in (0..pixels.len()).filter(|index| inner(*index)) {
            match (kinds[index], pixels[index]) {
                (Some(false), pixel) if !window.own[index] => {
                    counts[0][0] += usize::from(pixel == Pixel::Mixed);
                    counts[0][1] += 1;
                }
                (Some(true), pixel) => {
                    counts[1][0] += usize::from(pixel == Pixel::Sound);
                    counts[1][1] += 1;
                }
                _ => {}
            }
        }
        counts
    }

    #[test]
    fn a_strip_that_narrows_is_background() {
        // The table's strip is 8 cells wide at the bottom and ends at the top.
        let (window, kinds) = scene(0.25, |row| [40.0 - 0.62 * row + 25.0, 40.0 - 0.72 * row + 25.0]);
        let [[strip, of], [sound, mixed]] = wrong(&window, &kinds);
        println!("background taken for mixed: {strip} of {of}; mixed taken for sound: {sound} of {mixed}");
        assert!(strip * 100 < of && sound * 20 < mixed);
    }

    #[test]
    fn a_strip_that_is_nowhere_wide_is_background() {
        // One to two cells of the table show all along the edge, which crosses a column within two rows.
        let (window, kinds) = scene(0.25, |row| [65.0 - 0.62 * row, 63.0 - 0.62 * row]);
        let [[strip, of], [sound, mixed]] = wrong(&window, &kinds);
        println!("background taken for mixed: {strip} of {of}; mixed taken for sound: {sound} of {mixed}");
        assert!(strip * 100 < of && sound * 20 < mixed);
    }

    #[test]
    fn smooth_mixing_along_a_row_stays_mixed() {
        // The plate's edge crosses a column within 80 rows: the ranges down that column are straight.
        let (window, kinds) = scene(0.25, |row| [39.75 + 0.006 * row, -9.0]);
        let [[strip, of], [sound, mixed]] = wrong(&window, &kinds);
        println!("background taken for mixed: {strip} of {of}; mixed taken for sound: {sound} of {mixed}");
        assert!(strip * 100 < of && sound * 20 < mixed && mixed > 60);
    }
}
