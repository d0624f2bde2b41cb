//! Mixed pixels: classification of cells by second differences of the inverse range.
//!
//! A mixed pixel is a cell whose beam straddles an edge; its range lies between those of the plate and of the
//! background. In: a window and the noise of its ranges. Out: the class of each cell ([`Pixel`]). Own; Masuda et al. do
//! not treat mixed pixels.

use super::range_noise::Noise;
use super::window::Window;

/// Bound of a second difference, in its standard deviations. A sound cell exceeds it with a probability of 6e-7 in one
/// difference, and is lost only when it exceeds it in all differences that could explain it.
const BOUND: f32 = 5.0;

/// Least bound in parts of the jump between the surfaces on both sides: the background is often noisier than the plate.
const LEAST_SHARE: f32 = 0.002;

/// Detection limit of a mixed pixel beside a surface, in standard deviations of a range: [`BOUND`] times that of a
/// second difference, rounded.
pub(super) const DETECTION_LIMIT: f64 = 12.0;

/// Returns the least part of the jump between two surfaces, metres, by which a mixed pixel must differ from one of them
/// to be detected. `noise` is the standard deviation of the ranges on it, metres.
pub(crate) fn detection_limit(noise: f64, jump: f64) -> f64 {
    (DETECTION_LIMIT * noise / jump).max(f64::from(LEAST_SHARE))
}

/// Steepest surface, metres of range per metre across the beam: that of an incidence of 85 degrees.
pub(super) const STEEPEST: f32 = 12.0;

/// Class of a cell, determined from its neighbours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum Pixel {
    /// No return, or too few neighbours.
    #[default]
    Unknown,
    /// Part of a surface along its row and along its column.
    Sound,
    /// Part of no surface.
    Mixed,
}

/// Classifies the cells of a window.
///
/// A cell is mixed if its range, along the row or along the column, departs by more than the noise from three
/// predictions: the straight continuations of the two cells on either side, and the middle between its neighbours. A
/// mixed pixel may lie in the middle between two surfaces by chance; the middle therefore counts only for a surface no
/// steeper than [`STEEPEST`].
///
/// Straight means in inverse range, so that there is no limit of the incidence. The noise is that of the surface that
/// is continued: a beam that sees a small part of a dark, noisy plate before a bright wall is detected by the noise of
/// the wall.
pub(super) fn classify(window: &Window, noise: &Noise, background: &Noise) -> Vec<Pixel> {
    let n_rows = window.n_rows;
    let mut pixels = vec![Pixel::Unknown; window.cells.len()];
    for (column, rows) in window.inner_spans(2) {
        for row in rows {
            let index = column * n_rows + row;
            let here = window.inverse[index];
            if here > 0.0 {
                let scale = BOUND * 6.0_f32.sqrt() * here * here;
                // A stepped background seems noisier than it is.
                let own = noise.of(column, row);
                let bounds = [own, background.of(column, row).min(own)].map(|noise| scale * noise);
                let down = along(window, index, (1, window.header.elevation_step), bounds);
                let across = along(window, index, (n_rows, window.header.azimuth_step), bounds);
                pixels[index] = match (down, across) {
                    (Pixel::Mixed, _) | (_, Pixel::Mixed) => Pixel::Mixed,
                    (Pixel::Sound, Pixel::Sound) => Pixel::Sound,
                    _ => Pixel::Unknown,
                };
            }
        }
    }
    pixels
}

/// Classifies a cell along one direction of the lattice, given by the stride of its cells and the angle between them.
/// The cell is mixed when both sides were measured and no prediction holds. The bounds are those of the component and
/// of the background.
#[inline]
fn along(window: &Window, index: usize, (stride, angle): (usize, f64), [own, background]: [f32; 2]) -> Pixel {
    let inverse = &window.inverse;
    let q = [
        inverse[index - 2 * stride],
        inverse[index - stride],
        inverse[index],
        inverse[index + stride],
        inverse[index + 2 * stride],
    ];
    let known = q.map(|q| q > 0.0);
    let bound_at = |at: usize| if window.own[at] { own } else { background };
    let small = |i: usize, bound: f32| (q[i] - 2.0 * q[i + 1] + q[i + 2]).abs() <= bound;
    let (before, behind) = (known[0] && known[1], known[3] && known[4]);
    let is_steep = (q[3] - q[1]).abs() > 2.0 * STEEPEST * angle as f32 * q[2];
    if (known[1] && known[3] && small(1, own) && !is_steep)
        || (before && small(0, bound_at(index - stride)))
        || (behind && small(2, bound_at(index + stride)))
    {
        Pixel::Sound
    } else if before && behind {
        let off = |i: usize| (q[i] - 2.0 * q[i + 1] + q[i + 2]).abs();
        if off(0).min(off(2)) < LEAST_SHARE * (off(0) + off(2)) {
            return Pixel::Sound;
        }
        Pixel::Mixed
    } else {
        Pixel::Unknown
    }
}

#[cfg(test)]
mod tests {
    use platen_numerics::random::Random;
    use platen_scan::ScanHeader;

    use super::*;

    const FACE_ROWS: usize = 40;

    /// Builds a window with a face of [`FACE_ROWS`] rows before a surface; `range` gives the range of a row and its
    /// standard deviation.
    fn window(seed: u64, range: impl Fn(usize) -> (f64, f64)) -> Window {
        let header = ScanHeader {
            n_rows: 80,
            n_columns: 40,
            azimuth_step: 9e-4,
            elevation_step: 9e-4,
            ..ScanHeader::default()
        };
        let mut random = Random::new(seed);
        let noise: Vec<f64> = (0..80 * 40).map(|_| random.normal()).collect();
        Window::of_ranges(header, |column, row| {
            let (range, sigma) = range(row);
            ((range + sigma * noise[80 * column + row]) as f32, row < FACE_ROWS)
        })
    }

    /// A wall 2 m behind a face; the inverse range of one row is the mean of both.
    #[test]
    fn halfway_between_two_surfaces_is_mixed() {
        let window = window(3, |row| match row {
            0..FACE_ROWS => (8.0, 1e-3),
            FACE_ROWS => (2.0 / (1.0 / 8.0 + 1.0 / 10.0), 1e-3),
            _ => (10.0, 1e-3),
        });
        let pixels =
            classify(&window, &Noise::estimate(&window, &window.own), &Noise::of_background(&window));
        let all = |class: Pixel, row: usize| (4..36).all(|column| pixels[80 * column + row] == class);
        assert!(all(Pixel::Mixed, FACE_ROWS));
        assert!(all(Pixel::Sound, FACE_ROWS + 1));
    }

    /// A wall of low noise 2 m behind a face of high noise; the beams of one row see 1 % of the face, 20 mm of range.
    #[test]
    fn little_of_a_noisy_face_before_a_quiet_wall_is_mixed() {
        let window = window(11, |row| match row {
            0..FACE_ROWS => (8.0, 2e-3),
            FACE_ROWS => (9.98, 2e-4),
            _ => (10.0, 2e-4),
        });
        let face = Noise::estimate(&window, &window.own);
        let mixed = |background: &Noise| {
            let pixels = classify(&window, &face, background);
            (4..36).filter(|column| pixels[80 * column + FACE_ROWS] == Pixel::Mixed).count()
        };
        let found = [&face, &Noise::of_background(&window)].map(mixed);
        println!("found by the noise of the face and of the background: {found:?} of 32");
        assert_eq!(found[1], 32);
        assert!(found[0] < 16);
    }
}
