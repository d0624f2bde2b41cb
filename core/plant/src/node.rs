//! A parsed TOML document as an owned tree in which every key and value knows its place.

use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A value and where it stands.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Node {
    /// Bytes of the value in the text; of its header or key for a table that a header or a dotted key opened.
    pub(crate) span: Range<usize>,
    pub(crate) kind: NodeKind,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum NodeKind {
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
        Self { span: table.span(), kind: NodeKind::Table(entries(table.get_ref())) }
    }

    /// Takes over a parsed value.
    pub(crate) fn from_value(value: &Spanned<DeValue<'_>>) -> Self {
        let kind = match value.get_ref() {
            DeValue::Boolean(value) => NodeKind::Bool(*value),
            DeValue::Integer(value) => i64::from_str_radix(value.as_str(), value.radix())
                .map_or(NodeKind::TooLarge, NodeKind::Integer),
            DeValue::Float(value) => match value.as_str().parse::<f64>() {
                Ok(number) if number.is_infinite() && !value.as_str().contains("inf") => NodeKind::TooLarge,
                Ok(number) => NodeKind::Float(number),
                Err(_) => NodeKind::TooLarge,
            },
            DeValue::String(value) => NodeKind::String(value.to_string()),
            DeValue::Datetime(_) => NodeKind::Datetime,
            DeValue::Array(array) => NodeKind::Array(array.iter().map(Self::from_value).collect()),
            DeValue::Table(table) => NodeKind::Table(entries(table)),
        };
        Self { span: value.span(), kind }
    }

    /// What the value is, in the words of a message: `the text "north"`, `4000`, `a table`.
    pub(crate) fn describe(&self) -> String {
        match &self.kind {
            NodeKind::Bool(value) => value.to_string(),
            NodeKind::Integer(value) => value.to_string(),
            NodeKind::Float(value) => format!("{value:?}"),
            NodeKind::String(value) => format!("the text {value:?}"),
            NodeKind::Datetime => "a date or time".to_owned(),
            NodeKind::Array(values) if values.is_empty() => "an empty list".to_owned(),
            NodeKind::Array(values) if values.iter().all(|v| matches!(v.kind, NodeKind::Table(_))) => {
                "a list of tables".to_owned()
            }
            NodeKind::Array(values) => format!("a list of {}", values.len()),
            NodeKind::Table(_) => "a table".to_owned(),
            NodeKind::TooLarge => "a number beyond 64 bits".to_owned(),
            NodeKind::Broken => "broken text".to_owned(),
        }
    }

    /// Marks every value below this one for which `is_broken` holds, whole, with all that it holds.
    pub(crate) fn break_values(&mut self, is_broken: &impl Fn(&Self) -> bool) {
        let visit = |value: &mut Self| match is_broken(value) {
            true => value.kind = NodeKind::Broken,
            false => value.break_values(is_broken),
        };
        match &mut self.kind {
            NodeKind::Table(entries) => entries.iter_mut().for_each(|entry| visit(&mut entry.value)),
            NodeKind::Array(values) => values.iter_mut().for_each(visit),
            _ => {}
        }
    }

    /// The entries of a table.
    pub(crate) fn as_table(&self) -> Option<&[Entry]> {
        match &self.kind {
            NodeKind::Table(entries) => Some(entries),
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
