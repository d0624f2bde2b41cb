//! Advice registers for a display at the press: 24 registers apart from the handshake, which no motion program reads.
//!
//! | offset | content | type |
//! |---|---|---|
//! | 0 | sequence number: written last, changes with each advice | u16 |
//! | 1 | number of the stroke that it follows | u16 |
//! | 2 | state: bit 0 valid, 1 bend, 2 turn over, 3 done, 4 cannot, 5 place only, 6 simulated | bits |
//! | 3 | reason of "cannot", from 1; 0 none | u16 |
//! | 4 to 7 | ends of the line: u1, v1, u2, v2 | i16, 1 mm |
//! | 8 | direction of the line | i16, 0.01 deg |
//! | 9 to 11 | angle, lower and upper end of its interval | i16, 0.001 deg |
//! | 12 to 14 | largest gap after the stroke, lower and upper end | u16, 0.01 mm |
//! | 15, 16 | strokes left: fewest, seldom exceeded | u16 |
//! | 17 | feed from the last bend | i16, 1 mm |
//! | 18, 19 | depth, not beyond | i16, 0.01 mm |
//! | 20, 21 | earlier plates of the same class, strokes of this plate used for learning | u16 |
//! | 22, 23 | 0 | |
//!
//! An unknown value is 0x8000 (i16) or 0xFFFF (u16). Depths are always unknown unless `depth_on_panel` is true.

use platen_model::units::mm;
use platen_model::{Advice, NextBend, Step};
use platen_plant::press::AdviceBlock;

/// Number of the registers.
pub const ADVICE_REGISTERS: u16 = AdviceBlock::COUNT;
/// Offset of the state.
pub(crate) const STATE: usize = 2;
const UNKNOWN: i16 = i16::MIN;
const UNKNOWN_COUNT: u16 = u16::MAX;

/// Bits of the state.
mod state {
    pub(super) const VALID: u16 = 1;
    pub(super) const BEND: u16 = 1 << 1;
    pub(super) const TURN_OVER: u16 = 1 << 2;
    pub(super) const DONE: u16 = 1 << 3;
    pub(super) const CANNOT: u16 = 1 << 4;
    pub(super) const PLACE: u16 = 1 << 5;
    pub(super) const SIMULATED: u16 = 1 << 6;
}

/// Words of the advice registers, without the sequence number in the first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AdviceImage(pub(crate) [u16; ADVICE_REGISTERS as usize]);

impl AdviceImage {
    /// Registers without advice.
    pub const NONE: Self = Self([0; ADVICE_REGISTERS as usize]);

    /// Encodes the advice that follows a stroke. `last` is the middle (u, v) of the last bend, metres; `depth` shows
    /// the depths.
    #[must_use]
    pub fn new(advice: &Advice, stroke: u16, simulated: bool, last: Option<[f64; 2]>, depth: bool) -> Self {
        let mut words = [0; ADVICE_REGISTERS as usize];
        words[4..=11].fill(UNKNOWN as u16);
        words[12..=16].fill(UNKNOWN_COUNT);
        words[17..=19].fill(UNKNOWN as u16);
        words[20..=21].fill(UNKNOWN_COUNT);
        words[1] = stroke;
        words[STATE] = state::VALID | if simulated { state::SIMULATED } else { 0 };
        words[STATE] |= match &advice.step {
            Step::Bend(bend) => {
                write_bend(&mut words, bend, last, depth);
                state::BEND
            }
            Step::TurnOver(bend) => {
                write_bend(&mut words, bend, last, depth);
                state::TURN_OVER
            }
            Step::Place { at, direction } => {
                words[4] = whole(mm(at[0]));
                words[5] = whole(mm(at[1]));
                words[8] = whole(100.0 * direction.to_degrees());
                state::PLACE
            }
            Step::Done => state::DONE,
            Step::Cannot { reason } => {
                words[3] = reason.number();
                state::CANNOT
            }
        };
        if let Some(left) = advice.strokes_left {
            words[15] = count(f64::from(left[0]));
            words[16] = count(f64::from(left[1]));
        }
        if let Some(model) = &advice.model {
            words[20] = count(f64::from(model.like_plates));
            words[21] = count(f64::from(model.strokes_learned));
        }
        Self(words)
    }
}

