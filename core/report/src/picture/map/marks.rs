//! Marks on a map: means of the field over parts of the plate, and the place of the next hit.

use platen_model::{Field, NodeState};

use super::Mark;
use super::layout::Layout;
use crate::picture::canvas::{Canvas, Text};
use crate::picture::colour::{self, INK, PAPER};
use crate::picture::scale::Scale;
use crate::picture::{PictureError, words};
use crate::result::{CURVATURE_DEFICIT, NextPlace};

/// Parts of the plate with their mean written on them, along u and v.
const PARTS: [usize; 2] = [5, 4];

/// Writes the field's mean on each part of the plate.
pub(super) fn part_means(
    field: &Field,
    layout: &Layout<'_>,
    canvas: &Canvas<'_>,
) -> Result<(), PictureError> {
    let digits = Text::new(27.0 * layout.look.letters).bold().centred();
    for (column, row) in (0..PARTS[0] * PARTS[1]).map(|k| (k % PARTS[0], k / PARTS[0])) {
        let share = [(column as f64 + 0.5) / PARTS[0] as f64, (row as f64 + 0.5) / PARTS[1] as f64];
        let Some((mean, beneath)) = mean(field, column, row).zip(shade_at(field, &layout.scale, share))
        else {
            continue;
        };
        let at = layout.at(share[0] * layout.plate.width_mm, share[1] * layout.plate.height_mm);
        let number = layout.scale.number(mean * layout.scale.factor, layout.view.units);
        canvas.text(&number, at, digits.coloured(colour::text_on(beneath)))?;
    }
    Ok(())
}

/// Marks the next action on the map of the missing curvature.
pub(super) fn next(
    mark: Option<Mark<'_>>,
    field: &Field,
    layout: &Layout<'_>,
    canvas: &Canvas<'_>,
) -> Result<(), PictureError> {
    match mark.filter(|_| field.name == CURVATURE_DEFICIT) {
        None => Ok(()),
        Some(Mark::Place(place)) => frame(place, field, layout, canvas),
        Some(Mark::Line(ends, to)) => {
            let line = ends.map(|[u, v]| layout.at(u, v));
            let Some(to) = to else {
                canvas.line(&line, PAPER, 12)?;
                return canvas.line(&line, INK, 6);
            };
            // With an interval the line is narrower, otherwise it would cover the outline.
            outline(ends, to, layout, canvas)?;
            canvas.line(&line, INK, 3)
        }
    }
}

/// Outlines the interval of the place of a bend, on either side of its line, with dashes.
fn outline(
    [[u1, v1], [u2, v2]]: [[f64; 2]; 2],
    to: f64,
    layout: &Layout<'_>,
    canvas: &Canvas<'_>,
) -> Result<(), PictureError> {
    let length = (u2 - u1).hypot(v2 - v1).max(f64::MIN_POSITIVE);
    let (u, v) = (to * (v1 - v2) / length, to * (u2 - u1) / length);
    let [a, b, c, d] = [(u1 + u, v1 + v), (u2 + u, v2 + v), (u2 - u, v2 - v), (u1 - u, v1 - v)]
        .map(|(u, v)| layout.at(u, v));
    canvas.area(&[a, b, c, d], PAPER)?;
    for (from, to) in [(a, b), (b, c), (c, d), (d, a)] {
        canvas.line(&[from, to], PAPER, 6)?;
    }
    [(a, b), (b, c), (c, d), (d, a)].into_iter().try_for_each(|(from, to)| canvas.dashed(from, to, INK, 2))
}

/// Draws a frame at the place of the next hit and its name inside the frame, away from the means.
fn frame(
    place: &NextPlace,
    field: &Field,
    layout: &Layout<'_>,
    canvas: &Canvas<'_>,
) -> Result<(), PictureError> {
    let ([u, v], [w, h]) = (place.at_mm, place.extent_mm.map(|mm| 0.5 * mm));
    let (a, b) = (layout.at(u - w, v - h), layout.at(u + w, v + h));
    let (from, to) = ((a.0.min(b.0), a.1.min(b.1)), (a.0.max(b.0), a.1.max(b.1)));
    // Paper colour around the ink makes it visible on the darkest shades.
    canvas.frame(from, to, PAPER, 8)?;
    canvas.frame(from, to, INK, 4)?;
    let ((left, _), (_, bottom)) = layout.corners();
    let [wide, high] = layout.extent();
    // Rows of means in the view.
    let u_is_up = layout.at(0.0, 0.0).1 != layout.at(layout.plate.width_mm, 0.0).1;
    let row_height = high / PARTS[usize::from(!u_is_up)] as f64;
    let to_a_mean = |y: f64| (((bottom - y) / row_height).fract() - 0.5).abs();
    let inside = 20.0 * layout.look.letters;
    let (low, top) = (to.1 - inside, from.1 + inside);
    let at = (0.5 * (from.0 + to.0), if to_a_mean(low) >= to_a_mean(top) { low } else { top });
    let share = layout.on_plate([(at.0 - left) / wide, (bottom - at.1) / high]);
    let beneath = shade_at(field, &layout.scale, share).unwrap_or(0.0);
    let look = layout.text().bold().centred().coloured(colour::text_on(beneath));
    canvas.text(words::NEXT_HIT.of(layout.view.language), at, look)
}

/// Returns the position of the shade at a share of the plate's sides; `None` where unseen.
fn shade_at(field: &Field, scale: &Scale, [u, v]: [f64; 2]) -> Option<f64> {
    match field.sample(u, v, 0) {
        (NodeState::Seen, value) => Some(scale.position(value * scale.factor)),
        (NodeState::Unchanged, _) => Some(0.0),
        (NodeState::Unseen, _) => None,
    }
}

/// Returns the mean over the seen nodes of a part of the plate; `None` if fewer than half were seen, or most are
/// unchanged.
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
