//! Owned tree of a parsed TOML document, with the place of every key and value.

use std::ops::Range;

use toml::Spanned;
use toml::de::{DeString, DeTable, DeValue};

/// Value and its place.
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
    /// Integer or float beyond 64 bits.
    TooLarge,
    /// Value that an error of syntax touches.
    Broken,
}

/// Entry of a table.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Entry {
    pub(crate) key: String,
    /// Bytes of the key in the text.
    pub(crate) key_span: Range<usize>,
    pub(crate) value: Node,
}

impl Node {
    /// Converts a parsed document. An inline value that overlaps one of `errors` becomes [`NodeKind::Broken`].
    pub(crate) fn from_document(document: &Spanned<DeTable<'_>>, errors: &[Range<usize>]) -> Self {
        Self { span: document.span(), kind: NodeKind::Table(entries(document.get_ref(), errors)) }
    }

    fn from_value(value: &Spanned<DeValue<'_>>, errors: &[Range<usize>]) -> Self {
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
            DeValue::Array(array) => {
                NodeKind::Array(array.iter().map(|value| Self::from_value(value, errors)).collect())
            }
            DeValue::Table(table) => NodeKind::Table(entries(table, errors)),
        };
        Self { span: value.span(), kind }
    }

    /// Returns the value in the words of a message: `the text "north"`, `4000`, `a table`.
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

    /// Returns the span of the broken value that an error at `span` touches.
    pub(crate) fn broken_at(&self, error: &Range<usize>) -> Option<Range<usize>> {
        match &self.kind {
            NodeKind::Broken => touch(error, &self.span).then(|| self.span.clone()),
            NodeKind::Table(entries) => entries.iter().find_map(|entry| entry.value.broken_at(error)),
            NodeKind::Array(values) => values.iter().find_map(|value| value.broken_at(error)),
            _ => None,
        }
    }

    pub(crate) fn as_table(&self) -> Option<&[Entry]> {
        match &self.kind {
            NodeKind::Table(entries) => Some(entries),
            _ => None,
        }
    }
}

/// Converts a table, its keys in the order of the text.
fn entries(table: &DeTable<'_>, errors: &[Range<usize>]) -> Vec<Entry> {
    let entry = |(key, value): (&Spanned<DeString<'_>>, &Spanned<DeValue<'_>>)| {
        let (key_span, span) = (key.span(), value.span());
        // The span of a table under a header is that of the header, which contains the key.
        let inline = key_span.end <= span.start;
        let value = match inline && errors.iter().any(|error| touch(error, &span)) {
            true => Node { span, kind: NodeKind::Broken },
            false => Node::from_value(value, errors),
        };
        Entry { key: key.get_ref().to_string(), key_span, value }
    };
    let mut entries: Vec<Entry> = table.iter().map(entry).collect();
    entries.sort_by_key(|entry| entry.key_span.start);
    entries
}

/// Returns whether two spans overlap or adjoin: the parser places an unclosed value's error behind it.
pub(crate) fn touch(a: &Range<usize>, b: &Range<usize>) -> bool {
    a.start <= b.end && b.start <= a.end
}
