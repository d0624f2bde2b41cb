//! Reconciliation of the host's registers: drives them to their target values.
//!
//! Every write can be repeated safely.
//!
//! The desired words are compared with the known actual words (echoed or read back); differences are written until they
//! are echoed. Order: data with the old commit word, the commit word, the status; a result is therefore complete before
//! it is valid. A result is withdrawn by its status first, also when the next result is present after a loss of the
//! link.

use std::time::Duration;

use platen_plant::press::{Mode, Output, Press, RegisterMap, RegisterPlace};
use tokio::time::Instant;

use crate::{Client, HostImage, Link, LinkError};

/// Age in beats of the oldest heartbeat that may still be in transit on a slow line.
const OLD_BEATS: u16 = 16;

/// Phase in which a register is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Turn {
    /// Diagnostic: written along with data and with each beat.
    Idle,
    Data,
    Commit,
    Status,
}

/// Host's block: desired and known actual words.
#[derive(Debug)]
pub(crate) struct Reconciler {
    map: RegisterMap,
    turns: Vec<Turn>,
    /// Spans of one write: neighbours inside the same range of the allow-list.
    spans: Vec<std::ops::Range<usize>>,
    pretend: bool,
    known: Option<Vec<u16>>,
    /// Sequence number of the last result made valid.
    shown: Option<u16>,
    heartbeat: u16,
    beat_every: Duration,
    next_beat: Instant,
    budget: Budget,
    /// Writes that repeated echoed words: the press had lost or changed them.
    pub(crate) rewrites: u64,
}

/// Writer of the host's own block, from a read-back.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Witness {
    pub(crate) owner: Option<u16>,
    pub(crate) heartbeat: Option<u16>,
    pub(crate) mine: bool,
}

impl Reconciler {
    pub(crate) fn new(press: &Press) -> Self {
        let now = Instant::now();
        Self {
            turns: turns(&press.map),
            spans: spans(press),
            pretend: press.mode == Mode::DryRun,
            known: None,
            shown: None,
            heartbeat: 0,
            beat_every: press.timeouts.heartbeat,
            next_beat: now,
            budget: Budget::new(press.write.max_writes_per_s, now),
            map: press.map.clone(),
            rewrites: 0,
        }
    }

    /// Marks all actual words as unknown.
    pub(crate) fn forget(&mut self) {
        self.known = None;
    }

    /// Returns whether actual and desired words differ, or a beat is due.
    pub(crate) fn is_due(&self, image: &HostImage) -> bool {
        Instant::now() >= self.next_beat || !self.says(&image.encode(&self.map, self.heartbeat))
    }

    /// Sets the actual words from a read-back. `owner` is this host's number.
    pub(crate) fn read_back(&mut self, words: Vec<u16>, owner: u16) -> Witness {
        let field = |output, words: &[u16]| {
            let offset = self.map.output(output).and_then(|field| field.place.offset())?;
            words.get(usize::from(offset)).copied()
        };
        let (found_owner, found_beat) = (field(Output::Owner, &words), field(Output::Heartbeat, &words));
        let before = self.known.as_deref();
        let known = |output| before.and_then(|words| field(output, words));
        let own = |found: u16| found == 0 || found == owner || Some(found) == known(Output::Owner);
        let recent = |found: u16| {
            found == 0
                || Some(found) == known(Output::Heartbeat)
                || self.heartbeat.wrapping_sub(found) < OLD_BEATS
        };
        let mine = found_owner.is_none_or(own) && found_beat.is_none_or(recent);
        if before.is_none() {
            self.heartbeat = found_beat.unwrap_or(0);
            self.next_beat = Instant::now();
        } else if before != Some(&words) {
            self.rewrites += 1;
        }
        if !self.pretend || self.known.is_none() {
            self.known = Some(words);
        }
        Witness { owner: found_owner, heartbeat: found_beat, mine }
    }

    /// Writes the differences. Returns true when the actual words equal `image`; false when the limit of writes per
    /// second defers the rest.
    pub(crate) async fn write<L: Link>(
        &mut self,
        client: &mut Client<L>,
        image: &HostImage,
        last: bool,
    ) -> Result<bool, LinkError> {
        let now = Instant::now();
        let beat = now >= self.next_beat;
        if beat && !last {
            self.heartbeat = self.heartbeat.wrapping_add(1);
            self.next_beat = now + self.beat_every;
        }
        let wanted = image.encode(&self.map, self.heartbeat);
        let Some(known) = &self.known else { return Ok(false) };
        let withdrawn = (self.shows_valid(known) && !(image.valid && self.shows_this(known, &wanted, image)))
            .then(|| HostImage { valid: false, ..image.clone() }.encode(&self.map, self.heartbeat));
        let mut steps: Vec<_> = withdrawn.iter().map(|words| (Turn::Status, words)).collect();
        steps.extend([Turn::Data, Turn::Commit, Turn::Status].map(|turn| (turn, &wanted)));
        if beat || last {
            steps.push((Turn::Idle, &wanted));
        }
        for (turn, words) in steps {
            for span in self.spans.clone() {
                let Some(range) = self.differing(turn, words, span) else { continue };
                if !last && !self.budget.take(now) {
                    return Ok(false);
                }
                self.write_range(client, turn, words, range).await?;
            }
        }
        let done = self.says(&wanted);
        if done && image.valid {
            self.shown = Some(image.result_seq);
        }
        Ok(done)
    }

