//! Faults of TOML syntax, sorted out so that one slip is one message, and doubled keys with both their places.

use std::ops::Range;

use crate::Fault;
use crate::node::{Entry, Node, NodeKind};
use crate::source::{Place, Source};

/// What the parser complained of.
#[derive(Debug, Default)]
pub(crate) struct Syntax {
    pub(crate) faults: Vec<Fault>,
    /// Bytes in which nothing can be trusted: what is said of them later would only repeat the syntax fault.
    pub(crate) broken: Vec<Range<usize>>,
}

const DUPLICATE: &str = "duplicate key";

impl Syntax {
    /// Turns the parser's complaints about `source`, which it recovered to `root`, into faults.
    pub(crate) fn sort_out(source: &Source, root: &Node, errors: &[toml::de::Error]) -> Self {
        let mut syntax = Self::default();
        let mut errors: Vec<(Range<usize>, &str)> =
            errors.iter().map(|error| (error.span().unwrap_or(0..0), error.message())).collect();
        errors.sort_by_key(|(span, _)| span.start);
        for (span, message) in &errors {
            if *message == DUPLICATE {
                syntax.faults.push(duplicate(source, root, span));
            } else if !syntax.covers(span.start) {
                syntax.add(source, root, span, message, &errors);
            }
        }
        syntax
    }

    /// Whether `offset` lies in broken text, its end included.
    pub(crate) fn covers(&self, offset: usize) -> bool {
        self.broken.iter().any(|range| range.start <= offset && offset <= range.end)
    }

    /// Whether broken text takes part in a value. The parser lets the header after a broken one begin at the broken one:
    /// of a header only its end counts.
    pub(crate) fn breaks(&self, source: &Source, value: &Node) -> bool {
        let Range { start, end } = value.span;
        let start = if under_header(source, value) { end.saturating_sub(1) } else { start };
        self.broken.iter().any(|range| start < range.end && range.start < end)
    }

    fn add(
        &mut self,
        source: &Source,
        root: &Node,
        span: &Range<usize>,
        message: &str,
        all: &[(Range<usize>, &str)],
    ) {
        let line = source.line_of(span.start);
        let value = value_at(source, root, span.start).filter(|value| value.len() > line.len());
        let unclosed = value.as_ref().and_then(|value| {
            let inside = |span: &Range<usize>| value.start <= span.start && span.start <= value.end;
            all.iter().find(|(span, message)| inside(span) && message.starts_with("unclosed"))
        });
        let broken = value.unwrap_or_else(|| section(source, line));
        let (offset, message) = match unclosed {
            Some((_, message)) => (broken.start, *message),
            None => (span.start, message),
        };
        let place = Place { key: String::new(), offset };
        self.faults.push(source.fault(&place, in_plain_words(message, span)));
        self.broken.push(broken);
    }
}

/// The line, or, when it is a broken header, all lines down to the next header: their keys have no home.
fn section(source: &Source, line: Range<usize>) -> Range<usize> {
    if !source.text[line.clone()].trim_start().starts_with('[') {
        return line;
    }
    let rest = &source.text[line.end..];
    let end = rest.match_indices('\n').find(|(at, _)| rest[at + 1..].trim_start().starts_with('['));
    line.start..end.map_or(source.text.len(), |(at, _)| line.end + at)
}

/// The parser's sentence, mended where it would mislead.
fn in_plain_words(message: &str, span: &Range<usize>) -> String {
    if message.starts_with("string values must be quoted") {
        return if span.is_empty() { "a value is missing" } else { "text needs quotes: \"...\"" }.to_owned();
    }
    message.replace(", expected nothing", "")
}

/// Bytes of the value after the equals sign of the key that holds `offset`.
fn value_at(source: &Source, table: &Node, offset: usize) -> Option<Range<usize>> {
    let children: Vec<&Node> = match &table.kind {
        NodeKind::Table(entries) => entries.iter().map(|entry| &entry.value).collect(),
        NodeKind::Array(values) => values.iter().collect(),
        _ => return None,
    };
    children.into_iter().find_map(|child| {
        let holds = child.span.start <= offset && offset <= child.span.end && !under_header(source, child);
        if holds { Some(child.span.clone()) } else { value_at(source, child, offset) }
    })
}

