//! Reader of the fields of `[press.map.in]` and `[press.map.out]`.

use std::collections::BTreeMap;
use std::time::Duration;

use platen_model::Measure;

use crate::document::Reported;
use crate::node::NodeKind;
use crate::press::names::{FieldName, dimension_of};
use crate::press::{
    AddressBase, Block, Counter, Input, Output, RegisterField, RegisterPlace, RegisterType, WordOrder,
};
use crate::{Dimension, Place, TomlTable, Unit};

/// Fields of one direction, with the places of those that the file gives.
pub(super) struct Given<N> {
    pub(super) fields: BTreeMap<N, RegisterField>,
    pub(super) places: BTreeMap<N, Place>,
}

/// Reader of fields: their common properties, and properties of the press that are given with fields.
pub(super) struct FieldReader {
    pub(super) order: WordOrder,
    /// Block of the fields and base of its addresses; `None` where they are faulty.
    pub(super) block: Option<(Block, AddressBase)>,
    pub(super) counter: Counter,
    pub(super) heartbeat_in: Option<Duration>,
}

impl FieldReader {
    /// Reads the fields of a direction: those of the profile with the changes of the file.
    pub(super) fn fields<N: FieldName>(
        &mut self,
        mut table: TomlTable<'_>,
        built_in: BTreeMap<N, RegisterField>,
    ) -> Result<Given<N>, Reported> {
        let mut given = Given { fields: built_in, places: BTreeMap::new() };
        for field in given.fields.values_mut() {
            field.order = self.order;
        }
        let mut failed = None;
        for &name in N::ALL {
            match self.one(&mut table, name, given.fields.get(&name)) {
                Ok(None) => {}
                Ok(Some((field, place))) => {
                    given.places.insert(name, place);
                    match field {
                        Some(field) => given.fields.insert(name, field),
                        None => given.fields.remove(&name),
                    };
                }
                Err(reported) => failed = Some(reported),
            }
        }
        table.finish();
        failed.map_or(Ok(given), Err)
    }

    /// Reads one field: `None` if the file does not give it, `Some(None)` if it is `"none"`.
    fn one<N: FieldName>(
        &mut self,
        table: &mut TomlTable<'_>,
        name: N,
        built_in: Option<&RegisterField>,
    ) -> Result<Option<(Option<RegisterField>, Place)>, Reported> {
        if !table.has(name.name()) {
            // The key is read, so that it counts as known.
            return table.node(name.name()).optional().map(|_| None);
        }
        let node = table.node(name.name()).located().required()?;
        if let NodeKind::String(text) = &node.value.kind {
            if text == "none" {
                return Ok(Some((None, node.place)));
            }
            let message =
                format!("found {text:?}, expected a table like {{ at = 4, type = \"u16\" }} or \"none\"");
            return Err(table.document().fault(&node.place, message));
        }
        let place = node.place;
        let field = self.table(table.table(name.name()).required()?, name, built_in, &place)?;
        Ok(Some((Some(field), place)))
    }

    fn table<N: FieldName>(
        &mut self,
        mut table: TomlTable<'_>,
        name: N,
        built_in: Option<&RegisterField>,
        place: &Place,
    ) -> Result<RegisterField, Reported> {
        let document = table.document();
        let dimension = name.dimension();
        let switch = dimension == Dimension::Switch;
        let default = built_in.cloned().unwrap_or_else(|| RegisterField {
            order: self.order,
            ..RegisterField::register(0, if switch { RegisterType::Bool } else { RegisterType::U16 })
        });
        let at = self.place(&mut table, name, built_in.map(|field| field.place));
        let kind = read_kind(&mut table, dimension, default.kind);
        let orders = WordOrder::ALL.map(|order| (order.name(), order));
        let order = table.choice("order", &orders).or(self.order);
        let kind = kind.and_then(|kind| {
            kind.ok_or_else(|| document.fault(place, "a text needs its length in registers"))
        });
        let same = kind.is_ok_and(|kind| kind == default.kind);
        let scale = table.number("scale").check(|scale| match *scale == 0.0 {
            true => Err("found 0, must not be 0".to_owned()),
            false => Ok(()),
        });
        let scale = scale.or(if same { default.scale } else { 1.0 });
        let unit = read_unit(&mut table, dimension, default.unit);
        let invalid = read_invalid(&mut table).map(|given| given.or(default.invalid.filter(|_| same)));
        let (min, max) = (table.number("min").optional(), table.number("max").optional());
        let actives = [("high", false), ("low", true)];
        let active_low =
            if switch { table.choice("active", &actives).or(default.active_low) } else { Ok(false) };
        let own = if N::INPUT {
            self.input_keys(&mut table, name.name(), &default)
        } else {
            output_keys(&mut table, name.name(), dimension, &default)
        };
        table.finish();
        let field = RegisterField {
            place: at?,
            kind: kind?,
            order: order?,
            scale: scale?,
            unit: unit?,
            invalid: invalid?,
            min: min?,
            max: max?,
            active_low: active_low?,
            ..own?
        };
        check_field(&field, dimension).map_err(|message| document.fault(place, message))?;
        Ok(field)
    }

