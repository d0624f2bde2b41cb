//! Elastic bending energy between the measured curvature and that of the target.
//!
//! The energy, joules, is one figure for the forming that remains. The second figure is the share of the plate that is
//! bent beyond its target.

use crate::{Surface, TargetSurface};

/// Young's modulus of structural steel, Pa (EN 1993-1-1, 3.2.6).
const YOUNG: f64 = 210e9;
/// Poisson's ratio of steel in the elastic range (EN 1993-1-1, 3.2.6).
const POISSON: f64 = 0.3;
/// Number of places along each side for the sums: one every 40 to 60 mm on the trade's plates, finer than a bend band.
const SIDE: usize = 81;

/// Bending energy and shares of a measured plate against its target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BendingEnergy {
    /// Energy that would bend the plate elastically from the measured to the target's curvature, joules: U = D/2 int
    /// (dku + dkv)^2 - 2 (1 - nu) (dku dkv - dkuv^2) dA, D = E t^3 / 12 (1 - nu^2) (Timoshenko and Woinowsky-Krieger,
    /// Theory of Plates and Shells, strain energy in pure bending of plates). Forming is plastic; as a measure of the
    /// remaining forming the energy counts missing and surplus curvature alike, by their squares.
    pub energy: f64,
    /// Share of the seen area that is bent beyond the target by more than the given tolerance.
    pub beyond_share: f64,
    /// Share of the plate that was seen; the rest does not enter these figures.
    pub seen_share: f64,
}

impl BendingEnergy {
    /// Computes the figures of a measured plate. `tolerance` is the curvature by which a place may exceed the target's,
    /// 1/m. `None` when no part was seen.
    #[must_use]
    pub fn new(surface: &Surface, target: &TargetSurface, tolerance: f64) -> Option<Self> {
        let (w, h, t) = (surface.width(), surface.height(), surface.thickness());
        let places = (0..SIDE * SIDE).map(|k| {
            // Middles of even cells: no place on the edge, where a spline's curvature is least certain.
            let at = |k: usize, length: f64| length * (k as f64 + 0.5) / SIDE as f64;
            (at(k % SIDE, w), at(k / SIDE, h))
        });
        let (mut seen, mut beyond, mut sum) = (0_usize, 0_usize, 0.0);
        for (u, v) in places.filter(|(u, v)| surface.mask().seen(*u, *v)) {
            let measured = surface.curvature(u, v);
            let lacks = target.curvature(u, v) - measured;
            sum +=
                (lacks.u + lacks.v).powi(2) - 2.0 * (1.0 - POISSON) * (lacks.u * lacks.v - lacks.uv.powi(2));
            seen += 1;
            beyond += usize::from(target.deficit(&measured, u, v) < -tolerance);
        }
        let stiffness = YOUNG * t.powi(3) / (12.0 * (1.0 - POISSON * POISSON));
        let cell = w * h / (SIDE * SIDE) as f64;
        (seen > 0).then(|| Self {
            energy: 0.5 * stiffness * sum * cell,
            beyond_share: beyond as f64 / seen as f64,
            seen_share: seen as f64 / (SIDE * SIDE) as f64,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec3;
    use crate::surface::{Mask, SplineFit, UniformKnots};
    use platen_model::{Facing, RadiusOf, Target, TargetShape};

    const W: f64 = 3.0;
    const H: f64 = 2.0;
    const T: f64 = 0.04;

    /// Builds a mid-surface without noise, bent along u to the curvature k.
    fn bent(k: f64, mut mask: Mask) -> Surface {
        let mut fit = SplineFit::new(UniformKnots::new(0.0, W, 15), UniformKnots::new(0.0, H, 10));
        for i in 0..120 * 80 {
            let (u, v) = (W * (f64::from(i % 120) + 0.5) / 120.0, H * (f64::from(i / 120) + 0.5) / 80.0);
            let point = match k {
                0.0 => Vec3::new(u, v, 0.0),
                _ => Vec3::new((k * u).sin() / k, v, (1.0 - (k * u).cos()) / k),
            };
            fit.add(u, v, point.into(), 1e8);
            if u < 0.5 * W {
                mask.mark(u, v);
            }
        }
        // REML requires noise: the penalty is given instead.
        let penalty = platen_numerics::reml::Penalty { u: 1e-6, v: 1e-6 };
        Surface::new(fit.solve_with(penalty).unwrap(), T, mask)
    }

    fn target(radius: f64) -> TargetSurface {
        let shape = TargetShape::Cylinder { radius, axis: std::f64::consts::FRAC_PI_2 };
        let target = Target { shape, radius_of: RadiusOf::Mid, scanned_face: Facing::Inside };
        TargetSurface::new(&target, W, H, T).unwrap()
    }

    fn whole() -> Mask {
        Mask::from_cells(W, H, [1, 1], vec![true]).unwrap()
    }

    #[test]
    fn a_flat_plate_lacks_the_energy_of_pure_bending() {
        let forming = BendingEnergy::new(&bent(0.0, whole()), &target(10.0), 0.006).unwrap();
        let stiffness = 210e9 * T.powi(3) / (12.0 * 0.91);
        let expected = 0.5 * stiffness * 0.1_f64.powi(2) * W * H;
        assert!((forming.energy / expected - 1.0).abs() < 1e-6, "{forming:?}, {expected}");
        assert_eq!((forming.beyond_share, forming.seen_share), (0.0, 1.0));
    }

    #[test]
    fn a_finished_plate_lacks_nothing_and_one_bent_too_far_is_beyond() {
        let done = BendingEnergy::new(&bent(0.1, whole()), &target(10.0), 0.006).unwrap();
        let flat = BendingEnergy::new(&bent(0.0, whole()), &target(10.0), 0.006).unwrap();
        assert!(done.energy < 1e-4 * flat.energy, "{done:?}");
        let beyond = BendingEnergy::new(&bent(0.12, whole()), &target(10.0), 0.006).unwrap();
        // A fifth too much: a twenty-fifth of the energy.
        assert!((beyond.energy / flat.energy - 0.04).abs() < 1e-3, "{beyond:?}");
        assert_eq!(beyond.beyond_share, 1.0);
        assert_eq!(
            BendingEnergy::new(&bent(0.103, whole()), &target(10.0), 0.006).unwrap().beyond_share,
            0.0
        );
    }

    #[test]
    fn unseen_parts_are_in_no_figure() {
        let half = BendingEnergy::new(&bent(0.0, Mask::unseen(W, H, 0.05)), &target(10.0), 0.006).unwrap();
        let whole = BendingEnergy::new(&bent(0.0, whole()), &target(10.0), 0.006).unwrap();
        assert!((half.seen_share - 0.5).abs() < 0.02, "{half:?}");
        assert!((half.energy / whole.energy - half.seen_share).abs() < 1e-6);
    }
}
