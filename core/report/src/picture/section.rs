//! Section of the plate under one template: profile and template above, the gap below.

use plotters::style::RGBColor;

use platen_model::{Seat, Texts};

use super::canvas::{At, Canvas, Text, draw};
use super::colour::{self, INK, PALE, STEEL, WOOD, WOOD_EDGE};
use super::scale::nice_ceiling;
use super::words;
use super::{Caption, PictureError, PictureScale, View};
use crate::result::{LineRecord, TemplateRecord};

const SIZE: (u32, u32) = (1200, 760);
const LEFT: f64 = 110.0;
const RIGHT: f64 = 1070.0;
/// Vertical extent of profile and gap, pixels from above.
const PROFILE: [f64; 2] = [200.0, 400.0];
const GAP: [f64; 2] = [470.0, 660.0];
/// Drawn heights of template and plate, pixels.
const TEMPLATE: f64 = 44.0;
const PLATE: f64 = 20.0;

/// Draws the section of the plate under a template. The sentence of the comparison stays in its language and in
/// millimetres.
///
/// # Errors
/// The drawing library fails.
pub fn section(
    line: &LineRecord,
    template: &TemplateRecord,
    caption: &Caption<'_>,
    picture_scale: &PictureScale,
    view: View,
) -> Result<String, PictureError> {
    draw(SIZE, |canvas| {
        let caption = Caption { verdict: template.verdict, ..*caption };
        let word = |text: Texts| text.of(view.language);
        let seat = match template.seat {
            Seat::Gravity => words::GRAVITY,
            Seat::Balanced => words::BALANCED,
            Seat::Held => words::HELD,
        };
        let rocks = if template.rocks { word(words::ROCKS) } else { "" };
        let chord = view.units.whole(template.chord_mm);
        let title =
            words::fill(word(words::SECTION), &[&template.name, &chord, &line.name, word(seat), rocks]);
        canvas.head(&caption, &title, view.language)?;
        canvas.text(&template.says, (24.0, 126.0), Text::new(26.0).bold())?;
        let layout = Layout { line, template, top_mm: top_of_gaps(template, picture_scale), view };
        layout.profile(canvas)?;
        layout.gap(canvas)
    })
}

/// Returns the first step of the plate's ladder above gap and limit, with a margin.
fn top_of_gaps(template: &TemplateRecord, picture_scale: &PictureScale) -> f64 {
    let most = template.gap_mm.iter().fold(template.limit_mm, |most, gap| most.max(gap.abs()));
    let wanted = 1.1 * (most + template.uncertainty_mm);
    let found = picture_scale.gaps().anchors.into_iter().find(|anchor| *anchor >= wanted);
    found.unwrap_or_else(|| nice_ceiling(wanted))
}

struct Layout<'a> {
    line: &'a LineRecord,
    template: &'a TemplateRecord,
    top_mm: f64,
    view: View,
}

