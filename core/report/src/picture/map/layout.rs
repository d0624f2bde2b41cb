//! Layout of a map: the plate's rectangle in the view, its axes and the edge that faces the press.

use platen_model::{Field, NodeState};

use crate::picture::canvas::{At, Canvas, Text};
use crate::picture::colour::INK;
use crate::picture::scale::{Scale, nice_ceiling};
use crate::picture::shades::Shades;
use crate::picture::{PictureError, PictureScale, SeenPlate, View, words};
use crate::result::PlateRecord;

/// Width of the picture and of the plate in it, pixels; a tall plate is drawn narrower.
const WIDTH: f64 = 1200.0;
pub(super) const PLATE: [f64; 2] = [808.0, 760.0];
/// Smallest height of the plate for the legend beside it, pixels, for letters of size 1.
pub(super) const LEAST_HEIGHT: f64 = 420.0;
/// Side of the squares of which the map consists, pixels; the lengths above and those of a [`Look`] are multiples of
/// it.
pub(in crate::picture) const SQUARE: f64 = 4.0;

/// Distances and sizes of a map, pixels.
#[derive(Debug, Clone, Copy)]
pub(in crate::picture) struct Look {
    /// Upper left corner of the plate.
    pub(in crate::picture) left: f64,
    pub(in crate::picture) top: f64,
    /// Height below the plate for ticks and titles.
    pub(in crate::picture) below: f64,
    /// Size of the letters, 1 in files.
    pub(in crate::picture) letters: f64,
    /// Distance from the plate down to the name of the press and to the title of the axis.
    pub(in crate::picture) press_line: f64,
    pub(in crate::picture) title_line: f64,
}

/// Map of one field.
pub(in crate::picture) struct Layout<'a> {
    pub(super) plate: &'a PlateRecord,
    pub(in crate::picture) view: View,
    pub(super) look: Look,
    pub(super) seen: SeenPlate,
    /// Squares from left to right and from top to bottom.
    pub(in crate::picture) squares: [usize; 2],
    pub(super) scale: Scale,
    pub(in crate::picture) title: String,
}

impl<'a> Layout<'a> {
    pub(in crate::picture) fn new(
        field: &Field,
        plate: &'a PlateRecord,
        picture_scale: &PictureScale,
        view: View,
        look: Look,
    ) -> Self {
        let largest = (0..field.state.len())
            .filter(|&node| field.state[node] != NodeState::Unseen)
            .map(|node| field.values[node].abs())
            .fold(0.0, f64::max);
        let (title, scale) = picture_scale.field(&field.name, &field.unit, largest, view);
        let seen = view.turn.of([plate.width_mm, plate.height_mm], plate.press_side);
        let extent = seen.extent_mm();
        let pixel_per_mm = (PLATE[0] / extent[0]).min(PLATE[1] / extent[1]);
        let squares = extent.map(|mm| ((mm * pixel_per_mm / SQUARE).round() as usize).max(1));
        Self { plate, view, look, seen, squares, scale, title }
    }

    /// Returns the size of the picture.
    pub(in crate::picture) fn size(&self) -> (u32, u32) {
        let Look { top, below, letters, .. } = self.look;
        let least = (LEAST_HEIGHT * letters / SQUARE).ceil() * SQUARE;
        (WIDTH as u32, (self.extent()[1].max(least) + top + below) as u32)
    }

    /// Returns the upper left and the lower right corner of the plate.
    pub(in crate::picture) fn corners(&self) -> (At, At) {
        let (Look { left, top, .. }, [wide, high]) = (self.look, self.extent());
        ((left, top), (left + wide, top + high))
    }

    pub(in crate::picture) fn shades(&self, field: &Field) -> Shades {
        Shades::of(field, &self.scale, self.squares, |share| self.on_plate(share))
    }

    /// Returns the extent of the plate, pixels.
    pub(super) fn extent(&self) -> [f64; 2] {
        self.squares.map(|n| n as f64 * SQUARE)
    }

    /// Returns the pixel of a place given as shares of the plate in the view, from the left and from below.
    fn pixel(&self, [x, y]: [f64; 2]) -> At {
        let ((left, _), (_, bottom)) = self.corners();
        let [wide, high] = self.extent();
        (left + x * wide, bottom - y * high)
    }

