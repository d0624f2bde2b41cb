//! Pictures of a stroke as SVG: maps of the plate, sections under templates, and the strip of the strokes so far.
//!
//! For the screen a map is a raster image with the text above it as SVG. Pictures are legible at a distance of two
//! metres. The scales of colours and heights are determined by the plate file alone ([`PictureScale`]), never by the
//! stroke, so that two strokes can be compared side by side. The colour map diverges from neutral gray, blue against
//! orange, in steps of equal perceived difference; signed numbers stand beside it. Unseen areas are hatched.

mod canvas;
mod colour;
mod map;
mod scale;
mod screen_map;
mod section;
mod shades;
mod strip;
mod view;
mod words;

pub use map::{Mark, map};
pub use scale::PictureScale;
pub use screen_map::{ScreenMap, screen_map, texture};
pub use section::section;
pub use strip::{StripPoint, strip};
pub use view::{SeenPlate, Turn, Units, View};

use platen_model::{Language, Verdict};

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
    fn title(&self, language: Language) -> String {
        match self.stroke {
            Some(number) => format!("{}, {} {number}", self.plate, words::STROKE.of(language)),
            None => self.plate.to_owned(),
        }
    }
}