fn write_bend(words: &mut [u16], bend: &NextBend, last: Option<[f64; 2]>, depth: bool) {
    let [[u1, v1], [u2, v2]] = bend.line;
    for (word, at) in words[4..8].iter_mut().zip([u1, v1, u2, v2]) {
        *word = whole(mm(at));
    }
    words[8] = whole(100.0 * bend.direction.to_degrees());
    let [low, high] = bend.angle_95;
    for (word, angle) in words[9..12].iter_mut().zip([bend.angle, low, high]) {
        *word = whole(1e3 * angle.to_degrees());
    }
    let [low, gap, high] = bend.gap_after;
    for (word, gap) in words[12..15].iter_mut().zip([gap, low, high]) {
        *word = count(100.0 * mm(gap));
    }
    if let Some(last) = last {
        // Distance across the line: positive towards larger u, and towards larger v for a line along u.
        let (sin, cos) = bend.direction.sin_cos();
        let way = [0.5 * (u1 + u2) - last[0], 0.5 * (v1 + v2) - last[1]];
        words[17] = whole(mm(sin * way[0] - cos * way[1]));
    }
    if depth {
        words[18] = bend.depth.map_or(UNKNOWN as u16, |depth| whole(100.0 * mm(depth)));
        words[19] = bend.depth_not_beyond.map_or(UNKNOWN as u16, |depth| whole(100.0 * mm(depth)));
    }
}

/// Returns a rounded number as a signed register; a number out of range becomes unknown.
fn whole(value: f64) -> u16 {
    let value = value.round();
    let fits = value > f64::from(i16::MIN) && value <= f64::from(i16::MAX);
    (if fits { value as i16 } else { UNKNOWN }) as u16
}

/// Returns a rounded number as an unsigned register; a number out of range becomes unknown.
fn count(value: f64) -> u16 {
    let value = value.round();
    if (0.0..f64::from(UNKNOWN_COUNT)).contains(&value) { value as u16 } else { UNKNOWN_COUNT }
}

#[cfg(test)]
mod tests {
    use super::*;
    use platen_model::CannotAdvise;

    fn advice(step: Step) -> Advice {
        Advice {
            step,
            strokes_left: Some([5, 7]),
            plan: Vec::new(),
            too_far: Vec::new(),
            says: Vec::new(),
            model: None,
        }
    }

    fn bend() -> NextBend {
        NextBend {
            line: [[1.65, 0.0], [1.65, 2.5]],
            direction: std::f64::consts::FRAC_PI_2,
            angle: 0.033,
            angle_95: [0.03, 0.036],
            place_95: Some(0.02),
            depth: Some(4.8e-3),
            depth_not_beyond: Some(5.3e-3),
            gap_after: [9e-3, 12e-3, 15e-3],
            template: "middle".into(),
            limit: 3e-3,
        }
    }

    #[test]
    fn a_bend_in_words() {
        let last = Some([1.35, 1.2]);
        let words = AdviceImage::new(&advice(Step::Bend(bend())), 7, true, last, true).0;
        assert_eq!(words[..9], [0, 7, 0b100_0011, 0, 1650, 0, 1650, 2500, 9000]);
        assert_eq!(words[9..17], [1891, 1719, 2063, 1200, 900, 1500, 5, 7]);
        assert_eq!(words[17..], [300, 480, 530, 0xffff, 0xffff, 0, 0]);
    }

    #[test]
    fn depths_are_unknown_unless_wanted_and_reasons_have_numbers() {
        let words = AdviceImage::new(&advice(Step::Bend(bend())), 7, false, None, false).0;
        assert_eq!(words[17..20], [0x8000; 3]);
        let words =
            AdviceImage::new(&advice(Step::Cannot { reason: CannotAdvise::Unseen }), 7, false, None, true).0;
        assert_eq!((words[2], words[3], words[4], words[12]), (0b1_0001, 3, 0x8000, 0xffff));
        assert_eq!(AdviceImage::new(&advice(Step::Done), 7, false, None, true).0[2], 0b1001);
    }
}
