//! Repeated measurement of recorded strokes from their kept scans, with the method of `platen measure`.
//!
//! A stroke is compared with the surfaces of the previous stroke and of the blank. Where their scans are kept, these
//! surfaces are measured again too; otherwise the recorded surfaces are used. The corner (0, 0) is continued from the
//! recorded pose. Each result is written to a folder of its own, together with its [`Inputs`]. If the folder already
//! has a result with the same inputs, nothing is measured.
//!
//! Limits: the plate file is the present file of the stroke's recipe, not the file at the time of the stroke. The
//! calibration is that of the plant file, unless it was too old at the time of the stroke.

mod comparison;
mod inputs;
mod part;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use platen_engine::calibration::{self, Calibration};
use platen_engine::pipeline::Pipeline;
use platen_engine::plugin::{Catalogue, Surfaces};
use platen_engine::stroke::{self, Baseline, NotMeasured, PreviousPose};
use platen_history::{Archive, Stroke};
use platen_model::Verdict;
use platen_plant::{PlantFile, PlateFile};
use platen_report::{history_view, output_folder};
use platen_shape::{Blank, Measured, Scanned, Surface};
use serde::{Deserialize, Serialize};

use crate::cli::{CliError, scan_file};
use crate::judgement::{self, Circumstances};
use crate::run::figures;
use crate::run::previous_scans::{Earlier, PreviousScans};
use crate::sha256;

pub(crate) use comparison::Difference;
use inputs::{Inputs, Origin, Setup};
pub(crate) use part::{Row, table};

/// Version of `remeasured.json`.
const SCHEMA: &str = "platen.remeasured/1";
/// File that is written last to the folder of a result: a result with it is complete.
const MARK: &str = "remeasured.json";

/// Result of a stroke that was measured again: `remeasured.json` beside the result's document.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Remeasured {
    schema: String,
    pub(crate) run_id: u32,
    /// Program and version.
    pub(crate) software: String,
    pub(crate) inputs: Inputs,
    pub(crate) verdict: Verdict,
    /// Reason of a missing measurement.
    pub(crate) reason: Option<String>,
    /// Figures as on record, in metres, radians and shares of one.
    pub(crate) figures: BTreeMap<String, f64>,
}

/// Outcome of a repeated measurement.
#[derive(Debug)]
pub(crate) enum Outcome {
    /// Measured now.
    Measured(Remeasured),
    /// Measured already, with the same inputs.
    Skipped(Remeasured),
    /// Its scan is not kept.
    NoScan,
}

/// Measures strokes of one record again. The caller passes one plate after the other, each with its strokes in their
/// order.
#[derive(Debug)]
pub(crate) struct Remeasurer<'a> {
    plant: &'a PlantFile,
    catalogue: &'a Catalogue,
    archive: &'a Archive,
    pipeline: Pipeline,
    setup: Setup,
    folder: &'a Path,
    /// Plate that the two caches belong to.
    plate: Option<u32>,
    scans: BTreeMap<u32, Option<KeptScan>>,
    surfaces: BTreeMap<u32, Rc<Reference>>,
}

#[derive(Debug, Clone)]
struct KeptScan {
    path: PathBuf,
    sha256: String,
}

/// Surface of an earlier scan.
#[derive(Debug)]
struct Reference {
    surface: Surface,
    blank: Option<Blank>,
}

/// Earlier surfaces of a stroke.
#[derive(Debug, Default)]
struct References {
    before: Option<Rc<Reference>>,
    baseline: Option<Rc<Reference>>,
}

impl<'a> Remeasurer<'a> {
    /// Loads the plugins of the plant. Results go into `folder`.
    ///
    /// # Errors
    /// A plugin cannot be used.
    pub(crate) fn new(
        plant: &'a PlantFile,
        catalogue: &'a Catalogue,
        archive: &'a Archive,
        folder: &'a Path,
    ) -> Result<Self, CliError> {
        let pipeline = Pipeline::of(plant, catalogue)?;
        let setup = Setup::of(plant, &pipeline)?;
        let (scans, surfaces) = (BTreeMap::new(), BTreeMap::new());
        Ok(Self { plant, catalogue, archive, pipeline, setup, folder, plate: None, scans, surfaces })
    }

