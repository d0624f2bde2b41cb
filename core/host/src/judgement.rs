//! Judgement of a measured plate: comparisons, verdict and document, the same for `run`, `measure` and `remeasure`.

use std::time::Instant;

use platen_engine::calibration::Calibration;
use platen_engine::doubtful_edge;
use platen_engine::pipeline::Pipeline;
use platen_engine::plugin::{Instance, PluginError, Surfaces};
use platen_engine::scanner_error::ScannerError;
use platen_engine::stroke;
use platen_model::{Report, Task};
use platen_plant::{PlantFile, PlateFile};
use platen_report::result::{self, Context, ResultRecord};
use platen_shape::{Measured, Scanned};

use crate::plugin_records;

/// Circumstances of a measurement besides its surfaces.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Circumstances<'a> {
    pub(crate) plant: &'a PlantFile,
    pub(crate) plate: &'a PlateFile,
    /// Valid calibration of the scanner; without one the range error of its data sheet is used.
    pub(crate) calibration: Option<&'a Calibration>,
    /// Scanner of a host; none for a file.
    pub(crate) scanner: Option<&'a Instance>,
    pub(crate) stroke: Option<u64>,
    /// Whether the plate rests on other supports than at the stroke before.
    pub(crate) supports_changed: bool,
}

/// Plate with its verdict.
#[derive(Debug)]
pub(crate) struct Judgement {
    pub(crate) record: ResultRecord,
    pub(crate) reports: Vec<Result<Report, PluginError>>,
    pub(crate) task: Task,
}

/// Compares a measured plate with its target and its earlier surfaces, judges it and assembles its document.
pub(crate) fn judge(
    pipeline: &Pipeline,
    scanned: &Scanned,
    measured: &Measured,
    surfaces: Surfaces<'_>,
    circumstances: Circumstances<'_>,
) -> Judgement {
    let Circumstances { plant, plate, calibration, scanner, stroke, supports_changed } = circumstances;
    let start = Instant::now();
    let assumed = || ScannerError::assumed(plant.range_error, scanned.header.range_error_m, surfaces.now);
    let calibrated = |calibration| ScannerError::calibrated(calibration, surfaces.now);
    let error = calibration.map_or_else(assumed, calibrated);
    error.log();
    let task = error.task(plate, supports_changed);
    let mut reports = stroke::compare(pipeline, &task, surfaces);
    let doubts = result::doubts(measured, plate);
    doubtful_edge::withdraw_verdicts(pipeline, &task, surfaces, &doubts, &mut reports);
    let context = Context {
        plate,
        task: &task,
        assumption: error.assumption.as_deref(),
        range_error: error.range(),
        doubts: &doubts,
        press: pipeline.press,
        stroke,
        verdict: stroke::verdict(&reports),
        reports: &reports,
        compare: start.elapsed(),
    };
    let mut record = ResultRecord::new(scanned, measured, context);
    record.name_plugins(plugin_records::records(scanner.into_iter().chain(pipeline.instances())));
    Judgement { record, reports, task }
}
