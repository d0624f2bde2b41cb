//! Measurement worker of `platen run`: scans and measures one stroke at a time, on a thread of its own.
//!
//! 1. Scan, in the window of the last stroke or else in the base window.
//! 2. Evaluation: measurement, comparisons, verdict, documents, answer to the press.
//! 3. Pictures and report.
//!
//! Between strokes the worker connects to the scanner and reports readiness to the press side.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU8, AtomicU64, Ordering};
use std::sync::mpsc::Receiver;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use platen_engine::calibration::{self, Calibration};
use platen_engine::pipeline::{self, Pipeline, PipelineError};
use platen_engine::plugin::{CancelToken, Catalogue, JobSpec, PluginError, ProgressSink, Scanner, Surfaces};
use platen_engine::stroke::{self, Baseline, NotMeasured, PreviousPose, ScanBuffer};
use platen_history::History;
use platen_model::{Code, Measure, Measurement, Report, StrokeData, StrokeKey, Task};
use platen_plant::press::Press;
use platen_plant::{PlantFile, PlateFile};
use platen_press::{Answer, Command};
use platen_report::result::ResultRecord;
use platen_report::{history_view, output_folder, plate_report};
use platen_scan::Window;
use platen_shape::{PlateSpec, Scanned, Surface};
use tokio::sync::mpsc::UnboundedSender;

use super::advice::{AdviceDesk, AdviceJob};
use super::clock::Clock;
use super::figures;
use super::plugin_status::{PluginStates, PluginStatus};
use super::previous_scans::PreviousScans;
use super::region::{self, Region};
use super::scan_retention::ScanRetention;
use super::scan_store;
use super::screen::{Event, EventSender, MeasuredStroke};
use crate::judgement::{self, Circumstances, Judgement};
use crate::plate_history::MeasuredPlate;

/// Deadline of a scan without an estimate of its driver: a full dome takes minutes.
const SCAN_LIMIT: Duration = Duration::from_secs(900);
/// Smallest estimate passed to the press side, as networks may stall and computers be busy.
const LEAST_ESTIMATE: Duration = Duration::from_secs(10);
/// Deadline for a scanner to connect.
const OPEN_LIMIT: Duration = Duration::from_secs(60);
/// Time between two attempts to connect to a scanner.
const RETRY: Duration = Duration::from_secs(2);

/// Outcome of one stroke, for the observer of a running host.
#[derive(Debug, Clone)]
pub struct StrokeReport {
    /// The stroke.
    pub key: StrokeKey,
    /// The stroke is a scan of the blank.
    pub baseline: bool,
    /// Its result document, or the reason why there is none.
    pub result: Result<Box<ResultRecord>, String>,
    /// Folder of its files.
    pub folder: Option<PathBuf>,
    /// Time from the order to the verdict.
    pub elapsed: Duration,
}

/// Stroke between its scan and its result.
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

struct JudgedStroke {
    answer: Measurement,
    record: ResultRecord,
    surface: Surface,
    reports: Vec<Result<Report, PluginError>>,
    task: Task,
    /// Folder of its files; `None` when they could not be written.
    folder: Option<PathBuf>,
}

#[derive(Debug)]
pub(super) struct MeasurementWorker {
    plant: PlantFile,
    catalogue: Catalogue,
    pipeline: Pipeline,
    /// Driver, once it has been created.
    scanner: Option<Scanner>,
    connected: bool,
    region: Region,
    /// Duration of a scan of the base window; `None` for a driver without scan planning.
    estimate: Option<Duration>,
    /// Time at which the scanner was connected.
    in_reach: Option<Instant>,
    /// Readiness as last reported to the press side.
    reported: Option<Result<(), Code>>,
    scan_limit: Option<Duration>,
    history: Arc<Mutex<History>>,
    archive: ScanRetention,
    receivers: Receivers,
    active: Option<ActiveStroke>,
}

#[derive(Debug)]
pub(super) struct Receivers {
    pub(super) answers: UnboundedSender<Answer>,
    pub(super) strokes: UnboundedSender<StrokeReport>,
    /// Number of strokes whose documents could not be written.
    pub(super) lost: Arc<AtomicU64>,
    pub(super) screen: EventSender,
    pub(super) plugins: PluginStates,
    pub(super) clock: Clock,
    pub(super) advice: AdviceDesk,
}