    /// Reads `at = 3`, `at = "2.1"`, `at = "@1234"`, `at = "@1234.5"`, or `const = 1`.
    fn place<N: FieldName>(
        &self,
        table: &mut TomlTable<'_>,
        name: N,
        built_in: Option<RegisterPlace>,
    ) -> Result<RegisterPlace, Reported> {
        let constant = if N::INPUT { table.number("const").optional() } else { Ok(None) };
        let at = table.node("at").try_map(|node| match &node.kind {
            NodeKind::Integer(offset) => self.offset(*offset).map(RegisterPlace::Register),
            NodeKind::String(text) => self.parse_place(text),
            _ => Err(format!("found {}, expected 3, \"2.1\", \"@1234\" or \"@1234.5\"", node.describe())),
        });
        let at = at.try_map(|at| match (name.dimension(), at) {
            (Dimension::Switch, _) | (_, RegisterPlace::Register(_) | RegisterPlace::Constant(_)) => Ok(at),
            (_, RegisterPlace::Bit(..)) => {
                Err("a bit holds a switch only; this field needs a register".to_owned())
            }
        });
        if let Some(number) = constant? {
            return Ok(RegisterPlace::Constant(number));
        }
        match built_in {
            Some(place) => at.or(place),
            None => at.required(),
        }
    }

    fn parse_place(&self, text: &str) -> Result<RegisterPlace, String> {
        let wrong = || format!("found {text:?}, expected 3, \"2.1\", \"@1234\" or \"@1234.5\"");
        let (absolute, rest) = text.strip_prefix('@').map_or((false, text), |rest| (true, rest));
        let (register, bit) =
            rest.split_once('.').map_or((rest, None), |(register, bit)| (register, Some(bit)));
        let register: i64 = register.trim().parse().map_err(|_| wrong())?;
        let register = if absolute { self.offset_of(register)? } else { self.offset(register)? };
        match bit.map(str::parse::<u8>) {
            None => Ok(RegisterPlace::Register(register)),
            Some(Ok(bit @ 0..=15)) => Ok(RegisterPlace::Bit(register, bit)),
            Some(Ok(bit)) => Err(format!("found bit {bit}, a register has bits 0 to 15")),
            Some(Err(_)) => Err(wrong()),
        }
    }

    fn offset(&self, offset: i64) -> Result<u16, String> {
        let Some((block, _)) = self.block else { return Ok(0) };
        let last = block.count - 1;
        let inside = u16::try_from(offset).ok().filter(|&offset| offset <= last);
        inside.ok_or_else(|| format!("found register {offset} of its block, which has 0 to {last}"))
    }

    fn offset_of(&self, address: i64) -> Result<u16, String> {
        let Some((block, base)) = self.block else { return Ok(0) };
        let first = i64::from(base.first(block.table)) + i64::from(block.start);
        let last = first + i64::from(block.count) - 1;
        let inside = (first..=last).contains(&address);
        if inside {
            Ok((address - first) as u16)
        } else {
            Err(format!("found @{address}, its block is @{first} to @{last}"))
        }
    }

    /// Reads the keys that only fields of the press have; some are properties of the press as a whole.
    fn input_keys(
        &mut self,
        table: &mut TomlTable<'_>,
        name: &str,
        default: &RegisterField,
    ) -> Result<RegisterField, Reported> {
        let expect = table.integer("expect").optional();
        let debounce = if name == Input::Trigger.name() {
            table
                .integer("debounce_reads")
                .in_range(1..=100)
                .map(|reads| reads as u8)
                .or(default.debounce_reads)
        } else {
            Ok(default.debounce_reads)
        };
        if name == Input::StrokeId.name() {
            let wrap = table.integer("wrap").in_range(2..=65_535).map(|wrap| wrap as u16).or(u16::MAX);
            let zero = table.choice("zero", &[("none", 1), ("stroke", 0)]).or(1);
            self.counter = Counter { wrap: wrap?, first: zero? };
        }
        if name == Input::Heartbeat.name() {
            self.heartbeat_in = super::ms(table, "timeout_ms", 100)?;
        }
        let (expect, debounce_reads) = (expect?.or(default.expect), debounce?);
        Ok(RegisterField { expect, debounce_reads, ..default.clone() })
    }
}

