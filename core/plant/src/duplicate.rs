//! Faults of keys and headers that are defined twice; the parser keeps the first value and drops the second.

use std::ops::Range;

use crate::Fault;
use crate::node::{Entry, Node, NodeKind};
use crate::source::{Place, Source, dotted};

/// The parser's message.
pub(crate) const DUPLICATE: &str = "duplicate key";

/// Returns the fault of the key or header whose second definition the parser found at `second`, with the place of the
/// first.
pub(crate) fn fault(source: &Source, root: &Node, second: &Range<usize>) -> Fault {
    let text = &source.text;
    let (key, first) = match header(line_at(text, second.start)) {
        Some(path) => (path.to_owned(), first_header(text, path)),
        None => {
            let name = text.get(second.clone()).unwrap_or_default().trim_matches(['"', '\'']);
            let mut owner = (String::new(), root);
            find_owner(root, "", source, second.start, &mut owner);
            let (path, table) = owner;
            let first = table.as_table().unwrap_or_default().iter().find(|entry| entry.key == name);
            (dotted(&path, name), first.map(|entry| entry.key_span.start))
        }
    };
    let first = first.filter(|&first| first < second.start).map(|first| source.line_column(first));
    let message = match first {
        Some((line, column)) => {
            format!("defined twice, first at {}:{line}:{column}; remove one", source.file)
        }
        None => "defined twice; remove one".to_owned(),
    };
    source.fault(&Place { key, offset: second.start }, message)
}

/// Sets `owner` to the path and node of the last table in the text that begins before `offset` and, if inline, contains
/// it.
fn find_owner<'a>(
    node: &'a Node,
    path: &str,
    source: &Source,
    offset: usize,
    owner: &mut (String, &'a Node),
) {
    let opened_by_header = source.text.as_bytes().get(node.span.start) == Some(&b'[');
    let children: Vec<(String, &Node)> = match &node.kind {
        NodeKind::Table(entries) => {
            let before = node.span.start < offset && owner.1.span.start <= node.span.start;
            if before && (opened_by_header || node.span.end > offset) {
                *owner = (path.to_owned(), node);
            }
            entries.iter().map(|Entry { key, value, .. }| (dotted(path, key), value)).collect()
        }
        NodeKind::Array(values) => {
            values.iter().enumerate().map(|(i, value)| (format!("{path}[{}]", i + 1), value)).collect()
        }
        _ => return,
    };
    for (path, child) in children {
        find_owner(child, &path, source, offset, owner);
    }
}

/// Returns the path in the header with which `text` begins.
fn header(text: &str) -> Option<&str> {
    let (path, _) = text.trim_start().strip_prefix('[')?.trim_start_matches('[').split_once(']')?;
    (!path.contains(['{', ',', '=', '\n'])).then_some(path.trim())
}

fn first_header(text: &str, path: &str) -> Option<usize> {
    let mut start = 0;
    text.split_inclusive('\n').find_map(|line| {
        let at = start + line.find(path).unwrap_or(0);
        start += line.len();
        (header(line) == Some(path)).then_some(at)
    })
}

/// Returns the text from the start of the line that contains `offset`.
fn line_at(text: &str, offset: usize) -> &str {
    let (before, after) = text.split_at_checked(offset).unwrap_or((text, ""));
    let start = before.rfind('\n').map_or(0, |newline| newline + 1);
    if after.is_empty() { "" } else { &text[start..] }
}
