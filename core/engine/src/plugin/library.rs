//! Plugin of a library, as described by a worker: the host itself opens no library.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::worker::{Limits, Link, LinkError, LoadedLibrary, Place};
use super::{Descriptor, PluginError, Quarantine};

/// Place where a plugin runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Isolation {
    /// In a process of its own.
    #[default]
    Process,
    /// In a thread of the host, for a debugger: a crash of the plugin ends the host.
    InProcess,
}

/// Run settings of a plugin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Settings {
    /// Place.
    pub isolation: Isolation,
    /// Resource limits.
    pub limits: Limits,
}

/// Effects of loading a library on its process.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LoadFacts {
    /// Time from the start of the process to the description.
    pub took: Duration,
    /// Last line that it printed.
    pub printed: Option<String>,
    /// Threads after loading; 0 where the plugin is not in a process of its own.
    pub threads: u64,
}

/// A plugin of a library.
#[derive(Debug, Clone)]
pub struct Library {
    path: PathBuf,
    about: Arc<LoadedLibrary>,
    /// Place of the plugin in the library.
    index: usize,
    pub(super) settings: Settings,
    pub(super) quarantine: Option<Quarantine>,
    facts: Arc<LoadFacts>,
}

impl Library {
    /// Loads a library in a worker and returns its plugins.
    ///
    /// # Errors
    /// Not a plugin, wrong version, failed to load, or the worker ended while loading.
    pub(super) fn load(
        path: &Path,
        settings: Settings,
        quarantine: Option<&Quarantine>,
    ) -> Result<Vec<Self>, PluginError> {
        let path = path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
        let began = Instant::now();
        let (worker, about) = start(&path, settings)?;
        let took = began.elapsed();
        let threads = worker.process_id().and_then(|process| status(process, "Threads")).unwrap_or(0);
        let facts = Arc::new(LoadFacts { took, threads, printed: worker.end() });
        let about = Arc::new(about);
        let plugin = |index| Self {
            path: path.clone(),
            about: Arc::clone(&about),
            index,
            settings,
            quarantine: quarantine.cloned(),
            facts: Arc::clone(&facts),
        };
        Ok((0..about.plugins.len()).map(plugin).collect())
    }

    /// Returns the plugin with other run settings.
    #[must_use]
    pub fn with(mut self, settings: Settings) -> Self {
        // In-process from the command line takes precedence.
        let isolation = if self.settings.isolation == Isolation::InProcess {
            Isolation::InProcess
        } else {
            settings.isolation
        };
        self.settings = Settings { isolation, ..settings };
        self
    }

    /// Returns the description of the plugin.
    pub fn descriptor(&self) -> &Descriptor {
        &self.about.plugins[self.index]
    }

    /// Returns the effects of loading the library on its process.
    pub fn facts(&self) -> &LoadFacts {
        &self.facts
    }

    /// Returns the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the SHA-256 of the file, hexadecimal.
    pub fn sha256(&self) -> &str {
        &self.about.sha256
    }
}

/// Returns a numeric entry of a process's status file.
pub(super) fn status(process: u32, name: &str) -> Option<u64> {
    let text = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = text.lines().find(|line| line.split(':').next() == Some(name))?;
    line.split_whitespace().nth(1)?.parse().ok()
}

/// Starts a worker with a library.
pub(super) fn start(path: &Path, settings: Settings) -> Result<(Link, LoadedLibrary), PluginError> {
    let place = match settings.isolation {
        Isolation::Process => Place::Process,
        Isolation::InProcess => Place::Thread,
    };
    let failed = |why: String| PluginError::FailedToLoad { path: path.to_owned(), why };
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
    Link::load(&name, path, place, &settings.limits).map_err(|error| match error {
        LinkError::Load(fault) => PluginError::of_load(fault, path),
        LinkError::Call(error) => failed(error.message),
        LinkError::Died(how) => failed(format!("its process ended: {how}")),
        LinkError::Hung(after) => failed(format!("it did not return within {} s", after.as_secs())),
        LinkError::System(why) => failed(why),
    })
}
