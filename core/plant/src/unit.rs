//! Units of measure of TOML values, of plugin options and of scaled registers.

use std::f64::consts::PI;

/// Quantity that a unit measures, or content of a register field that has no unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dimension {
    /// One bit.
    Switch,
    /// Characters.
    Text,
    /// A counter, a code, an identity.
    Count,
    /// A share of one.
    Ratio,
    /// Base unit: metre.
    Length,
    /// Base unit: radian.
    Angle,
    /// Base unit: second.
    Time,
    /// Base unit: hertz.
    Frequency,
    /// Base unit: 1/m.
    Curvature,
    /// Base unit: m/s.
    Speed,
    /// Base unit: newton.
    Force,
    /// Base unit: pascal.
    Pressure,
    /// Base unit: byte.
    Data,
    /// Base unit: degree Celsius.
    Temperature,
}

/// Formats as in messages: `length`.
impl std::fmt::Display for Dimension {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&format!("{self:?}").to_lowercase())
    }
}

/// Unit of measure: one of a fixed list.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    symbol: &'static str,
    dimension: Dimension,
    /// One unit is `numerator / denominator` base units; two numbers, so that decimal factors stay exact.
    numerator: f64,
    denominator: f64,
}

const fn unit(symbol: &'static str, dimension: Dimension, numerator: f64, denominator: f64) -> Unit {
    Unit { symbol, dimension, numerator, denominator }
}

/// Every unit. Temperatures have one scale only.
const UNITS: &[Unit] = &[
    unit("m", Dimension::Length, 1.0, 1.0),
    unit("km", Dimension::Length, 1000.0, 1.0),
    unit("cm", Dimension::Length, 1.0, 100.0),
    Unit::MILLIMETRE,
    unit("um", Dimension::Length, 1.0, 1e6),
    unit("in", Dimension::Length, 254.0, 10_000.0),
    unit("ft", Dimension::Length, 3048.0, 10_000.0),
    unit("rad", Dimension::Angle, 1.0, 1.0),
    unit("mrad", Dimension::Angle, 1.0, 1000.0),
    Unit::DEGREE,
    Unit::SECOND,
    Unit::MILLISECOND,
    unit("us", Dimension::Time, 1.0, 1e6),
    Unit::MINUTE,
    unit("h", Dimension::Time, 3600.0, 1.0),
    Unit::DAY,
    unit("Hz", Dimension::Frequency, 1.0, 1.0),
    unit("kHz", Dimension::Frequency, 1000.0, 1.0),
    unit("MHz", Dimension::Frequency, 1e6, 1.0),
    unit("1/m", Dimension::Curvature, 1.0, 1.0),
    unit("1/km", Dimension::Curvature, 1.0, 1000.0),
    unit("1/mm", Dimension::Curvature, 1000.0, 1.0),
    unit("m/s", Dimension::Speed, 1.0, 1.0),
    unit("mm/s", Dimension::Speed, 1.0, 1000.0),
    unit("N", Dimension::Force, 1.0, 1.0),
    Unit::KILONEWTON,
    unit("MN", Dimension::Force, 1e6, 1.0),
    unit("Pa", Dimension::Pressure, 1.0, 1.0),
    unit("MPa", Dimension::Pressure, 1e6, 1.0),
    unit("GPa", Dimension::Pressure, 1e9, 1.0),
    unit("B", Dimension::Data, 1.0, 1.0),
    unit("kB", Dimension::Data, 1e3, 1.0),
    unit("MB", Dimension::Data, 1e6, 1.0),
    unit("GB", Dimension::Data, 1e9, 1.0),
    unit("KiB", Dimension::Data, 1024.0, 1.0),
    unit("MiB", Dimension::Data, 1_048_576.0, 1.0),
    unit("GiB", Dimension::Data, 1_073_741_824.0, 1.0),
    Unit::CELSIUS,
    Unit::ONE,
    Unit::PERCENT,
];

impl Unit {
    /// Millimetre.
    pub const MILLIMETRE: Self = unit("mm", Dimension::Length, 1.0, 1000.0);
    /// Degree of angle.
    pub const DEGREE: Self = unit("deg", Dimension::Angle, PI, 180.0);
    /// Second.
    pub const SECOND: Self = unit("s", Dimension::Time, 1.0, 1.0);
    /// Millisecond.
    pub const MILLISECOND: Self = unit("ms", Dimension::Time, 1.0, 1000.0);
    /// Minute.
    pub const MINUTE: Self = unit("min", Dimension::Time, 60.0, 1.0);
    /// Day.
    pub const DAY: Self = unit("d", Dimension::Time, 86_400.0, 1.0);
    /// Kilonewton.
    pub const KILONEWTON: Self = unit("kN", Dimension::Force, 1000.0, 1.0);
    /// Degree Celsius.
    pub const CELSIUS: Self = unit("degC", Dimension::Temperature, 1.0, 1.0);
    /// Pure number.
    pub const ONE: Self = unit("1", Dimension::Ratio, 1.0, 1.0);
    /// Hundredth.
    pub const PERCENT: Self = unit("%", Dimension::Ratio, 1.0, 100.0);

    /// Returns the quantity measured.
    pub fn dimension(&self) -> Dimension {
        self.dimension
    }

    /// Returns the number of base units in one of this unit.
    pub fn factor(&self) -> f64 {
        self.numerator / self.denominator
    }

