use std::f64::consts::{PI, TAU};

use crate::chart::{abf, plane_angles};
use nalgebra::{DMatrix, DVector};
use platen_numerics::random::Random;
use platen_shape::DiskMesh;
use platen_shape::flatten::closed_form::*;
use platen_shape::flatten::{check_fit, interior};

fn errors(plate: &ClosedForm) -> [f64; 2] {
    plate.errors(&abf(&plate.mesh().unwrap(), || Ok(())).unwrap())
}

fn check_order(surface: impl Fn([f64; 2]) -> [f64; 3] + Copy, size: [f64; 2], finest: f64) {
    let error = |n: u32| errors(&ClosedForm::new(surface, size, [3 * n, 2 * n], 0.0, 0))[1];
    let [coarse, fine] = [error(10), error(40)];
    assert!(fine < finest, "{fine:e} m");
    assert!(coarse / fine > 13.0, "order {}", (coarse / fine).log2() / 2.0);
}

/// Returns the constraints as published: triangle sums less pi, vertex sums less 2 pi, quotients of the rings' products
/// less 1.
fn constraints(mesh: &DiskMesh, angles: &[[f64; 3]]) -> DVector<f64> {
    let (node_of, inner) = interior(mesh);
    let (mut sums, mut rings) = (vec![-TAU; inner.len()], vec![[1.0, 1.0]; inner.len()]);
    for (t, x) in mesh.triangles.iter().zip(angles) {
        for k in 0..3 {
            let Some(node) = node_of[t[k] as usize] else { continue };
            sums[node as usize] += x[k];
            rings[node as usize][0] *= x[(k + 1) % 3].sin();
            rings[node as usize][1] *= x[(k + 2) % 3].sin();
        }
    }
    let triangles = angles.iter().map(|x| x.iter().sum::<f64>() - PI);
    let all: Vec<_> = triangles.chain(sums).chain(rings.iter().map(|[a, b]| a / b - 1.0)).collect();
    DVector::from_vec(all)
}

#[test]
fn a_flat_plate_keeps_its_places() {
    let plate = ClosedForm::new(|[u, v]| [u, 1.0, -v], [5.0, 2.0], [50, 20], 0.3, 3);
    assert!(errors(&plate)[1] < 1e-11);
}

#[test]
fn developable_plates_are_exact_to_second_order_of_the_mesh() {
    // Found: 0.03 and 0.08 um.
    check_order(&cylinder(8.0, 0.5), [3.0, 2.5], 7e-8);
    check_order(&cone([-7.0, 1.0], 0.6), [3.0, 2.0], 1.6e-7);
}

#[test]
fn the_angles_are_those_of_a_plane_mesh() {
    let size = [3.0, 2.5];
    for plate in [
        ClosedForm::new(sphere_of_fibres(6.0, size), size, [36, 30], 0.3, 5),
        ClosedForm::new(cylinder(9.0, 0.2), size, [60, 50], 0.3, 5).with_noise(5e-4, 6),
    ] {
        let mesh = plate.mesh().unwrap();
        let angles = plane_angles(&mesh, || Ok(())).unwrap();
        let worst = constraints(&mesh, &angles).amax();
        assert!(worst < 1e-10, "{worst:e}");
    }
}

/// Tests the condition of a minimum: the gradient of the distance lies in the span of the constraints' gradients, which
/// are differences of the constraints as published.
#[test]
fn no_plane_angles_are_nearer() {
    let size = [3.0, 2.5];
    let plate = ClosedForm::new(sphere_of_fibres(2.0, size), size, [6, 5], 0.3, 5).with_noise(0.01, 1);
    let mesh = plate.mesh().unwrap();
    let (node_of, inner) = interior(&mesh);
    let targets = crate::angles::targets(&mesh, &node_of, inner.len());
    let angles = plane_angles(&mesh, || Ok(())).unwrap();
    let pairs = angles.iter().flatten().zip(targets.iter().flatten());
    let slope = DVector::from_iterator(angles.len() * 3, pairs.map(|(x, b)| 2.0 * (x - b) / (b * b)));
    let h = 1e-5;
    let columns: Vec<_> = (0..slope.len())
        .map(|i| {
            let at = |step: f64| {
                let mut moved = angles.clone();
                moved[i / 3][i % 3] += step;
                constraints(&mesh, &moved)
            };
            (at(h) - at(-h)) / (2.0 * h)
        })
        .collect();
    let jacobian_transposed = DMatrix::from_columns(&columns).transpose();
    let multipliers = jacobian_transposed.clone().svd(true, true).solve(&slope, 1e-9).unwrap();
    let left = (&slope - jacobian_transposed * multipliers).norm();
    assert!(slope.norm() > 0.1 && left < 1e-6 * slope.norm(), "{left:e} of {:e}", slope.norm());
}

/// On a sphere its error equals that of the harmonic map: 0.65 to 1.3 mm in the mean at R 10 m, 2.5 x 5 m.
#[test]
fn on_a_sphere_it_is_wrong_by_a_millimetre() {
    let size = [2.5, 5.0];
    let [mean, max] = errors(&ClosedForm::new(sphere_of_fibres(10.0, size), size, [70, 140], 0.3, 2));
    assert!(
        (0.6e-3..0.75e-3).contains(&mean) && (1.1e-3..1.4e-3).contains(&max),
        "mean {mean:e}, max {max:e}"
    );
}

/// Small meshes of every kind, with noise up to the size of the cells: no panic, no hang, every coordinate finite.
#[test]
fn random_small_meshes_give_finite_charts_or_are_refused() {
    let mut refused = 0;
    for seed in 0..3000 {
        let mut random = Random::new(seed);
        let cells = [1 + (random.unit() * 9.0) as u32, 1 + (random.unit() * 9.0) as u32];
        let size = [0.5 + 5.0 * random.unit(), 0.5 + 5.0 * random.unit()];
        let radius = 2.0 + 20.0 * random.unit();
        let smooth = random.unit() < 0.5;
        let noise = random.unit() * if smooth { 1e-3 } else { 0.3 };
        let plate = ClosedForm::new(sphere_of_fibres(radius, size), size, cells, 0.45 * random.unit(), seed)
            .with_noise(noise, seed);
        let mesh = plate.mesh().unwrap_or_else(|e| panic!("seed {seed}: {e}"));
        if check_fit(&mesh).is_err() {
            refused += 1;
            continue;
        }
        match abf(&mesh, || Ok(())) {
            Ok(uv) => assert!(uv.iter().flatten().all(|x| x.is_finite()), "seed {seed}"),
            Err(e) => {
                assert!(!smooth, "seed {seed}: {e}");
                refused += 1;
            }
        }
    }
    // Found: 249 of 3000.
    assert!(refused < 500, "{refused} refused");
}
