//! Inputs of a measurement: the SHA-256 of everything that its result depends on, so that an existing result is not
//! computed again.

use platen_engine::pipeline::Pipeline;
use platen_plant::PlantFile;
use serde::{Deserialize, Serialize};

use crate::sha256;

/// Inputs of one measurement.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Inputs {
    #[serde(flatten)]
    pub(crate) setup: Setup,
    /// Calibration in force at the time of the stroke.
    pub(crate) calibration: Option<String>,
    /// Raw scan.
    pub(crate) scan: String,
    /// Plate file.
    pub(crate) plate_file: String,
    /// Scan of the blank.
    pub(crate) baseline: Option<Origin>,
    /// Stroke before.
    pub(crate) before: Option<Origin>,
}

/// Inputs that all measurements of one run of the program share.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Setup {
    /// The program.
    pub(crate) program: String,
    /// Libraries of the flattening and of the comparisons.
    plugins: Vec<String>,
    /// Frame, options of the plugins and range error in the plant file.
    options: String,
}

/// Source of an earlier surface.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Origin {
    /// Measured again from its kept scan.
    Scan { scan: String, plate_file: String },
    /// Surface on record: its scan is no longer kept.
    Record { surface: String },
}

impl Setup {
    /// Returns the digests of this program with the plugins of a plant.
    ///
    /// # Errors
    /// The program's file cannot be read.
    pub(crate) fn of(plant: &PlantFile, pipeline: &Pipeline) -> std::io::Result<Self> {
        // Within one program the Debug form of equal options is equal, and the program is itself an input.
        let options =
            format!("{:?}", (&plant.frame, &plant.flattening, &plant.comparisons, plant.range_error));
        Ok(Self {
            program: sha256::of_file(&std::env::current_exe()?)?,
            plugins: pipeline.instances().map(|plugin| plugin.sha256()).collect(),
            options: sha256::of_bytes(options.as_bytes()),
        })
    }
}
