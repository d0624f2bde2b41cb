//! Boxes and capsules, of which the surroundings consist, with closed-form ray intersection.

use crate::bounds::Bounds;
use crate::ray::Ray;
use nalgebra::Isometry3;
use platen_sim_plate::Vec3;

/// Solid body.
#[derive(Debug, Clone, PartialEq)]
pub enum Solid {
    /// Box.
    Cuboid {
        /// Transform from the box's own frame (origin in its middle) to the scanner frame.
        pose: Isometry3<f64>,
        /// Half edge lengths, metres.
        half: Vec3,
    },
    /// Capsule: all points within `radius` of a segment; a ball when both ends agree.
    Capsule {
        /// Ends of the segment, metres.
        ends: [Vec3; 2],
        /// Radius, metres.
        radius: f64,
    },
}

impl Solid {
    /// Creates an upright box from its middle, edge lengths, and rotation about the vertical.
    pub fn upright(middle: Vec3, edges: Vec3, yaw: f64) -> Self {
        Self::Cuboid { pose: Isometry3::new(middle, Vec3::z() * yaw), half: edges / 2.0 }
    }

    pub(crate) fn bounds(&self) -> Bounds {
        match self {
            Self::Cuboid { pose, half } => {
                let corner = |k: usize| {
                    let sign = |bit: usize| if k >> bit & 1 == 1 { 1.0 } else { -1.0 };
                    let local = Vec3::new(sign(0), sign(1), sign(2)).component_mul(half);
                    pose.rotation * local + pose.translation.vector
                };
                Bounds::of((0..8).map(corner), 1e-9)
            }
            Self::Capsule { ends, radius } => Bounds::of(*ends, radius + 1e-9),
        }
    }

    /// Returns the range of the nearest hit from outside and the outward unit normal there.
    pub(crate) fn cast(&self, ray: &Ray) -> Option<(f64, Vec3)> {
        match self {
            Self::Cuboid { pose, half } => cuboid(ray, pose, half),
            Self::Capsule { ends, radius } => capsule(ray, ends, *radius),
        }
    }
}

fn cuboid(ray: &Ray, pose: &Isometry3<f64>, half: &Vec3) -> Option<(f64, Vec3)> {
    let origin = pose.rotation.inverse_transform_vector(&(ray.origin - pose.translation.vector));
    let direction = pose.rotation.inverse_transform_vector(&ray.direction);
    let (mut near, mut far, mut axis) = (0.0, f64::INFINITY, None);
    for k in 0..3 {
        let inverse = 1.0 / direction[k];
        let (a, b) = ((-half[k] - origin[k]) * inverse, (half[k] - origin[k]) * inverse);
        if a.min(b) > near {
            (near, axis) = (a.min(b), Some(k));
        }
        far = f64::min(far, a.max(b));
    }
    let axis = axis.filter(|_| near <= far)?;
    let mut normal = Vec3::zeros();
    normal[axis] = -direction[axis].signum();
    Some((near, pose.rotation * normal))
}

fn capsule(ray: &Ray, ends: &[Vec3; 2], radius: f64) -> Option<(f64, Vec3)> {
    let (start, along) = (ray.origin - ends[0], ends[1] - ends[0]);
    let length_squared = along.norm_squared();
    let mut nearest: Option<(f64, Vec3)> = None;
    let mut offer = |range: f64, normal: Vec3| {
        if range > 0.0 && nearest.is_none_or(|(best, _)| range < best) {
            nearest = Some((range, normal / radius));
        }
    };
    if length_squared > 0.0 {
        // Infinite cylinder: |start + t d|^2 without the component along the segment.
        let across = |v: Vec3| v - along * (v.dot(&along) / length_squared);
        let (s, d) = (across(start), across(ray.direction));
        if let Some(range) = first_root(d.norm_squared(), s.dot(&d), s.norm_squared() - radius * radius) {
            let place = (start + ray.direction * range).dot(&along) / length_squared;
            if (0.0..=1.0).contains(&place) {
                offer(range, s + d * range);
            }
        }
    }
    for end in ends {
        let s = ray.origin - end;
        if let Some(range) = first_root(1.0, s.dot(&ray.direction), s.norm_squared() - radius * radius) {
            offer(range, s + ray.direction * range);
        }
    }
    nearest
}

/// Returns the smaller root of a t^2 + 2 b t + c = 0.
fn first_root(a: f64, b: f64, c: f64) -> Option<f64> {
    let discriminant = b * b - a * c;
    (a > 0.0 && discriminant >= 0.0).then(|| (-b - discriminant.sqrt()) / a)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ray(origin: [f64; 3], towards: [f64; 3]) -> Ray {
        let origin = Vec3::from(origin);
        Ray { origin, direction: (Vec3::from(towards) - origin).normalize() }
    }

    #[test]
    fn box_is_hit_on_the_face_that_is_seen() {
        let solid = Solid::upright(Vec3::new(5.0, 0.0, 0.0), Vec3::new(2.0, 2.0, 2.0), 0.0);
        let (range, normal) = solid.cast(&ray([0.0; 3], [5.0, 0.0, 0.0])).unwrap();
        assert!((range - 4.0).abs() < 1e-15 && (normal + Vec3::x()).norm() < 1e-15);
        let turned =
            Solid::upright(Vec3::new(5.0, 0.0, 0.0), Vec3::new(2.0, 2.0, 2.0), 0.25 * std::f64::consts::PI);
        let (range, _) = turned.cast(&ray([0.0; 3], [5.0, 0.0, 0.0])).unwrap();
        assert!((range - (5.0 - 2_f64.sqrt())).abs() < 1e-14);
        assert!(solid.cast(&ray([0.0; 3], [5.0, 1.5, 0.0])).is_none());
        assert!(solid.cast(&ray([9.0, 0.0, 0.0], [12.0, 0.0, 0.0])).is_none());
    }

    #[test]
    fn capsule_is_a_cylinder_with_round_ends() {
        let solid =
            Solid::Capsule { ends: [Vec3::new(5.0, 0.0, -1.0), Vec3::new(5.0, 0.0, 1.0)], radius: 0.5 };
        let (range, normal) = solid.cast(&ray([0.0; 3], [5.0, 0.0, 0.0])).unwrap();
        assert!((range - 4.5).abs() < 1e-14 && (normal + Vec3::x()).norm() < 1e-14);
        let (range, normal) = solid.cast(&ray([5.0, 0.0, 4.0], [5.0, 0.0, 0.0])).unwrap();
        assert!((range - 2.5).abs() < 1e-14 && (normal - Vec3::z()).norm() < 1e-14);
        assert!(solid.cast(&ray([0.0, 0.0, 1.6], [5.0, 0.0, 1.6])).is_none());
    }
}
