//! Map for a screen: the colours as a palette PNG with one pixel for each square, and an SVG of words and numbers over
//! it.
//!
//! Colours, scale and marks are those of the map in the files. The letters are larger, and the plate is drawn as the
//! operator sees it.

use platen_model::Field;

use super::canvas::{Text, overlay};
use super::map::{self, Layout, Look, Mark, SQUARE};
use super::{PictureError, View};
use crate::result::PlateRecord;

/// Layout on a screen.
const LOOK: Look =
    Look { left: 112.0, top: 104.0, below: 136.0, letters: 1.35, press_line: 74.0, title_line: 114.0 };

/// Two images of equal proportions: the PNG is shown as wide as the SVG, without smoothing, and the SVG lies over it.
#[derive(Debug, Clone, PartialEq)]
pub struct ScreenMap {
    /// Colours, white around the plate.
    pub png: Vec<u8>,
    /// Words, numbers, marks and hatching on a transparent background.
    pub svg: String,
}

/// Draws one field over the plate, with the scale of the plate's pictures. On the map of the missing curvature it
/// frames the place of the next hit or draws the advised bend line.
///
/// # Errors
/// An encoder fails.
pub fn screen_map(
    field: &Field,
    plate: &PlateRecord,
    view: View,
    mark: Option<Mark<'_>>,
) -> Result<ScreenMap, PictureError> {
    let layout = Layout::new(field, plate, &plate.scale, view, LOOK);
    let (size, (from, to)) = (layout.size(), layout.corners());
    let shades = layout.shades(field);
    let squares = |pixels: f64| (pixels / SQUARE) as usize;
    let pixels = [size.0, size.1].map(|pixels| squares(f64::from(pixels)));
    let png = shades.png(pixels, [squares(from.0), squares(from.1)]);
    let svg = overlay(size, |canvas| {
        canvas.text(&layout.title, (24.0, 34.0), Text::new(24.0 * LOOK.letters).bold())?;
        shades.hatch(canvas, from, to)?;
        map::words(&layout, field, mark, canvas)
    })?;
    Ok(ScreenMap { png: png.map_err(|e| PictureError(e.to_string()))?, svg })
}

