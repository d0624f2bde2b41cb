//! Picture of a scan in the scanner's view: equirectangular projection, with the same angle for every pixel.
//!
//! The colour is the range of the nearest surface, histogram-equalised from dark violet (near) to yellow (far). The
//! brightness is the intensity. Black is no return.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use platen_scan::{Column, ScanHeader, State};

/// Largest size of the picture, pixels.
const WIDTH: f64 = 1600.0;
const HEIGHT: f64 = 1200.0;
/// Part of a pixel that rounding may add to a whole number of pixels.
const ROUNDING: f64 = 1e-6;
/// Brightness of the weakest echo.
const DIM: f64 = 0.5;
/// Colour of a pixel without a return.
const NOTHING: [u8; 3] = [0, 0, 0];

#[derive(Debug, Clone, Copy, Default)]
struct Pixel {
    range_m: f32,
    intensity: f32,
    n: u32,
}

/// Collects columns into pixels; its memory does not grow with the scan.
#[derive(Debug)]
pub(super) struct RangePicture {
    width: usize,
    height: usize,
    /// Pixels from one column to the next, and from one row to the next.
    per_column: f64,
    per_row: f64,
    pixels: Vec<Pixel>,
}

impl RangePicture {
    pub(super) fn new(header: &ScanHeader) -> Self {
        let (n_rows, n_columns) = (f64::from(header.n_rows), f64::from(header.n_columns.max(1)));
        let (wide, high) = (n_columns * header.azimuth_step, n_rows * header.elevation_step);
        let finest = header.azimuth_step.min(header.elevation_step);
        let angle = (wide / WIDTH).max(high / HEIGHT).max(finest);
        let [width, height] = [wide, high].map(|extent| (extent / angle - ROUNDING).ceil() as usize);
        Self {
            width,
            height,
            per_column: header.azimuth_step / angle,
            per_row: header.elevation_step / angle,
            pixels: vec![Pixel::default(); width * height],
        }
    }

    pub(super) fn add(&mut self, column: &Column) {
        let xs = covered(column.index as usize, self.per_column, self.width);
        for i in (0..column.len()).filter(|i| column.state[*i] == State::Valid) {
            for y in covered(column.first_row as usize + i, self.per_row, self.height) {
                for x in xs.clone() {
                    // Azimuth grows counter-clockwise: to the left.
                    let pixel = &mut self.pixels[y * self.width + self.width - 1 - x];
                    pixel.range_m += column.range_m[i] as f32;
                    pixel.intensity += f32::from(column.intensity[i]);
                    pixel.n += 1;
                }
            }
        }
    }

    pub(super) fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Writes a new file, either completely or not at all.
    pub(super) fn write(&self, path: &Path) -> Result<(), png::EncodingError> {
        let part = path.with_extension(format!("png.{}.part", std::process::id()));
        let written = self.encode(&part).and_then(|()| Ok(std::fs::rename(&part, path)?));
        if written.is_err() {
            // A file that cannot be removed is named `.part`.
            let _ = std::fs::remove_file(&part);
        }
        written
    }

    fn encode(&self, part: &Path) -> Result<(), png::EncodingError> {
        let out = BufWriter::new(File::create_new(part)?);
        let mut encoder = png::Encoder::new(out, self.width as u32, self.height as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&self.colours())?;
        writer.finish()
    }

    fn colours(&self) -> Vec<u8> {
        let mean = |sum: fn(&Pixel) -> f32| {
            self.pixels.iter().map(move |p| if p.n == 0 { f32::NAN } else { sum(p) / p.n as f32 }).collect()
        };
        let (ranges, intensities): (Vec<f32>, Vec<f32>) = (mean(|p| p.range_m), mean(|p| p.intensity));
        let (far, bright) = (ranks(&ranges), ranks(&intensities));
        let colour = |(far, bright): (&f64, &f64)| {
            if far.is_nan() { NOTHING } else { scale(*far).map(|c| (c * (DIM + (1.0 - DIM) * bright)) as u8) }
        };
        far.iter().zip(&bright).flat_map(colour).collect()
    }
}

