//! Whole measurements of exact plates, with noise, against their closed forms.

use super::Measurement;
use super::scene::{Errors, Scene};
use crate::Vec3;
use crate::evaluate::{Place, grid, reference_line};
use crate::flatten::closed_form::{cone, cylinder, half_bent, sphere_of_fibres};

fn errors(name: &str, scene: &Scene) -> Errors {
    let errors = Errors::of(&scene.measure(), scene);
    println!("{name}: {errors:?}");
    errors
}

/// Checks the errors against bounds of about twice the figures found: markers, normal distance inside and near an edge
/// (mm), curvature (1/m). Markers move with the edges, whose noise is that of a few hundred crossings; curvature errors
/// are due to the smoothing of bends.
fn check(name: &str, scene: &Scene, [markers, inside, edge, curvature]: [f64; 4]) {
    let e = errors(name, scene);
    assert!(
        e.markers < markers && e.inside < inside && e.edge < edge && e.curvature < curvature,
        "{name}: {e:?}"
    );
}

#[test]
fn plates_of_constant_curvature_are_met() {
    check("cylinder", &Scene::new(cylinder(9.0, 1.2), [3.0, 2.5]), [0.2, 0.0045, 0.008, 7e-5]);
    check("convex", &Scene::new(cylinder(-5.0, 0.3), [4.0, 2.5]), [0.18, 0.0065, 0.014, 2.5e-4]);
    check("cone", &Scene::new(cone([-7.0, 1.0], 0.6), [3.0, 2.0]), [0.18, 0.0075, 0.0165, 2.6e-4]);
    // The harmonic map is wrong on a sphere: the markers are displaced within the surface, but the surface is correct.
    let sphere = sphere_of_fibres(11.0, [3.0, 2.5]);
    check("sphere", &Scene::new(sphere, [3.0, 2.5]), [0.8, 0.0066, 0.0115, 1.9e-4]);
}

#[test]
fn at_four_times_the_noise_too() {
    let noisy = |mid: Scene| Scene { sigma: 2e-3, ..mid };
    check("cylinder", &noisy(Scene::new(cylinder(9.0, 1.2), [3.0, 2.5])), [0.6, 0.015, 0.025, 1.2e-4]);
    check("cone", &noisy(Scene::new(cone([-7.0, 1.0], 0.6), [3.0, 2.0])), [0.6, 0.023, 0.041, 5.2e-4]);
}

#[test]
fn a_half_bent_thick_plate_keeps_its_material_points() {
    let scene = Scene { thickness: 0.04, ..Scene::new(half_bent(5.0, 2.5), [5.0, 2.5]) };
    check("half bent", &scene, [0.2, 0.013, 0.0205, 3.8e-3]);
}

#[test]
fn a_plate_bent_along_the_line_of_sight_is_met() {
    // R 5 m, concave, over 4.5 m: its near end rises into the line of sight.
    let middle = Vec3::new(5.0, 0.0, -2.4);
    let bent = cylinder(5.0, std::f64::consts::FRAC_PI_2);
    let scene = Scene { yaw: 0.0, middle, ..Scene::new(bent, [4.5, 2.5]) };
    let placed = scene.placed();
    let incidence =
        (-placed.face(0.05, 1.25).normalize()).dot(&placed.mid_derivatives(0.05, 1.25).normal()).acos();
    assert!((80.0..84.0).contains(&incidence.to_degrees()), "{}", incidence.to_degrees());
    check("along sight", &scene, [0.13, 0.0066, 0.014, 4.2e-4]);
}

#[test]
fn wild_samples_move_nothing() {
    let scene = Scene { wild: 0.02, ..Scene::new(cylinder(7.0, 0.4), [3.0, 2.5]) };
    check("wild", &scene, [0.2, 0.006, 0.01, 1.3e-4]);
}

#[test]
fn holes_are_bridged_and_marked() {
    let hole = [[1.0, 0.8], [1.5, 1.2]];
    let scene = Scene { hidden: Some(hole), ..Scene::new(cylinder(7.0, 0.4), [3.0, 2.5]) };
    let measured = scene.measure();
    let e = Errors::of(&measured, &scene);
    println!("hole: {e:?}");
    assert!(e.markers < 0.2 && e.inside < 0.006 && e.edge < 0.01, "{e:?}");
    let mask = measured.surface.mask();
    assert!(!mask.seen(1.25, 1.0) && !mask.seen(1.05, 1.15) && mask.seen(0.9, 1.0) && mask.seen(1.25, 1.3));
    let hidden = 0.5 * 0.4 / (3.0 * 2.5);
    assert!((measured.quality.coverage - (1.0 - hidden)).abs() < 0.005, "{:?}", measured.quality);
    // In the hole the surface is interpolated, with a larger stated uncertainty.
    let (surface, placed) = (&measured.surface, scene.placed());
    let off = (surface.face(1.25, 1.0) - placed.face(1.25, 1.0)).norm();
    assert!(off < 0.3e-3, "{off}");
    assert!(surface.sigma_point(1.25, 1.0) > 1.2 * surface.sigma_point(2.2, 1.0));
}

