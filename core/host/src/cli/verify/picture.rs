//! Picture of the scan's intensities with the measured edges, lines and markers drawn over it, as SVG.

use std::fmt::Write as _;

use base64::Engine as _;
use platen_plant::PlateFile;
use platen_shape::evaluate;
use platen_shape::inspection::marker_detection::{DetectedMarker, NoMarker};
use platen_shape::{Measurement, Patch, Vec3};

/// Largest width of the picture, pixels.
const WIDTH: f64 = 1600.0;

/// Shares of the median intensity drawn black and white: paint is dark, and glare at edges does not stretch the scale.
const GRAYS: [f64; 2] = [0.25, 1.5];

/// Margin round the plate, pixels.
const MARGIN: f64 = 40.0;

/// Mapping from directions to pixels. Seen from the scanner, azimuths increase to the left.
struct View {
    /// Horizontal direction of the plate's centre.
    forward: [f64; 2],
    /// Azimuth of column 0 relative to `forward`, and elevation of row 0.
    origin: [f64; 2],
    step: [f64; 2],
    /// First and last column, first and last row.
    columns: [u32; 2],
    rows: [u32; 2],
    /// Pixels per column and per row.
    scale: [f64; 2],
}

impl View {
    fn of(patch: &Patch) -> Option<Self> {
        let middle = patch.samples.iter().map(|s| s.point).sum::<Vec3>() / patch.samples.len() as f64;
        let length = middle.x.hypot(middle.y);
        let forward = [middle.x / length, middle.y / length];
        let range = |of: fn(&platen_shape::Sample) -> u32| {
            Some([patch.samples.iter().map(of).min()?, patch.samples.iter().map(of).max()?])
        };
        let (columns, rows) = (range(|s| s.column)?, range(|s| s.row)?);
        let step = [patch.azimuth_step, patch.elevation_step];
        // Direction of column 0 and row 0: mean over all samples.
        let n = patch.samples.len() as f64;
        let origin = patch.samples.iter().fold([0.0, 0.0], |sum, s| {
            let [azimuth, elevation] = direction(forward, s.point);
            let at = [azimuth - f64::from(s.column) * step[0], elevation + f64::from(s.row) * step[1]];
            [sum[0] + at[0] / n, sum[1] + at[1] / n]
        });
        let elevation = middle.z.atan2(length);
        let x = WIDTH / f64::from(columns[1] - columns[0] + 1);
        let y = x * step[1] / (step[0] * elevation.cos());
        Some(Self { forward, origin, step, columns, rows, scale: [x, y] })
    }

    fn size(&self) -> [f64; 2] {
        let n = |[first, last]: [u32; 2]| f64::from(last - first + 1);
        [n(self.columns) * self.scale[0], n(self.rows) * self.scale[1]]
    }

    fn pixel(&self, p: Vec3) -> [f64; 2] {
        let [azimuth, elevation] = direction(self.forward, p);
        let column = (azimuth - self.origin[0]) / self.step[0];
        let row = (self.origin[1] - elevation) / self.step[1];
        let x = f64::from(self.columns[1]) - column + 0.5;
        let y = row - f64::from(self.rows[0]) + 0.5;
        [x * self.scale[0], y * self.scale[1]]
    }

    /// Encodes the intensities as PNG, one pixel for each cell, transparent where the plate was not seen.
    fn intensities(&self, patch: &Patch) -> Result<Vec<u8>, png::EncodingError> {
        let (n_x, n_y) = (self.columns[1] - self.columns[0] + 1, self.rows[1] - self.rows[0] + 1);
        let mut intensities: Vec<u16> = patch.samples.iter().map(|s| s.intensity).collect();
        let middle = intensities.len() / 2;
        let median = f64::from(*intensities.select_nth_unstable(middle).1);
        let [black, white] = GRAYS.map(|share| share * median);
        let mut pixels = vec![0_u8; 2 * n_x as usize * n_y as usize];
        for s in &patch.samples {
            let at = (s.row - self.rows[0]) as usize * n_x as usize + (self.columns[1] - s.column) as usize;
            let gray = 255.0 * (f64::from(s.intensity) - black) / (white - black).max(1.0);
            pixels[2 * at] = gray.clamp(0.0, 255.0) as u8;
            pixels[2 * at + 1] = 255;
        }
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, n_x, n_y);
        encoder.set_color(png::ColorType::GrayscaleAlpha);
        encoder.set_depth(png::BitDepth::Eight);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&pixels)?;
        writer.finish()?;
        Ok(file)
    }
}

