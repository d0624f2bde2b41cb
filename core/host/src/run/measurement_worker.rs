//! The bench: scans and measures one stroke at a time, on a thread of its own.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::Receiver;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use platen_history::History;
use platen_model::Measure;
use platen_model::{Code, Measurement, StrokeData, StrokeKey};
use platen_plant::press::Press;
use platen_plant::{PlantFile, PlateFile};
use platen_press::Answer;
use platen_scan::Window;
use platen_shape::{PlateSpec, Surface};
use tokio::sync::mpsc::UnboundedSender;

use super::previous_scans::PreviousScans;
use super::region::{self, Region};
use super::scan_retention::ScanRetention;
use super::{Watcher, figures};
use platen_engine::pipeline::{self, Pipeline};
use platen_engine::plugin::{CancelToken, Catalogue, JobSpec, PluginError, Scanner, Surfaces};
use platen_engine::stroke::{self, Baseline, NotMeasured, PreviousPose, ScanBuffer};
use platen_engine::{calibration, calibration::Calibration};
use platen_model::Report;
use platen_report::result::{Context, ResultRecord};
use platen_report::{history_view, output_folder, plate_report};
use platen_shape::Scanned;

/// Longest scan of a driver that gives no estimate: a full dome takes minutes.
const SCAN_LIMIT: Duration = Duration::from_secs(900);
/// A scan is given at least this long, whatever its driver estimates: networks stall, computers are busy.
const LEAST_ESTIMATE: Duration = Duration::from_secs(10);
/// Time for a scanner to connect.
const OPEN_LIMIT: Duration = Duration::from_secs(60);
/// Time between two tries to reach a scanner.
const RETRY: Duration = Duration::from_secs(2);

/// What the bench is asked.
#[derive(Debug)]
pub(super) enum Task {
    /// Scan this stroke.
    Scan { key: StrokeKey, run_id: u32, data: Box<StrokeData>, token: CancelToken },
    /// Judge the stroke that was scanned last.
    Evaluate(StrokeKey),
}

/// One stroke as it ended, for those who watch.
#[derive(Debug, Clone)]
pub struct StrokeReport {
    /// The stroke.
    pub key: StrokeKey,
    /// A scan of the blank.
    pub baseline: bool,
    /// Its result document, or why there is none.
    pub result: Result<Box<ResultRecord>, String>,
    /// Folder of its files.
    pub folder: Option<PathBuf>,
    /// From the order to the verdict.
    pub elapsed: Duration,
}

/// A stroke between its scan and its result.
#[derive(Debug)]
struct ActiveStroke {
    key: StrokeKey,
    run_id: u32,
    data: Box<StrokeData>,
    plate: PlateFile,
    scanned: Scanned,
    buffer: Option<ScanBuffer>,
    started: Instant,
    scanned_at: jiff::Timestamp,
}

/// A stroke with all that was found out about it.
struct Judged {
    answer: Measurement,
    record: ResultRecord,
    surface: Surface,
    reports: Vec<Result<Report, PluginError>>,
    /// Folder of its files, where they could be written.
    folder: Option<PathBuf>,
}

/// Scans and measures.
#[derive(Debug)]
pub(super) struct MeasurementWorker {
    plant: PlantFile,
    catalogue: Catalogue,
    rig: Pipeline,
    scanner: Option<Scanner>,
    region: Region,
    /// How long a scan of the base window takes; `None` for a driver that does not plan its scans.
    estimate: Option<Duration>,
    /// Since when the scanner has been in reach.
    in_reach: Option<Instant>,
    /// What the press side was told last about being ready to scan.
    told: Option<Result<(), Code>>,
    scan_limit: Option<Duration>,
    history: Arc<Mutex<History>>,
    archive: ScanRetention,
    ends: Ends,
    active: Option<ActiveStroke>,
}

/// Those who hear of the bench's work.
#[derive(Debug)]
pub(super) struct Ends {
    /// The press side.
    pub(super) answers: UnboundedSender<Answer>,
    /// Who watches each stroke.
    pub(super) watcher: Option<Watcher>,
    /// How many strokes' documents could not be written.
    pub(super) lost: Arc<AtomicU64>,
}

impl MeasurementWorker {
    pub(super) fn new(
        plant: &PlantFile,
        catalogue: &Catalogue,
        rig: Pipeline,
        press: &Press,
        history: Arc<Mutex<History>>,
        ends: Ends,
    ) -> Self {
        Self {
            plant: plant.clone(),
            catalogue: catalogue.clone(),
            region: Region::new(plant.scan_window, rig.region.as_ref()),
            estimate: None,
            rig,
            scanner: None,
            in_reach: None,
            told: None,
            scan_limit: press.timeouts.scan,
            history,
            archive: ScanRetention::start(&plant.output),
            ends,
            active: None,
        }
    }