/// Whether a table, or every table of an array, was opened by a header and not by braces.
fn under_header(source: &Source, node: &Node) -> bool {
    match &node.kind {
        NodeKind::Table(_) => source.text.as_bytes().get(node.span.start) == Some(&b'['),
        NodeKind::Array(values) => {
            !values.is_empty() && values.iter().all(|value| under_header(source, value))
        }
        _ => false,
    }
}

fn duplicate(source: &Source, root: &Node, span: &Range<usize>) -> Fault {
    let name = source.text.get(span.clone()).unwrap_or_default().trim_matches(['"', '\'']);
    let (key, first) = match header_path(source, span.start) {
        Some(path) => (path.clone(), first_header(source, &path, span.start)),
        None => {
            let (path, entries) = owner(source, root, span.start);
            let key = if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") };
            (key, first_key(source, entries, name, span.start))
        }
    };
    let message = match first.map(|offset| source.line_column(offset)) {
        Some((line, column)) => {
            format!("defined twice, first at {}:{line}:{column}; remove one", source.file)
        }
        None => "defined twice; remove one".to_owned(),
    };
    source.fault(&Place { key, offset: span.start }, message)
}

/// The dotted path of the header that holds `offset`, when the line is a header.
fn header_path(source: &Source, offset: usize) -> Option<String> {
    let line = &source.text[source.line_of(offset)];
    let path = line.trim_start().strip_prefix('[')?.trim_start_matches('[').split(']').next()?;
    (!path.contains(['{', ',', '='])).then(|| path.chars().filter(|c| !c.is_whitespace()).collect())
}

fn first_header(source: &Source, path: &str, before: usize) -> Option<usize> {
    let mut start = 0;
    for line in source.text[..source.line_of(before).start].split_inclusive('\n') {
        if header_path(source, start).as_deref() == Some(path) {
            return Some(start + line.len() - line.trim_start().len());
        }
        start += line.len();
    }
    None
}

/// Path and entries of the table in which the key at `offset` stands: of the innermost braces round it, else of the
/// last header before it.
fn owner<'a>(source: &Source, root: &'a Node, offset: usize) -> (String, &'a [Entry]) {
    let mut best = (None, String::new(), root.as_table().unwrap_or_default());
    let mut stack = vec![(String::new(), root)];
    while let Some((path, node)) = stack.pop() {
        match &node.kind {
            NodeKind::Table(entries) => {
                let braces = source.text.as_bytes().get(node.span.start) == Some(&b'{');
                let holds = (braces && node.span.contains(&offset))
                    || (under_header(source, node) && node.span.end <= offset);
                if holds && !path.is_empty() && best.0.is_none_or(|start| start < node.span.start) {
                    best = (Some(node.span.start), path.clone(), entries);
                }
                let below = |entry: &'a Entry| match path.as_str() {
                    "" => (entry.key.clone(), &entry.value),
                    path => (format!("{path}.{}", entry.key), &entry.value),
                };
                stack.extend(entries.iter().map(below));
            }
            NodeKind::Array(values) => {
                let numbered = |(i, value)| (format!("{path}[{}]", i + 1), value);
                stack.extend(values.iter().enumerate().map(numbered));
            }
            _ => {}
        }
    }
    (best.1, best.2)
}

/// Where `key` is first written among `entries`, or below them by a dotted key.
fn first_key(source: &Source, entries: &[Entry], key: &str, before: usize) -> Option<usize> {
    let direct = entries.iter().find(|entry| entry.key == key && entry.key_span.start < before);
    direct.map(|entry| entry.key_span.start).or_else(|| {
        let dotted = |node: &Node| !matches!(source.text.as_bytes().get(node.span.start), Some(b'{' | b'['));
        entries
            .iter()
            .filter(|entry| dotted(&entry.value))
            .filter_map(|entry| entry.value.as_table())
            .find_map(|entries| first_key(source, entries, key, before))
    })
}
