//! Browser pages of a running host, over HTTP/1.1: operator's screen, strokes of a plate, comparison of two strokes,
//! engineer's page, plate in 3D.
//!
//! Overview: `core/screen/README.md`.
//!
//! | module | contents |
//! |---|---|
//! | `snapshot` | the state of press, plate, stroke and result: `platen.screen/1` |
//! | `source` | the trait through which pages read; the host implements it |
//! | `view` | language, units, orientation and theme of a page, from its address |
//! | `words` | texts of the pages in both languages |
//! | `cells` | the changing elements of a page, rendered once for the first paint and again for every later event |
//! | `page` | the pages |
//! | `server` | listener, access, headers, the event stream |
//!
//! The pages only read: the server answers GET and HEAD alone. This crate has no access to press, plugins or database.

mod cells;
mod page;
mod server;
mod snapshot;
mod source;
mod view;
mod words;

use std::time::Duration;

pub use server::{Access, Listener, Server, ServerError, Token, TokenError};
pub use snapshot::{
    AdvicePart, AdvisedBend, AdvisedStep, HostPart, LastAdvice, PlatePart, PressPart, RecordPart, ResultPart,
    SCHEMA, ScannerPart, ScannerState, ShownAlarm, Snapshot, Stage, StripPart, StrokePart, Worst,
};
pub use source::{
    Beat, Engineer, FILES, PlateRow, PluginRow, RegisterRow, Source, SourceError, StrokeRow, TimelineRow,
};
pub use view::{Theme, View};

/// Age of the press cycle above which measuring counts as stopped (rule R2).
const CYCLE_LIMIT: Duration = Duration::from_secs(3);
