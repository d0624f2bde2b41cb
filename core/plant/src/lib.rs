//! Reader of plant and plate files: TOML to the types of `platen-model`, with all faults at once, each with file, line and
//! column.
//!
//! Order: [`Document`] parses the text with the `toml` crate's error recovery; [`TomlTable`] and [`TomlKey`] read it key by key and
//! collect the faults; [`plant`] and [`plate`] are the readers of the two kinds of file, [`press`] of `[press]`. [`check_options`] checks
//! the options of a plugin against the plugin's declarations. Values leave this crate checked and in metres, radians
//! and seconds.
//!
//! Limits: files are read and nothing else; no socket, no clock, no plugin.

mod document;
mod duplicate;
mod error;
mod fault;
mod key;
mod nearest;
mod node;
mod option;
pub mod plant;
pub mod plate;
pub mod press;
mod source;
mod table;
mod unit;

pub use document::{Document, Reported};
pub use error::Error;
pub use fault::{Fault, Faults};
pub use key::{Located, TomlKey};
pub use nearest::nearest;
pub use option::{OptionDecl, OptionType, OptionValue, RawOptions, Value, check_options};
pub use plant::{
    AdviceUse, Crews, Forward, PlantFile, PluginRole, PluginUse, ScanWindow, Screen, Show, SinkKind, SinkUse,
    Survey, Worker,
};
pub use plate::PlateFile;
pub use source::Place;
pub use table::TomlTable;
pub use unit::{Dimension, Unit};
