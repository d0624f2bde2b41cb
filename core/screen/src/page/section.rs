//! Sections of two strokes under one template, drawn over each other: height of the face above the chord between the
//! template's ends.

use maud::{Markup, html};
use platen_report::result::TemplateRecord;

use super::clean;
use crate::view::View;
use crate::words;

/// Size of the drawing, and its margin.
const SIZE: [f64; 2] = [640.0, 200.0];
const MARGIN: f64 = 10.0;

/// Draws the sections of strokes a and b on one scale.
pub(super) fn overlaid(a: &TemplateRecord, b: &TemplateRecord, view: View) -> Markup {
    let largest =
        |t: &TemplateRecord| t.height_mm.iter().fold(0.0_f64, |most, height| most.max(height.abs()));
    let full = largest(a).max(largest(b)).max(1.0);
    let [wide, high] = SIZE;
    let middle = 0.5 * high;
    let points = |template: &TemplateRecord| {
        let n = template.height_mm.len().max(2) as f64 - 1.0;
        let x = |k: usize| MARGIN + (wide - 2.0 * MARGIN) * k as f64 / n;
        let y = |height: f64| middle - (middle - MARGIN) * height / full;
        let seen = template.height_mm.iter().zip(&template.seen).enumerate().filter(|(_, (_, seen))| **seen);
        seen.map(|(k, (height, _))| format!("{:.1},{:.1}", x(k), y(*height))).collect::<Vec<_>>().join(" ")
    };
    let name = clean(&b.name);
    html! {
        figure {
            svg.section viewBox=(format!("0 0 {wide} {high}")) role="img" aria-label=(name) {
                line x1=(MARGIN) x2=(wide - MARGIN) y1=(middle) y2=(middle) class="chord" {}
                polyline points=(points(a)) class="a" {}
                polyline points=(points(b)) class="b" {}
            }
            figcaption {
                (name) ": " (words::SECTIONS.of(view.language)) " \u{b1}" (view.length(full))
            }
        }
    }
}
