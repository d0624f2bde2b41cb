//! The forwarder: each sink is served by a task of its own, with a reader and a cursor of its own.
//!
//! A sink that stalls, lies or is away delays no other sink, and nothing that is done here reaches the press: the record is read only.

use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use platen_history::Owner;
use platen_plant::{Forward, PlantFile, SinkKind, SinkUse};
use tokio::sync::watch;
use tokio::task::{JoinSet, LocalSet};

use crate::cursor::{CursorError, SharedCursors};
use crate::feed::Feed;
use crate::message::{Message, Names};
use crate::mqtt::MqttSink;
use crate::postgresql::PostgresqlSink;
use crate::sink::{Sink, SinkError};
use crate::sparkplug::SparkplugSink;
use crate::status::{ForwardStatus, SinkStatus};

/// File of the cursors, beside the record.
const CURSORS: &str = "forward.sqlite";
/// Time between two looks for new changes.
const LOOK: Duration = Duration::from_millis(500);
/// Time between two states on the disk.
const STATE: Duration = Duration::from_secs(1);
/// Waits before a connection is tried again: doubled after each failure, up to the second.
const RETRY: [Duration; 2] = [Duration::from_secs(1), Duration::from_secs(30)];

/// Where the sinks begin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Start {
    /// Where each has got to.
    Cursor,
    /// After the changes before this stroke: what was sent is sent again.
    Run(u32),
    /// After the changes before this time.
    Time(jiff::Timestamp),
}

