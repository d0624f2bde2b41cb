//! Built-in register map "PPH-1" (plate press - host, version 1), and the two minimal profiles.
//!
//! Numbers that are judged have 16 bits, so that no default register depends on a word order. The block lengths are
//! distinct (8, 32, 64): on a serial line a late answer cannot be mistaken for another block.

use std::collections::BTreeMap;

use super::{
    AddressBase, Block, Counter, Input, Output, Profile, RegisterField, RegisterMap, RegisterTable,
    RegisterType,
};
use crate::Unit;

/// Raw value of an i16 field that has no value.
pub const INVALID_I16: u32 = 0x8000;
/// Raw value of a u16 field that has no value.
pub const INVALID_U16: u32 = 0xFFFF;
/// Stations that the map has registers for.
pub const STATIONS: u16 = 20;
/// The only version of this map.
pub const MAP_VERSION: u16 = 1;

fn u16_at(offset: u16) -> RegisterField {
    RegisterField::register(offset, RegisterType::U16)
}

fn i16_at(offset: u16) -> RegisterField {
    RegisterField::register(offset, RegisterType::I16)
}

fn u32_at(offset: u16) -> RegisterField {
    RegisterField::register(offset, RegisterType::U32)
}

/// Returns a field for a signed result in hundredths of a millimetre.
fn signed_mm(offset: u16) -> RegisterField {
    i16_at(offset).scaled(0.01, Unit::MILLIMETRE).invalid(INVALID_I16)
}

/// Returns a field for an unsigned result in hundredths of a millimetre.
fn unsigned_mm(offset: u16) -> RegisterField {
    u16_at(offset).scaled(0.01, Unit::MILLIMETRE).invalid(INVALID_U16)
}

/// Returns a field for a place on the plate in millimetres.
fn place_mm(offset: u16) -> RegisterField {
    i16_at(offset).scaled(1.0, Unit::MILLIMETRE).invalid(INVALID_I16)
}

/// Returns a field for a share in tenths of a percent.
fn share(offset: u16) -> RegisterField {
    u16_at(offset).scaled(0.1, Unit::PERCENT).invalid(INVALID_U16)
}

/// Returns a field for a duration in hundredths of a second.
fn duration(offset: u16) -> RegisterField {
    u16_at(offset).scaled(10.0, Unit::MILLISECOND).invalid(INVALID_U16)
}

fn inputs() -> BTreeMap<Input, RegisterField> {
    BTreeMap::from([
        (Input::MapVersion, RegisterField { expect: Some(i64::from(MAP_VERSION)), ..u16_at(0) }),
        (Input::Heartbeat, u16_at(1)),
        (Input::Enable, RegisterField::bit(2, 0)),
        (Input::Trigger, RegisterField::bit(2, 1)),
        (Input::Ack, RegisterField::bit(2, 2)),
        (Input::Abort, RegisterField::bit(2, 3)),
        (Input::ErrorReset, RegisterField::bit(2, 4)),
        (Input::ClearToScan, RegisterField::bit(2, 5)),
        (Input::DryRun, RegisterField::bit(2, 6)),
        (Input::PartEnd, RegisterField::bit(2, 7)),
        (Input::Rescan, RegisterField::bit(2, 8)),
        (Input::Baseline, RegisterField::bit(2, 9)),
        (Input::StrokeId, u16_at(3)),
        (Input::SessionId, u16_at(4)),
        (Input::RecipeId, u16_at(5)),
        (Input::PressState, u16_at(6)),
        (Input::PressId, u16_at(7)),
        (Input::PartId, u32_at(8)),
        (Input::PartName, RegisterField::register(10, RegisterType::Ascii { registers: 8 })),
        (Input::BendIndex, u16_at(18)),
        (Input::Thickness, u16_at(19).scaled(0.01, Unit::MILLIMETRE)),
        (Input::PressForce, u16_at(20).scaled(1.0, Unit::KILONEWTON)),
        (Input::RamDepth, i16_at(21).scaled(0.01, Unit::MILLIMETRE)),
        (Input::PlateX, i16_at(22).scaled(1.0, Unit::MILLIMETRE)),
        (Input::PlateY, i16_at(23).scaled(1.0, Unit::MILLIMETRE)),
        (Input::PlateRot, i16_at(24).scaled(0.01, Unit::DEGREE)),
        (Input::Temperature, i16_at(25).scaled(0.1, Unit::CELSIUS)),
        (Input::PlcUnixS, u32_at(26)),
        (Input::PlcMs, u16_at(28)),
        (Input::Attempt, u16_at(29)),
        (Input::DieId, u16_at(30)),
        (Input::StrokeIdTail, u16_at(31)),
    ])
}

