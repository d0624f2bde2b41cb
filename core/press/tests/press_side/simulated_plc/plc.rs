//! PLC of a press: registers and reference program, written from the printed register map, independent of the host's
//! code.

use std::time::Duration;

pub(crate) const P: usize = 0;
pub(crate) const H: usize = 100;

/// Faults of the PLC program.
#[derive(Debug, Clone, Default)]
pub(crate) struct Habits {
    /// Lowers the trigger in every other cycle while it waits.
    pub(crate) bounce: bool,
    /// Keeps the trigger up until the result is valid.
    pub(crate) keeps_trigger: bool,
    /// Never acknowledges.
    pub(crate) no_ack: bool,
    /// Increments the stroke number by two before the stroke with this index.
    pub(crate) jump_at: Option<usize>,
    /// Sets the stroke number to 1 and changes the session before the stroke with this index.
    pub(crate) back_at: Option<usize>,
    /// Delays the tail of its block by this many cycles at each stroke.
    pub(crate) torn_cycles: u32,
    /// Refuses writes that touch this register of the host's block.
    pub(crate) refuses: Option<usize>,
    /// Lowers `clear_to_scan` this many ms after acceptance.
    pub(crate) unclear_after_ms: Option<u64>,
}

/// Result as read by the PLC.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Result {
    pub(crate) stroke: u16,
    pub(crate) status: u16,
    pub(crate) dev_max: u16,
    pub(crate) error: u16,
    pub(crate) seq: u16,
}

#[derive(Debug)]
pub(crate) struct Plc {
    pub(crate) regs: [u16; 256],
    pub(crate) habits: Habits,
    pub(crate) to_do: usize,
    pub(crate) done: usize,
    pub(crate) results: Vec<Result>,
    pub(crate) gave_up: Vec<u16>,
    pub(crate) writes: usize,
    pub(crate) outside: usize,
    /// Writes that replaced a valid result by another one.
    pub(crate) swapped: usize,
    pub(crate) now_ms: u64,
    /// Times from the trigger to its acceptance, on the clock of the PLC.
    pub(crate) accept_ms: Vec<u64>,
    waiting: bool,
    accepted: bool,
    since_ms: u64,
    accepted_ms: u64,
    rest_until_ms: u64,
    host_beat: u16,
    host_beat_ms: u64,
    cycle: u64,
    torn_left: u32,
    limit_ms: u64,
}

impl Plc {
    pub(crate) fn new(press_id: u16, first_stroke: u16) -> Self {
        let mut regs = [0; 256];
        regs[P] = 1;
        regs[P + 2] = 0b10_0001;
        regs[P + 3] = first_stroke;
        regs[P + 31] = first_stroke;
        regs[P + 4] = 0xA001;
        regs[P + 7] = press_id;
        regs[P + 19] = 3500;
        Self {
            regs,
            habits: Habits::default(),
            to_do: 0,
            done: 0,
            results: Vec::new(),
            gave_up: Vec::new(),
            writes: 0,
            outside: 0,
            swapped: 0,
            now_ms: 0,
            accept_ms: Vec::new(),
            waiting: false,
            accepted: false,
            since_ms: 0,
            accepted_ms: 0,
            rest_until_ms: 0,
            host_beat: 0,
            host_beat_ms: 0,
            cycle: 0,
            torn_left: 0,
            limit_ms: 180_000,
        }
    }

    pub(crate) fn idle(&self) -> bool {
        self.to_do == 0 && !self.waiting && self.regs[P + 2] & 0b100 == 0
    }

    /// Restarts the PLC: registers lost, new session, a waiting stroke forgotten.
    pub(crate) fn restart(&mut self, session: u16) {
        let press_id = self.regs[P + 7];
        let stroke = self.regs[P + 3];
        let fresh = Self::new(press_id, stroke);
        self.regs = fresh.regs;
        self.regs[P + 4] = session;
        if self.waiting {
            self.gave_up.push(stroke);
        }
        self.waiting = false;
    }

    pub(crate) fn read(&self, start: u16, count: u16) -> Option<Vec<u16>> {
        let start = usize::from(start);
        self.regs.get(start..start + usize::from(count)).map(<[u16]>::to_vec)
    }

    pub(crate) fn write(&mut self, start: u16, words: &[u16]) -> bool {
        let start = usize::from(start);
        self.writes += 1;
        if start < H || start + words.len() > H + 64 {
            self.outside += 1;
            return false;
        }
        if self.habits.refuses.is_some_and(|register| (start..start + words.len()).contains(&(H + register)))
        {
            return false;
        }
        let before = self.valid_result();
        self.regs[start..start + words.len()].copy_from_slice(words);
        let after = self.valid_result();
        self.swapped += usize::from(before.is_some() && after.is_some() && before != after);
        true
    }

