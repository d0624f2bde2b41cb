//! Text of a file, and places in it.

use std::ops::Range;

use crate::Fault;

/// Text of one file, with the file's name as the user gave it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Source {
    pub(crate) file: String,
    pub(crate) text: String,
    /// Bytes of the errors of syntax.
    pub(crate) syntax_errors: Vec<Range<usize>>,
}

/// Key and its place in the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// Dotted path of the key.
    pub(crate) key: String,
    /// Byte in the text.
    pub(crate) offset: usize,
}

impl Place {
    /// Returns the dotted path of the key, as in [`Fault::key`].
    pub fn key(&self) -> &str {
        &self.key
    }
}

/// Returns the dotted path of `key` in the table at `path`.
pub(crate) fn dotted(path: &str, key: &str) -> String {
    if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") }
}

impl Source {
    /// Returns line and column of a byte, both from 1, the column in characters.
    pub(crate) fn line_column(&self, offset: usize) -> (usize, usize) {
        let before = self.text.get(..offset).unwrap_or(&self.text);
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        let line = before.bytes().filter(|&byte| byte == b'\n').count() + 1;
        (line, before[line_start..].trim_start_matches('\u{feff}').chars().count() + 1)
    }

    pub(crate) fn fault(&self, place: &Place, message: String) -> Fault {
        let (line, column) = self.line_column(place.offset);
        Fault { file: self.file.clone(), line, column, key: place.key.clone(), message }
    }
}
