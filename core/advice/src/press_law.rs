//! Depth law of a stroke: three-point bending of an elastic, perfectly plastic plate, with springback, in closed form.
//!
//! In: thickness, yield strength, die opening. Out: the depth of the ram for a bend angle, metres.
//!
//! With w the die opening, t the thickness, E' = E / (1 - nu^2) and s' = 2 s_y / sqrt 3 (plane strain), the yield
//! curvature is k_y = 2 s' / (E' t). Under the punch the moment is m yield moments, 1 <= m < 1.5; it falls linearly to
//! the shoulders. With r = sqrt(3 - 2 m):
//!
//! ```text
//! angle that stays   th(m) = (w k_y / m) [(1 - r) - (m^2 - 1) / 2]
//! sag that stays     s(m)  = (w^2 k_y / 4 m^2) [4/3 - 3 r / 2 + r^3 / 6 - (m^3 - 1) / 3]
//! springback         e(m)  = m k_y w^2 / 12
//! depth              f(th) = s + e;   beyond the plastic hinge  f(1.5) + (th - th(1.5)) w / 4
//! ```
//!
//! A stroke of depth h leaves the angle th with h = sag + f(th) + q + a th. The sag is that of the bends that already
//! lie in the die. The offset q (zero of the ram, thickness, frame, die, yield: all effects that are constant on a
//! plate) and the slope a (hardening, effective opening) are found by the [`Learner`](crate::learner::Learner). Since
//! the moment saturates, the springback hardly depends on the angle.

use platen_model::{Die, Steel};

/// Young's modulus of steel, pascals.
const YOUNG: f64 = 210e9;
/// Poisson's ratio of steel.
const POISSON: f64 = 0.3;
/// Moment of the plastic hinge, yield moments.
const HINGE: f64 = 1.5;

/// Three-point bending of one plate in one die.
#[derive(Debug, Clone, Copy)]
pub struct PressLaw {
    opening: f64,
    yield_curvature: f64,
}

impl PressLaw {
    /// Creates the law of a plate of this thickness, metres.
    #[must_use]
    pub fn new(die: &Die, steel: &Steel, thickness: f64) -> Self {
        let modulus = YOUNG / (1.0 - POISSON * POISSON);
        let plane_strain = 2.0 * steel.yield_strength / 3.0_f64.sqrt();
        Self { opening: die.opening, yield_curvature: 2.0 * plane_strain / (modulus * thickness) }
    }

    /// Returns the distance between the shoulders, metres.
    #[must_use]
    pub fn opening(&self) -> f64 {
        self.opening
    }

    /// Returns the change of depth with the angle beyond the plastic hinge, metres per radian.
    #[must_use]
    pub fn stiffness(&self) -> f64 {
        0.25 * self.opening
    }

    /// Returns the depth that leaves `angle` (radians, not negative) on a flat plate, metres; without offset and slope.
    #[must_use]
    pub fn depth(&self, angle: f64) -> f64 {
        let hinge = self.angle_at(HINGE);
        let m = if angle < hinge { self.moment(angle) } else { HINGE };
        self.sag_at(m) + self.springback_at(m) + (angle - hinge).max(0.0) * self.stiffness()
    }

