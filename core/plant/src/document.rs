//! Parsed TOML document with the faults found so far.

use std::cell::RefCell;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use toml::de::DeTable;

use crate::duplicate::{self, DUPLICATE};
use crate::node::{Entry, Node, touch};
use crate::source::{Place, Source};
use crate::{Error, Fault, Faults, TomlTable};

/// Limits for a text that may be TOML: number of syntax errors that are reported, and number of errors after which it
/// is parsed again.
const MOST_ERRORS: usize = 500;
const MOST_PARSES: usize = 20;

/// Proof that a fault has been recorded. Only [`Document`] makes it, so no reader can refuse a file without a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reported(());

/// Parsed TOML document: [`Document::root`] returns its table, [`Document::finish`] the result or all faults.
///
/// Faults are collected: a reader continues after a fault, and takes its values out with `?` when everything has been
/// read.
///
/// ```
/// use platen_plant::{Document, Faults, Reported, TomlTable};
///
/// struct Oven { name: String, heat_kw: f64 }
///
/// fn oven(mut table: TomlTable<'_>) -> Result<Oven, Reported> {
///     let name = table.string("name").required();
///     let heat_kw = table.number("heat_kw").in_range(1.0..=500.0).or(90.0);
///     table.finish();
///     Ok(Oven { name: name?, heat_kw: heat_kw? })
/// }
///
/// let document = Document::parse("oven.toml", "name = 7\nheat_kw = 900\ncolor = 'red'\n");
/// let oven = oven(document.root());
/// let faults = document.finish(oven).err().unwrap();
/// assert_eq!(
///     faults.to_string(),
///     "oven.toml:1:8: name: found 7, expected a text\n\
///      oven.toml:2:11: heat_kw: found 900, allowed 1 to 500\n\
///      oven.toml:3:1: color: unknown key; allowed here: name, heat_kw"
/// );
/// ```
#[derive(Debug)]
pub struct Document {
    source: Arc<Source>,
    path: String,
    root: Node,
    faults: RefCell<Vec<Fault>>,
}

