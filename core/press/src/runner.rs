//! I/O task of the press side: connects link, registers, journal and host with the pure handshake.
//!
//! One task polls the press, feeds the handshake and executes its effects (`cycle`). The host takes part through two
//! channels: it receives [`Order`]s and sends [`Answer`]s. The journal is written on a thread of its own (`journal`);
//! the modes `off` and `listen` write nothing (`read_only`); `metrics` counts strokes and durations.

mod cycle;
mod journal;
mod metrics;
mod read_only;

use std::time::Duration;

use platen_plant::press::{Mode, Press, Role};
use tokio::sync::{mpsc, watch};

pub use metrics::{Durations, Metrics};

use crate::advice_block::AdviceWriter;
use crate::handshake::{Config, Handshake};
use crate::reconcile::Reconciler;
use crate::{
    AdviceImage, Client, Code, Command, Counts, HostImage, Journal, Link, Measurement, PressImage, State,
    StrokeKey,
};

/// Order of the press side to the host.
#[derive(Debug, Clone, PartialEq)]
pub enum Order {
    /// Command of the handshake, unchanged.
    Command(Command),
    /// An alarm, once per cause.
    Alarm {
        /// Alarm.
        code: Code,
        /// The active stroke.
        stroke: Option<StrokeKey>,
        /// Place and cause in one line, where they add to the table of alarms.
        detail: Option<String>,
    },
    /// In modes without scans: the registers of the press have changed.
    Seen(Box<PressImage>),
}

/// Answer of the host to the press side.
#[derive(Debug, Clone, PartialEq)]
pub enum Answer {
    /// The scan of a stroke is complete.
    Acquired(StrokeKey),
    /// The result of a stroke.
    Result(StrokeKey, Box<Measurement>),
    /// Scan or evaluation of a stroke failed.
    Failed(StrokeKey, Code),
    /// Whether the scanner can take a scan, and how long one would take. No stroke is accepted before the first.
    Scanner {
        /// Its fault, if any.
        ready: Result<(), Code>,
        /// Its estimate of one scan.
        estimate: Option<Duration>,
    },
    /// Advice after a stroke, for a display at the press.
    Advice(StrokeKey, Box<AdviceImage>),
    /// The operator resets faults.
    Reset,
    /// Stop; the registers are made safe first.
    Stop,
}

/// State of the press side, for `status` and screen.
#[derive(Debug, Clone, PartialEq)]
pub struct Status {
    /// State of the handshake.
    pub state: State,
    /// Fault of the link; not necessarily in the registers.
    pub link_error: Option<Code>,
    /// Registers of the press at the last read.
    pub press: Option<PressImage>,
    /// Words of the last read of the whole block.
    pub words: Vec<u16>,
    /// Desired registers of the host.
    pub host: HostImage,
    /// Counters of the link.
    pub counts: Counts,
    /// Metrics of the strokes.
    pub metrics: Metrics,
}

/// The host's ends of the channels.
#[derive(Debug)]
pub struct HostSide {
    /// Receives orders.
    pub orders: mpsc::UnboundedReceiver<Order>,
    /// Sends answers; dropping it means [`Answer::Stop`].
    pub answers: mpsc::UnboundedSender<Answer>,
    /// State of the press side.
    pub status: watch::Receiver<Status>,
}

/// The press side's ends of the channels.
#[derive(Debug)]
pub struct PressSide {
    orders: mpsc::UnboundedSender<Order>,
    answers: mpsc::UnboundedReceiver<Answer>,
    status: watch::Sender<Status>,
}

/// Creates the channels between the host and one press.
pub fn channels() -> (HostSide, PressSide) {
    let (order, orders) = mpsc::unbounded_channel();
    let (answer, answers) = mpsc::unbounded_channel();
    let (tell_status, status) = watch::channel(Status {
        state: State::default(),
        link_error: None,
        press: None,
        words: Vec::new(),
        host: HostImage::default(),
        counts: Counts::default(),
        metrics: Metrics::default(),
    });
    (HostSide { orders, answers: answer, status }, PressSide { orders: order, answers, status: tell_status })
}

/// Reason why the press side could not start.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the message of a variant names its fields")]
pub enum RunError<E: std::error::Error + 'static> {
    /// The journal could not be read: without it a stroke could be measured twice.
    #[error("press {press}: the journal cannot be read: {source}; repair or replace it before measuring")]
    Journal { press: String, source: E },
    /// The journal panicked while it was read.
    #[error("press {press}: the journal failed while being read")]
    JournalGone { press: String },
}

/// Serves one press until the host sends [`Answer::Stop`] or drops its end; then makes the registers safe.
///
/// Errors of `link` are not errors of this function: it reconnects without end.
///
/// # Errors
/// [`RunError`], when the journal cannot be read at the start.
pub async fn run_press<L: Link, J: Journal>(
    press: Press,
    link: L,
    journal: J,
    side: PressSide,
) -> Result<(), RunError<J::Error>> {
    match press.mode {
        Mode::Off => {
            read_only::wait_for_stop(side).await;
            Ok(())
        }
        Mode::Listen => {
            read_only::listen(&press, Client::new(link, &press), side).await;
            Ok(())
        }
        Mode::DryRun | Mode::Simulate | Mode::Measure => {
            let name = press.name.clone();
            let (journal, recalled) = journal::start(journal).await.map_err(|source| match source {
                Some(source) => RunError::Journal { press: name.clone(), source },
                None => RunError::JournalGone { press: name.clone() },
            })?;
            tracing::info!(press = name, allow = %press.write, server = press.role == Role::Server, "registers that may be written");
            let runner = cycle::Runner {
                handshake: Handshake::new(Config::new(&press), recalled),
                registers: Reconciler::new(&press),
                advice: AdviceWriter::new(&press),
                client: Client::new(link, &press),
                metrics: Metrics::default(),
                journal,
                side,
                clock: cycle::Clock::start(&press),
                faults: cycle::Faults::default(),
                last_press: None,
                last_words: Vec::new(),
                press,
            };
            runner.run().await;
            Ok(())
        }
    }
}
