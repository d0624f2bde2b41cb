//! Pictures of a stroke as SVG: maps of the plate, sections under templates, the strip of strokes so far.
//!
//! Legible at two metres. Scales of colours and heights follow from the plate file alone ([`PictureScale`]), never from the
//! stroke, so that two strokes can be compared side by side. The colour map diverges from neutral gray, blue against orange,
//! in steps of equal perceived difference; signed numbers stand beside it. Unseen areas are hatched.

mod canvas;
mod colour;
mod map;
mod scale;
mod section;
mod shades;
mod strip;
mod view;

pub use map::map;
pub use scale::PictureScale;
pub use section::section;
pub use strip::{StripPoint, strip};
pub use view::{Turn, Units, View};

use platen_model::Verdict;

/// Failure of the drawing library.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct PictureError(String);

/// Heading of a picture: plate, stroke and verdict.
#[derive(Debug, Clone, Copy)]
pub struct Caption<'a> {
    /// Name of the plate.
    pub plate: &'a str,
    /// Stroke, where there is one.
    pub stroke: Option<u64>,
    /// Verdict of the stroke.
    pub verdict: Verdict,
}

impl Caption<'_> {
    fn title(&self) -> String {
        match self.stroke {
            Some(number) => format!("{}, stroke {number}", self.plate),
            None => self.plate.to_owned(),
        }
    }
}

/// Formats millimetres with their sign, one decimal below 10 and none above; the minus sign is U+2212.
fn signed_mm(value: f64) -> String {
    let size = value.abs();
    let digits = if size < 9.95 { format!("{size:.1}") } else { format!("{size:.0}") };
    match digits.trim_matches(|c| c == '0' || c == '.').is_empty() {
        true => "0".to_owned(),
        false if value < 0.0 => format!("\u{2212}{digits}"),
        false => format!("+{digits}"),
    }
}

#[cfg(test)]
mod tests {
    use super::signed_mm;

    #[test]
    fn numbers_have_a_sign_and_no_more_digits_than_the_fit_knows() {
        let all =
            [(0.04, "0"), (0.26, "+0.3"), (-9.94, "\u{2212}9.9"), (9.96, "+10"), (-123.4, "\u{2212}123")];
        for (value, expected) in all {
            assert_eq!(signed_mm(value), expected);
        }
    }
}
