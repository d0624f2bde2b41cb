//! A field over the plate's own rectangle.

use platen_model::Verdict;

use super::colour::{self, INK, PALE};
use super::page::{At, Page, Text, draw};
use super::scale::{Scale, nice_ceiling};
use super::shades::{self, Shades};
use super::{Caption, PictureError, Yardstick};
use crate::result::PlateRecord;
use platen_model::{Field, NodeState};

/// Width of the picture and of the plate in it, pixels; a tall plate is drawn narrower.
const WIDTH: u32 = 1200;
const PLATE: (f64, f64) = (810.0, 760.0);
/// Where the plate's upper left corner lies.
const LEFT: f64 = 110.0;
const TOP: f64 = 128.0;
/// Below the plate: ticks and their title.
const BELOW: f64 = 92.0;
/// Least height of the plate, for the legend beside it.
const LEAST_HEIGHT: f64 = 420.0;
/// Side of the squares that the field is drawn with, pixels.
const SQUARE: f64 = 4.0;
/// Numbers written on the plate, along u and v.
const CODES: [usize; 2] = [5, 4];

/// A map of one field over the plate.
///
/// # Errors
/// When the drawing library fails.
pub fn map(
    field: &Field,
    plate: &PlateRecord,
    caption: &Caption<'_>,
    yardstick: &Yardstick,
) -> Result<String, PictureError> {
    let largest = (0..field.state.len())
        .filter(|&node| field.state[node] != NodeState::Unseen)
        .map(|node| field.values[node].abs())
        .fold(0.0, f64::max);
    let (what, scale) = yardstick.field(&field.name, &field.unit, largest);
    let by_width = PLATE.0 / plate.width_mm;
    let pixel_per_mm = by_width.min(PLATE.1 / plate.height_mm);
    let sheet = Sheet { plate, pixel_per_mm, scale };
    let height = (plate.height_mm * pixel_per_mm).max(LEAST_HEIGHT) + TOP + BELOW;
    draw((WIDTH, height as u32), |page| {
        page.head(caption, &what)?;
        let squares = [plate.width_mm, plate.height_mm].map(|mm| sheet.squares(mm));
        let corners = [sheet.at(0.0, plate.height_mm), sheet.at(plate.width_mm, 0.0)];
        Shades::of(field, &sheet.scale, squares).paint(page, corners[0], corners[1])?;
        sheet.axes(page)?;
        codes(field, &sheet, page, caption.verdict == Verdict::Pass)?;
        sheet.legend(page, field)
    })
}

/// Where everything lies.
struct Sheet<'a> {
    plate: &'a PlateRecord,
    pixel_per_mm: f64,
    scale: Scale,
}

