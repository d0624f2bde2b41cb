//! Register image of the press: typed values, decoded from the words of the read block.

use platen_plant::Unit;
use platen_plant::press::{Input, Profile, RegisterField, RegisterMap, RegisterPlace, RegisterType};

use super::words;
use crate::{StrokeData, Timestamp};

/// Content of the press's registers at one read.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PressImage {
    /// Heartbeat; `None` where the press has none.
    pub heartbeat: Option<u16>,
    /// Measuring is enabled.
    pub enable: bool,
    /// A stroke waits to be measured.
    pub trigger: bool,
    /// The result has been read.
    pub ack: bool,
    /// Abort the running scan.
    pub abort: bool,
    /// Clear latched errors.
    pub error_reset: bool,
    /// Ram up and plate at rest.
    pub clear_to_scan: bool,
    /// The plate is finished.
    pub part_end: bool,
    /// Measure the same stroke again.
    pub rescan: bool,
    /// Number of the stroke, 0 for none.
    pub stroke_id: u16,
    /// Session of the press, 0 where it has none.
    pub session_id: u16,
    /// Count of rescan requests for this stroke.
    pub attempt: u16,
    /// Data about the stroke; complete only when the whole block was read.
    pub data: StrokeData,
    /// A register with another value than the expected one.
    pub wrong: Option<Wrong>,
}

/// A register with another value than the one expected: wrong press or wrong map.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Wrong {
    /// Field.
    pub input: Input,
    /// Value found.
    pub found: i64,
    /// Value expected.
    pub expected: i64,
}

/// Torn read: the press was writing its block; `stroke_id` and `stroke_id_tail` differ.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Torn {
    /// The stroke number.
    pub head: u16,
    /// `stroke_id_tail`.
    pub tail: u16,
}

/// Decoder of the fields of one map.
struct Reader<'a> {
    map: &'a RegisterMap,
    words: &'a [u16],
}

impl Reader<'_> {
    /// Returns the registers of one field, if the map has it and they were read.
    fn registers(&self, field: &RegisterField) -> Option<&[u16]> {
        let start = usize::from(field.place.offset()?);
        self.words.get(start..start + usize::from(field.registers()))
    }

    fn raw(&self, input: Input) -> Option<(&RegisterField, u32)> {
        let field = self.map.input(input)?;
        let words = self.registers(field)?;
        Some((field, words::bits(field.kind, field.order, words)?))
    }

    /// Returns a number in the inside unit.
    fn number(&self, input: Input) -> Option<f64> {
        let field = self.map.input(input)?;
        if let RegisterPlace::Constant(number) = field.place {
            return Some(number * field.unit.factor());
        }
        let (field, bits) = self.raw(input)?;
        words::number(field, bits)
    }

    fn count_u32(&self, input: Input) -> Option<u32> {
        let number = self.number(input)?;
        (0.0..=f64::from(u32::MAX)).contains(&number).then_some(number as u32)
    }

    fn count(&self, input: Input) -> Option<u16> {
        self.count_u32(input).and_then(|number| u16::try_from(number).ok())
    }

    fn switch(&self, input: Input) -> Option<bool> {
        let field = self.map.input(input)?;
        match field.place {
            RegisterPlace::Constant(number) => Some(number != 0.0),
            RegisterPlace::Bit(offset, bit) => {
                let word = self.words.get(usize::from(offset))?;
                Some((word >> bit & 1 == 1) != field.active_low)
            }
            RegisterPlace::Register(_) => {
                let (field, bits) = self.raw(input)?;
                Some((bits != 0) != field.active_low)
            }
        }
    }

    fn text(&self, input: Input) -> Option<String> {
        let field = self.map.input(input)?;
        if matches!(field.kind, RegisterType::Ascii { .. }) {
            words::text(self.registers(field)?)
        } else {
            None
        }
    }

    fn wrong(&self, press_id: u16) -> Option<Wrong> {
        let fixed = self.map.inputs.iter().filter_map(|(input, field)| Some((*input, field.expect?)));
        let id = self.map.input(Input::PressId).map(|_| (Input::PressId, i64::from(press_id)));
        fixed.chain(id).find_map(|(input, expected)| {
            let (field, bits) = self.raw(input)?;
            let found = words::raw_number(field.kind, bits) as i64;
            (found != expected).then_some(Wrong { input, found, expected })
        })
    }

    /// Returns a number for which 0 means "none": no stroke has zero force, ram depth, die or thickness.
    fn reported(&self, input: Input) -> Option<f64> {
        self.number(input).filter(|value| *value != 0.0)
    }

    fn data(&self) -> StrokeData {
        StrokeData {
            recipe_id: self.count(Input::RecipeId),
            press_state: self.count(Input::PressState),
            part_id: self.count_u32(Input::PartId),
            part_name: self.text(Input::PartName),
            bend_index: self.count(Input::BendIndex),
            thickness: self.reported(Input::Thickness),
            force: self.reported(Input::PressForce),
            ram_depth: self.reported(Input::RamDepth),
            plate_x: self.number(Input::PlateX),
            plate_y: self.number(Input::PlateY),
            plate_rot: self.number(Input::PlateRot),
            temperature: self.number(Input::Temperature),
            plc_time: self
                .count_u32(Input::PlcUnixS)
                .filter(|&unix_s| unix_s > 0)
                .map(|unix_s| Timestamp { unix_s, ms: self.count(Input::PlcMs).unwrap_or(0) }),
            die_id: self.count(Input::DieId).filter(|die| *die != 0),
            crew: self.count(Input::Crew).filter(|crew| *crew != 0),
            baseline: self.switch(Input::Baseline).unwrap_or(false),
            dry_run: self.switch(Input::DryRun).unwrap_or(false),
        }
    }
}

