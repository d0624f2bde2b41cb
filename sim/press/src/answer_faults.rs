//! Fault injection into Modbus answers; pure functions.

use std::time::Duration;

use crate::faults::{LineFault, LineFaults};
use crate::frame::{Framing, Message};

/// Number of noise bytes before an answer.
const NOISE: usize = 5;

/// Answer to the host after fault injection.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Answer {
    /// Sends these bytes at once.
    Bytes(Vec<u8>),
    /// Sends these bytes after a delay.
    Late(Vec<u8>, Duration),
    /// Sends these bytes one at a time.
    Dribble(Vec<u8>),
    /// Sends nothing.
    None,
    /// Resets the connection.
    Reset,
}

/// Returns the exception response to `request` (MODBUS Application Protocol V1.1b3, section 7).
pub(crate) fn exception(request: &Message, code: u8) -> Message {
    let function = request.pdu.first().copied().unwrap_or(0) | 0x80;
    Message { pdu: vec![function, code], ..*request }
}

/// Encodes `answer` with `fault` applied.
pub(crate) fn apply_fault(
    mut answer: Message,
    fault: Option<LineFault>,
    framing: Framing,
    faults: &LineFaults,
    random: &mut fastrand::Rng,
) -> Answer {
    let Some(fault) = fault else { return Answer::Bytes(framing.encode(&answer)) };
    match fault {
        LineFault::WrongTransaction => answer.transaction = answer.transaction.wrapping_add(1),
        LineFault::WrongUnit => answer.unit = answer.unit.wrapping_add(1),
        // 3 becomes 4, 16 becomes 23: both are functions of their own.
        LineFault::WrongFunction => answer.pdu[0] ^= 0x07,
        LineFault::Short => resize(&mut answer.pdu, -1),
        LineFault::Long => resize(&mut answer.pdu, 1),
        _ => {}
    }
    let mut bytes = framing.encode(&answer);
    match fault {
        LineFault::Late => {
            let [shortest, longest] = faults.late_ms;
            Answer::Late(bytes, Duration::from_millis(random.u64(shortest..=longest)))
        }
        LineFault::Reset | LineFault::ResetAfter => Answer::Reset,
        LineFault::NoAnswer => Answer::None,
        LineFault::Noise => {
            let mut noisy: Vec<u8> = std::iter::repeat_with(|| random.u8(..)).take(NOISE).collect();
            noisy.append(&mut bytes);
            Answer::Bytes(noisy)
        }
        LineFault::BitFlip => {
            let reach = if framing == Framing::Tcp { 6 } else { bytes.len() };
            bytes[random.usize(..reach)] ^= 1 << random.u8(..8);
            Answer::Bytes(bytes)
        }
        LineFault::Half => {
            bytes.truncate(bytes.len() / 2);
            Answer::Bytes(bytes)
        }
        LineFault::Twice => Answer::Bytes(bytes.repeat(2)),
        LineFault::Dribble => Answer::Dribble(bytes),
        _ => Answer::Bytes(bytes),
    }
}

/// Adds or removes one register in the answer to a read; changes the count in the answer to a write.
fn resize(pdu: &mut Vec<u8>, by: i8) {
    match pdu.first() {
        Some(3) if pdu.len() >= 4 => {
            if by < 0 {
                pdu.truncate(pdu.len() - 2);
            } else {
                pdu.extend([0x5A, 0x5A]);
            }
            pdu[1] = pdu[1].wrapping_add_signed(2 * by);
        }
        Some(6 | 16) if pdu.len() == 5 => pdu[4] = pdu[4].wrapping_add_signed(by),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answer() -> Message {
        Message { transaction: 7, unit: 1, pdu: vec![3, 4, 0, 1, 0, 2] }
    }

    fn faulty(fault: LineFault) -> Answer {
        apply_fault(
            answer(),
            Some(fault),
            Framing::Tcp,
            &LineFaults::default(),
            &mut fastrand::Rng::with_seed(1),
        )
    }

    #[test]
    fn each_fault_changes_what_its_name_says() {
        let whole = vec![0, 7, 0, 0, 0, 7, 1, 3, 4, 0, 1, 0, 2];
        let cases = [
            (LineFault::WrongTransaction, vec![0, 8, 0, 0, 0, 7, 1, 3, 4, 0, 1, 0, 2]),
            (LineFault::WrongUnit, vec![0, 7, 0, 0, 0, 7, 2, 3, 4, 0, 1, 0, 2]),
            (LineFault::WrongFunction, vec![0, 7, 0, 0, 0, 7, 1, 4, 4, 0, 1, 0, 2]),
            (LineFault::Short, vec![0, 7, 0, 0, 0, 5, 1, 3, 2, 0, 1]),
            (LineFault::Long, vec![0, 7, 0, 0, 0, 9, 1, 3, 6, 0, 1, 0, 2, 0x5A, 0x5A]),
            (LineFault::Half, whole[..6].to_vec()),
            (LineFault::Twice, whole.repeat(2)),
        ];
        for (fault, bytes) in cases {
            assert_eq!(faulty(fault), Answer::Bytes(bytes), "{fault:?}");
        }
        assert_eq!(faulty(LineFault::Dribble), Answer::Dribble(whole.clone()));
        let Answer::Bytes(noisy) = faulty(LineFault::Noise) else { panic!("noise is sent at once") };
        assert_eq!(noisy[NOISE..], whole);
        let Answer::Late(late, delay) = faulty(LineFault::Late) else { panic!("late is late") };
        assert_eq!(late, whole);
        assert!((200..=900).contains(&delay.as_millis()), "{delay:?}");
        let Answer::Bytes(flipped) = faulty(LineFault::BitFlip) else { panic!("a flip is sent at once") };
        let bits: u32 = flipped.iter().zip(&whole).map(|(a, b)| (a ^ b).count_ones()).sum();
        assert_eq!((bits, &flipped[6..]), (1, &whole[6..]));
    }

    #[test]
    fn an_exception_answers_its_request() {
        let request = Message { transaction: 9, unit: 1, pdu: vec![16, 0, 100, 0, 1, 2, 0, 0] };
        assert_eq!(exception(&request, 6), Message { transaction: 9, unit: 1, pdu: vec![0x90, 6] });
    }
}
