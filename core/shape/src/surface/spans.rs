//! A net as one polynomial per span: dearer to make than the net, cheaper to read at many places.

use super::axis::{Axis, BASIS};
use super::net::Net;

/// A bicubic in the middle-centred coordinates s (along u) and t (along v) of a span: `[q][p]` is the coefficient of
/// s^p t^q.
pub(super) type Bicubic<const D: usize> = [[[f64; D]; 4]; 4];

/// The polynomials of all spans of a net, v outer, u inner.
#[derive(Debug, Clone)]
pub(crate) struct Spans<const D: usize> {
    pub(crate) u: Axis,
    pub(crate) v: Axis,
    polynomials: Vec<Bicubic<D>>,
}

impl<const D: usize> Spans<D> {
    pub(crate) fn of(net: &Net<D>) -> Self {
        let (n_u, n_v) = (net.u.n_spans(), net.v.n_spans());
        let polynomials = (0..n_u * n_v).map(|c| bicubic(net, c % n_u, c / n_u)).collect();
        Self { u: net.u, v: net.v, polynomials }
    }

    /// Value and first derivatives at (u, v): p, p_u, p_v. Beyond the ends the last span goes on.
    pub(crate) fn frame(&self, u: f64, v: f64) -> [[f64; D]; 3] {
        let ((i, s), (k, t)) = (self.u.locate(u), self.v.locate(v));
        let rows = &self.polynomials[k * self.u.n_spans() + i];
        let (values, slopes) = (rows.map(|row| value(&row, s)), rows.map(|row| slope(&row, s)));
        let per_step = (1.0 / self.u.step(), 1.0 / self.v.step());
        [
            value(&values, t),
            value(&slopes, t).map(|x| x * per_step.0),
            slope(&values, t).map(|x| x * per_step.1),
        ]
    }
}

/// A cubic at x, by Horner's rule, all components side by side.
#[inline]
fn value<const D: usize>([a, b, c, d]: &[[f64; D]; 4], x: f64) -> [f64; D] {
    let mut sum = *d;
    for row in [c, b, a] {
        sum.iter_mut().zip(row).for_each(|(sum, term)| *sum = *sum * x + term);
    }
    sum
}

/// Its derivative.
#[inline]
fn slope<const D: usize>([_, b, c, d]: &[[f64; D]; 4], x: f64) -> [f64; D] {
    let mut sum = *d;
    sum.iter_mut().for_each(|sum| *sum *= 3.0);
    sum.iter_mut().zip(c).for_each(|(sum, term)| *sum = *sum * x + 2.0 * term);
    sum.iter_mut().zip(b).for_each(|(sum, term)| *sum = *sum * x + term);
    sum
}

/// The net's polynomial in the span (i, k).
pub(super) fn bicubic<const D: usize>(net: &Net<D>, i: usize, k: usize) -> Bicubic<D> {
    let mut bicubic = [[[0.0; D]; 4]; 4];
    for (b, along_v) in BASIS.iter().enumerate() {
        // Row k + b of the net as a polynomial in s.
        let mut row = [[0.0; D]; 4];
        for (control, along_u) in net.row(i, k + b).iter().zip(&BASIS) {
            for (slot, f) in row.iter_mut().zip(along_u) {
                (0..D).for_each(|d| slot[d] += f * control[d]);
            }
        }
        for (slots, f) in bicubic.iter_mut().zip(along_v) {
            for (slot, x) in slots.iter_mut().zip(&row) {
                (0..D).for_each(|d| slot[d] += f * x[d]);
            }
        }
    }
    bicubic
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_read_as_the_net_does() {
        let f = |u: f64, v: f64| [(2.0 * u).sin() * v, (u - v).cos()];
        let net = Net::approximate(Axis::new(-1.0, 2.0, 7), Axis::new(0.0, 1.5, 4), f);
        let spans = Spans::of(&net);
        for (u, v) in [(-1.0, 0.0), (0.3, 0.7), (2.0, 1.5), (2.04, -0.03)] {
            let difference =
                spans.frame(u, v).into_iter().flatten().zip(net.frame(u, v).into_iter().flatten());
            assert!(difference.into_iter().all(|(a, b)| (a - b).abs() < 1e-12), "{u} {v}");
        }
    }
}
