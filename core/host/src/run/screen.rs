//! Browser pages of a running host: the data that `platen-screen` displays, collected from press side, worker, record
//! and files.
//!
//! [`Screen::keep`] follows the state of the press side and the events of dispatcher and worker. It publishes a
//! snapshot whenever one of them changes (`snapshot`: rules R3 to R6 as pure functions). `site` answers the pages'
//! queries of record and files, `engineer` the queries of the engineer's page.

mod engineer;
mod site;
mod snapshot;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use platen_engine::plugin::Catalogue;
use platen_model::{Code, Field, Report, StrokeData, StrokeKey};
use platen_plant::PlantFile;
use platen_plant::press::Press;
use platen_press::Status;
use platen_report::advice::AdviceRecord;
use platen_report::picture::StripPoint;
use platen_report::result::{Next, ResultRecord};
use platen_screen::{Access, Listener, Server, ServerError, Snapshot, Token, TokenError};
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender, unbounded_channel};
use tokio::sync::watch;

use super::status::Beside;
use site::Site;
use snapshot::Facts;

/// Reason why the pages cannot be served.
#[derive(Debug, thiserror::Error)]
pub enum ScreenError {
    /// The token cannot be used.
    #[error("[screen]: {0}")]
    Token(#[from] TokenError),
    /// Without a token, other computers could read the pages.
    #[error(
        "[screen]: {0} is open to other computers; make a token with `platen screen token FILE` and name it as token_file"
    )]
    Open(std::net::SocketAddr),
    /// The address cannot be opened.
    #[error(transparent)]
    Server(#[from] ServerError),
}

/// An event from outside the press side.
#[derive(Debug)]
pub(super) enum Event {
    /// A stroke is being scanned.
    Accepted { key: StrokeKey, run_id: u32, data: Box<StrokeData> },
    /// Share of a stroke that is scanned, as reported by the driver.
    Scanned { key: StrokeKey, percent: u8 },
    /// The plate is finished.
    PartEnded,
    /// The press side raised an alarm.
    Alarm(Code),
    /// State of the scanner and its estimate of one scan.
    Scanner { ready: Result<(), Code>, estimate_s: Option<f64> },
    /// A stroke was measured; sent after the answer to the press.
    Measured(Box<MeasuredStroke>),
    /// The position of the next hit after this stroke has been bent before.
    Again(u32),
    /// Advice after a measured stroke.
    Advised(Box<AdviceRecord>),
}

/// A measured stroke, as the pages show it.
#[derive(Debug, Clone)]
pub(super) struct MeasuredStroke {
    pub(super) run_id: u32,
    pub(super) record: Arc<ResultRecord>,
    /// Fields with one component, which have maps.
    pub(super) fields: Vec<Arc<Field>>,
    /// Strokes of the plate up to this one, oldest first.
    pub(super) strokes: Vec<StripPoint>,
}

impl MeasuredStroke {
    pub(super) fn new(
        run_id: u32,
        record: &ResultRecord,
        reports: &[&Report],
        strokes: Vec<StripPoint>,
    ) -> Self {
        let fields = reports.iter().flat_map(|report| &report.fields).filter(|field| field.components == 1);
        let fields = fields.map(|field| Arc::new(field.clone())).collect();
        Self { run_id, record: Arc::new(record.clone()), fields, strokes }
    }
}

/// Connection to the pages for dispatcher and worker; does nothing where no pages are served.
#[derive(Debug, Clone, Default)]
pub(super) struct EventSender(Option<UnboundedSender<Event>>);

impl EventSender {
    /// Returns whether pages are served, so that an event is needed.
    pub(super) fn is_connected(&self) -> bool {
        self.0.is_some()
    }

    /// Queues an event for the pages.
    pub(super) fn send(&self, event: Event) {
        if let Some(sender) = &self.0 {
            // The pages may have ended before the host.
            let _ = sender.send(event);
        }
    }
}

