//! Scales of colours and heights, fixed for a plate by its plate file.
//!
//! Gaps are shown on a ladder of 1, 2, 5, 10, 20 and 50 times the limit, at equal steps of colour or height. Curvatures
//! are shown as the gap that they open under a template of chord c: g = delta kappa c^2 / 8.

use serde::{Deserialize, Serialize};

use platen_model::units::{metres, mm};
use platen_model::{Target, TargetShape, Texts};
use platen_plant::PlateFile;

use super::words;
use super::{Units, View};
use crate::result::CURVATURE_DEFICIT;

/// Limit and chord of a template where the plate file has none, millimetres: 3 mm on 2 m, usual in the trade.
const USUAL: [f64; 2] = [3.0, 2000.0];

/// Steps of the ladder as multiples of the limit: fine near the limit, coarse towards the unbent plate.
const LADDER: [f64; 6] = [1.0, 2.0, 5.0, 10.0, 20.0, 50.0];

const EVEN: usize = 4;

/// Parameters of the scales of a plate's pictures. They depend on its plate file alone, so that no stroke changes them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PictureScale {
    /// Smallest limit of the plate's templates, millimetres.
    pub limit_mm: f64,
    /// Chord of the first template, millimetres.
    pub chord_mm: f64,
    /// Strongest curvature of the target, 1/m.
    pub bend_per_m: f64,
}

impl Default for PictureScale {
    /// Returns the parameters of a plate without templates and target.
    fn default() -> Self {
        let [limit_mm, chord_mm] = USUAL;
        Self { limit_mm, chord_mm, bend_per_m: 10.0 * per_m(limit_mm, chord_mm) }
    }
}

impl PictureScale {
    /// Returns the parameters of a plate.
    pub fn of(plate: &PlateFile) -> Self {
        let limits = plate.templates.iter().map(|template| mm(template.limit));
        let limit_mm = limits.filter(|limit| *limit > 0.0).min_by(f64::total_cmp).unwrap_or(USUAL[0]);
        let chord_mm = plate.templates.first().map_or(USUAL[1], |template| mm(template.chord));
        let radius = plate.target.as_ref().and_then(smallest_radius);
        let by_template = 10.0 * per_m(limit_mm, chord_mm);
        Self { limit_mm, chord_mm, bend_per_m: radius.map_or(by_template, |radius| 1.0 / radius) }
    }

    /// Returns the curvature that opens a gap of the limit under the template, 1/m.
    pub fn tolerance_per_m(&self) -> f64 {
        per_m(self.limit_mm, self.chord_mm)
    }

    /// Returns the position of a gap on the ladder, from 0 for none to 1 for the largest that is distinguished.
    pub fn share(&self, gap_mm: f64) -> f64 {
        self.gaps().position(gap_mm.abs())
    }

    pub(super) fn gaps(&self) -> Scale {
        let anchors = LADDER.map(|step| step * self.limit_mm).to_vec();
        Scale { anchors, unit: Unit::Length, factor: 1000.0, inverted: false, words: None, locked: true }
    }

    /// Returns title and scale of a field; `largest` is its largest value, for fields without a scale of the plate.
    pub(super) fn field(&self, name: &str, unit: &str, largest: f64, view: View) -> (String, Scale) {
        let titled = |text: Texts, value: &str| words::fill(text.of(view.language), &[value]);
        let (template, towards) = (view.units.whole(self.chord_mm), words::TOWARDS.of(view.language));
        // Gap to curvature: delta kappa = 8 g / c^2.
        let as_gap = Scale { factor: 1.0 / per_m(1.0, self.chord_mm), ..self.gaps() };
        match name {
            CURVATURE_DEFICIT => (
                titled(words::STILL_TO_BEND, &template),
                Scale { inverted: true, words: Some([words::TOO_FAR, words::BEND_MORE]), ..as_gap },
            ),
            "curvature_change" => (titled(words::BENT, &template), as_gap),
            "deviation" => (titled(words::DEVIATION, towards), self.gaps()),
            "displacement_normal" => (titled(words::MOVED, towards), self.gaps()),
            _ if unit == "m" => (name.replace('_', " "), self.gaps()),
            _ if unit == "1/m" => {
                let words = curvature_words(name).map(|text| titled(text, towards));
                let scale = Scale::even(1.5 * self.bend_per_m, "1/m", true);
                (words.unwrap_or_else(|| name.replace('_', " ")), scale)
            }
            _ if unit == "1/m2" => {
                (name.replace('_', " "), Scale::even(1.5 * self.bend_per_m.powi(2), "1/m\u{b2}", true))
            }
            _ => {
                let title = name.replace('_', " ") + words::OWN_SCALE.of(view.language);
                (title, Scale::even(largest, "", false))
            }
        }
    }
}

/// Returns the curvature that opens a gap under a template, 8 g / c^2, 1/m.
fn per_m(gap_mm: f64, chord_mm: f64) -> f64 {
    8.0 * metres(gap_mm) / metres(chord_mm).powi(2)
}

fn smallest_radius(target: &Target) -> Option<f64> {
    match target.shape {
        TargetShape::Flat => None,
        TargetShape::Cylinder { radius, .. } | TargetShape::Sphere { radius } => Some(radius),
        TargetShape::Cone { radius_start, radius_end, .. } => Some(radius_start.min(radius_end)),
        TargetShape::Torus { radius, cross_radius, .. } => Some(radius.min(cross_radius.abs())),
    }
}

