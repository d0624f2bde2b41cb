//! Rasterised field: few rectangles of few colours or a palette PNG, with hatching where unseen.

use std::collections::BTreeMap;

use plotters::style::RGBColor;

use platen_model::{Field, NodeState};

use super::PictureError;
use super::canvas::{At, Canvas};
use super::colour::{self, PALE, PAPER};
use super::scale::Scale;

/// Number of shades from one anchor of the scale to the next.
const PER_STEP: i32 = 4;
/// Distance of the hatching lines, squares.
const HATCH: usize = 4;
/// Overlap of neighbouring rectangles that hides the seams, pixels.
pub(super) const OVERLAP: f64 = 0.5;

/// Returns the number of shades on each side of zero.
pub(super) fn count(scale: &Scale) -> i32 {
    PER_STEP * scale.anchors.len() as i32
}

/// Returns the colour of a shade, `n` on each side of zero.
pub(super) fn colour_of(shade: i32, n: i32) -> RGBColor {
    colour::diverging(f64::from(shade) / f64::from(n))
}

/// Returns the shade of a position, rounded away from zero, so that only zero is neutral.
pub(super) fn shade_of(position: f64, n: i32) -> i32 {
    let size = (position.abs() * f64::from(n)).ceil().min(f64::from(n)) as i32;
    if position < 0.0 { -size } else { size }
}

/// Raster of shades, v outer from the top, u inner; `None` where unseen.
pub(super) struct Shades {
    n_x: usize,
    n_y: usize,
    shade: Vec<Option<i32>>,
    n_shades: i32,
}

/// Squares of one row that share a shade: from, to, shade.
type Run = (usize, usize, Option<i32>);

impl Shades {
    /// Rasterises a field with one component into `n_x` times `n_y` squares. `on_plate` converts shares from the left
    /// and from below to shares of the plate's sides u and v.
    pub(super) fn of(
        field: &Field,
        scale: &Scale,
        [n_x, n_y]: [usize; 2],
        on_plate: impl Fn([f64; 2]) -> [f64; 2],
    ) -> Self {
        let n_shades = count(scale);
        let shade = |x: usize, y: usize| {
            let [u, v] = on_plate([(x as f64 + 0.5) / n_x as f64, 1.0 - (y as f64 + 0.5) / n_y as f64]);
            let (state, value) = field.sample(u, v, 0);
            match state {
                NodeState::Unseen => None,
                NodeState::Unchanged => Some(0),
                NodeState::Seen => Some(shade_of(scale.colour_position(value * scale.factor), n_shades)),
            }
        };
        let shade = (0..n_x * n_y).map(|k| shade(k % n_x, k / n_x)).collect();
        Self { n_x, n_y, shade, n_shades }
    }

    /// Draws the shades between the upper left and the lower right corner.
    pub(super) fn paint(
        &self,
        canvas: &Canvas<'_>,
        (left, top): At,
        (right, bottom): At,
    ) -> Result<(), PictureError> {
        let x = |k: usize| left + (right - left) * k as f64 / self.n_x as f64;
        let y = |k: usize| top + (bottom - top) * k as f64 / self.n_y as f64;
        for ((from, to, shade), rows) in self.rectangles() {
            let colour = shade.map_or(PAPER, |shade| colour_of(shade, self.n_shades));
            canvas.fill((x(from), y(rows[0])), (x(to) + OVERLAP, y(rows[1]) + OVERLAP), colour)?;
        }
        self.hatch(canvas, (left, top), (right, bottom))
    }

    /// Hatches the unseen area.
    pub(super) fn hatch(
        &self,
        canvas: &Canvas<'_>,
        (left, top): At,
        (right, bottom): At,
    ) -> Result<(), PictureError> {
        for [from, to] in self.hatching() {
            let corner = |[column, row]: [usize; 2]| {
                let (x, y) = (column as f64 / self.n_x as f64, row as f64 / self.n_y as f64);
                (left + (right - left) * x, top + (bottom - top) * y)
            };
            canvas.line(&[corner(from), corner(to)], PALE, 2)?;
        }
        Ok(())
    }

