//! Linear scaling of intensities to 16 bits.

/// Extent of the intensities of valid cells.
#[derive(Debug, Clone, Copy)]
pub(super) struct Observed {
    min: f64,
    max: f64,
    whole: bool,
}

impl Default for Observed {
    fn default() -> Self {
        Self { min: f64::INFINITY, max: f64::NEG_INFINITY, whole: true }
    }
}

impl Observed {
    /// Adds a value; one that is not finite is ignored.
    pub(super) fn add(&mut self, value: f64) {
        if value.is_finite() {
            self.min = self.min.min(value);
            self.max = self.max.max(value);
            // A cast is an instruction, `fract` a call. For speed only: `tests::speed`.
            self.whole &= value as i64 as f64 == value;
        }
    }
}

/// A linear map from the file's scale to 16 bits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Scale {
    low: f64,
    high: f64,
    /// Smallest and largest value in the header.
    pub(super) range: (u16, u16),
}

/// Full scales in use for whole numbers.
const WHOLE: [(f64, f64); 5] =
    [(0.0, 255.0), (0.0, 2047.0), (0.0, 4095.0), (0.0, 65535.0), (-2048.0, 2047.0)];

impl Scale {
    /// Selects the declared scale where it contains all values, else the smallest scale in use that does, else the
    /// extent of the values. Returns a note unless the declared scale is selected.
    pub(super) fn choose(declared: Option<(f64, f64)>, seen: &Observed) -> (Self, Option<String>) {
        if seen.min >= seen.max {
            let range = (seen.min.is_finite()).then(|| format!("all intensities are {}", seen.min));
            return (Self { low: 0.0, high: 65535.0, range: (0, 65535) }, range);
        }
        let (low, high) = (seen.min, seen.max);
        let holds = |(a, b): &(f64, f64)| *a < *b && *a <= low && high <= *b;
        if let Some((a, b)) = declared.filter(holds) {
            return (Self::new(a, b), None);
        }
        let usual = if seen.whole && high > 1.0 {
            WHOLE.into_iter().find(holds)
        } else {
            Some((0.0, 1.0)).filter(holds)
        };
        let (a, b) = usual.unwrap_or((low, high));
        let why = match declared {
            Some((c, d)) => format!("the file declares {c} to {d}"),
            None => "the file declares none".to_owned(),
        };
        let note = format!("intensity scale {a} to {b} taken from the {low} to {high} seen ({why})");
        (Self::new(a, b), Some(note))
    }

    /// Keeps whole numbers that fit; stretches everything else to 16 bits.
    fn new(low: f64, high: f64) -> Self {
        let fits = low.fract() == 0.0 && high.fract() == 0.0 && low >= 0.0 && high > 1.0 && high <= 65535.0;
        let range = if fits { (low as u16, high as u16) } else { (0, u16::MAX) };
        Self { low, high, range }
    }

    /// Returns the 16-bit value, clamped to the scale.
    pub(super) fn apply(&self, value: f64) -> u16 {
        let (a, b) = (f64::from(self.range.0), f64::from(self.range.1));
        let scaled = a + (value - self.low) * (b - a) / (self.high - self.low);
        // The cast rounds down; `round` is a call. For speed only: `tests::speed`.
        (scaled.clamp(a, b) + 0.5) as u16
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(declared: Option<(f64, f64)>, seen: &[f64], value: f64, expected: (u16, (u16, u16), bool)) {
        let mut observed = Observed::default();
        seen.iter().for_each(|v| observed.add(*v));
        let (scale, note) = Scale::choose(declared, &observed);
        assert_eq!((scale.apply(value), scale.range, note.is_some()), expected, "{note:?}");
    }

    #[test]
    fn each_scale_in_use_is_recognised() {
        check(Some((0.0, 2047.0)), &[3.0, 900.0], 900.0, (900, (0, 2047), false));
        check(None, &[0.0, 1700.0], 900.0, (900, (0, 2047), true));
        check(None, &[0.0, 255.0], 17.0, (17, (0, 255), true));
        check(None, &[0.0, 60000.0], 17.0, (17, (0, 65535), true));
        check(None, &[0.1, 0.9], 1.0, (65535, (0, 65535), true));
        check(Some((0.0, 1.0)), &[0.0, 1.0], 0.0, (0, (0, 65535), false));
        check(None, &[-2000.0, 1000.0], -2048.0, (0, (0, 65535), true));
        check(Some((0.0, 1.0)), &[0.0, 200.0], 200.0, (200, (0, 255), true));
        check(Some((5.0, 5.0)), &[5.0, 5.0], 5.0, (5, (0, 65535), true));
        check(None, &[f64::NAN], f64::NAN, (0, (0, 65535), false));
    }
}
