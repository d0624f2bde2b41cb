//! Forwarder: each sink is served by a separate task with its own reader and cursor.
//!
//! A sink that stalls, gives wrong answers or is not reachable delays no other sink. The press is not affected, since
//! the record is only read.

use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use platen_plant::{Forward, PlantFile, SinkKind, SinkUse};
use tokio::sync::watch;
use tokio::task::{JoinSet, LocalSet};

use crate::cursor::{CursorError, SharedCursors};
use crate::feed::Feed;
use crate::message::Names;
use crate::mqtt::MqttSink;
use crate::postgresql::PostgresqlSink;
use crate::pump::Pump;
use crate::shared::Shared;
use crate::sparkplug::SparkplugSink;
use crate::status::{ForwardStatus, SinkStatus};

/// File of the cursors, beside the record.
const CURSORS: &str = "forward.sqlite";
/// Time between two checks for a new state.
const STATE: Duration = Duration::from_secs(1);
/// Number of checks after which an unchanged state is written again: its time shows that the forwarder runs.
const SAME: u32 = 5;

/// Change from which the sinks begin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Start {
    /// The cursor of each sink.
    Cursor,
    /// After the changes before this stroke: changes that were sent are sent again.
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

/// Resets the cursors of all sinks to an earlier change.
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

/// Writes the state to the output folder when it has changed, at most once a second: replacing a file delays the host's
/// next sync of its record.
async fn keep(shared: Arc<Shared>, folder: std::path::PathBuf) {
    let mut reported = false;
    let (mut written, mut looks) = (None, 0);
    loop {
        let status = shared.status();
        if looks % SAME == 0 || written.as_ref() != Some(&status.sinks) {
            if let Err(error) = status.write(&folder)
                && !std::mem::replace(&mut reported, true)
            {
                tracing::warn!("{}: {error}; `platen status` will be out of date", folder.display());
            }
            (written, looks) = (Some(status.sinks), 0);
        }
        looks += 1;
        tokio::time::sleep(STATE).await;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs in virtual time, half a second after each check.
    #[tokio::test(start_paused = true)]
    async fn a_state_is_written_when_it_changes_and_now_and_then() {
        let folder = tempfile::tempdir().unwrap();
        let shared = Arc::new(Shared {
            cursors: SharedCursors::open(&folder.path().join(CURSORS)).unwrap(),
            sinks: Mutex::new(vec![SinkStatus::new("historian", "postgresql")]),
        });
        let written = || ForwardStatus::load(folder.path()).unwrap().unwrap();
        let keeper = tokio::spawn(keep(Arc::clone(&shared), folder.path().to_owned()));
        tokio::time::sleep(STATE / 2).await;
        let first = written();
        tokio::time::sleep(3 * STATE).await;
        assert_eq!(written(), first, "nothing changed");
        shared.sinks.lock().unwrap()[0].sent = 7;
        tokio::time::sleep(STATE).await;
        let changed = written();
        assert_eq!(changed.sinks[0].sent, 7);
        tokio::time::sleep(SAME * STATE).await;
        assert!(written().at > changed.at, "the time shows that the forwarder runs");
        keeper.abort();
    }
}