/// Reason why nothing is forwarded.
#[derive(Debug, thiserror::Error)]
pub enum ForwardError {
    /// The plant file has no `[forward]`.
    #[error("{}: has no [forward]; name the site, the press and a sink", .0.display())]
    NotConfigured(std::path::PathBuf),
    /// The file of cursors.
    #[error(transparent)]
    Cursor(#[from] CursorError),
    /// The record.
    #[error(transparent)]
    History(#[from] platen_history::Error),
    /// A file that the plant file names: a password, certificates.
    #[error("{0}")]
    File(String),
}

/// Serves all sinks of a plant file until `stop` turns true, or with `until_sent` until each has all changes.
///
/// # Errors
/// [`ForwardError`].
pub async fn forward(
    plant: &PlantFile,
    start: Start,
    until_sent: bool,
    stop: watch::Receiver<bool>,
) -> Result<ForwardStatus, ForwardError> {
    // A reader of SQLite stays on its thread.
    LocalSet::new().run_until(serve(plant, start, until_sent, stop)).await
}

async fn serve(
    plant: &PlantFile,
    start: Start,
    until_sent: bool,
    stop: watch::Receiver<bool>,
) -> Result<ForwardStatus, ForwardError> {
    let forward = plant.forward.as_ref().ok_or_else(|| ForwardError::NotConfigured(plant.file.clone()))?;
    let folder = plant.output.folder.clone();
    std::fs::create_dir_all(&folder).map_err(|e| ForwardError::File(format!("{}: {e}", folder.display())))?;
    let crews = plant.crews.as_ref().is_some_and(|crews| crews.forward);
    let names = Names { site: forward.site.clone(), press: forward.press.clone(), crews };
    let sinks = forward.sinks.iter().map(|sink| SinkStatus::new(&sink.name, sink.kind.name())).collect();
    let shared = Arc::new(Shared {
        cursors: SharedCursors::open(&plant.output.history.with_file_name(CURSORS))?,
        sinks: Mutex::new(sinks),
    });
    let feed = || Feed::new(&plant.output.history, &names);
    if start != Start::Cursor {
        rewind(&mut feed(), &shared, forward, start)?;
    }
    let mut tasks = JoinSet::new();
    for (place, sink) in forward.sinks.iter().enumerate() {
        let pump =
            Pump { place, name: sink.name.clone(), shared: Arc::clone(&shared), feed: feed(), until_sent };
        spawn(&mut tasks, pump, sink, (&names, &folder), stop.clone())?;
    }
    let keeper = tokio::spawn(keep(Arc::clone(&shared), folder.clone()));
    let mut ended = Ok(());
    while let Some(done) = tasks.join_next().await {
        match done {
            Ok(Err(error)) => ended = Err(error.into()),
            Ok(Ok(())) => {}
            Err(panic) => tracing::error!("a sink ended on its own: {panic}"),
        }
    }
    keeper.abort();
    let status = shared.status();
    if let Err(error) = status.write(&folder) {
        tracing::warn!("{}: {error}", folder.display());
    }
    ended.map(|()| status)
}

/// Returns when the end is asked for.
async fn asked(stop: &mut watch::Receiver<bool>) {
    // A sender that is gone asks, too.
    let _ = stop.wait_for(|stop| *stop).await;
}

/// Starts the task of a sink.
fn spawn(
    tasks: &mut JoinSet<Result<(), CursorError>>,
    pump: Pump,
    sink: &SinkUse,
    (names, folder): (&Names, &Path),
    stop: watch::Receiver<bool>,
) -> Result<(), ForwardError> {
    match sink.kind {
        SinkKind::Postgresql => tasks.spawn_local(pump.run(PostgresqlSink::new(sink, names)?, stop)),
        SinkKind::Mqtt => tasks.spawn_local(pump.run(MqttSink::new(sink, names, folder)?, stop)),
        SinkKind::Sparkplug => {
            let cursors = pump.shared.cursors.clone();
            tasks.spawn_local(pump.run(SparkplugSink::new(sink, names, folder, cursors)?, stop))
        }
    };
    Ok(())
}

/// Sets the cursors of all sinks back.
fn rewind(feed: &mut Feed, shared: &Shared, forward: &Forward, start: Start) -> Result<(), ForwardError> {
    let owners = feed.owners()?;
    let before = match start {
        Start::Cursor => return Ok(()),
        Start::Run(run_id) => feed.before_run(run_id)?,
        Start::Time(at) => feed.before(at)?,
    };
    for sink in &forward.sinks {
        let now = shared.cursors.lock().of(&sink.name, &owners)?;
        if let Some(owner) = owners.last() {
            shared.cursors.lock().set(&sink.name, owner.owner, before.min(now))?;
        }
    }
    Ok(())
}

/// What the tasks share.
#[derive(Debug)]
struct Shared {
    cursors: SharedCursors,
    sinks: Mutex<Vec<SinkStatus>>,
}

impl Shared {
    fn status(&self) -> ForwardStatus {
        let sinks = self.sinks.lock().unwrap_or_else(PoisonError::into_inner).clone();
        ForwardStatus { at: jiff::Timestamp::now(), pid: std::process::id(), sinks }
    }
}

/// Writes the state to the output folder, at most once a second.
async fn keep(shared: Arc<Shared>, folder: std::path::PathBuf) {
    let mut reported = false;
    let write = |folder: &Path| shared.status().write(folder);
    loop {
        if let Err(error) = write(&folder)
            && !std::mem::replace(&mut reported, true)
        {
            tracing::warn!("{}: {error}; `platen status` will be out of date", folder.display());
        }
        tokio::time::sleep(STATE).await;
    }
}

/// Passes the changes of the record to one sink.
struct Pump {
    place: usize,
    name: String,
    shared: Arc<Shared>,
    feed: Feed,
    until_sent: bool,
}

/// Reason why a pump leaves its sink.
enum Leave {
    /// Nothing is left to send, and no more was asked for.
    Sent,
    /// The connection is gone.
    Lost(SinkError),
    /// The file of cursors cannot be written: going on would send for ever.
    Cursor(CursorError),
}

impl From<SinkError> for Leave {
    fn from(error: SinkError) -> Self {
        Self::Lost(error)
    }
}

impl From<CursorError> for Leave {
    fn from(error: CursorError) -> Self {
        Self::Cursor(error)
    }
}

impl From<platen_history::Error> for Leave {
    fn from(error: platen_history::Error) -> Self {
        Self::Lost(SinkError::Unavailable(error.to_string()))
    }
}

impl Pump {
    async fn run(mut self, mut sink: impl Sink, mut stop: watch::Receiver<bool>) -> Result<(), CursorError> {
        let mut wait = RETRY[0];
        loop {
            let left = tokio::select! {
                left = self.serve(&mut sink, &mut wait) => left,
                () = asked(&mut stop) => {
                    sink.close().await;
                    return Ok(());
                }
            };
            match left {
                Leave::Sent => {
                    sink.close().await;
                    return Ok(());
                }
                Leave::Cursor(error) => return Err(error),
                Leave::Lost(error) => self.lost(&error.to_string()),
            }
            tokio::select! {
                () = tokio::time::sleep(wait) => {}
                () = asked(&mut stop) => return Ok(()),
            }
            wait = (2 * wait).min(RETRY[1]);
        }
    }

    /// Connects and sends until there is a reason to leave.
    async fn serve(&mut self, sink: &mut impl Sink, wait: &mut Duration) -> Leave {
        let served = async {
            self.look()?;
            sink.connect().await?;
            self.update(|it| (it.connected, it.error) = (true, None));
            tracing::info!("{}: connected", self.name);
            loop {
                let (after, owners) = self.look()?;
                let owner = owners.last().map_or(0, |it| it.owner);
                let batch = self.feed.next(after, sink.batch())?;
                *wait = RETRY[0];
                if batch.last == after {
                    if self.until_sent {
                        return Err(Leave::Sent);
                    }
                    sink.idle(LOOK).await?;
                    continue;
                }
                for (n, why) in &batch.unreadable {
                    self.refused(owner, *n, why)?;
                }
                self.deliver(sink, &batch.messages, &owners).await?;
                self.shared.cursors.lock().set(&self.name, owner, batch.last)?;
            }
        };
        match served.await {
            Ok(never) => never,
            Err(leave) => leave,
        }
    }

    /// Sends messages; one that is refused for its content is noted and passed over.
    async fn deliver(
        &self,
        sink: &mut impl Sink,
        messages: &[Message],
        owners: &[Owner],
    ) -> Result<(), Leave> {
        let owner = owners.last().map_or(0, |it| it.owner);
        let receipts = match sink.deliver(messages, owners).await {
            Err(SinkError::Refused(_)) if messages.len() > 1 => {
                for one in messages {
                    Box::pin(self.deliver(sink, std::slice::from_ref(one), owners)).await?;
                }
                return Ok(());
            }
            Err(SinkError::Refused(why)) => {
                for message in messages {
                    self.refused(owner, message.n, &why)?;
                }
                return Ok(());
            }
            delivered => delivered?,
        };
        let sent = u64::try_from(messages.len()).unwrap_or_default();
        self.update(|it| {
            it.sent += sent;
            it.conflicts += receipts.conflicts;
            if receipts.apart != it.apart {
                if let Some(apart) = &receipts.apart {
                    tracing::warn!("{}: {apart}", self.name);
                }
                it.apart = receipts.apart.clone();
            }
        });
        if receipts.conflicts > 0 {
            tracing::warn!(
                "{}: {} changes differ from what is there under the same key",
                self.name,
                receipts.conflicts
            );
        }
        Ok(())
    }

    /// Returns the cursor and the owner numbers; notes how far the sink is behind.
    fn look(&mut self) -> Result<(u64, Vec<Owner>), Leave> {
        let owners = self.feed.owners()?;
        let after = self.shared.cursors.lock().of(&self.name, &owners)?;
        let backlog = self.feed.backlog(after)?;
        self.update(|it| (it.backlog, it.behind_s) = (backlog.changes, backlog.oldest_s));
        Ok((after, owners))
    }

    fn refused(&self, owner: u16, n: u64, why: &str) -> Result<(), CursorError> {
        tracing::warn!("{}: change {n} is passed over: {why}", self.name);
        let count = {
            let cursors = self.shared.cursors.lock();
            cursors.refuse(&self.name, owner, n, why)?;
            cursors.refused(&self.name)?
        };
        self.update(|it| it.refused = count);
        Ok(())
    }

    fn lost(&mut self, why: &str) {
        // The count goes on while the sink is away.
        let _ = self.look();
        self.update(|it| {
            if it.error.as_deref() != Some(why) {
                tracing::warn!("{}: {why}", self.name);
            }
            (it.connected, it.error) = (false, Some(why.to_owned()));
        });
    }

    fn update(&self, change: impl FnOnce(&mut SinkStatus)) {
        let mut sinks = self.shared.sinks.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(sink) = sinks.get_mut(self.place) {
            change(sink);
        }
    }
}