impl Sheet<'_> {
    fn at(&self, u_mm: f64, v_mm: f64) -> At {
        (LEFT + u_mm * self.pixel_per_mm, TOP + (self.plate.height_mm - v_mm) * self.pixel_per_mm)
    }

    fn squares(&self, mm: f64) -> usize {
        ((mm * self.pixel_per_mm / SQUARE).round() as usize).max(1)
    }

    fn axes(&self, page: &Page<'_>) -> Result<(), PictureError> {
        let (w, h) = (self.plate.width_mm, self.plate.height_mm);
        page.frame(self.at(0.0, h), self.at(w, 0.0), INK, 3)?;
        let step = nice_ceiling(w.max(h) / 7.0);
        let tick = Text::new(22.0).coloured(INK);
        for k in 1..=(w / step) as u32 {
            let (x, y) = self.at(f64::from(k) * step, 0.0);
            page.line(&[(x, y), (x, y + 8.0)], INK, 2)?;
            page.text(&format!("{}", f64::from(k) * step), (x, y + 24.0), tick.centred())?;
        }
        for k in 1..=(h / step) as u32 {
            let (x, y) = self.at(0.0, f64::from(k) * step);
            page.line(&[(x, y), (x - 8.0, y)], INK, 2)?;
            page.text(&format!("{}", f64::from(k) * step), (x - 14.0, y), tick.right())?;
        }
        let (x, y) = self.at(w, 0.0);
        page.text("u, mm \u{2192}", (x, y + 56.0), tick.right())?;
        let (x, y) = self.at(0.0, h);
        page.text("v, mm \u{2191}", (x - 14.0, y - 16.0), tick.right())?;
        self.corner(page)?;
        self.press(page)
    }

    /// The corner where u and v begin, as it is marked on the plate.
    fn corner(&self, page: &Page<'_>) -> Result<(), PictureError> {
        let (x, y) = self.at(0.0, 0.0);
        page.area(&[(x, y), (x + 34.0, y), (x, y - 34.0)], INK)?;
        page.text("(0, 0)", (x - 14.0, y + 24.0), Text::new(22.0).bold().right())
    }

    /// A bar along the side that faces the press.
    fn press(&self, page: &Page<'_>) -> Result<(), PictureError> {
        const BAR: f64 = 12.0;
        let (w, h) = (self.plate.width_mm, self.plate.height_mm);
        let (from, to, label) = match self.plate.press_side {
            None => return Ok(()),
            Some([_, v]) if v < 0 => {
                let ((x0, y), (x1, _)) = (self.at(0.0, 0.0), self.at(w, 0.0));
                ((x0, y), (x1, y + BAR), (0.5 * (x0 + x1), y + 56.0))
            }
            Some([_, v]) if v > 0 => {
                let ((x0, y), (x1, _)) = (self.at(0.0, h), self.at(w, h));
                ((x0, y - BAR), (x1, y), (0.5 * (x0 + x1), y - 26.0))
            }
            Some([u, _]) => {
                let ((x, y0), (_, y1)) = if u < 0 {
                    (self.at(0.0, h), self.at(0.0, 0.0))
                } else {
                    (self.at(w, h), self.at(w, 0.0))
                };
                let (a, b) = if u < 0 { (x - BAR, x) } else { (x, x + BAR) };
                ((a, y0), (b, y1), (0.5 * (a + b), y0 - 26.0))
            }
        };
        page.fill(from, to, INK)?;
        page.text("press", label, Text::new(22.0).bold().centred())
    }

    fn legend(&self, page: &Page<'_>, field: &Field) -> Result<(), PictureError> {
        let (left, wide) = (LEFT + PLATE.0 + 44.0, 46.0);
        let steps = shades::count(&self.scale);
        let (top, tall) = (TOP + 64.0, LEAST_HEIGHT - 130.0);
        let y = |position: f64| top + (1.0 - position) / 2.0 * tall;
        for shade in -steps..steps {
            let position = (f64::from(shade) + 0.5) / f64::from(steps);
            let colour = shades::colour_of(shades::shade_of(self.scale.turn(position), steps), steps);
            let (low, high) = (f64::from(shade) / f64::from(steps), f64::from(shade + 1) / f64::from(steps));
            page.fill((left, y(high)), (left + wide, y(low) + shades::OVERLAP), colour)?;
        }
        page.frame((left, top), (left + wide, top + tall), INK, 2)?;
        let text = Text::new(22.0);
        let n = self.scale.anchors.len() as f64;
        let ends = self.scale.anchors.iter().enumerate().map(|(k, value)| ((k + 1) as f64 / n, *value));
        let both = ends.flat_map(|(position, value)| [(position, value), (-position, -value)]);
        for (position, value) in both.chain([(0.0, 0.0)]) {
            page.line(&[(left + wide, y(position)), (left + wide + 8.0, y(position))], INK, 2)?;
            page.text(&self.scale.number(value), (left + wide + 14.0, y(position)), text)?;
        }
        page.text(self.scale.unit, (left, TOP + 10.0), text.bold())?;
        let [less, more] = self.scale.words.unwrap_or(["", ""]);
        page.text(more, (left, top - 22.0), text.bold())?;
        page.text(less, (left, top + tall + 20.0), text.bold())?;
        self.keys(page, field, (left, top + tall + 58.0))
    }

    /// What gray and hatching mean, where the map has them, and the numbers on it.
    fn keys(&self, page: &Page<'_>, field: &Field, (left, mut y): At) -> Result<(), PictureError> {
        let has = |state: NodeState| field.state.contains(&state);
        let side = 26.0;
        if has(NodeState::Unchanged) {
            page.fill((left, y - side / 2.0), (left + side, y + side / 2.0), colour::diverging(0.0))?;
            page.frame((left, y - side / 2.0), (left + side, y + side / 2.0), INK, 1)?;
            let word = if self.scale.words.is_some() { "enough" } else { "no change" };
            page.text(word, (left + side + 10.0, y), Text::new(22.0))?;
            y += 36.0;
        }
        if has(NodeState::Unseen) {
            for k in 0..3 {
                let s = 6.0 + 10.0 * f64::from(k);
                page.line(&[(left, y - side / 2.0 + s), (left + s, y - side / 2.0)], PALE, 2)?;
            }
            page.frame((left, y - side / 2.0), (left + side, y + side / 2.0), INK, 1)?;
            page.text("no data", (left + side + 10.0, y), Text::new(22.0))?;
            y += 36.0;
        }
        page.text("numbers: means", (left, y), Text::new(22.0))
    }
}

