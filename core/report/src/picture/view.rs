//! How a person sees figures and pictures on a screen: language, unit of lengths, orientation of the plate. Files and registers stay
//! in millimetres and as drawn.

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
    /// Turned by quarter turns, never mirrored, so that the edge that faces the press is below; as drawn where it is unknown.
    #[default]
    Press,
    /// As drawn: u to the right, v up.
    Drawing,
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

    /// Formats a length with its uncertainty, both given in millimetres, without the symbol. The uncertainty is rounded up and
    /// never 0.
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
    use super::Units;

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
}
