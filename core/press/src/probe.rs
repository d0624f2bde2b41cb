//! Search for word order and address of a 32-bit number: every interpretation of the registers around an address.

use platen_plant::press::{RegisterType, WordOrder};

use crate::codec::{bits, raw_number};

/// One interpretation of two registers as a number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Offset from the given address, registers: manuals that count from 1 give one too many.
    pub shift: i8,
    /// Type of the 32 bits.
    pub kind: RegisterType,
    /// Order of the words and bytes.
    pub order: WordOrder,
    /// The two registers.
    pub words: [u16; 2],
    /// The number.
    pub number: f64,
}

impl Reading {
    /// Returns whether it equals the expected number to the precision of the smaller of both types (24 bits).
    pub fn is(&self, expected: f64) -> bool {
        (self.number - expected).abs() <= expected.abs().max(f64::MIN_POSITIVE) * f64::from(f32::EPSILON)
    }
}

/// Returns every interpretation of 32-bit numbers at an address and one register to either side of it. `around` are the
/// registers from one before the address on; pairs beyond their end are left out.
pub fn readings(around: &[u16]) -> Vec<Reading> {
    let mut readings = Vec::new();
    for (shift, words) in (-1i8..=1).zip(around.windows(2)) {
        let words = [words[0], words[1]];
        for kind in [RegisterType::F32, RegisterType::I32, RegisterType::U32] {
            for order in WordOrder::ALL {
                if let Some(bits) = bits(kind, order, &words) {
                    readings.push(Reading { shift, kind, order, words, number: raw_number(kind, bits) });
                }
            }
        }
    }
    readings
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Raw words from the bits of -12.5 (C1480000) and of 0x12345678, never from a library's names of the orders.
    #[test]
    fn names_the_order_and_the_shift_of_known_words() {
        let found = |around: &[u16], expected: f64| -> Vec<(i8, RegisterType, WordOrder)> {
            let right = readings(around).into_iter().filter(|reading| reading.is(expected));
            right.map(|reading| (reading.shift, reading.kind, reading.order)).collect()
        };
        for (order, words) in [
            (WordOrder::Abcd, [0xC148, 0x0000]),
            (WordOrder::Cdab, [0x0000, 0xC148]),
            (WordOrder::Badc, [0x48C1, 0x0000]),
            (WordOrder::Dcba, [0x0000, 0x48C1]),
        ] {
            let [a, b] = words;
            assert_eq!(found(&[9, a, b, 9], -12.5), [(0, RegisterType::F32, order)]);
            assert_eq!(found(&[a, b, 9, 9], -12.5), [(-1, RegisterType::F32, order)]);
            assert_eq!(found(&[9, 9, a, b], -12.5), [(1, RegisterType::F32, order)]);
        }
        let both = found(&[0, 0x5678, 0x1234, 0], f64::from(0x1234_5678));
        assert_eq!(both, [(0, RegisterType::I32, WordOrder::Cdab), (0, RegisterType::U32, WordOrder::Cdab)]);
        assert_eq!(found(&[1, 2, 3, 4], -12.5), []);
    }

    #[test]
    fn the_end_of_the_table_leaves_readings_out() {
        assert_eq!(readings(&[1, 2, 3]).len(), 24);
        assert_eq!(readings(&[1]).len(), 0);
    }
}