    /// Returns whether a register field of `dimension` may have this unit. A pure number stands for the base unit,
    /// except where registers commonly hold another one.
    pub fn fits(&self, dimension: Dimension) -> bool {
        let explicit = matches!(dimension, Dimension::Length | Dimension::Angle | Dimension::Force);
        self.dimension == dimension || (*self == Self::ONE && !explicit)
    }

    /// Returns the units that a register field of `dimension` may have, with their symbols.
    pub(crate) fn fitting(dimension: Dimension) -> Vec<(&'static str, Self)> {
        UNITS.iter().filter(|unit| unit.fits(dimension)).map(|unit| (unit.symbol, *unit)).collect()
    }

    /// Returns the unit with this symbol; `µ` and `°` are accepted for `u` and `deg`.
    pub fn find(symbol: &str) -> Option<Self> {
        let symbol = symbol.replace(['µ', 'μ'], "u").replace("°C", "degC").replace('°', "deg");
        UNITS.iter().find(|unit| unit.symbol == symbol).copied()
    }

    /// Returns the symbol.
    pub fn symbol(&self) -> &'static str {
        self.symbol
    }

    /// Reads `"30 m"` or `"30"` as a number of this unit.
    ///
    /// # Errors
    /// The sentence for the fault: no number, an unknown unit, a unit of another quantity.
    pub fn read(&self, text: &str) -> Result<f64, String> {
        let text = text.trim();
        let digits = number_len(text);
        let (number, symbol) = (&text[..digits], text[digits..].trim());
        let number: f64 = number.parse().ok().filter(|number: &f64| number.is_finite()).ok_or_else(|| {
            format!(
                "found the text {text:?}, expected a number in {0} or one with its unit, like \"1 {0}\"",
                self.symbol
            )
        })?;
        if symbol.is_empty() {
            return Ok(number);
        }
        let given = Self::find(symbol).ok_or_else(|| {
            format!("found {text:?} with the unknown unit \"{symbol}\", allowed {}", self.family())
        })?;
        if given.dimension != self.dimension {
            return Err(format!(
                "found {text:?}, which is {}, expected {} in {}",
                given.dimension,
                self.dimension,
                self.family()
            ));
        }
        Ok(given.to(number, *self))
    }

    /// Converts a value of this unit to `other` of the same dimension.
    pub(crate) fn to(self, value: f64, other: Self) -> f64 {
        value * (self.numerator * other.denominator) / (self.denominator * other.numerator)
    }

    /// Returns all symbols that convert to this unit.
    fn family(&self) -> String {
        let family: Vec<_> =
            UNITS.iter().filter(|u| u.dimension == self.dimension).map(|u| u.symbol).collect();
        family.join(", ")
    }
}

/// Converts millimetres of a file to metres.
pub(crate) fn metres(mm: f64) -> f64 {
    mm / 1000.0
}

/// Converts metres to millimetres for a message, rounded to a micrometre.
pub(crate) fn millimetres(m: f64) -> f64 {
    (m * 1e6).round() / 1000.0
}

/// Returns the length of the number that `text` begins with. An exponent needs its digits, so that "2 eV" or "3em" ends
/// at the digit.
fn number_len(text: &str) -> usize {
    let plain =
        |from: &str| from.find(|c: char| !matches!(c, '0'..='9' | '.' | '+' | '-')).unwrap_or(from.len());
    let mantissa = plain(text);
    match text[mantissa..].strip_prefix(['e', 'E']) {
        Some(exponent) if plain(exponent) > 0 => mantissa + 1 + plain(exponent),
        _ => mantissa,
    }
}

#[cfg(test)]
mod tests {
    use super::Unit;

    fn read(unit: &str, text: &str) -> Result<f64, String> {
        Unit::find(unit).unwrap().read(text)
    }

    #[test]
    fn values_convert_exactly_to_the_declared_unit() {
        let check = |unit, text, expected| assert_eq!(read(unit, text), Ok(expected), "{text} in {unit}");
        check("m", "30 m", 30.0);
        check("m", "30", 30.0);
        check("mm", "1.2 in", 30.48);
        check("mm", "30m", 30_000.0);
        check("m", "0.5 mm", 0.0005);
        check("s", "250 ms", 0.25);
        check("ms", "2 min", 120_000.0);
        check("deg", "3.141592653589793 rad", 180.0);
        check("mrad", "1e-3 rad", 1.0);
        check("1", "5 %", 0.05);
        check("um", "2 µm", 2.0);
        check("degC", "21.5 °C", 21.5);
        check("MiB", "2 GiB", 2048.0);
    }

    #[test]
    fn wrong_dimensions_unknown_units_and_words_are_refused() {
        let check = |unit, text, expected: &str| assert_eq!(read(unit, text), Err(expected.to_owned()));
        check("m", "30 s", "found \"30 s\", which is time, expected length in m, km, cm, mm, um, in, ft");
        check(
            "m",
            "30 furlong",
            "found \"30 furlong\" with the unknown unit \"furlong\", allowed m, km, cm, mm, um, in, ft",
        );
        check(
            "s",
            "soon",
            "found the text \"soon\", expected a number in s or one with its unit, like \"1 s\"",
        );
        check(
            "s",
            "1e999 s",
            "found the text \"1e999 s\", expected a number in s or one with its unit, like \"1 s\"",
        );
    }
}
