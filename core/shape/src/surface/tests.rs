#![cfg(feature = "measure")]

use super::*;

/// Builds a surface without noise over 3 x 2 m, with points `f(u, v)` of the mid-surface.
fn exact(spans: [usize; 2], f: impl Fn(f64, f64) -> Vec3) -> Surface {
    let (u, v) = (UniformKnots::new(0.0, 3.0, spans[0]), UniformKnots::new(0.0, 2.0, spans[1]));
    let mut fit = SplineFit::new(u, v);
    let (n_u, n_v) = (8 * spans[0], 8 * spans[1]);
    for k in 0..n_u * n_v {
        let at = |j: usize, n: usize, length: f64| length * (j as f64 + 0.5) / n as f64;
        let (x, y) = (at(k % n_u, n_u, 3.0), at(k / n_u, n_v, 2.0));
        fit.add(x, y, f(x, y).into(), 1e8);
    }
    let penalty = platen_numerics::reml::Penalty { u: 1e-6, v: 1e-6 };
    Surface::new(fit.solve_with(penalty).expect("determined"), 0.04, Mask::unseen(3.0, 2.0, 0.1))
}

/// Returns a cylinder of radius r that bends along a direction psi from u, with its centre on the side of +z.
fn cylinder(r: f64, psi: f64) -> impl Fn(f64, f64) -> Vec3 {
    let (s, c) = psi.sin_cos();
    move |u, v| {
        let (across, along) = (c * u + s * v, -s * u + c * v);
        let (x, z) = (r * (across / r).sin(), r * (1.0 - (across / r).cos()));
        Vec3::new(c * x - s * along, s * x + c * along, z)
    }
}

#[test]
fn a_cylinders_curvature_and_normal_are_the_closed_form() {
    let psi = 0.35;
    let surface = exact([24, 16], cylinder(6.0, psi));
    for (u, v) in [(0.3, 0.3), (1.5, 1.0), (2.8, 1.9), (0.0, 0.0)] {
        let k = surface.curvature(u, v);
        let (s, c) = psi.sin_cos();
        let want = [c * c / 6.0, s * s / 6.0, s * c / 6.0, 1.0 / 6.0, 0.0, 0.0];
        for (got, want) in [k.u, k.v, k.uv, k.max, k.min, k.gaussian].into_iter().zip(want) {
            assert!((got - want).abs() < 1e-4, "{k:?}");
        }
        let across = (c * u + s * v) / 6.0;
        let normal = Vec3::new(-c * across.sin(), -s * across.sin(), across.cos());
        assert!((surface.normal(u, v) - normal).norm() < 1e-5);
        let face = cylinder(6.0, psi)(u, v) + 0.02 * normal;
        assert!((surface.face(u, v) - face).norm() < 1e-6);
    }
}

#[test]
fn a_saddles_principal_curvatures_have_both_signs() {
    let surface = exact([12, 8], |u, v| Vec3::new(u, v, 0.05 * ((u - 1.5).powi(2) - (v - 1.0).powi(2))));
    let k = surface.curvature(1.5, 1.0);
    assert!((k.max - 0.1).abs() < 1e-6 && (k.min + 0.1).abs() < 1e-6 && (k.gaussian + 0.01).abs() < 1e-6);
}

#[test]
fn curvature_converges_with_the_second_order() {
    // The second derivative of a cubic spline has an error of order step^2 on a shape that is not a polynomial.
    let error = |n: usize| {
        let surface = exact([3 * n, 2 * n], |u, v| Vec3::new(u, v, 0.02 * (4.0 * u).sin()));
        (0..60)
            .map(|i| 0.5 + f64::from(i) / 30.0)
            .map(|u| {
                let (slope, bend) = (0.08 * (4.0 * u).cos(), -0.32 * (4.0 * u).sin());
                (surface.curvature(u, 1.0).u - bend / (1.0 + slope * slope).powf(1.5)).powi(2)
            })
            .sum::<f64>()
            .sqrt()
    };
    let order = (error(5) / error(10)).log2();
    assert!((1.7..2.6).contains(&order), "order {order}");
}

#[test]
fn curvature_at_a_skew_parametrisation_is_that_of_the_surface() {
    // The same cylinder with S_u and S_v at 70 degrees: principal curvatures do not depend on it.
    let surface = exact([24, 16], |u, v| cylinder(6.0, 0.2)(u + 0.34 * v, 0.94 * v));
    let k = surface.curvature(1.2, 0.9);
    assert!((k.max - 1.0 / 6.0).abs() < 1e-4 && k.min.abs() < 1e-4, "{k:?}");
}

#[test]
fn parts_give_the_surface_back() {
    let surface = exact([6, 9], cylinder(5.0, 0.1));
    let again = Surface::from_parts(surface.to_parts()).expect("fits");
    assert!((again.point(1.0, 1.0) - surface.point(1.0, 1.0)).norm() < 1e-12);
    assert_eq!(again.sigma_point(1.0, 1.0), surface.sigma_point(1.0, 1.0));
    let refused = |change: fn(&mut SurfaceParts)| {
        let mut parts = surface.to_parts();
        change(&mut parts);
        Surface::from_parts(parts).expect_err("must be refused").what
    };
    assert_eq!(refused(|p| p.knots_u[4] += 0.1), "knots of u are not uniform");
    assert_eq!(refused(|p| p.control.truncate(7)), "the control net does not fit its knots");
    assert_eq!(refused(|p| p.precision_factor.truncate(7)), "the factor does not fit the control net");
    assert_eq!(refused(|p| p.control[3][1] = f64::NAN), "a number is not finite");
    assert_eq!(refused(|p| p.noise_share = 0.0), "the share of noise is not above 0 to 1");
    assert_eq!(refused(|p| p.seen.truncate(7)), "the mask does not fit its cells");
}

#[test]
fn one_place_and_many_places_state_the_same_deviation() {
    let surface = exact([10, 8], cylinder(5.0, 0.1));
    for (u, v) in [(0.01, 0.01), (1.3, 0.8), (2.99, 1.2)] {
        let (local, whole) = (surface.sigma_point(u, v), surface.sigma_of_heights(&[([u, v], 1.0)]));
        assert!((local / whole - 1.0).abs() < 1e-6, "{local} {whole}");
    }
    // The second derivative as a difference quotient of three heights.
    let (d, u, v) = (2e-3, 1.31, 0.8);
    let terms = [([u - d, v], 1.0), ([u, v], -2.0), ([u + d, v], 1.0)];
    let quotient = surface.sigma_of_heights(&terms) / (d * d);
    assert!((quotient / surface.sigma_curvature(u, v)[0] - 1.0).abs() < 1e-2);
    // 4,000 draws of the same quotient: their rms is known to 1.1 %, one standard deviation.
    let draws = surface.draw_heights::<4000>(5);
    let [before, at, after] = [u - d, u, u + d].map(|u| draws.at(u, v));
    let drawn = (0..4000).map(|k| before[k] - 2.0 * at[k] + after[k]);
    let rms = (drawn.map(|quotient| quotient.powi(2)).sum::<f64>() / 4000.0).sqrt() / (d * d);
    assert!((rms / quotient - 1.0).abs() < 0.03, "{rms} {quotient}");
    // Noise of 0.1 mm on 1920 points, 9 per coefficient: the deviation is below the noise inside and larger in the
    // corner.
    assert!(
        surface.sigma_point(1.3, 0.8) < 1e-4 && surface.sigma_point(0.0, 0.0) > surface.sigma_point(1.3, 0.8)
    );
}
