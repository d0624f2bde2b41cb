//! Alignment of two scans: the rigid motion of the plate as a whole, by weighted least squares.

use nalgebra::{Matrix6, Rotation3, Vector6};
use platen_sdk::{PlateGrid, Result};
use platen_shape::{Placement, Vec3};

use crate::nodes::Nodes;

/// Nodes along each side.
const NODES: usize = PlateGrid::SIDE;

/// Standard deviation of a material point within the surface, metres, as observed on scans of good plates. The normal
/// direction is ten times more certain and determines the alignment; this value prevents sliding.
const TANGENT_SIGMA: f64 = 0.3e-3;

/// Least standard deviation along the normal, metres: errors outside the fits' covariances (lattice, range bias).
const NORMAL_FLOOR: f64 = 0.05e-3;

/// Tukey's biweight constant: 95 % efficiency for normal errors (Huber, Ronchetti, Robust Statistics, 2nd ed., 4.8).
const TUKEY: f64 = 4.685;

/// Standard deviation of normal errors over the length of the shortest interval that contains half of them.
const SHORTH: f64 = 0.7413;

/// Local fits along each side in the search for the unchanged part.
const LOCAL_FITS: usize = 6;

/// `p -> rotation * (p - pivot) + pivot + translation`, with the covariance of its six parameters.
#[derive(Debug, Clone)]
pub(crate) struct Motion {
    rotation: Rotation3<f64>,
    translation: Vec3,
    pivot: Vec3,
    covariance: Matrix6<f64>,
}

/// Motion of the earlier plate, with the weights of its fit.
#[derive(Debug)]
pub(crate) struct Alignment<'a> {
    pub(crate) motion: Motion,
    /// Weight of each node in the fit, 0 to 1.
    pub(crate) weights: Vec<f64>,
    pub(crate) name: &'a str,
}

impl Motion {
    pub(crate) fn none() -> Self {
        Self {
            rotation: Rotation3::identity(),
            translation: Vec3::zeros(),
            pivot: Vec3::zeros(),
            covariance: Matrix6::zeros(),
        }
    }

    pub(crate) fn apply(&self, p: &Vec3) -> Vec3 {
        self.rotation * (p - self.pivot) + self.pivot + self.translation
    }

    pub(crate) fn angle(&self) -> f64 {
        self.rotation.angle()
    }

    /// Returns the displacement of a point by the motion.
    pub(crate) fn translation_at(&self, p: Vec3) -> Vec3 {
        self.apply(&p) - p
    }

    /// Returns the standard deviation of the moved point along `normal`.
    pub(crate) fn sigma(&self, p: &Vec3, normal: &Vec3) -> f64 {
        let row = jacobian_row(&(p - self.pivot), normal);
        (row.transpose() * self.covariance * row)[0].max(0.0).sqrt()
    }
}

/// Returns the derivative of `direction . motion(p)` by the small rotation and the translation.
fn jacobian_row(arm: &Vec3, direction: &Vec3) -> Vector6<f64> {
    let turn = arm.cross(direction);
    Vector6::new(turn.x, turn.y, turn.z, direction.x, direction.y, direction.z)
}

/// Fits the four corners.
pub(crate) fn corners(nodes: &Nodes) -> Motion {
    let last = NODES - 1;
    fit(nodes, &[0, last, NODES * last, NODES * last + last])
}

/// Fits all points of a short list.
pub(crate) fn places(nodes: &Nodes) -> Motion {
    fit(nodes, &(0..nodes.now.len()).collect::<Vec<_>>())
}

fn fit(nodes: &Nodes, places: &[usize]) -> Motion {
    let mut motion = closed_form(nodes, places.iter().copied());
    for _ in 0..8 {
        step(nodes, &mut motion, places.iter().map(|i| (*i, 1.0)), 1.0);
    }
    motion
}

/// Fits the largest part that kept its shape. Returns the motion and the weight of each node, 0 to 1.
///
/// The local fit with the most inliers is refined by iteratively reweighted least squares with Tukey's biweight.
pub(crate) fn unchanged(check: &dyn Fn() -> Result<()>, nodes: &Nodes) -> Result<(Motion, Vec<f64>)> {
    let start = all_seen(nodes);
    let mut best = (f64::NEG_INFINITY, start.clone());
    for row in 0..LOCAL_FITS {
        for column in 0..LOCAL_FITS {
            check()?;
            let motion = local(nodes, &start, row, column);
            let inliers = inliers(nodes, &motion);
            if inliers > best.0 {
                best = (inliers, motion);
            }
        }
    }
    let mut motion = best.1;
    for _ in 0..20 {
        let weights = weights(nodes, &motion);
        step(nodes, &mut motion, weights.into_iter().enumerate(), SHARING);
    }
    let weights = weights(nodes, &motion);
    Ok((motion, weights))
}

/// Returns the motion by unweighted least squares (Kabsch), as the start of Gauss-Newton. It also finds a plate that
/// was turned by half a turn.
fn closed_form(nodes: &Nodes, places: impl Iterator<Item = usize>) -> Motion {
    let seen = places.filter(|i| nodes.seen[*i]);
    let placement = Placement::of_pairs(seen.map(|i| (nodes.before[i], nodes.now[i])));
    let pivot = nodes.centre();
    let translation = placement.moved(&pivot) - pivot;
    Motion { rotation: placement.rotation(), translation, pivot, ..Motion::none() }
}

/// Fits all points that were seen.
fn all_seen(nodes: &Nodes) -> Motion {
    let places = || (0..PlateGrid::NODES).step_by(7);
    let mut motion = closed_form(nodes, places());
    for _ in 0..6 {
        step(nodes, &mut motion, places().map(|i| (i, 1.0)), 1.0);
    }
    motion
}