    /// Measures one stroke, unless its result is there already.
    ///
    /// # Errors
    /// A file or a plugin fails; a stroke that cannot be measured gives a result with the reason.
    pub(crate) fn measure(&mut self, stroke: &Stroke) -> Result<Outcome, CliError> {
        if self.plate.replace(stroke.plate) != Some(stroke.plate) {
            self.scans.clear();
            self.surfaces.clear();
        }
        let Some(scan) = self.kept(stroke)? else { return Ok(Outcome::NoScan) };
        let plate_file = self.plate_file(stroke)?;
        let calibration = self.calibration(stroke);
        let inputs = Inputs {
            setup: self.setup.clone(),
            calibration: calibration.as_ref().map(|it| sha256::of_bytes(it.to_toml().as_bytes())),
            scan: scan.sha256.clone(),
            plate_file: file_digest(&plate_file)?,
            baseline: self.origin(self.archive.baseline(stroke.run_id)?)?,
            before: self.origin(self.archive.before(stroke.run_id)?)?,
        };
        let folder = result_folder(self.folder, stroke.run_id);
        if let Some(done) = read(&folder).filter(|done| done.inputs == inputs) {
            return Ok(Outcome::Skipped(done));
        }
        clear(&folder)?;
        let plate = PlateFile::load(&plate_file)?;
        let mut done = Remeasured {
            schema: SCHEMA.to_owned(),
            run_id: stroke.run_id,
            software: concat!("platen ", env!("CARGO_PKG_VERSION")).to_owned(),
            inputs,
            verdict: Verdict::NotMeasured,
            reason: None,
            figures: BTreeMap::new(),
        };
        let references = self.references(stroke)?;
        match self.shape(stroke, &scan, &plate, &references)? {
            Ok((scanned, measured)) => {
                self.judge(
                    stroke,
                    &plate,
                    calibration.as_ref(),
                    &references,
                    &scanned,
                    &measured,
                    &mut done,
                )?;
                let Measured { measurement, blank, .. } = measured;
                let reference = Reference { surface: measurement.surface, blank };
                self.surfaces.insert(stroke.run_id, Rc::new(reference));
            }
            Err(why) => {
                std::fs::create_dir_all(&folder).map_err(failed(&folder))?;
                done.reason = Some(why.to_string());
            }
        }
        let text = serde_json::to_vec_pretty(&done).map_err(|e| CliError::Failed(e.to_string()))?;
        output_folder::put(&folder, MARK, &text)?;
        Ok(Outcome::Measured(done))
    }

    /// Judges a measured stroke and writes its documents.
    #[expect(clippy::too_many_arguments, reason = "the parts of one stroke, each used once")]
    fn judge(
        &self,
        stroke: &Stroke,
        plate: &PlateFile,
        calibration: Option<&Calibration>,
        references: &References,
        scanned: &Scanned,
        measured: &Measured,
        done: &mut Remeasured,
    ) -> Result<(), CliError> {
        let earlier = PreviousScans::of(self.archive, stroke.run_id);
        let supports = earlier.last().and_then(|last| last.supports.as_deref());
        let surfaces = Surfaces {
            now: &measured.measurement.surface,
            before: references.before.as_ref().map(|it| &it.surface),
            baseline: references.baseline.as_ref().map(|it| &it.surface),
        };
        let circumstances = Circumstances {
            plant: self.plant,
            plate,
            calibration,
            scanner: None,
            stroke: Some(stroke.key.stroke.into()),
            supports_changed: history_view::supports_changed(supports, plate),
        };
        let judged = judgement::judge(&self.pipeline, scanned, measured, surfaces, circumstances);
        let source = self.pipeline.register_source.and_then(|place| judged.reports[place].as_ref().ok());
        let figures = figures::of_plate(measured, source, plate);
        done.figures =
            figures.values.iter().map(|(measure, value)| (measure.name().to_owned(), *value)).collect();
        done.verdict = judged.record.verdict;
        output_folder::write(&result_folder(self.folder, done.run_id), &judged.record, surfaces.now)?;
        Ok(())
    }

