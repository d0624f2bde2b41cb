//! Rigid registration of a plate to its target (Kabsch, Acta Cryst. A32 (1976)).

use nalgebra::{Matrix3, Rotation3};

use super::TargetSurface;
use crate::{Surface, Vec3};

/// A rigid motion, such as that from the scanner's frame to the target's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    rotation: Rotation3<f64>,
    translation: Vec3,
}

impl Placement {
    /// Finds the motion that brings the material points of the places (u, v) closest to the target's, on the scanned
    /// face.
    #[must_use]
    pub fn best(now: &Surface, target: &TargetSurface, places: impl Iterator<Item = [f64; 2]>) -> Self {
        Self::of_pairs(places.map(|[u, v]| (now.face(u, v), target.face(u, v))))
    }

    /// Finds the motion that brings the first points of the pairs closest to the second ones (Kabsch, by the singular
    /// vectors of the covariance).
    #[must_use]
    pub fn of_pairs(pairs: impl Iterator<Item = (Vec3, Vec3)>) -> Self {
        let pairs: Vec<(Vec3, Vec3)> = pairs.collect();
        let n = pairs.len().max(1) as f64;
        let from = pairs.iter().map(|(p, _)| p).sum::<Vec3>() / n;
        let to = pairs.iter().map(|(_, q)| q).sum::<Vec3>() / n;
        let covariance: Matrix3<f64> = pairs.iter().map(|(p, q)| (q - to) * (p - from).transpose()).sum();
        let svd = covariance.svd(true, true);
        let rotation = match (svd.u, svd.v_t) {
            (Some(left), Some(right)) => {
                let handed = (left * right).determinant().signum();
                let upright = Matrix3::from_diagonal(&Vec3::new(1.0, 1.0, handed));
                Rotation3::from_matrix_unchecked(left * upright * right)
            }
            _ => Rotation3::identity(),
        };
        Self { rotation, translation: to - rotation * from }
    }

    /// Returns the rotation of the motion.
    #[must_use]
    pub fn rotation(&self) -> Rotation3<f64> {
        self.rotation
    }

    /// Returns the moved point.
    #[must_use]
    pub fn moved(&self, p: &Vec3) -> Vec3 {
        self.rotation * p + self.translation
    }

    /// Returns measured minus target along the target's normal at a place (u, v), metres, positive towards the scanner.
    #[must_use]
    pub fn deviation(&self, now: &Surface, target: &TargetSurface, [u, v]: [f64; 2]) -> f64 {
        let here = self.moved(&now.face(u, v));
        (here - target.face(u, v)).dot(&target.normal(u, v))
    }
}
