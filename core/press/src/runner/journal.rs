//! The journal on a thread of its own: a slow disk must not stop the heartbeat.

use tokio::sync::{mpsc, oneshot};
use tokio::task::JoinHandle;

use crate::{Journal, Recalled, Record, Stage, StrokeKey};

/// What became of a record.
#[derive(Debug)]
pub(super) struct Done {
    pub(super) key: StrokeKey,
    pub(super) stage: Stage,
    pub(super) error: Option<String>,
}

/// The way to the journal's thread: records are written in the order in which they are sent.
#[derive(Debug)]
pub(super) struct JournalThread {
    records: mpsc::UnboundedSender<Record>,
    pub(super) done: mpsc::UnboundedReceiver<Done>,
    thread: JoinHandle<()>,
}

/// Reads the journal and starts its thread. The error is `None` when the thread ended by itself.
pub(super) async fn start<J: Journal>(mut journal: J) -> Result<(JournalThread, Recalled), Option<J::Error>> {
    let (records, mut queue) = mpsc::unbounded_channel::<Record>();
    let (tell, done) = mpsc::unbounded_channel();
    let (tell_recalled, recalled) = oneshot::channel();
    let thread = tokio::task::spawn_blocking(move || {
        let read = journal.recall();
        let failed = read.is_err();
        if tell_recalled.send(read).is_err() || failed {
            return;
        }
        while let Some(record) = queue.blocking_recv() {
            let error = journal.record(&record).err().map(|error| error.to_string());
            // Nobody may be left to hear it when the host ends.
            let _ = tell.send(Done { key: record.key(), stage: record.stage(), error });
        }
    });
    match recalled.await {
        Ok(Ok(recalled)) => Ok((JournalThread { records, done, thread }, recalled)),
        Ok(Err(error)) => Err(Some(error)),
        Err(_) => Err(None),
    }
}

impl JournalThread {
    /// Asks for a record; [`done`](Self::done) tells when it would survive a power cut.
    pub(super) fn record(&self, record: Record) -> Result<(), Record> {
        self.records.send(record).map_err(|refused| refused.0)
    }

    /// Waits until everything asked for is written.
    pub(super) async fn finish(self) {
        drop(self.records);
        if self.thread.await.is_err() {
            tracing::error!("the journal's thread panicked");
        }
    }
}
