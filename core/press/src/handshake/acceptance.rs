//! Conditions for accepting a stroke or a rescan, causes of a block, and missed strokes.
//!
//! A stroke is identified by session and number; the trigger is a level. Missed strokes are found from gaps in the
//! numbers, modulo the wrap of the counter.

use platen_plant::press::{NoAck, OnMissed, OnStorageFull};

use super::machine::Handshake;
use super::{Transition, Work};
use crate::{Code, PressImage};

impl Handshake {
    /// Returns the reason why no stroke is accepted.
    pub(super) fn obstacle(&self) -> Option<Code> {
        let policy = self.config.policy;
        let storage = !self.storage_ok && policy.on_storage_full == OnStorageFull::Stop;
        let missed = self.missed && policy.on_missed_stroke == OnMissed::Block;
        None.or(self.scanner.err())
            .or(self.stale.then_some(Code::PressStale))
            .or(storage.then_some(Code::StorageFailed))
            .or(missed.then_some(Code::MissedStroke))
    }

    pub(super) fn blocked(&self) -> bool {
        self.obstacle().is_some() || self.press.as_ref().is_some_and(|press| !press.enable)
    }

    /// Returns whether the next stroke waits for the acknowledgement of a result, by policy.
    pub(super) fn held(&self) -> bool {
        self.work == Work::WaitAck && self.config.policy.no_ack == NoAck::Hold
    }

    /// Returns whether the trigger rose while the last stroke was being measured. Such a trigger is no acknowledgement
    /// of the result, which the press cannot have read.
    pub(super) fn trigger_is_early(&self) -> bool {
        let here = self.press.as_ref().map(|press| (press.session_id, press.stroke_id));
        here == self.counted && self.last.is_some_and(|last| here != Some((last.session, last.stroke)))
    }

    /// Returns the image of the press if its trigger is debounced and there is a stroke number.
    pub(super) fn settled_trigger(&self) -> Option<&PressImage> {
        let needed = if self.config.counter.is_some() { self.config.debounce_reads } else { 1 };
        let none =
            |press: &PressImage| self.config.counter.is_some_and(|it| it.first == 1) && press.stroke_id == 0;
        self.press.as_ref().filter(|press| press.trigger && self.held_reads >= needed.max(1) && !none(press))
    }

    pub(super) fn stroke_waits(&self) -> bool {
        let new = |press: &&PressImage| {
            self.last.is_none_or(|last| (press.session_id, press.stroke_id) != (last.session, last.stroke))
        };
        let early = self.work == Work::WaitAck && self.trigger_is_early();
        !self.blocked() && !self.held() && !early && self.settled_trigger().filter(new).is_some()
    }

    pub(super) fn rescan_wanted(&self) -> bool {
        let Some(press) = self.press.as_ref().filter(|press| press.rescan) else { return false };
        let asked = if self.config.counts_attempts { press.attempt != self.asked } else { self.rescan_rose };
        let same = self.last.is_some_and(|last| self.press_is_at(last));
        asked && same && !self.blocked() && !self.held()
    }

    pub(super) fn another_stroke(&self) -> bool {
        let here = |press: &PressImage| (press.session_id, press.stroke_id);
        let active = self.stroke().map(|key| (key.session, key.stroke));
        self.settled_trigger()
            .is_some_and(|press| Some(here(press)) != active && Some(here(press)) != self.counted)
    }

    /// Counts a stroke that came while another was active. It is not queued, since the plate has moved.
    pub(super) fn record_missed(&mut self) -> Transition {
        if let Some(press) = &self.press {
            let here = (press.session_id, press.stroke_id);
            let missed = self.steps_to(here).map_or(1, |(steps, back)| if back { 1 } else { steps });
            self.counted = Some(here);
            self.count_missed(missed);
        }
        Transition::StrokeMissed
    }

    /// Returns the steps of the stroke counter since the last accounted stroke, and whether it went back; `None` in
    /// another session or without a counter.
    pub(super) fn steps_to(&self, (session, stroke): (u16, u16)) -> Option<(u32, bool)> {
        let counter = self.config.counter?;
        let (_, before) = self.counted.filter(|&(counted_session, _)| counted_session == session)?;
        let steps = counter.distance(before, stroke);
        Some((steps, steps > u32::from(counter.wrap) / 2))
    }

    pub(super) fn count_missed(&mut self, strokes: u32) {
        if strokes > 0 {
            self.missed = true;
            self.missed_total += u64::from(strokes);
            self.missed_count = self.missed_count.saturating_add(u16::try_from(strokes).unwrap_or(u16::MAX));
            self.warn(Code::MissedStroke);
        }
    }
}
