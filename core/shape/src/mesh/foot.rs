//! Foot points: the place on a surface that is nearest to a point in space.

use crate::Vec3;
use crate::surface::{Axis, Net};

/// The place of a point over a surface.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Foot {
    /// Coordinates of the foot.
    pub(crate) at: [f64; 2],
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
struct Tangent {
    at: [f64; 2],
    point: Vec3,
    along: [Vec3; 2],
    /// Inverse of the metric (e, f; f, g): g, -f and e over its determinant.
    inverse: [f64; 3],
}

impl Tangent {
    fn of(net: &Net<3>, at: [f64; 2]) -> Self {
        let [point, along_u, along_v] = net.frame(at[0], at[1]).map(Vec3::from);
        let (e, f, g) = (along_u.norm_squared(), along_u.dot(&along_v), along_v.norm_squared());
        let determinant = e * g - f * f;
        let inverse = [g / determinant, -f / determinant, e / determinant];
        Self { at, point, along: [along_u, along_v], inverse }
    }

    /// From here to the foot of `p` on the tangent plane; not finite where the surface is degenerate.
    fn step(&self, p: &Vec3) -> [f64; 2] {
        let d = p - self.point;
        let (x, y) = (self.along[0].dot(&d), self.along[1].dot(&d));
        [self.inverse[0] * x + self.inverse[1] * y, self.inverse[1] * x + self.inverse[2] * y]
    }
}

/// Finds feet one after the other; each search starts at the one before.
pub(crate) struct FootFinder<'a> {
    net: &'a Net<3>,
    last: Option<Tangent>,
}

impl<'a> FootFinder<'a> {
    pub(crate) fn new(net: &'a Net<3>) -> Self {
        Self { net, last: None }
    }

    /// The foot of `p`: Gauss-Newton, which converges at a rate of height times curvature. `None` beyond the margin.
    pub(crate) fn find(&mut self, p: &Vec3) -> Option<Foot> {
        let near = self.last.and_then(|start| self.descend(p, start));
        let (foot, tangent) = near.or_else(|| self.descend(p, Tangent::of(self.net, self.coarse(p))))?;
        self.last = Some(tangent);
        Some(foot)
    }

    fn descend(&self, p: &Vec3, mut tangent: Tangent) -> Option<(Foot, Tangent)> {
        let (u, v) = (&self.net.u, &self.net.v);
        let within = |x: f64, axis: &Axis| x.clamp(axis.start() - MARGIN, axis.end() + MARGIN);
        for _ in 0..MAX_STEPS {
            let [du, dv] = tangent.step(p);
            let to = [tangent.at[0] + du, tangent.at[1] + dv];
            let inside = [within(to[0], u), within(to[1], v)];
            if du * du + dv * dv < SMALL_STEP * SMALL_STEP {
                let normal = tangent.along[0].cross(&tangent.along[1]).normalize();
                let foot = Foot { at: to, normal, height: normal.dot(&(p - tangent.point)) };
                return (to == inside).then_some((foot, tangent));
            }
            tangent = Tangent::of(self.net, inside);
        }
        None
    }

    /// The nearest of a coarse grid of places.
    fn coarse(&self, p: &Vec3) -> [f64; 2] {
        let place = |axis: &Axis, k: usize| {
            axis.start() + (axis.end() - axis.start()) * (k as f64 + 0.5) / COARSE as f64
        };
        let mut best = ([0.0; 2], f64::INFINITY);
        for k in 0..COARSE * COARSE {
            let at = [place(&self.net.u, k % COARSE), place(&self.net.v, k / COARSE)];
            let distance = (Vec3::from(self.net.point(at[0], at[1])) - p).norm_squared();
            if distance < best.1 {
                best = (at, distance);
            }
        }
        best.0
    }
}

/// Visits samples in lattice order with the feet found so far: within a column from sample to sample, at a new column
/// from the first foot of the column before.
pub(crate) fn walk<'s>(
    net: &Net<3>,
    samples: impl Iterator<Item = &'s crate::Sample>,
    mut visit: impl FnMut(&'s crate::Sample, Foot),
) {
    let mut finder = FootFinder::new(net);
    let mut column_start: Option<(u32, Tangent)> = None;
    for sample in samples {
        let new_column = column_start.is_none_or(|(column, _)| column != sample.column);
        if let (true, Some((_, start))) = (new_column, column_start) {
            finder.last = Some(start);
        }
        if let Some(foot) = finder.find(&sample.point) {
            if let (true, Some(start)) = (new_column, finder.last) {
                column_start = Some((sample.column, start));
            }
            visit(sample, foot);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn feet_on_a_cylinder_are_the_closed_form() {
        let axes = [Axis::new(0.0, 4.0, 40), Axis::new(0.0, 2.0, 20)];
        let r = 5.0;
        let point = |u: f64, v: f64| [r * (u / r).sin(), v, r * (1.0 - (u / r).cos())];
        let net = Net::approximate(axes[0], axes[1], point);
        let mut finder = FootFinder::new(&net);
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