    /// Scans and measures the shape; the inner error is about the plate.
    fn shape(
        &mut self,
        stroke: &Stroke,
        scan: &KeptScan,
        plate: &PlateFile,
        references: &References,
    ) -> Result<Result<(Scanned, Measured), NotMeasured>, CliError> {
        let spec = self.pipeline.spec(plate);
        let scanned = match scan_file(self.catalogue, &scan.path, &spec)? {
            Ok(scanned) => scanned,
            Err(fault @ (NotMeasured::Scanner(_) | NotMeasured::Column(_))) => {
                return Err(CliError::Failed(format!("{}: {fault}", scan.path.display())));
            }
            Err(refusal) => return Ok(Err(refusal)),
        };
        let on_record = PreviousScans::of(self.archive, stroke.run_id);
        let fed_by = on_record
            .last()
            .and_then(|last| last.plate_rot.zip(stroke.press_data().plate_rot).map(|(then, now)| now - then));
        let measured_again =
            || references.before.as_ref().or(references.baseline.as_ref()).map(|it| &it.surface);
        let surface = on_record.last().map(|last| &last.surface).or_else(measured_again);
        let last = surface.map(|surface| PreviousPose { surface, fed_by });
        let blank = references.baseline.as_ref().and_then(|baseline| baseline.blank.as_ref());
        let baseline = match blank {
            _ if stroke.baseline => Baseline::This,
            Some(blank) => Baseline::Earlier(blank),
            None => Baseline::None,
        };
        let measured = stroke::measure_scanned(&mut self.pipeline, &scanned, &spec, last, baseline);
        Ok(measured.map(|measured| (scanned, measured)))
    }

    fn references(&mut self, stroke: &Stroke) -> Result<References, CliError> {
        let [before, baseline] = [self.archive.before(stroke.run_id)?, self.archive.baseline(stroke.run_id)?];
        let on_record = PreviousScans::of(self.archive, stroke.run_id);
        Ok(References {
            before: self.reference(before, on_record.before)?,
            baseline: self.reference(baseline, on_record.baseline)?,
        })
    }

    /// Returns the surface of an earlier stroke: measured again if possible, otherwise the recorded one.
    fn reference(
        &mut self,
        stroke: Option<Stroke>,
        on_record: Option<Earlier>,
    ) -> Result<Option<Rc<Reference>>, CliError> {
        let Some(stroke) = stroke else { return Ok(None) };
        if let Some(known) = self.surfaces.get(&stroke.run_id) {
            return Ok(Some(Rc::clone(known)));
        }
        let again = match self.kept(&stroke)? {
            Some(scan) => self.shape_alone(&stroke, &scan)?,
            None => None,
        };
        let old = || on_record.map(|old| Reference { surface: old.surface, blank: old.blank });
        let reference = again.or_else(old).map(Rc::new);
        if let Some(reference) = &reference {
            self.surfaces.insert(stroke.run_id, Rc::clone(reference));
        }
        Ok(reference)
    }

