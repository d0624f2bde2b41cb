//! Evaluation of one stroke in the order of its data: scan, plate, outline, surface, comparisons, verdict.
//!
//! ```text
//! columns -> Patch -> Outline -> Measurement (mid-surface, mesh, chart, S) -> Reports -> Verdict
//! ```
//! Each arrow is one function here ([`scan`], [`measure_scanned`], [`compare`], [`verdict`]), with one type on each
//! side.

mod previous_pose;
mod scan_buffer;

pub use previous_pose::PreviousPose;
pub use scan_buffer::ScanBuffer;

use std::time::Instant;

use platen_model::{Report, Task, Verdict};
use platen_scan::{ColumnError, Window};
use platen_shape::extract::{Extractor, Refusal};
use platen_shape::measure::{MeasureError, measure};
use platen_shape::outline::{Outline, OutlineError, outline};
use platen_shape::{Blank, BlankError, Measured, Patch, PlateSpec, Reorientation, Scanned, reorientation};

use crate::pipeline::Pipeline;
use crate::plugin::{JobSpec, PluginError, Scanner, Surfaces};

/// Reason why a stroke was not measured, by the person who must act.
#[derive(Debug, thiserror::Error)]
pub enum NotMeasured {
    /// The scanner gave no scan.
    #[error("scanner {0}")]
    Scanner(#[from] PluginError),
    /// A column of the driver does not fit its lattice.
    #[error("scan: {0}; report this to the driver's author")]
    Column(#[from] ColumnError),
    /// The plate was not found in the scan.
    #[error("scan: {0}")]
    Plate(#[from] Refusal),
    /// The plate's outline was not found.
    #[error("plate: {0}")]
    Outline(#[from] OutlineError),
    /// The plate is turned against the previous scan.
    #[error(
        "plate: its nearest edge lies {angle_deg:.0} degrees from where u ran at the scan before; turn it back, or let the \
         press send plate_rot"
    )]
    Askew {
        /// Angle between its nearest edge and the previous direction of u, degrees.
        angle_deg: f64,
    },
    /// The corner assignment is ambiguous: the plate fits the previous scan only after a quarter or half turn.
    #[error(
        "plate: it fits the scan before only when taken as turned {0}; turn it back, or let the press send plate_rot (`measure --turned`)"
    )]
    Turned(Reorientation),
    /// The scan of the blank is that of another plate.
    #[error("baseline: {0}")]
    Blank(#[from] BlankError),
    /// The plate could not be flattened or fitted.
    #[error("plate: {0}")]
    Shape(#[from] MeasureError),
}

/// Acquires a scan; the plate is extracted while columns arrive. The whole scan goes to `buffer`, if there is one.
///
/// # Errors
/// No scan, or no plate in it.
pub fn scan(
    scanner: &Scanner,
    job: JobSpec,
    window: Option<&Window>,
    spec: &PlateSpec,
    mut buffer: Option<&mut ScanBuffer>,
) -> Result<Scanned, NotMeasured> {
    let start = Instant::now();
    let mut scan = scanner.start(job, window)?;
    let header = scan.header().clone();
    let mut extractor = Extractor::new(&header, spec);
    if let Some(buffer) = buffer.as_deref_mut() {
        buffer.header = Some(header.clone());
    }
    for column in &mut scan {
        let column = column?;
        extractor.push(&column)?;
        if let Some(buffer) = buffer.as_deref_mut() {
            buffer.push(column);
        }
    }
    let end = scan.finish()?;
    if let Some(buffer) = buffer {
        buffer.end = Some(end);
    }
    let acquired = Instant::now();
    extractor.leave_out_warm_up(end.warm_up_columns);
    let patch = extractor.finish()?;
    Ok(Scanned {
        header,
        n_valid: end.points,
        warm_up_columns: end.warm_up_columns,
        patch,
        acquire: acquired - start,
        extract: acquired.elapsed(),
    })
}

/// Outline of the blank, to which (u, v) refer.
#[derive(Debug, Clone, Copy)]
pub enum Baseline<'a> {
    /// Unknown: the nominal rectangle of the plate file.
    None,
    /// From an earlier scan of the blank.
    Earlier(&'a Blank),
    /// From this scan, which is the baseline. Without an outline in it the nominal rectangle is used, and the log names
    /// the reason.
    This,
}

impl Baseline<'_> {
    fn blank(self, patch: &Patch, outline: &Outline, spec: &PlateSpec) -> Result<Option<Blank>, BlankError> {
        match self {
            Self::None => Ok(None),
            Self::Earlier(blank) => Ok(Some(*blank)),
            Self::This => match Blank::of_scan(patch, outline, spec) {
                Ok(blank) => Ok(Some(blank)),
                Err(another @ BlankError::OffSize { .. }) => Err(another),
                Err(why) => {
                    tracing::warn!("baseline: {why}; the plate counts as the rectangle of its plate file");
                    Ok(None)
                }
            },
        }
    }
}

/// Measures the shape of the plate from its scanned face. The corners are assigned by the u-axis hint of `spec` at the
/// first scan and by the `last` pose later; (u, v) refer to the outline of `baseline`.
///
/// # Errors
/// The reason why the plate was not measured.
pub fn measure_scanned(
    pipeline: &mut Pipeline,
    scanned: &Scanned,
    spec: &PlateSpec,
    last: Option<PreviousPose<'_>>,
    baseline: Baseline<'_>,
) -> Result<Measured, NotMeasured> {
    let start = Instant::now();
    let outline = match last {
        None => outline(&scanned.patch, spec)?,
        Some(last) => {
            let spec = PlateSpec { u_axis: Some(last.u_axis(pipeline.press_z)), ..spec.clone() };
            outline(&scanned.patch, &spec).map_err(|error| match error {
                OutlineError::Hint { angle_deg } => NotMeasured::Askew { angle_deg },
                other => other.into(),
            })?
        }
    };
    let outline_time = start.elapsed();
    let blank = baseline.blank(&scanned.patch, &outline, spec)?;
    let ordered = spec.rectangle();
    let cut = blank.as_ref().unwrap_or(&ordered);
    let measurement =
        measure(&scanned.patch, &outline, spec, cut, &mut pipeline.flattening, &mut || start.elapsed())?;
    match last.and_then(|last| reorientation(&measurement.surface, last.surface)) {
        Some(turned) => Err(NotMeasured::Turned(turned)),
        None => Ok(Measured { outline, blank, measurement, outline_time }),
    }
}

/// Runs the comparisons in the order of the plant file. A failed one leaves its error in its place.
pub fn compare(pipeline: &Pipeline, task: &Task, surfaces: Surfaces<'_>) -> Vec<Result<Report, PluginError>> {
    pipeline.comparisons.iter().map(|comparison| comparison.compare(task, surfaces)).collect()
}

/// Returns the verdict of the plate: the worst of those given. A failed comparison counts as `cannot_tell`, and so does
/// the absence of any judging comparison.
pub fn verdict(reports: &[Result<Report, PluginError>]) -> Verdict {
    let given = reports.iter().filter_map(|report| match report {
        Ok(report) => report.findings.verdict,
        Err(_) => Some(Verdict::CannotTell),
    });
    given.max().unwrap_or(Verdict::CannotTell)
}
