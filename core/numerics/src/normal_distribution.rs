//! Normal distribution function, by the rational approximation of Abramowitz and Stegun 7.1.26, accurate to 1.5e-7.

/// Number of standard deviations beyond which the distribution function is taken as 0 or 1, to a hundred-millionth.
pub const CERTAIN: f64 = 5.6;

/// Normal distribution function at a place, with the derivatives of its logarithm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LogCdf {
    /// The distribution function.
    pub cdf: f64,
    /// First derivative of its logarithm.
    pub slope: f64,
    /// Negative second derivative of its logarithm.
    pub bend: f64,
}

/// Returns the normal distribution function with the derivatives of its logarithm, for Newton's method.
#[inline]
#[must_use]
pub fn log_cdf(z: f64) -> LogCdf {
    // Below this, the ratio to the density follows from the series of Mills' ratio, with an error below 1 in 500.
    const TAIL: f64 = -4.0;
    if z > CERTAIN {
        return LogCdf { cdf: 1.0, slope: 0.0, bend: 0.0 };
    }
    let bell = (-0.5 * z * z).exp();
    let density = bell / (2.0 * std::f64::consts::PI).sqrt();
    let (cdf, slope) = if z < TAIL {
        let slope = -z / (1.0 - 1.0 / (z * z) + 3.0 / z.powi(4));
        (density / slope, slope)
    } else {
        let cdf = if z < 0.0 { upper_tail(-z, bell) } else { 1.0 - upper_tail(z, bell) };
        (cdf, density / cdf)
    };
    LogCdf { cdf, slope, bend: slope * (slope + z) }
}

/// Returns the normal distribution function.
#[inline]
#[must_use]
pub fn cdf(z: f64) -> f64 {
    if z.abs() > CERTAIN {
        return f64::from(z > 0.0);
    }
    let tail = upper_tail(z.abs(), (-0.5 * z * z).exp());
    if z < 0.0 { tail } else { 1.0 - tail }
}

/// Returns one minus the distribution function at `z` of 0 or more, where `bell` is exp(-z^2 / 2).
#[inline]
fn upper_tail(z: f64, bell: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.327_591_1 / std::f64::consts::SQRT_2 * z);
    let series = [0.254_829_592, -0.284_496_736, 1.421_413_741, -1.453_152_027, 1.061_405_429];
    0.5 * series.iter().rev().fold(0.0, |sum, c| sum * t + c) * t * bell
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_logarithm_and_its_derivatives_agree() {
        // ln of the distribution function at -5, 0 and 1.5, from tables.
        for (z, log) in [(-5.0, -15.064_998), (0.0, -std::f64::consts::LN_2), (1.5, -0.069_143)] {
            assert!((log_cdf(z).cdf.ln() - log).abs() < 3e-3, "{z}: {}", log_cdf(z).cdf.ln());
        }
        for z in [-6.0, -3.0, -0.7, 0.4, 2.0] {
            let h = 1e-3;
            let (below, above) = (log_cdf(z - h), log_cdf(z + h));
            assert!(((above.cdf / below.cdf).ln() / (2.0 * h) - log_cdf(z).slope).abs() < 0.02);
            assert!((-(above.slope - below.slope) / (2.0 * h) - log_cdf(z).bend).abs() < 0.05);
            assert!((log_cdf(z).cdf - cdf(z)).abs() < 2e-7);
        }
    }
}
