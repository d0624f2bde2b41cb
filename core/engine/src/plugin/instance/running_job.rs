//! Running job of a plugin: its frames in order of arrival, its deadline, its cancellation.

use std::sync::MutexGuard;
use std::time::{Duration, Instant};

use platen_abi::status;
use platen_sdk::exchange::{AlignedBuffer, DecodeError, Payload};

use super::{Instance, State};
use crate::plugin::PluginError;
use crate::plugin::job::CancelToken;
use crate::plugin::worker::{CallError, JobEvent, Link, LinkError};

/// Grace period: time for a plugin to return after its cancellation, before its process is ended.
const GRACE: Duration = Duration::from_millis(500);
/// Period at which a waiting job checks for cancellation.
const CANCEL_POLL: Duration = Duration::from_millis(20);

/// A frame that a plugin emitted.
#[derive(Debug)]
pub struct Emitted {
    /// Name of the format.
    pub format: String,
    buffer: AlignedBuffer,
}

impl Emitted {
    /// Returns the data, unchecked.
    pub fn bytes(&self) -> &[u8] {
        self.buffer.as_ref()
    }

    /// Returns whether the frame has the format of `T`.
    pub fn is<T: Payload>(&self) -> bool {
        self.format.as_bytes() == T::FORMAT.to_bytes()
    }

    /// Reads the value in the frame.
    ///
    /// # Errors
    /// As [`Payload::decode`].
    pub fn decode<T: Payload>(&self) -> Result<T, DecodeError> {
        T::decode(self.bytes())
    }
}

/// A job in progress. Dropping it before its end cancels it and waits for the plugin.
#[derive(Debug)]
pub struct RunningJob<'a> {
    instance: &'a Instance,
    /// Held until the job has ended.
    state: Option<MutexGuard<'a, State>>,
    id: u64,
    deadline: Instant,
    started: Instant,
    token: CancelToken,
    cancelled_at: Option<Instant>,
    result: Option<Result<(), PluginError>>,
}

impl<'a> RunningJob<'a> {
    /// Creates the job that was just sent to the plugin's worker.
    pub(super) fn new(
        instance: &'a Instance,
        state: MutexGuard<'a, State>,
        id: u64,
        started: Instant,
        limit: Duration,
        token: CancelToken,
    ) -> Self {
        Self {
            instance,
            state: Some(state),
            id,
            deadline: started + limit,
            started,
            token,
            cancelled_at: None,
            result: None,
        }
    }

    /// Returns the next frame; `None` at the end of the job.
    pub fn next_frame(&mut self) -> Option<Emitted> {
        while self.result.is_none() {
            if self.token.is_cancelled() && self.cancelled_at.is_none() {
                self.cancel();
            }
            let now = Instant::now();
            let until = self.cancelled_at.map_or(self.deadline, |at| at + GRACE);
            let left = until.saturating_duration_since(now);
            let id = self.id;
            let next = match self.link() {
                Some(link) => link.next_of_job(id, now + left.min(CANCEL_POLL)),
                None => Err(LinkError::Died("it is gone".into())),
            };
            match next {
                Ok(Some(JobEvent::Frame { format, buffer })) if self.cancelled_at.is_none() => {
                    return Some(Emitted { format, buffer });
                }
                Ok(Some(JobEvent::Frame { .. })) => {}
                Ok(Some(JobEvent::Done(result))) => self.end(result),
                Ok(None) if left > CANCEL_POLL => {}
                Ok(None) if self.cancelled_at.is_none() => self.cancel(),
                Ok(None) => self.fail(LinkError::Hung(self.started.elapsed())),
                Err(error) => self.fail(error),
            }
        }
        None
    }

    fn link(&mut self) -> Option<&mut Link> {
        self.state.as_mut().and_then(|state| state.link.as_mut())
    }

    /// Records the end of a job: one that was stopped is reported as stopped, whatever the plugin returned.
    fn end(&mut self, result: Result<(), CallError>) {
        let late = Instant::now() >= self.deadline;
        let cancelled = matches!(&result, Err(error) if error.status == status::CANCELLED);
        if self.cancelled_at.is_some() || (cancelled && late) {
            self.state = None;
            self.result = Some(Err(PluginError::Stopped {
                name: self.instance.name().to_owned(),
                elapsed_ms: self.started.elapsed().as_millis() as u64,
                why: if late { "its deadline passed" } else { "it was cancelled" },
            }));
            return;
        }
        match (result, self.state.take()) {
            (Ok(()), Some(mut state)) => {
                state.faults.success();
                self.result = Some(Ok(()));
            }
            (Ok(()), None) => self.result = Some(Ok(())),
            (Err(error), state) => {
                self.state = state;
                self.fail(LinkError::Call(error));
            }
        }
    }

    fn fail(&mut self, error: LinkError) {
        if let Some(mut state) = self.state.take() {
            self.result = Some(Err(self.instance.failed(&mut state, error, self.started)));
        }
    }

    /// Cancels the job; later frames are dropped.
    pub fn cancel(&mut self) {
        self.cancelled_at = Some(Instant::now());
        let id = self.id;
        if let Some(link) = self.link() {
            link.cancel(id);
        }
    }

    /// Waits for the end; later frames are dropped.
    ///
    /// # Errors
    /// The reason of the failure.
    pub fn finish(&mut self) -> Result<(), PluginError> {
        while self.next_frame().is_some() {}
        self.result.clone().unwrap_or(Ok(()))
    }

    /// Returns the error of a plugin that violated the contract of the boundary, and ends its process.
    pub(in crate::plugin) fn misbehaved(&mut self, what: impl Into<String>) -> PluginError {
        let name = self.instance.name().to_owned();
        let mut error = PluginError::Misbehaved { name, what: what.into() };
        let state = self.state.take();
        if let Some(mut state) = state.or_else(|| self.instance.state().ok()) {
            error = self.instance.fault(&mut state, error);
        }
        self.result = Some(Err(error.clone()));
        error
    }
}

impl Drop for RunningJob<'_> {
    fn drop(&mut self) {
        if self.result.is_some() {
            return;
        }
        if self.cancelled_at.is_none() {
            self.cancel();
        }
        let ended = self.finish();
        tracing::debug!(plugin = self.instance.name(), ?ended, "cancelled before its end");
    }
}
