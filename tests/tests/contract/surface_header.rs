//! Test of `platen_surface.h` against the surface in Rust: the same numbers at the same points.

use std::process::Command;

use platen_sdk::exchange::Payload as _;
use platen_shape::Surface;
use platen_shape::surface::{Mask, SplineFit, UniformKnots};
use platen_tests::{c_source, compile_c};

/// Returns a skew bump over 3 x 2 m, oblique in space, half of it seen.
fn surface() -> Surface {
    let (u, v) = (UniformKnots::new(0.0, 3.0, 13), UniformKnots::new(0.0, 2.0, 9));
    let mut fit = SplineFit::new(u, v);
    let mut mask = Mask::unseen(3.0, 2.0, 0.1);
    for k in 0..104 * 72 {
        let (x, y) = (3.0 * (f64::from(k % 104) + 0.5) / 104.0, 2.0 * (f64::from(k / 104) + 0.5) / 72.0);
        let z = 0.05 * (1.3 * x + 0.4 * y).sin() + 0.02 * x * y;
        fit.add(x, y, [x + 0.1 * y, y - 0.05 * x, z], 1e6);
        if x < 1.5 {
            mask.mark(x, y);
        }
    }
    Surface::new(fit.solve([0.0, 0.0, 1.0]).unwrap(), 0.03, mask)
}

#[test]
fn the_header_evaluates_the_surface_as_rust_does() {
    let (folder, surface) = (tempfile::tempdir().unwrap(), surface());
    let (program, file) = (folder.path().join("surface"), folder.path().join("surface.platen"));
    std::fs::write(&file, surface.to_buffer().as_ref()).unwrap();
    compile_c(&c_source("surface.c"), &program, &["-Wpedantic"]);
    let output = Command::new(program).arg(&file).output().unwrap();
    assert!(output.status.success());
    let text = String::from_utf8(output.stdout).unwrap();
    let lines: Vec<Vec<f64>> =
        text.lines().map(|line| line.split(' ').map(|x| x.parse().unwrap()).collect()).collect();
    assert_eq!(lines.len(), 17 * 23);
    let mut worst = [0.0_f64; 11];
    for (k, line) in lines.iter().enumerate() {
        let (u, v) = (surface.width() * (k % 23) as f64 / 22.0, surface.height() * (k / 23) as f64 / 16.0);
        let (p, n, bent) = (surface.point(u, v), surface.normal(u, v), surface.curvature(u, v));
        let seen = f64::from(u8::from(surface.mask().seen(u, v)));
        let sigma = surface.sigma_point(u, v);
        let want = [p.x, p.y, p.z, n.x, n.y, n.z, bent.u, bent.v, bent.uv, sigma, seen];
        for (worst, (got, want)) in worst.iter_mut().zip(line.iter().zip(want)) {
            *worst = worst.max((got - want).abs());
        }
    }
    println!("largest differences: {worst:?}");
    assert!(worst.iter().all(|difference| *difference < 1e-12), "{worst:?}");
}
