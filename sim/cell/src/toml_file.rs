//! TOML files, with the line of an error.

use crate::error::Error;
use serde::de::DeserializeOwned;
use std::path::Path;

/// Reads a TOML file.
pub(crate) fn read<T: DeserializeOwned>(path: &Path) -> Result<T, Error> {
    let text = std::fs::read_to_string(path).map_err(|source| Error::Read { path: path.into(), source })?;
    toml::from_str(&text).map_err(|error| {
        let before = error.span().map_or("", |span| text.get(..span.start).unwrap_or(""));
        let line = before.matches('\n').count() + 1;
        Error::Config { path: path.into(), line, message: error.message().to_owned() }
    })
}
