//! Stroke numbers for a press that has none: debounced rising edges of the trigger.
//!
//! Used by the profiles without stroke numbers. A missed edge cannot be detected.

use crate::{PressImage, Recalled, Stage};

/// Counter of rising edges. A level is valid after `needed_reads` equal reads.
#[derive(Debug, Clone)]
pub(super) struct EdgeCounter {
    needed_reads: u8,
    level: Option<bool>,
    candidate: bool,
    reads: u8,
    session: u16,
    stroke: u16,
    pending: bool,
}

impl EdgeCounter {
    /// Makes a counter that continues after the last stroke of the journal.
    pub(super) fn new(needed_reads: u8, recalled: &Recalled) -> Self {
        let last = recalled.last.as_ref();
        Self {
            needed_reads: needed_reads.max(1),
            level: None,
            candidate: false,
            reads: 0,
            session: last.map_or(1, |entry| entry.key.session.max(1)),
            stroke: last.map_or(0, |entry| entry.key.stroke),
            pending: last.is_some_and(|entry| entry.stage < Stage::Acked),
        }
    }

    /// Writes the debounced trigger and its stroke number into an image. A trigger that is up at the first read is the
    /// last stroke of the journal if that is not acknowledged, else a new stroke.
    pub(super) fn number(&mut self, image: &mut PressImage) {
        self.reads = if image.trigger == self.candidate { self.reads.saturating_add(1) } else { 1 };
        self.candidate = image.trigger;
        if self.reads >= self.needed_reads && self.level != Some(self.candidate) {
            let known = self.level.is_none() && self.pending;
            if self.candidate && !known {
                self.count();
            }
            self.level = Some(self.candidate);
        }
        image.trigger = self.level == Some(true);
        image.session_id = self.session;
        image.stroke_id = self.stroke;
    }

    /// Returns whether the debounced trigger is low, so that the next rising edge will be detected.
    pub(super) fn armed(&self) -> bool {
        self.level == Some(false)
    }

    fn count(&mut self) {
        if self.stroke == u16::MAX {
            self.session = self.session.checked_add(1).unwrap_or(1);
        }
        self.stroke = self.stroke.checked_add(1).unwrap_or(1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn strokes(counter: &mut EdgeCounter, levels: &[u8]) -> Vec<(bool, u16)> {
        let number = |&level: &u8| {
            let mut image = PressImage { trigger: level == 1, ..PressImage::default() };
            counter.number(&mut image);
            (image.trigger, image.stroke_id)
        };
        levels.iter().map(number).collect()
    }

    #[test]
    fn a_stroke_is_a_settled_rising_trigger() {
        let mut counter = EdgeCounter::new(2, &Recalled::empty(1));
        let seen = strokes(&mut counter, &[0, 0, 1, 0, 1, 1, 0, 1, 1, 0, 0, 1, 1]);
        let numbers: Vec<u16> = seen.iter().map(|&(_, stroke)| stroke).collect();
        assert_eq!(numbers, [0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 2]);
        assert!(seen[6].0, "one low reading is a bounce");
        strokes(&mut counter, &[0]);
        assert!(!counter.armed(), "a rising edge now is a bounce");
        strokes(&mut counter, &[0]);
        assert!(counter.armed());
    }

    #[test]
    fn numbers_wrap_into_a_new_session() {
        let mut counter = EdgeCounter::new(1, &Recalled::empty(1));
        counter.stroke = u16::MAX;
        let mut image = PressImage { trigger: true, ..PressImage::default() };
        counter.number(&mut image);
        assert_eq!((image.session_id, image.stroke_id), (2, 1));
    }
}
