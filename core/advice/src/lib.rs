//! Advice for the next stroke: place, angle and depth of the next bend with intervals, or the reason to stop.
//!
//! In: target, surface and record of a plate. Out: [`Advice`]. Not in Masuda et al., who leave the choice of the stroke
//! to the operator.
//!
//! | module | from -> to | method |
//! |---|---|---|
//! | [`situation`] | record, surfaces -> [`Situation`] | heights under the boards by integration of the curvature |
//! | [`bend_lines`], [`board`] | target -> lines, templates on them | parallel lines, fan of a cone; seat of a template |
//! | [`press_law`] | angle -> depth | three-point bending with springback in closed form |
//! | [`learner`] | reported depths, measured angles -> offset and slope | Gaussian process regression along the plate |
//! | `planner`, `nnls` | heights -> fewest bends | non-negative least squares, settled lines |
//! | `past` | strokes of the history -> bends in the plate, depth law | |
//! | `next_bend` | plan, depth law -> [`Advice`] | guard against bending too far; intervals |
//! | `remarks` | evidence of the strokes about press and plate file -> sentences | |
//! | [`press_capability`] | scatter of the ram -> gap under a board | first order |
//! | [`strain`] | angles of bends -> strain of the face | width of a bend by thickness and punch |
//! | `place` | double curvature -> place and direction | largest mean missing curvature |
//!
//! A *board* is a template on its line. Units are metres and radians; angles are positive in the sense in which the
//! target bends. All functions are pure and deterministic: no clock, no files, no randomness.

pub mod bend_lines;
pub mod board;
pub mod learner;
mod next_bend;
mod nnls;
mod past;
mod place;
mod planner;
pub mod press_capability;
pub mod press_law;
mod remarks;
mod settings;
pub mod situation;
pub mod strain;

pub use next_bend::{advise, too_late};
pub use past::{depth_at, expected_angle};
pub use platen_model::Advice;
pub use settings::{Order, Settings};
pub use situation::Situation;

use platen_model::{CannotAdvise, PlateHistory};
use platen_shape::{Surface, TargetSurface};

/// Returns the advice after the last stroke of the history, from the surfaces of the plate and of its blank: a bend
/// with its intervals on cylinder and cone, a place on double curvature.
#[must_use]
pub fn advise_on_surfaces(
    settings: &Settings,
    history: &PlateHistory,
    now: &Surface,
    blank: Option<&Surface>,
) -> Advice {
    let task = &history.task;
    let target = task.target.as_ref();
    let target = target.and_then(|it| TargetSurface::new(it, task.width, task.height, task.thickness).ok());
    match (Situation::of_surfaces(history, now, blank), target) {
        (Ok(situation), _) => advise(settings, history, &situation),
        (Err(CannotAdvise::NoTarget), Some(target)) if target.curvature(0.0, 0.0).strongest() != 0.0 => {
            place::advise(history, &target, now)
        }
        (Err(reason), _) => next_bend::cannot(reason),
    }
}
