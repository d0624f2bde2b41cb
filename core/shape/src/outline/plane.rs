//! Mean plane of the plate: projection of points to it and heights over it, metres.

use nalgebra::Vector2;

use crate::Vec3;

/// A plane with an origin and two orthonormal axes.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Plane {
    origin: Vec3,
    axes: [Vec3; 2],
}

impl Plane {
    /// Builds the plane through `origin` across `normal`. Seen against `normal`, the axes are counter-clockwise.
    pub(crate) fn new(origin: Vec3, normal: Vec3) -> Self {
        let along = if normal.z.abs() < 0.9 { Vec3::z() } else { Vec3::x() };
        let first = along.cross(&normal).normalize();
        Self { origin, axes: [first, normal.normalize().cross(&first)] }
    }

    /// Returns the same plane with its first axis along `direction`.
    pub(crate) fn along(&self, direction: Vector2<f64>) -> Self {
        let first = self.lift_direction(direction).normalize();
        Self { origin: self.origin, axes: [first, self.normal().cross(&first)] }
    }

    /// Returns the unit normal towards the scanner.
    pub(crate) fn normal(&self) -> Vec3 {
        self.axes[0].cross(&self.axes[1])
    }

    /// Returns the height of a point over the plane.
    pub(crate) fn height(&self, point: Vec3) -> f64 {
        self.normal().dot(&(point - self.origin))
    }

    pub(crate) fn project(&self, point: Vec3) -> Vector2<f64> {
        self.direction(point - self.origin)
    }

    pub(crate) fn direction(&self, vector: Vec3) -> Vector2<f64> {
        Vector2::new(self.axes[0].dot(&vector), self.axes[1].dot(&vector))
    }

    pub(crate) fn lift_direction(&self, vector: Vector2<f64>) -> Vec3 {
        self.axes[0] * vector.x + self.axes[1] * vector.y
    }
}
