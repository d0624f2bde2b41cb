//! Strip of a plate's strokes so far: worst gap with its uncertainty against the limit.

use platen_model::Verdict;

use super::canvas::{Canvas, Text, draw};
use super::colour::{self, INK, PALE, PAPER};
use super::{Caption, PictureError, PictureScale, View, words};

const SIZE: (u32, u32) = (1200, 560);
const LEFT: f64 = 110.0;
const RIGHT: f64 = 1160.0;
const TOP: f64 = 130.0;
const BOTTOM: f64 = 470.0;

/// Stroke of the strip.
#[derive(Debug, Clone, PartialEq)]
pub struct StripPoint {
    /// Label below it, e.g. the stroke's number.
    pub label: String,
    /// Worst gap, `None` without a measurement.
    pub gap_mm: Option<f64>,
    /// Its expanded uncertainty (95 %).
    pub uncertainty_mm: Option<f64>,
    /// -1 not bent enough, 0 within, 1 bent too far.
    pub sense: i8,
    /// Verdict.
    pub verdict: Verdict,
}

/// Draws the strip of the strokes so far, oldest first; labels are drawn as given.
///
/// # Errors
/// The drawing library fails.
pub fn strip(
    points: &[StripPoint],
    caption: &Caption<'_>,
    picture_scale: &PictureScale,
    view: View,
) -> Result<String, PictureError> {
    let scale = picture_scale.gaps();
    let y = |mm: f64| BOTTOM - scale.position(mm.max(0.0)) * (BOTTOM - TOP);
    // A strip of few strokes keeps its spacing and does not fill the width.
    let step = (RIGHT - LEFT) / points.len().max(12) as f64;
    let x = |k: usize| LEFT + (k as f64 + 0.5) * step;
    draw(SIZE, |canvas| {
        let title = words::fill(words::STRIP.of(view.language), &[view.units.symbol()]);
        canvas.head(caption, &title, view.language)?;
        canvas.fill((LEFT, y(picture_scale.limit_mm)), (RIGHT, BOTTOM), colour::diverging(0.0))?;
        axes(canvas, &y, picture_scale, view)?;
        let known = |k: usize| points[k].gap_mm.map(|gap| (x(k), y(gap)));
        for k in 1..points.len() {
            if let (Some(from), Some(to)) = (known(k - 1), known(k)) {
                canvas.line(&[from, to], PALE, 2)?;
            }
        }
        for (k, point) in points.iter().enumerate() {
            draw_point(canvas, point, x(k), &y)?;
            // Labels do not overlap, however many strokes there are.
            let every = (34.0 / step).ceil() as usize;
            if (points.len() - 1 - k).is_multiple_of(every) {
                canvas.text(&point.label, (x(k), BOTTOM + 24.0), Text::new(22.0).centred())?;
            }
        }
        if let Some((k, newest)) = points.iter().enumerate().next_back() {
            draw_newest(canvas, newest, x(k), &y, view)?;
        }
        let along = format!("{} \u{2192}", words::STROKE.of(view.language));
        canvas.text(&along, (RIGHT, BOTTOM + 58.0), Text::new(22.0).right())
    })
}

fn axes(
    canvas: &Canvas<'_>,
    y: &dyn Fn(f64) -> f64,
    picture_scale: &PictureScale,
    view: View,
) -> Result<(), PictureError> {
    let text = Text::new(22.0);
    canvas.line(&[(LEFT, TOP), (LEFT, BOTTOM), (RIGHT, BOTTOM)], INK, 2)?;
    for mm in std::iter::once(0.0).chain(picture_scale.gaps().anchors) {
        canvas.line(&[(LEFT - 8.0, y(mm)), (LEFT, y(mm))], INK, 2)?;
        canvas.text(&view.units.tick(mm), (LEFT - 14.0, y(mm)), text.right())?;
    }
    let limit = y(picture_scale.limit_mm);
    canvas.dashed((LEFT, limit), (RIGHT, limit), INK, 2)?;
    canvas.text(words::LIMIT.of(view.language), (RIGHT - 8.0, limit - 15.0), text.bold().right())
}

