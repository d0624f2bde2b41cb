//! Shared data model of the workspace: one type for each concept that is used by more than one crate.
//!
//! | module | types |
//! |---|---|
//! | `plate` | [`Plate`], [`Marker`], [`ReferenceLine`], [`Support`], [`Station`]: the plate as ordered and the points on it |
//! | `target` | [`Target`] and its shapes: the shape that the plate is bent toward |
//! | `template` | [`Template`], [`Centre`], [`Seat`]: a template laid on a reference line |
//! | `stroke` | [`StrokeKey`], [`StrokeData`]: identity of a stroke, and the press's data about it |
//! | `task` | [`Task`]: the input of a comparison |
//! | `findings`, `field` | [`Findings`], [`Field`], [`Report`]: the output of a comparison |
//! | `plate_history`, `advice` | [`PlateHistory`], [`Advice`]: the input and the output of an advisor |
//! | `verdict`, `figures`, `publication` | [`Verdict`], [`Figures`], [`Publication`]: the result as the press receives it |
//! | `journal` | [`Record`], [`Recalled`]: the steps of a stroke that survive a power cut |
//! | `alarm` | [`Code`]: numbers, texts and remedies of the alarms |
//! | `language` | [`Language`], [`Texts`], [`Sentence`]: texts for people in each language |
//!
//! Lengths are in metres, angles in radians, and points are (u, v) on the original rectangle. [`units`] converts to the
//! units shown to people. The types are plain data with serde: no I/O, no clock.

mod advice;
mod alarm;
mod field;
mod figures;
mod findings;
mod journal;
mod language;
mod plate;
mod plate_history;
mod publication;
mod stroke;
mod target;
mod task;
mod template;
pub mod units;
mod verdict;

pub use advice::{Advice, CannotAdvise, NextBend, PlannedBend, PressModel, Step};
pub use alarm::{Alarm, Audience, Code, Severity};
pub use field::{Field, NodeState};
pub use figures::{Figures, Measure};
pub use findings::{Contact, Figure, Findings, Report, TemplateFinding};
pub use journal::{Acknowledgement, Entry, Recalled, Record, Stage};
pub use language::{Language, Sentence, Texts, fill};
pub use plate::{Marker, Plate, Quantity, ReferenceLine, Station, Support, TrimLine};
pub use plate_history::{Bend, Die, LikePlates, PlateHistory, PressedStroke, Steel, WantedBend};
pub use publication::{Judgement, Measurement, Publication};
pub use stroke::{StrokeData, StrokeKey, Timestamp};
pub use target::{FLATTEST_CONE, Facing, RadiusOf, Target, TargetShape};
pub use task::Task;
pub use template::{Centre, Seat, Template};
pub use verdict::Verdict;