    /// Works until the dispatcher lets go, or a plugin hangs.
    pub(super) fn serve(mut self, tasks: &Receiver<Task>) {
        loop {
            if self.scanner.is_none() {
                self.connect();
            }
            self.tell_ready();
            let task = match (&self.scanner, tasks.recv_timeout(RETRY)) {
                (_, Ok(task)) => task,
                (_, Err(std::sync::mpsc::RecvTimeoutError::Timeout)) => continue,
                (_, Err(std::sync::mpsc::RecvTimeoutError::Disconnected)) => return,
            };
            let hung = match task {
                Task::Scan { key, run_id, data, token } => self.scan(key, run_id, data, token),
                Task::Evaluate(key) => self.evaluate(key),
            };
            if hung {
                return;
            }
        }
    }

    fn say(&self, answer: Answer) {
        // A press side that ended needs no answer.
        let _ = self.ends.answers.send(answer);
    }

    fn connect(&mut self) {
        let scanner =
            pipeline::scanner(&self.plant, &self.catalogue).map_err(|e| e.to_string()).and_then(|scanner| {
                scanner.instance().open(OPEN_LIMIT).map_err(|e| e.to_string())?;
                let estimate = scanner.estimate(self.region.base(), OPEN_LIMIT).map_err(|e| e.to_string())?;
                Ok((scanner, estimate))
            });
        match scanner {
            Ok((scanner, estimate)) => {
                tracing::info!(?estimate, window = ?self.region.base(), "scanner in reach");
                self.scanner = Some(scanner);
                self.estimate = estimate;
                self.in_reach.get_or_insert_with(Instant::now);
            }
            Err(why) => {
                tracing::error!("scanner: {why}");
                self.in_reach = None;
                self.told = Some(Err(Code::ScannerNotReady));
                self.say(Answer::Scanner { ready: Err(Code::ScannerNotReady), estimate: None });
            }
        }
    }

    /// What is known of the scanner; `None` where the plant names no calibration.
    fn calibration(&self) -> Result<Option<Calibration>, calibration::Invalid> {
        let in_reach = self.in_reach.map_or(Duration::ZERO, |since| since.elapsed());
        let wanted = self.plant.calibration.as_ref();
        wanted.map(|wanted| calibration::in_force(wanted, jiff::Timestamp::now(), in_reach)).transpose()
    }

    /// Tells the press side whether strokes can be measured, when that changed: a scanner in reach whose calibration
    /// does not hold measures nothing that could be judged.
    fn tell_ready(&mut self) {
        if self.in_reach.is_none() {
            return;
        }
        let found = self.calibration();
        let ready = found.as_ref().map(|_| ()).map_err(|_| Code::CalibrationInvalid);
        if self.told == Some(ready) {
            return;
        }
        match found {
            Ok(_) => tracing::info!("scanner ready"),
            Err(why) => tracing::error!("{why}"),
        }
        self.told = Some(ready);
        // A plate that has moved out of its window is scanned twice.
        let estimate = self.estimate.map(|estimate| (2 * estimate).max(LEAST_ESTIMATE));
        self.say(Answer::Scanner { ready, estimate });
    }

    /// True when a plugin hangs.
    fn scan(&mut self, key: StrokeKey, run_id: u32, data: Box<StrokeData>, token: CancelToken) -> bool {
        let started = Instant::now();
        self.active = None;
        let mut buffer = self.archive.buffer();
        let scanned = self.plate(&data).and_then(|plate| {
            let spec = self.rig.spec(&plate);
            let scanner =
                self.scanner.as_ref().ok_or((Code::ScannerNotReady, "not connected".to_owned(), false))?;
            let limit = self.scan_limit.unwrap_or(SCAN_LIMIT);
            let job = JobSpec { stroke: u64::from(key.stroke), trigger: started, limit, cancel: token };
            let window = self.quicker(scanner).filter(|_| !data.baseline);
            let scanned = self.acquire(scanner, job, window, &spec, &mut buffer).map_err(|e| refusal(&e))?;
            Ok((plate, scanned))
        });
        match scanned {
            Ok((plate, scanned)) => {
                let scanned_at = jiff::Timestamp::now();
                self.active =
                    Some(ActiveStroke { key, run_id, data, plate, scanned, buffer, started, scanned_at });
                self.say(Answer::Acquired(key));
                false
            }
            Err((code, why, hung)) => {
                if matches!(code, Code::ScanFailed | Code::ScannerNotReady) {
                    self.scanner = None;
                }
                let found_no_plate = matches!(code, Code::PlateNotFound);
                self.fail(key, data.baseline, code, why, started);
                self.archive.keep(self.folder(run_id), buffer.filter(|_| found_no_plate));
                hung
            }
        }
    }