/// One of the parts that the plate is divided into for numbers.
struct Part {
    column: usize,
    row: usize,
    /// In the legend's unit.
    mean: f64,
    /// Shade under its number.
    beneath: f64,
}

/// The field's mean over each part of the plate, in digits. Unless the plate is done, the part that is farthest from it is
/// framed and named: what passes under its boards may still be a little off beyond their ends, and asks for nothing.
fn codes(field: &Field, sheet: &Sheet<'_>, page: &Page<'_>, done: bool) -> Result<(), PictureError> {
    let (w, h) = (sheet.plate.width_mm / CODES[0] as f64, sheet.plate.height_mm / CODES[1] as f64);
    let part = |k: usize| {
        let (column, row) = (k % CODES[0], k / CODES[0]);
        let beneath = shade_at(field, &sheet.scale, (column as f64 + 0.5, row as f64 + 0.5))?;
        let mean = mean(field, column, row)? * sheet.scale.factor;
        Some(Part { column, row, mean, beneath })
    };
    let parts: Vec<Part> = (0..CODES[0] * CODES[1]).filter_map(part).collect();
    let digits = Text::new(27.0).bold().centred();
    for part in &parts {
        let at = sheet.at((part.column as f64 + 0.5) * w, (part.row as f64 + 0.5) * h);
        page.text(&sheet.scale.number(part.mean), at, digits.coloured(colour::text_on(part.beneath)))?;
    }
    let Some(words) = sheet.scale.words.filter(|_| !done) else { return Ok(()) };
    let worst = parts.iter().max_by(|a, b| a.mean.abs().total_cmp(&b.mean.abs()));
    let Some(worst) = worst.filter(|part| part.mean.abs() > sheet.scale.anchors[0]) else { return Ok(()) };
    let inset = 3.0 / sheet.pixel_per_mm;
    let (i, k) = (worst.column as f64, worst.row as f64);
    let (from, to) =
        (sheet.at(i * w + inset, (k + 1.0) * h - inset), sheet.at((i + 1.0) * w - inset, k * h + inset));
    page.frame(from, to, INK, 4)?;
    // At the part's lower side, where the shade may be another than under its number.
    let (below, row) = ((0.5 * (from.0 + to.0), to.1 - 20.0), k + (inset + 20.0 / sheet.pixel_per_mm) / h);
    let beneath = shade_at(field, &sheet.scale, (i + 0.5, row)).unwrap_or(worst.beneath);
    let look = Text::new(22.0).bold().centred().coloured(colour::text_on(beneath));
    page.text(words[usize::from(worst.mean > 0.0)], below, look)
}

/// The shade at a place given in parts of the plate along u and v; `None` where nothing was seen.
fn shade_at(field: &Field, scale: &Scale, (column, row): (f64, f64)) -> Option<f64> {
    match field.sample(column / CODES[0] as f64, row / CODES[1] as f64, 0) {
        (NodeState::Seen, value) => Some(scale.position(value * scale.factor)),
        (NodeState::Unchanged, _) => Some(0.0),
        (NodeState::Unseen, _) => None,
    }
}

