//! A parsed TOML document as an owned tree in which every key and value knows its place.

use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A value and where it stands.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Node {
    /// Bytes of the value in the text; of its header or key for a table that a header or a dotted key opened.
    pub(crate) span: Range<usize>,
    pub(crate) kind: Kind,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Kind {
    Bool(bool),
    Integer(i64),
    Float(f64),
    String(String),
    Datetime,
    Array(Vec<Node>),
    Table(Vec<Entry>),
    /// An integer or float beyond 64 bits.
    TooLarge,
    /// Broken syntax, reported already.
    Broken,
}

/// One key of a table.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Entry {
    pub(crate) key: String,
    /// Bytes of the key in the text.
    pub(crate) key_span: Range<usize>,
    pub(crate) value: Node,
}

impl Node {
    /// Takes over a parsed table, its keys in the order of the text.
    pub(crate) fn from_table(table: &Spanned<DeTable<'_>>) -> Self {
        Self { span: table.span(), kind: Kind::Table(entries(table.get_ref())) }
    }

    /// Takes over a parsed value.
    pub(crate) fn from_value(value: &Spanned<DeValue<'_>>) -> Self {
        let kind = match value.get_ref() {
            DeValue::Boolean(value) => Kind::Bool(*value),
            DeValue::Integer(value) => {
                i64::from_str_radix(value.as_str(), value.radix()).map_or(Kind::TooLarge, Kind::Integer)
            }
            DeValue::Float(value) => match value.as_str().parse::<f64>() {
                Ok(number) if number.is_infinite() && !value.as_str().contains("inf") => Kind::TooLarge,
                Ok(number) => Kind::Float(number),
                Err(_) => Kind::TooLarge,
            },
            DeValue::String(value) => Kind::String(value.to_string()),
            DeValue::Datetime(_) => Kind::Datetime,
            DeValue::Array(array) => Kind::Array(array.iter().map(Self::from_value).collect()),
            DeValue::Table(table) => Kind::Table(entries(table)),
        };
        Self { span: value.span(), kind }
    }

    /// What the value is, in the words of a message: `the text "north"`, `4000`, `a table`.
    pub(crate) fn describe(&self) -> String {
        match &self.kind {
            Kind::Bool(value) => value.to_string(),
            Kind::Integer(value) => value.to_string(),
            Kind::Float(value) => format!("{value:?}"),
            Kind::String(value) => format!("the text {value:?}"),
            Kind::Datetime => "a date or time".to_owned(),
            Kind::Array(values) if values.is_empty() => "an empty list".to_owned(),
            Kind::Array(values) if values.iter().all(|v| matches!(v.kind, Kind::Table(_))) => {
                "a list of tables".to_owned()
            }
            Kind::Array(values) => format!("a list of {}", values.len()),
            Kind::Table(_) => "a table".to_owned(),
            Kind::TooLarge => "a number beyond 64 bits".to_owned(),
            Kind::Broken => "broken text".to_owned(),
        }
    }

    /// Marks every value below this one for which `is_broken` holds, whole, with all that it holds.
    pub(crate) fn break_values(&mut self, is_broken: &impl Fn(&Self) -> bool) {
        let visit = |value: &mut Self| match is_broken(value) {
            true => value.kind = Kind::Broken,
            false => value.break_values(is_broken),
        };
        match &mut self.kind {
            Kind::Table(entries) => entries.iter_mut().for_each(|entry| visit(&mut entry.value)),
            Kind::Array(values) => values.iter_mut().for_each(visit),
            _ => {}
        }
    }

    /// The entries of a table.
    pub(crate) fn as_table(&self) -> Option<&[Entry]> {
        match &self.kind {
            Kind::Table(entries) => Some(entries),
            _ => None,
        }
    }
}

fn entries(table: &DeTable<'_>) -> Vec<Entry> {
    let mut entries: Vec<Entry> = table
        .iter()
        .map(|(key, value)| Entry {
            key: key.get_ref().to_string(),
            key_span: key.span(),
            value: Node::from_value(value),
        })
        .collect();
    entries.sort_by_key(|entry| entry.key_span.start);
    entries
}
