use super::*;

const T: f64 = 0.04;

fn target(shape: TargetShape, radius_of: RadiusOf, scanned_face: Facing) -> TargetSurface {
    TargetSurface::new(&Target { shape, radius_of, scanned_face }, 4.0, 2.5, T).expect("sound")
}

fn shapes() -> Vec<TargetShape> {
    let axis = 0.4;
    vec![
        TargetShape::Flat,
        TargetShape::Cylinder { radius: 6.0, axis },
        TargetShape::Cone { axis, radius_start: 5.0, radius_end: 6.5 },
        TargetShape::Cone { axis, radius_start: 6.5, radius_end: 5.0 },
        TargetShape::Sphere { radius: 9.0 },
        TargetShape::Torus { axis, radius: 5.0, cross_radius: 10.0 },
        TargetShape::Torus { axis, radius: 5.0, cross_radius: -10.0 },
    ]
}

/// Returns the normal curvature along a direction from points and normals alone: -(dn . dp) / |dp|^2.
fn curvature_by_differences(t: &TargetSurface, at: [f64; 2], direction: [f64; 2]) -> f64 {
    let h = 1e-4;
    let [from, to] = [-h, h].map(|s| [at[0] + s * direction[0], at[1] + s * direction[1]]);
    let step = t.point(to[0], to[1]) - t.point(from[0], from[1]);
    let turn = t.normal(to[0], to[1]) - t.normal(from[0], from[1]);
    -turn.dot(&step) / step.norm_squared()
}

#[test]
fn normals_and_curvatures_are_those_of_the_points() {
    for facing in [Facing::Inside, Facing::Outside] {
        for shape in shapes() {
            let t = target(shape, RadiusOf::Mid, facing);
            for at in [[2.0, 1.25], [0.3, 0.4], [3.8, 1.0], [1.0, 2.4]] {
                let h = 1e-5;
                let [u, v] = at;
                let along_u = (t.point(u + h, v) - t.point(u - h, v)) / (2.0 * h);
                let along_v = (t.point(u, v + h) - t.point(u, v - h)) / (2.0 * h);
                let normal = along_u.cross(&along_v).normalize();
                assert!((normal - t.normal(u, v)).norm() < 1e-8, "{shape:?} {facing:?} {at:?}");
                let k = t.curvature(u, v);
                // A torus and a sphere stretch their lines, which turns directions by hundredths.
                let bound = if matches!(shape, TargetShape::Torus { .. }) { 6e-3 } else { 1e-6 };
                for direction in [[1.0, 0.0], [0.0, 1.0], [0.6, 0.8]] {
                    let found = curvature_by_differences(&t, at, direction);
                    assert!(
                        (k.along(direction) - found).abs() < bound,
                        "{shape:?} {direction:?} {found} {k:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn developable_targets_keep_lengths() {
    for shape in &shapes()[..4] {
        let t = target(*shape, RadiusOf::Mid, Facing::Outside);
        for at in [[2.0, 1.25], [0.3, 0.4], [3.8, 2.2]] {
            for direction in [[1.0, 0.0], [0.0, 1.0], [0.6, 0.8]] {
                let h = 1e-5;
                let [p, q] = [-h, h].map(|s| t.point(at[0] + s * direction[0], at[1] + s * direction[1]));
                assert!(((q - p).norm() / (2.0 * h) - 1.0).abs() < 1e-8, "{shape:?}");
            }
        }
    }
}

#[test]
fn the_radius_is_that_of_the_surface_named() {
    let sphere = TargetShape::Sphere { radius: 8.0 };
    for (radius_of, facing, face_radius) in [
        (RadiusOf::Inside, Facing::Inside, 8.0),
        (RadiusOf::Inside, Facing::Outside, 8.0 + T),
        (RadiusOf::Mid, Facing::Inside, 8.0 - T / 2.0),
        (RadiusOf::Outside, Facing::Outside, 8.0),
        (RadiusOf::Outside, Facing::Inside, 8.0 - T),
    ] {
        let t = target(sphere, radius_of, facing);
        let side = t.side();
        let mid_radius = face_radius + side * T / 2.0;
        let centre = Vec3::z() * (side * mid_radius);
        for (u, v) in [(0.0, 0.0), (2.0, 1.25), (3.9, 0.7)] {
            let distance = (t.face(u, v) - centre).norm();
            assert!((distance - face_radius).abs() < 1e-12, "{radius_of:?} {facing:?} {distance}");
        }
    }
}

#[test]
fn a_cones_radii_are_those_at_the_ends_of_its_middle_line() {
    let shape = TargetShape::Cone { axis: 0.0, radius_start: 5.0, radius_end: 6.5 };
    let t = target(shape, RadiusOf::Mid, Facing::Inside);
    for (u, radius) in [(0.0, 5.0), (2.0, 5.75), (4.0, 6.5)] {
        assert!((t.curvature(u, 1.25).max - 1.0 / radius).abs() < 1e-9);
        assert!(t.curvature(u, 1.25).min.abs() < 1e-12);
    }
}

#[test]
fn the_direction_of_bending_is_across_the_straight_lines() {
    let axis = 0.4_f64;
    for facing in [Facing::Inside, Facing::Outside] {
        let t = target(TargetShape::Cylinder { radius: 6.0, axis }, RadiusOf::Mid, facing);
        let [u, v] = t.bending(1.0, 1.0).expect("a cylinder has one");
        assert!((u * axis.cos() + v * axis.sin()).abs() < 1e-9);
    }
    assert_eq!(
        target(TargetShape::Sphere { radius: 6.0 }, RadiusOf::Mid, Facing::Inside).bending(1.0, 1.0),
        None
    );
}

#[test]
fn impossible_targets_are_refused_in_one_sentence() {
    let says = |shape| {
        let target = Target { shape, radius_of: RadiusOf::Inside, scanned_face: Facing::Inside };
        TargetSurface::new(&target, 4.0, 2.5, T).expect_err("refused").to_string()
    };
    assert_eq!(
        says(TargetShape::Sphere { radius: -3.0 }),
        "target: a radius of -3000 mm is no radius; give one above 0"
    );
    assert!(says(TargetShape::Sphere { radius: f64::NAN }).contains("no radius"));
    assert!(says(TargetShape::Torus { axis: 0.0, radius: 5.0, cross_radius: 0.0 }).contains("no radius"));
    assert!(
        says(TargetShape::Cylinder { radius: 0.3, axis: 0.0 }).contains("rolls the plate's side of 2500 mm")
    );
    let flat = TargetShape::Cone { axis: 0.0, radius_start: 2.0, radius_end: 82.0 };
    assert!(says(flat).contains("changes by 80000 mm along a straight line of 4000 mm"));
}
