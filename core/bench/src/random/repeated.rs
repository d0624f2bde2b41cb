//! Bias and scatter of figures over repeated scans of one scene (trueness and precision of ISO 5725-1).
//!
//! A stated standard deviation covers two kinds of error: the scatter due to noise, and the error that an edge, its
//! contrast and its position on the lattice cause in every scan. Errors over random scenes do not separate the two.
//! Here one scene is scanned several times with other noise and the plate moved a little: the mean error is the bias,
//! and the deviations from it are the scatter.
//!
//! In: the figures of each scan; out: [`Repeated`]. A figure is identified by its kind and its number among the figures
//! of that kind.

use serde_json::{Value as Json, json};

use super::stated::{Kind, Stated};
use crate::accuracy::rms;

/// Figure over the scans of one scene, metres or radians.
pub(super) struct Repeated {
    pub(super) kind: Kind,
    /// Number of scans that have it.
    pub(super) n: usize,
    /// Mean error.
    pub(super) bias: f64,
    /// Standard deviation of single errors.
    pub(super) scatter: f64,
    /// Stated standard deviation, root mean square.
    pub(super) sigma: f64,
}

impl Repeated {
    /// Returns the figures of a kind that at least two of the scans have.
    pub(super) fn of(scans: &[&[Stated]], kind: Kind) -> Vec<Self> {
        let of_kind = |scan: &&[Stated]| scan.iter().filter(|s| s.kind == kind).copied().collect::<Vec<_>>();
        let scans: Vec<Vec<Stated>> = scans.iter().map(of_kind).collect();
        let most = scans.iter().map(Vec::len).max().unwrap_or(0);
        let figure = |number: usize| -> Vec<Stated> {
            scans.iter().filter_map(|scan| scan.get(number).copied()).collect()
        };
        let figures = (0..most).map(figure).filter(|figure| figure.len() > 1);
        figures.map(|figure| Self::of_figure(kind, &figure)).collect()
    }

    fn of_figure(kind: Kind, figure: &[Stated]) -> Self {
        let n = figure.len();
        let bias = figure.iter().map(|s| s.error).sum::<f64>() / n as f64;
        let squares: f64 = figure.iter().map(|s| (s.error - bias).powi(2)).sum();
        let scatter = (squares / (n - 1) as f64).sqrt();
        Self { kind, n, bias, scatter, sigma: rms(figure.iter().map(|s| s.sigma)) }
    }

    /// Returns the figure in the unit of its kind.
    pub(super) fn document(&self) -> Json {
        let (name, unit) = self.kind.name_and_unit();
        json!({
            "of": name, "scans": self.n, "bias": unit(self.bias), "scatter": unit(self.scatter),
            "stated_sigma": unit(self.sigma),
        })
    }
}

/// Returns the row of a kind: number of figures, bias and its largest amount, scatter, stated standard deviation (root
/// mean squares).
pub(super) fn row(kind: Kind, figures: &[&Repeated]) -> Vec<String> {
    let (name, unit) = kind.name_and_unit();
    let over =
        |of: fn(&Repeated) -> f64| format!("{:.3}", unit(rms(figures.iter().map(|figure| of(figure)))));
    let most = figures.iter().map(|figure| figure.bias.abs()).fold(0.0, f64::max);
    let bias = [over(|figure| figure.bias), format!("{:.3}", unit(most))];
    let spread = [over(|figure| figure.scatter), over(|figure| figure.sigma)];
    [name.to_owned(), figures.len().to_string()].into_iter().chain(bias).chain(spread).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_constant_error_is_bias_and_one_that_changes_sign_is_scatter() {
        let stated = |kind, error| Stated { kind, error, sigma: 2.0 };
        let scan = |sign: f64| {
            [stated(Kind::Corner, 3.0), stated(Kind::Edge, 9.0), stated(Kind::Corner, 0.5 * sign)]
        };
        let (scans, short) = ([scan(1.0), scan(-1.0), scan(1.0), scan(-1.0)], [stated(Kind::Corner, 3.0)]);
        let all: Vec<&[Stated]> = scans.iter().map(<[_; 3]>::as_slice).chain([short.as_slice()]).collect();
        let found = Repeated::of(&all, Kind::Corner);
        let numbers: Vec<[f64; 3]> = found.iter().map(|f| [f.bias, f.scatter, f.sigma]).collect();
        assert_eq!(found.iter().map(|f| f.n).collect::<Vec<_>>(), [5, 4]);
        assert_eq!(numbers[0], [3.0, 0.0, 2.0]);
        assert!(numbers[1][0] == 0.0 && (numbers[1][1] - (4.0 * 0.25_f64 / 3.0).sqrt()).abs() < 1e-12);
        assert!(Repeated::of(&all[..1], Kind::Corner).is_empty(), "one scan has no scatter");
    }
}
