//! Wanted registers of the host as a function of the state.
//!
//! The registers are derived after every step. Until the acceptance of a stroke is journalled, the registers about the
//! stroke keep their former values, because an echo commits the host to the stroke.

use std::time::Duration;

use platen_model::Measure;
use platen_plant::press::OnMissed;

use super::machine::{ActiveStroke, Handshake};
use super::trigger_edges::EdgeCounter;
use super::{LinkState, Work};
use crate::{Code, Figures, HostImage, Publication, Severity};

impl Work {
    /// Returns whether a stroke is active, so that another one is missed.
    pub(super) fn is_busy(self) -> bool {
        matches!(self, Self::Accepted | Self::Scanning | Self::Evaluating | Self::Aborted | Self::Publish)
    }
}

impl ActiveStroke {
    /// Adds the times of the state machine where the evaluation has given none.
    pub(super) fn add_times(&self, figures: &mut Figures, now: Duration) {
        let mut add = |measure, from: Option<Duration>, to: Option<Duration>| {
            if let (Some(from), Some(to)) = (from, to) {
                figures.values.entry(measure).or_insert(to.saturating_sub(from).as_secs_f64());
            }
        };
        add(Measure::ScanTime, self.scan_started_at, self.acquired_at);
        add(Measure::EvaluateTime, self.acquired_at, Some(now));
        add(Measure::StrokeToResultTime, Some(self.accepted_at), Some(now));
    }
}

impl Handshake {
    /// Updates the image from the state. While the acceptance of a stroke is not journalled, the fields of the stroke
    /// before are kept.
    pub(super) fn refresh_image(&mut self) {
        let present = self.present_image();
        let promised = self.work != Work::Accepted || self.journaled();
        let before = std::mem::take(&mut self.image);
        self.image = if promised { present } else { self.unpromised(present, before) };
    }

    fn unpromised(&self, present: HostImage, before: HostImage) -> HostImage {
        let stopped = matches!(self.link, LinkState::Stopped { .. });
        let (result, valid) = (before.result.as_ref(), before.valid && !stopped);
        HostImage {
            ready: self.link == LinkState::Online && !self.blocked(),
            busy: false,
            valid,
            error: self.error(result, valid).filter(|_| !stopped),
            warning: self.present_warning(result).filter(|_| !stopped),
            scan_done: before.scan_done && !stopped,
            ack_stroke_id: before.ack_stroke_id,
            session: before.session,
            attempt: before.attempt,
            result_seq: before.result_seq,
            result: before.result,
            ..present
        }
    }

    fn present_image(&self) -> HostImage {
        let result = self.result();
        let online = self.link == LinkState::Online;
        let stopped = matches!(self.link, LinkState::Stopped { .. });
        let waiting = self.work == Work::Publish && result.is_none();
        let busy = self.work.is_busy() && (self.work != Work::Publish || waiting);
        let standing = self.work == Work::Publish || self.unacked.is_some() && self.work != Work::Clear;
        let valid = result.is_some() && standing && !stopped;
        let stroke = self.stroke().or(self.last);
        HostImage {
            ready: online && !busy && !self.blocked() && !self.held() && self.sees_the_next_stroke(),
            busy: busy && !stopped,
            valid,
            scan_done: self.active.as_ref().is_some_and(|active| active.acquired_at.is_some()) && !stopped,
            missed: self.missed && !stopped,
            missed_count: self.missed_count,
            simulated: self.config.simulated && !stopped,
            storage_degraded: !self.storage_ok && !stopped,
            calibration_invalid: self.scanner == Err(Code::CalibrationInvalid) && !stopped,
            ack_stroke_id: stroke.map_or(0, |key| key.stroke),
            session: stroke.map_or(0, |key| key.session),
            attempt: stroke.map_or(0, |key| key.attempt),
            error: self.error(result, valid).filter(|_| !stopped),
            warning: self.present_warning(result).filter(|_| !stopped),
            result_seq: result.map_or(self.image.result_seq, |result| result.seq),
            result: result.cloned(),
            owner: self.owner,
            host_state: self.state().number(),
        }
    }

    /// Returns whether the next stroke will be detected. Without stroke numbers, ready waits until the debounced
    /// trigger is low: a press that raises it again between two reads would bend a plate without a measurement.
    fn sees_the_next_stroke(&self) -> bool {
        self.trigger_edges.as_ref().is_none_or(EdgeCounter::armed)
    }

    /// Returns the result that may be in the registers: the last one, once it is journalled.
    fn result(&self) -> Option<&Publication> {
        let pending = self.work == Work::Aborted || self.work == Work::Publish && !self.journaled();
        self.active.as_ref().filter(|_| !pending)?.publication.as_ref()
    }

    /// Returns the most urgent error, in this order: fault; while the result is `valid`, the reason why the stroke was
    /// not measured, so that no unrelated code appears beside its number; cause of the block; missed stroke.
    fn error(&self, result: Option<&Publication>, valid: bool) -> Option<Code> {
        let fault = if let LinkState::Fault(code) = self.link { Some(code) } else { None };
        let obstacle = self.obstacle().filter(|code| code.alarm().severity == Severity::Error);
        let missed = self.missed && self.config.policy.on_missed_stroke != OnMissed::Warn;
        let unmeasured = result.and_then(|result| result.measurement.reason());
        let urgent = fault.or(unmeasured.filter(|_| valid)).or(obstacle);
        urgent.or(unmeasured).or(missed.then_some(Code::MissedStroke))
    }

    fn present_warning(&self, result: Option<&Publication>) -> Option<Code> {
        let stale = self.stale.then_some(Code::PressStale);
        let storage = (!self.storage_ok).then_some(Code::StorageDegraded);
        stale.or(storage).or(self.warning).or(result.and_then(|result| result.measurement.warning))
    }
}
