//! Options of a plugin: declared by the plugin, given in the plant file, checked here.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::document::{Document, Reported};
use crate::key::TomlKey;
use crate::nearest;
use crate::node::{Entry, Node, NodeKind};
use crate::source::{Place, Source};
use crate::table::{TomlTable, number};
use crate::unit::Unit;
use crate::{Fault, Faults};

/// Type of an option.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum OptionType {
    /// True or false.
    Bool,
    /// A whole number, with or without a unit.
    Int,
    /// A number, with or without a unit.
    Float,
    /// A text.
    String,
    /// One of [`OptionDecl::choices`].
    Choice,
    /// A file or folder; a relative one starts at the folder of the plant file.
    Path,
    /// A time, in seconds unless [`OptionDecl::unit`] is another unit of time.
    Duration,
    /// A list of numbers.
    Floats,
}

impl OptionType {
    /// Returns the name for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bool => "true or false",
            Self::Int => "whole number",
            Self::Float => "number",
            Self::String => "text",
            Self::Choice => "choice",
            Self::Path => "path",
            Self::Duration => "duration",
            Self::Floats => "list of numbers",
        }
    }
}

/// Declaration of one option by its plugin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OptionDecl {
    /// The key: `[a-z][a-z0-9_]*`.
    pub name: String,
    /// Type.
    pub kind: OptionType,
    /// Symbol of the unit of a bare number, for [`Unit::find`]; none for pure numbers.
    pub unit: Option<String>,
    /// Smallest number allowed, of each element of a list, in the declared unit.
    pub min: Option<f64>,
    /// Largest number allowed.
    pub max: Option<f64>,
    /// Words of a choice.
    pub choices: Vec<String>,
    /// Value where the plant file gives none, as TOML text.
    pub default: Option<String>,
    /// Required in the plant file.
    pub required: bool,
    /// Purpose, in one sentence.
    pub doc: String,
    /// Value kept out of logs and records. May be given as `{ env = "NAME" }` or `{ file = "PATH" }`.
    pub secret: bool,
}

/// Checked value. Numbers are in the declared unit, durations in seconds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Value {
    /// Of a [`OptionType::Bool`].
    Bool(bool),
    /// Of a [`OptionType::Int`].
    Int(i64),
    /// Of a [`OptionType::Float`].
    Float(f64),
    /// Of a [`OptionType::Duration`], seconds whatever the declared unit.
    Duration(f64),
    /// Of a [`OptionType::String`] or [`OptionType::Choice`].
    String(String),
    /// Of a [`OptionType::Path`].
    Path(PathBuf),
    /// Of a [`OptionType::Floats`].
    Floats(Vec<f64>),
}

/// Value of one option and its origin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OptionValue {
    /// Name of the option.
    pub name: String,
    /// Value.
    pub value: Value,
    /// Given in the plant file; else the default.
    pub given: bool,
}

/// Unchecked options of one plugin with their places in the plant file.
#[derive(Debug, Clone, PartialEq)]
pub struct RawOptions {
    source: Arc<Source>,
    place: Place,
    /// Proof of a fault if the file has a value that is not a table.
    entries: Result<Vec<Entry>, Reported>,
}

impl RawOptions {
    pub(crate) fn new(source: Arc<Source>, place: Place, entries: Result<Vec<Entry>, Reported>) -> Self {
        Self { source, place, entries }
    }

    /// Returns an empty set, for a plugin that no plant file uses; messages contain `owner` in place of a file.
    pub fn none(owner: &str) -> Self {
        let source = Source { file: owner.to_owned(), text: String::new(), syntax_errors: Vec::new() };
        Self::new(Arc::new(source), Place { key: String::new(), offset: 0 }, Ok(Vec::new()))
    }

    /// Makes a fault of the options as a whole.
    /// Returns every text among the values.
    pub fn texts(&self) -> impl Iterator<Item = &str> {
        let entries = self.entries.as_ref().map_or(&[][..], Vec::as_slice);
        entries.iter().filter_map(|entry| match &entry.value.kind {
            NodeKind::String(text) => Some(text.as_str()),
            _ => None,
        })
    }

    pub(crate) fn fault(&self, message: String) -> Fault {
        self.source.fault(&self.place, message)
    }