impl MeasurementWorker {
    pub(super) fn new(
        plant: &PlantFile,
        catalogue: &Catalogue,
        pipeline: Pipeline,
        press: &Press,
        history: Arc<Mutex<History>>,
        receivers: Receivers,
    ) -> Self {
        Self {
            plant: plant.clone(),
            catalogue: catalogue.clone(),
            region: Region::new(plant.scan_window, pipeline.region.as_ref()),
            estimate: None,
            pipeline,
            scanner: None,
            connected: false,
            in_reach: None,
            reported: None,
            scan_limit: press.timeouts.scan,
            archive: ScanRetention::start(
                &plant.output,
                Arc::clone(&history),
                scan_store::start(plant, Arc::clone(&history)),
            ),
            history,
            receivers,
            active: None,
        }
    }

    /// Executes commands until the dispatcher closes the channel.
    pub(super) fn serve(mut self, commands: &Receiver<(Command, CancelToken)>) {
        loop {
            self.look_after_scanner();
            self.report_readiness();
            self.report_plugins();
            let (command, token) = match commands.recv_timeout(RETRY) {
                Ok(command) => command,
                Err(std::sync::mpsc::RecvTimeoutError::Timeout) => continue,
                Err(std::sync::mpsc::RecvTimeoutError::Disconnected) => return,
            };
            match command {
                Command::Scan { key, run_id, data } => self.scan(key, run_id, data, token),
                Command::Evaluate(key) => self.evaluate(key),
                // Executed by the dispatcher.
                Command::Cancel(_) | Command::PartEnd => {}
            }
        }
    }

    fn answer(&self, answer: Answer) {
        if let Answer::Scanner { ready, estimate } = &answer {
            let estimate_s = estimate.map(|time| time.as_secs_f64());
            self.receivers.screen.send(Event::Scanner { ready: *ready, estimate_s });
        }
        // The press side may have ended.
        let _ = self.receivers.answers.send(answer);
    }

    /// Connects to the scanner if it is not connected; otherwise checks that its driver still runs.
    fn look_after_scanner(&mut self) {
        if let Some(scanner) = self.scanner.as_ref().filter(|_| self.connected)
            && let Err(why) = scanner.instance().check()
        {
            tracing::error!("scanner: {why}");
            self.connected = false;
        }
        if self.connected {
            return;
        }
        match self.connect() {
            Ok(()) => {
                tracing::info!(estimate = ?self.estimate, window = ?self.region.base, "scanner in reach");
                self.connected = true;
                self.in_reach.get_or_insert_with(Instant::now);
            }
            Err(why) => {
                tracing::error!("scanner: {why}");
                self.in_reach = None;
                let out_of_use = matches!(why, PipelineError::Plugin(PluginError::Quarantined { .. }));
                self.report_ready(Err(if out_of_use { Code::PluginOutOfUse } else { Code::ScannerNotReady }));
            }
        }
    }

    fn connect(&mut self) -> Result<(), PipelineError> {
        let scanner = match self.scanner.take() {
            Some(scanner) => scanner,
            None => pipeline::scanner(&self.plant, &self.catalogue)?,
        };
        let scanner = self.scanner.insert(scanner);
        scanner.instance().open(OPEN_LIMIT)?;
        self.estimate = scanner.estimate(self.region.base.as_ref(), OPEN_LIMIT)?;
        Ok(())
    }

    /// Returns the valid calibration; `None` where the plant file has none.
    fn calibration(&self) -> Result<Option<Calibration>, calibration::Invalid> {
        let in_reach = self.in_reach.map_or(Duration::ZERO, |since| since.elapsed());
        let wanted = self.plant.calibration.as_ref();
        wanted.map(|wanted| calibration::in_force(wanted, jiff::Timestamp::now(), in_reach)).transpose()
    }