/// Returns the pixels that a row or column covers, at least one.
fn covered(index: usize, per: f64, n: usize) -> std::ops::Range<usize> {
    let from = ((index as f64 * per) as usize).min(n.saturating_sub(1));
    from..(((index + 1) as f64 * per) as usize).clamp(from + 1, n.max(from + 1))
}

/// Returns the share of the other values below each value; NaN stays NaN.
fn ranks(values: &[f32]) -> Vec<f64> {
    let mut sorted: Vec<f32> = values.iter().copied().filter(|value| !value.is_nan()).collect();
    sorted.sort_by(f32::total_cmp);
    let rank = |value: f32| {
        let below = sorted.partition_point(|other| *other < value);
        let same = sorted[below..].partition_point(|other| *other <= value);
        (below as f64 + 0.5 * same as f64) / sorted.len() as f64
    };
    values.iter().map(|value| if value.is_nan() { f64::NAN } else { rank(*value) }).collect()
}

/// Colour scale "viridis" (S. van der Walt and N. Smith, 2015), uniform in lightness, at nine positions.
const SCALE: [[f64; 3]; 9] = [
    [68.0, 1.0, 84.0],
    [71.0, 44.0, 122.0],
    [59.0, 81.0, 139.0],
    [44.0, 113.0, 142.0],
    [33.0, 144.0, 141.0],
    [39.0, 173.0, 129.0],
    [92.0, 200.0, 99.0],
    [170.0, 220.0, 50.0],
    [253.0, 231.0, 37.0],
];

fn scale(share: f64) -> [f64; 3] {
    let place = share.clamp(0.0, 1.0) * (SCALE.len() - 1) as f64;
    let from = (place as usize).min(SCALE.len() - 2);
    let part = place - from as f64;
    std::array::from_fn(|k| SCALE[from][k] + (SCALE[from + 1][k] - SCALE[from][k]) * part)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(n_rows: u32, n_columns: u32, steps: [f64; 2]) -> ScanHeader {
        ScanHeader {
            n_rows,
            n_columns,
            azimuth_step: steps[0],
            elevation_step: steps[1],
            ..ScanHeader::default()
        }
    }

    fn column(index: u32, n: usize) -> Column {
        Column {
            index,
            range_m: (0..n).map(|row| 5.0 + row as f64).collect(),
            azimuth: vec![0.0; n],
            elevation: vec![0.0; n],
            intensity: vec![7; n],
            state: vec![State::Valid; n],
            ..Column::default()
        }
    }

    #[test]
    fn every_pixel_of_a_full_scan_is_filled_whatever_the_steps() {
        for (rows, columns, steps) in [
            (40, 30, [1e-3, 1e-3]),
            (40, 30, [4e-3, 1e-3]),
            (3000, 40, [1e-4, 1e-4]),
            (7, 4000, [1e-4, 1e-3]),
        ] {
            let mut picture = RangePicture::new(&header(rows, columns, steps));
            (0..columns).for_each(|index| picture.add(&column(index, rows as usize)));
            assert!(picture.size().0 <= 1601 && picture.size().1 <= 1201, "{:?}", picture.size());
            assert!(picture.pixels.iter().all(|pixel| pixel.n > 0), "{rows} x {columns}");
        }
    }

    #[test]
    fn the_first_column_is_on_the_right_and_row_0_on_top() {
        let mut picture = RangePicture::new(&header(5, 4, [1e-3, 1e-3]));
        picture.add(&column(0, 1));
        let filled: Vec<usize> = (0..20).filter(|i| picture.pixels[*i].n > 0).collect();
        assert_eq!(filled, [3]);
        let colours = picture.colours();
        assert!(colours[9..12].iter().any(|c| *c > 0) && colours[12..].iter().all(|c| *c == 0));
    }
}