impl PressImage {
    /// Decodes the registers of press `press_id`; `words` are the read block or its first part, in which case later
    /// fields are absent.
    ///
    /// A press without an `enable` or `clear_to_scan` always gives both. One that counts no strokes and has no `ack`
    /// acknowledges by dropping its trigger.
    ///
    /// The fields that identify press and map do not change while a press writes: they are checked first.
    ///
    /// # Errors
    /// [`Torn`], when the press was writing: read again.
    pub fn decode(map: &RegisterMap, press_id: u16, words: &[u16]) -> Result<Self, Torn> {
        let reader = Reader { map, words };
        let stroke_id = reader.count(Input::StrokeId).unwrap_or(0);
        let wrong = reader.wrong(press_id);
        let tail = reader.count(Input::StrokeIdTail).filter(|&tail| tail != stroke_id);
        if let (Some(tail), None) = (tail, wrong) {
            return Err(Torn { head: stroke_id, tail });
        }
        let trigger = reader.switch(Input::Trigger).unwrap_or(false);
        let go_is_ack = map.profile != Profile::Pph1 && map.input(Input::Ack).is_none();
        Ok(Self {
            heartbeat: reader.count(Input::Heartbeat),
            enable: reader.switch(Input::Enable).unwrap_or(true),
            trigger,
            ack: if go_is_ack { !trigger } else { reader.switch(Input::Ack).unwrap_or(false) },
            abort: reader.switch(Input::Abort).unwrap_or(false),
            error_reset: reader.switch(Input::ErrorReset).unwrap_or(false),
            clear_to_scan: reader.switch(Input::ClearToScan).unwrap_or(true),
            part_end: reader.switch(Input::PartEnd).unwrap_or(false),
            rescan: reader.switch(Input::Rescan).unwrap_or(false),
            stroke_id,
            session_id: reader.count(Input::SessionId).unwrap_or(0),
            attempt: reader.count(Input::Attempt).unwrap_or(0),
            data: reader.data(),
            wrong,
        })
    }
}

/// Returns every field that was read, by name, formatted for people (`dump` and `watch`).
pub fn describe_inputs(map: &RegisterMap, words: &[u16]) -> Vec<(Input, String)> {
    let reader = Reader { map, words };
    let show = |(&input, field): (&Input, &RegisterField)| {
        let text = match field.kind {
            RegisterType::Ascii { .. } => reader.text(input).unwrap_or_else(|| "-".into()),
            RegisterType::Bool => {
                reader.switch(input).map_or_else(|| "-".into(), |on| u8::from(on).to_string())
            }
            _ => reader.number(input).map_or_else(|| "-".into(), |number| show_number(field, number)),
        };
        (input, text)
    };
    map.inputs.iter().map(show).collect()
}

