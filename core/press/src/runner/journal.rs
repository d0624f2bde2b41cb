//! Journal on a thread of its own, so that a slow disk does not stop the heartbeat.

use std::time::Duration;

use tokio::sync::mpsc;
use tokio::task::{JoinHandle, spawn_blocking};
use tokio::time::Instant;

use crate::{Journal, Recalled, Record, Stage, StrokeKey};

/// Completion of a record.
#[derive(Debug)]
pub(super) struct Done {
    pub(super) key: StrokeKey,
    pub(super) stage: Stage,
    pub(super) error: Option<String>,
    pub(super) took: Duration,
}

/// Queue to the journal: records are written in the order in which they are sent.
#[derive(Debug)]
pub(super) struct Recorder {
    records: mpsc::UnboundedSender<Record>,
    pub(super) done: mpsc::UnboundedReceiver<Done>,
    task: JoinHandle<()>,
}

/// Reads the journal and starts its thread. The error is `None` when the journal panicked.
pub(super) async fn start<J: Journal>(mut journal: J) -> Result<(Recorder, Recalled), Option<J::Error>> {
    let read = spawn_blocking(move || (journal.recall(), journal)).await;
    let (recalled, journal) = read.map_err(|_| None)?;
    let (records, queue) = mpsc::unbounded_channel();
    let (completions, done) = mpsc::unbounded_channel();
    let task = tokio::spawn(write(journal, queue, completions));
    Ok((Recorder { records, done, task }, recalled.map_err(Some)?))
}

async fn write<J: Journal>(
    mut journal: J,
    mut queue: mpsc::UnboundedReceiver<Record>,
    completions: mpsc::UnboundedSender<Done>,
) {
    while let Some(record) = queue.recv().await {
        let (key, stage) = (record.key(), record.stage());
        let asked = Instant::now();
        let written = spawn_blocking(move || (journal.record(&record), journal)).await;
        let Ok((result, back)) = written else { return };
        journal = back;
        let error = result.err().map(|error| error.to_string());
        // The receiver may be gone when the host ends.
        let _ = completions.send(Done { key, stage, error, took: asked.elapsed() });
    }
}

impl Recorder {
    /// Queues a record; [`done`](Self::done) receives its completion when it would survive a power cut.
    ///
    /// # Errors
    /// The record, when the journal has panicked.
    pub(super) fn record(&self, record: Record) -> Result<(), Record> {
        self.records.send(record).map_err(|refused| refused.0)
    }

    /// Waits until all records are written.
    pub(super) async fn finish(self) {
        drop(self.records);
        if self.task.await.is_err() {
            tracing::error!("the journal panicked");
        }
    }
}
