//! View settings of figures and pictures on a screen: language, unit of lengths, orientation of the plate.
//!
//! Files and registers are always in millimetres and in the orientation of the drawing.

use platen_model::Language;

/// View of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct View {
    /// Language of its words.
    pub language: Language,
    /// Unit of lengths.
    pub units: Units,
    /// Orientation of the plate.
    pub turn: Turn,
}

impl View {
    /// View of files and reports.
    pub const FILE: Self = Self { language: Language::En, units: Units::Millimetre, turn: Turn::Drawing };
}

/// Unit of lengths.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Units {
    /// Millimetres.
    #[default]
    Millimetre,
    /// Inches of 25.4 mm.
    Inch,
}

/// Orientation of the plate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Turn {
    /// Turned by quarter turns, never mirrored, so that the edge that faces the press is below; as drawn where it is
    /// unknown.
    #[default]
    Press,
    /// As drawn: u to the right, v up.
    Drawing,
}

/// Plate as seen in a view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeenPlate {
    /// Quarter turns, clockwise from the drawing.
    quarters: u8,
    /// Extent along u and v.
    size_mm: [f64; 2],
    /// Whether the edge that faces the press is below.
    pub press_below: bool,
}

impl Turn {
    /// Returns the plate as seen in the view, from its extent along u and v and the direction in (u, v) of the edge
    /// that faces the press.
    pub fn of(self, size_mm: [f64; 2], press_side: Option<[i8; 2]>) -> SeenPlate {
        let press = press_side.filter(|_| self == Self::Press);
        let quarters = match press {
            Some([1, _]) => 1,
            Some([_, 1]) => 2,
            Some([-1, _]) => 3,
            _ => 0,
        };
        SeenPlate { quarters, size_mm, press_below: press.is_some() }
    }
}

impl SeenPlate {
    /// Returns the extent from left to right and from below upwards.
    pub fn extent_mm(self) -> [f64; 2] {
        let [w, h] = self.size_mm;
        if self.quarters % 2 == 1 { [h, w] } else { [w, h] }
    }

    /// Returns the distances of a place (u, v) from the left and from below.
    pub fn place_mm(self, [u, v]: [f64; 2]) -> [f64; 2] {
        let [w, h] = self.size_mm;
        match self.quarters {
            0 => [u, v],
            1 => [v, w - u],
            2 => [w - u, h - v],
            _ => [h - v, u],
        }
    }

    /// Returns the place (u, v) at these distances from the left and from below.
    pub fn at_mm(self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [w, h] = self.size_mm;
        match self.quarters {
            0 => [x, y],
            1 => [w - y, x],
            2 => [w - x, h - y],
            _ => [y, h - x],
        }
    }
}

