//! Replay of a recording of both blocks to the handshake: strokes accepted now against strokes accepted by the recorded
//! host.
//!
//! A recording contains the changes of the blocks as read. The handshake receives the press's block at the recorded
//! times. The recorded host replaces the scanner: its results follow at their recorded times, or at once in a recording
//! without a host. A fault in the field thus becomes a test case, with or without this host in the recording.

use std::collections::BTreeMap;
use std::time::Duration;

use platen_plant::press::{Output, Press, RegisterField, RegisterMap, RegisterPlace};

use crate::codec::{bits, raw_number};
use crate::{
    Code, Config, Effect, Event, Figures, Handshake, Measurement, PressImage, Recalled, StrokeKey,
    Transition, Verdict,
};

/// Period of the check of the handshake's timers.
const TICK: Duration = Duration::from_millis(100);

/// A block as read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sample {
    /// Time since the start of the recording.
    pub at: Duration,
    /// Side that writes the block.
    pub side: Side,
    /// Its words.
    pub words: Vec<u16>,
}

/// Writer of a block.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// The press.
    Press,
    /// The host.
    Host,
}

/// Outcome of a replay.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Replayed {
    /// Every transition with its time and the active stroke.
    pub transitions: Vec<(Duration, Transition, Option<StrokeKey>)>,
    /// Alarms in their order.
    pub alarms: Vec<(Duration, Code)>,
    /// Session and number of the strokes accepted now.
    pub accepted: Vec<(u16, u16)>,
    /// Session and number of the strokes that the recorded host had accepted; empty where there was none.
    pub recorded: Vec<(u16, u16)>,
    /// Strokes missed now.
    pub missed: u64,
    /// Torn reads.
    pub torn: u64,
}

impl Replayed {
    /// Returns whether the handshake accepts the strokes of the recorded host; true without one.
    pub fn agrees(&self) -> bool {
        self.recorded.is_empty() || self.recorded == self.accepted
    }
}

/// Replays a recording.
pub fn replay(press: &Press, samples: &[Sample]) -> Replayed {
    let mut replayed = Replayed { recorded: recorded_strokes(&press.map, samples), ..Replayed::default() };
    let results = recorded_results(&press.map, samples);
    let mut player = Player { handshake: Handshake::new(Config::new(press), Recalled::empty(1)), results };
    let mut now = samples.first().map_or(Duration::ZERO, |sample| sample.at);
    for event in [
        Event::Tick,
        Event::Scanner { ready: Ok(()), estimate: None },
        Event::Connected,
        // The registers of the recorded host do not count as those of a second host.
        Event::Host { owner: None, heartbeat: None, mine: true },
    ] {
        player.step(event, now, &mut replayed);
    }
    for sample in samples {
        while now + TICK < sample.at {
            now += TICK;
            player.step(Event::Tick, now, &mut replayed);
        }
        now = sample.at;
        if sample.side == Side::Press {
            match PressImage::decode(&press.map, press.press_id, &sample.words) {
                Ok(image) => player.step(Event::Press(Box::new(image)), now, &mut replayed),
                Err(_) => replayed.torn += 1,
            }
        } else {
            player.step(Event::Tick, now, &mut replayed);
        }
    }
    replayed.missed = player.handshake.missed_total();
    replayed
}

/// The handshake with a journal that never fails, a press that accepts every write, and the recorded host as scanner.
struct Player {
    handshake: Handshake,
    results: BTreeMap<(u16, u16), Duration>,
}

impl Player {
    fn step(&mut self, event: Event, now: Duration, replayed: &mut Replayed) {
        let mut events = vec![event];
        let mut due = self.due(now);
        while let Some(event) = events.pop().or_else(|| due.take()) {
            let effects = self.handshake.step(event, now);
            events.extend(effects.into_iter().filter_map(|effect| self.answer(effect, now, replayed)));
            if events.is_empty()
                && self.handshake.may_write()
                && self.handshake.state().work == crate::Work::Publish
            {
                events.push(Event::Written);
            }
            due = due.or_else(|| self.due(now));
        }
    }

    /// Returns the answer of the recorded host up to now.
    fn due(&self, now: Duration) -> Option<Event> {
        let key = self.handshake.stroke()?;
        let came = self.results.get(&(key.session, key.stroke)).is_none_or(|&at| at <= now);
        match self.handshake.state().work {
            crate::Work::Scanning if came => Some(Event::Acquired(key)),
            crate::Work::Evaluating if came => Some(Event::Measured(key, Box::new(stand_in()))),
            _ => None,
        }
    }

    fn answer(&self, effect: Effect, now: Duration, replayed: &mut Replayed) -> Option<Event> {
        match effect {
            Effect::Journal(record) => {
                if let crate::Record::Accepted { key, .. } = &record {
                    replayed.accepted.push((key.session, key.stroke));
                }
                Some(Event::Journaled { key: record.key(), stage: record.stage(), ok: true })
            }
            Effect::Alarm(code) => {
                replayed.alarms.push((now, code));
                None
            }
            Effect::Transition(transition) => {
                replayed.transitions.push((now, transition, self.handshake.stroke()));
                None
            }
            Effect::Command(_) | Effect::Reconnect => None,
        }
    }
}

fn stand_in() -> Measurement {
    Measurement {
        judgement: Verdict::CannotTell.into(),
        figures: Figures::default(),
        scanned_at: None,
        warning: None,
    }
}

/// Returns the number in a field of the host's block.
fn number(map: &RegisterMap, output: Output, words: &[u16]) -> Option<u16> {
    let field: &RegisterField = map.output(output)?;
    let start = usize::from(field.place.offset()?);
    if let RegisterPlace::Bit(_, bit) = field.place {
        return Some(u16::from((words.get(start)? >> bit & 1 == 1) != field.active_low));
    }
    let words = words.get(start..start + usize::from(field.kind.registers()))?;
    Some(raw_number(field.kind, bits(field.kind, field.order, words)?) as u16)
}

fn host_blocks(samples: &[Sample]) -> impl Iterator<Item = &Sample> {
    samples.iter().filter(|sample| sample.side == Side::Host)
}

/// Returns the strokes in the order in which the recorded host echoed them; a stroke echoed at the start is already
/// finished.
fn recorded_strokes(map: &RegisterMap, samples: &[Sample]) -> Vec<(u16, u16)> {
    let echo = |sample: &Sample| {
        let session = number(map, Output::SessionEcho, &sample.words).unwrap_or(0);
        Some((session, number(map, Output::AckStrokeId, &sample.words)?))
    };
    let mut echoes: Vec<(u16, u16)> = host_blocks(samples).filter_map(echo).collect();
    echoes.dedup();
    let standing = usize::from(!echoes.is_empty());
    echoes.drain(..standing);
    echoes.retain(|&(_, stroke)| stroke != 0);
    echoes
}

/// Returns the time when the recorded host's result of each stroke was first valid.
fn recorded_results(map: &RegisterMap, samples: &[Sample]) -> BTreeMap<(u16, u16), Duration> {
    let mut results = BTreeMap::new();
    for sample in host_blocks(samples) {
        if number(map, Output::StatusResultValid, &sample.words) == Some(1)
            && let Some(stroke) = number(map, Output::ResultStrokeId, &sample.words)
        {
            let session = number(map, Output::SessionEcho, &sample.words).unwrap_or(0);
            results.entry((session, stroke)).or_insert(sample.at);
        }
    }
    results
}