#[test]
fn an_edge_behind_a_person_is_bridged() {
    let scene =
        Scene { hidden: Some([[1.2, -1.0], [1.7, 0.5]]), ..Scene::new(cylinder(7.0, 0.4), [3.0, 2.5]) };
    let e = errors("person", &scene);
    assert!(e.markers < 0.2 && e.inside < 0.006 && e.edge < 0.0105 && e.curvature < 1.4e-4, "{e:?}");
}

#[test]
fn a_bevelled_plate_is_mapped_by_its_mid_surface_edges() {
    let scene = Scene { inset: 0.0115, thickness: 0.04, ..Scene::new(cylinder(6.0, 0.3), [3.0, 2.5]) };
    check("bevelled", &scene, [0.2, 0.0065, 0.014, 2.6e-4]);
}

/// Smoothing of the heights moves no place within the surface; without `place_by_chart` corners move by 0.7 mm.
#[test]
fn a_noisy_curved_plate_has_its_corners_where_the_outline_has_them() {
    let scene = Scene { sigma: 1.5e-3, pitch: 0.016, ..Scene::new(cylinder(-11.0, 0.0), [2.45, 1.75]) };
    let (outline, Measurement { surface, corners, .. }) = (scene.outline(), scene.measure());
    let off = |k: usize| {
        let [u, v] = scene.spec().rectangle().corners[k];
        let (off, normal) = (corners[k] - outline.corners[k].point, surface.normal(u, v));
        (off - normal * off.dot(&normal)).norm()
    };
    let off = (0..4).map(off).fold(0.0, f64::max);
    println!("corners off by {:.3} mm within the surface", 1e3 * off);
    assert!(off < 1e-5, "{off}");
}

#[test]
fn stated_deviations_are_those_observed() {
    // Pooled over plates: errors of one plate are correlated over long distances.
    let mut square = 0.0;
    for seed in 0..6 {
        let scene = Scene { seed, pitch: 0.012, ..Scene::new(cylinder(8.0, 0.7), [3.0, 2.0]) };
        square += errors("stated", &scene).over_stated.powi(2) / 6.0;
    }
    assert!((0.6..1.4).contains(&square.sqrt()), "observed over stated {}", square.sqrt());
}

#[test]
fn the_same_samples_give_the_same_bits() {
    let scene = Scene { pitch: 0.02, ..Scene::new(cylinder(8.0, 0.7), [3.0, 2.0]) };
    let bits = |m: &super::Measurement| -> Vec<u64> {
        m.surface.to_parts().control.iter().flatten().map(|x| x.to_bits()).collect()
    };
    assert_eq!(bits(&scene.measure()), bits(&scene.measure()));
}

#[test]
fn lines_and_grid_lie_on_the_face() {
    let scene = Scene { pitch: 0.02, ..Scene::new(cylinder(8.0, 0.7), [3.0, 2.0]) };
    let m = scene.measure();
    let line = reference_line(&m.surface, &m.location, [0.0, 1.0], [3.0, 1.0]);
    assert_eq!(line.len(), 61);
    assert_eq!((line[0].u, line[1].u, line[60].u), (0.0, 0.05, 3.0));
    let placed = scene.placed();
    assert!(line.iter().all(|p| (p.position - placed.face(p.u, p.v)).norm() < 1e-3 && p.seen));
    let sigma = |p: &Place| p.sigma.iter().map(|s| s * s).sum::<f64>().sqrt();
    assert!(line.iter().all(|p| (1e-6..1e-3).contains(&sigma(p))));
    let grid = grid(&m.surface, &m.location, 21, 21);
    let node = &grid.nodes[20 * 21];
    assert_eq!((node.place.u, node.place.v), (0.0, 2.0));
    assert!((m.corners[3] - node.place.position).norm() < 1e-12);
    assert!(grid.nodes.iter().all(|n| (n.curvature.max - 0.125).abs() < 0.05));
}

#[test]
fn an_empty_patch_is_refused() {
    let full = Scene::new(cylinder(8.0, 0.7), [3.0, 2.0]);
    let outline = full.outline();
    let scene = Scene { pitch: 2.0, ..full };
    let mut clock = std::time::Duration::default;
    let mut flatten = super::scene::Harmonic;
    let error = super::measure(
        &scene.patch(),
        &outline,
        &scene.spec(),
        &scene.spec().rectangle(),
        &mut flatten,
        &mut clock,
    );
    let message = error.expect_err("refused").to_string();
    assert!(message.contains("points do not determine the surface"), "{message}");
}
