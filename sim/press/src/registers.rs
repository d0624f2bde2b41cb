//! Register map PPH-1 (plate press - host, version 1), written from its specification and deliberately not shared with
//! the host: an offset that is wrong on one side causes wrong figures between the two.
//!
//! Holding registers only. The press writes the P block (32 words) and reads the H block (64 words); the host may write
//! the H block only. All words are 16 bit; 32-bit values have the high word first.

use serde::Serialize;

/// The only version of the map.
pub const MAP_VERSION: u16 = 1;
/// Words of the P block.
pub const P_LEN: usize = 32;
/// Number of the registers for advice.
pub const ADVICE_LEN: usize = 24;
/// Words of the H block.
pub const H_LEN: usize = 64;

/// Offsets in the P block, press to host.
pub mod p {
    /// Constant 1.
    pub const MAP_VERSION: usize = 0;
    /// Incremented every 250 to 500 ms.
    pub const HEARTBEAT: usize = 1;
    /// Bits of [`super::control`].
    pub const CONTROL: usize = 2;
    /// 1..=65535, 0 none.
    pub const STROKE_ID: usize = 3;
    /// Changes at each start of the program and each part change.
    pub const SESSION_ID: usize = 4;
    /// Number of the plate file.
    pub const RECIPE_ID: usize = 5;
    /// 2 automatic, 3 down, 4 dwell, 5 up.
    pub const PRESS_STATE: usize = 6;
    /// Plant number of the press.
    pub const PRESS_ID: usize = 7;
    /// Two words.
    pub const PART_ID: usize = 8;
    /// Eight words, sixteen ASCII characters, high byte first.
    pub const PART_NAME: usize = 10;
    /// Bends made on this part.
    pub const BEND_INDEX: usize = 18;
    /// 0.01 mm.
    pub const THICKNESS: usize = 19;
    /// Signed, 0.01 mm.
    pub const RAM_DEPTH: usize = 21;
    /// Rescan requests of this stroke.
    pub const ATTEMPT: usize = 29;
    /// Die set in use.
    pub const DIE_ID: usize = 30;
    /// Copy of [`STROKE_ID`].
    pub const STROKE_ID_TAIL: usize = 31;
}

/// Bits of the P block's control word.
pub mod control {
    /// Measuring enabled.
    pub const ENABLE: u16 = 1 << 0;
    /// Stroke waiting for its scan.
    pub const TRIGGER: u16 = 1 << 1;
    /// Result accepted.
    pub const ACK: u16 = 1 << 2;
    /// Stop the scan.
    pub const ABORT: u16 = 1 << 3;
    /// Clear latched faults.
    pub const ERROR_RESET: u16 = 1 << 4;
    /// Ram up, plate at rest.
    pub const CLEAR_TO_SCAN: u16 = 1 << 5;
    /// Part leaving the press.
    pub const PART_END: u16 = 1 << 7;
    /// Measure the same stroke again.
    pub const RESCAN: u16 = 1 << 8;
    /// Scan without a bend.
    pub const BASELINE: u16 = 1 << 9;
}

/// Offsets in the H block, host to press.
pub mod h {
    /// Constant 1.
    pub const MAP_VERSION: usize = 0;
    /// Incremented every 500 ms.
    pub const HEARTBEAT: usize = 1;
    /// Bits of [`super::status`].
    pub const STATUS: usize = 2;
    /// Echo of the accepted stroke id.
    pub const ACK_STROKE_ID: usize = 3;
    /// Stroke of the result.
    pub const RESULT_STROKE_ID: usize = 4;
    /// Echo of the session id.
    pub const SESSION_ECHO: usize = 5;
    /// Commit word, incremented with each published result.
    pub const RESULT_SEQ: usize = 8;
    /// Number of strokes missed by the host.
    pub const MISSED_COUNT: usize = 9;
    /// Signed, 0.01 mm.
    pub const DEV_MAX: usize = 10;
    /// Signed, 0.01 mm.
    pub const DEV_MIN: usize = 11;
    /// Echo of the recipe.
    pub const RECIPE_ECHO: usize = 48;
    /// Random number of the host's installation.
    pub const OWNER: usize = 49;
    /// CRC-16/MODBUS over 3..=51 and 55..=61.
    pub const CRC16: usize = 52;
    /// Equal to [`RESULT_SEQ`] when the block is whole.
    pub const RESULT_SEQ_TAIL: usize = 53;
    /// 0.01 mm.
    pub const GAP_MAX: usize = 55;
    /// 1 mm along u.
    pub const GAP_U: usize = 57;
    /// 1 mm along v.
    pub const GAP_V: usize = 58;
    /// Signed: -1 not bent enough, 0 within, +1 bent too far.
    pub const SENSE: usize = 60;
    /// Attempt of the result.
    pub const ATTEMPT_ECHO: usize = 61;
}

