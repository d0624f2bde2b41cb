//! Conversion of numbers and texts to and from 16-bit registers.

use platen_plant::press::{RegisterField, RegisterType, WordOrder};

/// Returns the bits of the 32-bit value in two registers.
fn join(order: WordOrder, words: [u16; 2]) -> u32 {
    let [first, second] = match order {
        WordOrder::Abcd => words,
        WordOrder::Cdab => [words[1], words[0]],
        WordOrder::Badc => words.map(u16::swap_bytes),
        WordOrder::Dcba => [words[1].swap_bytes(), words[0].swap_bytes()],
    };
    u32::from(first) << 16 | u32::from(second)
}

/// Returns the two registers of a 32-bit value.
fn split(order: WordOrder, bits: u32) -> [u16; 2] {
    let words = [(bits >> 16) as u16, bits as u16];
    match order {
        WordOrder::Abcd => words,
        WordOrder::Cdab => [words[1], words[0]],
        WordOrder::Badc => words.map(u16::swap_bytes),
        WordOrder::Dcba => [words[1].swap_bytes(), words[0].swap_bytes()],
    }
}

/// Returns the bits of one value in `words`; `None` for texts.
pub(crate) fn bits(kind: RegisterType, order: WordOrder, words: &[u16]) -> Option<u32> {
    match (kind.registers(), words) {
        (1, &[word]) => Some(u32::from(word)),
        (2, &[first, second]) if !matches!(kind, RegisterType::Ascii { .. }) => {
            Some(join(order, [first, second]))
        }
        _ => None,
    }
}

/// Returns the registers of the bits of one value.
pub(super) fn registers(kind: RegisterType, order: WordOrder, bits: u32) -> Vec<u16> {
    if kind.registers() == 2 { split(order, bits).to_vec() } else { vec![bits as u16] }
}

/// Returns the raw number of the bits of one value.
pub(crate) fn raw_number(kind: RegisterType, bits: u32) -> f64 {
    match kind {
        RegisterType::Bool | RegisterType::U16 | RegisterType::Ascii { .. } => f64::from(bits as u16),
        RegisterType::I16 => f64::from(bits as u16 as i16),
        RegisterType::U32 => f64::from(bits),
        RegisterType::I32 => f64::from(bits as i32),
        RegisterType::F32 => f64::from(f32::from_bits(bits)),
    }
}

fn raw_bits(kind: RegisterType, raw: f64) -> u32 {
    match kind {
        RegisterType::Bool | RegisterType::U16 | RegisterType::Ascii { .. } => u32::from(raw as u16),
        RegisterType::I16 => u32::from(raw as i16 as u16),
        RegisterType::U32 => raw as u32,
        RegisterType::I32 => raw as i32 as u32,
        RegisterType::F32 => (raw as f32).to_bits(),
    }
}

/// Returns the bits for "no value": those of the field, else the value farthest from every plausible one.
pub(super) fn invalid_bits(field: &RegisterField) -> u32 {
    field.invalid.unwrap_or(match field.kind {
        RegisterType::Bool | RegisterType::Ascii { .. } => 0,
        RegisterType::U16 => 0xFFFF,
        RegisterType::I16 => 0x8000,
        RegisterType::U32 => 0xFFFF_FFFF,
        RegisterType::I32 => 0x8000_0000,
        RegisterType::F32 => f32::NAN.to_bits(),
    })
}

/// Returns the bits of a number of the inside unit, and whether it was clamped to the range of the field. The range is
/// symmetric (an i16: -32767 to 32767) and excludes the invalid value.
pub(super) fn number_bits(field: &RegisterField, number: Option<f64>) -> (u32, bool) {
    let invalid = invalid_bits(field);
    let (Some(number), Some((low, high))) = (number.filter(|n| n.is_finite()), field.kind.range()) else {
        return (invalid, false);
    };
    let raw = number / field.unit.factor() / field.scale;
    if field.kind == RegisterType::F32 {
        return (raw_bits(field.kind, raw.clamp(low, high)), !(low..=high).contains(&raw));
    }
    let raw = raw.round();
    let held = raw.clamp(low.max(-high), high);
    let bits = raw_bits(field.kind, held);
    if bits == invalid {
        return (raw_bits(field.kind, held - held.signum()), true);
    }
    (bits, held != raw)
}

/// Returns the bits of a count of the handshake, for which every value is valid.
pub(super) fn count_bits(field: &RegisterField, count: u32) -> u32 {
    let (low, high) = field.kind.range().unwrap_or((0.0, 0.0));
    raw_bits(field.kind, f64::from(count).clamp(low, high))
}

/// Returns the number of the bits of a field, inside unit; `None` for "no value", NaN, and values outside the field's
/// limits.
pub(super) fn number(field: &RegisterField, bits: u32) -> Option<f64> {
    if field.invalid == Some(bits) {
        return None;
    }
    let scaled = raw_number(field.kind, bits) * field.scale;
    let plausible = scaled.is_finite()
        && field.min.is_none_or(|min| scaled >= min)
        && field.max.is_none_or(|max| scaled <= max);
    plausible.then(|| scaled * field.unit.factor())
}

