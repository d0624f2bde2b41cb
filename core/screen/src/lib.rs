//! Browser pages of a running host, over HTTP/1.1: the operator's screen, the strokes of a plate, two strokes compared, the
//! engineer's page, the plate in 3D. Overview: `core/screen/README.md`.
//!
//! | module | contents |
//! |---|---|
//! | `snapshot` | the state of press, plate, stroke and result: `platen.screen/1` |
//! | `source` | the trait through which pages read; the host implements it |
//! | `view` | language, units, turn and theme of a page, from its address |
//! | `words` | texts of the pages in both languages |
//! | `cells` | the parts of a page that change, rendered once for the first paint and for every later event |
//! | `page` | the pages |
//! | `server` | listener, access, headers, the event stream |
//!
//! Pages read and never write: the server answers GET and HEAD alone. It knows no press, no plugin and no database.

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

/// Age of the press cycle from which on measuring has stopped (rule R2).
const CYCLE_LIMIT: Duration = Duration::from_secs(3);
