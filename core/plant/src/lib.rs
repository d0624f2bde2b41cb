//! Plant and plate TOML to checked types, every fault at once with file, line and column.

pub mod press;
