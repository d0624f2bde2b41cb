//! Corner assignment after the first scan of a plate: the direction of u is continued from the previous scan.

use nalgebra::Rotation3;
use platen_shape::{Surface, Vec3};

/// Pose of the plate at its previous scan.
#[derive(Debug, Clone, Copy)]
pub struct PreviousPose<'a> {
    /// Surface at that scan, scanner frame.
    pub surface: &'a Surface,
    /// Rotation of the plate since then as reported by the press, radians about the press's z axis.
    pub fed_by: Option<f64>,
}

impl PreviousPose<'_> {
    /// Returns the expected direction of growing u, scanner frame: the previous one, rotated about the press's z axis.
    pub(super) fn u_axis(&self, press_z: Vec3) -> Vec3 {
        let (width, middle) = (self.surface.width(), 0.5 * self.surface.height());
        let along_u = self.surface.point(width, middle) - self.surface.point(0.0, middle);
        Rotation3::new(press_z * self.fed_by.unwrap_or(0.0)) * along_u
    }
}

#[cfg(test)]
mod tests {
    use platen_shape::surface::{Mask, SplineFit, UniformKnots};

    use super::*;

    #[test]
    fn u_goes_on_from_the_last_scan_and_turns_with_the_press() {
        // Rounding limit, radians, from a spline's normal equations: points without noise lead to more smoothing, which
        // makes the equations stiffer.
        const ROUNDING: f64 = 1e-7;
        let mut fit = SplineFit::new(UniformKnots::new(0.0, 2.0, 4), UniformKnots::new(0.0, 1.0, 4));
        for i in 0..400 {
            let (u, v) = (0.1 * (f64::from(i % 20) + 0.5), 0.05 * (f64::from(i / 20) + 0.5));
            fit.add(u, v, [5.0 + u, v, -3.0], 1e6);
        }
        let mask = Mask::unseen(2.0, 1.0, 1.0);
        let surface = Surface::new(fit.solve([0.0, 0.0, 1.0]).unwrap(), 0.04, mask);
        let u_axis = |fed_by, press_z| PreviousPose { surface: &surface, fed_by }.u_axis(press_z).normalize();
        assert!((u_axis(None, Vec3::z()) - Vec3::x()).norm() < ROUNDING);
        let quarter = Some(std::f64::consts::FRAC_PI_2);
        assert!((u_axis(quarter, Vec3::z()) - Vec3::y()).norm() < ROUNDING);
        // A scanner that hangs upside down sees the press turn the other way.
        assert!((u_axis(quarter, -Vec3::z()) + Vec3::y()).norm() < ROUNDING);
    }
}
