//! Plugin folders, and the libraries in them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::{Descriptor, Isolation, Library, PluginError, Quarantine, Settings};

/// Plugin folders, in the order of the search, and how their plugins run.
#[derive(Debug, Clone)]
pub struct Catalogue {
    folders: Vec<PathBuf>,
    isolation: Isolation,
    quarantine: Option<Quarantine>,
}

/// One library file of the plugin folders.
#[derive(Debug)]
pub struct Listed {
    /// File.
    pub path: PathBuf,
    /// Its plugins, or the reason why it cannot be used.
    pub plugins: Result<Vec<Descriptor>, PluginError>,
}

impl Catalogue {
    /// Returns the search order: `given` first, then `../lib/platen/plugins` beside the program, then the program's own
    /// folder.
    pub fn new(given: Option<&Path>) -> Self {
        let program = std::env::current_exe().ok().and_then(|exe| exe.parent().map(Path::to_path_buf));
        let installed = program.as_ref().map(|folder| folder.join("../lib/platen/plugins"));
        let folders = [given.map(Path::to_path_buf), installed, program];
        let folders = folders.into_iter().flatten().filter(|folder| folder.is_dir()).collect();
        Self { folders, isolation: Isolation::Process, quarantine: None }
    }

    /// Returns the catalogue with another place for its plugins to run in.
    #[must_use]
    pub fn isolated(self, isolation: Isolation) -> Self {
        Self { isolation, ..self }
    }

    /// Returns the catalogue with a quarantine for plugins that fail too often.
    #[must_use]
    pub fn with_quarantine(self, quarantine: Quarantine) -> Self {
        Self { quarantine: Some(quarantine), ..self }
    }

    /// Loads the plugin that plant files call `name`: from the library of that name, else from any library that
    /// contains it.
    ///
    /// # Errors
    /// [`PluginError::NotFound`], or the reason why the library found cannot be used.
    pub fn load(&self, name: &str) -> Result<Library, PluginError> {
        let files = self.files();
        let stem = name.replace('-', "_");
        let named =
            |libraries: Vec<Library>| libraries.into_iter().find(|found| found.descriptor().id == name);
        if let Some(path) = files.get(&stem)
            && let Some(found) = named(self.read(path)?)
        {
            return Ok(found);
        }
        let others = files.iter().filter(|(other, _)| **other != stem);
        let found = others.filter_map(|(_, path)| self.read(path).ok()).find_map(named);
        found.ok_or_else(|| PluginError::NotFound {
            name: name.to_owned(),
            nearest: self.nearest(name),
            file: format!("{}{stem}{}", std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX),
            looked_in: self.folders.clone(),
        })
    }

    /// Loads a library file and returns its plugins.
    ///
    /// # Errors
    /// Why it cannot be used.
    pub fn open(&self, path: &Path) -> Result<Vec<Library>, PluginError> {
        self.read(path)
    }

    fn read(&self, path: &Path) -> Result<Vec<Library>, PluginError> {
        let settings = Settings { isolation: self.isolation, ..Settings::default() };
        Library::load(path, settings, self.quarantine.as_ref())
    }

    /// Returns the installed plugin whose name is most similar to `name`, if one is similar enough.
    fn nearest(&self, name: &str) -> Option<String> {
        let names: Vec<String> = self.files().into_keys().map(|stem| stem.replace('_', "-")).collect();
        platen_plant::nearest(name, names.iter().map(String::as_str)).map(str::to_owned)
    }

    /// Returns the library files by plugin name; a file of an earlier folder hides one of a later folder.
    fn files(&self) -> BTreeMap<String, PathBuf> {
        let mut files = BTreeMap::new();
        for folder in &self.folders {
            for path in std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path()) {
                let stem = path.file_name().and_then(|n| n.to_str()).and_then(|n| {
                    n.strip_prefix(std::env::consts::DLL_PREFIX)?.strip_suffix(std::env::consts::DLL_SUFFIX)
                });
                if let Some(stem) = stem {
                    files.entry(stem.to_owned()).or_insert(path);
                }
            }
        }
        files
    }

    /// Lists every library file of the folders with its description.
    pub fn list(&self) -> Vec<Listed> {
        let describe = |path: PathBuf| {
            let found = self.read(&path);
            let plugins = found.map(|all| all.iter().map(|library| library.descriptor().clone()).collect());
            Listed { path, plugins }
        };
        self.files().into_values().map(describe).collect()
    }

    /// Returns the folders searched.
    pub fn folders(&self) -> &[PathBuf] {
        &self.folders
    }
}