fn outputs() -> BTreeMap<Output, RegisterField> {
    BTreeMap::from([
        (Output::MapVersion, u16_at(0)),
        (Output::Heartbeat, u16_at(1)),
        (Output::StatusReady, RegisterField::bit(2, 0)),
        (Output::StatusBusy, RegisterField::bit(2, 1)),
        (Output::StatusResultValid, RegisterField::bit(2, 2)),
        (Output::StatusPass, RegisterField::bit(2, 3)),
        (Output::StatusFail, RegisterField::bit(2, 4)),
        (Output::StatusError, RegisterField::bit(2, 5)),
        (Output::StatusWarning, RegisterField::bit(2, 6)),
        (Output::StatusScanDone, RegisterField::bit(2, 7)),
        (Output::StatusMissedStroke, RegisterField::bit(2, 8)),
        (Output::StatusSimulated, RegisterField::bit(2, 9)),
        (Output::StatusStorageDegraded, RegisterField::bit(2, 10)),
        (Output::StatusCalibrationInvalid, RegisterField::bit(2, 11)),
        (Output::StatusNotMeasured, RegisterField::bit(2, 12)),
        (Output::StatusCannotTell, RegisterField::bit(2, 13)),
        (Output::AckStrokeId, u16_at(3)),
        (Output::ResultStrokeId, u16_at(4)),
        (Output::SessionEcho, u16_at(5)),
        (Output::ErrorCode, u16_at(6)),
        (Output::WarningCode, u16_at(7)),
        (Output::ResultSeq, u16_at(8)),
        (Output::MissedCount, u16_at(9)),
        (Output::DevMax, signed_mm(10)),
        (Output::DevMin, signed_mm(11)),
        (Output::DevRms, unsigned_mm(12)),
        (Output::DevP95, unsigned_mm(13)),
        (Output::InTol, share(14)),
        (Output::Tolerance, unsigned_mm(15)),
        (Output::Coverage, share(16)),
        (Output::MaxX, place_mm(17)),
        (Output::MaxY, place_mm(18)),
        (Output::MinX, place_mm(19)),
        (Output::MinY, place_mm(20)),
        (Output::RadiusDev, i16_at(21).scaled(0.1, Unit::PERCENT).invalid(INVALID_I16)),
        (Output::Station, RegisterField { count: STATIONS, ..signed_mm(22) }),
        (Output::ScanTime, duration(42)),
        (Output::EvalTime, duration(43)),
        (Output::StrokeToResultTime, duration(44)),
        (Output::UnixS, u32_at(45)),
        (Output::Ms, u16_at(47)),
        (Output::RecipeEcho, u16_at(48)),
        (Output::Owner, u16_at(49)),
        (Output::RunId, u32_at(50)),
        (Output::Crc16, u16_at(52)),
        (Output::ResultSeqTail, u16_at(53)),
        (Output::HostState, u16_at(54)),
        (Output::GapMax, unsigned_mm(55)),
        (Output::GapUnc, unsigned_mm(56)),
        (Output::GapU, place_mm(57)),
        (Output::GapV, place_mm(58)),
        (Output::GapLine, u16_at(59).invalid(INVALID_U16)),
        (Output::Sense, i16_at(60).invalid(INVALID_I16)),
        (Output::AttemptEcho, u16_at(61)),
    ])
}

fn map(profile: Profile, read_count: u16, write_count: u16) -> RegisterMap {
    RegisterMap {
        profile,
        address_base: AddressBase::Zero,
        read: Block { table: RegisterTable::Holding, start: 0, count: read_count },
        write: Block { table: RegisterTable::Holding, start: 100, count: write_count },
        inputs: BTreeMap::new(),
        outputs: BTreeMap::new(),
        counter: Counter::default(),
    }
}

impl RegisterMap {
    /// Returns the built-in map: 32 registers from 0 on for the press, 64 from 100 on for the host.
    pub fn pph1() -> Self {
        Self { inputs: inputs(), outputs: outputs(), ..map(Profile::Pph1, 32, 64) }
    }

    /// Returns the map of profile `word`: a command word (bit 0 go, held until done) and a status word (2 running, 4
    /// done, 8 error) with the largest gap and deviations behind it. The press acknowledges a result by dropping "go".
    pub fn word() -> Self {
        Self {
            inputs: BTreeMap::from([(
                Input::Trigger,
                RegisterField { debounce_reads: 2, ..RegisterField::bit(0, 0) },
            )]),
            outputs: BTreeMap::from([
                (Output::StatusBusy, RegisterField::bit(0, 1)),
                (Output::StatusResultValid, RegisterField::bit(0, 2)),
                (Output::StatusError, RegisterField::bit(0, 3)),
                (Output::DevMax, signed_mm(1)),
                (Output::DevMin, signed_mm(2)),
                (Output::GapMax, unsigned_mm(3)),
                (Output::Sense, i16_at(4).invalid(INVALID_I16)),
            ]),
            ..map(Profile::Word, 1, 5)
        }
    }

    /// Returns the map of profile `bits`: trigger and acknowledge from the press, ready, busy, valid, pass, fail and
    /// error from the host, one register each way, with the largest gap and deviations behind the status.
    pub fn bits() -> Self {
        Self {
            inputs: BTreeMap::from([
                (Input::Trigger, RegisterField { debounce_reads: 2, ..RegisterField::bit(0, 0) }),
                (Input::Ack, RegisterField::bit(0, 1)),
            ]),
            outputs: BTreeMap::from([
                (Output::StatusReady, RegisterField::bit(0, 0)),
                (Output::StatusBusy, RegisterField::bit(0, 1)),
                (Output::StatusResultValid, RegisterField::bit(0, 2)),
                (Output::StatusPass, RegisterField::bit(0, 3)),
                (Output::StatusFail, RegisterField::bit(0, 4)),
                (Output::StatusError, RegisterField::bit(0, 5)),
                (Output::DevMax, signed_mm(1)),
                (Output::DevMin, signed_mm(2)),
                (Output::GapMax, unsigned_mm(3)),
                (Output::Sense, i16_at(4).invalid(INVALID_I16)),
            ]),
            ..map(Profile::Bits, 1, 5)
        }
    }

    /// Returns the built-in map of a profile.
    pub fn of(profile: Profile) -> Self {
        match profile {
            Profile::Pph1 => Self::pph1(),
            Profile::Word => Self::word(),
            Profile::Bits => Self::bits(),
        }
    }
}
