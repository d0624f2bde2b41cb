//! Map of a field over the plate's rectangle (u, v).

use platen_model::{Field, NodeState};

use super::canvas::{At, Canvas, Text, draw};
use super::colour::{self, INK, PALE};
use super::scale::{Scale, nice_ceiling};
use super::shades::{self, Shades};
use super::{Caption, PictureError, PictureScale};
use crate::result::{CURVATURE_DEFICIT, Next, NextPlace, PlateRecord};

/// Width of the picture and of the plate in it, pixels; a tall plate is drawn narrower.
const WIDTH: u32 = 1200;
const PLATE: (f64, f64) = (810.0, 760.0);
/// Upper left corner of the plate, pixels.
const LEFT: f64 = 110.0;
const TOP: f64 = 128.0;
/// Height below the plate for ticks and their title, pixels.
const BELOW: f64 = 92.0;
/// Least height of the plate for the legend beside it, pixels.
const LEAST_HEIGHT: f64 = 420.0;
/// Side of the squares of which the map consists, pixels.
const SQUARE: f64 = 4.0;
/// Parts of the plate with their mean written on them, along u and v.
const PARTS: [usize; 2] = [5, 4];

/// Draws one field over the plate. The map of the missing curvature frames the place of the next hit.
///
/// # Errors
/// The drawing library fails.
pub fn map(
    field: &Field,
    plate: &PlateRecord,
    caption: &Caption<'_>,
    picture_scale: &PictureScale,
    next: Option<&Next>,
) -> Result<String, PictureError> {
    let largest = (0..field.state.len())
        .filter(|&node| field.state[node] != NodeState::Unseen)
        .map(|node| field.values[node].abs())
        .fold(0.0, f64::max);
    let (title, scale) = picture_scale.field(&field.name, &field.unit, largest);
    let by_width = PLATE.0 / plate.width_mm;
    let pixel_per_mm = by_width.min(PLATE.1 / plate.height_mm);
    let layout = Layout { plate, pixel_per_mm, scale };
    let height = (plate.height_mm * pixel_per_mm).max(LEAST_HEIGHT) + TOP + BELOW;
    draw((WIDTH, height as u32), |canvas| {
        canvas.head(caption, &title)?;
        let squares = [plate.width_mm, plate.height_mm].map(|mm| layout.squares(mm));
        let corners = [layout.at(0.0, plate.height_mm), layout.at(plate.width_mm, 0.0)];
        Shades::of(field, &layout.scale, squares).paint(canvas, corners[0], corners[1])?;
        layout.axes(canvas)?;
        part_means(field, &layout, canvas)?;
        if let Some(place) = next.and_then(Next::place).filter(|_| field.name == CURVATURE_DEFICIT) {
            next_place(place, field, &layout, canvas)?;
        }
        layout.legend(canvas, field)
    })
}

struct Layout<'a> {
    plate: &'a PlateRecord,
    pixel_per_mm: f64,
    scale: Scale,
}

