//! Page `/` for the operator, legible from two metres: verdict, place of the next hit, gap against its limit, states,
//! one alarm.

mod advice;

use maud::{Markup, html};
use platen_model::{Audience, Severity, Texts};
use platen_report::picture::PictureScale;
use platen_report::result::Next;

use super::{LivePage, class, clean, document, navigation};
use crate::cells::Cells;
use crate::view::View;
use crate::{ResultPart, Snapshot, Stage, words};

/// Strokes in the strip, and the size of its drawing.
const STRIP: usize = 16;
const STRIP_SIZE: [f64; 2] = [640.0, 100.0];
/// Size of the drawing of the gap against its limit.
const BAR_SIZE: [f64; 2] = [600.0, 48.0];
/// Fields for the map, in order of preference.
const FIELDS: [&str; 2] = ["curvature_deficit", "deviation"];

/// Returns the page.
pub(crate) fn page(snapshot: &Snapshot, view: View) -> Markup {
    let cells = cells(snapshot, view);
    let text = |texts: Texts| texts.of(view.language);
    let view_box = |[w, h]: [f64; 2]| format!("0 0 {w} {h}");
    let body = html! {
        header id="band" class=[cells.attribute("band", "class")] {
            h1 aria-live="polite" { (cells.span("verdict")) }
            (cells.p("why"))
            (cells.p("mode"))
        }
        main data-result="" {
            section.where {
                div.map { (cells.img("map")) (cells.img("overlay")) }
                (cells.p("remark"))
                (cells.p("advised-before"))
                svg.strip viewBox=(view_box(STRIP_SIZE)) preserveAspectRatio="none" role="img" aria-label=(text(words::STROKES)) {
                    (cells.rect("strip-limit"))
                    @for k in 0..STRIP { (cells.rect(&format!("strip-{k}"))) }
                }
            }
            section.figures {
                h2 { (cells.span("place-title")) }
                p.figure { (cells.span("left")) " " (cells.span("left-words")) }
                p.figure { (cells.span("near")) " " (cells.span("near-words")) }
                (cells.p("advice"))
                h2 { (cells.span("gap-title")) " " (cells.span("limit")) }
                p.figure { (cells.span("gap")) " " (cells.span("gap-more")) }
                svg.bar viewBox=(view_box(BAR_SIZE)) preserveAspectRatio="none" role="img" aria-label=(text(words::GAP)) {
                    @for id in ["bar-limit", "bar-gap", "bar-uncertainty"] { (cells.rect(id)) }
                }
            }
        }
        footer {
            p.alarm-line { (cells.span("alarm")) }
            (cells.p("stroke"))
            p.states {
                @for id in ["press", "scanner", "record"] { (cells.span(id)) }
            }
            (navigation(view, "/"))
        }
    };
    document(view, "platen", "operator", Some((LivePage::Operator, &snapshot.boot)), body)
}

/// Returns the cells of the page.
pub(super) fn cells(snapshot: &Snapshot, view: View) -> Cells {
    let mut cells = Cells::default();
    band(&mut cells, snapshot, view);
    place(&mut cells, snapshot, view);
    advice::cells(&mut cells, snapshot, view);
    gap(&mut cells, snapshot, view);
    strip(&mut cells, snapshot);
    states(&mut cells, snapshot, view);
    cells
}

/// Fills the band: the verdict of the present stroke, or else the current activity.
fn band(cells: &mut Cells, snapshot: &Snapshot, view: View) {
    let text = |texts: Texts| texts.of(view.language);
    let stage = snapshot.stroke.as_ref().map(|stroke| stroke.stage).filter(|stage| *stage != Stage::Done);
    let (verdict, why, look) = match (&snapshot.result, stage) {
        _ if !snapshot.press.in_step && snapshot.host.mode == "listen" => (words::LISTENING, None, "unknown"),
        _ if !snapshot.press.in_step => (words::NO_LINK, Some(words::NO_LINK_WHY), "unknown"),
        (_, Some(stage)) => (words::stage(stage), None, "busy"),
        (Some(result), None) => {
            let sense = sense(result);
            (words::verdict(result.verdict, sense), result.why, class(result.verdict, sense))
        }
        (None, None) if snapshot.press.ready => (words::READY, None, "ready"),
        (None, None) => (words::NOT_READY, None, "unknown"),
    };
    cells.text("verdict", text(verdict));
    let scanned = snapshot.stroke.as_ref().and_then(|stroke| stroke.scanned_percent);
    let scanned = scanned.filter(|_| look == "busy").map(|percent| format!("{percent} %"));
    cells.text("why", scanned.as_deref().unwrap_or(why.map_or("", text)));
    cells.class("band", format!("band {look}"));
    let mode = match snapshot.host.mode {
        _ if snapshot.host.simulated => text(words::SIMULATED),
        "dry-run" => text(words::TRIAL),
        _ => "",
    };
    cells.text("mode", mode);
}