    fn document(&self, entries: &[Entry]) -> Document {
        let span = self.place.offset..self.place.offset;
        let root = Node { span, kind: NodeKind::Table(entries.to_vec()) };
        Document::part(self.source.clone(), self.place.key.clone(), root)
    }

    fn folder(&self) -> &Path {
        Path::new(&self.source.file).parent().unwrap_or(Path::new(""))
    }
}

/// Checks the options given for `plugin` against its declarations.
///
/// Returns one value per option that is given or has a default, in the order of the declarations.
///
/// # Errors
/// Every fault: unknown names with the nearest, wrong types, units and ranges, missing required options; also a default
/// that its own declaration refuses, under the plugin's name in place of a file.
pub fn check_options(
    plugin: &str,
    raw: &RawOptions,
    declared: &[OptionDecl],
) -> Result<Vec<OptionValue>, Faults> {
    // Options that are not a table were reported with the file.
    let Ok(entries) = &raw.entries else { return Ok(Vec::new()) };
    let document = raw.document(entries);
    let mut table = document.root();
    let mut faults = Vec::new();
    let mut values = Vec::new();
    for option in declared {
        match option.read(&mut table, raw.folder()).optional() {
            Ok(Some(value)) => values.push(OptionValue { name: option.name.clone(), value, given: true }),
            Ok(None) => match option.default_value(plugin) {
                Ok(default) => values.extend(default.map(|value| OptionValue {
                    name: option.name.clone(),
                    value,
                    given: false,
                })),
                Err(bad) => faults.extend(bad),
            },
            Err(Reported { .. }) => {}
        }
        if option.required && !table.has(&option.name) {
            document.absent(
                &Place { key: format!("{}.{}", raw.place.key, option.name), offset: raw.place.offset },
                format!("missing; {plugin} needs it: {} ({option})", option.doc),
            );
        }
    }
    table.finish_with(|near, _| unknown(plugin, near, declared));
    if let Err(more) = document.finish(Ok(())) {
        faults.extend(more);
    }
    match Faults::new(faults) {
        Some(faults) => Err(faults),
        None => Ok(values),
    }
}

fn unknown(plugin: &str, near: Option<&str>, declared: &[OptionDecl]) -> String {
    if let Some(option) = declared.iter().find(|option| near == Some(option.name.as_str())) {
        return format!("{plugin} has no such option; did you mean \"{}\" ({option})?", option.name);
    }
    match declared.iter().map(|option| option.name.as_str()).collect::<Vec<_>>() {
        names if names.is_empty() => format!("{plugin} has no options"),
        names => format!("{plugin} has no such option; allowed here: {}", names.join(", ")),
    }
}

impl OptionDecl {
    /// Returns the default, checked as a given value is. Relative paths are left as they are.
    /// Returns the value where the plant file gives none.
    ///
    /// # Errors
    /// A default that its own declaration refuses, under the plugin's name in place of a file.
    pub fn default_value(&self, plugin: &str) -> Result<Option<Value>, Faults> {
        let Some(default) = &self.default else { return Ok(None) };
        let document = Document::parse(plugin, format!("{} = {default}", self.name));
        let mut table = document.root();
        let value = self.read(&mut table, Path::new("")).optional();
        document.finish(value)
    }