/// Fits one cell of the grid of local fits, with a margin.
fn local(nodes: &Nodes, start: &Motion, row: usize, column: usize) -> Motion {
    let range = |k: usize| {
        let cell = (NODES - 1) as f64 / LOCAL_FITS as f64;
        let (from, to) = ((k as f64 - 0.25) * cell, (k as f64 + 1.25) * cell);
        from.max(0.0) as usize..=to.min((NODES - 1) as f64) as usize
    };
    let mut motion = start.clone();
    for _ in 0..3 {
        let places =
            range(row).step_by(2).flat_map(|v| range(column).step_by(2).map(move |u| (v * NODES + u, 1.0)));
        step(nodes, &mut motion, places, 1.0);
    }
    motion
}

/// Returns the standard deviation of a point along the normal. It includes the scanner's correlated error: a fit scaled
/// to the noise alone follows one crest of a wave and leaves the other as a change.
fn sigma_normal(nodes: &Nodes, i: usize) -> f64 {
    nodes.sigma[i].hypot(NORMAL_FLOOR).hypot(nodes.correlated)
}

fn scaled_residual(nodes: &Nodes, motion: &Motion, i: usize) -> f64 {
    let off = (nodes.now[i] - motion.apply(&nodes.before[i])).dot(&nodes.normal[i]);
    off / sigma_normal(nodes, i)
}

fn inliers(nodes: &Nodes, motion: &Motion) -> f64 {
    let near = |i: &usize| nodes.seen[*i] && scaled_residual(nodes, motion, *i).abs() < TUKEY;
    (0..PlateGrid::NODES).step_by(3).filter(near).count() as f64
}

/// Returns Tukey's biweight of every node, scaled by [`scatter`].
fn weights(nodes: &Nodes, motion: &Motion) -> Vec<f64> {
    let residual: Vec<f64> = (0..PlateGrid::NODES).map(|i| scaled_residual(nodes, motion, i)).collect();
    let scale = scatter(nodes, &residual);
    let weight = |r: f64| if r.abs() < 1.0 { (1.0 - r * r).powi(2) } else { 0.0 };
    residual.into_iter().map(|r| weight(r / (TUKEY * scale))).collect()
}

/// Returns the standard deviation of the scaled residuals of the part that kept its shape. It is computed from the
/// shortest interval that contains half of the residuals (the shorth; Rousseeuw, Leroy, "Robust Regression and Outlier
/// Detection", 1987, 4.3), wherever a first fit has placed it. It is not below the noise of the fits, and not above 1,
/// the stated error. A good scanner has smaller errors than its data sheet states; with the scale of the data sheet a
/// change would shift the alignment.
fn scatter(nodes: &Nodes, residual: &[f64]) -> f64 {
    let of_seen = |value: &dyn Fn(usize) -> f64| {
        let mut values: Vec<f64> = (0..PlateGrid::NODES).filter(|i| nodes.seen[*i]).map(value).collect();
        values.sort_unstable_by(f64::total_cmp);
        values
    };
    let sorted = of_seen(&|i| residual[i]);
    let half = sorted.len() / 2;
    let shortest = sorted.iter().zip(sorted.iter().skip(half)).map(|(from, to)| to - from).reduce(f64::min);
    let noise = of_seen(&|i| nodes.sigma[i] / sigma_normal(nodes, i)).get(half).copied().unwrap_or(1.0);
    (SHORTH * shortest.unwrap_or(0.0)).clamp(noise.min(1.0), 1.0)
}

/// Nodes per independent point: a spline has fewer degrees of freedom than the fields have nodes. One in 25, as in the
/// result's own grid.
const SHARING: f64 = 25.0;

/// Takes one Gauss-Newton step of the weighted fit over the given points; `inflation` scales the covariance.
fn step(nodes: &Nodes, motion: &mut Motion, places: impl Iterator<Item = (usize, f64)>, inflation: f64) {
    let mut normal_matrix = Matrix6::zeros();
    let mut gradient = Vector6::zeros();
    for (i, weight) in places.filter(|(i, weight)| nodes.seen[*i] && *weight > 0.0) {
        let moved = motion.apply(&nodes.before[i]);
        let off = nodes.now[i] - moved;
        let arm = moved - motion.pivot - motion.translation;
        let n = nodes.normal[i];
        let tangent = n.cross(&least_axis(&n)).normalize();
        let (sigma_n, sigma_t) = (sigma_normal(nodes, i), TANGENT_SIGMA.hypot(nodes.correlated));
        for (direction, sigma) in [(n, sigma_n), (tangent, sigma_t), (n.cross(&tangent), sigma_t)] {
            let row = jacobian_row(&arm, &direction);
            let w = weight / (sigma * sigma);
            normal_matrix += row * row.transpose() * w;
            gradient += row * (off.dot(&direction) * w);
        }
    }
    let Some(cholesky) = normal_matrix.cholesky() else { return };
    let delta = cholesky.solve(&gradient);
    motion.rotation = Rotation3::new(Vec3::new(delta[0], delta[1], delta[2])) * motion.rotation;
    motion.translation += Vec3::new(delta[3], delta[4], delta[5]);
    motion.covariance = cholesky.inverse() * inflation;
}

/// Returns the unit axis in which `n` is smallest.
fn least_axis(n: &Vec3) -> Vec3 {
    let axis = n.iamin();
    Vec3::from_fn(|k, _| f64::from(k == axis))
}
