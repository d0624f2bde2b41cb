//! Pages `/strokes` (the recorded plates) and `/strokes?plate=N` (the strokes of one plate, as pictures, table and
//! files).

use maud::{Markup, html};
use platen_model::Texts;
use platen_report::sequence::{Sequence, SequenceStroke};

use super::{chip, clean, document, navigation};
use crate::view::View;
use crate::{PlateRow, StrokeRow, words};

/// Returns the page of all plates.
pub(crate) fn plates(plates: &[PlateRow], view: View) -> Markup {
    let text = |texts: Texts| texts.of(view.language);
    let body = html! {
        (navigation(view, "/strokes"))
        main {
            h1 { (text(words::STROKES)) }
            @if plates.is_empty() { p { (text(words::NO_STROKES)) } } @else {
                table {
                    thead { tr {
                        th scope="col" { (text(words::PLATE)) }
                        th scope="col" { (text(words::TIME)) }
                        th.n scope="col" { (text(words::STROKES)) }
                        th scope="col" { (text(words::VERDICT)) }
                        th scope="col" { (text(words::REPORT)) }
                    } }
                    tbody { @for plate in plates { tr {
                        td { a href=(view.link(&format!("/strokes?plate={}", plate.plate))) { (clean(&plate.name)) } }
                        td.t { (plate.first) }
                        td.n { (plate.strokes) }
                        td { (chip(view, plate.verdict, plate.sense)) }
                        td { a href=(format!("/plates/{}/report.html", plate.plate)) { (text(words::REPORT)) } }
                    } } }
                }
            }
        }
    };
    document(view, text(words::STROKES), "page", None, body)
}

/// Returns the page of one plate's strokes.
pub(crate) fn strokes(
    plate: u32,
    name: &str,
    strokes: &[StrokeRow],
    sequence: Option<&Sequence>,
    view: View,
) -> Markup {
    let text = |texts: Texts| texts.of(view.language);
    let newest = strokes.iter().rev().find(|stroke| stroke.gap_mm.is_some());
    let bends = |run: u32| sequence?.strokes.iter().find(|stroke| stroke.run_id == run);
    let body = html! {
        (navigation(view, "/strokes"))
        main {
            h1 { (text(words::PLATE)) " " (clean(name)) }
            p { a href=(format!("/plates/{plate}/report.html")) { (text(words::REPORT)) } }
            @if let Some(newest) = newest {
                img.wide src=(format!("/files/{}/strokes.svg", newest.run)) alt=(text(words::WORST_GAP));
            }
            form action="/compare" method="get" {
                @for (name, value) in view.pairs() { input type="hidden" name=(name) value=(value); }
                div.scroll tabindex="0" role="region" aria-label=(text(words::STROKES)) { table {
                    thead { tr {
                        th scope="col" { "a" } th scope="col" { "b" }
                        th.t scope="col" { (text(words::STROKE)) }
                        th scope="col" { (text(words::TIME)) }
                        th scope="col" { (text(words::VERDICT)) }
                        th.n scope="col" { (text(words::WORST_GAP)) }
                        th.n scope="col" { (text(words::OVERSHOOT)) }
                        th scope="col" { (text(words::BENDS)) }
                        th scope="col" { (text(words::FILES)) }
                    } }
                    tbody { @for (k, stroke) in strokes.iter().enumerate() { (row(stroke, bends(stroke.run), k, strokes.len(), view)) } }
                } }
                button type="submit" { (text(words::COMPARE)) }
            }
        }
    };
    document(view, name, "page", None, body)
}

fn row(stroke: &StrokeRow, bends: Option<&SequenceStroke>, k: usize, n: usize, view: View) -> Markup {
    let text = |texts: Texts| texts.of(view.language);
    let length = |mm: Option<f64>| mm.map_or(String::new(), |mm| view.length(mm));
    let measured = stroke.gap_mm.is_some();
    html! { tr {
        @for (name, chosen) in [("a", k + 2 == n), ("b", k + 1 == n)] {
            td { @if measured {
                input type="radio" name=(name) value=(stroke.run) checked[chosen]
                    aria-label=(format!("{name}: {} {}", text(words::STROKE), stroke.label));
            } }
        }
        td.t { (clean(&stroke.label)) }
        td.t { (stroke.accepted) }
        td { (chip(view, stroke.verdict, stroke.sense)) }
        @match stroke.gap_mm {
            Some(gap) => {
                td.n { (view.with_uncertainty(gap, stroke.uncertainty_mm.unwrap_or(f64::NAN))) }
                td.n { (length(bends.and_then(|bends| bends.overshoot_mm).filter(|mm| *mm > 0.0))) }
                td { @for bend in bends.and_then(|stroke| stroke.bends.as_deref()).unwrap_or_default() {
                    div {
                        span.t { (format!("{:.2}\u{b0} ({}, {})", bend.angle_deg, view.distance(bend.at_mm[0]), view.distance(bend.at_mm[1]))) }
                        @if let Some(feed) = bend.feed_mm { (format!("; {} {}", text(words::FEED), view.distance(feed))) }
                        @if let Some(again) = &bend.rehit_of { (format!("; {} ({})", text(words::REHIT), clean(again))) }
                    }
                } }
            }
            None => { td colspan="3" lang="en" { (stroke.reason.as_deref().map(clean).unwrap_or_default()) } }
        }
        td.files {
            @if measured { a href=(view.link(&format!("/plate?run={}", stroke.run))) { (text(words::PLATE_3D)) } }
            @for file in stroke.files.iter().filter(|file| !file.ends_with(".png")) { " " a href=(format!("/files/{}/{file}", stroke.run)) { (file) } }
        }
    } }
}