impl Layout<'_> {
    fn at(&self, u_mm: f64, v_mm: f64) -> At {
        (LEFT + u_mm * self.pixel_per_mm, TOP + (self.plate.height_mm - v_mm) * self.pixel_per_mm)
    }

    fn squares(&self, mm: f64) -> usize {
        ((mm * self.pixel_per_mm / SQUARE).round() as usize).max(1)
    }

    fn axes(&self, canvas: &Canvas<'_>) -> Result<(), PictureError> {
        let (w, h) = (self.plate.width_mm, self.plate.height_mm);
        canvas.frame(self.at(0.0, h), self.at(w, 0.0), INK, 3)?;
        let step = nice_ceiling(w.max(h) / 7.0);
        let tick = Text::new(22.0).coloured(INK);
        for k in 1..=(w / step) as u32 {
            let (x, y) = self.at(f64::from(k) * step, 0.0);
            canvas.line(&[(x, y), (x, y + 8.0)], INK, 2)?;
            canvas.text(&format!("{}", f64::from(k) * step), (x, y + 24.0), tick.centred())?;
        }
        for k in 1..=(h / step) as u32 {
            let (x, y) = self.at(0.0, f64::from(k) * step);
            canvas.line(&[(x, y), (x - 8.0, y)], INK, 2)?;
            canvas.text(&format!("{}", f64::from(k) * step), (x - 14.0, y), tick.right())?;
        }
        let (x, y) = self.at(w, 0.0);
        canvas.text("u, mm \u{2192}", (x, y + 56.0), tick.right())?;
        let (x, y) = self.at(0.0, h);
        canvas.text("v, mm \u{2191}", (x - 14.0, y - 16.0), tick.right())?;
        self.corner(canvas)?;
        self.press(canvas)
    }

    /// Draws the mark of the corner (0, 0).
    fn corner(&self, canvas: &Canvas<'_>) -> Result<(), PictureError> {
        let (x, y) = self.at(0.0, 0.0);
        canvas.area(&[(x, y), (x + 34.0, y), (x, y - 34.0)], INK)?;
        canvas.text("(0, 0)", (x - 14.0, y + 24.0), Text::new(22.0).bold().right())
    }

    /// Draws a bar along the edge that faces the press.
    fn press(&self, canvas: &Canvas<'_>) -> Result<(), PictureError> {
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
        canvas.fill(from, to, INK)?;
        canvas.text("press", label, Text::new(22.0).bold().centred())
    }

    fn legend(&self, canvas: &Canvas<'_>, field: &Field) -> Result<(), PictureError> {
        let (left, wide) = (LEFT + PLATE.0 + 44.0, 46.0);
        let steps = shades::count(&self.scale);
        let (top, tall) = (TOP + 64.0, LEAST_HEIGHT - 130.0);
        let y = |position: f64| top + (1.0 - position) / 2.0 * tall;
        for shade in -steps..steps {
            let position = (f64::from(shade) + 0.5) / f64::from(steps);
            let colour = shades::colour_of(shades::shade_of(self.scale.of_colour(position), steps), steps);
            let (low, high) = (f64::from(shade) / f64::from(steps), f64::from(shade + 1) / f64::from(steps));
            canvas.fill((left, y(high)), (left + wide, y(low) + shades::OVERLAP), colour)?;
        }
        canvas.frame((left, top), (left + wide, top + tall), INK, 2)?;
        let text = Text::new(22.0);
        let n = self.scale.anchors.len() as f64;
        let ends = self.scale.anchors.iter().enumerate().map(|(k, value)| ((k + 1) as f64 / n, *value));
        let both = ends.flat_map(|(position, value)| [(position, value), (-position, -value)]);
        for (position, value) in both.chain([(0.0, 0.0)]) {
            canvas.line(&[(left + wide, y(position)), (left + wide + 8.0, y(position))], INK, 2)?;
            canvas.text(&self.scale.number(value), (left + wide + 14.0, y(position)), text)?;
        }
        canvas.text(self.scale.unit, (left, TOP + 10.0), text.bold())?;
        let [less, more] = self.scale.words.unwrap_or(["", ""]);
        canvas.text(more, (left, top - 22.0), text.bold())?;
        canvas.text(less, (left, top + tall + 20.0), text.bold())?;
        self.keys(canvas, field, (left, top + tall + 58.0))
    }

    /// Draws the keys of gray and hatching, where the map has them, and of the numbers.
    fn keys(&self, canvas: &Canvas<'_>, field: &Field, (left, mut y): At) -> Result<(), PictureError> {
        let has = |state: NodeState| field.state.contains(&state);
        let side = 26.0;
        if has(NodeState::Unchanged) {
            canvas.fill((left, y - side / 2.0), (left + side, y + side / 2.0), colour::diverging(0.0))?;
            canvas.frame((left, y - side / 2.0), (left + side, y + side / 2.0), INK, 1)?;
            let word = if self.scale.words.is_some() { "enough" } else { "no change" };
            canvas.text(word, (left + side + 10.0, y), Text::new(22.0))?;
            y += 36.0;
        }
        if has(NodeState::Unseen) {
            for k in 0..3 {
                let s = 6.0 + 10.0 * f64::from(k);
                canvas.line(&[(left, y - side / 2.0 + s), (left + s, y - side / 2.0)], PALE, 2)?;
            }
            canvas.frame((left, y - side / 2.0), (left + side, y + side / 2.0), INK, 1)?;
            canvas.text("no data", (left + side + 10.0, y), Text::new(22.0))?;
            y += 36.0;
        }
        canvas.text("numbers: means", (left, y), Text::new(22.0))
    }
}

/// Writes the field's mean on each part of the plate.
fn part_means(field: &Field, layout: &Layout<'_>, canvas: &Canvas<'_>) -> Result<(), PictureError> {
    let [n_u, n_v] = PARTS.map(|n| n as f64);
    let digits = Text::new(27.0).bold().centred();
    for (column, row) in (0..PARTS[0] * PARTS[1]).map(|k| (k % PARTS[0], k / PARTS[0])) {
        let share = [(column as f64 + 0.5) / n_u, (row as f64 + 0.5) / n_v];
        let Some((mean, beneath)) = mean(field, column, row).zip(shade_at(field, &layout.scale, share))
        else {
            continue;
        };
        let at = layout.at(share[0] * layout.plate.width_mm, share[1] * layout.plate.height_mm);
        let number = layout.scale.number(mean * layout.scale.factor);
        canvas.text(&number, at, digits.coloured(colour::text_on(beneath)))?;
    }
    Ok(())
}

