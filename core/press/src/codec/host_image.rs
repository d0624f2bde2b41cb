//! Register image of the host: typed values, encoded to the words of the write block.

use crc::{CRC_16_MODBUS, Crc};
use platen_plant::press::{Output, RegisterField, RegisterMap, RegisterPlace};

use super::{press_image::show_number, words};
use crate::{Code, Figures, Publication, Verdict};

const CRC: Crc<u16> = Crc::<u16>::new(&CRC_16_MODBUS);

/// Desired content of the host's registers, without the heartbeat, which is added when the words are encoded.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct HostImage {
    /// A stroke will be accepted.
    pub ready: bool,
    /// A stroke is being measured.
    pub busy: bool,
    /// [`result`](Self::result) is valid.
    pub valid: bool,
    /// The scan is taken, the plate may move.
    pub scan_done: bool,
    /// A stroke was missed; until reset.
    pub missed: bool,
    /// Strokes missed since the last reset.
    pub missed_count: u16,
    /// Results are simulated.
    pub simulated: bool,
    /// Results are not being recorded.
    pub storage_degraded: bool,
    /// The scanner's calibration is not valid.
    pub calibration_invalid: bool,
    /// Echo of the accepted stroke's number, 0 before the first.
    pub ack_stroke_id: u16,
    /// Session of that stroke.
    pub session: u16,
    /// Attempt of that stroke.
    pub attempt: u16,
    /// Content of `error_code`.
    pub error: Option<Code>,
    /// Content of `warning_code`.
    pub warning: Option<Code>,
    /// Count of published results.
    pub result_seq: u16,
    /// The result, once it may be written; `None` writes every figure as invalid.
    pub result: Option<Publication>,
    /// Number of this installation.
    pub owner: u16,
    /// Number of the handshake's state.
    pub host_state: u16,
}

impl HostImage {
    fn verdict(&self) -> Option<Verdict> {
        self.result.as_ref().filter(|_| self.valid).map(|result| result.measurement.verdict())
    }

    fn switch(&self, output: Output) -> Option<bool> {
        Some(match output {
            Output::StatusReady => self.ready,
            Output::StatusBusy => self.busy,
            Output::StatusResultValid => self.valid,
            Output::StatusPass => self.verdict() == Some(Verdict::Pass),
            Output::StatusFail => self.verdict() == Some(Verdict::Fail),
            Output::StatusError => self.error.is_some(),
            Output::StatusWarning => self.warning.is_some(),
            Output::StatusScanDone => self.scan_done,
            Output::StatusMissedStroke => self.missed,
            Output::StatusSimulated => self.simulated,
            Output::StatusStorageDegraded => self.storage_degraded,
            Output::StatusCalibrationInvalid => self.calibration_invalid,
            Output::StatusNotMeasured => self.verdict() == Some(Verdict::NotMeasured),
            Output::StatusCannotTell => self.verdict() == Some(Verdict::CannotTell),
            _ => return None,
        })
    }

    /// Returns the number of a handshake field; `None` for switches and figures.
    fn count(&self, output: Output, heartbeat: u16) -> Option<u32> {
        let code = |code: Option<Code>| u32::from(code.map_or(0, Code::number));
        let result = self.result.as_ref();
        let scanned_at = result.and_then(|result| result.measurement.scanned_at);
        Some(match output {
            Output::MapVersion => u32::from(platen_plant::press::MAP_VERSION),
            Output::Heartbeat => u32::from(heartbeat),
            Output::AckStrokeId => u32::from(self.ack_stroke_id),
            Output::ResultStrokeId => result.map_or(0, |result| u32::from(result.key.stroke)),
            Output::SessionEcho => u32::from(self.session),
            Output::ErrorCode => code(self.error),
            Output::WarningCode => code(self.warning),
            Output::ResultSeq | Output::ResultSeqTail => u32::from(self.result_seq),
            Output::MissedCount => u32::from(self.missed_count),
            Output::UnixS => scanned_at.map_or(0, |at| at.unix_s),
            Output::Ms => scanned_at.map_or(0, |at| u32::from(at.ms)),
            Output::RecipeEcho => result.and_then(|result| result.recipe_id).map_or(0, u32::from),
            Output::Owner => u32::from(self.owner),
            Output::RunId => result.map_or(0, |result| result.run_id),
            Output::HostState => u32::from(self.host_state),
            Output::AttemptEcho => u32::from(self.attempt),
            _ => return None,
        })
    }

    /// Encodes the write block. Reserved registers are 0.
    pub fn encode(&self, map: &RegisterMap, heartbeat: u16) -> Vec<u16> {
        let mut block = vec![0; usize::from(map.write.count)];
        for (&output, field) in &map.outputs {
            if output != Output::Crc16 {
                self.put(output, field, heartbeat, &mut block);
            }
        }
        if let Some(offset) = map.output(Output::Crc16).and_then(|field| field.place.offset()) {
            let crc = checksum(map, &block);
            put_words(&mut block, offset, &[crc]);
        }
        block
    }

