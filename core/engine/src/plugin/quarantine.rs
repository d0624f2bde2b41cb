//! Quarantine of plugins that failed too often: a file of the SHA-256 of their libraries, beside the record of the
//! plant.
//!
//! A quarantine ends when the library has another content, or with `platen plugins quarantine clear`.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

/// File of a plant's quarantined plugins.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Quarantine {
    file: PathBuf,
}

/// One library in quarantine.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Quarantined {
    /// Name of the plugin.
    pub plugin: String,
    /// File of the library.
    pub library: PathBuf,
    /// SHA-256 of its content, hexadecimal.
    pub sha256: String,
    /// Last fault.
    pub why: String,
    /// Number of faults until then.
    pub faults: u64,
    /// Start of the quarantine.
    pub since: jiff::Timestamp,
}

impl Quarantine {
    /// Returns the file beside the record of a plant (`output.history`).
    pub fn beside(history: &Path) -> Self {
        Self { file: history.with_file_name("quarantine.json") }
    }

    /// Returns the libraries in quarantine; none if the file is missing.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn list(&self) -> io::Result<Vec<Quarantined>> {
        match fs::read(&self.file) {
            Ok(bytes) => serde_json::from_slice(&bytes)
                .map_err(|e| io::Error::other(format!("{}: {e}", self.file.display()))),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(Vec::new()),
            Err(error) => Err(io::Error::new(error.kind(), format!("{}: {error}", self.file.display()))),
        }
    }

    /// Releases a plugin, or all plugins without a name; returns those released.
    ///
    /// # Errors
    /// The file cannot be read or written.
    pub fn clear(&self, plugin: Option<&str>) -> io::Result<Vec<Quarantined>> {
        let (released, kept) =
            self.list()?.into_iter().partition(|held| plugin.is_none_or(|plugin| held.plugin == plugin));
        self.write(&kept)?;
        Ok(released)
    }

    /// Returns the entry of a library with this content; an unreadable file counts as empty.
    pub(super) fn find(&self, sha256: &str) -> Option<Quarantined> {
        self.list().ok()?.into_iter().find(|held| held.sha256 == sha256)
    }

    pub(super) fn add(&self, entry: Quarantined) -> io::Result<()> {
        let mut all = self.list().unwrap_or_default();
        all.retain(|held| held.sha256 != entry.sha256);
        all.push(entry);
        self.write(&all)
    }

    fn write(&self, all: &Vec<Quarantined>) -> io::Result<()> {
        let new = self.file.with_extension("json.new");
        fs::write(&new, serde_json::to_vec_pretty(all)?)?;
        fs::rename(new, &self.file)
    }
}
