//! Units of values in a plant file: what they measure and how they convert.

use std::f64::consts::PI;

/// A unit of the table below.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    symbol: &'static str,
    measures: &'static str,
    /// One unit is `numerator / denominator` base units; two numbers, so that decimal factors stay exact.
    numerator: f64,
    denominator: f64,
}

const fn unit(symbol: &'static str, measures: &'static str, numerator: f64, denominator: f64) -> Unit {
    Unit { symbol, measures, numerator, denominator }
}

/// Every unit that a value or an option may name. Temperatures are only accepted as they are: no other scale is in use.
const UNITS: &[Unit] = &[
    unit("m", "length", 1.0, 1.0),
    unit("km", "length", 1000.0, 1.0),
    unit("cm", "length", 1.0, 100.0),
    unit("mm", "length", 1.0, 1000.0),
    unit("um", "length", 1.0, 1e6),
    unit("in", "length", 254.0, 10_000.0),
    unit("ft", "length", 3048.0, 10_000.0),
    unit("rad", "angle", 1.0, 1.0),
    unit("mrad", "angle", 1.0, 1000.0),
    unit("deg", "angle", PI, 180.0),
    unit("s", "time", 1.0, 1.0),
    unit("ms", "time", 1.0, 1000.0),
    unit("us", "time", 1.0, 1e6),
    unit("min", "time", 60.0, 1.0),
    unit("h", "time", 3600.0, 1.0),
    unit("d", "time", 86_400.0, 1.0),
    unit("Hz", "frequency", 1.0, 1.0),
    unit("kHz", "frequency", 1000.0, 1.0),
    unit("MHz", "frequency", 1e6, 1.0),
    unit("1/m", "curvature", 1.0, 1.0),
    unit("1/km", "curvature", 1.0, 1000.0),
    unit("1/mm", "curvature", 1000.0, 1.0),
    unit("m/s", "speed", 1.0, 1.0),
    unit("mm/s", "speed", 1.0, 1000.0),
    unit("N", "force", 1.0, 1.0),
    unit("kN", "force", 1000.0, 1.0),
    unit("MN", "force", 1e6, 1.0),
    unit("Pa", "pressure", 1.0, 1.0),
    unit("MPa", "pressure", 1e6, 1.0),
    unit("GPa", "pressure", 1e9, 1.0),
    unit("B", "amount of data", 1.0, 1.0),
    unit("kB", "amount of data", 1e3, 1.0),
    unit("MB", "amount of data", 1e6, 1.0),
    unit("GB", "amount of data", 1e9, 1.0),
    unit("KiB", "amount of data", 1024.0, 1.0),
    unit("MiB", "amount of data", 1_048_576.0, 1.0),
    unit("GiB", "amount of data", 1_073_741_824.0, 1.0),
    unit("degC", "temperature", 1.0, 1.0),
    unit("1", "ratio", 1.0, 1.0),
    unit("%", "ratio", 1.0, 100.0),
];

impl Unit {
    /// Seconds.
    pub const SECOND: Self = unit("s", "time", 1.0, 1.0);
    /// Minutes.
    pub const MINUTE: Self = unit("min", "time", 60.0, 1.0);
    /// Days.
    pub const DAY: Self = unit("d", "time", 86_400.0, 1.0);
    /// The unit of what measures nothing.
    pub const ONE: Self = unit("1", "ratio", 1.0, 1.0);

    /// What it measures: "length", "time".
    pub fn measures(&self) -> &'static str {
        self.measures
    }

    /// The unit with this symbol; `µ` and `°` are accepted for `u` and `deg`.
    pub fn find(symbol: &str) -> Option<Self> {
        let symbol = symbol.replace(['µ', 'μ'], "u").replace("°C", "degC").replace('°', "deg");
        UNITS.iter().find(|unit| unit.symbol == symbol).copied()
    }

    /// The symbol.
    pub fn symbol(&self) -> &'static str {
        self.symbol
    }

    /// Reads `"30 m"` or `"30"` as a number of this unit.
    ///
    /// # Errors
    /// The sentence for the fault: no number, an unknown unit, a unit of something else.
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
        if given.measures != self.measures {
            return Err(format!(
                "found {text:?}, which is {}, expected {} in {}",
                given.measures,
                self.measures,
                self.family()
            ));
        }
        Ok(given.to(number, *self))
    }

    /// Converts a value of this unit to `other`, which measures the same.
    pub(crate) fn to(self, value: f64, other: Self) -> f64 {
        value * (self.numerator * other.denominator) / (self.denominator * other.numerator)
    }

    /// All symbols that convert to this unit.
    fn family(&self) -> String {
        let family: Vec<_> = UNITS.iter().filter(|u| u.measures == self.measures).map(|u| u.symbol).collect();
        family.join(", ")
    }
}

/// Bytes of the number that `text` begins with. An exponent needs its digits, so that "2 eV" or "3em" ends at the digit.
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
