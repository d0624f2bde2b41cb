//! Page `/plate?run=RUN`: the plate in 3D with the colours of its map; a browser without WebGL shows the map.

use maud::{Markup, html};
use platen_model::Texts;
use platen_report::result::ResultRecord;

use super::{chip, clean, document, navigation};
use crate::server::assets;
use crate::view::View;
use crate::words;

/// Returns the page.
pub(crate) fn page(run: u32, record: &ResultRecord, view: View) -> Markup {
    let text = |texts: Texts| texts.of(view.language);
    let map = |ending: &str| format!("/files/{run}/{}.{ending}", super::compare::map(record));
    let number = record.stroke.map_or(String::new(), |n| n.to_string());
    let body = html! {
        script type="module" src=(assets::address("plate.js")) {}
        (navigation(view, "/plate"))
        main {
            h1 { (text(words::PLATE)) " " (clean(&record.plate)) ", " (text(words::STROKE)) " " (number) " " (chip(view, record.verdict, super::compare::worst_sense(record))) }
            p.buttons {
                @for height in [1, 5, 20] {
                    button type="button" data-height=(height) aria-pressed=(if height == 5 { "true" } else { "false" }) { (text(words::HEIGHT)) " x" (height) }
                }
                @for (name, texts) in [("scanner", words::SCANNER), ("press", words::PRESS), ("above", words::ABOVE)] {
                    button type="button" data-from=(name) { (text(texts)) }
                }
            }
            canvas id="plate" data-mesh=(format!("/strokes/{run}/mesh.bin")) data-map=(map("png")) tabindex="0"
                aria-label=(text(words::MAP)) {}
            p id="height" { (text(words::HEIGHT)) " x5" }
            div.map id="flat" hidden {
                p { (text(words::NO_WEBGL)) }
                img src=(map("svg")) alt=(text(words::MAP));
            }
        }
    };
    document(view, &record.plate, "page", None, body)
}