fn curvature_words(name: &str) -> Option<Texts> {
    match name {
        "kappa_u" => Some(words::KAPPA_U),
        "kappa_v" => Some(words::KAPPA_V),
        "kappa_uv" => Some(words::KAPPA_UV),
        "kappa_max" => Some(words::KAPPA_MAX),
        "kappa_min" => Some(words::KAPPA_MIN),
        _ => None,
    }
}

/// Unit of the numbers of a scale.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Unit {
    /// Millimetres, shown in the unit of lengths of the view.
    Length,
    /// Another unit, as it is shown.
    Other(&'static str),
}

/// Symmetric scale: values at equal steps of colour or height.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Scale {
    /// Ascending positive values in the unit of the scale.
    pub(super) anchors: Vec<f64>,
    /// Unit.
    pub(super) unit: Unit,
    /// Factor from the field's unit to that of the scale.
    pub(super) factor: f64,
    /// The positive side is blue.
    pub(super) inverted: bool,
    /// Names of the negative and the positive side.
    pub(super) words: Option<[Texts; 2]>,
    /// Whether the scale is the same for every stroke of the plate.
    pub(super) locked: bool,
}

impl Scale {
    fn even(full: f64, unit: &'static str, locked: bool) -> Self {
        let full = nice_ceiling(full.max(1e-12));
        let anchors = (1..=EVEN).map(|k| full * k as f64 / EVEN as f64).collect();
        Self { anchors, unit: Unit::Other(unit), factor: 1.0, inverted: false, words: None, locked }
    }

    /// Returns the position of a value in the unit of the scale, -1 to 1; values beyond the scale are at its ends.
    pub(super) fn position(&self, value: f64) -> f64 {
        let size = value.abs();
        let above = self.anchors.iter().take_while(|anchor| **anchor <= size).count();
        let Some(next) = self.anchors.get(above) else { return value.signum() };
        let from = above.checked_sub(1).map_or(0.0, |k| self.anchors[k]);
        let steps = above as f64 + (size - from) / (next - from);
        value.signum() * steps / self.anchors.len() as f64
    }

    /// Returns the position of its colour, negative for blue.
    pub(super) fn colour_position(&self, value: f64) -> f64 {
        self.of_colour(self.position(value))
    }

    /// Converts a position on the scale to that of its colour.
    pub(super) fn of_colour(&self, position: f64) -> f64 {
        if self.inverted { -position } else { position }
    }

    /// Returns the symbol of the unit shown.
    pub(super) fn symbol(&self, units: Units) -> &'static str {
        match self.unit {
            Unit::Length => units.symbol(),
            Unit::Other(symbol) => symbol,
        }
    }

    /// Formats a number with its sign.
    pub(super) fn number(&self, value: f64, units: Units) -> String {
        if self.unit == Unit::Length {
            return units.signed(value);
        }
        // Three digits at the end of the scale.
        let last = self.anchors.last().copied().unwrap_or(1.0);
        let decimals = (2.0 - last.log10().floor()).max(0.0) as usize;
        let text = format!("{value:+.decimals$}").replace('-', "\u{2212}");
        let is_zero = !text.contains(|c: char| ('1'..='9').contains(&c));
        if is_zero { "0".to_owned() } else { text }
    }
}

/// Returns the smallest of 1, 2 and 5 times a power of ten that is not below `value`.
pub(super) fn nice_ceiling(value: f64) -> f64 {
    let power = 10.0_f64.powf(value.log10().floor());
    [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|step| step * power)
        .find(|nice| *nice >= value * (1.0 - 1e-12))
        .unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PICTURE_SCALE: PictureScale =
        PictureScale { limit_mm: 3.0, chord_mm: 2000.0, bend_per_m: 1.0 / 9.0 };

    fn field(name: &str, unit: &str, largest: f64) -> (String, Scale) {
        PICTURE_SCALE.field(name, unit, largest, View::FILE)
    }

    #[test]
    fn scales_end_on_round_numbers() {
        for (value, expected) in [(0.7, 1.0), (1.0, 1.0), (1.2, 2.0), (3.3, 5.0), (7.0, 10.0), (420.0, 500.0)]
        {
            assert!((nice_ceiling(value) - expected).abs() < 1e-9 * expected);
        }
    }

    #[test]
    fn a_ladder_is_symmetric_and_rises_evenly_from_limit_to_limit() {
        let scale = PICTURE_SCALE.gaps();
        for (value, steps) in
            [(0.0, 0.0), (1.5, 0.5), (3.0, 1.0), (4.5, 1.5), (6.0, 2.0), (150.0, 6.0), (900.0, 6.0)]
        {
            assert!((scale.position(value) - steps / 6.0).abs() < 1e-12, "{value}");
            assert!((scale.position(-value) + steps / 6.0).abs() < 1e-12, "-{value}");
        }
    }

    #[test]
    fn the_scale_is_that_of_the_plate_whatever_the_stroke_holds() {
        for name in ["deviation", "displacement_normal", "curvature_deficit", "kappa_u"] {
            let unit = if name.starts_with('d') { "m" } else { "1/m" };
            assert_eq!(field(name, unit, 1e-3).1, field(name, unit, 1e3).1);
            assert!(field(name, unit, 1.0).1.locked);
        }
        assert!(!field("somebody_elses", "K", 1.0).1.locked, "and the title names it where it is not");
    }

    #[test]
    fn missing_curvature_is_shown_as_the_gap_under_the_template_blue_where_more_is_wanted() {
        let (_, scale) = field("curvature_deficit", "1/m", 1.0);
        // 3 mm on 2 m is 0.006 1/m.
        assert!((0.006 * scale.factor - 3.0).abs() < 1e-9);
        assert!(scale.colour_position(3.0) < 0.0 && scale.colour_position(-3.0) > 0.0);
    }
}
