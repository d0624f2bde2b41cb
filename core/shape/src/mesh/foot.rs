//! Foot points: the place on a surface that is nearest to a point in space.

use crate::Vec3;
use crate::surface::{Axis, Spans};

/// The place of a point over a surface: the first three components of a net, which may carry more.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Foot<const D: usize> {
    /// Coordinates of the foot.
    pub(crate) at: [f64; 2],
    /// The net in the foot.
    pub(crate) value: [f64; D],
    /// Unit normal in the foot, along p_u x p_v.
    pub(crate) normal: Vec3,
    /// Height of the point over the surface, along the normal, metres.
    pub(crate) height: f64,
}

/// A step below this, metres, changes neither height nor normal (by 10^-9 m and 10^-5 rad at R 5 m): the place
/// is moved by it and is final.
const SMALL_STEP: f64 = 5e-5;
/// Steps from a neighbour's foot; 2 or 3 are usual.
const MAX_STEPS: usize = 12;
/// How far outside the surface's rectangle a foot may lie, metres.
const MARGIN: f64 = 0.05;
/// Places per axis of the coarse search for a first foot.
const COARSE: usize = 24;

/// A place of a surface with its tangents, ready for steps from it.
#[derive(Clone, Copy)]
struct Tangent<const D: usize> {
    at: [f64; 2],
    /// The net and its derivatives.
    frame: [[f64; D]; 3],
    /// The first three components of those.
    point: Vec3,
    along: [Vec3; 2],
    /// Inverse of the metric (e, f; f, g): g, -f and e over its determinant.
    inverse: [f64; 3],
}

impl<const D: usize> Tangent<D> {
    fn of(spans: &Spans<D>, at: [f64; 2]) -> Self {
        let frame = spans.frame(at[0], at[1]);
        let [point, along_u, along_v] = frame.map(|c| Vec3::new(c[0], c[1], c[2]));
        let (e, f, g) = (along_u.norm_squared(), along_u.dot(&along_v), along_v.norm_squared());
        let per_area = 1.0 / (e * g - f * f);
        let inverse = [g * per_area, -f * per_area, e * per_area];
        Self { at, frame, point, along: [along_u, along_v], inverse }
    }

    /// From here to the foot of `p` on the tangent plane; not finite where the surface is degenerate.
    fn step(&self, p: &Vec3) -> [f64; 2] {
        let d = p - self.point;
        let (x, y) = (self.along[0].dot(&d), self.along[1].dot(&d));
        [self.inverse[0] * x + self.inverse[1] * y, self.inverse[1] * x + self.inverse[2] * y]
    }

    /// The foot of `p` after a last, small step from here.
    fn foot(&self, p: &Vec3, at: [f64; 2], [du, dv]: [f64; 2]) -> Foot<D> {
        let [value, along_u, along_v] = &self.frame;
        let across = self.along[0].cross(&self.along[1]);
        let normal = across * (1.0 / across.norm());
        Foot {
            at,
            value: std::array::from_fn(|d| value[d] + du * along_u[d] + dv * along_v[d]),
            normal,
            height: normal.dot(&(p - self.point)),
        }
    }
}

/// Finds feet one after the other; each search starts at the one before.
pub(crate) struct FootFinder<'a, const D: usize> {
    spans: &'a Spans<D>,
    last: Option<Tangent<D>>,
}

impl<'a, const D: usize> FootFinder<'a, D> {
    pub(crate) fn new(spans: &'a Spans<D>) -> Self {
        Self { spans, last: None }
    }

    /// The foot of `p`: Gauss-Newton, which converges at a rate of height times curvature. `None` beyond the margin.
    pub(crate) fn find(&mut self, p: &Vec3) -> Option<Foot<D>> {
        if let Some(foot) = self.last.as_mut().and_then(|last| descend(self.spans, p, last)) {
            return Some(foot);
        }
        let mut start = Tangent::of(self.spans, self.coarse(p));
        let foot = descend(self.spans, p, &mut start)?;
        self.last = Some(start);
        Some(foot)
    }

    /// The nearest of a coarse grid of places.
    fn coarse(&self, p: &Vec3) -> [f64; 2] {
        let place = |axis: &Axis, k: usize| {
            axis.start() + (axis.end() - axis.start()) * (k as f64 + 0.5) / COARSE as f64
        };
        let mut best = ([0.0; 2], f64::INFINITY);
        for k in 0..COARSE * COARSE {
            let at = [place(&self.spans.u, k % COARSE), place(&self.spans.v, k / COARSE)];
            let distance = (Tangent::of(self.spans, at).point - p).norm_squared();
            if distance < best.1 {
                best = (at, distance);
            }
        }
        best.0
    }
}

/// Moves `tangent` to the foot of `p`. `None` beyond the margin.
fn descend<const D: usize>(spans: &Spans<D>, p: &Vec3, tangent: &mut Tangent<D>) -> Option<Foot<D>> {
    let within = |x: f64, axis: &Axis| x.clamp(axis.start() - MARGIN, axis.end() + MARGIN);
    for _ in 0..MAX_STEPS {
        let step = tangent.step(p);
        let to = [tangent.at[0] + step[0], tangent.at[1] + step[1]];
        let inside = [within(to[0], &spans.u), within(to[1], &spans.v)];
        if step[0] * step[0] + step[1] * step[1] < SMALL_STEP * SMALL_STEP {
            return (to == inside).then(|| tangent.foot(p, to, step));
        }
        *tangent = Tangent::of(spans, inside);
    }
    None
}

/// Visits samples in lattice order with the feet found so far: within a column from sample to sample, at a new column
/// from the first foot of the column before.
pub(crate) fn walk<'s, const D: usize>(
    spans: &Spans<D>,
    samples: impl Iterator<Item = &'s crate::Sample>,
    mut visit: impl FnMut(&'s crate::Sample, &Foot<D>),
) {
    let mut finder = FootFinder::new(spans);
    let mut column_start: Option<(u32, Tangent<D>)> = None;
    for sample in samples {
        let new_column = column_start.is_none_or(|(column, _)| column != sample.column);
        if let (true, Some((_, start))) = (new_column, column_start) {
            finder.last = Some(start);
        }
        if let Some(foot) = finder.find(&sample.point) {
            if let (true, Some(start)) = (new_column, finder.last) {
                column_start = Some((sample.column, start));
            }
            visit(sample, &foot);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::Net;

    #[test]
    fn feet_on_a_cylinder_are_the_closed_form() {
        let axes = [Axis::new(0.0, 4.0, 40), Axis::new(0.0, 2.0, 20)];
        let r = 5.0;
        let point = |u: f64, v: f64| [r * (u / r).sin(), v, r * (1.0 - (u / r).cos())];
        let net = Net::approximate(axes[0], axes[1], point);
        let spans = Spans::of(&net);
        let mut finder = FootFinder::new(&spans);
        for k in 0..200 {
            let (u, v, h) =
                (4.0 * f64::from(k) / 199.0, 2.0 * f64::from(k % 7) / 6.0, 0.01 * f64::from(k % 5));
            let normal = Vec3::new(-(u / r).sin(), 0.0, (u / r).cos());
            let foot = finder.find(&(Vec3::from(point(u, v)) + h * normal)).expect("inside");
            assert!((foot.at[0] - u).hypot(foot.at[1] - v) < 2e-6, "{foot:?} {u} {v}");
            assert!((foot.height - h).abs() < 1e-7 && (foot.normal - normal).norm() < 2e-5);
        }
        assert!(finder.find(&Vec3::new(-0.2, 1.0, 0.0)).is_none());
    }
}
