//! Plugins that took part in a measurement.

use serde::{Deserialize, Serialize};

/// A plugin that took part in a measurement.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PluginRecord {
    /// `scanner`, `flattening` or `comparison`.
    pub kind: String,
    /// Name.
    pub plugin: String,
    /// Version.
    pub version: String,
    /// SHA-256 of its library, hexadecimal.
    pub sha256: String,
    /// Whether it ran in a process of its own.
    pub isolated: bool,
    /// Whether the first attempt failed and this is the result of a second one in a new process.
    pub retried: bool,
}
