//! One field of a register map: where it stands, how its words are read, and what its number means.

use crate::Unit;

/// How the words of a field are read.
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
    /// Registers of one value.
    pub fn registers(self) -> u16 {
        match self {
            Self::Bool | Self::U16 | Self::I16 => 1,
            Self::U32 | Self::I32 | Self::F32 => 2,
            Self::Ascii { registers } => registers,
        }
    }

    /// The name in the plant file; the length of a text stands beside it.
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

    /// Smallest and largest raw number; `None` for bits and text.
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
    /// All four.
    pub const ALL: [Self; 4] = [Self::Abcd, Self::Cdab, Self::Badc, Self::Dcba];

    /// The name in the plant file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Abcd => "ABCD",
            Self::Cdab => "CDAB",
            Self::Badc => "BADC",
            Self::Dcba => "DCBA",
        }
    }

    /// The order of this name, if there is one.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|order| order.name() == name)
    }
}

/// Where a field stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RegisterPlace {
    /// From this register of its block on.
    Register(u16),
    /// One bit (0 the lowest) of this register of its block.
    Bit(u16, u8),
    /// In no register: the press always means this number, in the field's unit.
    Constant(f64),
}

impl RegisterPlace {
    /// First register in the block, `None` for a constant.
    pub fn offset(self) -> Option<u16> {
        match self {
            Self::Register(offset) | Self::Bit(offset, _) => Some(offset),
            Self::Constant(_) => None,
        }
    }
}

/// One field of a register map.
///
/// The number a field means is `raw * scale` in `unit`.
#[derive(Debug, Clone, PartialEq)]
pub struct RegisterField {
    /// Where it stands.
    pub place: RegisterPlace,
    /// How its words are read.
    pub kind: RegisterType,
    /// Values one after the other; 1 but for lists.
    pub count: u16,
    /// Order of the words of a 32-bit value.
    pub order: WordOrder,
    /// Units per raw step; never 0.
    pub scale: f64,
    /// Unit of the scaled number.
    pub unit: Unit,
    /// Raw value (the bits, whatever the kind) that means "no value".
    pub invalid: Option<u32>,
    /// The only raw number that is right.
    pub expect: Option<i64>,
    /// Least plausible number, in `unit`; below it the value counts as missing.
    pub min: Option<f64>,
    /// Greatest plausible number, in `unit`; above it the value counts as missing.
    pub max: Option<f64>,
    /// A bit that means yes when it is 0.
    pub active_low: bool,
    /// Equal reads in a row before a bit's change counts.
    pub debounce_reads: u8,
    /// The figure in an output field, when it is not the field's own.
    pub from: Option<platen_model::Measure>,
}

impl RegisterField {
    /// A field of one register or more, at `offset` of its block: scale 1, no unit, no limits.
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

    /// One bit of the register at `offset`.
    pub fn bit(offset: u16, bit: u8) -> Self {
        Self { place: RegisterPlace::Bit(offset, bit), ..Self::register(offset, RegisterType::Bool) }
    }

    /// The same field with a scale and a unit.
    pub fn scaled(self, scale: f64, unit: Unit) -> Self {
        Self { scale, unit, ..self }
    }

    /// The same field with a raw value that means "no value".
    pub fn invalid(self, raw: u32) -> Self {
        Self { invalid: Some(raw), ..self }
    }

    /// Registers it takes in its block; 0 for a constant.
    pub fn registers(&self) -> u16 {
        match self.place {
            RegisterPlace::Constant(_) => 0,
            _ => self.kind.registers() * self.count,
        }
    }
}
