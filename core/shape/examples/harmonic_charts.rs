//! Closed-form meshes with their harmonic charts, written to a folder as JSON files for `tests/peers/flattening.py`.
//!
//! ```text
//! cargo run --release -p platen-shape --features closed-form --example harmonic_charts -- DIR
//! ```

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use platen_shape::flatten::closed_form::{ClosedForm, cone, cylinder, half_bent, sphere_of_fibres};
use platen_shape::flatten::{cotangents, fixed_boundary};

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).ok_or("usage: harmonic_charts DIR")?;
    let square = [4.0, 4.0];
    let plate =
        |surface: &dyn Fn([f64; 2]) -> [f64; 3], size, cells| ClosedForm::new(surface, size, cells, 0.3, 1);
    let plates = [
        ("cone", plate(&cone([-7.0, 1.0], 0.6), [3.0, 2.0], [30, 20])),
        ("half-bent", plate(&half_bent(5.0, 2.5), [5.0, 2.5], [100, 50])),
        ("rolled-1k", plate(&cylinder(12.0, 0.3), square, [31; 2])),
        ("rolled-5k", plate(&cylinder(12.0, 0.3), square, [70; 2])),
        ("rolled-10k", plate(&cylinder(12.0, 0.3), square, [100; 2])),
        ("noisy-10k", plate(&cylinder(12.0, 0.3), square, [100; 2]).with_noise(5e-4, 2)),
        ("sphere-10k", plate(&sphere_of_fibres(15.0, square), square, [100; 2])),
        ("rolled-50k", plate(&cylinder(12.0, 0.3), square, [223; 2])),
        ("rolled-100k", plate(&cylinder(12.0, 0.3), square, [315; 2])),
    ];
    for (name, plate) in &plates {
        write(Path::new(&folder), name, plate)?;
    }
    Ok(())
}

fn write(folder: &Path, name: &str, plate: &ClosedForm) -> Result<(), Box<dyn Error>> {
    let mesh = plate.mesh()?;
    let mut best_ms = f64::INFINITY;
    let mut uv = Vec::new();
    for _ in 0..5 {
        let start = Instant::now();
        uv = fixed_boundary(&mesh, &cotangents(&mesh))?;
        best_ms = best_ms.min(start.elapsed().as_secs_f64() * 1e3);
    }
    let vertices: Vec<[f64; 3]> = mesh.vertices.iter().map(|&p| p.into()).collect();
    let file = std::fs::File::create(folder.join(format!("{name}.json")))?;
    let content = serde_json::json!({
        "vertices_m": vertices,
        "triangles": mesh.triangles,
        "boundary": mesh.boundary,
        "boundary_uv_m": mesh.places,
        "uv_m": uv,
        "size_m": [mesh.width, mesh.height],
        "ms": best_ms,
    });
    serde_json::to_writer(std::io::BufWriter::new(file), &content)?;
    Ok(())
}