impl Layout<'_> {
    fn word(&self, text: Texts) -> &'static str {
        text.of(self.view.language)
    }

    /// Returns the pixel of a share of the template's length.
    fn x(&self, share: f64) -> f64 {
        LEFT + (RIGHT - LEFT) * share
    }

    fn share(&self, sample: usize) -> f64 {
        sample as f64 / (self.template.gap_mm.len().max(2) - 1) as f64
    }

    /// Returns the position of a place of the plate along the template, 0 to 1.
    fn along(&self, [u, v]: [f64; 2]) -> Option<f64> {
        let (first, last) = (self.line.points.first()?, self.line.points.last()?);
        let (du, dv) = (last.u_mm - first.u_mm, last.v_mm - first.v_mm);
        let way = ((u - first.u_mm) * du + (v - first.v_mm) * dv) / du.hypot(dv);
        let share = (way - self.template.start_mm) / self.template.chord_mm;
        share.is_finite().then_some(share.clamp(0.0, 1.0))
    }

    /// Returns the sample nearest to a share of the template.
    fn sample(&self, share: f64) -> usize {
        (share * (self.template.gap_mm.len().max(1) - 1) as f64).round() as usize
    }

    /// Returns the colour of the gap, the same as that of the missing bend in the maps.
    fn open(&self) -> RGBColor {
        colour::diverging(0.5 * f64::from(self.template.sense))
    }

    fn profile(&self, canvas: &Canvas<'_>) -> Result<(), PictureError> {
        let Self { template, .. } = self;
        let (heights, gaps) = (&template.height_mm, &template.gap_mm);
        let edge: Vec<f64> = heights.iter().zip(gaps).map(|(height, gap)| height + gap).collect();
        let all = || heights.iter().chain(&edge).copied();
        let (low, high) = (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max));
        if heights.len() < 2 || heights.len() != gaps.len() || !(high - low).is_finite() {
            return canvas.text(self.word(words::NO_PROFILE), (LEFT, PROFILE[0]), Text::new(22.0));
        }
        let room = PROFILE[1] - PROFILE[0] - TEMPLATE - PLATE;
        let pixel_per_mm = room / (high - low).max(self.top_mm);
        let y = |mm: f64| PROFILE[1] - PLATE - (mm - low) * pixel_per_mm;
        let along = |values: &[f64]| -> Vec<At> {
            values.iter().enumerate().map(|(k, mm)| (self.x(self.share(k)), y(*mm))).collect()
        };
        let (face, edge) = (along(heights), along(&edge));
        let closed = |points: &[At], other: Vec<At>| -> Vec<At> {
            points.iter().copied().chain(other.into_iter().rev()).collect()
        };
        let top = y(high) - TEMPLATE;
        canvas.area(&closed(&edge, vec![(LEFT, top), (RIGHT, top)]), WOOD)?;
        canvas.area(&closed(&edge, face.clone()), self.open())?;
        let below = face.iter().map(|(x, y)| (*x, y + PLATE)).collect();
        canvas.area(&closed(&face, below), STEEL)?;
        canvas.line(&edge, WOOD_EDGE, 3)?;
        canvas.line(&face, INK, 3)?;
        self.unseen(canvas, |k| [y(heights[k]), y(heights[k]) + PLATE])?;
        for share in template.contacts_mm.iter().filter_map(|contact| self.along(*contact)) {
            let (x, y) = (self.x(share), y(heights[self.sample(share)]));
            canvas.area(&[(x, y + 2.0), (x - 12.0, y + 24.0), (x + 12.0, y + 24.0)], INK)?;
        }
        canvas.text(
            self.word(words::TEMPLATE),
            (LEFT + 12.0, top + 20.0),
            Text::new(20.0).coloured(WOOD_EDGE),
        )?;
        let scale = pixel_per_mm / ((RIGHT - LEFT) / template.chord_mm);
        let note = words::fill(self.word(words::ENLARGED), &[&format!("{scale:.0}")]);
        canvas.text(&note, (RIGHT, PROFILE[1] + 26.0), Text::new(20.0).coloured(PALE).right())
    }

    fn gap(&self, canvas: &Canvas<'_>) -> Result<(), PictureError> {
        let Self { template, top_mm, .. } = self;
        let low_mm = if template.gap_mm.iter().any(|gap| *gap < -1e-3) { -top_mm } else { 0.0 };
        let y =
            |mm: f64| GAP[1] - (mm.clamp(low_mm, *top_mm) - low_mm) / (top_mm - low_mm) * (GAP[1] - GAP[0]);
        let band = |offset: f64| -> Vec<At> {
            let gaps = template.gap_mm.iter().enumerate();
            gaps.map(|(k, gap)| (self.x(self.share(k)), y(gap + offset))).collect()
        };
        let (upper, lower) = (band(template.uncertainty_mm), band(-template.uncertainty_mm));
        canvas.area(&upper.into_iter().chain(lower.into_iter().rev()).collect::<Vec<_>>(), self.open())?;
        canvas.line(&band(0.0), INK, 4)?;
        self.unseen(canvas, |k| [y(template.gap_mm[k]) - 10.0, y(template.gap_mm[k]) + 10.0])?;
        self.axes(canvas, &y, low_mm)?;
        let text = Text::new(22.0);
        canvas.dashed((LEFT, y(template.limit_mm)), (RIGHT, y(template.limit_mm)), INK, 2)?;
        let units = self.view.units;
        let limit = format!("{} {}", self.word(words::LIMIT), units.number(template.limit_mm));
        canvas.text(&limit, (RIGHT + 10.0, y(template.limit_mm)), text.bold())?;
        let Some(at) = self.along(template.max_gap_at_mm) else { return Ok(()) };
        let gap = template.gap_mm.get(self.sample(at)).copied().unwrap_or(template.max_gap_mm);
        let (x, height) = (self.x(at), y(gap));
        canvas.ring((x, height), 10, INK, 4)?;
        let number = units.with_uncertainty(template.max_gap_mm, Some(template.uncertainty_mm));
        let words = format!("{number} {}", units.symbol());
        let look = Text::new(30.0).bold();
        let above = height - 32.0;
        // Placed clear of the line of the limit, and above the gap's own curve, which falls to either side of here.
        let limit = y(template.limit_mm);
        let above = if (above - limit).abs() > 22.0 { above } else { limit - 30.0 };
        let above = if above > GAP[0] - 20.0 { above } else { height + 34.0 };
        match at {
            at if at < 0.2 => canvas.text(&words, (x + 16.0, above), look),
            at if at > 0.8 => canvas.text(&words, (x - 16.0, above), look.right()),
            _ => canvas.text(&words, (x, above), look.centred()),
        }
    }

    fn axes(&self, canvas: &Canvas<'_>, y: &dyn Fn(f64) -> f64, low_mm: f64) -> Result<(), PictureError> {
        let (text, units) = (Text::new(22.0), self.view.units);
        canvas.line(&[(LEFT, GAP[0]), (LEFT, GAP[1])], INK, 2)?;
        canvas.line(&[(LEFT, y(0.0)), (RIGHT, y(0.0))], INK, 2)?;
        for mm in [low_mm, 0.0, 0.5 * self.top_mm, self.top_mm] {
            canvas.line(&[(LEFT - 8.0, y(mm)), (LEFT, y(mm))], INK, 2)?;
            canvas.text(&units.tick(mm), (LEFT - 14.0, y(mm)), text.right())?;
        }
        let title = |word: Texts| format!("{}, {}", self.word(word), units.symbol());
        canvas.text(&title(words::GAP), (LEFT - 86.0, GAP[0] - 30.0), text)?;
        let [start, chord] = [self.template.start_mm, self.template.chord_mm].map(|mm| units.of_mm(mm));
        let step = nice_ceiling(chord / 6.0);
        let first = (start / step).ceil() as i64;
        let last = ((start + chord) / step).floor() as i64;
        for k in first..=last {
            let x = self.x((k as f64 * step - start) / chord);
            canvas.line(&[(x, GAP[1]), (x, GAP[1] + 8.0)], INK, 2)?;
            canvas.text(&format!("{}", k as f64 * step), (x, GAP[1] + 24.0), text.centred())?;
        }
        let along = title(words::ALONG) + " \u{2192}";
        canvas.text(&along, (RIGHT, GAP[1] + 58.0), text.right())
    }

    /// Hatches the unseen parts.
    fn unseen(&self, canvas: &Canvas<'_>, span: impl Fn(usize) -> [f64; 2]) -> Result<(), PictureError> {
        for k in (0..self.template.seen.len()).filter(|&k| !self.template.seen[k]) {
            let ([from, to], x) = (span(k), self.x(self.share(k)));
            canvas.line(&[(x - 5.0, to), (x + 5.0, from)], PALE, 3)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use platen_model::{Language, Seat, Verdict};

    use super::*;
    use crate::picture::Units;
    use crate::result::PointRecord;

    fn template(gap_mm: Vec<f64>, seen: Vec<bool>) -> TemplateRecord {
        let n = gap_mm.len();
        TemplateRecord {
            name: "T<1>".into(),
            seat: Seat::Gravity,
            rocks: false,
            max_gap_mm: 4.1,
            uncertainty_mm: 0.2,
            max_gap_at_mm: [100.0, 0.0],
            contacts_mm: vec![[700.0, 0.0], [1500.0, 0.0]],
            start_mm: 100.0,
            chord_mm: 2000.0,
            height_mm: (0..n).map(|k| (k as f64 / n as f64 - 0.5).powi(2) * 200.0).collect(),
            seen,
            gap_mm,
            limit_mm: 3.0,
            sense: -1,
            verdict: Verdict::Fail,
            says: "not bent enough".into(),
        }
    }

    fn drawn(template: &TemplateRecord) -> String {
        drawn_in(template, View::FILE)
    }

    fn drawn_in(template: &TemplateRecord, view: View) -> String {
        let point = |u_mm: f64| PointRecord { u_mm, v_mm: 0.0, position_m: [0.0; 3], seen: true };
        let points = vec![point(0.0), point(3000.0)];
        let line = LineRecord { name: "R1".into(), points, templates: Vec::new() };
        let caption = Caption { plate: "A", stroke: None, verdict: Verdict::Pass };
        let picture_scale = PictureScale { limit_mm: 3.0, chord_mm: 2000.0, bend_per_m: 0.1 };
        section(&line, template, &caption, &picture_scale, view).unwrap()
    }

    #[test]
    fn it_shows_gap_uncertainty_limit_verdict_and_sentence() {
        let svg = drawn(&template(vec![4.1, 2.0, 0.0, 2.0, 4.0], vec![true; 5]));
        for text in ["4.1 \u{b1} 0.2 mm", "limit 3.0", "FAIL", "not bent enough", "T&lt;1&gt;"] {
            assert!(svg.contains(text), "{text}");
        }
    }

    #[test]
    fn it_is_drawn_in_japanese_and_in_inches() {
        let view = View { language: Language::Ja, units: Units::Inch, ..View::FILE };
        let svg = drawn_in(&template(vec![4.1, 2.0, 0.0, 2.0, 4.0], vec![true; 5]), view);
        // 4.1 mm, 0.2 mm rounded up, 3 mm, 2 m; a tick of the gap at 15 mm.
        for text in
            ["0.16 \u{b1} 0.01 in", "許容値 0.12", "78.74 in", "不合格", "自重", "すき間, in", "\n0.24\n"]
        {
            assert!(svg.contains(text), "{text}");
        }
        for text in [" mm", "limit", "gap", "FAIL"] {
            assert!(!svg.contains(text), "{text}");
        }
    }

    #[test]
    fn what_was_not_seen_is_hatched() {
        let gaps = vec![4.1, 2.0, 0.0, 2.0, 4.0];
        let hatches = |seen| drawn(&template(gaps.clone(), seen)).matches("#6E7278").count();
        assert_eq!(
            hatches(vec![true, false, false, true, true]),
            hatches(vec![true; 5]) + 4,
            "profile and gap"
        );
    }

    #[test]
    fn a_record_without_a_profile_is_still_a_picture() {
        let mut bare = template(Vec::new(), Vec::new());
        bare.height_mm.clear();
        assert!(drawn(&bare).contains("no profile"));
    }
}
