//! Lock file of a history, which allows one writer at a time.
//!
//! It contains the holder's name; the operating system releases it when the process ends.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

use jiff::Timestamp;

use crate::Error;

/// Exclusive lock, released when dropped.
#[derive(Debug)]
pub(crate) struct Lock {
    _file: File,
}

impl Lock {
    /// Takes the lock of the database at `database`.
    ///
    /// # Errors
    /// [`Error::InUse`] naming the holder, [`Error::Unreachable`].
    pub(crate) fn take(database: &Path, now: Timestamp) -> Result<Self, Error> {
        let path = lock_path(database);
        let unreachable = |source| Error::Unreachable { path: path.clone(), source };
        let mut file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(&path)
            .map_err(unreachable)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                return Err(Error::InUse { path: database.to_owned(), holder: holder(&mut file) });
            }
            Err(TryLockError::Error(source)) => return Err(unreachable(source)),
        }
        file.set_len(0).map_err(unreachable)?;
        let program = std::env::current_exe().ok();
        let program = program.as_deref().and_then(Path::file_name).unwrap_or_default().to_string_lossy();
        let line = format!("{program}, process {}, since {now:.0}\n", std::process::id());
        file.write_all(line.as_bytes()).map_err(unreachable)?;
        Ok(Self { _file: file })
    }
}

/// Returns the path of the lock file: beside the database, so that SQLite's own locks stay free for readers.
fn lock_path(database: &Path) -> PathBuf {
    let mut name = database.as_os_str().to_owned();
    name.push(".lock");
    PathBuf::from(name)
}

fn holder(file: &mut File) -> String {
    let mut text = String::new();
    match file.read_to_string(&mut text) {
        Ok(_) if !text.trim().is_empty() => text.trim().to_owned(),
        _ => "another process".to_owned(),
    }
}
