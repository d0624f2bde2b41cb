//! Pages, each rendered completely on the server; [`live`] returns the cells that a page keeps up to date.

mod compare;
mod engineer;
mod operator;
mod plate;
mod section;
mod strokes;

pub(crate) use compare::page as compare;
pub(crate) use engineer::page as engineer;
pub(crate) use operator::page as operator;
pub(crate) use plate::page as plate;
pub(crate) use strokes::{plates, strokes};

use maud::{DOCTYPE, Markup, html};
use platen_model::{Texts, Verdict};

use crate::cells::Cells;
use crate::server::assets;
use crate::source::present;
use crate::view::{Theme, View};
use crate::{CYCLE_LIMIT, Source, words};

/// A page that keeps itself up to date.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum LivePage {
    /// `/`.
    Operator,
    /// `/engineer`.
    Engineer,
}

impl LivePage {
    /// Returns the page's name in the address of its events.
    fn name(self) -> &'static str {
        match self {
            Self::Operator => "operator",
            Self::Engineer => "engineer",
        }
    }

    /// Returns the page of a name.
    pub(crate) fn from_name(name: &str) -> Option<Self> {
        [Self::Operator, Self::Engineer].into_iter().find(|page| page.name() == name)
    }

    /// Returns its present cells.
    pub(crate) fn cells(self, source: &dyn Source, view: View) -> Cells {
        let snapshot = present(source);
        match self {
            Self::Operator => operator::cells(&snapshot, view),
            Self::Engineer => engineer::cells(&snapshot, &source.engineer(), view),
        }
    }
}

/// Returns a document. A live page contains the address of its events, and the words that are shown when they stop.
fn document(view: View, title: &str, class: &str, live: Option<(LivePage, &str)>, body: Markup) -> Markup {
    let text = |texts: Texts| texts.of(view.language);
    let theme = if view.theme == Theme::Dark { "dark" } else { "light" };
    html! {
        (DOCTYPE)
        html lang=(view.lang()) {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (title) }
                link rel="stylesheet" href=(assets::address("style.css"));
                link rel="icon" href=(assets::address("icon.svg"));
                @if let Some((page, boot)) = live {
                    script type="module" src=(assets::address("live.js")) {}
                    noscript { meta http-equiv="refresh" content="2"; }
                    meta name="platen-live" content=(view.link(&format!("/live/{}", page.name())))
                        data-boot=(boot) data-cycle-ms=(CYCLE_LIMIT.as_millis())
                        data-lost=(text(words::LOST)) data-lost-remedy=(text(words::LOST_REMEDY))
                        data-stuck=(text(words::STUCK)) data-stuck-remedy=(text(words::STUCK_REMEDY));
                }
            }
            body class={ (class) " " (theme) } { (body) }
        }
    }
}

/// Returns the links between the pages.
fn navigation(view: View, here: &str) -> Markup {
    let link = |path: &str, texts: Texts| {
        let current = (path == here).then_some("page");
        html! { a href=(view.link(path)) aria-current=[current] { (texts.of(view.language)) } }
    };
    html! {
        nav aria-label="platen" {
            (link("/", words::OPERATOR))
            (link("/strokes", words::STROKES))
            (link("/compare", words::COMPARE))
            (link("/engineer", words::ENGINEER))
        }
    }
}

/// Returns a verdict as a chip of its colour.
fn chip(view: View, verdict: Verdict, sense: i8) -> Markup {
    html! { span class={ "chip " (class(verdict, sense)) } { (words::verdict(verdict, sense).of(view.language)) } }
}

/// Returns the class of a verdict: its colour.
fn class(verdict: Verdict, sense: i8) -> &'static str {
    match (verdict, sense) {
        (Verdict::Pass, _) => "pass",
        (Verdict::Fail, 1..) => "far",
        (Verdict::Fail, _) => "more",
        (Verdict::CannotTell | Verdict::NotMeasured, _) => "unknown",
    }
}

/// Returns a text from a person, a press or a plugin in a form that is safe to show: without control characters and
/// marks that change the writing direction, and not longer than 64 characters.
pub(crate) fn clean(text: &str) -> String {
    clean_to(64, text)
}

/// Returns a sentence of a plugin, cleaned as by [`clean`] and not longer than 240 characters.
pub(crate) fn clean_sentence(text: &str) -> String {
    clean_to(240, text)
}

fn clean_to(most: usize, text: &str) -> String {
    let is_mark = |c: char| matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{feff}');
    let shown = |c: char| if c.is_control() || is_mark(c) { '\u{fffd}' } else { c };
    let mut clean: String = text.chars().take(most).map(shown).collect();
    if text.chars().nth(most).is_some() {
        clean.push('\u{2026}');
    }
    clean
}

#[cfg(test)]
mod tests {
    use super::clean;

    #[test]
    fn marks_and_control_characters_are_replaced_and_long_texts_end() {
        assert_eq!(clean("A\u{202e}12\n"), "A\u{fffd}12\u{fffd}");
        assert_eq!(clean("<b>"), "<b>", "escaping is the renderer's");
        assert_eq!(clean(&"\u{202b}".repeat(10_000)).chars().count(), 65);
    }
}