    fn put(&self, output: Output, field: &RegisterField, heartbeat: u16, block: &mut [u16]) {
        if let Some(on) = self.switch(output) {
            let raw = on != field.active_low;
            match field.place {
                RegisterPlace::Bit(offset, bit) => {
                    if let Some(word) = block.get_mut(usize::from(offset)) {
                        *word |= u16::from(raw) << bit;
                    }
                }
                RegisterPlace::Register(offset) => put_words(block, offset, &[u16::from(raw)]),
                RegisterPlace::Constant(_) => {}
            }
            return;
        }
        let Some(offset) = field.place.offset() else { return };
        for index in 0..field.count {
            let figure = || {
                let figures = &self.result.as_ref()?.measurement.figures;
                figure(figures, output, field, usize::from(index))
            };
            let bits = match self.count(output, heartbeat) {
                Some(count) => words::count_bits(field, count),
                None => words::number_bits(field, figure()).0,
            };
            let registers = words::registers(field.kind, field.order, bits);
            put_words(block, offset + index * field.kind.registers(), &registers);
        }
    }
}

fn put_words(block: &mut [u16], offset: u16, words: &[u16]) {
    let start = usize::from(offset);
    if let Some(place) = block.get_mut(start..start + words.len()) {
        place.copy_from_slice(words);
    }
}

/// Returns whether a figure is larger than its field can hold.
pub fn saturates(map: &RegisterMap, figures: &Figures) -> bool {
    map.outputs.iter().any(|(&output, field)| {
        let cut = |index| words::number_bits(field, figure(figures, output, field, index)).1;
        (0..usize::from(field.count)).any(cut)
    })
}

/// Returns the figure of one value of a field; `None` without one and in fields of the handshake.
fn figure(figures: &Figures, output: Output, field: &RegisterField, index: usize) -> Option<f64> {
    match field.from.or(output.measure()) {
        Some(measure) => figures.values.get(&measure).copied(),
        None if output == Output::Station => figures.stations.get(index).copied().flatten(),
        None => None,
    }
}

/// Returns the CRC-16/MODBUS over the block's fields, high byte first, in the order of their registers. Left out are
/// the fields that change with every beat or step (map version, heartbeat, status, host state) and the closing words
/// (tail, the CRC itself). In the built-in map the CRC covers the registers 3-51 and 55-61.
fn checksum(map: &RegisterMap, block: &[u16]) -> u16 {
    let mut covered = vec![false; block.len()];
    for (&output, field) in &map.outputs {
        let left_out = matches!(
            output,
            Output::MapVersion
                | Output::Heartbeat
                | Output::HostState
                | Output::Crc16
                | Output::ResultSeqTail
        ) || output.is_status();
        if let (false, Some(offset)) = (left_out, field.place.offset()) {
            let start = usize::from(offset);
            let end = (start + usize::from(field.registers())).min(block.len());
            covered[start.min(end)..end].fill(true);
        }
    }
    let mut digest = CRC.digest();
    for (word, _) in block.iter().zip(covered).filter(|(_, covered)| *covered) {
        digest.update(&word.to_be_bytes());
    }
    digest.finalize()
}