    /// Reports to the press side whether strokes can be measured, if that has changed. Without a valid calibration a
    /// measurement cannot be judged; without its plugins it cannot be made.
    fn report_readiness(&mut self) {
        if self.in_reach.is_none() {
            return;
        }
        let plugins = self.pipeline.revive().map_err(|why| (Code::PluginOutOfUse, why.to_string()));
        let found = plugins.and_then(|()| {
            self.calibration().map(drop).map_err(|why| (Code::CalibrationInvalid, why.to_string()))
        });
        let ready = found.as_ref().copied().map_err(|(code, _)| *code);
        if self.reported == Some(ready) {
            return;
        }
        match &found {
            Ok(()) => tracing::info!("scanner ready"),
            Err((_, why)) => tracing::error!("{why}"),
        }
        self.report_ready(ready);
    }

    fn report_plugins(&self) {
        let scanner = self.scanner.iter().map(Scanner::instance);
        let mut states: Vec<PluginStatus> =
            scanner.chain(self.pipeline.instances()).filter_map(PluginStatus::of).collect();
        // A driver that does not report a state is not at fault; one that does not answer is found by the next check
        // after it.
        let scanner = self.scanner.as_ref().filter(|_| self.connected);
        let health = scanner.and_then(|scanner| scanner.instance().health().ok().flatten());
        if let (Some(state), Some(health)) = (states.first_mut(), health) {
            state.instrument = Some(health.into());
        }
        *self.receivers.plugins.lock().unwrap_or_else(PoisonError::into_inner) = states;
    }

    fn report_ready(&mut self, ready: Result<(), Code>) {
        self.reported = Some(ready);
        // A plate that has moved out of its window is scanned twice.
        let estimate = self.estimate.map(|estimate| (2 * estimate).max(LEAST_ESTIMATE));
        self.answer(Answer::Scanner { ready, estimate: estimate.filter(|_| self.connected) });
    }

    fn scan(&mut self, key: StrokeKey, run_id: u32, data: Box<StrokeData>, token: CancelToken) {
        let started = Instant::now();
        self.active = None;
        self.pipeline.instances().for_each(|plugin| plugin.at_stroke(u64::from(key.stroke)));
        let mut buffer = self.archive.buffer();
        let scanned = self.plate(&data).and_then(|plate| {
            let spec = self.pipeline.spec(&plate);
            let scanner = self.scanner.as_ref().filter(|_| self.connected);
            let scanner = scanner.ok_or((Code::ScannerNotReady, "not connected".to_owned()))?;
            let limit = self.scan_limit.unwrap_or(SCAN_LIMIT);
            let progress = self.shown_progress(key);
            let job =
                JobSpec { stroke: u64::from(key.stroke), trigger: started, limit, cancel: token, progress };
            let window = self.quicker(scanner).filter(|_| !data.baseline);
            let scanned = self.acquire(scanner, job, window, &spec, &mut buffer).map_err(|e| refusal(&e))?;
            Ok((plate, scanned))
        });
        match scanned {
            Ok((plate, scanned)) => {
                let scanned_at = jiff::Timestamp::now();
                self.active =
                    Some(ActiveStroke { key, run_id, data, plate, scanned, buffer, started, scanned_at });
                self.answer(Answer::Acquired(key));
            }
            Err((code, why)) => {
                if matches!(code, Code::ScanFailed | Code::ScannerNotReady | Code::ScanTimeout) {
                    self.connected = false;
                }
                let found_no_plate = matches!(code, Code::PlateNotFound);
                self.fail(key, data.baseline, code, why, started);
                self.archive.keep(run_id, self.folder(run_id), buffer.filter(|_| found_no_plate));
            }
        }
    }

    /// Returns a receiver that forwards a scan's progress to the pages, percent by percent.
    fn shown_progress(&self, key: StrokeKey) -> ProgressSink {
        if !self.receivers.screen.is_connected() {
            return ProgressSink::default();
        }
        let (screen, shown) = (self.receivers.screen.clone(), AtomicU8::new(u8::MAX));
        ProgressSink::new(move |share, _| {
            let percent = (100.0 * share) as u8;
            if shown.swap(percent, Ordering::Relaxed) != percent {
                screen.send(Event::Scanned { key, percent });
            }
        })
    }