/// State that the pages' source shares with the task that keeps it.
#[derive(Debug)]
struct Board {
    facts: Mutex<Facts>,
    /// Status of the press side, and the time when its cycle last reported.
    status: Mutex<(Status, Instant)>,
    snapshots: watch::Sender<Arc<Snapshot>>,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Opened address of the pages, before the host runs.
#[derive(Debug)]
pub struct Pages {
    listener: Listener,
    access: Access,
}

impl Pages {
    /// Opens the address of the plant file; `None` where it has no `[screen]`.
    ///
    /// # Errors
    /// [`ScreenError`].
    pub fn open(plant: &PlantFile) -> Result<Option<Self>, ScreenError> {
        let Some(wanted) = &plant.screen else { return Ok(None) };
        let token = wanted.token_file.as_deref().map(Token::load).transpose()?;
        if token.is_none() && !wanted.listen.ip().is_loopback() {
            return Err(ScreenError::Open(wanted.listen));
        }
        let listener = Listener::open(wanted.listen)?;
        Ok(Some(Self { listener, access: Access { token, names: wanted.names.clone() } }))
    }

    /// Returns the address as readable text.
    pub fn address(&self) -> String {
        format!("http://{}/", self.listener.address())
    }
}

/// Pages of a running host.
#[derive(Debug)]
pub(super) struct Screen {
    board: Arc<Board>,
    site: Arc<Site>,
    events: UnboundedReceiver<Event>,
    sender: EventSender,
    _server: Server,
}

impl Screen {
    /// Serves the pages.
    ///
    /// # Errors
    /// [`ScreenError`].
    pub(super) fn start(
        pages: Pages,
        plant: &PlantFile,
        press: &Press,
        catalogue: &Catalogue,
        status: &watch::Receiver<Status>,
        beside: &Beside,
    ) -> Result<(Self, EventSender), ScreenError> {
        let status = status.borrow().clone();
        let mut facts = Facts::new(press);
        facts.observe(&status);
        let first = Arc::new(facts.snapshot(&status, 0));
        let board = Arc::new(Board {
            facts: Mutex::new(facts),
            status: Mutex::new((status, Instant::now())),
            snapshots: watch::Sender::new(first),
        });
        let site = Arc::new(Site::new(Arc::clone(&board), plant, press, catalogue, beside));
        let source = Arc::clone(&site) as Arc<dyn platen_screen::Source>;
        let server = Server::start(pages.listener, pages.access, source)?;
        let (sender, events) = unbounded_channel();
        let sender = EventSender(Some(sender));
        Ok((Self { board, site, events, sender: sender.clone(), _server: server }, sender))
    }

    /// Keeps the pages up to date until the press side ends.
    pub(super) async fn keep(mut self, mut status: watch::Receiver<Status>) {
        loop {
            tokio::select! {
                changed = status.changed() => {
                    if changed.is_err() {
                        return;
                    }
                    let now = status.borrow_and_update().clone();
                    self.recall(&now);
                    *lock(&self.board.status) = (now, Instant::now());
                }
                Some(event) = self.events.recv() => {
                    self.look_for_earlier_bends(&event);
                    lock(&self.board.facts).take(event);
                }
            }
            self.publish();
        }
    }

    /// Determines, without delaying other work, whether an earlier stroke bent the plate at the position of the next
    /// hit.
    fn look_for_earlier_bends(&self, event: &Event) {
        let Event::Measured(measured) = event else { return };
        let next = measured.record.next.as_ref().and_then(Next::place);
        let Some(place) = next.map(|next| next.at_mm) else { return };
        let (site, sender, run_id) = (Arc::clone(&self.site), self.sender.clone(), measured.run_id);
        tokio::task::spawn_blocking(move || {
            if site.was_bent(run_id, place) {
                sender.send(Event::Again(run_id));
            }
        });
    }

    /// Reads the record of a result that was published before this start.
    fn recall(&self, status: &Status) {
        let Some(run_id) = status.host.result.as_ref().map(|result| result.run_id) else { return };
        let is_known = lock(&self.board.facts).knows(run_id);
        if !is_known {
            let (measured, advice) = (self.site.recorded(run_id), self.site.advised(run_id));
            lock(&self.board.facts).recall(run_id, measured, advice);
        }
    }

    fn publish(&self) {
        let status = lock(&self.board.status).0.clone();
        let mut facts = lock(&self.board.facts);
        facts.observe(&status);
        self.board.snapshots.send_if_modified(|snapshot| {
            let next = facts.snapshot(&status, snapshot.seq);
            let changed = next != **snapshot;
            if changed {
                *snapshot = Arc::new(Snapshot { seq: snapshot.seq + 1, ..next });
            }
            changed
        });
    }
}