    /// Scans in the window where the plate lay at the stroke before, if there is one, else in the base window. A plate
    /// that has moved out of its window is scanned again in the base window.
    fn acquire(
        &self,
        scanner: &Scanner,
        job: JobSpec,
        window: Option<&Window>,
        spec: &PlateSpec,
        buffer: &mut Option<ScanBuffer>,
    ) -> Result<Scanned, NotMeasured> {
        let start = Instant::now();
        if let Some(window) = window {
            let why = match stroke::scan(scanner, job.clone(), Some(window), spec, buffer.as_mut()) {
                Ok(scanned) if !region::is_cut_off(&scanned) => return Ok(scanned),
                Ok(_) => "it reaches the border of the window".to_owned(),
                Err(NotMeasured::Plate(refusal)) => refusal.to_string(),
                Err(error) => return Err(error),
            };
            let stroke = job.stroke;
            tracing::warn!(
                stroke,
                "the plate is not where it was at the stroke before: {why}; scanning everything once"
            );
            *buffer = self.archive.buffer();
        }
        // Only a driver that plans its scans is told where to look: one that hands over files has all in them.
        let base = self.region.base().filter(|_| self.estimate.is_some());
        let limit = job.limit.saturating_sub(start.elapsed());
        let mut scanned = stroke::scan(scanner, JobSpec { limit, ..job }, base, spec, buffer.as_mut())?;
        scanned.acquire = start.elapsed() - scanned.extract;
        Ok(scanned)
    }

    /// The window round the last stroke's plate, when a scan of it takes less time.
    fn quicker(&self, scanner: &Scanner) -> Option<&Window> {
        let window = self.region.plate()?;
        let takes = scanner.estimate(Some(window), OPEN_LIMIT).ok()??;
        (takes < self.estimate?).then_some(window)
    }

    fn fail(&self, key: StrokeKey, baseline: bool, code: Code, why: String, started: Instant) {
        tracing::error!(%key, code = code.number(), "not measured: {why}");
        self.say(Answer::Failed(key, code));
        self.report(StrokeReport {
            key,
            baseline,
            result: Err(why),
            folder: None,
            elapsed: started.elapsed(),
        });
    }

    fn report(&self, report: StrokeReport) {
        if let Some(watcher) = &self.ends.watcher {
            // A watcher that went away needs no report.
            let _ = watcher.strokes.send(report);
        }
    }

    /// The plate file of the stroke's recipe.
    fn plate(&self, data: &StrokeData) -> Result<PlateFile, (Code, String, bool)> {
        let unknown = |why: String| (Code::RecipeUnknown, why, false);
        let recipe = data.recipe_id.ok_or_else(|| unknown("the press names no recipe".into()))?;
        PlateFile::load(&self.plant.plate_path(recipe)).map_err(|e| unknown(format!("recipe {recipe}: {e}")))
    }

    /// True when a plugin hangs.
    fn evaluate(&mut self, key: StrokeKey) -> bool {
        let Some(mut stroke) = self.active.take().filter(|stroke| stroke.key == key) else {
            self.fail(key, false, Code::Interrupted, "its scan is gone".into(), Instant::now());
            return false;
        };
        let start = Instant::now();
        let (baseline, started) = (stroke.data.baseline, stroke.started);
        let (folder, buffer) = (self.folder(stroke.run_id), stroke.buffer.take());
        let hung = match self.measure(&stroke, start) {
            Ok(Judged { answer, record, surface, reports, folder }) => {
                self.say(Answer::Result(key, Box::new(answer)));
                let elapsed = started.elapsed();
                // The press waits for its answer, not for pictures.
                if let Some(folder) = &folder {
                    self.illustrate(&stroke, folder, &record, &surface, &reports);
                }
                self.report(StrokeReport { key, baseline, result: Ok(Box::new(record)), folder, elapsed });
                false
            }
            Err(error) => {
                let (code, why, hung) = refusal(&error);
                self.fail(key, baseline, code, why, started);
                hung
            }
        };
        self.archive.keep(folder, buffer);
        hung
    }

    /// Where the files of a stroke go.
    fn folder(&self, run_id: u32) -> PathBuf {
        self.plant.output.folder.join(format!("run-{run_id:06}"))
    }

