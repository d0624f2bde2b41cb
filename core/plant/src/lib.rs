//! Reader of plant and plate files: TOML to the types of `platen-model`, with all faults at once, each with file, line
//! and column.
//!
//! 1. [`Document`] parses the text with the error recovery of the `toml` crate.
//! 2. [`TomlTable`] and [`TomlKey`] read it key by key and collect the faults.
//! 3. [`plant`] and [`plate`] are the readers of the two kinds of file, [`press`] of `[press]`.
//! 4. [`check_options`] checks the options of a plugin against the plugin's declarations.
//!
//! Returned values are checked and in metres, radians and seconds.
//!
//! Limits: this crate only reads files. It uses no socket, clock or plugin.

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
