//! Tests of rays against exact geometry: every ray hits its target, at the right range.
#![expect(clippy::unwrap_used, reason = "a test that fails to build its plate must fail")]

use platen_sim_plate::{Band, Plate, PlateState, Pose, Shape, Side, Vec3};
use platen_sim_scanner::{Label, Ray, Scene, SimLattice, Solid, Surroundings};

fn plate(shape: Shape) -> Plate {
    let mut state = PlateState::flat(3000.0, 2500.0, 36.0);
    state.shape = shape;
    state.pose = Pose { centre_mm: [6000.0, 300.0, -3600.0], yaw_deg: 33.0, pitch_deg: 1.0, roll_deg: -0.7 };
    Plate::new(&state).unwrap()
}

/// Returns the plate with edges bevelled by 30 degrees on both faces, and a root face.
fn bevelled(shape: Shape) -> Plate {
    let mut state = PlateState::flat(3000.0, 2500.0, 36.0);
    (state.blank.face_inset_mm, state.blank.root_face_mm) = (9.24, 4.0);
    state.shape = shape;
    state.pose = Pose { centre_mm: [5000.0, 300.0, -3600.0], yaw_deg: 33.0, pitch_deg: 1.0, roll_deg: -0.7 };
    Plate::new(&state).unwrap()
}

fn shapes() -> Vec<Shape> {
    let band = |at_mm, angle_deg| Band { at_mm, width_mm: 250.0, angle_deg };
    vec![
        Shape::Flat,
        Shape::Cylinder { radius_mm: 4000.0, axis_deg: 110.0 },
        Shape::Cylinder { radius_mm: -2500.0, axis_deg: 30.0 },
        Shape::Cone { axis_deg: 20.0, radius_start_mm: 4000.0, radius_end_mm: 9000.0 },
        Shape::Sphere { radius_mm: 6000.0 },
        Shape::Torus { axis_deg: 0.0, radius_mm: 9000.0, cross_radius_mm: -7000.0 },
        Shape::Bands {
            axis_deg: 90.0,
            bands: vec![band(-700.0, 8.0), band(400.0, -5.0)],
            cross_bands: Vec::new(),
        },
    ]
}

fn towards(point: Vec3) -> Ray {
    Ray { origin: Vec3::zeros(), direction: point.normalize() }
}

/// Returns the height of a label's face above the mid-surface; sides have none.
fn height(plate: &Plate, label: Label) -> Option<f64> {
    match label {
        Label::PlateTop => Some(plate.thickness() / 2.0),
        Label::PlateUnderside => Some(-plate.thickness() / 2.0),
        _ => None,
    }
}

#[test]
fn every_hit_lies_on_its_face_and_on_its_ray() {
    for shape in shapes() {
        let plate = plate(shape.clone());
        let scene = Scene::of(Some(plate.clone()), Vec::new());
        let lattice = SimLattice::around(&plate.corners(), 0.1, 0.004);
        let mut counts = [0; 2];
        for k in 0..lattice.n_cells() as u32 {
            let (azimuth, elevation) =
                (lattice.azimuth(k / lattice.n_rows), lattice.elevation(k % lattice.n_rows));
            let flat = elevation.cos();
            let ray = towards(Vec3::new(flat * azimuth.cos(), flat * azimuth.sin(), elevation.sin()));
            let Some(hit) = scene.cast(&ray, 100.0) else { continue };
            let [u, v] = hit.uv.unwrap();
            assert!(
                (-1e-8..=plate.width() + 1e-8).contains(&u) && (-1e-8..=plate.height() + 1e-8).contains(&v)
            );
            let off = match height(&plate, hit.label) {
                Some(h) => (plate.jet(u, v, h).point - ray.at(hit.range)).norm(),
                // On a side the height of the material point is unknown.
                None => (ray.at(hit.range) - plate.mid(u, v)).cross(&plate.normal(u, v)).norm(),
            };
            assert!(off < 1e-9, "{shape:?} {:?} at {u} {v}: {off:e} m", hit.label);
            counts[usize::from(hit.label == Label::PlateSide)] += 1;
        }
        assert!(counts[0] > 3000 && counts[1] > 0, "{shape:?}: {counts:?}");
    }
}