    /// From the plate's face to the result and its files.
    fn measure(&mut self, stroke: &ActiveStroke, start: Instant) -> Result<Judged, NotMeasured> {
        let spec = self.rig.spec(&stroke.plate);
        let earlier = PreviousScans::of(self.history().archive(), stroke.run_id);
        let last = earlier.last().map(|last| PreviousPose {
            surface: &last.surface,
            fed_by: last.plate_rot.zip(stroke.data.plate_rot).map(|(then, now)| now - then),
        });
        let blank = earlier.baseline.as_ref().and_then(|baseline| baseline.blank.as_ref());
        let baseline = match blank {
            _ if stroke.data.baseline => Baseline::This,
            Some(blank) => Baseline::Earlier(blank),
            None => Baseline::None,
        };
        let measured = stroke::measure_scanned(&mut self.rig, &stroke.scanned, &spec, last, baseline)?;
        self.region.saw(&measured.outline);
        let surfaces = Surfaces {
            now: &measured.measurement.surface,
            before: earlier.before.as_ref().map(|before| &before.surface),
            baseline: earlier.baseline.as_ref().map(|baseline| &baseline.surface),
        };
        let comparing = Instant::now();
        let calibration = self.calibration().ok().flatten();
        let supports = earlier.last().and_then(|last| last.supports.as_deref());
        let task = Calibration::task(
            calibration.as_ref(),
            &stroke.plate,
            history_view::moved(supports, &stroke.plate),
        );
        let reports = stroke::compare(&self.rig, &task, surfaces);
        let compare = comparing.elapsed();
        let verdict = stroke::verdict(&reports);
        let context = Context {
            plate: &stroke.plate,
            task: &task,
            press: self.rig.press,
            stroke: Some(u64::from(stroke.key.stroke)),
            verdict,
            reports: &reports,
            compare,
        };
        let record = ResultRecord::new(&stroke.scanned, &measured, context);
        let folder = self.keep(stroke, &record, &measured.measurement.surface);
        let times = [
            (Measure::ScanTime, stroke.scanned.acquire + stroke.scanned.extract),
            (Measure::EvaluateTime, start.elapsed()),
            (Measure::StrokeToResultTime, stroke.started.elapsed()),
        ];
        let mut answer =
            figures::measurement(&measured, &reports, verdict, &stroke.plate, times, stroke.scanned_at);
        // A result whose files are lost still goes to the press, and says so.
        answer.warning = folder.is_none().then_some(Code::StorageDegraded);
        Ok(Judged { answer, record, surface: measured.measurement.surface, reports, folder })
    }

    fn history(&self) -> MutexGuard<'_, History> {
        self.history.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Writes the documents and notes where they lie. A full disk costs the record, not the result.
    fn keep(&mut self, stroke: &ActiveStroke, record: &ResultRecord, surface: &Surface) -> Option<PathBuf> {
        let folder = self.folder(stroke.run_id);
        let written =
            output_folder::write(&folder, record, surface).map_err(|e| e.to_string()).and_then(|_| {
                let document = folder.join("result.json");
                self.history().attach_document(stroke.run_id, &document).map_err(|e| e.to_string())
            });
        match written {
            Ok(()) => Some(folder),
            Err(why) => {
                self.ends.lost.fetch_add(1, Ordering::Relaxed);
                tracing::error!(key = %stroke.key, "the record is lost: {why}");
                None
            }
        }
    }

    /// Pictures, table and mesh beside the documents, and the plate's report. All can be made again: losing them is no
    /// fault of the stroke.
    fn illustrate(
        &self,
        stroke: &ActiveStroke,
        folder: &Path,
        record: &ResultRecord,
        surface: &Surface,
        reports: &[Result<Report, PluginError>],
    ) {
        let sound: Vec<&Report> = reports.iter().flatten().collect();
        let draw = || -> Result<(), Box<dyn std::error::Error>> {
            // A reader of its own: the journal must never wait for a picture.
            let archive = platen_history::Archive::open(&self.plant.output.history)?;
            let strokes = history_view::strokes_until(&archive, stroke.run_id, record)?;
            output_folder::illustrate(folder, record, surface, &sound, &strokes)?;
            let plate = archive.stroke(stroke.run_id)?.plate;
            plate_report::write(&archive, &self.plant.name, plate, &self.plant.output.folder)?;
            Ok(())
        };
        if let Err(why) = draw() {
            tracing::warn!(key = %stroke.key, "pictures or report are missing: {why}");
        }
    }
}

/// Code for the press, sentence for people, and whether a plugin hangs.
fn refusal(error: &NotMeasured) -> (Code, String, bool) {
    let hung = matches!(error, NotMeasured::Scanner(PluginError::Hangs { .. }));
    let code = match error {
        NotMeasured::Scanner(PluginError::Stopped { .. }) => Code::ScanTimeout,
        NotMeasured::Scanner(_) | NotMeasured::Column(_) | NotMeasured::NoHeader => Code::ScanFailed,
        NotMeasured::Plate(_) => Code::PlateNotFound,
        NotMeasured::Askew { .. } | NotMeasured::Turned(_) => Code::PlateTurned,
        NotMeasured::Outline(_) | NotMeasured::Blank(_) | NotMeasured::Shape(_) => Code::EvaluationFailed,
    };
    (code, error.to_string(), hung)
}
