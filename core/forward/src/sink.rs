//! Destination of messages: accepts them in order and acknowledges them when they are stored permanently.

use std::time::Duration;

use platen_history::Owner;

use crate::message::Message;

/// Longest wait for an answer of a server.
pub(crate) const ANSWER: Duration = Duration::from_secs(5);

/// Failure of a sink. After a broken connection a new one is opened, and the messages are sent again.
#[derive(Debug, thiserror::Error)]
pub(crate) enum SinkError {
    /// The server cannot be reached or used: a sentence that includes the action to take.
    #[error("{0}")]
    Unavailable(String),
    /// The server refuses this message for its content; others would be accepted.
    #[error("{0}")]
    Refused(String),
}

impl SinkError {
    pub(crate) fn silent(place: &str) -> Self {
        Self::Unavailable(format!(
            "{place}: no answer in {} s; look at the server, its disk and the network",
            ANSWER.as_secs()
        ))
    }
}

/// Receipt of a sink for messages that it has.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Receipt {
    /// Sentence where the sink keeps messages of this press separate, or has seen another host with its name.
    pub(crate) apart: Option<String>,
    /// Number of messages that differ from an earlier one under the same key.
    pub(crate) conflicts: u64,
}

/// A destination. The sink owns its connection; [`connect`](Self::connect) opens a new one after every failure.
pub(crate) trait Sink {
    /// Connects to the server.
    async fn connect(&mut self) -> Result<(), SinkError>;

    /// Sends messages and returns when the server has all of them. `owners` are the owner numbers of the record, the
    /// current one last.
    async fn deliver(&mut self, messages: &[Message], owners: &[Owner]) -> Result<Receipt, SinkError>;

    /// Keeps the connection alive while there is nothing to send.
    async fn idle(&mut self, time: Duration) -> Result<(), SinkError>;

    /// Closes the connection in an orderly way, so that the server does not take it for a failure.
    async fn close(&mut self);

    /// Returns the largest number of messages of one delivery.
    fn batch(&self) -> u32;
}