fn draw_point(
    canvas: &Canvas<'_>,
    point: &StripPoint,
    x: f64,
    y: &dyn Fn(f64) -> f64,
) -> Result<(), PictureError> {
    let Some(gap) = point.gap_mm else {
        let (cross, at) = (9.0, BOTTOM - 18.0);
        canvas.line(&[(x - cross, at - cross), (x + cross, at + cross)], INK, 4)?;
        return canvas.line(&[(x - cross, at + cross), (x + cross, at - cross)], INK, 4);
    };
    if let Some(uncertainty) = point.uncertainty_mm {
        let (high, low) = (y(gap + uncertainty), y(gap - uncertainty));
        canvas.line(&[(x, high), (x, low)], INK, 3)?;
        for end in [high, low] {
            canvas.line(&[(x - 8.0, end), (x + 8.0, end)], INK, 3)?;
        }
    }
    let colour = match (point.verdict, point.sense) {
        (Verdict::Pass, _) => INK,
        (_, 0) => PAPER,
        (_, sense) => colour::diverging(0.75 * f64::from(sense)),
    };
    canvas.dot((x, y(gap)), 11, colour)?;
    canvas.ring((x, y(gap)), 11, INK, 3)
}

/// Rings the newest stroke and writes its gap and verdict.
fn draw_newest(
    canvas: &Canvas<'_>,
    point: &StripPoint,
    x: f64,
    y: &dyn Fn(f64) -> f64,
    view: View,
) -> Result<(), PictureError> {
    let Some(gap) = point.gap_mm else { return Ok(()) };
    let number = view.units.with_uncertainty(gap, point.uncertainty_mm);
    let verdict = words::verdict(point.verdict).of(view.language);
    let words = format!("{number} {}, {verdict}", view.units.symbol());
    canvas.ring((x, y(gap)), 17, INK, 3)?;
    // Gaps decrease: the upper right corner stays free.
    canvas.text(&words, (RIGHT, TOP + 4.0), Text::new(34.0).bold().right())
}

#[cfg(test)]
mod tests {
    use platen_model::Language;

    use super::*;
    use crate::picture::Units;

    fn point(label: usize, gap_mm: Option<f64>, verdict: Verdict) -> StripPoint {
        StripPoint { label: label.to_string(), gap_mm, uncertainty_mm: Some(0.2), sense: -1, verdict }
    }

    fn drawn(points: &[StripPoint]) -> String {
        drawn_in(points, View::FILE)
    }

    fn drawn_in(points: &[StripPoint], view: View) -> String {
        let caption = Caption { plate: "A", stroke: Some(2), verdict: Verdict::Pass };
        let scale = PictureScale { limit_mm: 3.0, chord_mm: 2000.0, bend_per_m: 0.1 };
        strip(points, &caption, &scale, view).unwrap()
    }

    #[test]
    fn it_shows_the_newest_gap_and_keeps_its_scale() {
        let few = drawn(&[point(1, Some(60.0), Verdict::Fail), point(2, Some(2.2), Verdict::Pass)]);
        assert!(few.contains("2.2 \u{b1} 0.2 mm, pass"));
        let small = drawn(&[point(1, Some(0.5), Verdict::Pass)]);
        assert!(small.contains("150") && few.contains("150"), "the axis does not follow the data");
    }

    #[test]
    fn it_is_drawn_in_japanese_and_in_inches() {
        let view = View { language: Language::Ja, units: Units::Inch, ..View::FILE };
        let svg = drawn_in(&[point(1, Some(60.0), Verdict::Fail), point(2, Some(2.2), Verdict::Pass)], view);
        for text in ["0.09 \u{b1} 0.01 in, 合格", "許容値", "ストローク", "\n5.91\n"] {
            assert!(svg.contains(text), "{text}");
        }
        assert!(!svg.contains("limit") && !svg.contains(" mm"));
    }

    #[test]
    fn a_stroke_without_measurement_is_a_cross_not_a_gap_of_zero() {
        let crosses = |svg: &str| svg.matches("stroke-width=\"32\"").count();
        let all = drawn(&[point(1, Some(60.0), Verdict::Fail), point(2, Some(2.2), Verdict::Pass)]);
        let lost = drawn(&[point(1, None, Verdict::NotMeasured), point(2, Some(2.2), Verdict::Pass)]);
        assert_eq!(crosses(&lost), crosses(&all) + 2);
    }

    #[test]
    fn many_strokes_keep_their_labels_apart() {
        let points: Vec<StripPoint> = (1..=120).map(|k| point(k, Some(10.0), Verdict::Fail)).collect();
        let svg = drawn(&points);
        assert!(svg.contains("120") && !svg.contains("\n119\n"));
    }
}
