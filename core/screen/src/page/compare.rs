//! Page `/compare?a=RUN&b=RUN`: two strokes on the same scale, with maps side by side, sections over each other, and
//! their figures with the difference.

use maud::{Markup, html};
use platen_model::Texts;
use platen_report::result::{CURVATURE_DEFICIT, ResultRecord, TemplateRecord};

use super::{chip, clean, document, navigation, section};
use crate::view::View;
use crate::words;

/// A figure of both strokes, with its expanded uncertainty (95 %).
struct Row {
    name: String,
    values: [Option<(f64, f64)>; 2],
}

/// Returns the page; without two strokes it explains how to choose them.
pub(crate) fn page(strokes: Option<[(u32, &ResultRecord); 2]>, view: View) -> Markup {
    let text = |texts: Texts| texts.of(view.language);
    let body = html! {
        (navigation(view, "/compare"))
        main {
            h1 { (text(words::COMPARE)) }
            @match strokes {
                None => { p { a href=(view.link("/strokes")) { (text(words::CHOOSE_TWO)) } } }
                Some(strokes) => { (compared(strokes, view)) }
            }
        }
    };
    document(view, text(words::COMPARE), "page", None, body)
}

fn compared(strokes: [(u32, &ResultRecord); 2], view: View) -> Markup {
    let text = |texts: Texts| texts.of(view.language);
    let [(_, a), (_, b)] = strokes;
    let alike = a.plate == b.plate && a.plate_file == b.plate_file;
    html! {
        div.pair {
            @for (run, record) in strokes {
                section {
                    h2 { (clean(&record.plate)) ", " (text(words::STROKE)) " " (record.stroke.map_or(String::new(), |n| n.to_string())) " " (chip(view, record.verdict, worst_sense(record))) }
                    @if alike {
                        img.wide src=(format!("/files/{run}/{}.svg", map(record))) alt=(text(words::MAP));
                    }
                }
            }
        }
        @if alike {
            div.pair {
                @for template in templates(a) {
                    @if let Some(other) = templates(b).find(|other| other.name == template.name) { (section::overlaid(template, other, view)) }
                }
            }
        } @else { p { (text(words::OTHER_PLATE)) } }
        table {
            thead { tr {
                th scope="col" { (text(words::FIGURE)) } th.n scope="col" { "a" } th.n scope="col" { "b" }
                th.n scope="col" { "b \u{2212} a" }
            } }
            tbody { @for row in rows([a, b]) { tr {
                th scope="row" lang="en" { (row.name) }
                @for value in row.values { td.n { (value.map_or("\u{2013}".to_owned(), |(value, u)| view.with_uncertainty(value, u))) } }
                td.n { (difference(row.values, view)) }
            } } }
        }
    }
}

/// Returns b - a with its uncertainty, or that there is no significant change.
fn difference(values: [Option<(f64, f64)>; 2], view: View) -> String {
    let [Some((a, u_a)), Some((b, u_b))] = values else { return "\u{2013}".to_owned() };
    let u = u_a.hypot(u_b);
    if (b - a).abs() <= u {
        return words::NO_CHANGE.of(view.language).to_owned();
    }
    view.with_uncertainty(b - a, u)
}

/// Returns the name of the map of the missing bend: of curvature if it was compared, else of height.
pub(super) fn map(record: &ResultRecord) -> &'static str {
    let is_curvature = |comparison: &serde_json::Value| comparison["plugin"] == "curvature";
    if record.comparisons.iter().any(is_curvature) { CURVATURE_DEFICIT } else { "deviation" }
}

fn templates(record: &ResultRecord) -> impl Iterator<Item = &TemplateRecord> {
    record.reference_lines.iter().flat_map(|line| &line.templates)
}

pub(super) fn worst_sense(record: &ResultRecord) -> i8 {
    platen_report::history_view::worst_template(record).map_or(0, |template| template.sense)
}

fn rows([a, b]: [&ResultRecord; 2]) -> Vec<Row> {
    let mut rows: Vec<Row> = templates(a)
        .map(|template| {
            let figure = |t: &TemplateRecord| (t.max_gap_mm, t.uncertainty_mm);
            let other = templates(b).find(|other| other.name == template.name);
            Row {
                name: format!("gap under {}", clean(&template.name)),
                values: [Some(figure(template)), other.map(figure)],
            }
        })
        .collect();
    let checks = |record: &ResultRecord| record.shape_checks.rows();
    let others = checks(b);
    rows.extend(checks(a).into_iter().filter(|(_, _, unit)| *unit == "mm").map(|(name, check, _)| {
        let other = others.iter().find(|(other, _, _)| *other == name);
        let values = [
            Some((check.value, check.uncertainty)),
            other.map(|(_, check, _)| (check.value, check.uncertainty)),
        ];
        Row { name, values }
    }));
    rows
}
