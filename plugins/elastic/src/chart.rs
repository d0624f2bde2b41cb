//! Chart of a mesh, in three steps: start, minimum of the energy, uncertainty.

use platen_sdk::Result;
use platen_shape::flatten::{cotangents, first_turned, fixed_boundary};
use platen_shape::{Chart, DiskMesh};

use crate::boundary_springs::BoundarySprings;
use crate::material_law_bound::material_law_bound;
use crate::membrane::{Membrane, Strained};
use crate::newton::{minimise, not_found, unsolved};

/// Returns the chart of least membrane energy. `check` is called between the steps and stops the work with its error.
pub(crate) fn elastic(mesh: &DiskMesh, poisson: f64, check: impl Fn() -> Result<()>) -> Result<Chart> {
    let mut uv = start(mesh)?;
    check()?;
    let membrane = Membrane::new(mesh, poisson);
    let springs = BoundarySprings::new(mesh, scatter(&membrane.strains(&uv)));
    minimise(mesh, &membrane, &springs, &mut uv, check)?;
    let strains = membrane.strains(&uv);
    let sigma =
        material_law_bound(&strains, &uv, [mesh.width, mesh.height], poisson).map_err(|e| unsolved(&e))?;
    Ok(Chart { uv, sigma: Some(sigma) })
}

/// Returns the harmonic map, or Tutte's (uniform weights) where obtuse angles fold it.
fn start(mesh: &DiskMesh) -> Result<Vec<[f64; 2]>> {
    let tutte = || vec![[1.0; 3]; mesh.triangles.len()];
    for weights in [&|| cotangents(mesh), &tutte as &dyn Fn() -> Vec<[f64; 3]>] {
        let uv = fixed_boundary(mesh, &weights()).map_err(|e| unsolved(&e))?;
        if first_turned(&mesh.triangles, &uv).is_none() {
            return Ok(uv);
        }
    }
    Err(not_found("the mesh folds over on the rectangle"))
}

/// Returns the root mean square deviation of the strain from its mean over the plate.
fn scatter(strains: &[Strained]) -> f64 {
    let area: f64 = strains.iter().map(|s| s.area).sum();
    let mean = [0, 1, 2].map(|k| strains.iter().map(|s| s.area * s.strain[k]).sum::<f64>() / area);
    let square = |s: &Strained| {
        let [a, b, c] = [0, 1, 2].map(|k| s.strain[k] - mean[k]);
        s.area * (a * a + b * b + 2.0 * c * c)
    };
    (strains.iter().map(square).sum::<f64>() / area).sqrt()
}
