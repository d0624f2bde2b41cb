//! Example of a flattening: the harmonic map, which is correct on plates that were bent without stretching.

use platen_sdk::{
    Chart, DiskMesh, Error, ErrorKind, Flattening, Info, Job, Result, cotangents, fixed_boundary,
};

struct MyPlugin;

impl Flattening for MyPlugin {
    const INFO: Info =
        Info::new(c"my-plugin", c"Harmonic map", c"Harmonic map.", c"0.1.0").by(c"an integrator", c"MIT");
    type Options = ();

    fn new((): ()) -> Result<Self> {
        Ok(Self)
    }

    fn flatten(&mut self, job: &Job<'_>, mesh: &DiskMesh) -> Result<Chart> {
        job.check()?; // cancelled, or past the deadline
        // Weights of 1 instead of cotangents give Tutte's map, which preserves no lengths: the host refuses it.
        let uv = fixed_boundary(mesh, &cotangents(mesh)).map_err(|error| {
            Error::new(ErrorKind::BadData, error.to_string()).hint("scan again with the whole plate in view")
        })?;
        Ok(Chart { uv, sigma: None })
    }
}

platen_sdk::export!(flattening MyPlugin);
