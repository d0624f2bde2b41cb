//! Register map: two blocks of registers and their fields.

use std::collections::BTreeMap;

use super::{Input, Output, RegisterField};

/// Modbus kind of a block's registers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum RegisterTable {
    /// Holding registers: read by function 3, written by function 16.
    #[default]
    Holding,
    /// Input registers: read by function 4, never written.
    Input,
}

impl RegisterTable {
    /// Returns the name in the plant file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Holding => "holding",
            Self::Input => "input",
        }
    }
}

/// Consecutive registers of one transaction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Block {
    /// Kind of the registers.
    pub table: RegisterTable,
    /// Address of the first, zero-based, as on the wire.
    pub start: u16,
    /// Number of registers.
    pub count: u16,
}

impl Block {
    /// Returns the addresses of the block; `u32` because the end may lie behind the last address.
    pub fn addresses(&self) -> std::ops::Range<u32> {
        u32::from(self.start)..u32::from(self.start) + u32::from(self.count)
    }
}

/// Base of addresses in the plant file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum AddressBase {
    /// As on the wire, from 0.
    #[default]
    Zero,
    /// As in many manuals, from 1.
    One,
    /// Modicon notation with five digits: 40001 is the first holding register, 30001 the first input register.
    FiveDigits,
    /// Modicon notation with six digits: 400001 and 300001.
    SixDigits,
}

impl AddressBase {
    /// Returns the number of the first register of `table`.
    pub fn first(self, table: RegisterTable) -> u32 {
        match (self, table) {
            (Self::Zero, _) => 0,
            (Self::One, _) => 1,
            (Self::FiveDigits, RegisterTable::Holding) => 40_001,
            (Self::FiveDigits, RegisterTable::Input) => 30_001,
            (Self::SixDigits, RegisterTable::Holding) => 400_001,
            (Self::SixDigits, RegisterTable::Input) => 300_001,
        }
    }
}

/// Extent of the handshake.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Profile {
    /// Stroke numbers, sessions and both heartbeats: the built-in map of version 1.
    #[default]
    Pph1,
    /// One command word (1 go) and one status word (2 running, 4 done, 8 error); no stroke numbers.
    Word,
    /// Bits for trigger, busy, valid and acknowledge; no stroke numbers.
    Bits,
}

impl Profile {
    /// Returns the name in the plant file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pph1 => "pph-1",
            Self::Word => "word",
            Self::Bits => "bits",
        }
    }
}

/// Stroke counter of the press.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Counter {
    /// Largest number; the next one is `first`.
    pub wrap: u16,
    /// The number after `wrap`: 1 where 0 means "no stroke", else 0.
    pub first: u16,
}

impl Counter {
    /// Returns the number of strokes from one number to another: 1 for neighbours, 0 for the same.
    pub fn distance(&self, from: u16, to: u16) -> u32 {
        let period = u32::from(self.wrap) - u32::from(self.first) + 1;
        (u32::from(to) + period - u32::from(from) % period) % period
    }
}

impl Default for Counter {
    fn default() -> Self {
        Self { wrap: u16::MAX, first: 1 }
    }
}

/// Register map of a press.
#[derive(Debug, Clone, PartialEq)]
pub struct RegisterMap {
    /// Extent of the handshake.
    pub profile: Profile,
    /// Base of addresses in the plant file and on the map's page.
    pub address_base: AddressBase,
    /// Registers that the host reads.
    pub read: Block,
    /// Registers that the host writes.
    pub write: Block,
    /// Fields from the press to the host; others do not exist on this press.
    pub inputs: BTreeMap<Input, RegisterField>,
    /// Fields from the host to the press.
    pub outputs: BTreeMap<Output, RegisterField>,
    /// Stroke counter of the press.
    pub counter: Counter,
}

impl RegisterMap {
    /// Returns the field of an input, if the press has it.
    pub fn input(&self, input: Input) -> Option<&RegisterField> {
        self.inputs.get(&input)
    }

    /// Returns the field of an output, if the press has it.
    pub fn output(&self, output: Output) -> Option<&RegisterField> {
        self.outputs.get(&output)
    }

    /// Returns whether the press numbers its strokes. Without numbers a stroke is a rising trigger, the host counts,
    /// and a missed stroke cannot be detected.
    pub fn counts_strokes(&self) -> bool {
        self.inputs.contains_key(&Input::StrokeId)
    }

    /// Returns the number of registers from the start of the read block that every poll requires: the handshake without
    /// the press's data. On a serial line only these are read until the trigger.
    pub fn fast_count(&self) -> u16 {
        const FAST: [Input; 14] = [
            Input::MapVersion,
            Input::Heartbeat,
            Input::Enable,
            Input::Trigger,
            Input::Ack,
            Input::Abort,
            Input::ErrorReset,
            Input::ClearToScan,
            Input::PartEnd,
            Input::Rescan,
            Input::Baseline,
            Input::StrokeId,
            Input::SessionId,
            Input::PressId,
        ];
        let end = |input: &Input| {
            let field = self.inputs.get(input)?;
            Some(field.place.offset()? + field.registers())
        };
        FAST.iter().filter_map(end).max().unwrap_or(self.read.count).min(self.read.count)
    }
}