impl Document {
    /// Parses `text`. Faults of syntax are kept until [`Document::finish`], and the rest of the file is read as well.
    ///
    /// The parser recovers from an error, but one mistake may cause several errors and may hide keys. Of the errors in
    /// one value or one line only the first is reported, the value is skipped, and no key is reported as missing. Lines
    /// after which the parser would lose the following tables are blanked, and the text is parsed again. A key that is
    /// defined twice hides nothing: its first value is read.
    pub fn parse(file: impl Into<String>, text: impl Into<String>) -> Self {
        let mut source = Source { file: file.into(), text: text.into(), syntax_errors: Vec::new() };
        let mut readable = source.text.clone();
        let mut faults = Vec::new();
        let root = 'parse: loop {
            let (table, mut errors) = DeTable::parse_recoverable(&readable);
            errors.sort_by_key(|error| span(error).start);
            errors.truncate(MOST_ERRORS);
            let doubled: Vec<_> = errors.extract_if(.., |error| error.message() == DUPLICATE).collect();
            let spans: Vec<Range<usize>> = errors.iter().map(span).collect();
            let root = Node::from_document(&table, &spans);
            let mut reported = Vec::new();
            let mut end = None;
            for (error, at) in errors.iter().zip(&spans) {
                if end.is_some_and(|end| at.start <= end) {
                    continue;
                }
                let fault =
                    source.fault(&Place { key: String::new(), offset: at.start }, error.message().to_owned());
                let (line, value) = (line_of(&readable, at.start), root.broken_at(at));
                let hiding = lines_that_hide(&readable, &line, value.as_ref());
                if let Some(lines) = hiding.filter(|_| faults.len() < MOST_PARSES) {
                    faults.push(fault);
                    source.syntax_errors.push(at.clone());
                    readable = blanked(&readable, &lines);
                    continue 'parse;
                }
                reported.push(fault);
                end = Some(value.map_or(line.end, |value| value.end.max(line.end)));
            }
            faults.extend(reported);
            faults.extend(doubled.iter().map(|error| duplicate::fault(&source, &root, &span(error))));
            source.syntax_errors.extend(spans);
            break root;
        };
        Self { source: Arc::new(source), path: String::new(), root, faults: RefCell::new(faults) }
    }

    /// Reads and parses a file.
    ///
    /// # Errors
    /// [`Error::Unreadable`] when the file cannot be opened, [`Error::Faulty`] with the place when it is not UTF-8.
    pub fn load(path: &Path) -> Result<Self, Error> {
        let file = path.display().to_string();
        let bytes =
            std::fs::read(path).map_err(|source| Error::Unreadable { path: path.to_owned(), source })?;
        let text = String::from_utf8(bytes).map_err(|error| {
            let offset = error.utf8_error().valid_up_to();
            let text = String::from_utf8_lossy(error.as_bytes()).into_owned();
            let source = Source { file: file.clone(), text, syntax_errors: Vec::new() };
            let message = "this byte is not UTF-8; save the file as UTF-8".to_owned();
            Faults::one(source.fault(&Place { key: String::new(), offset }, message))
        })?;
        Ok(Self::parse(file, text))
    }

    /// Makes a document of a part of another one.
    pub(crate) fn part(source: Arc<Source>, path: String, root: Node) -> Self {
        Self { source, path, root, faults: RefCell::default() }
    }

    /// Returns the root table.
    pub fn root(&self) -> TomlTable<'_> {
        TomlTable::new(self, Place { key: self.path.clone(), offset: self.root.span.start }, self.entries())
    }

    /// Records a fault at `place`, unless an error of syntax lies there.
    pub fn fault(&self, place: &Place, message: impl Into<String>) -> Reported {
        if !self.source.syntax_errors.iter().any(|error| touch(error, &(place.offset..place.offset))) {
            self.faults.borrow_mut().push(self.source.fault(place, message.into()));
        }
        Reported(())
    }

    /// Records a fault that already has a place.
    pub(crate) fn report(&self, fault: Fault) -> Reported {
        self.faults.borrow_mut().push(fault);
        Reported(())
    }

    /// Records that something is missing, unless an error of syntax may have hidden it.
    pub(crate) fn absent(&self, place: &Place, message: impl Into<String>) -> Reported {
        if self.source.syntax_errors.is_empty() {
            return self.fault(place, message);
        }
        Reported(())
    }

    /// Returns the proof for a value that an error of syntax has broken.
    pub(crate) fn broken(&self) -> Reported {
        Reported(())
    }

    /// Returns `file:line:column` of a place, for a message about another one.
    pub fn locate(&self, place: &Place) -> String {
        let (line, column) = self.source.line_column(place.offset);
        format!("{}:{line}:{column}", self.source.file)
    }

    /// Returns `result` if there is no fault.
    ///
    /// # Errors
    /// All faults of the file in the order of their places.
    pub fn finish<T>(self, result: Result<T, Reported>) -> Result<T, Faults> {
        match (Faults::new(self.faults.into_inner()), result) {
            (None, Ok(value)) => Ok(value),
            (Some(faults), _) => Err(faults),
            (None, Err(Reported(()))) => {
                let place = Place { key: self.path, offset: 0 };
                Err(Faults::one(self.source.fault(&place, "cannot be read".to_owned())))
            }
        }
    }

    pub(crate) fn source(&self) -> &Arc<Source> {
        &self.source
    }

    fn entries(&self) -> &[Entry] {
        self.root.as_table().unwrap_or_default()
    }
}

fn span(error: &toml::de::Error) -> Range<usize> {
    error.span().unwrap_or(0..0)
}

/// Returns the bytes of the line that contains `offset`, without its line end.
fn line_of(text: &str, offset: usize) -> Range<usize> {
    let (before, after) = text.split_at_checked(offset).unwrap_or((text, ""));
    let start = before.rfind('\n').map_or(0, |newline| newline + 1);
    start..before.len() + after.find('\n').unwrap_or(after.len())
}

/// Replaces the characters of `lines` by spaces, so that every other byte keeps its place.
fn blanked(text: &str, lines: &Range<usize>) -> String {
    let mut blanked = text[..lines.start].to_owned();
    for letter in text[lines.clone()].chars() {
        blanked.extend(std::iter::repeat_n(if letter == '\n' { '\n' } else { ' ' }, letter.len_utf8()));
    }
    blanked + &text[lines.end..]
}

/// Returns the lines that make the parser lose the tables after an error in `line`: the lines of an unclosed `value`
/// down to the next header, or a line that is neither a header nor a key with a value.
fn lines_that_hide(text: &str, line: &Range<usize>, value: Option<&Range<usize>>) -> Option<Range<usize>> {
    let header = |line: &str| {
        let line = line.trim_start();
        let name = line.trim_start_matches('[').trim_start();
        line.starts_with('[')
            && name.starts_with(|c: char| c.is_alphabetic() || c == '_')
            && !line.contains(',')
    };
    match value {
        None => {
            let content = &text[line.clone()];
            (!content.trim().is_empty() && !header(content)).then(|| line.clone())
        }
        Some(value) => {
            let mut start = value.start;
            let lost = text[value.clone()].split_inclusive('\n').find_map(|line| {
                start += line.len();
                text[start..].lines().next().is_some_and(header).then_some(start)
            });
            lost.filter(|&end| end < value.end).map(|end| line_of(text, value.start).start..end)
        }
    }
}
