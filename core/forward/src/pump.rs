//! At-least-once delivery to one sink: new changes of the record are sent, and the cursor follows the acknowledgements.

use std::sync::{Arc, PoisonError};
use std::time::Duration;

use platen_history::Owner;
use tokio::sync::watch;

use crate::cursor::CursorError;
use crate::feed::Feed;
use crate::message::Message;
use crate::shared::Shared;
use crate::sink::{Sink, SinkError};
use crate::status::SinkStatus;

/// Time between two checks for new changes.
const LOOK: Duration = Duration::from_millis(500);
/// First and longest wait before a connection is tried again; the wait is doubled after each failure.
const RETRY: [Duration; 2] = [Duration::from_secs(1), Duration::from_secs(30)];

/// Task that passes the changes of the record to one sink.
pub(crate) struct Pump {
    /// Index of the sink's state.
    pub(crate) place: usize,
    pub(crate) name: String,
    pub(crate) shared: Arc<Shared>,
    pub(crate) feed: Feed,
    /// True when the task ends as soon as all changes have been sent.
    pub(crate) until_sent: bool,
}

/// Reason why a pump leaves its sink.
enum Leave {
    /// All changes have been sent, and only that was requested.
    Sent,
    /// The connection is lost.
    Lost(SinkError),
    /// The file of cursors cannot be written: to continue would mean to send the same changes for ever.
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
    /// Serves a sink until the end is requested: connects, sends, and starts again after each failure.
    ///
    /// # Errors
    /// The file of cursors cannot be written.
    pub(crate) async fn run(
        mut self,
        mut sink: impl Sink,
        mut stop: watch::Receiver<bool>,
    ) -> Result<(), CursorError> {
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

    /// Sends messages; a message that is refused for its content is recorded and skipped.
    async fn deliver(
        &self,
        sink: &mut impl Sink,
        messages: &[Message],
        owners: &[Owner],
    ) -> Result<(), Leave> {
        let owner = owners.last().map_or(0, |it| it.owner);
        let receipt = match sink.deliver(messages, owners).await {
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
            it.conflicts += receipt.conflicts;
            if receipt.apart != it.apart {
                if let Some(apart) = &receipt.apart {
                    tracing::warn!("{}: {apart}", self.name);
                }
                it.apart = receipt.apart.clone();
            }
        });
        if receipt.conflicts > 0 {
            tracing::warn!(
                "{}: {} changes differ from what is there under the same key",
                self.name,
                receipt.conflicts
            );
        }
        Ok(())
    }

    /// Returns the cursor and the owner numbers; records the backlog of the sink.
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
        // The backlog is counted while the sink is not reachable.
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

/// Waits until the end is requested.
async fn asked(stop: &mut watch::Receiver<bool>) {
    // A dropped sender also counts as a request.
    let _ = stop.wait_for(|stop| *stop).await;
}