    /// Returns whether this write lowers the valid bit.
    pub(crate) fn would_withdraw(&self, start: u16, words: &[u16]) -> bool {
        let status = (H + 2).checked_sub(usize::from(start)).and_then(|at| words.get(at));
        self.valid_result().is_some() && status.is_some_and(|status| status & 1 << 2 == 0)
    }

    /// Returns stroke, sequence number and its copy while a result is valid.
    fn valid_result(&self) -> Option<[u16; 3]> {
        (self.regs[H + 2] & 1 << 2 != 0).then(|| [4, 8, 53].map(|word| self.regs[H + word]))
    }

    fn set(&mut self, bit: u16, on: bool) {
        let word = &mut self.regs[P + 2];
        *word = if on { *word | 1 << bit } else { *word & !(1 << bit) };
    }

    fn next_stroke(&mut self) {
        let id = self.regs[P + 3];
        let next = |id: u16| id.checked_add(1).unwrap_or(1);
        let mut id = next(id);
        if self.habits.jump_at == Some(self.done) {
            id = next(id);
        }
        if self.habits.back_at == Some(self.done) {
            id = 1;
            self.regs[P + 4] ^= 0x1111;
        }
        self.torn_left = self.habits.torn_cycles;
        self.regs[P + 3] = id;
        self.regs[P + 31] = if self.torn_left > 0 { id ^ 0x4000 } else { id };
    }

    /// Runs one cycle of the reference program. The host is alive while `now - host_beat_ms <= 2000`.
    pub(crate) fn cycle(&mut self, now: Duration) {
        self.now_ms = now.as_millis() as u64;
        self.cycle += 1;
        if self.cycle.is_multiple_of(20) {
            self.regs[P + 1] = self.regs[P + 1].wrapping_add(1);
        }
        if self.regs[H + 1] != self.host_beat {
            self.host_beat = self.regs[H + 1];
            self.host_beat_ms = self.now_ms;
        }
        if self.torn_left > 0 {
            self.torn_left -= 1;
            if self.torn_left == 0 {
                self.regs[P + 31] = self.regs[P + 3];
            }
        }
        let alive = self.now_ms - self.host_beat_ms <= 2000;
        let status = self.regs[H + 2];
        let ready = status & 1 == 1;
        let acking = self.regs[P + 2] & 0b100 != 0;
        if self.to_do > 0 && !self.waiting && !acking && ready && alive && self.now_ms >= self.rest_until_ms {
            self.next_stroke();
            self.to_do -= 1;
            self.done += 1;
            self.waiting = true;
            self.accepted = false;
            self.since_ms = self.now_ms;
        }
        let (stroke, session) = (self.regs[P + 3], self.regs[P + 4]);
        let was_accepted = self.accepted;
        self.accepted = self.waiting && self.regs[H + 3] == stroke && self.regs[H + 5] == session;
        if self.accepted && !was_accepted {
            self.accept_ms.push(self.now_ms - self.since_ms);
            self.accepted_ms = self.now_ms;
        }
        let bounce = self.habits.bounce && self.cycle.is_multiple_of(2);
        let holds = !self.accepted || self.habits.keeps_trigger;
        self.set(1, self.waiting && holds && self.torn_left == 0 && !bounce);
        let unclear =
            |after| self.accepted && self.now_ms - self.accepted_ms >= after && status & 1 << 7 == 0;
        self.set(5, !self.habits.unclear_after_ms.is_some_and(unclear));
        let valid = self.accepted
            && status & 1 << 2 != 0
            && status & 1 << 9 == 0
            && self.regs[H + 4] == stroke
            && self.regs[H + 8] == self.regs[H + 53]
            && alive;
        if valid {
            self.results.push(Result {
                stroke,
                status,
                dev_max: self.regs[H + 10],
                error: self.regs[H + 6],
                seq: self.regs[H + 8],
            });
            self.waiting = false;
            self.set(1, false);
            self.set(2, !self.habits.no_ack);
            self.rest_until_ms = self.now_ms + 30;
        }
        if self.regs[P + 2] & 0b100 != 0 && self.regs[H + 2] & 1 << 2 == 0 {
            self.set(2, false);
        }
        if self.waiting && self.now_ms - self.since_ms > self.limit_ms {
            self.waiting = false;
            self.gave_up.push(stroke);
        }
    }
}