    fn read<'d>(&self, table: &mut TomlTable<'d>, folder: &Path) -> TomlKey<'d, Value> {
        let name = &self.name;
        match self.kind {
            OptionType::Bool => table.bool(name).map(Value::Bool),
            OptionType::Int => table.node(name).try_map(|node| self.int(node)).map(Value::Int),
            OptionType::Float => table.node(name).try_map(|node| self.float(node)).map(Value::Float),
            OptionType::Duration => table
                .node(name)
                .try_map(|node| self.float(node))
                .map(|value| Value::Duration(self.declared_unit().to(value, Unit::SECOND))),
            OptionType::String if self.secret => {
                table.node(name).try_map(|node| secret(node, folder)).map(Value::String)
            }
            OptionType::String => table.string(name).map(Value::String),
            OptionType::Choice => table.string(name).check(|found| self.chosen(found)).map(Value::String),
            OptionType::Path => table.name(name).map(|path| Value::Path(folder.join(path))),
            OptionType::Floats => table.node(name).try_map(|node| self.floats(node)).map(Value::Floats),
        }
    }

    fn chosen(&self, found: &str) -> Result<(), String> {
        if self.choices.iter().any(|choice| choice == found) {
            return Ok(());
        }
        let near = nearest::suggestion(found, self.choices.iter().map(String::as_str));
        Err(format!("found {found:?}, allowed {}{near}", self.choices.join(", ")))
    }

    fn int(&self, node: &Node) -> Result<i64, String> {
        let value = match &node.kind {
            NodeKind::Integer(value) => *value,
            NodeKind::String(text) if self.unit.is_some() => whole(self.declared_unit().read(text)?)
                .ok_or_else(|| {
                    format!("found {text:?}, expected a whole number of {}", self.declared_unit().symbol())
                })?,
            _ => return Err(format!("found {}, expected a whole number", node.describe())),
        };
        self.in_range(value as f64, node).map(|()| value)
    }

    fn float(&self, node: &Node) -> Result<f64, String> {
        let measured = self.unit.is_some() || self.kind == OptionType::Duration;
        let value = match (&node.kind, number(node)) {
            (_, Some(value)) => value,
            (NodeKind::String(text), _) if measured => self.declared_unit().read(text)?,
            _ => return Err(format!("found {}, expected a number", node.describe())),
        };
        self.in_range(value, node).map(|()| value)
    }

    fn floats(&self, node: &Node) -> Result<Vec<f64>, String> {
        match &node.kind {
            NodeKind::Array(values) => values.iter().map(|value| self.float(value)).collect(),
            _ => Err(format!("found {}, expected a list of numbers", node.describe())),
        }
    }

    fn in_range(&self, value: f64, node: &Node) -> Result<(), String> {
        let inside = self.min.is_none_or(|min| value >= min) && self.max.is_none_or(|max| value <= max);
        if inside { Ok(()) } else { Err(format!("found {}, allowed {}", node.describe(), self.range())) }
    }

    /// Returns the declared unit; seconds for a duration without one.
    fn declared_unit(&self) -> Unit {
        let default = if self.kind == OptionType::Duration { Unit::SECOND } else { Unit::ONE };
        self.unit.as_deref().and_then(Unit::find).unwrap_or(default)
    }

    /// Returns `0.6 to 130 m`.
    fn range(&self) -> String {
        let range = match (self.min, self.max) {
            (Some(min), Some(max)) => format!("{min} to {max}"),
            (Some(min), None) => format!("at least {min}"),
            (None, Some(max)) => format!("at most {max}"),
            (None, None) => return String::new(),
        };
        if self.declared_unit() == Unit::ONE {
            range
        } else {
            format!("{range} {}", self.declared_unit().symbol())
        }
    }
}

/// Formats as `number in m, 0.6 to 130 m, default 30`.
impl fmt::Display for OptionDecl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.kind.name())?;
        if self.declared_unit() != Unit::ONE {
            write!(f, " in {}", self.declared_unit().symbol())?;
        }
        if !self.choices.is_empty() {
            write!(f, ": {}", self.choices.join(", "))?;
        }
        if self.min.or(self.max).is_some() {
            write!(f, ", {}", self.range())?;
        }
        match &self.default {
            Some(default) => write!(f, ", default {default}"),
            None if self.required => f.write_str(", required"),
            None => Ok(()),
        }
    }
}

fn whole(value: f64) -> Option<i64> {
    // Above 2^53 a f64 cannot represent every whole number.
    (value.fract() == 0.0 && value.abs() <= 9_007_199_254_740_992.0).then_some(value as i64)
}

/// Returns a secret text, given directly or by its variable or file. No message quotes it.
fn secret(node: &Node, folder: &Path) -> Result<String, String> {
    let entries = match &node.kind {
        NodeKind::String(text) => return Ok(text.clone()),
        NodeKind::Table(entries) => entries.as_slice(),
        _ => &[],
    };
    match entries {
        [Entry { key, value: Node { kind: NodeKind::String(name), .. }, .. }] if key == "env" => {
            std::env::var(name).map_err(|_| format!("the environment variable {name} is not set"))
        }
        [Entry { key, value: Node { kind: NodeKind::String(name), .. }, .. }] if key == "file" => {
            let path = folder.join(name);
            let text =
                std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
            Ok(text.trim_end_matches(['\r', '\n']).to_owned())
        }
        _ => Err("expected a text, { env = \"NAME\" } or { file = \"PATH\" }".to_owned()),
    }
}