/// Mean over the known nodes of a part of the plate; `None` when fewer than half were seen, or most show no change.
fn mean(field: &Field, i: usize, k: usize) -> Option<f64> {
    let [n_u, n_v] = field.nodes;
    let range = |part: usize, parts: usize, n: usize| part * n / parts..(part + 1) * n / parts;
    let (mut all, mut seen, mut gray, mut sum) = (0, 0, 0, 0.0);
    for row in range(k, CODES[1], n_v) {
        for column in range(i, CODES[0], n_u) {
            let node = row * n_u + column;
            all += 1;
            if field.state[node] != NodeState::Unseen {
                seen += 1;
                gray += i32::from(field.state[node] == NodeState::Unchanged);
                sum += field.values[node];
            }
        }
    }
    (2 * seen >= all && seen > 2 * gray).then(|| sum / f64::from(seen))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: usize = 21;

    fn field(name: &str, unit: &str, value: impl Fn(f64, f64) -> f64, hole: bool) -> Field {
        let at = |k: usize| ((k % SIDE) as f64 / (SIDE - 1) as f64, (k / SIDE) as f64 / (SIDE - 1) as f64);
        let state = |(u, v): (f64, f64)| match hole && (u - 0.5).hypot(v - 0.5) < 0.2 {
            true => NodeState::Unseen,
            false => NodeState::Seen,
        };
        Field {
            name: name.into(),
            unit: unit.into(),
            nodes: [SIDE, SIDE],
            components: 1,
            values: (0..SIDE * SIDE).map(at).map(|(u, v)| value(u, v)).collect(),
            state: (0..SIDE * SIDE).map(at).map(state).collect(),
        }
    }

    fn drawn(field: &Field) -> String {
        let plate = PlateRecord { width_mm: 3000.0, height_mm: 2500.0, ..PlateRecord::default() };
        let caption = Caption { plate: "A<7>", stroke: Some(7), verdict: Verdict::Fail };
        let yardstick = Yardstick { limit_mm: 3.0, chord_mm: 2000.0, bend_per_m: 0.1 };
        map(field, &plate, &caption, &yardstick).unwrap()
    }

    /// The part of the picture that is the legend's numbers.
    fn legend(svg: &str) -> Vec<&str> {
        svg.lines().filter(|line| line.contains('+') || line.contains('\u{2212}')).collect()
    }

    #[test]
    fn the_plates_name_cannot_break_the_picture() {
        assert!(drawn(&field("deviation", "m", |u, _| u, false)).contains("A&lt;7&gt;"));
    }

    #[test]
    fn small_and_large_strokes_have_the_same_legend() {
        let [small, large] = [1e-3, 1e-1].map(|size| drawn(&field("deviation", "m", |u, _| -size * u, true)));
        for number in ["+3.0", "+150", "\u{2212}150"] {
            assert!(legend(&small).contains(&number) && legend(&large).contains(&number), "{number}");
        }
    }

    #[test]
    fn what_was_not_seen_is_hatched_and_named() {
        let whole = drawn(&field("deviation", "m", |u, _| u, false));
        let holed = drawn(&field("deviation", "m", |u, _| u, true));
        assert!(!whole.contains("no data") && holed.contains("no data"));
        let hatches = |svg: &str| svg.matches("#6E7278").count();
        assert!(hatches(&holed) > hatches(&whole) + 20, "{} {}", hatches(&holed), hatches(&whole));
    }

    #[test]
    fn the_worst_part_is_told_in_words_and_only_beyond_the_limit() {
        let per_mm = 0.006 / 3.0;
        let much = drawn(&field("curvature_deficit", "1/m", |u, _| 40.0 * per_mm * u, false));
        assert!(much.matches("bend more").count() == 2, "legend and plate");
        let done = drawn(&field("curvature_deficit", "1/m", |u, _| 2.0 * per_mm * u, false));
        assert!(done.matches("bend more").count() == 1, "legend alone");
    }
}
