//! Tests of every shape against closed forms: metric, normals, curvature, thickness.

use platen_sim_plate::{Band, CurvatureStep, Plate, PlateState, Pose, Shape, Side, Vec3};

fn state(shape: Shape) -> PlateState {
    let mut state = PlateState::flat(3000.0, 2500.0, 36.0);
    state.shape = shape;
    state.pose = Pose { centre_mm: [6000.0, 300.0, -3600.0], yaw_deg: 33.0, pitch_deg: 1.0, roll_deg: -0.7 };
    state
}

fn band(at_mm: f64, angle_deg: f64) -> Band {
    Band { at_mm, width_mm: 400.0, angle_deg }
}

fn developable() -> Vec<Shape> {
    let steps = vec![CurvatureStep { at_mm: 100.0, width_mm: 300.0, change_per_m: -1.0 / 6.0 }];
    let bands = vec![band(-800.0, 1.5), band(100.0, 2.0), band(700.0, -0.5)];
    vec![
        Shape::Flat,
        Shape::Cylinder { radius_mm: 5000.0, axis_deg: 110.0 },
        Shape::Cylinder { radius_mm: -7000.0, axis_deg: 0.0 },
        Shape::Cone { axis_deg: 20.0, radius_start_mm: 5000.0, radius_end_mm: 9000.0 },
        Shape::Cone { axis_deg: 20.0, radius_start_mm: 9000.0, radius_end_mm: 5000.0 },
        Shape::Cone { axis_deg: -75.0, radius_start_mm: -5000.0, radius_end_mm: -9000.0 },
        Shape::Steps { axis_deg: 90.0, curvature_per_m: 1.0 / 6.0, steps },
        Shape::Bands { axis_deg: 75.0, bands, cross_bands: Vec::new() },
    ]
}

fn doubly_curved() -> Vec<Shape> {
    vec![
        Shape::Sphere { radius_mm: 8000.0 },
        Shape::Torus { axis_deg: 30.0, radius_mm: 9000.0, cross_radius_mm: -12000.0 },
        Shape::Bands { axis_deg: 90.0, bands: vec![band(-500.0, 2.0)], cross_bands: vec![band(300.0, 1.5)] },
    ]
}

fn all() -> Vec<Shape> {
    developable().into_iter().chain(doubly_curved()).collect()
}

/// Returns material points all over the plate, away from its edges.
fn points(plate: &Plate) -> impl Iterator<Item = (f64, f64)> {
    let (width, height) = (plate.width(), plate.height());
    (0..7).flat_map(move |i| {
        (0..7).map(move |j| (width * (f64::from(i) + 0.4) / 7.0, height * (f64::from(j) + 0.3) / 7.0))
    })
}

/// Returns central differences of `f` with a step that balances truncation and rounding.
fn differences(f: impl Fn(f64, f64) -> Vec3, u: f64, v: f64) -> [Vec3; 2] {
    let h = 2e-4;
    let fourth =
        |at: &dyn Fn(f64) -> Vec3| ((at(h) - at(-h)) * 8.0 - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h);
    [fourth(&|d| f(u + d, v)), fourth(&|d| f(u, v + d))]
}

#[test]
fn developable_plates_are_isometric_on_the_mid_surface() {
    for shape in developable() {
        let plate = Plate::new(&state(shape.clone())).unwrap();
        for (u, v) in points(&plate) {
            let [du, dv] = differences(|u, v| plate.mid(u, v), u, v);
            for found in [du.norm_squared() - 1.0, dv.norm_squared() - 1.0, du.dot(&dv)] {
                assert!(found.abs() < 1e-10, "{shape:?} at {u} {v}: metric off by {found:e}");
            }
        }
    }
}

#[test]
fn analytic_derivatives_agree_with_differences() {
    for shape in all() {
        let plate = Plate::new(&state(shape.clone())).unwrap();
        for (u, v) in points(&plate) {
            let jet = plate.jet(u, v, 0.01);
            let [du, dv] = differences(|u, v| plate.jet(u, v, 0.01).point, u, v);
            let [nu, nv] = differences(|u, v| plate.normal(u, v), u, v);
            assert!((jet.du - du).norm() < 1e-9 && (jet.dv - dv).norm() < 1e-9, "{shape:?} tangents");
            assert!((jet.normal - du.cross(&dv).normalize()).norm() < 1e-9, "{shape:?} normal");
            let off = (jet.normal_du - nu).norm().max((jet.normal_dv - nv).norm());
            assert!(off < 1e-9, "{shape:?} normal slopes: {off:e}");
        }
    }
}