    /// Measures the shape of an earlier stroke that was not selected itself.
    fn shape_alone(&mut self, stroke: &Stroke, scan: &KeptScan) -> Result<Option<Reference>, CliError> {
        let plate = PlateFile::load(&self.plate_file(stroke)?)?;
        let baseline = match self.archive.baseline(stroke.run_id)? {
            Some(blank) if !stroke.baseline => {
                let on_record = PreviousScans::of(self.archive, stroke.run_id).baseline;
                self.reference(Some(blank), on_record)?
            }
            _ => None,
        };
        let shape = self.shape(stroke, scan, &plate, &References { before: None, baseline })?;
        let reference = |(_, measured): (Scanned, Measured)| Reference {
            surface: measured.measurement.surface,
            blank: measured.blank,
        };
        Ok(shape
            .map(reference)
            .inspect_err(|why| tracing::warn!("run {}: {why}; its surface on record is used", stroke.run_id))
            .ok())
    }

    /// Returns the kept scan of a stroke: beside its result, or at the place in the record.
    fn kept(&mut self, stroke: &Stroke) -> Result<Option<KeptScan>, CliError> {
        if let Some(known) = self.scans.get(&stroke.run_id) {
            return Ok(known.clone());
        }
        let beside = result_folder(&self.plant.output.folder, stroke.run_id).join(output_folder::SCAN);
        let path = [Some(beside), stroke.scan.clone()].into_iter().flatten().find(|path| path.is_file());
        let kept = path.map(|path| Ok::<_, CliError>(KeptScan { sha256: file_digest(&path)?, path }));
        let kept = kept.transpose()?;
        self.scans.insert(stroke.run_id, kept.clone());
        Ok(kept)
    }

    fn origin(&mut self, earlier: Option<Stroke>) -> Result<Option<Origin>, CliError> {
        let Some(earlier) = earlier else { return Ok(None) };
        if let Some(scan) = self.kept(&earlier)? {
            let plate_file = file_digest(&self.plate_file(&earlier)?)?;
            return Ok(Some(Origin::Scan { scan: scan.sha256, plate_file }));
        }
        let surface = earlier.document.map(|document| document.with_file_name(output_folder::SURFACE));
        let surface = surface.filter(|surface| surface.is_file());
        let digest = surface.map(|surface| file_digest(&surface)).transpose()?;
        Ok(digest.map(|surface| Origin::Record { surface }))
    }

    fn plate_file(&self, stroke: &Stroke) -> Result<PathBuf, CliError> {
        let recipe = stroke.recipe.ok_or_else(|| {
            CliError::Failed(format!(
                "run {}: the press named no recipe, so it has no plate file",
                stroke.run_id
            ))
        })?;
        Ok(self.plant.plate_path(recipe))
    }

    fn calibration(&self, stroke: &Stroke) -> Option<Calibration> {
        let wanted = self.plant.calibration.as_ref()?;
        // The record contains no warm-up of the scanner; the scanner counts as warm. A calibration made after the
        // stroke is valid: strokes are often measured again because of a new calibration.
        let made = Calibration::load(&wanted.file).map(|calibration| calibration.made).ok();
        let now = made.unwrap_or(stroke.accepted).max(stroke.accepted);
        let valid = calibration::in_force(wanted, now, wanted.warm_up);
        valid.inspect_err(|why| tracing::warn!("run {}: {why}", stroke.run_id)).ok()
    }
}

/// Returns the folder of a stroke's result.
pub(crate) fn result_folder(results: &Path, run_id: u32) -> PathBuf {
    results.join(format!("run-{run_id:06}"))
}

fn read(folder: &Path) -> Option<Remeasured> {
    let text = std::fs::read(folder.join(MARK)).ok()?;
    serde_json::from_slice(&text).ok().filter(|done: &Remeasured| done.schema == SCHEMA)
}

/// Removes a result with other inputs, and the remains of an interrupted run.
fn clear(folder: &Path) -> Result<(), CliError> {
    match std::fs::remove_dir_all(folder) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(failed(folder)(error)),
        _ => Ok(()),
    }
}

fn file_digest(path: &Path) -> Result<String, CliError> {
    sha256::of_file(path).map_err(failed(path))
}

fn failed(path: &Path) -> impl Fn(std::io::Error) -> CliError + '_ {
    move |error| CliError::Failed(format!("{}: {error}", path.display()))
}