/// Returns every field of a write block as read back, by name, formatted for people (`dump` and `watch`).
pub fn describe_outputs(map: &RegisterMap, block: &[u16]) -> Vec<(Output, String)> {
    let show = |(&output, field): (&Output, &RegisterField)| {
        let value = |index: u16| {
            let start = usize::from(field.place.offset()? + index * field.kind.registers());
            let words = block.get(start..start + usize::from(field.kind.registers()))?;
            if let RegisterPlace::Bit(_, bit) = field.place {
                return Some(u16::from((words[0] >> bit & 1 == 1) != field.active_low).to_string());
            }
            let bits = words::bits(field.kind, field.order, words)?;
            words::number(field, bits).map(|number| show_number(field, number))
        };
        let values: Vec<_> =
            (0..field.count).map(|index| value(index).unwrap_or_else(|| "-".into())).collect();
        (output, values.join(" "))
    };
    map.outputs.iter().map(show).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Measurement, StrokeKey, Timestamp};
    use platen_model::Measure;
    use platen_plant::press::{RegisterField, RegisterType};

    fn publication() -> Publication {
        let values = [
            (Measure::DeviationMax, 0.0041),
            (Measure::DeviationMin, -0.0012),
            (Measure::DeviationRms, 0.00151),
            (Measure::Coverage, 0.981),
            (Measure::DeviationMaxU, 1.25),
            (Measure::GapMax, 0.00409),
            (Measure::GapLine, 2.0),
            (Measure::Sense, -1.0),
            (Measure::ScanTime, 12.344),
        ];
        Publication {
            key: StrokeKey { press: 3, session: 0xBEEF, stroke: 41, attempt: 0 },
            run_id: 0x0001_0002,
            seq: 7,
            recipe_id: Some(17),
            measurement: Measurement {
                judgement: Verdict::Fail.into(),
                figures: Figures { values: values.into(), stations: vec![Some(0.001), None, Some(-0.002)] },
                scanned_at: Some(Timestamp { unix_s: 1_700_000_000, ms: 250 }),
                warning: None,
            },
        }
    }

    fn image() -> HostImage {
        HostImage {
            ready: true,
            valid: true,
            ack_stroke_id: 41,
            session: 0xBEEF,
            result_seq: 7,
            result: Some(publication()),
            owner: 0x5EED,
            host_state: 11,
            ..HostImage::default()
        }
    }

    #[test]
    fn golden_words_of_the_host_block() {
        let words = image().encode(&RegisterMap::pph1(), 99);
        assert_eq!(words.len(), 64);
        assert_eq!(words[0..10], [1, 99, 0b1_0101, 41, 41, 0xBEEF, 0, 0, 7, 0]);
        assert_eq!(words[10..14], [410, 0xFF88, 151, 0xFFFF]);
        assert_eq!(words[14..22], [0xFFFF, 0xFFFF, 981, 1250, 0x8000, 0x8000, 0x8000, 0x8000]);
        assert_eq!(words[22..26], [100, 0x8000, 0xFF38, 0x8000]);
        assert!(words[26..42].iter().all(|&word| word == 0x8000));
        assert_eq!(words[42..52], [1234, 0xFFFF, 0xFFFF, 0x6553, 0xF100, 250, 17, 0x5EED, 1, 2]);
        assert_eq!(words[53..64], [7, 11, 409, 0xFFFF, 0x8000, 0x8000, 2, 0xFFFF, 0, 0, 0]);
    }

    /// Computes it bit by bit, as a PLC programmer would write it: polynomial 0xA001, start 0xFFFF.
    #[test]
    fn the_crc_is_that_of_the_page() {
        let words = image().encode(&RegisterMap::pph1(), 99);
        let mut crc = 0xFFFFu16;
        for word in words[3..=51].iter().chain(&words[55..=61]) {
            for byte in word.to_be_bytes() {
                crc ^= u16::from(byte);
                for _ in 0..8 {
                    crc = if crc & 1 == 1 { crc >> 1 ^ 0xA001 } else { crc >> 1 };
                }
            }
        }
        assert_eq!(words[52], crc);
    }

    #[test]
    fn the_last_stroke_number_is_no_invalid_value() {
        let words = HostImage { ack_stroke_id: 65_535, ..image() }.encode(&RegisterMap::pph1(), 65_535);
        assert_eq!((words[1], words[3]), (65_535, 65_535));
    }

    #[test]
    fn no_verdict_bit_without_a_valid_result() {
        let bits = |verdict: Verdict, valid| {
            let mut image = HostImage { valid, ..image() };
            if let Some(result) = &mut image.result {
                result.measurement.judgement = verdict.into();
            }
            image.encode(&RegisterMap::pph1(), 0)[2] & 0b11_0000_0001_1100
        };
        assert_eq!(bits(Verdict::Pass, true), 1 << 2 | 1 << 3);
        assert_eq!(bits(Verdict::Fail, true), 1 << 2 | 1 << 4);
        assert_eq!(bits(Verdict::NotMeasured, true), 1 << 2 | 1 << 12);
        assert_eq!(bits(Verdict::CannotTell, true), 1 << 2 | 1 << 13);
        assert_eq!(bits(Verdict::Pass, false), 0);
    }

    #[test]
    fn a_figure_can_be_moved_and_stand_in_a_float() {
        let mut map = RegisterMap::pph1();
        let float =
            RegisterField { from: Some(Measure::GapMax), ..RegisterField::register(62, RegisterType::F32) };
        map.outputs.insert(Output::DevMax, float);
        let words = image().encode(&map, 0);
        assert_eq!(words[10], 0, "its old register is reserved now");
        let bits = (0.00409f64 as f32).to_bits();
        assert_eq!(words[62..64], [(bits >> 16) as u16, bits as u16]);
    }

    #[test]
    fn saturation_is_reported() {
        let mut figures = publication().measurement.figures;
        assert!(!saturates(&RegisterMap::pph1(), &figures));
        figures.stations[2] = Some(0.4);
        assert!(saturates(&RegisterMap::pph1(), &figures));
    }
}