/// Frames the place of the next hit and names it inside the frame, away from the rows of the means.
fn next_place(
    place: &NextPlace,
    field: &Field,
    layout: &Layout<'_>,
    canvas: &Canvas<'_>,
) -> Result<(), PictureError> {
    let ([u, v], [w, h]) = (place.at_mm, place.extent_mm.map(|mm| 0.5 * mm));
    let (from, to) = (layout.at(u - w, v + h), layout.at(u + w, v - h));
    canvas.frame(from, to, INK, 4)?;
    let row_height = layout.plate.height_mm * layout.pixel_per_mm / PARTS[1] as f64;
    let to_a_mean = |y: f64| (((y - TOP) / row_height).fract() - 0.5).abs();
    let (low, high) = (to.1 - 20.0, from.1 + 20.0);
    let y = if to_a_mean(low) >= to_a_mean(high) { low } else { high };
    let share = [u / layout.plate.width_mm, 1.0 - (y - TOP) / (layout.plate.height_mm * layout.pixel_per_mm)];
    let beneath = shade_at(field, &layout.scale, share).unwrap_or(0.0);
    let look = Text::new(22.0).bold().centred().coloured(colour::text_on(beneath));
    canvas.text("next hit", (0.5 * (from.0 + to.0), y), look)
}

/// Returns the position of the shade at a share of the plate's sides; `None` where unseen.
fn shade_at(field: &Field, scale: &Scale, [u, v]: [f64; 2]) -> Option<f64> {
    match field.sample(u, v, 0) {
        (NodeState::Seen, value) => Some(scale.position(value * scale.factor)),
        (NodeState::Unchanged, _) => Some(0.0),
        (NodeState::Unseen, _) => None,
    }
}

/// Returns the mean over the seen nodes of a part of the plate; `None` when fewer than half were seen, or most are unchanged.
fn mean(field: &Field, i: usize, k: usize) -> Option<f64> {
    let [n_u, n_v] = field.nodes;
    let range = |part: usize, parts: usize, n: usize| part * n / parts..(part + 1) * n / parts;
    let (mut all, mut seen, mut gray, mut sum) = (0, 0, 0, 0.0);
    for row in range(k, PARTS[1], n_v) {
        for column in range(i, PARTS[0], n_u) {
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
    use platen_model::Verdict;

    use super::*;
    use crate::result::NoNext;

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
        framed(field, None)
    }

    fn framed(field: &Field, next: Option<&Next>) -> String {
        let plate = PlateRecord { width_mm: 3000.0, height_mm: 2500.0, ..PlateRecord::default() };
        let caption = Caption { plate: "A<7>", stroke: Some(7), verdict: Verdict::Fail };
        let picture_scale = PictureScale { limit_mm: 3.0, chord_mm: 2000.0, bend_per_m: 0.1 };
        map(field, &plate, &caption, &picture_scale, next).unwrap()
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
    fn the_place_of_the_next_hit_is_framed_on_the_map_of_the_missing_curvature_alone() {
        let next = Next::Place(NextPlace {
            at_mm: [2000.0, 1000.0],
            extent_mm: [600.0, 800.0],
            gap_mm: 20.0,
            uncertainty_mm: None,
            limit_mm: 3.0,
            chord_mm: 2000.0,
        });
        let deficit = field(CURVATURE_DEFICIT, "1/m", |_, _| 0.04, false);
        // 0.27 pixels a millimetre, 8 units a pixel; u from the left, v from below.
        let corner = |u: f64, v: f64| {
            let [x, y] = [LEFT + 0.27 * u, TOP + 0.27 * (2500.0 - v)].map(|pixel| (8.0 * pixel).round());
            format!("{x},{y}")
        };
        let svg = framed(&deficit, Some(&next));
        for place in [corner(1700.0, 600.0), corner(2300.0, 600.0), corner(1700.0, 1400.0)] {
            assert!(svg.contains(&place), "{place}");
        }
        assert!(svg.contains("next hit"));
        for other in [
            framed(&deficit, None),
            framed(&deficit, Some(&Next::Nowhere { none: NoNext::NothingStandsOut })),
            framed(&field("deviation", "m", |_, _| 0.04, false), Some(&next)),
        ] {
            assert!(!other.contains("next hit") && !other.contains(&corner(1700.0, 600.0)));
        }
    }
}