fn sense(result: &ResultPart) -> i8 {
    result.worst.as_ref().map_or(0, |worst| worst.sense)
}

/// Fills the map and the place of the next hit.
fn place(cells: &mut Cells, snapshot: &Snapshot, view: View) {
    let text = |texts: Texts| texts.of(view.language).to_owned();
    let result = snapshot.result.as_ref();
    let field =
        result.and_then(|result| FIELDS.into_iter().find(|name| result.fields.iter().any(|f| f == name)));
    let picture = |ending: &str| {
        let (result, field) = (result?, field?);
        Some(view.link(&format!("/strokes/{}/{field}.{ending}", result.run)))
    };
    // Another address once the advice is there, since its line is drawn on the map.
    let advised = result.is_some_and(|result| result.advice.is_some());
    for (id, ending) in [("map", "png"), ("overlay", if advised { "svg?advised" } else { "svg" })] {
        cells.set(id, "src", picture(ending));
        cells.set(id, "alt", Some(if id == "map" { text(words::MAP) } else { String::new() }));
    }
    let again = result.is_some_and(|result| result.again);
    let next = result.and_then(|result| result.next.as_ref());
    cells.text("place-title", next.map_or(String::new(), |next| text(words::next(next, again))));
    let next = next.and_then(Next::place).zip(snapshot.plate.as_ref());
    let seen = next.and_then(|(place, plate)| Some((place, view.turn.of(plate.size_mm?, plate.press_side))));
    let [left, near] = seen.map_or([None; 2], |(place, seen)| seen.place_mm(place.at_mm).map(Some));
    let by_press = seen.is_some_and(|(_, seen)| seen.press_below);
    let near_words = if by_press { words::FROM_PRESS } else { words::FROM_BOTTOM };
    for (id, mm, texts) in [("left", left, words::FROM_LEFT), ("near", near, near_words)] {
        cells.text(id, mm.map_or(String::new(), |mm| view.distance(mm)));
        cells.text(format!("{id}-words"), mm.map_or(String::new(), |_| text(texts)));
    }
}

/// Fills the worst gap against its limit.
fn gap(cells: &mut Cells, snapshot: &Snapshot, view: View) {
    let worst = snapshot.result.as_ref().and_then(|result| result.worst.as_ref());
    let text = |texts: Texts| texts.of(view.language);
    let gap =
        worst.map(|worst| view.with_uncertainty(worst.gap_mm, worst.uncertainty_mm)).unwrap_or_default();
    // The figure is large; its uncertainty and unit beside it are small.
    let (gap, more) = gap.split_once(' ').unwrap_or_default();
    cells.text("gap-title", worst.map_or("", |_| text(words::GAP)));
    cells.text("gap", gap);
    cells.text("gap-more", more);
    let limit = worst
        .map_or(String::new(), |worst| format!("({} {})", text(words::LIMIT), view.length(worst.limit_mm)));
    cells.text("limit", limit);
    let [wide, high] = BAR_SIZE;
    let bars = worst.map_or([[0.0; 4]; 3], |worst| {
        let scale = PictureScale { limit_mm: worst.limit_mm, ..PictureScale::default() };
        let x = |gap_mm: f64| wide * scale.share(gap_mm.max(0.0));
        let gap = worst.gap_mm.abs();
        let (low, high_end) = (x(gap - worst.uncertainty_mm), x(gap + worst.uncertainty_mm));
        [
            [0.0, 0.0, x(worst.limit_mm), high],
            [0.0, 0.25 * high, x(gap), 0.5 * high],
            [low, 0.1 * high, (high_end - low).max(3.0), 0.8 * high],
        ]
    });
    let look = snapshot.result.as_ref().map_or("unknown", |result| class(result.verdict, sense(result)));
    for (id, bar) in ["bar-limit", "bar-gap", "bar-uncertainty"].into_iter().zip(bars) {
        cells.bar(id, bar, if id == "bar-gap" { look } else { id });
    }
}

