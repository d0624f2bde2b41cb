//! Command `platen run`: after a trigger of the press the plate is measured and the result is written to the press.
//!
//! | part | task |
//! |---|---|
//! | press side ([`platen_press::run_press`]) | link, handshake, registers |
//! | `measurement_worker` | scans and measures one stroke at a time, on a thread of its own |
//! | dispatcher (this module) | passes messages between the two, stops both |
//! | `journal` | steps of a stroke in the history; a commitment to the press is recorded before it is made |
//! | `previous_scans`, `region` | the previous stroke and the baseline, from the history; the window of the next scan |
//! | `scan_retention` | raw scans beside their results, for as long as the plant file allows |
//! | `scan_store` | copies of kept scans in a store, by the rule of the plant file |
//! | `screen` | the browser pages, where the plant file has `[screen]` |
//! | `advice` | advice on the next stroke, after the result, where the plant file has `[advice]` |
//! | `alarms` | an alarm to the log, the record, the status and the pages |
//! | `forward`, `forward_record` | monitoring of `platen forward` and its state, where the plant file has `[forward]` |
//! | `status`, `prometheus`, `disk` | the state of the host for `platen status` |
//! | `clock` | synchronisation and jumps of the machine's clock |
//! | `stopping` | requests to stop, carried out between two plates |
//! | `figures` | conversion of findings to figures of the press's registers |

mod advice;
mod alarms;
mod clock;
mod disk;
mod forward;
mod forward_record;
mod measurement_worker;

pub(crate) mod figures;
mod journal;
mod plugin_status;
pub(crate) mod previous_scans;
mod prometheus;
mod region;
mod scan_retention;
mod scan_store;
mod screen;
mod service;
mod status;
mod stopping;

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use jiff::Timestamp;
use platen_history::{Error as HistoryError, History};
use platen_model::{Code, StrokeKey};
use platen_plant::PlantFile;
use platen_plant::press::Press;
use platen_press::{Command, Order, PressLink, RunError, channels, run_press};
use tokio::sync::watch;

pub use forward_record::ForwardRecord;
pub use measurement_worker::StrokeReport;
pub use plugin_status::PluginStatus;
pub use screen::{Pages, ScreenError};
pub use status::{LinkRecord, StatusRecord, reset_request};
pub use stopping::{StopRequest, stop_request};

use advice::AdviceDesk;
use alarms::Alarms;
use measurement_worker::MeasurementWorker;
use platen_engine::pipeline::{Pipeline, PipelineError};
use platen_engine::plugin::{CancelToken, Catalogue, Quarantine};
use screen::{EventSender, Screen};
use stopping::PlateInHand;

/// Time for the last scan to be written when the host stops.
const LAST_SCAN: Duration = Duration::from_secs(20);

