//! Plant and plate TOML to checked types, every fault at once with file, line and column.
//!
//! [`Document`] parses a file and keeps every key and value with its place; [`TomlTable`] and [`TomlKey`] read it, key by key,
//! and collect the faults; [`check_options`] does the same for the options of a plugin, from the plugin's own
//! declarations. What leaves this crate is checked and in metres, radians and seconds.
//!
//! It reads files and nothing else: no socket, no clock, no plugin.

mod document;
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
pub use plant::{PlantFile, PluginUse, ScanWindow};
pub use plate::PlateFile;
pub use source::Place;
pub use table::TomlTable;
pub use unit::{Dimension, Unit};