#[test]
fn material_points_in_view_are_found_again() {
    for shape in shapes() {
        let plate = plate(shape.clone());
        let scene = Scene::of(Some(plate.clone()), Vec::new());
        for i in 0..60 {
            for j in 0..60 {
                let (u, v) = (
                    plate.width() * (f64::from(i) + 0.5) / 60.0,
                    plate.height() * (f64::from(j) + 0.5) / 60.0,
                );
                let target = plate.top(u, v);
                let facing = plate.normal(u, v).dot(&-target.normalize());
                let Some(hit) = scene.cast(&towards(target), 100.0) else {
                    panic!("{shape:?} at {u} {v}: nothing, facing {facing}")
                };
                if hit.range < target.norm() - 1e-6 {
                    continue; // hidden by another part of the plate
                }
                assert!(facing > 0.0 && hit.label == Label::PlateTop, "{shape:?} at {u} {v}: {hit:?}");
                let off = (hit.range - target.norm()).abs().max((hit.cos_incidence - facing).abs());
                assert!(off < 1e-9, "{shape:?} at {u} {v}: {off:e}, {hit:?} {facing}");
                let [found_u, found_v] = hit.uv.unwrap();
                assert!((found_u - u).hypot(found_v - v) < 1e-8);
            }
        }
    }
}

#[test]
fn no_ray_slips_between_the_faces() {
    let plate = plate(Shape::Cylinder { radius_mm: 4000.0, axis_deg: 110.0 });
    let scene = Scene::of(Some(plate.clone()), Vec::new());
    // Rays at edges and corners: a nanometre inside they must hit the plate.
    for side in Side::ALL {
        for i in 0..=200 {
            let [u, v] = plate.side_uv(side, f64::from(i) / 200.0);
            let inside = |x: f64, size: f64| x.clamp(1e-9, size - 1e-9);
            let target = plate.top(inside(u, plate.width()), inside(v, plate.height()));
            assert!(scene.cast(&towards(target), 100.0).is_some(), "{side:?} {i}");
        }
    }
}

#[test]
fn flanks_of_a_bevel_lie_at_their_angle_and_close_the_plate() {
    for shape in shapes() {
        let plate = bevelled(shape.clone());
        let scene = Scene::of(Some(plate.clone()), Vec::new());
        let (w, h) = (plate.width(), plate.height());
        // Over the edges and corners, across the strip in which flanks and root face are visible.
        let mut strips = [0; 3];
        for side in Side::ALL {
            for i in 0..=300 {
                let [u, v] = plate.side_uv(side, f64::from(i) / 300.0);
                for k in -20..=20 {
                    let off = 0.002 * f64::from(k);
                    let [du, dv] =
                        [[0.0, off], [off, 0.0]][usize::from(matches!(side, Side::Left | Side::Right))];
                    let ray = towards(plate.top(u + du, v + dv));
                    let from_edge = (u + du).min(w - u - du).min(v + dv).min(h - v - dv);
                    // A ray along the face's horizon may pass.
                    let facing = plate.normal(u + du, v + dv).dot(&-ray.direction).abs() > 1e-3;
                    let inside = facing && from_edge > plate.face_inset() + 1e-3;
                    let Some(hit) = scene.cast(&ray, 100.0) else {
                        assert!(!inside, "{shape:?} {side:?} {i} {k}: no hit");
                        continue;
                    };
                    let [u, v] = hit.uv.unwrap();
                    let height = (ray.at(hit.range) - plate.mid(u, v)).dot(&plate.normal(u, v));
                    let from_edge = u.min(w - u).min(v).min(h - v);
                    match hit.label {
                        Label::PlateTop => assert!(from_edge > plate.face_inset() - 1e-8, "{from_edge}"),
                        Label::PlateSide => {
                            let expected = (height.abs() - 0.002).max(0.0) * (9.24 / 16.0);
                            assert!(
                                (from_edge - expected).abs() < 1e-8,
                                "{shape:?} {side:?}: {from_edge} {expected}"
                            );
                            strips[usize::from(height > 0.002) + 2 * usize::from(height < -0.002)] += 1;
                        }
                        _ => {}
                    }
                }
            }
        }
        assert!(strips[0] > 50 && strips[1] > 500, "{shape:?}: {strips:?}");
    }
}

