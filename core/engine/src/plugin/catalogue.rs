//! The folders of the plugins, and the libraries in them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::{Descriptor, Library, PluginError};

/// Plugin folders, in the order of the search.
#[derive(Debug, Clone)]
pub struct Catalogue {
    folders: Vec<PathBuf>,
}

/// One library file of the plugin folders.
#[derive(Debug)]
pub struct Listed {
    /// File.
    pub path: PathBuf,
    /// Its description, or the reason why it cannot be used.
    pub plugin: Result<Descriptor, PluginError>,
}

impl Catalogue {
    /// Returns the search order: `given` first, then `../lib/platen/plugins` beside the program, then the program's own folder.
    pub fn new(given: Option<&Path>) -> Self {
        let program = std::env::current_exe().ok().and_then(|exe| exe.parent().map(Path::to_path_buf));
        let installed = program.as_ref().map(|folder| folder.join("../lib/platen/plugins"));
        let folders = [given.map(Path::to_path_buf), installed, program];
        Self { folders: folders.into_iter().flatten().filter(|folder| folder.is_dir()).collect() }
    }

    /// Loads the plugin named `name` in plant files.
    ///
    /// # Errors
    /// [`PluginError::NotFound`], or the reason why the library found cannot be used.
    pub fn load(&self, name: &str) -> Result<Library, PluginError> {
        let file = format!(
            "{}{}{}",
            std::env::consts::DLL_PREFIX,
            name.replace('-', "_"),
            std::env::consts::DLL_SUFFIX
        );
        match self.folders.iter().map(|folder| folder.join(&file)).find(|path| path.is_file()) {
            Some(path) => Library::load(&path),
            None => Err(PluginError::NotFound {
                name: name.to_owned(),
                nearest: self.nearest(name),
                file,
                looked_in: self.folders.clone(),
            }),
        }
    }

    /// Returns the installed plugin with the name nearest to `name`, if one is near.
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
        let describe =
            |path: PathBuf| Listed { plugin: Library::load(&path).map(|l| l.descriptor().clone()), path };
        self.files().into_values().map(describe).collect()
    }

    /// Returns the folders searched.
    pub fn folders(&self) -> &[PathBuf] {
        &self.folders
    }
}
