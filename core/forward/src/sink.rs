//! Destination of messages: takes them in order and says when it has them for good.

use std::time::Duration;

use platen_history::Owner;

use crate::message::Message;

/// Longest wait for an answer of a server.
pub(crate) const ANSWER: Duration = Duration::from_secs(5);

/// Failure of a sink. A broken connection is built anew; the messages are sent again.
#[derive(Debug, thiserror::Error)]
pub(crate) enum SinkError {
    /// The server cannot be reached or used: a sentence with what to do.
    #[error("{0}")]
    Unavailable(String),
    /// The server refuses this one message for its content; others would pass.
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
    /// The sink keeps messages of this press apart, or saw another host with its name: a sentence.
    pub(crate) apart: Option<String>,
    /// Messages that differ from one that was there under the same key.
    pub(crate) conflicts: u64,
}

/// A destination. The connection is the sink's own; [`connect`](Self::connect) makes a new one after every failure.
pub(crate) trait Sink {
    /// Connects.
    async fn connect(&mut self) -> Result<(), SinkError>;

    /// Sends messages and returns when the server has all of them. `owners` are the owner numbers of the record, the one in force last.
    async fn deliver(&mut self, messages: &[Message], owners: &[Owner]) -> Result<Receipt, SinkError>;

    /// Keeps the connection alive while there is nothing to send.
    async fn idle(&mut self, time: Duration) -> Result<(), SinkError>;

    /// Takes leave: the server knows that the end is meant.
    async fn close(&mut self);

    /// Most messages of one delivery.
    fn batch(&self) -> u32;
}
