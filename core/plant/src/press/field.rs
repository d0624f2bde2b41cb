//! Field of a register map: position, type of its words, scale and unit.

use crate::Unit;

/// Type of a field's words.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RegisterType {
    /// One bit of a register.
    Bool,
    /// Unsigned, one register.
    U16,
    /// Two's complement, one register.
    I16,
    /// Unsigned, two registers.
    U32,
    /// Two's complement, two registers.
    I32,
    /// IEEE 754 single precision, two registers.
    F32,
    /// Characters, two per register, high byte first, padded with zeros.
    Ascii {
        /// Registers it takes.
        registers: u16,
    },
}

impl RegisterType {
    /// Returns the number of registers of one value.
    pub fn registers(self) -> u16 {
        match self {
            Self::Bool | Self::U16 | Self::I16 => 1,
            Self::U32 | Self::I32 | Self::F32 => 2,
            Self::Ascii { registers } => registers,
        }
    }

    /// Returns the name in the plant file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bool => "bool",
            Self::U16 => "u16",
            Self::I16 => "i16",
            Self::U32 => "u32",
            Self::I32 => "i32",
            Self::F32 => "f32",
            Self::Ascii { .. } => "ascii",
        }
    }

    /// Returns the smallest and largest raw number; `None` for bits and text.
    pub fn range(self) -> Option<(f64, f64)> {
        match self {
            Self::Bool | Self::Ascii { .. } => None,
            Self::U16 => Some((0.0, f64::from(u16::MAX))),
            Self::I16 => Some((f64::from(i16::MIN), f64::from(i16::MAX))),
            Self::U32 => Some((0.0, f64::from(u32::MAX))),
            Self::I32 => Some((f64::from(i32::MIN), f64::from(i32::MAX))),
            Self::F32 => Some((f64::from(f32::MIN), f64::from(f32::MAX))),
        }
    }
}

/// Order of the four bytes of a 32-bit value on the wire, A the most significant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum WordOrder {
    /// High word first, high byte first: -12.5 is `C148 0000`.
    #[default]
    Abcd,
    /// Low word first: -12.5 is `0000 C148`.
    Cdab,
    /// High word first, bytes swapped: -12.5 is `48C1 0000`.
    Badc,
    /// Low word first, bytes swapped: -12.5 is `0000 48C1`.
    Dcba,
}

impl WordOrder {
    /// All orders.
    pub const ALL: [Self; 4] = [Self::Abcd, Self::Cdab, Self::Badc, Self::Dcba];

    /// Returns the name in the plant file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Abcd => "ABCD",
            Self::Cdab => "CDAB",
            Self::Badc => "BADC",
            Self::Dcba => "DCBA",
        }
    }
}

/// Place of a field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RegisterPlace {
    /// Offset of the first register in its block.
    Register(u16),
    /// Offset of a register in its block and a bit of it, 0 the lowest.
    Bit(u16, u8),
    /// No register: a fixed number, in the field's unit.
    Constant(f64),
}

impl RegisterPlace {
    /// Returns the offset of the first register, `None` for a constant.
    pub fn offset(self) -> Option<u16> {
        match self {
            Self::Register(offset) | Self::Bit(offset, _) => Some(offset),
            Self::Constant(_) => None,
        }
    }
}

/// Field of a register map. Its number is `raw * scale` in `unit`.
#[derive(Debug, Clone, PartialEq)]
pub struct RegisterField {
    /// Place.
    pub place: RegisterPlace,
    /// Type of its words.
    pub kind: RegisterType,
    /// Number of consecutive values; 1 except for lists.
    pub count: u16,
    /// Order of the words of a 32-bit value.
    pub order: WordOrder,
    /// Units per raw step; never 0.
    pub scale: f64,
    /// Unit of the scaled number.
    pub unit: Unit,
    /// Raw bits that mean "no value".
    pub invalid: Option<u32>,
    /// Required raw number.
    pub expect: Option<i64>,
    /// Smallest plausible number, in `unit`; below it the value counts as missing.
    pub min: Option<f64>,
    /// Largest plausible number, in `unit`; above it the value counts as missing.
    pub max: Option<f64>,
    /// Inverted bit: 0 means yes.
    pub active_low: bool,
    /// Number of equal reads before a change of a bit counts.
    pub debounce_reads: u8,
    /// Figure in an output field, if not the field's own.
    pub from: Option<platen_model::Measure>,
}

impl RegisterField {
    /// Makes a field at `offset` of its block: scale 1, no unit, no limits.
    pub fn register(offset: u16, kind: RegisterType) -> Self {
        Self {
            place: RegisterPlace::Register(offset),
            kind,
            count: 1,
            order: WordOrder::Abcd,
            scale: 1.0,
            unit: Unit::ONE,
            invalid: None,
            expect: None,
            min: None,
            max: None,
            active_low: false,
            debounce_reads: 1,
            from: None,
        }
    }

    /// Makes a field of one bit of the register at `offset`.
    pub fn bit(offset: u16, bit: u8) -> Self {
        Self { place: RegisterPlace::Bit(offset, bit), ..Self::register(offset, RegisterType::Bool) }
    }

    /// Returns the field with a scale and a unit.
    pub fn scaled(self, scale: f64, unit: Unit) -> Self {
        Self { scale, unit, ..self }
    }

    /// Returns the field with raw bits that mean "no value".
    pub fn invalid(self, raw: u32) -> Self {
        Self { invalid: Some(raw), ..self }
    }

    /// Returns the number of registers in its block; 0 for a constant.
    pub fn registers(&self) -> u16 {
        match self.place {
            RegisterPlace::Constant(_) => 0,
            _ => self.kind.registers() * self.count,
        }
    }
}
