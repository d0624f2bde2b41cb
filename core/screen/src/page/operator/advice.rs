//! Advice on the operator's page: the line to press along (instead of the place of the next hit), the depth, and the
//! expected outcome.

use platen_model::{Texts, fill};
use platen_report::picture::SeenPlate;

use crate::cells::Cells;
use crate::page::clean_sentence;
use crate::view::View;
use crate::{AdvicePart, AdvisedBend, AdvisedStep, LastAdvice, Snapshot, words};

/// A line whose ends differ by less than this is shown by one number, millimetres.
const STRAIGHT: f64 = 5.0;

/// Fills the cells of the advice, replacing the cells of the next place.
pub(super) fn cells(cells: &mut Cells, snapshot: &Snapshot, view: View) {
    let advice = snapshot.result.as_ref().and_then(|result| result.advice.as_ref());
    let text = |texts: Texts| texts.of(view.language);
    cells.text("advice", advice.map_or(String::new(), |advice| sentence(advice, view)));
    let remark = advice.and_then(|it| it.says.first());
    cells.text("remark", remark.map_or(String::new(), |it| clean_sentence(it.of(view.language))));
    cells.text(
        "advised-before",
        advice.and_then(|it| it.last).map_or(String::new(), |last| before(last, view)),
    );
    let seen = snapshot.plate.as_ref().and_then(|it| Some(view.turn.of(it.size_mm?, it.press_side)));
    let Some((advice, (bend, seen))) = advice.and_then(|it| Some((it, it.bend.as_ref().zip(seen)?))) else {
        return;
    };
    let title = if advice.step == AdvisedStep::TurnOver { words::TURN_OVER } else { words::PRESS_LINE };
    cells.text("place-title", text(title));
    let (from, [near, far]) = distances(bend, seen);
    cells.text("left", view.place(near));
    let far = ((near - far).abs() > STRAIGHT).then(|| view.place(far));
    cells.text(
        "left-words",
        match far {
            None => text(from).to_owned(),
            Some(far) => fill(text(words::FAR_END), &[text(from), &far]),
        },
    );
    cells.text("near", bend.depth_mm.map_or(String::new(), |depth| view.length(depth)));
    cells.text("near-words", if bend.depth_mm.is_some() { text(words::DEPTH) } else { "" });
}

/// Returns the last stroke's advised angle beside the angle that it made.
fn before(last: LastAdvice, view: View) -> String {
    let text = |texts: Texts| texts.of(view.language);
    let number = |deg: f64| format!("{deg:.1}");
    match last {
        LastAdvice::TooLate => text(words::LAST_TOO_LATE).to_owned(),
        LastAdvice::Made { advised_deg, advised_95_deg, made_deg } => {
            let advised = match advised_95_deg.map(|it| it.map(number)) {
                Some([low, high]) => fill(text(words::RANGE), &[&number(advised_deg), &low, &high]),
                None => fill(text(words::DEGREES), &[&number(advised_deg)]),
            };
            fill(text(words::LAST_STROKE), &[&advised, &fill(text(words::DEGREES), &[&number(made_deg)])])
        }
    }
}

/// Returns the edge from which a line is measured, and the distances of its ends in millimetres; the end nearer to the
/// operator (or to the left) is first.
fn distances(bend: &AdvisedBend, seen: SeenPlate) -> (Texts, [f64; 2]) {
    let [[x1, y1], [x2, y2]] = bend.line_mm.map(|end| seen.place_mm(end));
    if (x1 - x2).abs() <= (y1 - y2).abs() {
        (words::FROM_LEFT, if y1 <= y2 { [x1, x2] } else { [x2, x1] })
    } else {
        let from = if seen.press_below { words::FROM_PRESS } else { words::FROM_BOTTOM };
        (from, if x1 <= x2 { [y1, y2] } else { [y2, y1] })
    }
}

/// Returns the largest depth, the expected outcome of the stroke and the number of strokes left, or the reason why
/// there is no advice.
fn sentence(advice: &AdvicePart, view: View) -> String {
    let text = |texts: Texts| texts.of(view.language);
    let most = advice.bend.and_then(|bend| bend.depth_mm.and(bend.depth_not_beyond_mm));
    let most = most.map(|most| fill(text(words::NOT_BEYOND), &[&view.length(most)]));
    let then = advice.bend.map(|bend| {
        let [low, gap, high] = bend.gap_after_mm.map(|gap| view.units.number(gap));
        fill(text(words::THEN), &[&format!("{gap} {}", view.units.symbol()), &low, &high])
    });
    let left = advice
        .strokes_left
        .filter(|left| left[1] > 0)
        .map(|[few, many]| fill(text(words::STROKES_LEFT), &[&few.to_string(), &many.to_string()]));
    let why = advice.why.map(|why| fill(text(words::NO_ADVICE), &[text(why)]));
    let parts: Vec<String> = [why, most, then, left].into_iter().flatten().collect();
    parts.join("; ")
}