    /// Scans in the window of the last stroke's plate if there is one, else in the base window. If the plate has moved
    /// out of its window, the scan is repeated in the base window.
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
        // Only a driver with scan planning receives a window: a file contains the whole scan.
        let base = self.region.base.as_ref().filter(|_| self.estimate.is_some());
        let limit = job.limit.saturating_sub(start.elapsed());
        let mut scanned = stroke::scan(scanner, JobSpec { limit, ..job }, base, spec, buffer.as_mut())?;
        scanned.acquire = start.elapsed() - scanned.extract;
        Ok(scanned)
    }

    /// Returns the window round the last stroke's plate if a scan of it takes less time.
    fn quicker(&self, scanner: &Scanner) -> Option<&Window> {
        let window = self.region.plate.as_ref()?;
        let takes = scanner.estimate(Some(window), OPEN_LIMIT).ok()??;
        (takes < self.estimate?).then_some(window)
    }

    fn fail(&self, key: StrokeKey, baseline: bool, code: Code, why: String, started: Instant) {
        tracing::error!(%key, code = code.number(), "not measured: {why}");
        self.answer(Answer::Failed(key, code));
        let elapsed = started.elapsed();
        self.report(StrokeReport { key, baseline, result: Err(why), folder: None, elapsed });
    }

    fn report(&self, report: StrokeReport) {
        // The observer may have ended.
        let _ = self.receivers.strokes.send(report);
    }

    /// Loads the plate file of the stroke's recipe.
    fn plate(&self, data: &StrokeData) -> Result<PlateFile, (Code, String)> {
        let unknown = |why: String| (Code::RecipeUnknown, why);
        let recipe = data.recipe_id.ok_or_else(|| unknown("the press names no recipe".into()))?;
        PlateFile::load(&self.plant.plate_path(recipe)).map_err(|e| unknown(format!("recipe {recipe}: {e}")))
    }

    fn evaluate(&mut self, key: StrokeKey) {
        let Some(mut stroke) = self.active.take().filter(|stroke| stroke.key == key) else {
            self.fail(key, false, Code::Interrupted, "its scan is gone".into(), Instant::now());
            return;
        };
        let start = Instant::now();
        let (baseline, started) = (stroke.data.baseline, stroke.started);
        let (folder, buffer) = (self.folder(stroke.run_id), stroke.buffer.take());
        match self.measure(&stroke, start) {
            Ok(JudgedStroke { answer, record, surface, reports, task, folder }) => {
                self.answer(Answer::Result(key, Box::new(answer)));
                let elapsed = started.elapsed();
                self.ask_for_advice(&stroke, &task, &surface, &reports, folder.as_deref());
                self.show(stroke.run_id, &record, &reports);
                // The press waits for its answer, but not for pictures.
                if let Some(folder) = &folder {
                    self.illustrate(&stroke, folder, &record, &surface, &reports);
                }
                self.report(StrokeReport { key, baseline, result: Ok(Box::new(record)), folder, elapsed });
            }
            Err(error) => {
                let (code, why) = refusal(&error);
                self.fail(key, baseline, code, why, started);
            }
        }
        self.archive.keep(stroke.run_id, folder, buffer);
    }

    /// Passes a result on to the pages if they are served.
    fn show(&self, run_id: u32, record: &ResultRecord, reports: &[Result<Report, PluginError>]) {
        if !self.receivers.screen.is_connected() {
            return;
        }
        let sound: Vec<&Report> = reports.iter().flatten().collect();
        let strokes = platen_history::Archive::open(&self.plant.output.history)
            .and_then(|archive| history_view::strokes_until(&archive, run_id, record));
        let strokes = strokes.unwrap_or_else(|why| {
            tracing::warn!(run_id, "the screen shows no strokes before this one: {why}");
            Vec::new()
        });
        let measured = MeasuredStroke::new(run_id, record, &sound, strokes);
        self.receivers.screen.send(Event::Measured(Box::new(measured)));
    }

    /// Passes a result to the advisor if there is one. Trials are not used for learning, and a result without files has
    /// no place for advice.
    fn ask_for_advice(
        &self,
        stroke: &ActiveStroke,
        task: &Task,
        surface: &Surface,
        reports: &[Result<Report, PluginError>],
        folder: Option<&Path>,
    ) {
        let Some(folder) = folder.filter(|_| self.receivers.advice.is_open() && !stroke.data.dry_run) else {
            return;
        };
        let sound: Vec<&Report> = reports.iter().flatten().collect();
        let measured =
            MeasuredPlate::new((stroke.run_id, stroke.key), &stroke.data, &stroke.plate, task, &sound);
        self.receivers.advice.ask(AdviceJob::new(measured, surface.clone(), folder.to_owned()));
    }

    fn folder(&self, run_id: u32) -> PathBuf {
        self.plant.output.folder.join(format!("run-{run_id:06}"))
    }

    /// Measures the scanned plate, compares, judges, and writes the documents.
    fn measure(&mut self, stroke: &ActiveStroke, start: Instant) -> Result<JudgedStroke, NotMeasured> {
        let spec = self.pipeline.spec(&stroke.plate);
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
        let measured = stroke::measure_scanned(&mut self.pipeline, &stroke.scanned, &spec, last, baseline)?;
        self.region.saw(&measured.outline);
        let surfaces = Surfaces {
            now: &measured.measurement.surface,
            before: earlier.before.as_ref().map(|before| &before.surface),
            baseline: earlier.baseline.as_ref().map(|baseline| &baseline.surface),
        };
        let calibration = self.calibration().ok().flatten();
        let supports = earlier.last().and_then(|last| last.supports.as_deref());
        let circumstances = Circumstances {
            plant: &self.plant,
            plate: &stroke.plate,
            calibration: calibration.as_ref(),
            scanner: self.scanner.as_ref().map(Scanner::instance),
            stroke: Some(u64::from(stroke.key.stroke)),
            supports_changed: history_view::supports_changed(supports, &stroke.plate),
        };
        let Judgement { mut record, reports, task } =
            judgement::judge(&self.pipeline, &stroke.scanned, &measured, surfaces, circumstances);
        record.clock = self.receivers.clock.record();
        let folder = self.keep(stroke, &record, &measured.measurement.surface);
        let times = [
            (Measure::ScanTime, stroke.scanned.acquire + stroke.scanned.extract),
            (Measure::EvaluateTime, start.elapsed()),
            (Measure::StrokeToResultTime, stroke.started.elapsed()),
        ];
        let source = self.pipeline.register_source.and_then(|place| reports[place].as_ref().ok());
        let mut answer =
            figures::measurement(&measured, source, record.verdict, &stroke.plate, times, stroke.scanned_at);
        if let Some(bound_ms) = record.clock.and_then(|clock| clock.error_bound_ms) {
            answer.figures.values.insert(Measure::ClockError, bound_ms / 1000.0);
        }
        // A result without files still goes to the press, with a warning.
        let retried = record.plugins.iter().any(|plugin| plugin.retried);
        let warnings = [
            (folder.is_none(), Code::StorageDegraded),
            (retried, Code::PluginRestarted),
            (self.receivers.clock.is_overdue(), Code::ClockUnsynchronised),
        ];
        answer.warning = warnings.into_iter().find_map(|(raised, code)| raised.then_some(code));
        Ok(JudgedStroke { answer, record, surface: measured.measurement.surface, reports, task, folder })
    }

    fn history(&self) -> MutexGuard<'_, History> {
        self.history.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Writes the documents and records their place. If the disk is full, the record is lost but not the result.
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
                self.receivers.lost.fetch_add(1, Ordering::Relaxed);
                tracing::error!(key = %stroke.key, "the record is lost: {why}");
                None
            }
        }
    }

    /// Writes pictures, table and mesh beside the documents, and the plate's report. They can be made again from the
    /// documents, so their loss is not a fault of the stroke.
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
            // A separate reader: the journal never waits for a picture.
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

/// Returns the alarm code and the readable sentence.
fn refusal(error: &NotMeasured) -> (Code, String) {
    let code = match error {
        NotMeasured::Scanner(PluginError::Stopped { .. } | PluginError::Hangs { .. }) => Code::ScanTimeout,
        NotMeasured::Scanner(PluginError::Quarantined { .. }) => Code::PluginOutOfUse,
        NotMeasured::Scanner(_) | NotMeasured::Column(_) => Code::ScanFailed,
        NotMeasured::Plate(_) => Code::PlateNotFound,
        NotMeasured::Askew { .. } | NotMeasured::Turned(_) => Code::PlateTurned,
        NotMeasured::Outline(_) | NotMeasured::Blank(_) | NotMeasured::Shape(_) => Code::EvaluationFailed,
    };
    (code, error.to_string())
}
