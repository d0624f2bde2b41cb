//! Foot points: the place on a surface that is nearest to a point in space.

use nalgebra::{Matrix2, Vector2};

use crate::Vec3;
use crate::surface::Net;

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

/// Finds feet one after the other; each search starts at the one before.
pub(crate) struct FootFinder<'a> {
    net: &'a Net<3>,
    last: Option<[f64; 2]>,
}

impl<'a> FootFinder<'a> {
    pub(crate) fn new(net: &'a Net<3>) -> Self {
        Self { net, last: None }
    }

    /// The next search starts here.
    pub(crate) fn start_at(&mut self, at: [f64; 2]) {
        self.last = Some(at);
    }

    /// The foot of `p`: Gauss-Newton, which converges at a rate of height times curvature. `None` beyond the margin.
    pub(crate) fn find(&mut self, p: &Vec3) -> Option<Foot> {
        let near = self.last.and_then(|at| self.descend(p, at));
        let foot = near.or_else(|| self.descend(p, self.coarse(p)))?;
        self.last = Some(foot.at);
        Some(foot)
    }

    fn descend(&self, p: &Vec3, start: [f64; 2]) -> Option<Foot> {
        let (u, v) = (&self.net.u, &self.net.v);
        let mut at = start;
        for _ in 0..MAX_STEPS {
            let [q, along_u, along_v] = self.net.frame(at[0], at[1]).map(Vec3::from);
            let d = p - q;
            let metric = Matrix2::new(
                along_u.norm_squared(),
                along_u.dot(&along_v),
                along_u.dot(&along_v),
                along_v.norm_squared(),
            );
            let step = metric.try_inverse()? * Vector2::new(along_u.dot(&d), along_v.dot(&d));
            let to = [at[0] + step.x, at[1] + step.y];
            if step.norm() < SMALL_STEP {
                let inside = to[0] > u.start() - MARGIN
                    && to[0] < u.end() + MARGIN
                    && to[1] > v.start() - MARGIN
                    && to[1] < v.end() + MARGIN;
                let normal = along_u.cross(&along_v).normalize();
                return inside.then(|| Foot { at: to, normal, height: normal.dot(&d) });
            }
            at = [
                to[0].clamp(u.start() - MARGIN, u.end() + MARGIN),
                to[1].clamp(v.start() - MARGIN, v.end() + MARGIN),
            ];
        }
        None
    }

    /// The nearest of a coarse grid of places.
    fn coarse(&self, p: &Vec3) -> [f64; 2] {
        let place = |axis: &crate::surface::Axis, k: usize| {
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
    let mut column_start: Option<(u32, [f64; 2])> = None;
    for sample in samples {
        let new_column = column_start.is_none_or(|(column, _)| column != sample.column);
        if let (true, Some((_, at))) = (new_column, column_start) {
            finder.start_at(at);
        }
        if let Some(foot) = finder.find(&sample.point) {
            if new_column {
                column_start = Some((sample.column, foot.at));
            }
            visit(sample, foot);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::Axis;

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