    /// Returns the pixel of a place (u, v).
    pub(super) fn at(&self, u_mm: f64, v_mm: f64) -> At {
        let ([x, y], [w, h]) = (self.seen.place_mm([u_mm, v_mm]), self.seen.extent_mm());
        self.pixel([x / w, y / h])
    }

    /// Converts shares of the plate in the view to shares of its sides u and v.
    pub(super) fn on_plate(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [w, h] = self.seen.extent_mm();
        let [u, v] = self.seen.at_mm([x * w, y * h]);
        [u / self.plate.width_mm, v / self.plate.height_mm]
    }

    pub(super) fn text(&self) -> Text {
        Text::new(22.0 * self.look.letters)
    }

    pub(super) fn axes(&self, canvas: &Canvas<'_>) -> Result<(), PictureError> {
        let (from, to) = self.corners();
        canvas.frame(from, to, INK, 3)?;
        let (units, look) = (self.view.units, self.look);
        let extent = self.seen.extent_mm().map(|mm| units.of_mm(mm));
        let step = nice_ceiling(extent[0].max(extent[1]) / 7.0);
        let ticks = |length: f64| (1..=(length / step + 1e-9) as u32).map(|k| f64::from(k) * step);
        for value in ticks(extent[0]) {
            let (x, y) = self.pixel([value / extent[0], 0.0]);
            canvas.line(&[(x, y), (x, y + 8.0)], INK, 2)?;
            canvas.text(&format!("{value}"), (x, y + 24.0 * look.letters), self.text().centred())?;
        }
        for value in ticks(extent[1]) {
            let (x, y) = self.pixel([0.0, value / extent[1]]);
            canvas.line(&[(x, y), (x - 8.0, y)], INK, 2)?;
            canvas.text(&format!("{value}"), (x - 14.0, y), self.text().right())?;
        }
        let (language, symbol) = (self.view.language, units.symbol());
        let [across, up] = match self.seen.press_below {
            true => [words::FROM_LEFT, words::FROM_PRESS].map(|text| text.of(language)),
            false => ["u", "v"],
        };
        let (across, up) = (format!("{across}, {symbol} \u{2192}"), format!("{up}, {symbol} \u{2191}"));
        canvas.text(&across, (to.0, to.1 + look.title_line), self.text().right())?;
        canvas.text(&up, (24.0, from.1 - 16.0 * look.letters), self.text())?;
        self.corner(canvas)?;
        self.press(canvas)
    }

    /// Draws the mark of the corner (0, 0); if it is not at the lower left, the legend explains it.
    fn corner(&self, canvas: &Canvas<'_>) -> Result<(), PictureError> {
        let ((x, y), (from, to)) = (self.at(0.0, 0.0), self.corners());
        let side = 34.0 * self.look.letters;
        let (inwards, upwards) = (if x > from.0 { -side } else { side }, if y < to.1 { side } else { -side });
        canvas.area(&[(x, y), (x + inwards, y), (x, y + upwards)], INK)?;
        if self.is_turned() {
            return Ok(());
        }
        let below = y + 24.0 * self.look.letters;
        canvas.text("(0, 0)", (x - 14.0, below), self.text().bold().right())
    }

    /// Returns whether the corner (0, 0) is not at the lower left.
    pub(super) fn is_turned(&self) -> bool {
        self.seen.place_mm([0.0, 0.0]) != [0.0, 0.0]
    }

    /// Draws a bar along the edge that faces the press.
    fn press(&self, canvas: &Canvas<'_>) -> Result<(), PictureError> {
        const BAR: f64 = 12.0;
        let Some(side) = self.plate.press_side else { return Ok(()) };
        let (w, h) = (self.plate.width_mm, self.plate.height_mm);
        let middle = |towards: i8, length: f64| 0.5 * length * (1.0 + f64::from(towards));
        let (x, y) = self.at(middle(side[0], w), middle(side[1], h));
        let (from, to) = self.corners();
        let above = from.1 - 26.0 * self.look.letters;
        let (low, high, label) = match () {
            () if y == to.1 => ((from.0, y), (to.0, y + BAR), y + self.look.press_line),
            () if y == from.1 => ((from.0, y - BAR), (to.0, y), above),
            () if x == to.0 => ((x, from.1), (x + BAR, to.1), above),
            () => ((x - BAR, from.1), (x, to.1), above),
        };
        canvas.fill(low, high, INK)?;
        canvas.text(words::PRESS.of(self.view.language), (x, label), self.text().bold().centred())
    }
}
