//! What can be wrong with a plugin, one message for each.

use std::path::PathBuf;

/// A plugin that cannot be used, or that failed at work.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PluginError {
    /// There is no library of that name.
    #[error("plugin {name}: not found; looked for {file} in {}; {}", list(.looked_in), suggestion(.nearest))]
    NotFound {
        /// Name in the plant file.
        name: String,
        /// File looked for.
        file: String,
        /// Folders looked in.
        looked_in: Vec<PathBuf>,
        /// An installed plugin of a similar name.
        nearest: Option<String>,
    },
    /// The file is a library of something else, or no library at all.
    #[error("plugin file {}: not a plugin: {why}; remove it from the plugin folder", .path.display())]
    NotAPlugin {
        /// File.
        path: PathBuf,
        /// What it lacks.
        why: String,
    },
    /// The library speaks another version of the boundary.
    #[error("plugin file {}: built for plugin boundary {found}, this platen speaks {ours}; install the plugin's version for this platen", .path.display())]
    WrongAbi {
        /// File.
        path: PathBuf,
        /// Version of the plugin.
        found: String,
        /// Version of the host.
        ours: String,
    },
    /// The system's loader refused the library.
    #[error("plugin file {}: failed to load: {why}; install what it needs beside it", .path.display())]
    FailedToLoad {
        /// File.
        path: PathBuf,
        /// The loader's words, with the symbol or library that is missing.
        why: String,
    },
    /// The plugin is of another kind than the place it is named in.
    #[error(
        "plugin {name}: is a {found}, a {needed} is needed here; `platen plugins list` names those installed"
    )]
    WrongKind {
        /// Name.
        name: String,
        /// Its kind.
        found: String,
        /// The kind needed.
        needed: &'static str,
    },
    /// The plugin refused its options.
    #[error("plugin {name}: refused its options: {message}")]
    RefusedOptions {
        /// Name.
        name: String,
        /// Its reason and hint.
        message: String,
    },
    /// The plugin failed at a job.
    #[error("{name}: {message}")]
    Failed {
        /// Name.
        name: String,
        /// Its reason and hint.
        message: String,
        /// Trying again may help.
        retryable: bool,
    },
    /// The job was cancelled, or its deadline passed.
    #[error("{name}: stopped after {elapsed_ms} ms: {why}")]
    Stopped {
        /// Name.
        name: String,
        /// How long it had worked.
        elapsed_ms: u64,
        /// Deadline or cancel.
        why: &'static str,
    },
    /// The plugin did not return after deadline, cancel and grace. It cannot be contained in this process.
    #[error(
        "{name}: hangs: {elapsed_ms} ms after its start it has not returned, though cancelled; restart platen, report the plugin"
    )]
    Hangs {
        /// Name.
        name: String,
        /// How long it had worked.
        elapsed_ms: u64,
    },
    /// The plugin broke the contract of the boundary.
    #[error("{name}: misbehaved: {what}; report this to the plugin's author")]
    Misbehaved {
        /// Name.
        name: String,
        /// What it did.
        what: String,
    },
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