/// Returns the colours of a field as a PNG of the plate alone, u to the right, v up.
///
/// # Errors
/// The encoder fails.
pub fn texture(field: &Field, plate: &PlateRecord) -> Result<Vec<u8>, PictureError> {
    let layout = Layout::new(field, plate, &plate.scale, View::FILE, LOOK);
    let png = layout.shades(field).png(layout.squares, [0, 0]);
    png.map_err(|e| PictureError(e.to_string()))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::io::Cursor;

    use platen_model::{Language, NodeState, Verdict};

    use super::*;
    use crate::picture::{Caption, Turn, Units, map};
    use crate::result::{CURVATURE_DEFICIT, Next, NextPlace};

    const SIDE: usize = 101;
    /// Curvature that opens 1 mm under the template of 2 m, 1/m.
    const ONE_MM: f64 = 2e-3;

    fn plate(press_side: Option<[i8; 2]>) -> PlateRecord {
        PlateRecord { width_mm: 3000.0, height_mm: 2000.0, press_side, ..PlateRecord::default() }
    }

    /// Returns a field of missing curvature by place in shares of the sides; `None` where unseen, unchanged where 0.
    fn field(missing: impl Fn(f64, f64) -> Option<f64>) -> Field {
        let share = |k: usize| k as f64 / (SIDE - 1) as f64;
        let nodes: Vec<_> = (0..SIDE * SIDE).map(|k| missing(share(k % SIDE), share(k / SIDE))).collect();
        let state = |value: &Option<f64>| match value {
            None => NodeState::Unseen,
            Some(0.0) => NodeState::Unchanged,
            Some(_) => NodeState::Seen,
        };
        Field {
            name: CURVATURE_DEFICIT.into(),
            unit: "1/m".into(),
            nodes: [SIDE; 2],
            components: 1,
            state: nodes.iter().map(state).collect(),
            values: nodes.iter().map(|value| value.unwrap_or(f64::NAN)).collect(),
        }
    }

    /// Returns a field with every shade of the scale from left to right, gray in the middle, and an unseen corner.
    fn rainbow() -> Field {
        field(|u, v| match u - 0.5 {
            _ if u > 0.8 && v > 0.8 => None,
            x if x.abs() < 0.03 => Some(0.0),
            x => Some(x.signum() * 160.0 * ONE_MM * (2.0 * x).powi(2)),
        })
    }

    fn drawn(field: &Field, press_side: Option<[i8; 2]>, view: View) -> ScreenMap {
        screen_map(field, &plate(press_side), view, None).unwrap()
    }

    /// Returns the colours of a PNG, row by row from above, with its width.
    fn decoded(png: &[u8]) -> (usize, Vec<String>) {
        let mut reader = png::Decoder::new(Cursor::new(png)).read_info().unwrap();
        let palette = reader.info().palette.clone().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let frame = reader.next_frame(&mut pixels).unwrap();
        assert_eq!(frame.color_type, png::ColorType::Indexed);
        let colour = |index: &u8| {
            let rgb = &palette[3 * usize::from(*index)..][..3];
            format!("#{:02X}{:02X}{:02X}", rgb[0], rgb[1], rgb[2])
        };
        (frame.width as usize, pixels.iter().map(colour).collect())
    }

    /// Returns the filled rectangles of an SVG: extent along x and y, pixels, and colour.
    fn rectangles(svg: &str) -> Vec<([[f64; 2]; 2], String)> {
        let value = |line: &str, name: &str| {
            let text = line.split_once(&format!(" {name}=\"")).unwrap().1;
            text[..text.find('"').unwrap()].to_owned()
        };
        let of = |line: &str| {
            let [x, y, width, height] =
                ["x", "y", "width", "height"].map(|name| value(line, name).parse::<f64>().unwrap() / 8.0);
            ([[x, x + width], [y, y + height]], value(line, "fill"))
        };
        svg.lines().filter(|line| line.starts_with("<rect")).map(of).collect()
    }

    /// A line along v at u 1.5 m, with intervals of 20 mm and 200 mm: the dashes lie at these distances on both sides.
    #[test]
    fn the_advised_line_lies_within_the_interval_of_its_place() {
        let field = rainbow();
        let dashes = |to: Option<f64>| {
            let mark = Some(Mark::Line([[1500.0, 0.0], [1500.0, 2000.0]], to));
            let svg = screen_map(&field, &plate(None), View::default(), mark).unwrap().svg;
            svg.lines()
                .filter(|line| line.starts_with("<polyline") && line.contains("stroke-width=\"16\""))
                .count()
        };
        let others = dashes(None);
        let [narrow, wide] = [20.0, 200.0].map(|to| dashes(Some(to)));
        println!("{others} {narrow} {wide}");
        // Both sides along the whole line, and longer ends for a wider interval.
        assert!(narrow > others + 20 && wide > narrow, "{others} {narrow} {wide}");
    }

    #[test]
    fn the_colours_of_the_pixels_are_those_of_the_legend_and_of_the_map_in_the_files() {
        let field = rainbow();
        let ScreenMap { png, svg } = drawn(&field, None, View::default());
        let (width, pixels) = decoded(&png);
        let legend: BTreeSet<String> = rectangles(&svg).into_iter().map(|(_, colour)| colour).collect();
        let shades: BTreeSet<String> = pixels.iter().filter(|colour| *colour != "#FFFFFF").cloned().collect();
        assert!(shades.len() > 40, "{} shades", shades.len());
        assert!(shades.is_subset(&legend), "not in the legend: {:?}", shades.difference(&legend));

        let plate = plate(None);
        let caption = Caption { plate: "A", stroke: None, verdict: Verdict::Fail };
        let file = rectangles(&map(&field, &plate, &caption, &plate.scale, None).unwrap());
        // The plate lies 24 pixels higher on the screen; later rectangles cover earlier ones.
        let colour_at = |x: f64, y: f64| {
            let covers = |span: [f64; 2], at: f64| span[0] <= at && at <= span[1];
            let mut all = file.iter().rev();
            all.find(|(span, _)| covers(span[0], x) && covers(span[1], y + 24.0)).map(|(_, colour)| colour)
        };
        for (x, y) in (28..230).flat_map(|x| (26..161).map(move |y| (x, y))) {
            let found = &pixels[y * width + x];
            assert_eq!(Some(found), colour_at(4.0 * x as f64 + 2.0, 4.0 * y as f64 + 2.0), "{x}, {y}");
        }
    }

    #[test]
    fn the_pixels_lie_under_the_overlay_s_plate() {
        let ScreenMap { png, svg } = drawn(&field(|_, _| Some(20.0 * ONE_MM)), None, View::default());
        let (width, pixels) = decoded(&png);
        let size = |name: &str| {
            let text = svg.split_once(&format!(" {name}=\"")).unwrap().1;
            text[..text.find('"').unwrap()].parse::<usize>().unwrap()
        };
        assert_eq!([size("width"), size("height")], [4 * width, 4 * pixels.len() / width]);
        // 808 pixels for 3 m, so 540 for 2 m.
        let coloured = |k: usize| pixels[k] != "#FFFFFF";
        let inside = |k: usize| (28..230).contains(&(k % width)) && (26..161).contains(&(k / width));
        assert!((0..pixels.len()).all(|k| coloured(k) == inside(k)));
        let corner = |x: usize, y: usize| format!("{},{}", 32 * x, 32 * y);
        assert!(svg.contains(&corner(28, 26)) && svg.contains(&corner(230, 161)), "frame");
    }

    #[test]
    fn the_press_is_below_whatever_its_side() {
        // A strong patch in the corner u = W, v = 0.
        let field = field(|u, v| Some(if u > 0.9 && v < 0.1 { 140.0 } else { 4.0 } * ONE_MM));
        // Right and below as drawn; turned clockwise by quarter turns with the edge v = 0, u = W, v = H, u = 0 below.
        for (side, at) in
            [([0, -1], [0.95, 0.95]), ([1, 0], [0.05, 0.95]), ([0, 1], [0.05, 0.05]), ([-1, 0], [0.95, 0.05])]
        {
            let ScreenMap { png, svg } = drawn(&field, Some(side), View::default());
            let (width, pixels) = decoded(&png);
            let plate: Vec<usize> = (0..pixels.len()).filter(|k| pixels[*k] != "#FFFFFF").collect();
            let (first, last) = (plate[0], plate[plate.len() - 1]);
            let extent = [last % width - first % width, last / width - first / width];
            let [x, y] = [0, 1].map(|i| (at[i] * extent[i] as f64) as usize);
            let strong = &pixels[first + y * width + x];
            let patch = plate.iter().filter(|k| pixels[**k] == *strong).count();
            assert!((1..plate.len() / 20).contains(&patch), "{side:?}: the patch is at {at:?}");
            assert_eq!(extent[1] > extent[0], side[0] != 0, "{side:?}: a quarter turn makes it tall");
            assert!(svg.contains("from the press") && svg.contains("press\n"));
        }
        let drawing = drawn(&field, Some([1, 0]), View::FILE);
        assert!(drawing.svg.contains("u, mm") && !drawing.svg.contains("from the"));
    }

    #[test]
    fn words_and_numbers_follow_language_and_unit() {
        let next = Next::Place(NextPlace {
            at_mm: [2400.0, 1000.0],
            extent_mm: [600.0, 800.0],
            gap_mm: 20.0,
            uncertainty_mm: None,
            limit_mm: 3.0,
            chord_mm: 2000.0,
        });
        let view = View { language: Language::Ja, units: Units::Inch, turn: Turn::Press };
        let svg = screen_map(&rainbow(), &plate(Some([0, 1])), view, Mark::of(Some(&next))).unwrap().svg;
        // The ladder ends at 150 mm, the template is 2 m long, the plate 118 in.
        for text in [
            "曲げ不足",
            "曲げ過ぎ",
            "次に押す位置",
            "プレス",
            "+5.91",
            "78.74 in",
            "\n100\n",
            "左から, in",
            "データなし",
        ] {
            assert!(svg.contains(text), "{text}");
        }
        assert!(!svg.contains("mm"));
        let english = |text: &str| text.chars().filter(|c| c.is_ascii_alphabetic()).count() > 2;
        let words = svg.lines().filter(|line| !line.starts_with('<') && english(line));
        assert_eq!(words.collect::<Vec<_>>(), Vec::<&str>::new(), "English words");
    }

    #[test]
    fn a_map_is_light() {
        let wavy = field(|u, v| {
            Some((30.0 * u + 3.0 * (60.0 * u + 9.0 * v).sin() + 2.0 * (70.0 * v).cos()) * ONE_MM)
        });
        let ScreenMap { png, svg } = drawn(&wavy, Some([0, -1]), View::default());
        // Found: 3.7 and 15.7 kB.
        assert!(png.len() < 8_000 && svg.len() < 32_000, "{} {}", png.len(), svg.len());
    }
}
