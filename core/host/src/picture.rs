//! Maps in plate coordinates: what the operator reads at two metres.
//!
//! Colours diverge from neutral gray, are safe for colour-blind readers and symmetric about zero; what was not seen is
//! hatched. The circle marks the plate's corner (0, 0).

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use crate::plugin::{Field, NodeState};
use crate::record::ResultRecord;

/// The picture could not be drawn.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct PictureError(String);

/// Width of a picture, pixels.
const WIDTH: u32 = 1000;
/// Room round the plate: left, right (legend), top, bottom.
const ROOM: [u32; 4] = [90, 150, 70, 60];

/// A map of one field over the plate, as SVG.
///
/// # Errors
/// When the drawing library fails.
pub fn map(field: &Field, record: &ResultRecord) -> Result<String, PictureError> {
    let (factor, unit) = if field.unit == "m" { (1000.0, "mm") } else { (1.0, field.unit.as_str()) };
    let known = || field.values.iter().zip(&field.state).filter(|(_, state)| **state != NodeState::Unseen);
    let largest = known().map(|(value, _)| value.abs() * factor).fold(0.0, f64::max);
    let full = nice_ceiling(largest.max(1e-9));

    let (width_mm, height_mm) = record.extent_mm();
    let plot_width = WIDTH - ROOM[0] - ROOM[1];
    let plot_height = ((f64::from(plot_width) * height_mm / width_mm) as u32).max(100);
    let size = (WIDTH, plot_height + ROOM[2] + ROOM[3]);
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        let draw = || -> Result<(), Box<dyn std::error::Error + '_>> {
            root.fill(&WHITE)?;
            let title = format!("{} {}: {}, {}", record.plate, stroke(record), field.name, verdict(record));
            root.draw_text(&title, &("sans-serif", 26).into_text_style(&root), (ROOM[0] as i32, 14))?;
            let to_pixel = |u: f64, v: f64| {
                let x = f64::from(ROOM[0]) + u / width_mm * f64::from(plot_width);
                let y = f64::from(ROOM[2]) + (1.0 - v / height_mm) * f64::from(plot_height);
                (x.round() as i32, y.round() as i32)
            };
            let [n_u, n_v] = field.nodes;
            for i_v in 0..n_v {
                for i_u in 0..n_u {
                    let node = i_v * n_u + i_u;
                    let edge = |k: f64, n: usize, length: f64| (k / (n - 1) as f64).clamp(0.0, 1.0) * length;
                    let from = to_pixel(
                        edge(i_u as f64 - 0.5, n_u, width_mm),
                        edge(i_v as f64 + 0.5, n_v, height_mm),
                    );
                    let to = to_pixel(
                        edge(i_u as f64 + 0.5, n_u, width_mm),
                        edge(i_v as f64 - 0.5, n_v, height_mm),
                    );
                    let colour = match field.state[node] {
                        NodeState::Unseen => WHITE,
                        NodeState::Unchanged => NEUTRAL,
                        NodeState::Seen => diverging(field.values[node] * factor / full),
                    };
                    // One pixel more on two sides leaves no seam between neighbours.
                    let cover = [from, (to.0 + 1, to.1 + 1)];
                    root.draw(&Rectangle::new(cover, colour.filled()))?;
                    if field.state[node] == NodeState::Unseen {
                        root.draw(&PathElement::new(
                            [(from.0, to.1), (to.0, from.1)],
                            RGBColor(120, 120, 120),
                        ))?;
                    }
                }
            }
            let frame = [to_pixel(0.0, height_mm), to_pixel(width_mm, 0.0)];
            root.draw(&Rectangle::new(frame, BLACK.stroke_width(2)))?;
            root.draw(&Circle::new(to_pixel(0.0, 0.0), 9, BLACK.stroke_width(3)))?;
            axes(&root, &to_pixel, width_mm, height_mm)?;
            legend(&root, plot_height, full, unit)?;
            root.present()?;
            Ok(())
        };
        draw().map_err(|e| PictureError(e.to_string()))?;
    }
    Ok(svg)
}

fn stroke(record: &ResultRecord) -> String {
    record.stroke.map(|n| format!("stroke {n}")).unwrap_or_default()
}

fn verdict(record: &ResultRecord) -> &'static str {
    use platen_shape::task::Verdict;
    match record.verdict {
        Verdict::Pass => "PASS",
        Verdict::Fail => "FAIL",
        Verdict::CannotTell => "CANNOT TELL",
        Verdict::NotMeasured => "NOT MEASURED",
    }
}

