//! Page `/engineer`: registers, timeline, link, scanner, plugins, alarms and files, updated every second.

use maud::{Markup, html};
use platen_model::Texts;

use super::{LivePage, clean, document, navigation};
use crate::cells::Cells;
use crate::view::View;
use crate::{Engineer, Snapshot, words};

/// Strokes of the timeline.
const TIMELINE: usize = 20;

/// Returns the page.
pub(crate) fn page(snapshot: &Snapshot, engineer: &Engineer, view: View) -> Markup {
    let text = |texts: Texts| texts.of(view.language);
    let cells = cells(snapshot, engineer, view);
    let table = |head: &[Texts], rows: Markup| {
        html! { table { thead { tr { @for name in head { th scope="col" { (text(*name)) } } } } tbody { (rows) } } }
    };
    let registers = |block: usize| {
        html! { @for (k, row) in engineer.registers[block].iter().enumerate() { tr {
            td.n { (row.address) } td.n { (40_001 + u32::from(row.address)) } td.n { (row.words) }
            th scope="row" { (row.name) }
            td { (cells.span(&format!("register-{block}-{k}"))) }
        } } }
    };
    let pairs = |rows: &[(String, String)], id: Option<&str>| {
        html! { @for (k, (name, value)) in rows.iter().enumerate() { tr {
            th scope="row" { (name) }
            td { @match id { Some(id) => { (cells.span(&format!("{id}-{k}"))) } None => { (clean_path(value)) } } }
        } } }
    };
    let body = html! {
        (navigation(view, "/engineer"))
        main data-result="" {
            h1 { (text(words::ENGINEER)) }
            p { (cells.span("verdict")) " " (cells.span("why")) }
            p { a href="/api/v1/diagnosis" download="platen-diagnosis.json" { (text(words::DIAGNOSIS)) } }
            div.pair {
                section { h2 { (text(words::STATE)) } (table(&[words::NAME, words::VALUE], pairs(&engineer.figures, Some("figure")))) }
                section { h2 { (text(words::ALARMS)) } (table(&[words::CODE, words::TEXT, words::COUNT], html! {
                    @for k in 0..ALARMS { tr { @for part in ["code", "text", "count"] { td { (cells.span(&format!("alarm-{k}-{part}"))) } } } }
                })) }
            }
            section { h2 { (text(words::TIMELINE)) } (table(&[words::STROKE, words::VERDICT, words::SCAN_END, words::RESULT, words::ACKNOWLEDGED], html! {
                @for k in 0..TIMELINE { tr { @for part in ["stroke", "verdict", "0", "1", "2"] { td { (cells.span(&format!("time-{k}-{part}"))) } } } }
            })) }
            div.pair {
                section { h2 { (text(words::REGISTERS_READ)) } (table(&[words::ADDRESS, words::CODE, words::WORDS, words::NAME, words::VALUE], registers(0))) }
                section { h2 { (text(words::REGISTERS_WRITTEN)) } (table(&[words::ADDRESS, words::CODE, words::WORDS, words::NAME, words::VALUE], registers(1))) }
            }
            section { h2 { (text(words::PLUGINS)) } (table(&[words::USE, words::NAME, words::VERSION, words::STATE, words::FILE], html! {
                @for (k, plugin) in engineer.plugins.iter().enumerate() { tr {
                    td { (plugin.role) } th scope="row" { (clean(&plugin.name)) } td { (clean(&plugin.version)) } td { (cells.span(&format!("plugin-{k}"))) } td { (clean_path(&plugin.file)) }
                } }
            })) }
            section { h2 { (text(words::FILES_IN_FORCE)) } (table(&[words::FILE, words::CHECKSUM], pairs(&engineer.files, None))) }
        }
    };
    document(view, text(words::ENGINEER), "page", Some((LivePage::Engineer, &snapshot.boot)), body)
}

/// Number of rows for alarms: more kinds than these have not been raised together.
const ALARMS: usize = 12;

/// Returns the cells of the page.
pub(super) fn cells(snapshot: &Snapshot, engineer: &Engineer, view: View) -> Cells {
    let mut cells = Cells::default();
    cells.text("verdict", snapshot.host.state.clone());
    cells.text("why", snapshot.host.mode);
    for (block, rows) in engineer.registers.iter().enumerate() {
        for (k, row) in rows.iter().enumerate() {
            cells.text(format!("register-{block}-{k}"), clean(&row.value));
        }
    }
    for (k, plugin) in engineer.plugins.iter().enumerate() {
        cells.text(format!("plugin-{k}"), clean(&plugin.state));
    }
    for (k, (_, value)) in engineer.figures.iter().enumerate() {
        cells.text(format!("figure-{k}"), value.clone());
    }
    for k in 0..ALARMS {
        let row = engineer.alarms.get(k);
        let parts = row.map(|(code, text, count)| [code.to_string(), text.clone(), format!("{count} x")]);
        for (part, text) in ["code", "text", "count"].into_iter().zip(parts.unwrap_or_default()) {
            cells.text(format!("alarm-{k}-{part}"), text);
        }
    }
    for k in 0..TIMELINE {
        let row = engineer.timeline.get(k);
        cells.text(format!("time-{k}-stroke"), row.map_or("", |row| &row.stroke));
        let verdict = row.map_or("", |row| words::verdict(row.verdict, 0).of(view.language));
        cells.text(format!("time-{k}-verdict"), verdict);
        for step in 0..3 {
            let ms = row.and_then(|row| row.steps_ms[step]);
            cells.text(format!("time-{k}-{step}"), ms.map_or(String::new(), |ms| format!("{ms:.0}")));
        }
    }
    cells
}

/// Returns a path in full: it may be longer than a name.
fn clean_path(path: &str) -> String {
    path.split('/').map(clean).collect::<Vec<_>>().join("/")
}
