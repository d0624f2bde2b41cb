//! Errors of plugins, one message each.

use std::path::PathBuf;

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
    /// The system's loader refused the library.
    #[error("plugin file {}: failed to load: {why}; install what it needs beside it", .path.display())]
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
    /// The plugin failed at a job.
    #[error("{name}: {message}")]
    Failed { name: String, message: String, retryable: bool },
    /// The job was cancelled, or its deadline passed.
    #[error("{name}: stopped after {elapsed_ms} ms: {why}")]
    Stopped { name: String, elapsed_ms: u64, why: &'static str },
    /// The plugin did not return after deadline, cancellation and grace period. It cannot be ended within this process.
    #[error(
        "{name}: hangs: not returned {elapsed_ms} ms after its start, although cancelled; restart platen and report the plugin"
    )]
    Hangs { name: String, elapsed_ms: u64 },
    /// The plugin violated the contract of the boundary.
    #[error("{name}: misbehaved: {what}; report this to the plugin's author")]
    Misbehaved { name: String, what: String },
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
