//! Runs the handshake: ties link, registers, journal and host together.
//!
//! One task polls the press, feeds the pure handshake and carries out its effects. The host takes part through two
//! channels: it receives [`Order`]s and sends [`Answer`]s, in its own time. The journal is written beside the loop.

mod cycle;
mod journal;
mod listen;
mod metrics;

use std::time::Duration;

use platen_plant::press::{Mode, Press, Role};
use tokio::sync::{mpsc, watch};

pub use metrics::{Durations, Metrics};

use crate::handshake::{Config, Handshake};
use crate::reconcile::Reconciler;
use crate::{
    Client, Code, Counts, HostImage, Journal, Link, Measurement, PressImage, State, StrokeData, StrokeKey,
};

/// What the press side wants from the host.
#[derive(Debug, Clone, PartialEq)]
pub enum Order {
    /// Scan a stroke; answer with [`Answer::Acquired`] or [`Answer::Failed`].
    StartScan {
        /// The stroke.
        key: StrokeKey,
        /// Key of its record.
        run_id: u32,
        /// What the press said about it.
        data: Box<StrokeData>,
    },
    /// Judge the scan of a stroke; answer with [`Answer::Result`] or [`Answer::Failed`]. Comes after
    /// [`Answer::Acquired`], and after a restart for a stroke that was scanned before.
    Evaluate(StrokeKey),
    /// Give up scan and evaluation of a stroke.
    Cancel(StrokeKey),
    /// The plate is finished and leaves.
    PartEnd,
    /// Something for people to know, once per cause.
    Alarm {
        /// What.
        code: Code,
        /// The stroke in hand.
        stroke: Option<StrokeKey>,
        /// Where and why, in one line, where there is more to say than the table of alarms does.
        detail: Option<String>,
    },
    /// Modes that never scan: what the press says has changed.
    Seen(Box<PressImage>),
}

/// What the host tells the press side.
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
        /// What is wrong with it.
        ready: Result<(), Code>,
        /// Its estimate of one scan.
        estimate: Option<Duration>,
    },
    /// The operator resets faults.
    Reset,
    /// End; the registers are made safe first.
    Stop,
}

/// How things stand, for `status` and screen.
#[derive(Debug, Clone, PartialEq)]
pub struct Status {
    /// State of the handshake.
    pub state: State,
    /// What is wrong with the link; may not stand in the registers.
    pub link_error: Option<Code>,
    /// What the press said last.
    pub press: Option<PressImage>,
    /// What the registers of the host shall say.
    pub host: HostImage,
    /// What happened on the link.
    pub counts: Counts,
    /// What happened to strokes.
    pub metrics: Metrics,
}

/// The host's ends of the channels.
#[derive(Debug)]
pub struct HostSide {
    /// What the press side wants.
    pub orders: mpsc::UnboundedReceiver<Order>,
    /// What the host tells; dropping it means [`Answer::Stop`].
    pub answers: mpsc::UnboundedSender<Answer>,
    /// How things stand.
    pub status: watch::Receiver<Status>,
}

/// The press side's ends of the channels.
#[derive(Debug)]
pub struct PressSide {
    orders: mpsc::UnboundedSender<Order>,
    answers: mpsc::UnboundedReceiver<Answer>,
    status: watch::Sender<Status>,
}

/// Channels between the host and one press.
pub fn channels() -> (HostSide, PressSide) {
    let (order, orders) = mpsc::unbounded_channel();
    let (answer, answers) = mpsc::unbounded_channel();
    let (tell_status, status) = watch::channel(Status {
        state: State::default(),
        link_error: None,
        press: None,
        host: HostImage::default(),
        counts: Counts::default(),
        metrics: Metrics::default(),
    });
    (HostSide { orders, answers: answer, status }, PressSide { orders: order, answers, status: tell_status })
}

/// Why the press side could not run.
#[derive(Debug, thiserror::Error)]
pub enum RunError<E: std::error::Error + 'static> {
    /// The journal could not be read: without it a stroke could be measured twice.
    #[error("press {press}: the journal cannot be read: {source}; repair or replace it before measuring")]
    Journal {
        /// Name of the press.
        press: String,
        /// Why.
        source: E,
    },
    /// The journal panicked while it was read.
    #[error("press {press}: the journal gave up while being read")]
    JournalGone {
        /// Name of the press.
        press: String,
    },
}

/// Serves one press until the host says [`Answer::Stop`] or drops its end; then makes the registers safe.
///
/// `link` leads to the press. Errors of the link are not errors of this function: it connects again for ever.
///
/// # Errors
/// [`RunError`] when the journal cannot be read at the start.
pub async fn run_press<L: Link, J: Journal>(
    press: Press,
    link: L,
    journal: J,
    side: PressSide,
) -> Result<(), RunError<J::Error>> {
    match press.mode {
        Mode::Off => {
            listen::wait_for_stop(side).await;
            Ok(())
        }
        Mode::Listen => {
            listen::listen(&press, Client::new(link, &press), side).await;
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
                client: Client::new(link, &press),
                metrics: Metrics::default(),
                journal,
                side,
                clock: cycle::Clock::start(&press),
                faults: cycle::Faults::default(),
                last_press: None,
                press,
            };
            runner.run().await;
            Ok(())
        }
    }
}
