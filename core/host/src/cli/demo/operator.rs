//! Simulated operator of the demo's press, who follows the advice or presses by habit.

use std::path::Path;
use std::time::{Duration, Instant};

use clap::ValueEnum;
use platen_model::units::mm;
use platen_model::{NextBend, Step};
use platen_report::advice::{ADVICE_FILE, AdviceRecord};
use platen_report::result::{Next, ResultRecord};
use serde_json::{Value as Json, json};

use crate::cli::CliError;
use crate::cli::cell::Cell;

/// Most strokes of a demo with advice.
pub(super) const MOST_ADVISED: u32 = 30;
/// Time within which an advice is recorded.
const LIMIT: Duration = Duration::from_secs(5);
/// Habit of an operator without advice: feed, first and last position, millimetres; depth of the pass and of a
/// correction.
const FEED_MM: f64 = 250.0;
const REACH_MM: [f64; 2] = [250.0, 2750.0];
const DEPTH_MM: [f64; 2] = [4.5, 3.6];

/// Behaviour of the simulated operator: follows the advice, or ignores it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Operator {
    /// Presses as the screen says
    Follow,
    /// Presses as he is used to; the advice is recorded and scored, and shown to nobody
    Ignore,
}

impl Operator {
    /// Waits for the advice after a result, and orders the next stroke from the press. A plate that passed needs none.
    ///
    /// # Errors
    /// The press does not answer.
    pub(super) fn order(
        self,
        cell: &mut Cell,
        record: &ResultRecord,
        folder: &Path,
        strokes: u32,
    ) -> Result<(), CliError> {
        let size = [record.plate_file.width_mm, record.plate_file.height_mm];
        let advice = advice(folder)?;
        let order = match (self, advice.and_then(|advice| advice.advice).map(|advice| advice.step)) {
            (_, Some(Step::Done)) => return Ok(()),
            (Self::Follow, Some(Step::Bend(next))) => as_advised(&next, size, false),
            (Self::Follow, Some(Step::TurnOver(next))) => as_advised(&next, size, true),
            _ => by_habit(record, size, strokes),
        };
        // The press accepts an order once it is at rest.
        let end = Instant::now() + LIMIT;
        loop {
            let answer = cell.ask(&json!({ "do": { "order": order } }).to_string())?;
            if answer["ok"] == true || cell.is_done()? {
                return Ok(());
            }
            if Instant::now() > end {
                return Err(CliError::Failed(format!("simulated press: {answer}")));
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

/// Reads the advice of a stroke once it is recorded; `None` if it is not recorded in time.
fn advice(folder: &Path) -> Result<Option<AdviceRecord>, CliError> {
    let end = Instant::now() + LIMIT;
    while Instant::now() < end {
        if let Some(record) = AdviceRecord::beside(&folder.join(ADVICE_FILE)).map_err(CliError::Failed)? {
            return Ok(Some(record));
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    Ok(None)
}

/// Makes an order; positions at the press are measured from the middle of the plate, across the die.
fn stroke(at_mm: [f64; 2], axis_deg: f64, depth_mm: f64, size: [f64; 2], turned_over: bool) -> Json {
    let (sin, cos) = axis_deg.to_radians().sin_cos();
    let across = (at_mm[0] - 0.5 * size[0]) * sin - (at_mm[1] - 0.5 * size[1]) * cos;
    json!({ "axis_deg": axis_deg, "at_mm": across, "depth_mm": depth_mm, "turned_over": turned_over })
}

fn as_advised(next: &NextBend, size: [f64; 2], turned_over: bool) -> Json {
    let middle = [0, 1].map(|k| mm(0.5 * (next.line[0][k] + next.line[1][k])));
    let depth = next.depth.map_or(DEPTH_MM[1], mm);
    stroke(middle, next.direction.to_degrees(), depth, size, turned_over)
}

/// Makes one pass at an even feed, then a hit at the position that the result gives for the next one.
fn by_habit(record: &ResultRecord, size: [f64; 2], strokes: u32) -> Json {
    let pass = REACH_MM[0] + FEED_MM * f64::from(strokes);
    match record.next.as_ref().and_then(Next::place) {
        _ if pass <= REACH_MM[1] => stroke([pass, 0.5 * size[1]], 90.0, DEPTH_MM[0], size, false),
        Some(place) => stroke(place.at_mm, 90.0, DEPTH_MM[1], size, false),
        None => stroke([0.5 * size[0], 0.5 * size[1]], 90.0, DEPTH_MM[1], size, false),
    }
}
