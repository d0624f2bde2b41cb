//! Faults of a file: place, key and message.

use std::fmt;

/// Fault of a file at one place.
///
/// Displays as `config/plant-north.toml:41:7: press.map.in.stroke_id: message`, in one line.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
pub struct Fault {
    /// The file as the user named it.
    pub file: String,
    /// Line, from 1; 0 for a file that cannot be read.
    pub line: usize,
    /// Column in characters, from 1; 0 for a file that cannot be read.
    pub column: usize,
    /// Dotted path of the key; elements of arrays are counted from 1: `template[2].chord_mm`. Empty for the whole file.
    pub key: String,
    /// Value found and values allowed.
    pub message: String,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            0 => write!(f, "{}: ", self.file)?,
            line => write!(f, "{}:{line}:{}: ", self.file, self.column)?,
        }
        if !self.key.is_empty() {
            write!(f, "{}: ", self.key)?;
        }
        f.write_str(&self.message)
    }
}

/// Faults of one or several files, sorted by file, line and column. Never empty.
///
/// Displays as one line per fault; serialises as an array of [`Fault`]s.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
#[serde(transparent)]
pub struct Faults(Vec<Fault>);

impl Faults {
    /// Sorts the faults and drops repeats; `None` when there are none.
    pub fn new(mut faults: Vec<Fault>) -> Option<Self> {
        faults.sort();
        faults.dedup();
        (!faults.is_empty()).then_some(Self(faults))
    }

    /// Makes a list of one fault.
    pub fn one(fault: Fault) -> Self {
        Self(vec![fault])
    }

    /// Returns the faults in the order of their places.
    pub fn as_slice(&self) -> &[Fault] {
        &self.0
    }
}

impl IntoIterator for Faults {
    type Item = Fault;
    type IntoIter = std::vec::IntoIter<Fault>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.into_iter()
    }
}

impl fmt::Display for Faults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, fault) in self.0.iter().enumerate() {
            if i > 0 {
                f.write_str("\n")?;
            }
            fault.fmt(f)?;
        }
        Ok(())
    }
}

impl std::error::Error for Faults {}