/// Fills the strip of the strokes of this plate: gap against the limit.
fn strip(cells: &mut Cells, snapshot: &Snapshot) {
    let [wide, high] = STRIP_SIZE;
    let worst = snapshot.result.as_ref().and_then(|result| result.worst.as_ref());
    let scale =
        PictureScale { limit_mm: worst.map_or(1.0, |worst| worst.limit_mm), ..PictureScale::default() };
    let step = wide / STRIP as f64;
    let shown =
        if worst.is_some() { &snapshot.strip[snapshot.strip.len().saturating_sub(STRIP)..] } else { &[] };
    for k in 0..STRIP {
        let bar = shown.get(k).map(|stroke| {
            let tall = stroke.gap_mm.map_or(high, |gap| (high * scale.share(gap)).max(3.0));
            let look = if k + 1 == shown.len() { "now" } else { "earlier" };
            let unknown = if stroke.gap_mm.is_none() { " unknown" } else { "" };
            ([k as f64 * step + 4.0, high - tall, step - 8.0, tall], format!("{look}{unknown}"))
        });
        let (bar, look) = bar.unwrap_or_default();
        cells.bar(&format!("strip-{k}"), bar, &look);
    }
    let limit = worst.map_or(0.0, |worst| high * scale.share(worst.limit_mm));
    let bar = if worst.is_some() { [0.0, high - limit, wide, limit] } else { [0.0; 4] };
    cells.bar("strip-limit", bar, "bar-limit");
}

/// Fills stroke and plate, three states in words, and at most one alarm.
fn states(cells: &mut Cells, snapshot: &Snapshot, view: View) {
    let text = |texts: Texts| texts.of(view.language);
    let stroke = snapshot.stroke.as_ref().map(|stroke| {
        if stroke.baseline {
            return text(words::BLANK).to_owned();
        }
        format!("{} {}", text(words::STROKE), words::number(stroke.number, stroke.attempt, view.language))
    });
    let plate = snapshot.plate.as_ref().and_then(|plate| {
        let name = plate.id.clone().or_else(|| plate.part.map(|part| part.to_string()))?;
        Some(format!("{} {}", text(words::PLATE), clean(&name)))
    });
    let parts: Vec<String> = stroke.into_iter().chain(plate).collect();
    cells.text("stroke", if parts.is_empty() { text(words::NO_PLATE).to_owned() } else { parts.join(", ") });
    let press = match &snapshot.press {
        press if !press.in_step => (words::OUT_OF_STEP, false),
        press if !press.alive => (words::STANDS, false),
        _ => (words::IN_STEP, true),
    };
    let scanner =
        (words::scanner(snapshot.scanner.state), snapshot.scanner.state == crate::ScannerState::Ready);
    let record = (
        if snapshot.record.complete { words::COMPLETE } else { words::LOST_RECORDS },
        snapshot.record.complete,
    );
    for (id, name, (state, good)) in [
        ("press", words::PRESS, press),
        ("scanner", words::SCANNER, scanner),
        ("record", words::RECORD, record),
    ] {
        cells.text(id, format!("{}: {}", text(name), text(state)));
        cells.class(id, if good { "state" } else { "state bad" });
    }
    let mut alarms = snapshot.alarms.iter().filter(|alarm| alarm.audience == Audience::Operator);
    let (first, more) = (alarms.next(), alarms.count());
    let more = if more > 0 { format!(" (+{more} {})", text(words::MORE_ALARMS)) } else { String::new() };
    cells.text("alarm", first.map_or(String::new(), |alarm| words::alarm(alarm, view.language) + &more));
    let look = match first.map(|alarm| alarm.severity) {
        None => "none",
        Some(Severity::Error) => "error",
        Some(Severity::Warning) => "warning",
    };
    cells.class("alarm", format!("alarm {look}"));
}
