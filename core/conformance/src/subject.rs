//! Plugin under test: its library, its options, new instances of it.

use std::path::{Path, PathBuf};
use std::time::Duration;

use platen_engine::plugin::{
    Advisor, Catalogue, Comparison, Descriptor, Flattening, Instance, Kind, Library, Limits, PluginError,
    Scanner, Settings as WorkerSettings,
};
use platen_plant::{OptionValue, PluginUse, check_options};

use crate::Verdict;

/// Deadline of a scanner to connect.
const OPEN_LIMIT: Duration = Duration::from_secs(60);

/// Plugin under test.
#[derive(Debug)]
pub struct Subject {
    pub(crate) path: PathBuf,
    pub(crate) catalogue: Catalogue,
    /// The plugin, or the reason why its library cannot be used.
    pub(crate) library: Result<Library, PluginError>,
    /// Its options, or the missing ones.
    pub(crate) values: Result<Vec<OptionValue>, String>,
    pub(crate) settings: Settings,
}

/// Settings of the tests.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Settings {
    /// Seed of random options.
    pub seed: u64,
    /// Deadline of a job.
    pub limit: Duration,
}

/// Reason why nothing can be tested.
#[derive(Debug, thiserror::Error)]
pub enum SubjectError {
    /// The library has several plugins.
    #[error("{} holds several plugins: {}; name one of them", .path.display(), .names.join(", "))]
    Several {
        /// The library.
        path: PathBuf,
        /// Its plugins.
        names: Vec<String>,
    },
    /// The library does not contain the requested plugin.
    #[error("{} holds no plugin {wanted}, but {}", .path.display(), .names.join(", "))]
    None {
        /// The library.
        path: PathBuf,
        /// Requested name.
        wanted: String,
        /// Its plugins.
        names: Vec<String>,
    },
}

impl Subject {
    /// Opens a library; `plugin` selects one of several in it, `options` are those of a plant file.
    ///
    /// # Errors
    /// The plugin is not selected or does not exist. A library that cannot be used is still a subject: its tests fail.
    pub fn open(
        catalogue: &Catalogue,
        path: &Path,
        plugin: Option<&str>,
        options: Option<&PluginUse>,
        settings: Settings,
    ) -> Result<Self, SubjectError> {
        let library = match catalogue.open(path) {
            Ok(all) => {
                let names: Vec<String> = all.iter().map(|one| one.descriptor().id.clone()).collect();
                let mut found =
                    all.into_iter().filter(|one| plugin.is_none_or(|name| one.descriptor().id == name));
                let path = path.to_owned();
                match (found.next(), found.next()) {
                    (Some(one), None) => Ok(one),
                    (None, _) => {
                        let wanted = plugin.unwrap_or_default().to_owned();
                        return Err(SubjectError::None { path, wanted, names });
                    }
                    _ => return Err(SubjectError::Several { path, names }),
                }
            }
            Err(error) => Err(error),
        };
        let values = match &library {
            Ok(library) => {
                let declared = &library.descriptor().options;
                let by_default = PluginUse::by_default(&library.descriptor().id);
                let used = options.unwrap_or(&by_default);
                check_options(&used.plugin, &used.options, declared).map_err(|faults| faults.to_string())
            }
            Err(_) => Err("the library cannot be used".to_owned()),
        };
        Ok(Self { path: path.to_owned(), catalogue: catalogue.clone(), library, values, settings })
    }

    pub(crate) fn library(&self) -> Result<&Library, Verdict> {
        self.library
            .as_ref()
            .map_err(|error| Verdict::LeftOut(format!("the library cannot be used: {error}")))
    }

    pub(crate) fn descriptor(&self) -> Result<&Descriptor, Verdict> {
        self.library().map(Library::descriptor)
    }

    pub(crate) fn kind(&self) -> Result<Kind, Verdict> {
        self.descriptor().map(|descriptor| descriptor.kind)
    }

    /// Returns the values of the options.
    pub(crate) fn values(&self) -> Result<&[OptionValue], Verdict> {
        self.values.as_deref().map_err(|why| Verdict::LeftOut(format!("give options by --plant: {why}")))
    }

    /// Returns a new instance with these values.
    pub(crate) fn instance(&self, values: &[OptionValue]) -> Result<Instance, PluginError> {
        let library = self.library.as_ref().map_err(Clone::clone)?;
        Instance::create(library, library.descriptor().kind, values)
    }

    /// Returns a flattening with this deadline.
    pub(crate) fn flattening(&self, limit: Duration) -> Result<Flattening, Verdict> {
        let created =
            Flattening::create(self.library()?, self.values()?, self.settings.limit).map_err(refused)?;
        Ok(created.with_limit(limit))
    }

    /// Returns a comparison with this deadline.
    pub(crate) fn comparison(&self, limit: Duration) -> Result<Comparison, Verdict> {
        let created =
            Comparison::create(self.library()?, self.values()?, self.settings.limit).map_err(refused)?;
        Ok(created.with_limit(limit))
    }

    /// Returns an advisor with this deadline.
    pub(crate) fn advisor(&self, limit: Duration) -> Result<Advisor, Verdict> {
        Advisor::create(self.library()?, self.values()?, limit).map_err(refused)
    }

    /// Returns a connected scanner.
    pub(crate) fn scanner(&self) -> Result<Scanner, Verdict> {
        let scanner = Scanner::create(self.library()?, self.values()?).map_err(refused)?;
        match scanner.instance().open(OPEN_LIMIT) {
            Ok(()) => Ok(scanner),
            Err(error) if error.is_fault() => Err(failed(error)),
            Err(error) => Err(Verdict::LeftOut(format!("the scanner does not open: {error}"))),
        }
    }

    /// Returns the library with this memory limit, bytes.
    pub(crate) fn limited(&self, memory: u64) -> Result<Library, Verdict> {
        let limits = Limits { memory, ..Limits::default() };
        Ok(self.library()?.clone().with(WorkerSettings { limits, ..WorkerSettings::default() }))
    }
}

/// Returns a failure of the plugin.
pub(crate) fn failed(what: impl std::fmt::Display) -> Verdict {
    Verdict::Failed(what.to_string())
}

fn refused(error: PluginError) -> Verdict {
    failed(format!("with its default options: {error}"))
}
