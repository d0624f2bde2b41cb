//! Example of a comparison: the mean curvature of the plate along u, over the part that was seen.

use platen_sdk::{
    Comparison, Error, ErrorKind, Figure, Findings, Info, Inputs, Job, PlateGrid, Report, Result, options,
};

options! {
    /// Options of `my-plugin`.
    pub struct Options {
        /// Least share of the plate that must have been seen.
        least_seen: f64 = 0.5, min 0.0, max 1.0;
    }
}

struct MyPlugin(Options);

impl Comparison for MyPlugin {
    const INFO: Info = Info::new(c"my-plugin", c"Mean curvature", c"Mean curvature along u.", c"0.1.0")
        .by(c"an integrator", c"MIT");
    type Options = Options;

    fn new(options: Options) -> Result<Self> {
        Ok(Self(options))
    }

    fn compare(&mut self, job: &Job<'_>, inputs: &Inputs) -> Result<Report> {
        job.check()?; // cancelled, or past the deadline
        let plate = &inputs.now;
        let curvatures =
            PlateGrid::new(plate).map(|u, v| plate.mask().seen(u, v).then(|| plate.curvature(u, v).u));
        let seen: Vec<f64> = curvatures.into_iter().flatten().collect();
        if seen.is_empty() || (seen.len() as f64) < self.0.least_seen * PlateGrid::NODES as f64 {
            return Err(Error::new(ErrorKind::BadData, "too little of the plate was seen")
                .hint("scan again with the whole plate in view"));
        }
        let mean = seen.iter().sum::<f64>() / seen.len() as f64;
        let figures = vec![Figure::new("mean_curvature.u", mean, "1/m")];
        Ok(Report::new(Findings { figures, ..Findings::default() }, Vec::new()))
    }
}

platen_sdk::export!(comparison MyPlugin);
