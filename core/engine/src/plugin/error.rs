//! Errors of plugins, one message each.

use std::path::{Path, PathBuf};

use super::worker::LoadFault;

/// Reason why a plugin cannot be used, or why it failed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of a variant names its fields")]
pub enum PluginError {
    /// No library has that name.
    #[error("plugin {name}: not found; looked for {file} in {}; {}", list(.looked_in), suggestion(.nearest))]
    NotFound { name: String, file: String, looked_in: Vec<PathBuf>, nearest: Option<String> },
    /// The file is another kind of library, or no library.
    #[error("plugin file {}: not a plugin: {why}; remove it from the plugin folder", .path.display())]
    NotAPlugin { path: PathBuf, why: String },
    /// The library was built for another version of the boundary.
    #[error("plugin file {}: built for plugin boundary {found}, this platen has {ours}; install the plugin's version for this platen", .path.display())]
    WrongAbi { path: PathBuf, found: String, ours: String },
    /// The system's loader or the library itself refused.
    #[error("plugin file {}: failed to load: {why}", .path.display())]
    FailedToLoad {
        path: PathBuf,
        /// The loader's message, with the symbol or library that is missing.
        why: String,
    },
    /// The kind of the plugin does not fit the place in the plant file.
    #[error(
        "plugin {name}: is a {found}, a {needed} is needed here; `platen plugins list` names those installed"
    )]
    WrongKind { name: String, found: String, needed: &'static str },
    /// The plugin refused its options.
    #[error("plugin {name}: refused its options: {message}")]
    RefusedOptions { name: String, message: String },
    /// The plugin failed at a job and returned the reason.
    #[error("{name}: {message}")]
    Failed { name: String, message: String, retryable: bool },
    /// The job was cancelled, or its deadline passed.
    #[error("{name}: stopped after {elapsed_ms} ms: {why}")]
    Stopped { name: String, elapsed_ms: u64, why: &'static str },
    /// The plugin did not return after deadline, cancellation and grace.
    #[error(
        "{name}: hangs: not returned {elapsed_ms} ms after its start, although cancelled; its process was ended"
    )]
    Hangs { name: String, elapsed_ms: u64 },
    /// The plugin's process ended.
    #[error("{name}: its process ended: {how}; report this to the plugin's author")]
    Died { name: String, how: String },
    /// The plugin violated the contract of the boundary.
    #[error("{name}: misbehaved: {what}; report this to the plugin's author")]
    Misbehaved { name: String, what: String },
    /// The plugin failed a moment ago and is started again later.
    #[error("{name}: is started again in {wait_s} s, after {why}")]
    Resting { name: String, wait_s: u64, why: String },
    /// The plugin failed too often.
    #[error(
        "{name}: quarantined after {faults} faults, the last: {why}; install another {}, or run platen plugins quarantine clear", .path.display()
    )]
    Quarantined { name: String, path: PathBuf, faults: u64, why: String },
    /// The file holds another plugin than at the start.
    #[error("{name}: {} now holds another version with other options; restart platen", .path.display())]
    Replaced { name: String, path: PathBuf },
}

impl PluginError {
    pub(super) fn of_load(fault: LoadFault, path: &Path) -> Self {
        let path = path.to_owned();
        match fault {
            LoadFault::NotAPlugin(why) => Self::NotAPlugin { path, why },
            LoadFault::WrongAbi(found) => {
                let ours = platen_abi::ENTRY_SYMBOL.to_string_lossy();
                Self::WrongAbi { path, found, ours: ours.trim_start_matches("platen_entry_").to_owned() }
            }
            LoadFault::FailedToLoad(why) => Self::FailedToLoad { path, why },
        }
    }

    /// Returns whether the plugin is at fault, so that a new process of it may succeed.
    pub fn is_fault(&self) -> bool {
        matches!(self, Self::Died { .. } | Self::Misbehaved { .. } | Self::Hangs { .. })
    }

    /// Returns whether nothing was tried because the plugin is out of use.
    pub fn is_out_of_use(&self) -> bool {
        matches!(self, Self::Quarantined { .. } | Self::Resting { .. })
    }
}

fn list(folders: &[PathBuf]) -> String {
    folders.iter().map(|f| f.display().to_string()).collect::<Vec<_>>().join(", ")
}

fn suggestion(name: &Option<String>) -> String {
    name.as_ref().map_or_else(
        || "`platen plugins list` names those installed".into(),
        |n| format!("did you mean {n}?"),
    )
}
