//! Example program for `tests/peers/surface.py`: writes scattered points of a rolled plate, with the spline fitted to
//! them, to a folder, one JSON file for each case.
//!
//! ```text
//! cargo run --release -p platen-tests --example surface_fits -- DIR
//! ```

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use platen_shape::surface::{SplineFit, UniformKnots};

/// Extent of the plate, metres.
const SIZE: [f64; 2] = [4.0, 3.0];
/// Radius of the plate, metres.
const RADIUS: f64 = 12.0;
/// Number of points along each side at which fits are compared, from edge to edge.
const PLACES: usize = 41;
const REPEAT: usize = 5;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).ok_or("usage: surface_fits DIR")?;
    for (name, n_points, spans, noise) in
        [("clean-10k", 10_000, 16, 0.0), ("noisy-10k", 10_000, 16, 5e-4), ("noisy-280k", 280_000, 32, 5e-4)]
    {
        write(Path::new(&folder), name, n_points, spans, noise)?;
    }
    Ok(())
}

/// Returns a point of the rolled plate, which is bent along u.
fn plate([u, v]: [f64; 2]) -> [f64; 3] {
    let angle = (u - 0.5 * SIZE[0]) / RADIUS;
    [RADIUS * angle.sin(), v, RADIUS * (1.0 - angle.cos())]
}

fn write(folder: &Path, name: &str, n_points: usize, spans: usize, noise: f64) -> Result<(), Box<dyn Error>> {
    let mut random = fastrand::Rng::with_seed(7);
    let uv: Vec<[f64; 2]> = (0..n_points).map(|_| SIZE.map(|length| length * random.f64())).collect();
    // Irwin and Hall's sum of twelve uniform numbers: variance 1.
    let mut normal = || (0..12).map(|_| random.f64()).sum::<f64>() - 6.0;
    let points: Vec<[f64; 3]> =
        uv.iter().map(|at| plate(*at)).map(|[x, y, z]| [x, y, z + noise * normal()]).collect();
    let weight = noise.max(1e-9).powi(-2);
    let (mut best_ms, mut fitted) = (f64::INFINITY, None);
    for _ in 0..REPEAT {
        let start = Instant::now();
        let mut fit = SplineFit::<3>::new(
            UniformKnots::new(0.0, SIZE[0], spans),
            UniformKnots::new(0.0, SIZE[1], spans),
        );
        for ([u, v], point) in uv.iter().zip(&points) {
            fit.add(*u, *v, *point, weight);
        }
        fitted = Some(fit.solve([0.0, 0.0, 1.0])?);
        best_ms = best_ms.min(start.elapsed().as_secs_f64() * 1e3);
    }
    let fitted = fitted.ok_or("no fit")?;
    let share = |k: usize| k as f64 / (PLACES - 1) as f64;
    let places = || (0..PLACES * PLACES).map(|k| [share(k % PLACES) * SIZE[0], share(k / PLACES) * SIZE[1]]);
    let content = serde_json::json!({
        "size_m": SIZE,
        "radius_m": RADIUS,
        "spans": spans,
        "noise_m": noise,
        "uv_m": uv,
        "points_m": points,
        "places_m": places().collect::<Vec<_>>(),
        "true_m": places().map(plate).collect::<Vec<_>>(),
        "fitted_m": places().map(|[u, v]| fitted.spline.point(u, v)).collect::<Vec<_>>(),
        "ms": best_ms,
    });
    let file = std::fs::File::create(folder.join(format!("{name}.json")))?;
    serde_json::to_writer(std::io::BufWriter::new(file), &content)?;
    Ok(())
}