/// Reads the keys that only fields of the host have.
fn output_keys(
    table: &mut TomlTable<'_>,
    name: &str,
    dimension: Dimension,
    default: &RegisterField,
) -> Result<RegisterField, Reported> {
    let count = if name == Output::Station.name() {
        table.integer("count").in_range(1..=100).map(|count| count as u16).or(default.count)
    } else {
        Ok(default.count)
    };
    let measured = Output::from_name(name).is_some_and(|output| output.measure().is_some());
    let from = if measured {
        let sources: Vec<_> = Measure::ALL.iter().map(|measure| (measure.name(), *measure)).collect();
        let from =
            table.choice("from", &sources).check(|measure| match dimension_of(*measure) == Some(dimension) {
                true => Ok(()),
                false => Err(format!("{} is of another kind than this field", measure.name())),
            });
        from.optional()
    } else {
        Ok(None)
    };
    Ok(RegisterField { count: count?, from: from?.or(default.from), ..default.clone() })
}

/// Reads the type; `None` for a text without a length.
fn read_kind(
    table: &mut TomlTable<'_>,
    dimension: Dimension,
    default: RegisterType,
) -> Result<Option<RegisterType>, Reported> {
    if dimension == Dimension::Text {
        let kind = table.choice("type", &[("ascii", ())]).optional();
        let registers = table.integer("length").in_range(1..=60).map(|registers| registers as u16).optional();
        kind?;
        let kept = if let RegisterType::Ascii { registers } = default { Some(registers) } else { None };
        return Ok(registers?.or(kept).map(|registers| RegisterType::Ascii { registers }));
    }
    let numbers =
        [RegisterType::U16, RegisterType::I16, RegisterType::U32, RegisterType::I32, RegisterType::F32]
            .map(|kind| (kind.name(), kind));
    let bits =
        [(RegisterType::Bool.name(), RegisterType::Bool), (RegisterType::U16.name(), RegisterType::U16)];
    let kinds = if dimension == Dimension::Switch { &bits[..] } else { &numbers[..] };
    table.choice("type", kinds).or(default).map(Some)
}

fn read_unit(table: &mut TomlTable<'_>, dimension: Dimension, default: Unit) -> Result<Unit, Reported> {
    if matches!(dimension, Dimension::Switch | Dimension::Text) {
        return Ok(Unit::ONE);
    }
    table.choice("unit", &Unit::fitting(dimension)).or(default)
}

/// Reads `invalid = "0x8000"` or `invalid = 32768`.
fn read_invalid(table: &mut TomlTable<'_>) -> Result<Option<u32>, Reported> {
    let field = table.node("invalid").try_map(|node| {
        let value = match &node.kind {
            NodeKind::Integer(value) => u32::try_from(*value).ok(),
            NodeKind::String(text) => {
                text.strip_prefix("0x").and_then(|hex| u32::from_str_radix(hex, 16).ok())
            }
            _ => None,
        };
        value.ok_or_else(|| format!("found {}, expected the raw bits like \"0x8000\"", node.describe()))
    });
    field.optional()
}

/// Checks the keys of one field against each other.
fn check_field(field: &RegisterField, dimension: Dimension) -> Result<(), String> {
    if !field.unit.fits(dimension) {
        let units: Vec<_> = Unit::fitting(dimension).into_iter().map(|(symbol, _)| symbol).collect();
        return Err(format!("needs its unit; allowed {}", units.join(", ")));
    }
    let Some((low, high)) = field.kind.range() else { return Ok(()) };
    if let (Some(min), Some(max)) = (field.min, field.max)
        && min > max
    {
        return Err(format!("min {min} is above max {max}"));
    }
    for (key, limit) in [("min", field.min), ("max", field.max)] {
        let raw = limit.map(|limit| limit / field.scale);
        if let Some(raw) = raw.filter(|raw| !(low..=high).contains(raw)) {
            let kind = field.kind.name();
            return Err(format!("{key} is {raw:.0} raw, which a {kind} ({low:.0} to {high:.0}) cannot hold"));
        }
    }
    if let Some(invalid) = field.invalid.filter(|&invalid| field.kind.registers() == 1 && invalid > 0xFFFF) {
        return Err(format!("invalid is {invalid:#x}, which one register cannot hold"));
    }
    Ok(())
}
