//! Tests of energy, gradient and Hessian against differences and closed forms.

use crate::membrane::{Forms, Membrane, Strained, positive_part};
use platen_numerics::random::Random;
use platen_shape::DiskMesh;
use platen_shape::flatten::closed_form::ClosedForm;

/// Returns a small plate with its material positions disturbed by `strain`.
fn shaken(strain: f64, seed: u64) -> (DiskMesh, Vec<[f64; 2]>) {
    let surface = |[u, v]: [f64; 2]| [u + 0.1 * v, v, 0.2 * u * v + 0.1 * u * u];
    let plate = ClosedForm::new(surface, [1.0, 0.8], [4, 3], 0.2, seed);
    let mut random = Random::new(seed);
    let x = plate.uv.iter().map(|p| p.map(|x| x + strain * 0.25 * (random.unit() - 0.5))).collect();
    (plate.mesh().unwrap(), x)
}

#[test]
fn the_gradient_is_the_energys_difference() {
    for seed in 0..20 {
        let (mesh, x) = shaken(0.3, seed);
        let membrane = Membrane::new(&mesh, 0.3);
        let mut gradient = vec![[0.0; 2]; x.len()];
        membrane.add_gradient(&x, &mut gradient);
        for (v, c) in (0..x.len()).flat_map(|v| [(v, 0), (v, 1)]) {
            let at = |step: f64| {
                let mut x = x.clone();
                x[v][c] += step;
                membrane.energy(&x)
            };
            let h = 1e-4;
            let difference = (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h);
            assert!((gradient[v][c] - difference).abs() < 1e-9 * (1.0 + difference.abs()), "{v} {c}");
        }
    }
}

#[test]
fn the_hessian_is_the_gradients_difference() {
    for seed in 0..20 {
        let (mesh, x) = shaken(0.3, seed);
        let membrane = Membrane::new(&mesh, 0.3);
        let (t, metric) = (membrane.triangles[0], membrane.metrics[0]);
        let state = membrane.state(&t, &metric, &x).unwrap();
        let forms = Forms::of(&state, 0.3);
        let gradient = |x: &[[f64; 2]]| {
            let state = membrane.state(&t, &metric, x).unwrap();
            let m = state.eshelby();
            state.hats.map(|g| [m[0] * g[0] + m[2] * g[1], m[2] * g[0] + m[1] * g[1]].map(|f| f * state.area))
        };
        for (b, c) in (0..3).flat_map(|b| [(b, 0), (b, 1)]) {
            let at = |step: f64| {
                let mut x = x.clone();
                x[t[b] as usize][c] += step;
                gradient(&x)
            };
            let h = 1e-4;
            let [p, m, p2, m2] = [at(h), at(-h), at(2.0 * h), at(-2.0 * h)];
            for (a, r) in (0..3).flat_map(|a| [(a, 0), (a, 1)]) {
                let difference = (8.0 * (p[a][r] - m[a][r]) - (p2[a][r] - m2[a][r])) / (12.0 * h);
                let block = forms.block(state.hats[a], state.hats[b], state.area);
                assert!(
                    (block[r][c] - difference).abs() < 1e-7 * (1.0 + difference.abs()),
                    "{seed} {a}{r} {b}{c}"
                );
            }
        }
    }
}

#[test]
fn the_positive_part_keeps_what_is_positive() {
    assert_eq!(positive_part([2.0, 1.0, 0.5]), [2.0, 1.0, 0.5]);
    assert_eq!(positive_part([-2.0, -1.0, 0.5]), [0.0; 3]);
    // Eigenvalues 3 and -1 along the diagonals.
    let [a, d, b] = positive_part([1.0, 1.0, 2.0]);
    assert!((a - 1.5).abs() + (d - 1.5).abs() + (b - 1.5).abs() < 1e-12);
}

#[test]
fn an_evenly_stretched_plate_has_its_closed_form_energy() {
    let plate = ClosedForm::new(|[u, v]| [1.01 * u, 0.0, 0.98 * v], [2.0, 1.0], [6, 4], 0.3, 1);
    let mesh = plate.mesh().unwrap();
    let membrane = Membrane::new(&mesh, 0.3);
    let (e1, e2) = (0.5 * (1.01_f64.powi(2) - 1.0), 0.5 * (0.98_f64.powi(2) - 1.0));
    let density = (e1 * e1 + e2 * e2 + 2.0 * 0.3 * e1 * e2) / (2.0 * (1.0 - 0.09));
    assert!((membrane.energy(&plate.uv) - 2.0 * density).abs() < 1e-15);
    for Strained { strain: [a, b, c], .. } in membrane.strains(&plate.uv) {
        assert!((a - e1).abs() < 1e-12 && (b - e2).abs() < 1e-12 && c.abs() < 1e-12);
    }
}