/// Bits of the H block's status word.
pub mod status {
    /// Ready for a trigger.
    pub const READY: u16 = 1 << 0;
    /// Stroke being scanned or evaluated.
    pub const BUSY: u16 = 1 << 1;
    /// Result words valid.
    pub const RESULT_VALID: u16 = 1 << 2;
    /// Within the limits.
    pub const PASS: u16 = 1 << 3;
    /// Outside the limits.
    pub const FAIL: u16 = 1 << 4;
    /// Scan done: the plate may move.
    pub const SCAN_DONE: u16 = 1 << 7;
    /// Result of a simulated measurement, not to be used.
    pub const SIMULATED: u16 = 1 << 9;
    /// Not measured: no figures, with a reason.
    pub const NOT_MEASURED: u16 = 1 << 12;
    /// Figures, but no verdict.
    pub const CANNOT_TELL: u16 = 1 << 13;
}

/// "No value" of the signed words.
pub const INVALID_I16: u16 = 0x8000;
/// "No value" of the unsigned words.
pub const INVALID_U16: u16 = 0xFFFF;

/// H block as read by the press.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HBlock(
    /// 64 raw words.
    pub [u16; H_LEN],
);

impl HBlock {
    /// Returns the word at `offset`; offsets are the constants of [`h`].
    #[must_use]
    pub fn word(&self, offset: usize) -> u16 {
        self.0[offset]
    }

    /// Returns whether all `bits` of the status word are set.
    #[must_use]
    pub fn status(&self, bits: u16) -> bool {
        self.word(h::STATUS) & bits == bits
    }

    /// Returns whether the commit word and its copy agree.
    #[must_use]
    pub fn whole(&self) -> bool {
        self.word(h::RESULT_SEQ) == self.word(h::RESULT_SEQ_TAIL)
    }

    /// Returns the CRC-16/MODBUS of words 3..=51 and 55..=61, each high byte first.
    #[must_use]
    pub fn crc(&self) -> u16 {
        let bytes: Vec<u8> =
            self.0[3..=51].iter().chain(&self.0[55..=61]).flat_map(|word| word.to_be_bytes()).collect();
        crate::frame::crc16(&bytes)
    }

    /// Returns the verdict, as the operator panel of the press displays it.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        if self.status(status::NOT_MEASURED) {
            Verdict::NotMeasured
        } else if self.status(status::PASS) {
            Verdict::Pass
        } else if self.status(status::FAIL) {
            Verdict::Fail
        } else {
            Verdict::CannotTell
        }
    }

    /// Returns the largest template gap in millimetres, if the result has one.
    #[must_use]
    pub fn gap_max_mm(&self) -> Option<f64> {
        (self.word(h::GAP_MAX) != INVALID_U16).then(|| f64::from(self.word(h::GAP_MAX)) * 0.01)
    }

    /// Returns the position (u, v) of the largest gap in millimetres, if the result has one.
    #[must_use]
    pub fn gap_at_mm(&self) -> Option<[f64; 2]> {
        let [u, v] = [self.word(h::GAP_U), self.word(h::GAP_V)];
        (u != INVALID_I16 && v != INVALID_I16)
            .then(|| [f64::from(u.cast_signed()), f64::from(v.cast_signed())])
    }

    /// Returns the sense: -1 not bent enough, 0 within the limits, +1 bent too far.
    #[must_use]
    pub fn sense(&self) -> i16 {
        self.word(h::SENSE).cast_signed()
    }
}

/// Verdict of a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Within the limits.
    Pass,
    /// Outside the limits.
    Fail,
    /// Measured, but the figures do not decide.
    CannotTell,
    /// Not measured.
    NotMeasured,
}

/// Holding registers of the press, address 0 to the end of the table.
///
/// Clients may write anywhere in the table, as on most controllers; the program overwrites its P block each cycle.
#[derive(Clone, Debug)]
pub struct Table {
    words: Vec<u16>,
    p_base: usize,
    h_base: usize,
    advice: Option<std::ops::Range<usize>>,
}