    /// Encodes one pixel for each square as a palette PNG of `size` pixels, white around the field, whose first square
    /// is at `corner`.
    pub(super) fn png(&self, size: [usize; 2], corner: [usize; 2]) -> Result<Vec<u8>, png::EncodingError> {
        // Paper first, then the shades from the most negative.
        let colours = (-self.n_shades..=self.n_shades).map(|shade| colour_of(shade, self.n_shades));
        let palette: Vec<u8> =
            std::iter::once(PAPER).chain(colours).flat_map(|RGBColor(r, g, b)| [r, g, b]).collect();
        let index = |shade: i32| (shade + self.n_shades + 1) as u8;
        let mut pixels = vec![0; size[0] * size[1]];
        for (row, squares) in self.shade.chunks(self.n_x).enumerate() {
            let first = (corner[1] + row) * size[0] + corner[0];
            for (pixel, shade) in pixels.iter_mut().skip(first).zip(squares) {
                *pixel = shade.map_or(0, index);
            }
        }
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, size[0] as u32, size[1] as u32);
        encoder.set_color(png::ColorType::Indexed);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_palette(palette);
        encoder.set_compression(png::Compression::High);
        encoder.set_filter(png::Filter::NoFilter);
        encoder.write_header()?.write_image_data(&pixels)?;
        Ok(file)
    }

    /// Returns maximal rectangles in a fixed order: runs (from, to, shade) with the rows that repeat them.
    fn rectangles(&self) -> Vec<(Run, [usize; 2])> {
        let mut done = Vec::new();
        let mut open: BTreeMap<Run, usize> = BTreeMap::new();
        for row in 0..self.n_y {
            let cells = &self.shade[row * self.n_x..(row + 1) * self.n_x];
            let mut runs = BTreeMap::new();
            let mut from = 0;
            for run in cells.chunk_by(|a, b| a == b) {
                let key = (from, from + run.len(), run[0]);
                runs.insert(key, open.remove(&key).unwrap_or(row));
                from += run.len();
            }
            done.extend(open.iter().map(|(key, first)| (*key, [*first, row])));
            open = runs;
        }
        done.extend(open.iter().map(|(key, first)| (*key, [*first, self.n_y])));
        done
    }

    /// Returns the unseen pieces of the diagonals, as corners of squares (column, row).
    fn hatching(&self) -> Vec<[[usize; 2]; 2]> {
        let mut lines = Vec::new();
        let unseen = |x: usize, y: usize| self.shade[y * self.n_x + x].is_none();
        for sum in (0..self.n_x + self.n_y).step_by(HATCH) {
            let mut start = None;
            for x in sum.saturating_sub(self.n_y - 1)..=sum.min(self.n_x - 1) {
                let y = sum - x;
                match (unseen(x, y), start) {
                    (true, None) => start = Some([x, y + 1]),
                    (false, Some(from)) => {
                        lines.push([from, [x, y + 1]]);
                        start = None;
                    }
                    _ => {}
                }
            }
            if let Some(from) = start {
                let x = sum.min(self.n_x - 1);
                lines.push([from, [x + 1, sum - x]]);
            }
        }
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rectangles_cover_every_square_once() {
        let shade: Vec<Option<i32>> =
            (0..30 * 20).map(|k| (k % 7 != 0).then_some((k % 30 / 10) * (k / 30 / 5))).collect();
        let shades = Shades { n_x: 30, n_y: 20, shade, n_shades: 8 };
        let mut covered = vec![0; 600];
        for ((from, to, shade), [first, last]) in shades.rectangles() {
            for cell in (first..last).flat_map(|row| (from..to).map(move |x| row * 30 + x)) {
                covered[cell] += 1;
                assert_eq!(shades.shade[cell], shade);
            }
        }
        assert!(covered.iter().all(|n| *n == 1));
    }
}