/// Returns azimuth relative to `forward` and elevation of a point.
fn direction(forward: [f64; 2], p: Vec3) -> [f64; 2] {
    let ahead = forward[0] * p.x + forward[1] * p.y;
    let aside = forward[0] * p.y - forward[1] * p.x;
    [aside.atan2(ahead), p.z.atan2(p.x.hypot(p.y))]
}

/// Draws the picture: reference lines yellow, edges cyan, markers as yellow crosses, discs found as red rings.
///
/// # Errors
/// The image cannot be encoded.
pub(super) fn draw(
    patch: &Patch,
    measurement: &Measurement,
    plate: &PlateFile,
    discs: &[Result<DetectedMarker, NoMarker>],
) -> Result<String, png::EncodingError> {
    let Some(view) = View::of(patch) else { return Ok(String::new()) };
    let [width, height] = view.size();
    let image = base64::engine::general_purpose::STANDARD.encode(view.intensities(patch)?);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"{start} {start} {:.0} {:.0}\" \
         font-family=\"sans-serif\" font-size=\"22\">\n<rect x=\"{start}\" y=\"{start}\" width=\"100%\" height=\"100%\" \
         fill=\"#203040\"/>\n<image width=\"{width:.1}\" \
         height=\"{height:.1}\" preserveAspectRatio=\"none\" image-rendering=\"pixelated\" \
         href=\"data:image/png;base64,{image}\"/>\n",
        width + 2.0 * MARGIN,
        height + 2.0 * MARGIN,
        start = -MARGIN,
    );
    let line = |svg: &mut String, from: [f64; 2], to: [f64; 2], colour: &str| {
        let places = evaluate::reference_line(&measurement.surface, &measurement.location, from, to);
        let points: String = places.iter().fold(String::new(), |mut text, place| {
            let [x, y] = view.pixel(place.position);
            // Writing to a text cannot fail.
            let _ = write!(text, "{x:.1},{y:.1} ");
            text
        });
        *svg += &format!(
            "<polyline points=\"{points}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\"/>\n"
        );
    };
    let label = |svg: &mut String, [x, y]: [f64; 2], colour: &str, text: &str| {
        let text = text.replace('&', "&amp;").replace('<', "&lt;");
        *svg +=
            &format!("<text x=\"{:.1}\" y=\"{:.1}\" fill=\"{colour}\">{text}</text>\n", x + 22.0, y - 14.0);
    };
    let (w, h) = (plate.plate.width, plate.plate.height);
    let corners = [[0.0, 0.0], [w, 0.0], [w, h], [0.0, h]];
    for k in 0..4 {
        line(&mut svg, corners[k], corners[(k + 1) % 4], "#00c8c8");
    }
    for reference in &plate.reference_lines {
        line(&mut svg, reference.from, reference.to, "#ffd800");
        let start = measurement.surface.face(reference.from[0], reference.from[1]);
        label(&mut svg, view.pixel(start), "#ffd800", &reference.name);
    }
    for (marker, disc) in plate.markers.iter().zip(discs) {
        let [x, y] = view.pixel(measurement.surface.face(marker.at[0], marker.at[1]));
        svg += &format!(
            "<path d=\"M{:.1} {y:.1}h14m12 0h14M{x:.1} {:.1}v14m0 12v14\" stroke=\"#ffd800\" stroke-width=\"2\"/>\n",
            x - 20.0,
            y - 20.0
        );
        label(&mut svg, [x, y], "#ffd800", &marker.name);
        if let Ok(disc) = disc {
            let [x, y] = view.pixel(disc.centre);
            svg += &format!(
                "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"20\" fill=\"none\" stroke=\"#ff5030\" stroke-width=\"2\"/>\n"
            );
        }
    }
    let origin = view.pixel(measurement.corners[0]);
    svg += &format!(
        "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"10\" fill=\"none\" stroke=\"#00c8c8\" stroke-width=\"4\"/>\n</svg>\n",
        origin[0], origin[1]
    );
    Ok(svg)
}
