//! Reader of one table: every key is read by name and type; a key that is never read is a fault.

use crate::RawOptions;
use crate::document::{Document, Reported};
use crate::key::{Located, TomlKey};
use crate::nearest;
use crate::node::{Entry, Node, NodeKind};
use crate::source::{Place, dotted};

/// Reader of one table of a [`Document`].
///
/// Each getter marks its key as known; [`TomlTable::finish`] reports the others. Read every key, then finish, then take
/// the values out: see [`Document`].
#[derive(Debug)]
#[must_use = "finish() reports the unknown keys"]
pub struct TomlTable<'d> {
    document: &'d Document,
    place: Place,
    entries: &'d [Entry],
    asked: Vec<String>,
    excuse: Option<Reported>,
}

impl<'d> TomlTable<'d> {
    pub(crate) fn new(document: &'d Document, place: Place, entries: &'d [Entry]) -> Self {
        Self { document, place, entries, asked: Vec::new(), excuse: None }
    }

    /// Accepts missing keys from here on: because of the fault `excuse` it is unknown which keys are required.
    pub(crate) fn excuse_missing(&mut self, excuse: Reported) {
        self.excuse = Some(excuse);
    }

    /// Returns the document, to record faults between several keys.
    pub fn document(&self) -> &'d Document {
        self.document
    }

    /// Returns the place of the table.
    pub fn place(&self) -> &Place {
        &self.place
    }

    /// Returns whether the key exists, with any type; it does not count as read.
    pub fn has(&self, key: &str) -> bool {
        self.entries.iter().any(|entry| entry.key == key)
    }

    /// Reads true or false.
    pub fn bool(&mut self, key: &str) -> TomlKey<'d, bool> {
        self.value(key, "true or false", |node| match node.kind {
            NodeKind::Bool(value) => Some(value),
            _ => None,
        })
    }

    /// Reads a whole number.
    pub fn integer(&mut self, key: &str) -> TomlKey<'d, i64> {
        self.value(key, "a whole number", |node| match node.kind {
            NodeKind::Integer(value) => Some(value),
            _ => None,
        })
    }

    /// Reads a finite number, with or without decimals.
    pub fn number(&mut self, key: &str) -> TomlKey<'d, f64> {
        self.value(key, "a number", number)
    }

    /// Reads a text.
    pub fn string(&mut self, key: &str) -> TomlKey<'d, String> {
        self.value(key, "a text", string)
    }

    /// Reads a text that is not empty.
    pub fn name(&mut self, key: &str) -> TomlKey<'d, String> {
        self.value(key, "a text", string).check(|name| match name.trim().is_empty() {
            true => Err("is empty, must have at least one character".to_owned()),
            false => Ok(()),
        })
    }

    /// Reads one of a few words.
    pub fn choice<T: Copy>(&mut self, key: &str, choices: &[(&str, T)]) -> TomlKey<'d, T> {
        let words = || choices.iter().map(|(word, _)| *word);
        self.value(key, "a text", string).try_map(|found| {
            choices.iter().find(|(word, _)| *word == found).map(|(_, value)| *value).ok_or_else(|| {
                let near = nearest::suggestion(&found, words());
                format!("found {found:?}, allowed {}{near}", words().collect::<Vec<_>>().join(", "))
            })
        })
    }

    /// Reads a list of exactly `N` finite numbers: a point, a direction.
    pub fn vector<const N: usize>(&mut self, key: &str) -> TomlKey<'d, [f64; N]> {
        self.value(key, &format!("a list of {N} numbers"), vector)
    }

    /// Reads any number of lists of exactly `N` finite numbers: the points of a line.
    pub fn vectors<const N: usize>(&mut self, key: &str) -> TomlKey<'d, Vec<[f64; N]>> {
        self.value(key, &format!("lists of {N} numbers"), |node| match &node.kind {
            NodeKind::Array(points) => points.iter().map(vector).collect(),
            _ => None,
        })
    }

    /// Reads `R` lists of exactly `N` finite numbers: the rows of a matrix.
    pub fn matrix<const R: usize, const N: usize>(&mut self, key: &str) -> TomlKey<'d, [[f64; N]; R]> {
        self.value(key, &format!("{R} lists of {N} numbers"), |node| match &node.kind {
            NodeKind::Array(rows) => rows.iter().map(vector).collect::<Option<Vec<_>>>()?.try_into().ok(),
            _ => None,
        })
    }

    /// Reads a list of texts, each with its place.
    pub fn strings(&mut self, key: &str) -> TomlKey<'d, Vec<Located<String>>> {
        let place = self.place_of(key);
        self.value(key, "a list of texts", |node| match &node.kind {
            NodeKind::Array(values) => values
                .iter()
                .map(|value| {
                    let place = Place { key: place.clone(), offset: value.span.start };
                    Some(Located { value: string(value)?, place })
                })
                .collect(),
            _ => None,
        })
    }

    /// Reads a table below this one.
    pub fn table(&mut self, key: &str) -> TomlKey<'d, TomlTable<'d>> {
        let (document, path) = (self.document, self.place_of(key));
        self.value(key, "a table", |node| {
            let place = Place { key: path.clone(), offset: node.span.start };
            node.as_table().map(|entries| Self::new(document, place, entries))
        })
    }

    /// Reads a table below this one in which every key has a default; a missing one is empty.
    ///
    /// # Errors
    /// [`Reported`] if the key exists and is not a table.
    pub fn section(&mut self, key: &str) -> Result<TomlTable<'d>, Reported> {
        let empty = Self::new(self.document, self.missing_place(key), &[]);
        Ok(self.table(key).optional()?.unwrap_or(empty))
    }

    /// Reads the elements of an array of tables (`[[key]]`) in their order; a missing one has none.
    ///
    /// # Errors
    /// [`Reported`] if the key exists and is not an array of tables.
    pub fn tables(&mut self, key: &str) -> Result<Vec<TomlTable<'d>>, Reported> {
        let (document, path) = (self.document, self.place_of(key));
        let field = self.value(key, &format!("tables, each under [[{path}]]"), |node| match &node.kind {
            NodeKind::Array(values) => values
                .iter()
                .enumerate()
                .map(|(i, value)| {
                    let place = Place { key: format!("{path}[{}]", i + 1), offset: value.span.start };
                    value.as_table().map(|entries| Self::new(document, place, entries))
                })
                .collect(),
            _ => None,
        });
        Ok(field.optional()?.unwrap_or_default())
    }

    /// Keeps a table of options, which a plugin's declarations check later; a missing one is empty.
    pub fn options(&mut self, key: &str) -> RawOptions {
        let table = self.section(key);
        let place = table.as_ref().map_or_else(|_| self.missing_place(key), |table| table.place.clone());
        let entries = table.map(|table| table.entries.to_vec());
        RawOptions::new(self.document.source().clone(), place, entries)
    }

    /// Reads the raw value, for keys that accept several types.
    pub(crate) fn node(&mut self, key: &str) -> TomlKey<'d, &'d Node> {
        self.asked.push(key.to_owned());
        let Some(entry) = self.entries.iter().find(|entry| entry.key == key) else {
            return TomlKey::new(self.document, self.missing_place(key), Ok(None), self.excuse);
        };
        let place = Place { key: self.place_of(key), offset: entry.value.span.start };
        let state = match entry.value.kind {
            NodeKind::Broken => Err(self.document.broken()),
            _ => Ok(Some(&entry.value)),
        };
        TomlKey::new(self.document, place, state, self.excuse)
    }

    /// Reports every key that was never read, with the nearest name that could have been meant.
    pub fn finish(self) {
        self.finish_with(|near, asked| match near {
            Some(near) => format!("unknown key; did you mean \"{near}\"?"),
            None => format!("unknown key; allowed here: {}", asked.join(", ")),
        });
    }

    /// Reports unknown keys like [`TomlTable::finish`], with a message made from the nearest key and all keys that were
    /// read.
    pub(crate) fn finish_with(self, message: impl Fn(Option<&str>, &[String]) -> String) {
        for entry in self.entries.iter().filter(|entry| !self.asked.contains(&entry.key)) {
            let place = Place { key: self.place_of(&entry.key), offset: entry.key_span.start };
            let near = nearest::nearest(&entry.key, self.asked.iter().map(String::as_str));
            self.document.fault(&place, message(near, &self.asked));
        }
    }

    /// Reads the value of `key` with `read`; if it refuses, the fault contains the expected type.
    fn value<T>(
        &mut self,
        key: &str,
        expected: &str,
        read: impl FnOnce(&'d Node) -> Option<T>,
    ) -> TomlKey<'d, T> {
        self.node(key).try_map(|node| {
            read(node).ok_or_else(|| format!("found {}, expected {expected}", node.describe()))
        })
    }

    fn missing_place(&self, key: &str) -> Place {
        Place { key: self.place_of(key), offset: self.place.offset }
    }

    fn place_of(&self, key: &str) -> String {
        dotted(&self.place.key, key)
    }
}

/// Returns a finite number.
pub(crate) fn number(node: &Node) -> Option<f64> {
    match node.kind {
        // Whole numbers above 2^53 lose their last digits; no quantity of a plant has so many.
        NodeKind::Integer(value) => Some(value as f64),
        NodeKind::Float(value) => value.is_finite().then_some(value),
        _ => None,
    }
}

fn vector<const N: usize>(node: &Node) -> Option<[f64; N]> {
    match &node.kind {
        NodeKind::Array(values) => values.iter().map(number).collect::<Option<Vec<f64>>>()?.try_into().ok(),
        _ => None,
    }
}

fn string(node: &Node) -> Option<String> {
    match &node.kind {
        NodeKind::String(value) => Some(value.clone()),
        _ => None,
    }
}