impl Table {
    /// Creates a table of zeros with the two blocks at the given addresses; it ends 36 words after the later block.
    #[must_use]
    pub fn new(p_base: u16, h_base: u16, advice_base: Option<u16>) -> Self {
        let (p_base, h_base) = (usize::from(p_base), usize::from(h_base));
        let advice = advice_base.map(|base| usize::from(base)..usize::from(base) + ADVICE_LEN);
        let end = (p_base + P_LEN).max(h_base + H_LEN).max(advice.clone().map_or(0, |it| it.end)) + 36;
        Self { words: vec![0; end], p_base, h_base, advice }
    }

    /// Returns `count` words from `address`, or `None` beyond the end of the table.
    #[must_use]
    pub fn read(&self, address: u16, count: u16) -> Option<&[u16]> {
        let start = usize::from(address);
        self.words.get(start..start + usize::from(count))
    }

    /// Stores `words` from `address`; returns `false`, with nothing stored, beyond the end of the table.
    #[must_use]
    pub fn write(&mut self, address: u16, words: &[u16]) -> bool {
        let start = usize::from(address);
        match self.words.get_mut(start..start + words.len()) {
            Some(place) => {
                place.copy_from_slice(words);
                true
            }
            None => false,
        }
    }

    /// Returns whether all `count` words from `address` lie in the H block, or in the registers for advice.
    #[must_use]
    pub fn is_of_host(&self, address: u16, count: usize) -> bool {
        let (start, end) = (usize::from(address), usize::from(address) + count);
        let in_h = start >= self.h_base && end <= self.h_base + H_LEN;
        in_h || self.advice.as_ref().is_some_and(|it| start >= it.start && end <= it.end)
    }

    /// Returns the number of the stroke that the advice follows, while it is valid.
    #[must_use]
    pub fn advised_after(&self) -> Option<u16> {
        let words = &self.words[self.advice.clone()?];
        (words[2] & 1 == 1).then_some(words[1])
    }

    /// Returns whether the `count` words from `address` overlap the P block.
    #[must_use]
    pub fn touches_p_block(&self, address: u16, count: u16) -> bool {
        let start = usize::from(address);
        start < self.p_base + P_LEN && start + usize::from(count) > self.p_base
    }

    /// Returns whether the `count` words from `address` overlap the H block.
    #[must_use]
    pub fn touches_h_block(&self, address: u16, count: u16) -> bool {
        let start = usize::from(address);
        start < self.h_base + H_LEN && start + usize::from(count) > self.h_base
    }

    /// Returns the present H block.
    #[must_use]
    pub fn h_block(&self) -> HBlock {
        let mut block = [0; H_LEN];
        block.copy_from_slice(&self.words[self.h_base..self.h_base + H_LEN]);
        HBlock(block)
    }

    /// Returns whether the P block contains this version of the map; a host must not write otherwise.
    #[must_use]
    pub fn contains_map(&self) -> bool {
        self.words[self.p_base + p::MAP_VERSION] == MAP_VERSION
    }

    /// Returns the present P block.
    #[must_use]
    pub fn p_block(&self) -> [u16; P_LEN] {
        let mut block = [0; P_LEN];
        block.copy_from_slice(&self.words[self.p_base..self.p_base + P_LEN]);
        block
    }

    /// Writes the P block.
    pub fn set_p_block(&mut self, block: &[u16; P_LEN]) {
        self.words[self.p_base..self.p_base + P_LEN].copy_from_slice(block);
    }

    /// Sets all registers to zero, as after a cold start of the controller.
    pub fn clear(&mut self) {
        self.words.fill(0);
    }
}

/// Encodes `name` as eight words of ASCII, high byte first, zero-padded; other characters become `?`.
#[must_use]
pub fn ascii_words(name: &str) -> [u16; 8] {
    let mut bytes = [0; 16];
    for (byte, character) in bytes.iter_mut().zip(name.chars()) {
        *byte = if character.is_ascii() { character as u8 } else { b'?' };
    }
    let mut words = [0; 8];
    for (word, pair) in words.iter_mut().zip(bytes.chunks_exact(2)) {
        *word = u16::from_be_bytes([pair[0], pair[1]]);
    }
    words
}