impl Units {
    /// Returns the symbol.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Millimetre => "mm",
            Self::Inch => "in",
        }
    }

    /// Returns the number of decimals: a tenth of a millimetre, a hundredth of an inch.
    fn decimals(self) -> usize {
        match self {
            Self::Millimetre => 1,
            Self::Inch => 2,
        }
    }

    /// Converts from millimetres.
    pub fn of_mm(self, mm: f64) -> f64 {
        match self {
            Self::Millimetre => mm,
            Self::Inch => mm / 25.4,
        }
    }

    /// Formats a length, given in millimetres, without its symbol.
    pub fn number(self, mm: f64) -> String {
        format!("{:.*}", self.decimals(), self.of_mm(mm))
    }

    /// Formats a length, given in millimetres, with its symbol: whole millimetres, hundredths of an inch.
    pub fn whole(self, mm: f64) -> String {
        format!("{:.*} {}", self.decimals() / 2 * 2, self.of_mm(mm), self.symbol())
    }

    /// Formats a tick of an axis of gaps, given in millimetres.
    pub(super) fn tick(self, mm: f64) -> String {
        match self {
            Self::Millimetre => format!("{mm}"),
            Self::Inch => self.number(mm),
        }
    }

    /// Formats a length, given in millimetres, with its sign and a digit less from 10 on; the minus sign is U+2212.
    pub(super) fn signed(self, mm: f64) -> String {
        let (size, decimals) = (self.of_mm(mm).abs(), self.decimals());
        let below_ten = size < 10.0 - 0.5 * 0.1_f64.powi(decimals as i32);
        let digits = format!("{size:.*}", if below_ten { decimals } else { decimals - 1 });
        match digits.trim_matches(|c| c == '0' || c == '.').is_empty() {
            true => "0".to_owned(),
            false if mm < 0.0 => format!("\u{2212}{digits}"),
            false => format!("+{digits}"),
        }
    }

    /// Formats a length with its uncertainty, both given in millimetres, without the symbol. The uncertainty is rounded
    /// up and never 0.
    pub fn with_uncertainty(self, mm: f64, uncertainty_mm: Option<f64>) -> String {
        let decimals = self.decimals();
        let steps = 10_f64.powi(decimals as i32);
        let up = |length: f64| (length * steps - 1e-9).ceil().max(1.0) / steps;
        match uncertainty_mm {
            Some(u) => format!("{} \u{b1} {:.decimals$}", self.number(mm), up(self.of_mm(u))),
            None => self.number(mm),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_uncertainty_is_rounded_up() {
        let all = [
            (0.02, "4.3 \u{b1} 0.1", "0.17 \u{b1} 0.01"),
            (0.2, "4.3 \u{b1} 0.2", "0.17 \u{b1} 0.01"),
            (0.21, "4.3 \u{b1} 0.3", "0.17 \u{b1} 0.01"),
            (0.26, "4.3 \u{b1} 0.3", "0.17 \u{b1} 0.02"),
            (0.0, "4.3 \u{b1} 0.1", "0.17 \u{b1} 0.01"),
        ];
        for (uncertainty, millimetres, inches) in all {
            assert_eq!(Units::Millimetre.with_uncertainty(4.26, Some(uncertainty)), millimetres);
            assert_eq!(Units::Inch.with_uncertainty(4.26, Some(uncertainty)), inches);
        }
        assert_eq!(Units::Millimetre.with_uncertainty(-0.5, None), "-0.5");
    }

    #[test]
    fn numbers_have_a_sign_and_no_more_digits_than_the_fit_knows() {
        let all = [
            (0.04, "0", "0"),
            (0.26, "+0.3", "+0.01"),
            (-9.94, "\u{2212}9.9", "\u{2212}0.39"),
            (9.96, "+10", "+0.39"),
            (-123.4, "\u{2212}123", "\u{2212}4.86"),
            (253.9, "+254", "+10.0"),
        ];
        for (value, millimetres, inches) in all {
            assert_eq!(Units::Millimetre.signed(value), millimetres);
            assert_eq!(Units::Inch.signed(value), inches);
        }
        assert_eq!([Units::Millimetre, Units::Inch].map(|u| u.whole(2000.0)), ["2000 mm", "78.74 in"]);
    }

    #[test]
    fn the_press_is_below_and_nothing_is_mirrored() {
        let size = [3000.0, 2000.0];
        for side in [[0, -1], [0, 1], [1, 0], [-1, 0]] {
            let seen = Turn::Press.of(size, Some(side));
            let edge = [0, 1].map(|i| 0.5 * [3000.0, 2000.0][i] * (1.0 + f64::from(side[i])));
            let [x, y] = seen.place_mm(edge);
            assert_eq!([2.0 * x, y], [seen.extent_mm()[0], 0.0], "{side:?}: the middle of the edge is below");
            // The direction of v is the direction of u turned by a quarter turn counter-clockwise.
            let [o, u, v] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]].map(|at| seen.place_mm(at));
            let way = |to: [f64; 2]| [to[0] - o[0], to[1] - o[1]];
            assert_eq!(way(v), [-way(u)[1], way(u)[0]], "{side:?}");
            assert_eq!(seen.at_mm(seen.place_mm([700.0, 300.0])), [700.0, 300.0], "{side:?}");
            assert!(seen.press_below);
            assert_eq!(Turn::Drawing.of(size, Some(side)).place_mm([700.0, 300.0]), [700.0, 300.0]);
        }
        let unplaced = Turn::Press.of(size, None);
        assert!(!unplaced.press_below && unplaced.place_mm([700.0, 300.0]) == [700.0, 300.0]);
    }
}
