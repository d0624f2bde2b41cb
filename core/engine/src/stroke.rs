//! One stroke, as the data travels: scanner, plate, outline, surface, comparisons, verdict.
//!
//! ```text
//! columns -> Patch -> Outline -> Measurement (mid-surface, mesh, chart, S) -> Reports -> Verdict
//! ```
//! Each arrow is one function here, with one type on each side. Nothing travels back.

mod previous_pose;
mod scan_buffer;

pub use previous_pose::PreviousPose;
pub use scan_buffer::ScanBuffer;

use std::ops::ControlFlow;
use std::time::Instant;

use platen_model::{Task, Verdict};
use platen_scan::{ColumnError, ScanHeader, Window};
use platen_shape::extract::{Extractor, Refusal};
use platen_shape::measure::{MeasureError, measure};
use platen_shape::outline::{Outline, OutlineError, outline};
use platen_shape::{Blank, BlankError, Measured, Patch, PlateSpec, Reorientation, Scanned, reorientation};

use crate::pipeline::Pipeline;
use crate::plugin::{JobSpec, PluginError, ScanEvent, Scanner, Surfaces};
use platen_model::Report;

/// Why a stroke was not measured, by who must act.
#[derive(Debug, thiserror::Error)]
pub enum NotMeasured {
    /// The scanner gave no scan.
    #[error("scanner {0}")]
    Scanner(#[from] PluginError),
    /// The scanner's driver sent what is no lattice.
    #[error("scan: {0}; report this to the driver's author")]
    Column(#[from] ColumnError),
    /// The driver sent columns before it said what they are.
    #[error("scan: columns without a header; report this to the driver's author")]
    NoHeader,
    /// The plate was not found in the scan.
    #[error("scan: {0}")]
    Plate(#[from] Refusal),
    /// The plate's outline was not found.
    #[error("plate: {0}")]
    Outline(#[from] OutlineError),
    /// The plate lies another way than at the scan before.
    #[error(
        "plate: its nearest edge lies {angle_deg:.0} degrees from where u ran at the scan before; turn it back, or let the \
         press send plate_rot"
    )]
    Askew {
        /// Degrees.
        angle_deg: f64,
    },
    /// Its corners would be mistaken.
    #[error(
        "plate: it fits the scan before only when taken as turned {0}; turn it back, or let the press send plate_rot"
    )]
    Turned(Reorientation),
    /// The scan of the blank is that of another plate.
    #[error("baseline: {0}")]
    Blank(#[from] BlankError),
    /// The plate could not be flattened or fitted.
    #[error("plate: {0}")]
    Shape(#[from] MeasureError),
}

/// Scans; the plate is extracted while columns arrive. All that came goes to the buffer, when there is one.
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
    let mut extractor: Option<(ScanHeader, Extractor)> = None;
    let mut wrong: Option<NotMeasured> = None;
    let mut take = |event| match (event, &mut extractor) {
        (ScanEvent::Begin(header), _) => {
            if let Some(buffer) = buffer.as_deref_mut() {
                buffer.begin(header.clone());
            }
            extractor = Some((header.clone(), Extractor::new(&header, spec)));
            Ok(())
        }
        (ScanEvent::Column(column), Some((_, extractor))) => {
            extractor.push(&column)?;
            if let Some(buffer) = buffer.as_deref_mut() {
                buffer.push(column);
            }
            Ok(())
        }
        (ScanEvent::Column(_), None) => Err(NotMeasured::NoHeader),
    };
    let end = scanner.scan(job, window, &mut |event| match take(event) {
        Ok(()) => ControlFlow::Continue(()),
        Err(error) => {
            wrong = Some(error);
            ControlFlow::Break(())
        }
    });
    if let Some(error) = wrong {
        return Err(error);
    }
    let end = end?;
    if let Some(buffer) = buffer {
        buffer.end(end);
    }
    let (header, mut extractor) = extractor.ok_or(NotMeasured::NoHeader)?;
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

/// What is known of the outline that the plate was really cut with.
#[derive(Debug, Clone, Copy)]
pub enum Baseline<'a> {
    /// Nothing: it counts as the rectangle of its plate file.
    None,
    /// What an earlier scan of the blank told.
    Earlier(&'a Blank),
    /// What this scan tells: it is the blank's. Where it tells no outline, the log says why, and it counts as [`None`](Self::None).
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

/// From the plate's face to its shape. At its first scan the hint of `spec` tells its corners apart, later the way
/// that it lay at the `last` one. Its edges lie where the `baseline` tells.
///
/// # Errors
/// Why the plate was not measured.
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

/// What the comparisons found, in the plant's order. One that fails says so in its place and judges nothing.
pub fn compare(pipeline: &Pipeline, task: &Task, surfaces: Surfaces<'_>) -> Vec<Result<Report, PluginError>> {
    pipeline.comparisons.iter().map(|comparison| comparison.compare(task, surfaces)).collect()
}

/// The plate's verdict: the worst of those given. Nothing is good by default: a comparison that failed, or none that
/// judges, leaves `cannot_tell`.
pub fn verdict(reports: &[Result<Report, PluginError>]) -> Verdict {
    let given = reports.iter().filter_map(|report| match report {
        Ok(report) => report.findings.verdict,
        Err(_) => Some(Verdict::CannotTell),
    });
    given.max().unwrap_or(Verdict::CannotTell)
}