#[test]
fn faces_lie_half_a_thickness_from_the_mid_surface_and_meet_the_sides() {
    for shape in all() {
        let plate = Plate::new(&state(shape)).unwrap();
        for (u, v) in points(&plate) {
            let through = plate.top(u, v) - plate.underside(u, v);
            assert!((through.norm() - 0.036).abs() < 1e-13);
            assert!((through / 0.036 - plate.normal(u, v)).norm() < 1e-12);
        }
        let corners = plate.corners();
        for (k, side) in Side::ALL.into_iter().enumerate() {
            for (along, corner) in [(0.0, k), (1.0, (k + 1) % 4)] {
                // The sides v = height and u = 0 run against the outline.
                let corner = if k < 2 { corner } else { (2 * k + 1 - corner) % 4 };
                let [u, v] = plate.side_uv(side, along);
                assert!((plate.top(u, v) - corners[corner]).norm() < 1e-14, "{side:?} {along}");
            }
        }
    }
}

#[test]
fn curvatures_are_those_of_the_shape() {
    let check = |shape: Shape, u: f64, v: f64, expected: [f64; 2]| {
        let curvature = Plate::new(&state(shape.clone())).unwrap().curvature(u, v, 0.0);
        let [a, b] = expected;
        assert!((curvature.mean - (a + b) / 2.0).abs() < 1e-10, "{shape:?}: {curvature:?}");
        assert!((curvature.gauss - a * b).abs() < 1e-10, "{shape:?}: {curvature:?}");
    };
    check(Shape::Cylinder { radius_mm: 5000.0, axis_deg: 110.0 }, 0.3, 2.0, [0.2, 0.0]);
    check(Shape::Sphere { radius_mm: -8000.0 }, 0.1, 2.4, [-0.125, -0.125]);
    // A torus has its nominal radii on the middle lines.
    let torus = Shape::Torus { axis_deg: 0.0, radius_mm: 10_000.0, cross_radius_mm: 5000.0 };
    check(torus, 1.5, 1.25, [0.1, 0.2]);
    // The radius of a cone grows evenly along the middle generator (here: along u, 3 m).
    let cone = Shape::Cone { axis_deg: 0.0, radius_start_mm: 5000.0, radius_end_mm: 8000.0 };
    check(cone.clone(), 0.0, 1.25, [0.2, 0.0]);
    check(cone.clone(), 3.0, 1.25, [0.125, 0.0]);
    check(cone, 1.0, 1.25, [1.0 / 6.0, 0.0]);
}

#[test]
fn oblique_cylinder_has_the_twist_of_its_axis() {
    let plate = Plate::new(&state(Shape::Cylinder { radius_mm: 9000.0, axis_deg: 110.0 })).unwrap();
    let curvature = plate.curvature(0.7, 0.9, 0.0);
    let (sin, cos) = 20_f64.to_radians().sin_cos();
    assert!((curvature.kappa_u - cos * cos / 9.0).abs() < 1e-12);
    assert!((curvature.kappa_v - sin * sin / 9.0).abs() < 1e-12);
    assert!((curvature.kappa_uv - sin * cos / 9.0).abs() < 1e-12);
    let face = plate.curvature(0.7, 0.9, 0.018);
    assert!((2.0 * face.mean - 1.0 / (9.0 - 0.018)).abs() < 1e-12);
}

#[test]
fn sphere_points_lie_on_the_sphere_and_strain_is_small() {
    let state = PlateState {
        pose: Pose { centre_mm: [0.0; 3], yaw_deg: 0.0, pitch_deg: 0.0, roll_deg: 0.0 },
        ..state(Shape::Sphere { radius_mm: 11_000.0 })
    };
    let plate = Plate::new(&state).unwrap();
    let centre = Vec3::new(0.0, 0.0, 11.0);
    let mut worst: f64 = 0.0;
    for (u, v) in points(&plate) {
        assert!(((plate.mid(u, v) - centre).norm() - 11.0).abs() < 1e-12);
        let jet = plate.jet(u, v, 0.0);
        worst = worst.max((jet.du.norm() - 1.0).abs()).max((jet.dv.norm() - 1.0).abs());
    }
    // Gauss: an isometric map is impossible; a good one spreads K L^2 / 24, here 3 parts in 1000 at the edges.
    assert!((1e-4..4e-3).contains(&worst), "{worst}");
}

#[test]
fn impossible_descriptions_are_refused_by_key() {
    let refused = |shape: Shape| Plate::new(&state(shape)).unwrap_err().to_string();
    assert!(refused(Shape::Sphere { radius_mm: 0.0 }).starts_with("plate.radius_mm: 0 is not allowed"));
    let cone = |radius_start_mm, radius_end_mm| Shape::Cone { axis_deg: 0.0, radius_start_mm, radius_end_mm };
    assert!(refused(cone(5000.0, -5000.0)).contains("same sign"));
    assert!(refused(cone(5000.0, 5000.0)).contains("cylinder"));
    assert!(refused(cone(500.0, 5000.0)).contains("apex"));
    let mut thin = PlateState::flat(3000.0, 2500.0, f64::NAN);
    assert!(Plate::new(&thin).unwrap_err().to_string().contains("thickness_mm"));
    thin.blank.thickness_mm = 30.0;
    thin.pose.yaw_deg = f64::INFINITY;
    assert!(Plate::new(&thin).unwrap_err().to_string().contains("pose"));
}
