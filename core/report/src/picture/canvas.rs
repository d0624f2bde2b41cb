//! Drawing area of a picture: shapes and text in pixels from its upper left corner, written as SVG.

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use platen_model::Language;

use super::colour::{self, INK, PAPER};
use super::words;
use super::{Caption, PictureError};

/// Position on the canvas, pixels.
pub(super) type At = (f64, f64);

pub(super) struct Canvas<'a> {
    area: DrawingArea<SVGBackend<'a>, Shift>,
    pub(super) width: f64,
}

/// Pixels of the drawing library for one pixel of the picture: the library has whole pixels only.
const FINE: f64 = 8.0;

#[derive(Clone, Copy)]
pub(super) struct Text {
    /// Height of the letters including line spacing, pixels.
    pub(super) size: f64,
    pub(super) colour: RGBColor,
    pub(super) bold: bool,
    /// Horizontal anchor of the text at its position.
    pub(super) across: HPos,
    pub(super) upright: VPos,
}

impl Text {
    pub(super) const fn new(size: f64) -> Self {
        Self { size, colour: INK, bold: false, across: HPos::Left, upright: VPos::Center }
    }

    pub(super) const fn bold(self) -> Self {
        Self { bold: true, ..self }
    }

    pub(super) const fn coloured(self, colour: RGBColor) -> Self {
        Self { colour, ..self }
    }

    pub(super) const fn centred(self) -> Self {
        Self { across: HPos::Center, ..self }
    }

    pub(super) const fn right(self) -> Self {
        Self { across: HPos::Right, ..self }
    }
}

/// Returns the SVG of the shapes drawn by `paint` on a paper-coloured background.
pub(super) fn draw(
    size: (u32, u32),
    paint: impl FnOnce(&Canvas<'_>) -> Result<(), PictureError>,
) -> Result<String, PictureError> {
    overlay(size, |canvas| {
        canvas.area.fill(&PAPER).map_err(failed)?;
        paint(canvas)
    })
}

/// Returns the SVG of the shapes drawn by `paint` on a transparent background.
pub(super) fn overlay(
    size: (u32, u32),
    paint: impl FnOnce(&Canvas<'_>) -> Result<(), PictureError>,
) -> Result<String, PictureError> {
    let mut svg = String::new();
    {
        let fine = [size.0, size.1].map(|pixels| pixels * FINE as u32);
        let area = SVGBackend::with_string(&mut svg, fine.into()).into_drawing_area();
        let canvas = Canvas { area, width: f64::from(size.0) };
        paint(&canvas)?;
        canvas.area.present().map_err(failed)?;
    }
    let shown = |pixels: [u32; 2]| format!("width=\"{}\" height=\"{}\"", pixels[0], pixels[1]);
    let size = [size.0, size.1];
    Ok(svg.replacen(&shown(size.map(|pixels| pixels * FINE as u32)), &shown(size), 1))
}

fn failed(error: impl std::fmt::Display) -> PictureError {
    PictureError(error.to_string())
}

fn pixel((x, y): At) -> (i32, i32) {
    ((x * FINE).round() as i32, (y * FINE).round() as i32)
}

/// Converts widths and radii to pixels of the drawing library.
fn wide(pixels: u32) -> u32 {
    pixels * FINE as u32
}

impl Canvas<'_> {
    pub(super) fn text(&self, text: &str, at: At, look: Text) -> Result<(), PictureError> {
        let weight = if look.bold { FontStyle::Bold } else { FontStyle::Normal };
        let font = FontDesc::new(FontFamily::SansSerif, look.size * FINE, weight);
        let style = TextStyle::from(font).color(&look.colour).pos(Pos::new(look.across, look.upright));
        self.area.draw_text(text, &style, pixel(at)).map_err(failed)
    }

    pub(super) fn fill(&self, from: At, to: At, colour: RGBColor) -> Result<(), PictureError> {
        self.area.draw(&Rectangle::new([pixel(from), pixel(to)], colour.filled())).map_err(failed)
    }

    pub(super) fn frame(&self, from: At, to: At, colour: RGBColor, width: u32) -> Result<(), PictureError> {
        // Drawn as a line: the library draws the outline of a rectangle one pixel wide, whatever its style.
        self.line(&[from, (to.0, from.1), to, (from.0, to.1), from], colour, width)
    }

    pub(super) fn line(&self, points: &[At], colour: RGBColor, width: u32) -> Result<(), PictureError> {
        let points: Vec<_> = points.iter().copied().map(pixel).collect();
        self.area.draw(&PathElement::new(points, colour.stroke_width(wide(width)))).map_err(failed)
    }

    /// Draws a line of dashes as long as their gaps.
    pub(super) fn dashed(&self, from: At, to: At, colour: RGBColor, width: u32) -> Result<(), PictureError> {
        const DASH: f64 = 12.0;
        let length = (to.0 - from.0).hypot(to.1 - from.1).max(1.0);
        let at = |way: f64| {
            let part = (way / length).min(1.0);
            (from.0 + (to.0 - from.0) * part, from.1 + (to.1 - from.1) * part)
        };
        let mut way = 0.0;
        while way < length {
            self.line(&[at(way), at(way + DASH)], colour, width)?;
            way += 2.0 * DASH;
        }
        Ok(())
    }

    pub(super) fn area(&self, points: &[At], colour: RGBColor) -> Result<(), PictureError> {
        let points: Vec<_> = points.iter().copied().map(pixel).collect();
        self.area.draw(&Polygon::new(points, colour.filled())).map_err(failed)
    }

    pub(super) fn ring(&self, at: At, radius: u32, colour: RGBColor, width: u32) -> Result<(), PictureError> {
        self.area
            .draw(&Circle::new(pixel(at), wide(radius), colour.stroke_width(wide(width))))
            .map_err(failed)
    }

    pub(super) fn dot(&self, at: At, radius: u32, colour: RGBColor) -> Result<(), PictureError> {
        self.area.draw(&Circle::new(pixel(at), wide(radius), colour.filled())).map_err(failed)
    }

    /// Draws the heading: plate and stroke, title of the picture, verdict at the right.
    pub(super) fn head(
        &self,
        caption: &Caption<'_>,
        title: &str,
        language: Language,
    ) -> Result<(), PictureError> {
        self.text(&caption.title(language), (24.0, 34.0), Text::new(38.0).bold())?;
        self.text(title, (24.0, 78.0), Text::new(24.0))?;
        let words = words::verdict(caption.verdict).of(language).to_uppercase();
        // Widths in a bold sans serif: a capital letter about 0.72 of its height, a Japanese character the full height.
        let letters = words.chars().map(|c| if c.is_ascii() { 0.72 } else { 1.0 });
        let chip = 34.0 * letters.sum::<f64>() + 40.0;
        let right = self.width - 24.0;
        self.fill((right - chip, 12.0), (right, 58.0), colour::verdict(caption.verdict))?;
        let look = Text::new(34.0).bold().centred().coloured(PAPER);
        self.text(&words, (right - chip / 2.0, 35.0), look)
    }
}
