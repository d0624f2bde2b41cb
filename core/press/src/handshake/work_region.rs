//! Actions of the work region: the active stroke from its acceptance to the acknowledgement.
//!
//! In order: accept, start the scan, begin the evaluation, conclude, publish, acknowledge; give up from accepted or
//! scanning. A commitment to the press is made only after its record is in the journal.

use std::time::Duration;

use platen_plant::press::OnStorageFull;

use super::machine::{ActiveStroke, Handshake};
use super::messages::{Command, Effect};
use super::{LinkState, Transition, Work};
use crate::{Acknowledgement, Code, Measurement, PressImage, Publication, Record, StrokeKey, Verdict};

/// Limit of one record of the journal; after it the record counts as failed.
const JOURNAL_LIMIT: Duration = Duration::from_secs(10);

impl Handshake {
    pub(super) fn accept_stroke(&mut self, now: Duration, transition: Transition) -> Transition {
        let Some(press) = self.press.clone() else { return transition };
        let here = (press.session_id, press.stroke_id);
        match self.steps_to(here) {
            Some((_, true)) => self.warn(Code::CounterBack),
            Some((steps, false)) => self.count_missed(steps.saturating_sub(1)),
            None => {}
        }
        self.accept(press, now);
        transition
    }

    pub(super) fn accept_rescan(&mut self, now: Duration, transition: Transition) -> Transition {
        if let Some(press) = self.press.clone() {
            self.accept(press, now);
        }
        transition
    }

    pub(super) fn accept(&mut self, press: PressImage, now: Duration) {
        if let Some(key) = self.unacked.take() {
            let how =
                if self.trigger_is_early() { Acknowledgement::Never } else { Acknowledgement::NextStroke };
            self.close(key, how);
        }
        if self.last.is_some_and(|last| last.session != press.session_id) {
            self.attempts.clear();
        }
        let known = self.attempts.get(&press.stroke_id);
        let attempt = known.map_or(press.attempt, |known| press.attempt.max(known.saturating_add(1)));
        self.attempts.insert(press.stroke_id, attempt);
        self.forget_old_lap(press.stroke_id);
        let key = StrokeKey {
            press: self.config.press,
            session: press.session_id,
            stroke: press.stroke_id,
            attempt,
        };
        self.run_id = self.run_id.wrapping_add(1);
        self.last = Some(key);
        // An acknowledge that is up now belongs to an earlier result.
        self.ack_was_low = !press.ack;
        self.asked = press.attempt;
        self.counted = Some((key.session, key.stroke));
        let data = Box::new(press.data.clone());
        self.effects.push(Effect::Journal(Record::Accepted { key, run_id: self.run_id, data }));
        self.active = Some(ActiveStroke::new(key, self.run_id, press.data, now));
        self.work = Work::Accepted;
    }

    /// Deletes attempts from the previous round of the stroke counter, whose numbers are used again.
    pub(super) fn forget_old_lap(&mut self, stroke: u16) {
        if let Some(counter) = self.config.counter {
            let half = u32::from(counter.wrap) / 2;
            self.attempts.retain(|&known, _| counter.distance(known, stroke) <= half);
        }
    }

    pub(super) fn journaled(&self) -> bool {
        self.active.as_ref().is_some_and(|active| active.journaled.is_some())
    }

    pub(super) fn journal_overdue(&self, now: Duration) -> bool {
        self.active.as_ref().is_some_and(|active| {
            active.journaled.is_none() && now.saturating_sub(active.since) >= JOURNAL_LIMIT
        })
    }

    pub(super) fn journal_failed(&mut self) {
        if let Some(active) = &mut self.active {
            active.journaled = Some(false);
        }
        self.storage_failed();
    }

    /// Returns whether the scan may start: press clear, and acceptance journalled or storage degraded by policy.
    pub(super) fn clear_to_start(&self) -> bool {
        let stored = self.active.as_ref().and_then(|active| active.journaled);
        let may = stored == Some(true) || stored.is_some() && !self.storage_stops();
        may && self.press.as_ref().is_some_and(|press| press.clear_to_scan && press.enable && !press.abort)
    }

    pub(super) fn storage_stops(&self) -> bool {
        self.config.policy.on_storage_full == OnStorageFull::Stop
    }

    pub(super) fn start_scan(&mut self, now: Duration) -> Transition {
        if let Some(active) = &mut self.active {
            active.scan_started_at = Some(now);
            active.since = now;
            let data = Box::new(active.data.clone());
            self.effects.push(Effect::Command(Command::Scan {
                key: active.key,
                run_id: active.run_id,
                data,
            }));
        }
        self.work = Work::Scanning;
        Transition::ScanStarted
    }

