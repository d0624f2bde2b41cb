//! Legend of a map: colours with their numbers, and the keys of gray, hatching and marks.

use platen_model::{Field, NodeState};

use super::layout::{LEAST_HEIGHT, Layout, PLATE};
use crate::picture::canvas::{At, Canvas};
use crate::picture::colour::{self, INK, PALE};
use crate::picture::shades;
use crate::picture::{PictureError, words};

pub(super) fn draw(field: &Field, layout: &Layout<'_>, canvas: &Canvas<'_>) -> Result<(), PictureError> {
    let (scale, view, letters) = (&layout.scale, layout.view, layout.look.letters);
    let (left, wide) = (layout.look.left + PLATE[0] + 44.0, 46.0 * letters);
    let steps = shades::count(scale);
    let (top, tall) = (layout.look.top + 64.0 * letters, (LEAST_HEIGHT - 130.0) * letters);
    let y = |position: f64| top + (1.0 - position) / 2.0 * tall;
    for shade in -steps..steps {
        let position = (f64::from(shade) + 0.5) / f64::from(steps);
        let colour = shades::colour_of(shades::shade_of(scale.of_colour(position), steps), steps);
        let (low, high) = (f64::from(shade) / f64::from(steps), f64::from(shade + 1) / f64::from(steps));
        canvas.fill((left, y(high)), (left + wide, y(low) + shades::OVERLAP), colour)?;
    }
    canvas.frame((left, top), (left + wide, top + tall), INK, 2)?;
    let text = layout.text();
    let n = scale.anchors.len() as f64;
    let ends = scale.anchors.iter().enumerate().map(|(k, value)| ((k + 1) as f64 / n, *value));
    let both = ends.flat_map(|(position, value)| [(position, value), (-position, -value)]);
    for (position, value) in both.chain([(0.0, 0.0)]) {
        canvas.line(&[(left + wide, y(position)), (left + wide + 8.0, y(position))], INK, 2)?;
        canvas.text(&scale.number(value, view.units), (left + wide + 14.0, y(position)), text)?;
    }
    canvas.text(scale.symbol(view.units), (left, layout.look.top + 10.0 * letters), text.bold())?;
    let [less, more] = scale.words.map_or(["", ""], |words| words.map(|text| text.of(view.language)));
    canvas.text(more, (left, top - 22.0 * letters), text.bold())?;
    canvas.text(less, (left, top + tall + 20.0 * letters), text.bold())?;
    keys(field, layout, canvas, (left, top + tall + 58.0 * letters))
}

/// Draws the keys of gray, hatching and corner, where the map has them, and of the numbers.
fn keys(
    field: &Field,
    layout: &Layout<'_>,
    canvas: &Canvas<'_>,
    (left, mut y): At,
) -> Result<(), PictureError> {
    let (language, letters, text) = (layout.view.language, layout.look.letters, layout.text());
    let has = |state: NodeState| field.state.contains(&state);
    let side = 26.0 * letters;
    let (beside, below) = (left + side + 10.0, 36.0 * letters);
    let square = |y: f64| ((left, y - side / 2.0), (left + side, y + side / 2.0));
    if has(NodeState::Unchanged) {
        let (from, to) = square(y);
        canvas.fill(from, to, colour::diverging(0.0))?;
        canvas.frame(from, to, INK, 1)?;
        let word = if layout.scale.words.is_some() { words::ENOUGH } else { words::NO_CHANGE };
        canvas.text(word.of(language), (beside, y), text)?;
        y += below;
    }
    if has(NodeState::Unseen) {
        let (from, to) = square(y);
        for k in 0..3 {
            let s = (6.0 + 10.0 * f64::from(k)) * letters;
            canvas.line(&[(left, from.1 + s), (left + s, from.1)], PALE, 2)?;
        }
        canvas.frame(from, to, INK, 1)?;
        canvas.text(words::NO_DATA.of(language), (beside, y), text)?;
        y += below;
    }
    if layout.is_turned() {
        let (from, to) = square(y);
        canvas.area(&[(from.0, to.1), to, from], INK)?;
        canvas.text("(0, 0)", (beside, y), text)?;
        y += below;
    }
    canvas.text(words::MEANS.of(language), (left, y), text)
}