type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;
type Drawn<'a> = Result<(), Box<dyn std::error::Error + 'a>>;

fn axes<'a>(
    root: &Area<'a>,
    to_pixel: &dyn Fn(f64, f64) -> (i32, i32),
    width: f64,
    height: f64,
) -> Drawn<'a> {
    let small = ("sans-serif", 18).into_text_style(root);
    let below = small.pos(Pos::new(HPos::Center, VPos::Top));
    let beside = small.pos(Pos::new(HPos::Right, VPos::Center));
    let step = nice_ceiling(width.max(height) / 6.0);
    for k in 0..=(width / step) as u32 {
        let (x, y) = to_pixel(f64::from(k) * step, 0.0);
        root.draw_text(&format!("{}", f64::from(k) * step), &below, (x, y + 10))?;
    }
    for k in 0..=(height / step) as u32 {
        let (x, y) = to_pixel(0.0, f64::from(k) * step);
        root.draw_text(&format!("{}", f64::from(k) * step), &beside, (x - 12, y))?;
    }
    let (x, y) = to_pixel(width / 2.0, 0.0);
    root.draw_text("u, mm", &below, (x + 60, y + 34))?;
    let (x, y) = to_pixel(0.0, height / 2.0);
    root.draw_text("v, mm", &beside, (x - 12, y + 24))?;
    Ok(())
}

fn legend<'a>(root: &Area<'a>, plot_height: u32, full: f64, unit: &str) -> Drawn<'a> {
    let left = (WIDTH - ROOM[1] + 30) as i32;
    let top = ROOM[2] as i32;
    for y in 0..plot_height as i32 {
        let value = 1.0 - 2.0 * f64::from(y) / f64::from(plot_height);
        let row = [(left, top + y), (left + 24, top + y + 2)];
        root.draw(&Rectangle::new(row, diverging(value).filled()))?;
    }
    let text = ("sans-serif", 18).into_text_style(root).pos(Pos::new(HPos::Left, VPos::Center));
    for value in [1.0, 0.5, 0.0, -0.5, -1.0] {
        let y = top + ((1.0 - value) / 2.0 * f64::from(plot_height)) as i32;
        root.draw_text(&format!("{:+}", value * full), &text, (left + 32, y))?;
    }
    root.draw_text(unit, &text, (left, top - 16))?;
    Ok(())
}

/// 1, 2 or 5 times a power of ten, not below `value`.
fn nice_ceiling(value: f64) -> f64 {
    let power = 10.0_f64.powf(value.log10().floor());
    [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|step| step * power)
        .find(|nice| *nice >= value * (1.0 - 1e-12))
        .unwrap_or(value)
}

/// Nothing changed.
const NEUTRAL: RGBColor = RGBColor(221, 221, 221);

/// Blue through neutral gray to orange-red for -1 to 1: the ends of the "vik" scale of scientific colour maps
/// (F. Crameri, 2018), even in lightness on both sides.
fn diverging(value: f64) -> RGBColor {
    const BLUE: [[f64; 3]; 3] = [[221.0, 221.0, 221.0], [93.0, 150.0, 190.0], [2.0, 62.0, 125.0]];
    const RED: [[f64; 3]; 3] = [[221.0, 221.0, 221.0], [214.0, 138.0, 92.0], [140.0, 45.0, 4.0]];
    let scale = if value < 0.0 { BLUE } else { RED };
    let place = value.abs().min(1.0) * 2.0;
    let (from, to, part) =
        if place < 1.0 { (scale[0], scale[1], place) } else { (scale[1], scale[2], place - 1.0) };
    let mix = |k: usize| (from[k] + (to[k] - from[k]) * part).round() as u8;
    RGBColor(mix(0), mix(1), mix(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn legends_end_on_round_numbers() {
        for (value, expected) in [(0.7, 1.0), (1.0, 1.0), (1.2, 2.0), (3.3, 5.0), (7.0, 10.0), (420.0, 500.0)]
        {
            assert!((nice_ceiling(value) - expected).abs() < 1e-9 * expected);
        }
    }

    #[test]
    fn colours_are_symmetric_in_lightness_and_neutral_at_zero() {
        let lightness =
            |c: RGBColor| 0.2126 * f64::from(c.0) + 0.7152 * f64::from(c.1) + 0.0722 * f64::from(c.2);
        assert_eq!(diverging(0.0), NEUTRAL);
        for value in [0.25, 0.5, 0.75, 1.0] {
            let (low, high) = (lightness(diverging(-value)), lightness(diverging(value)));
            assert!((low - high).abs() < 12.0, "{value}: {low} {high}");
        }
    }
}