/// Reason why a host cannot run.
#[derive(Debug, thiserror::Error)]
pub enum HostError {
    /// A plugin or a file is wrong.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
    /// The history cannot be used.
    #[error("{0}")]
    History(#[from] HistoryError),
    /// The browser pages could not be served.
    #[error(transparent)]
    Screen(#[from] ScreenError),
    /// The press side could not start.
    #[error(transparent)]
    Press(#[from] RunError<HistoryError>),
    /// The system has no thread for the measurement worker.
    #[error("no thread for measuring: {0}")]
    Thread(std::io::Error),
    /// The measurement worker ended unexpectedly.
    #[error("measuring has ended: {0}; restart platen")]
    Worker(String),
}

/// Runs until `stop` becomes true; the press's registers are then safe. `pages` are served meanwhile. `strokes`
/// receives one report for each stroke, measured or not.
///
/// # Errors
/// [`HostError`]; nothing was written to the press when the start fails.
pub async fn run(
    plant: &PlantFile,
    press: Press,
    catalogue: &Catalogue,
    pages: Option<Pages>,
    mut stop: watch::Receiver<bool>,
    strokes: tokio::sync::mpsc::UnboundedSender<StrokeReport>,
) -> Result<(), HostError> {
    let history = History::open(&plant.output.history, press.press_id, Timestamp::now())?;
    let history = Arc::new(Mutex::new(history));
    let catalogue = &catalogue.clone().with_quarantine(Quarantine::beside(&plant.output.history));
    let pipeline = Pipeline::of(plant, catalogue)?;
    let (mut host, side) = channels();
    let (commands, inbox) = std::sync::mpsc::channel();
    let address = pages.as_ref().map(Pages::address);
    let beside = status::Beside { pages: address, ..status::Beside::default() };
    let mut events = EventSender::default();
    let mut screen = None;
    if let Some(pages) = pages {
        tracing::info!("pages on {}", pages.address());
        let started = Screen::start(pages, plant, &press, catalogue, &host.status, &beside)?;
        events = started.1;
        screen = Some(tokio::spawn(started.0.keep(host.status.clone())));
    }
    let desk = AdviceDesk::start(plant, catalogue, events.clone(), host.answers.clone())
        .map_err(HostError::Thread)?;
    let receivers = measurement_worker::Receivers {
        answers: host.answers.clone(),
        strokes,
        lost: Arc::clone(&beside.lost),
        screen: events.clone(),
        plugins: Arc::clone(&beside.plugins),
        clock: beside.clock.clone(),
        advice: desk.clone(),
    };
    let worker = MeasurementWorker::new(plant, catalogue, pipeline, &press, Arc::clone(&history), receivers);
    let worker = std::thread::Builder::new().name("measure".into()).spawn(move || worker.serve(&inbox));
    let worker = worker.map_err(HostError::Thread)?;

    let alarms =
        Alarms { history: Arc::clone(&history), newest: beside.alarm.clone(), screen: events.clone() };
    let forward = plant.forward.as_ref().map(|_| {
        let state = Arc::clone(&beside.forward);
        tokio::spawn(forward::watch(plant.output.folder.clone(), state, alarms.clone()))
    });
    let link = PressLink::new(&press);
    let status = tokio::spawn(status::keep(
        plant.output.folder.clone(),
        press.clone(),
        host.status.clone(),
        beside.clone(),
        host.answers.clone(),
    ));
    let clock = {
        let alarms = alarms.clone();
        let raise = move || alarms.raise(Code::ClockUnsynchronised, None, None);
        tokio::spawn(clock::keep(beside.clock.clone(), Arc::clone(&history), raise))
    };
    let service = tokio::spawn(service::keep(press.mode, host.status.clone()));
    let mut press_side =
        tokio::spawn(run_press(press, link, journal::HistoryJournal(Arc::clone(&history)), side));
    let mut scanning: Option<(StrokeKey, CancelToken)> = None;
    let mut hung = None;
    let ended = loop {
        tokio::select! {
            ended = &mut press_side => break ended,
            changed = stop.changed() => {
                service::stopping();
                if changed.is_err() || *stop.borrow() {
                    // The press side makes the registers safe; then it ends.
                    let _ = host.answers.send(platen_press::Answer::Stop);
                }
                if changed.is_err() {
                    break press_side.await;
                }
            }
            Some(order) = host.orders.recv() => {
                if worker.is_finished() && hung.is_none() {
                    hung = Some(HostError::Worker("a plugin hangs or the measurement failed".into()));
                    let _ = host.answers.send(platen_press::Answer::Stop);
                }
                if matches!(order, Order::Command(Command::Scan { .. } | Command::PartEnd)) {
                    desk.cancel();
                }
                dispatch(order, &commands, &mut scanning, &alarms, &beside.plate);
            }
        }
    };
    service.abort();
    clock.abort();
    drop(commands);
    if let Some((_, token)) = scanning {
        token.cancel();
    }
    status.abort();
    if let Some(forward) = forward {
        forward.abort();
    }
    if let Some(screen) = screen {
        screen.abort();
    }
    // A scan that is still being written is finished; a plugin that hangs is not waited for.
    let end = tokio::time::Instant::now() + LAST_SCAN;
    while hung.is_none() && !worker.is_finished() && tokio::time::Instant::now() < end {
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    match ended {
        Ok(result) => result?,
        Err(panic) => return Err(HostError::Worker(panic.to_string())),
    }
    hung.map_or(Ok(()), Err)
}

/// Executes an order: commands to scan or evaluate go to the worker with the token that cancels them, a cancellation
/// bypasses its queue.
fn dispatch(
    order: Order,
    commands: &std::sync::mpsc::Sender<(Command, CancelToken)>,
    scanning: &mut Option<(StrokeKey, CancelToken)>,
    alarms: &Alarms,
    plate: &PlateInHand,
) {
    match order {
        Order::Command(Command::Cancel(key)) => {
            if let Some((_, token)) = scanning.take_if(|(running, _)| *running == key) {
                token.cancel();
            }
        }
        Order::Command(Command::PartEnd) => {
            plate.ended();
            alarms.screen.send(screen::Event::PartEnded);
            let ended =
                alarms.history.lock().unwrap_or_else(PoisonError::into_inner).part_end(Timestamp::now());
            if let Err(error) = ended {
                tracing::error!("end of part: {error}");
            }
        }
        Order::Command(command) => {
            let token = CancelToken::default();
            if let Command::Scan { key, run_id, data } = &command {
                plate.stroke();
                alarms.screen.send(screen::Event::Accepted {
                    key: *key,
                    run_id: *run_id,
                    data: data.clone(),
                });
                *scanning = Some((*key, token.clone()));
            }
            // The dispatcher detects the end of the worker.
            let _ = commands.send((command, token));
        }
        Order::Alarm { code, stroke, detail } => alarms.raise(code, stroke, detail.as_deref()),
        Order::Seen(image) => tracing::debug!(?image, "the press says"),
    }
}