/// Formats a number of the inside unit in the field's unit, with the digits of its scale.
pub(super) fn show_number(field: &RegisterField, number: f64) -> String {
    let digits = if field.kind == RegisterType::F32 {
        3
    } else {
        (-field.scale.abs().log10()).ceil().clamp(0.0, 6.0) as usize
    };
    let unit = if field.unit == Unit::ONE { String::new() } else { format!(" {}", field.unit.symbol()) };
    format!("{:.digits$}{unit}", number / field.unit.factor())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the example of the register page as raw words: 35.00 mm, 12 MN, -3.21 mm, 7/-8 mm, -1.5 degrees, 21.5
    /// degrees Celsius.
    fn golden() -> Vec<u16> {
        let mut words = vec![0; 32];
        words[0] = 1;
        words[1] = 77;
        words[2] = 0b10_0010_0011;
        words[3] = 41;
        words[4] = 0xBEEF;
        words[5] = 17;
        words[6] = 5;
        words[7] = 3;
        words[8..10].copy_from_slice(&[0x0001, 0x86A1]);
        words[10..12].copy_from_slice(&[0x4131, 0x3700]);
        words[18] = 9;
        words[19] = 3500;
        words[20] = 12_000;
        words[21] = 0xFEBF;
        words[22] = 7;
        words[23] = 0xFFF8;
        words[24] = 0xFF6A;
        words[25] = 215;
        words[26..28].copy_from_slice(&[0x6553, 0xF100]);
        words[28] = 250;
        words[29] = 2;
        words[30] = 8;
        words[31] = 41;
        words
    }

    #[test]
    fn golden_words_of_the_press_block() {
        let image = PressImage::decode(&RegisterMap::pph1(), 3, &golden()).unwrap();
        assert!(image.enable && image.trigger && image.clear_to_scan && image.data.baseline);
        assert!(!image.ack && !image.abort && !image.error_reset && !image.part_end && !image.rescan);
        assert_eq!((image.stroke_id, image.session_id, image.attempt), (41, 0xBEEF, 2));
        assert_eq!((image.heartbeat, image.wrong), (Some(77), None));
        let data = image.data;
        assert_eq!((data.part_id, data.part_name.as_deref()), (Some(100_001), Some("A17")));
        assert_eq!((data.recipe_id, data.bend_index, data.die_id), (Some(17), Some(9), Some(8)));
        assert_eq!(data.plc_time, Some(Timestamp { unix_s: 1_700_000_000, ms: 250 }));
        let close = |value: Option<f64>, expected: f64| assert!((value.unwrap() - expected).abs() < 1e-12);
        close(data.thickness, 0.035);
        close(data.force, 12e6);
        close(data.ram_depth, -0.00321);
        close(data.plate_x, 0.007);
        close(data.plate_y, -0.008);
        close(data.plate_rot, (-1.5f64).to_radians());
        close(data.temperature, 21.5);
    }

    #[test]
    fn zero_is_no_value_where_no_stroke_is_made_without_one() {
        let mut words = golden();
        let of = |data: StrokeData| (data.thickness, data.force, data.ram_depth, data.die_id);
        let reported = of(PressImage::decode(&RegisterMap::pph1(), 3, &words).unwrap().data);
        assert!(reported.0.and(reported.1).and(reported.2).and(reported.3).is_some(), "{reported:?}");
        let map = RegisterMap::pph1();
        for input in [Input::Thickness, Input::PressForce, Input::RamDepth, Input::DieId] {
            words[usize::from(map.input(input).unwrap().place.offset().unwrap())] = 0;
        }
        assert_eq!(of(PressImage::decode(&map, 3, &words).unwrap().data), (None, None, None, None));
    }

    #[test]
    fn a_differing_copy_of_the_stroke_number_is_torn() {
        let mut words = golden();
        words[31] = 40;
        let torn = PressImage::decode(&RegisterMap::pph1(), 3, &words);
        assert_eq!(torn, Err(Torn { head: 41, tail: 40 }));
        let fast = PressImage::decode(&RegisterMap::pph1(), 3, &words[..8]).unwrap();
        assert_eq!((fast.stroke_id, fast.data.part_id), (41, None));
    }

    #[test]
    fn another_press_or_another_map_is_noticed() {
        let map = RegisterMap::pph1();
        let wrong = PressImage::decode(&map, 4, &golden()).unwrap().wrong;
        assert_eq!(wrong, Some(Wrong { input: Input::PressId, found: 3, expected: 4 }));
        let mut words = golden();
        words[0] = 2;
        let wrong = PressImage::decode(&map, 3, &words).unwrap().wrong;
        assert_eq!(wrong, Some(Wrong { input: Input::MapVersion, found: 2, expected: 1 }));
    }

    #[test]
    fn a_press_with_one_command_word_acknowledges_by_dropping_go() {
        let map = RegisterMap::word();
        let go = PressImage::decode(&map, 0, &[1]).unwrap();
        assert!(go.trigger && !go.ack && go.enable && go.clear_to_scan);
        assert!(PressImage::decode(&map, 0, &[0]).unwrap().ack);
        let mut low = map;
        low.inputs.entry(Input::Trigger).and_modify(|field| field.active_low = true);
        assert!(PressImage::decode(&low, 0, &[0]).unwrap().trigger);
    }
}