    /// Returns the reason why the scan must not start or continue. A stroke whose acceptance is still being journalled
    /// is not given up, since it will be echoed.
    pub(super) fn given_up(&self, now: Duration) -> Option<Code> {
        let active = self.active.as_ref()?;
        let scanning = self.work == Work::Scanning;
        if !scanning && active.journaled.is_none() {
            return None;
        }
        let press = self.press.as_ref().filter(|_| self.link == LinkState::Online);
        let asks = |bit: fn(&PressImage) -> bool| press.is_some_and(bit);
        let failed = active.outcome.as_ref().filter(|_| !active.acquired).and_then(Measurement::reason);
        let overdue = now.saturating_sub(active.since) >= self.scan_limit();
        let unstored = active.journaled == Some(false) && self.storage_stops() && !scanning;
        failed
            .or(asks(|press| press.abort).then_some(Code::ScanAborted))
            .or(asks(|press| !press.enable).then_some(Code::PressDisabled))
            .or((scanning && !active.acquired && asks(|press| !press.clear_to_scan))
                .then_some(Code::NotClear))
            .or((overdue && scanning).then_some(Code::ScanTimeout))
            .or((overdue && !scanning).then_some(Code::NotClear))
            .or(unstored.then_some(Code::StorageFailed))
    }

    pub(super) fn give_up(&mut self, now: Duration) -> Transition {
        let code = self.given_up(now).unwrap_or(Code::ScanFailed);
        if let (Work::Scanning, Some(key)) = (self.work, self.stroke()) {
            self.effects.push(Effect::Command(Command::Cancel(key)));
        }
        self.finish(Measurement::not_measured(code), Work::Aborted, now);
        Transition::ScanGivenUp
    }

    pub(super) fn scan_complete(&self) -> bool {
        self.active.as_ref().is_some_and(|active| active.acquired || active.outcome.is_some())
    }

    pub(super) fn begin_evaluation(&mut self, now: Duration) -> Transition {
        if let Some(active) = &mut self.active {
            active.acquired_at = Some(now);
            active.since = now;
            self.effects.push(Effect::Journal(Record::Scanned { key: active.key }));
            self.effects.push(Effect::Command(Command::Evaluate(active.key)));
        }
        self.work = Work::Evaluating;
        Transition::ScanTaken
    }

    pub(super) fn evaluated(&self, now: Duration) -> bool {
        let limit = self.config.timeouts.evaluate;
        self.active
            .as_ref()
            .is_some_and(|active| active.outcome.is_some() || now.saturating_sub(active.since) >= limit)
    }

    pub(super) fn conclude(&mut self, now: Duration) -> Transition {
        let outcome = self.active.as_mut().and_then(|active| active.outcome.take());
        if outcome.is_none()
            && let Some(key) = self.stroke()
        {
            self.effects.push(Effect::Command(Command::Cancel(key)));
        }
        let outcome = outcome.unwrap_or_else(|| Measurement::not_measured(Code::EvaluationTimeout));
        let measured = outcome.verdict() != Verdict::NotMeasured;
        self.finish(outcome, Work::Publish, now);
        if measured { Transition::StrokeMeasured } else { Transition::StrokeNotMeasured }
    }

    /// Makes the result final and journals it; the registers follow after the record.
    pub(super) fn finish(&mut self, mut measurement: Measurement, next: Work, now: Duration) {
        let Some(active) = &mut self.active else { return };
        if let Some(code) = measurement.reason() {
            self.effects.push(Effect::Alarm(code));
        } else {
            active.add_times(&mut measurement.figures, now);
        }
        self.result_seq = self.result_seq.checked_add(1).unwrap_or(1);
        let publication = Publication {
            key: active.key,
            run_id: active.run_id,
            seq: self.result_seq,
            recipe_id: active.data.recipe_id,
            measurement,
        };
        self.effects.push(Effect::Journal(Record::Finished(Box::new(publication.clone()))));
        active.publication = Some(publication);
        active.journaled = None;
        active.since = now;
        self.work = next;
    }

    pub(super) fn published(&mut self, now: Duration) -> Transition {
        self.unacked = self.stroke();
        self.work = Work::WaitAck;
        if let Some(active) = &mut self.active {
            active.since = now;
        }
        Transition::ResultPublished
    }

    /// Returns whether the press acknowledges this result. An acknowledgement older than the result belongs to another
    /// one.
    pub(super) fn acknowledged(&self) -> bool {
        let ack = self.press.as_ref().is_some_and(|press| press.ack);
        ack && self.ack_was_low && self.unacked.is_some()
    }

    pub(super) fn acked(&mut self, now: Duration) -> Transition {
        if let Some(key) = self.unacked {
            self.close(key, Acknowledgement::Explicit);
        }
        self.ack_was_low = false;
        self.work = Work::Clear;
        if let Some(active) = &mut self.active {
            active.since = now;
        }
        Transition::ResultAcknowledged
    }

    pub(super) fn ack_overdue(&self, now: Duration) -> bool {
        let waited = self.active.as_ref().map_or(Duration::MAX, |active| now.saturating_sub(active.since));
        if self.held() { self.reset } else { waited >= self.config.timeouts.ack }
    }

    /// Stops waiting; the result stays in the registers, the next stroke acknowledges it.
    pub(super) fn go_on_without_ack(&mut self, _now: Duration) -> Transition {
        self.warn(Code::AckTimeout);
        self.work = Work::Idle;
        Transition::AckTimedOut
    }

    pub(super) fn ack_dropped(&self, now: Duration) -> bool {
        let waited = self.active.as_ref().map_or(Duration::MAX, |active| now.saturating_sub(active.since));
        let ack = self.press.as_ref().is_some_and(|press| press.ack);
        !ack || waited >= self.config.timeouts.clear
    }
}
