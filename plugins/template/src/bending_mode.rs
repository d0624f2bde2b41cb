//! Bending modes of the plate as a whole, each with the standard deviation of its coefficient.

use platen_shape::Surface;

use crate::scanner_sigma::ScannerSigma;

/// Bending mode of the plate as a whole.
#[derive(Debug)]
pub(crate) struct Mode {
    /// Height at (x, y), each from -1 to 1 over the plate.
    height: fn(f64, f64) -> f64,
    /// Heights, at places in shares of the sides, whose weighted sum is the mode's coefficient.
    coefficient: &'static [([f64; 2], f64)],
}

/// Hollow along u, hollow along v, twist.
pub(crate) const MODES: [Mode; 3] = [
    Mode { height: |x, _| x * x, coefficient: &[([0.0, 0.5], 0.5), ([0.5, 0.5], -1.0), ([1.0, 0.5], 0.5)] },
    Mode { height: |_, y| y * y, coefficient: &[([0.5, 0.0], 0.5), ([0.5, 0.5], -1.0), ([0.5, 1.0], 0.5)] },
    Mode {
        height: |x, y| x * y,
        coefficient: &[([0.0, 0.0], 0.25), ([1.0, 0.0], -0.25), ([1.0, 1.0], 0.25), ([0.0, 1.0], -0.25)],
    },
];

impl Mode {
    /// Returns the mode's height at (u, v).
    pub(crate) fn at(&self, [u, v]: [f64; 2], now: &Surface) -> f64 {
        (self.height)(2.0 * u / now.width() - 1.0, 2.0 * v / now.height() - 1.0)
    }

    /// Returns the standard deviation of its coefficient, metres.
    pub(crate) fn sigma(&self, now: &Surface, scanner: ScannerSigma) -> f64 {
        let place = |[x, y]: [f64; 2]| [x * now.width(), y * now.height()];
        let terms: Vec<([f64; 2], f64)> =
            self.coefficient.iter().map(|(at, weight)| (place(*at), *weight)).collect();
        now.sigma_of_heights(&terms).hypot(scanner.of_heights(terms.iter().map(|(_, weight)| *weight)))
    }
}