    /// Writes the registers of the error code and of the status where they differ, one by one and the status last. A
    /// refused write does not prevent the others.
    /// keep back the others.
    ///
    /// # Errors
    /// The last refusal, or an error that ended the connection.
    pub(crate) async fn withdraw<L: Link>(
        &mut self,
        client: &mut Client<L>,
        image: &HostImage,
    ) -> Result<(), LinkError> {
        let wanted = image.encode(&self.map, self.heartbeat);
        let offset = |output| self.map.output(output).and_then(|field| field.place.offset());
        let code = offset(Output::ErrorCode).map(usize::from);
        let status = (0..self.turns.len()).filter(|i| self.turns[*i] == Turn::Status);
        let registers = code.into_iter().chain(status.filter(|i| Some(*i) != code));
        let writable = |i: &usize| self.spans.iter().any(|span| span.contains(i));
        let registers: Vec<usize> = registers.filter(writable).collect();
        let mut refusal = Ok(());
        for register in registers {
            if self.known.as_ref().is_none_or(|known| known[register] == wanted[register]) {
                continue;
            }
            match self.write_range(client, self.turns[register], &wanted, register..register + 1).await {
                Err(error @ LinkError::Exception { .. }) => refusal = Err(error),
                other => other?,
            }
        }
        refusal
    }

    /// Returns whether the valid result in the registers is this one: by its sequence number there, else by the last
    /// one made valid.
    fn shows_this(&self, known: &[u16], wanted: &[u16], image: &HostImage) -> bool {
        match self.map.output(Output::ResultSeq).and_then(|field| field.place.offset()) {
            Some(offset) => known.get(usize::from(offset)) == wanted.get(usize::from(offset)),
            None => self.shown.is_none_or(|seq| seq == image.result_seq),
        }
    }

    /// Returns whether the actual words of the writable registers equal these.
    fn says(&self, wanted: &[u16]) -> bool {
        let same = |known: &Vec<u16>| {
            let mut registers = self.spans.iter().cloned().flatten().filter(|&i| self.turns[i] != Turn::Idle);
            registers.all(|i| known[i] == wanted[i])
        };
        self.known.as_ref().is_some_and(same)
    }

    fn shows_valid(&self, words: &[u16]) -> bool {
        let field = self.map.output(Output::StatusResultValid);
        field.is_some_and(|field| match field.place {
            RegisterPlace::Bit(offset, bit) => {
                words.get(usize::from(offset)).is_some_and(|word| (word >> bit & 1 == 1) != field.active_low)
            }
            RegisterPlace::Register(offset) => words.get(usize::from(offset)).is_some_and(|&word| word != 0),
            RegisterPlace::Constant(_) => false,
        })
    }

    /// Returns the range from the first to the last register of this phase that differs within a span.
    fn differing(
        &self,
        turn: Turn,
        wanted: &[u16],
        span: std::ops::Range<usize>,
    ) -> Option<std::ops::Range<usize>> {
        let known = self.known.as_ref()?;
        let differs = |&i: &usize| self.turns[i] == turn && wanted[i] != known[i];
        let first = span.clone().find(differs)?;
        let last = span.rev().find(differs)?;
        Some(first..last + 1)
    }

    /// Returns the words of a write: registers of other phases in between keep their actual words.
    async fn write_range<L: Link>(
        &mut self,
        client: &mut Client<L>,
        turn: Turn,
        wanted: &[u16],
        range: std::ops::Range<usize>,
    ) -> Result<(), LinkError> {
        let Some(known) = &mut self.known else { return Ok(()) };
        let goes = |i: usize| self.turns[i] == turn || self.turns[i] == Turn::Idle;
        let word = |i: usize| if goes(i) { wanted[i] } else { known[i] };
        let words: Vec<u16> = range.clone().map(word).collect();
        let start = self.map.write.start + range.start as u16;
        if self.pretend {
            tracing::info!(start, ?words, "dry run: would write");
        } else {
            client.guarded_write(start, &words).await?;
        }
        known[range].copy_from_slice(&words);
        Ok(())
    }
}

fn turns(map: &RegisterMap) -> Vec<Turn> {
    let mut turns = vec![Turn::Data; usize::from(map.write.count)];
    let mut set = |offset: Option<u16>, turn| {
        if let Some(place) = offset.and_then(|offset| turns.get_mut(usize::from(offset))) {
            *place = turn;
        }
    };
    set(map.output(Output::HostState).and_then(|field| field.place.offset()), Turn::Idle);
    set(map.output(Output::ResultSeq).and_then(|field| field.place.offset()), Turn::Commit);
    let last = [Output::MapVersion, Output::Heartbeat, Output::AckStrokeId];
    let status = map.outputs.iter().filter(|(output, _)| output.is_status() || last.contains(output));
    for (_, field) in status {
        set(field.place.offset(), Turn::Status);
    }
    turns
}

/// Returns the parts of the write block inside the allow-list, as register offsets.
fn spans(press: &Press) -> Vec<std::ops::Range<usize>> {
    let block = press.map.write.addresses();
    let inside = |range: &std::ops::RangeInclusive<u16>| {
        let start = u32::from(*range.start()).max(block.start);
        let end = (u32::from(*range.end()) + 1).min(block.end);
        (start < end).then(|| (start - block.start) as usize..(end - block.start) as usize)
    };
    press.write.ranges().iter().filter_map(inside).collect()
}

/// Token bucket: a limit of writes per second with a burst of one second.
#[derive(Debug)]
struct Budget {
    per_second: f64,
    left: f64,
    at: Instant,
}

impl Budget {
    fn new(per_second: u32, now: Instant) -> Self {
        let per_second = f64::from(per_second);
        Self { per_second, left: per_second, at: now }
    }

    fn take(&mut self, now: Instant) -> bool {
        let earned = now.saturating_duration_since(self.at).as_secs_f64() * self.per_second;
        self.left = (self.left + earned).min(self.per_second);
        self.at = now;
        let may = self.left >= 1.0;
        if may {
            self.left -= 1.0;
        }
        may
    }
}
