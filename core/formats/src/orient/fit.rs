//! Weighted least-squares fit of an angle to the number of a line (row or column), with its correlation.
//!
//! Azimuths are averaged as unit vectors (circular mean and variance) and unwrapped from line to line by the median
//! step, so that a blind sector of more than half a turn does not lose a turn.

use std::f64::consts::{PI, TAU};

use platen_scan::wrap_azimuth;

/// Sums over the valid cells of one row or one column.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Line {
    /// Number of cells stored, valid or not.
    pub(super) cells: u32,
    /// Number of valid cells.
    pub(super) valid: u32,
    elevation: f64,
    elevation2: f64,
    // Horizontal part of the beams' unit vectors: beams near the zenith have little weight.
    east: f64,
    north: f64,
    horizontal: f64,
}

impl Line {
    /// Adds a valid cell: parts of its unit vector to the east, to the north and horizontal, and its elevation.
    pub(super) fn add(&mut self, [east, north, horizontal]: [f64; 3], elevation: f64) {
        self.valid += 1;
        self.elevation += elevation;
        self.elevation2 += elevation * elevation;
        self.east += east;
        self.north += north;
        self.horizontal += horizontal;
    }

    /// Returns mean and variance of the elevation.
    fn elevation(&self) -> (f64, f64) {
        let n = f64::from(self.valid);
        let mean = self.elevation / n;
        (mean, (self.elevation2 / n - mean * mean).max(0.0))
    }

    /// Returns circular mean and variance of the azimuth, radians and radians squared (2 (1 - R) for a small spread).
    fn azimuth(&self) -> (f64, f64) {
        let mean = self.north.atan2(self.east);
        let resultant = self.east.hypot(self.north) / self.horizontal.max(f64::MIN_POSITIVE);
        (mean, (2.0 * (1.0 - resultant)).max(0.0))
    }
}

/// Straight fit `angle = start + step * line`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Fit {
    /// Correlation over all valid cells, not over line means.
    pub(super) correlation: f64,
    /// Angle of line 0, radians.
    pub(super) start: f64,
    /// Radians per line, signed.
    pub(super) step: f64,
    /// Root mean square distance of line means from the straight fit, radians.
    pub(super) spread: f64,
}

/// A line with valid cells: number, count of valid cells, mean angle, variance about it.
struct Mean {
    line: f64,
    weight: f64,
    angle: f64,
    variance: f64,
}

/// Fits elevation to the number of the line; `None` with fewer than two lines of valid cells.
pub(super) fn elevation(lines: &[Line]) -> Option<Fit> {
    let means: Vec<Mean> = means(lines, Line::elevation);
    fit(&means)
}

/// Fits azimuth, unwrapped from line to line, to the number of the line.
pub(super) fn azimuth(lines: &[Line]) -> Option<Fit> {
    let mut means: Vec<Mean> = means(lines, Line::azimuth);
    unwrap(&mut means);
    fit(&means)
}

fn means(lines: &[Line], angle: fn(&Line) -> (f64, f64)) -> Vec<Mean> {
    let filled = lines.iter().enumerate().filter(|(_, line)| line.valid > 0);
    filled
        .map(|(number, line)| {
            let (angle, variance) = angle(line);
            Mean { line: number as f64, weight: f64::from(line.valid), angle, variance }
        })
        .collect()
}

/// Adds whole turns so that the angle grows evenly from line to line.
///
/// Every line is predicted from the previous one by the median step between neighbours.
fn unwrap(means: &mut [Mean]) {
    let mut steps: Vec<f64> = means
        .windows(2)
        .map(|pair| wrap_azimuth(pair[1].angle - pair[0].angle) / (pair[1].line - pair[0].line))
        .collect();
    if steps.is_empty() {
        return;
    }
    let middle = steps.len() / 2;
    let step = *steps.select_nth_unstable_by(middle, f64::total_cmp).1;
    for i in 1..means.len() {
        let predicted = means[i - 1].angle + step * (means[i].line - means[i - 1].line);
        means[i].angle += TAU * ((predicted - means[i].angle) / TAU).round();
    }
    debug_assert!(means.windows(2).all(|pair| {
        (pair[1].angle - pair[0].angle - step * (pair[1].line - pair[0].line)).abs() <= PI + 1e-9
    }));
}

/// Fits a straight line to the line means; the correlation includes the variance within lines.
fn fit(means: &[Mean]) -> Option<Fit> {
    if means.len() < 2 {
        return None;
    }
    let total: f64 = means.iter().map(|m| m.weight).sum();
    let mean_line = means.iter().map(|m| m.weight * m.line).sum::<f64>() / total;
    let mean_angle = means.iter().map(|m| m.weight * m.angle).sum::<f64>() / total;
    let (mut line2, mut both, mut angle2) = (0.0, 0.0, 0.0);
    for m in means {
        let (l, a) = (m.line - mean_line, m.angle - mean_angle);
        line2 += m.weight * l * l;
        both += m.weight * l * a;
        angle2 += m.weight * (a * a + m.variance);
    }
    let step = both / line2;
    let start = mean_angle - step * mean_line;
    let residual2: f64 = means.iter().map(|m| m.weight * (m.angle - start - step * m.line).powi(2)).sum();
    let correlation = if angle2 > 0.0 { both / (line2 * angle2).sqrt() } else { 0.0 };
    Some(Fit { correlation, start, step, spread: (residual2 / total).sqrt() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use platen_scan::Direction;

    fn line(cells: &[Direction]) -> Line {
        let mut line = Line::default();
        for cell in cells {
            line.add(cell.unit(), cell.elevation);
        }
        line
    }

    #[test]
    fn azimuth_is_followed_through_the_seam_and_over_a_blind_sector() {
        let step = -0.02;
        let mut lines = vec![Line::default(); 310];
        for (number, held) in lines.iter_mut().enumerate() {
            if !(60..240).contains(&number) {
                let azimuth = 0.3 + step * number as f64;
                *held = line(&[-0.5, 0.0, 0.5].map(|elevation| Direction { azimuth, elevation }));
            }
        }
        let fit = azimuth(&lines).unwrap();
        assert!((fit.step - step).abs() < 1e-12 && (fit.start - 0.3).abs() < 1e-9, "{fit:?}");
        assert!((fit.correlation + 1.0).abs() < 1e-9 && fit.spread < 1e-9);
        assert!(elevation(&lines).unwrap().correlation.abs() < 1e-6);
    }
}