#[test]
fn the_nearest_thing_wins() {
    let plate = plate(Shape::Flat);
    let target = plate.top(1.0, 1.0);
    let ball = Solid::Capsule { ends: [target * 0.5; 2], radius: 0.2 };
    let scene = Scene::of(Some(plate.clone()), vec![(Label::Person, ball)]);
    let hit = scene.cast(&towards(target), 100.0).unwrap();
    assert_eq!(hit.label, Label::Person);
    assert!((hit.range - (target.norm() / 2.0 - 0.2)).abs() < 1e-12);
    assert!(!scene.sees(target) && scene.sees(plate.top(2.9, 0.1)));
    assert!(scene.cast(&towards(target), 1.0).is_none());
}

#[test]
fn the_shop_shows_all_it_has_and_hides_what_it_should() {
    let share_seen = |around: Surroundings| {
        let plate = plate(Shape::Cylinder { radius_mm: 7000.0, axis_deg: 90.0 });
        let scene = Scene::new(Some(plate.clone()), &around);
        let seen = (0..400).filter(|k| {
            let (u, v) = (f64::from(k % 20) + 0.5, f64::from(k / 20) + 0.5);
            scene.sees(plate.top(u * plate.width() / 20.0, v * plate.height() / 20.0))
        });
        seen.count() as f64 / 400.0
    };
    assert_eq!(share_seen(Surroundings::default()), 1.0);
    let hidden = Surroundings { person_in_front: true, chain: true, ..Surroundings::default() };
    let share = share_seen(hidden);
    assert!((0.8..0.99).contains(&share), "{share}");
}

#[test]
fn a_person_hides_the_nearest_corner() {
    let plate = plate(Shape::Flat);
    let (far_u, far_v) = (plate.width() - 0.02, plate.height() - 0.02);
    let mut corners =
        [(0.02, 0.02), (far_u, 0.02), (far_u, far_v), (0.02, far_v)].map(|(u, v)| plate.top(u, v));
    corners.sort_by(|a, b| a.norm().total_cmp(&b.norm()));
    let seen = |person_at_corner| {
        let around = Surroundings { person_at_corner, ..Surroundings::default() };
        let scene = Scene::new(Some(plate.clone()), &around);
        corners.map(|corner| scene.sees(corner))
    };
    assert_eq!(seen(false), [true; 4]);
    // The farthest one may lie behind the person's head.
    assert_eq!(seen(true)[..3], [false, true, true]);
}

#[test]
fn a_strip_of_the_table_shows_beyond_the_far_edges() {
    let (plate, strip) = (plate(Shape::Flat), 1e-3);
    let narrow = Surroundings { strip: Some(strip), ..Surroundings::default() };
    let scene = Scene::new(Some(plate.clone()), &narrow);
    let (corners, centre) = (plate.corners(), plate.scanner_from_plate().translation.vector);
    let middles = [0, 1, 2, 3].map(|edge| 0.5 * (corners[edge] + corners[(edge + 1) % 4]));
    let far: Vec<Vec3> = middles.into_iter().filter(|middle| middle.norm() > centre.norm()).collect();
    assert_eq!(far.len(), 2);
    for middle in far {
        let raised = |angle: f64| {
            let across = middle.xy().norm();
            let elevation = middle.z.atan2(across) + angle;
            let beam = Vec3::new(middle.x, middle.y, across * elevation.tan());
            scene.cast(&towards(beam), 100.0).unwrap().label
        };
        // The plate leans by a degree: its edges are not level.
        assert_eq!([raised(-0.3 * strip), raised(0.3 * strip)], [Label::PlateTop, Label::Table]);
        assert_ne!(raised(1.5 * strip), Label::Table);
    }
}