    /// Returns the moment that leaves an angle below that of the hinge, yield moments, by bisection: the angle grows
    /// with the moment.
    fn moment(&self, angle: f64) -> f64 {
        let (mut low, mut high) = (1.0, HINGE);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if self.angle_at(middle) < angle { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    }

    fn angle_at(&self, m: f64) -> f64 {
        let r = (3.0 - 2.0 * m).max(0.0).sqrt();
        self.opening * self.yield_curvature / m * ((1.0 - r) - 0.5 * (m * m - 1.0))
    }

    fn sag_at(&self, m: f64) -> f64 {
        let r = (3.0 - 2.0 * m).max(0.0).sqrt();
        let shape = 4.0 / 3.0 - 1.5 * r + r.powi(3) / 6.0 - (m.powi(3) - 1.0) / 3.0;
        self.opening.powi(2) * self.yield_curvature / (4.0 * m * m) * shape
    }

    fn springback_at(&self, m: f64) -> f64 {
        m * self.yield_curvature * self.opening.powi(2) / 12.0
    }
}

/// Returns the sag under the punch of sharp bends, (distance from the punch, angle), in a die of this opening, metres.
#[must_use]
pub fn sag_of_bends(opening: f64, bends: impl IntoIterator<Item = (f64, f64)>) -> f64 {
    let arm = |distance: f64| (0.5 * opening - distance.abs()).max(0.0);
    bends.into_iter().map(|(distance, angle)| 0.5 * angle * arm(distance)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn law(opening: f64) -> PressLaw {
        let die = Die { id: 1, opening, edge: 0.2, punch_radius: None };
        let steel = Steel { grade: None, yield_strength: 440e6, heat: None };
        PressLaw::new(&die, &steel, 0.036)
    }

    #[test]
    fn the_hinge_of_a_known_plate() {
        let law = law(0.36);
        // 0.122 1/m, 11 mrad, 2.0 mm: figures of a plate of 36 mm and 440 MPa in a die of 360 mm.
        assert!((law.yield_curvature - 0.1223).abs() < 1e-4, "{}", law.yield_curvature);
        assert!((law.angle_at(HINGE) - 0.25 * 0.36 * law.yield_curvature).abs() < 1e-15);
        assert!((law.springback_at(HINGE) - 1.98e-3).abs() < 1e-5);
        assert!((super::PressLaw::springback_at(&self::law(0.6), HINGE) - 5.5e-3).abs() < 1e-5);
    }

    /// Integrates the curvature over half the die with the moment m (1 - 2 x / w): curvature k_y / sqrt(3 - 2 m) in the
    /// plastic part, less the elastic curvature of unloading.
    #[test]
    fn angle_and_sag_agree_with_numeric_integration() {
        let law = law(0.36);
        for m in [1.05, 1.2, 1.35, 1.45] {
            let n = 200_000;
            let dx = 0.5 * law.opening / f64::from(n);
            let (mut angle, mut sag) = (0.0, 0.0);
            for i in 0..n {
                let x = (f64::from(i) + 0.5) * dx;
                let local = m * (1.0 - 2.0 * x / law.opening);
                let left = if local > 1.0 { 1.0 / (3.0 - 2.0 * local).sqrt() - local } else { 0.0 };
                angle += 2.0 * left * law.yield_curvature * dx;
                sag += left * law.yield_curvature * (0.5 * law.opening - x) * dx;
            }
            assert!((angle / law.angle_at(m) - 1.0).abs() < 1e-6, "m {m}: {angle} {}", law.angle_at(m));
            assert!((sag / law.sag_at(m) - 1.0).abs() < 1e-6, "m {m}: {sag} {}", law.sag_at(m));
        }
    }

    #[test]
    fn depth_grows_with_the_angle_without_a_step_at_the_hinge() {
        let law = law(0.36);
        let hinge = law.angle_at(HINGE);
        assert!((law.depth(hinge * (1.0 + 1e-9)) - law.depth(hinge * (1.0 - 1e-9))).abs() < 1e-8);
        let depths: Vec<f64> = (0..100).map(|k| law.depth(f64::from(k) * 5e-4)).collect();
        assert!(depths.windows(2).all(|pair| pair[1] > pair[0]));
    }

    #[test]
    fn the_sag_of_a_bend_under_the_punch_is_half_its_angle_times_half_the_opening() {
        assert!((sag_of_bends(0.36, [(0.0, 0.03)]) - 0.5 * 0.03 * 0.18).abs() < 1e-15);
        assert_eq!(sag_of_bends(0.36, [(0.2, 0.03), (-0.18, 0.03)]), 0.0);
    }
}