/// Returns the text in `words` up to the first zero byte, without trailing blanks; `None` when empty or not ASCII.
pub(super) fn text(words: &[u16]) -> Option<String> {
    let bytes: Vec<u8> =
        words.iter().flat_map(|word| word.to_be_bytes()).take_while(|&byte| byte != 0).collect();
    let text = String::from_utf8(bytes).ok().filter(|text| text.is_ascii())?;
    let text = text.trim_end();
    (!text.is_empty()).then(|| text.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use platen_plant::Unit;

    /// Raw words from the IEEE 754 bits of -12.5 (C1480000), never from a library's own names of the orders.
    #[test]
    fn golden_words_of_every_order() {
        let golden = [
            (WordOrder::Abcd, [0xC148, 0x0000]),
            (WordOrder::Cdab, [0x0000, 0xC148]),
            (WordOrder::Badc, [0x48C1, 0x0000]),
            (WordOrder::Dcba, [0x0000, 0x48C1]),
        ];
        for (order, words) in golden {
            let field = RegisterField { order, ..RegisterField::register(0, RegisterType::F32) };
            let (bits_out, cut) = number_bits(&field, Some(-12.5));
            assert_eq!(
                (registers(RegisterType::F32, order, bits_out), cut),
                (words.to_vec(), false),
                "{order:?}"
            );
            assert_eq!(
                number(&field, bits(RegisterType::F32, order, &words).unwrap()),
                Some(-12.5),
                "{order:?}"
            );
        }
        let orders = [
            (WordOrder::Abcd, [0x1234, 0x5678]),
            (WordOrder::Cdab, [0x5678, 0x1234]),
            (WordOrder::Badc, [0x3412, 0x7856]),
            (WordOrder::Dcba, [0x7856, 0x3412]),
        ];
        for (order, words) in orders {
            assert_eq!(bits(RegisterType::U32, order, &words), Some(0x1234_5678), "{order:?}");
            assert_eq!(registers(RegisterType::U32, order, 0x1234_5678), words, "{order:?}");
        }
    }

    #[test]
    fn hundredths_of_a_millimetre_saturate_and_never_wrap_or_turn_invalid() {
        let signed =
            RegisterField::register(0, RegisterType::I16).scaled(0.01, Unit::MILLIMETRE).invalid(0x8000);
        let unsigned =
            RegisterField::register(0, RegisterType::U16).scaled(0.01, Unit::MILLIMETRE).invalid(0xFFFF);
        let check = |field: &RegisterField, metres: Option<f64>, word: u32, cut: bool| {
            assert_eq!(number_bits(field, metres), (word, cut), "{metres:?}");
        };
        check(&signed, Some(0.0041), 410, false);
        check(&signed, Some(-0.0041), 0xFE66, false);
        check(&signed, Some(0.000_005), 1, false);
        check(&signed, Some(0.327_67), 0x7FFF, false);
        check(&signed, Some(0.4), 0x7FFF, true);
        check(&signed, Some(-0.327_68), 0x8001, true);
        check(&signed, Some(-1.0), 0x8001, true);
        check(&signed, None, 0x8000, false);
        check(&signed, Some(f64::NAN), 0x8000, false);
        check(&unsigned, Some(0.655_34), 0xFFFE, false);
        check(&unsigned, Some(0.655_35), 0xFFFE, true);
        check(&unsigned, Some(-0.001), 0, true);
        check(&unsigned, None, 0xFFFF, false);
    }

    #[test]
    fn limits_and_the_invalid_value_make_a_number_missing() {
        let thickness = RegisterField {
            min: Some(3.0),
            max: Some(120.0),
            ..RegisterField::register(0, RegisterType::U16)
        };
        let thickness = thickness.scaled(0.01, Unit::MILLIMETRE).invalid(0xFFFF);
        assert_eq!(number(&thickness, 3500), Some(0.035));
        assert_eq!(number(&thickness, 299), None);
        assert_eq!(number(&thickness, 12_001), None);
        assert_eq!(number(&thickness, 0xFFFF), None);
        let float = RegisterField::register(0, RegisterType::F32);
        assert_eq!(number(&float, f32::NAN.to_bits()), None);
        let signed = RegisterField::register(0, RegisterType::I16).scaled(0.01, Unit::DEGREE);
        assert!((number(&signed, 0xDCD8).unwrap() + 90.0f64.to_radians()).abs() < 1e-12, "-90.00 degrees");
    }

    #[test]
    fn texts_end_at_the_first_zero() {
        assert_eq!(text(&[0x4131, 0x3700, 0x5858]), Some("A17".into()));
        assert_eq!(text(&[0x4120, 0x2020]), Some("A".into()));
        assert_eq!(text(&[0, 0]), None);
        assert_eq!(text(&[0xFFFF, 0xFFFF]), None);
    }
}
