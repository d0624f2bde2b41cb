//! Advice after a result: collected, computed, recorded and shown on a thread of its own.
//!
//! Neither the press nor the next stroke ever waits for it.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use platen_engine::pipeline;
use platen_engine::plugin::{Advisor, CancelToken, Catalogue};
use platen_history::Archive;
use platen_model::{Advice, CannotAdvise, Language, Step};
use platen_plant::press::Mode;
use platen_plant::{AdviceUse, PlantFile, Show};
use platen_press::{AdviceImage, Answer};
use platen_report::advice::AdviceRecord;
use platen_shape::Surface;
use tokio::sync::mpsc::UnboundedSender;

use super::screen::{Event, EventSender};
use crate::plate_history::{self, MeasuredPlate};

/// Result for which advice is to be computed.
#[derive(Debug)]
pub(super) struct AdviceJob {
    pub(super) measured: MeasuredPlate,
    pub(super) surface: Surface,
    /// Folder of the stroke's files.
    pub(super) folder: PathBuf,
    /// Time of the result.
    pub(super) since: Instant,
    /// Token that the next stroke cancels, also before the advisor has begun.
    token: CancelToken,
}

impl AdviceJob {
    pub(super) fn new(measured: MeasuredPlate, surface: Surface, folder: PathBuf) -> Self {
        Self { measured, surface, folder, since: Instant::now(), token: CancelToken::default() }
    }
}

/// Connection to the advisor's thread. Does nothing where the plant file has no `[advice]`.
#[derive(Debug, Clone, Default)]
pub(super) struct AdviceDesk(Option<Arc<Desk>>);

#[derive(Debug)]
struct Desk {
    jobs: Mutex<Sender<AdviceJob>>,
    /// Token of the newest job.
    newest: Mutex<CancelToken>,
}

impl AdviceDesk {
    /// Starts the advisor's thread.
    ///
    /// # Errors
    /// The system has no thread.
    pub(super) fn start(
        plant: &PlantFile,
        catalogue: &Catalogue,
        screen: EventSender,
        answers: UnboundedSender<Answer>,
    ) -> std::io::Result<Self> {
        let Some(wanted) = plant.advice.clone() else { return Ok(Self::default()) };
        let (jobs, inbox) = channel();
        let desk = Arc::new(Desk { jobs: Mutex::new(jobs), newest: Mutex::default() });
        let thread = Thread {
            plant: plant.clone(),
            wanted,
            catalogue: catalogue.clone(),
            screen,
            answers,
            advisor: None,
        };
        std::thread::Builder::new().name("advice".into()).spawn(move || thread.serve(&inbox))?;
        Ok(Self(Some(desk)))
    }

    /// Returns whether advice is enabled, so that a job is needed.
    pub(super) fn is_open(&self) -> bool {
        self.0.is_some()
    }

    /// Passes a result to the thread.
    pub(super) fn ask(&self, job: AdviceJob) {
        if let Some(desk) = &self.0 {
            *desk.newest.lock().unwrap_or_else(PoisonError::into_inner) = job.token.clone();
            // The thread ends with the host.
            let _ = desk.jobs.lock().unwrap_or_else(PoisonError::into_inner).send(job);
        }
    }

    /// Cancels the advice that is queued or in progress: the next stroke has been made, or the plate has been removed.
    pub(super) fn cancel(&self) {
        if let Some(desk) = &self.0 {
            desk.newest.lock().unwrap_or_else(PoisonError::into_inner).cancel();
        }
    }
}

struct Thread {
    plant: PlantFile,
    wanted: AdviceUse,
    catalogue: Catalogue,
    screen: EventSender,
    answers: UnboundedSender<Answer>,
    /// The plugin, once it has been created.
    advisor: Option<Advisor>,
}

impl Thread {
    fn serve(mut self, inbox: &Receiver<AdviceJob>) {
        // The plugin is started before the first stroke; an error is reported with that stroke.
        let _ = self.advisor();
        while let Ok(job) = inbox.recv() {
            let run_id = job.measured.run_id;
            match self.advise(&job) {
                Ok(record) => self.keep(&job.folder, record),
                Err(why) => tracing::warn!(run_id, "no advice: {why}"),
            }
        }
    }

    fn advise(&mut self, job: &AdviceJob) -> Result<AdviceRecord, String> {
        let archive = Archive::open(&self.plant.output.history).map_err(|e| e.to_string())?;
        let mut record = plate_history::gather(&archive, &self.plant, &self.wanted, &job.measured)?;
        let origin = plate_history::origin(&archive, job.measured.run_id);
        let advice = self.advisor().and_then(|advisor| {
            advisor
                .advise(&record.history, &job.surface, origin.as_ref(), job.token.clone())
                .map_err(|e| e.to_string())
        });
        // This includes an advice that was ready a moment later: it was not shown.
        let advice = if job.token.is_cancelled() { Ok(platen_advice::too_late()) } else { advice };
        (record.advice, record.failed) = match advice {
            Ok(advice) => (Some(advice), None),
            Err(why) => (None, Some(why)),
        };
        if let Some(why) = record.failed.as_deref().or(late(record.advice.as_ref())) {
            tracing::warn!(run_id = job.measured.run_id, "no advice: {why}");
        }
        record.elapsed_ms = 1e3 * job.since.elapsed().as_secs_f64();
        Ok(record)
    }

    /// Returns the plugin; one that cannot be used is tried again at the next stroke.
    fn advisor(&mut self) -> Result<&Advisor, String> {
        let advisor = match self.advisor.take() {
            Some(advisor) => advisor,
            None => {
                let (library, values) =
                    pipeline::load(&self.catalogue, &self.wanted.plugin).map_err(|e| e.to_string())?;
                Advisor::create(&library, &values, self.wanted.deadline).map_err(|e| e.to_string())?
            }
        };
        Ok(self.advisor.insert(advisor))
    }

    /// Writes the advice, and passes it on to registers and pages. They receive a late advice together with the next
    /// one.
    fn keep(&self, folder: &Path, record: AdviceRecord) {
        if let Err(why) = record.write(folder) {
            tracing::warn!(run_id = record.run_id, "the advice is not on record: {why}");
        }
        tracing::info!(run_id = record.run_id, ms = record.elapsed_ms, "advice");
        if self.wanted.show == Show::Shadow || late(record.advice.as_ref()).is_some() {
            return;
        }
        let press = self.plant.press.as_ref();
        let registers = press.and_then(|press| Some((press.advice?, press.mode == Mode::Simulate)));
        if let Some(((registers, simulated), advice)) = registers.zip(record.advice.as_ref()) {
            let last = record.history.strokes.last().and_then(|stroke| Some(stroke.bends.first()?.at));
            let image = AdviceImage::new(advice, record.key.stroke, simulated, last, registers.depth);
            // The press side ends with the host.
            let _ = self.answers.send(Answer::Advice(record.key, Box::new(image)));
        }
        self.screen.send(Event::Advised(Box::new(record)));
    }
}

/// Returns the sentence of an advice that came too late.
fn late(advice: Option<&Advice>) -> Option<&'static str> {
    let late = matches!(advice?.step, Step::Cannot { reason: CannotAdvise::TooLate });
    late.then(|| CannotAdvise::TooLate.texts().of(Language::En))
}
