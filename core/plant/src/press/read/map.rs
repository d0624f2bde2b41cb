//! Reads `[press.map]`: the built-in map of the profile, with what the file says otherwise.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::time::Duration;

use super::field::{FieldReader, Given};
use crate::document::Reported;
use crate::press::{
    AddressBase, Block, Counter, Input, Output, Profile, RegisterMap, RegisterTable, WordOrder,
};
use crate::{Place, TomlTable};

/// Most registers in one read and in one write (Modbus Application Protocol V1.1b3, 6.3 and 6.12).
const MOST_READ: i64 = 125;
const MOST_WRITTEN: i64 = 123;

/// A register map and where the file says what of it.
#[derive(Debug)]
pub(super) struct LocatedMap {
    pub(super) map: RegisterMap,
    /// Where the file speaks of a field; the others are the profile's.
    pub(super) inputs: BTreeMap<Input, Place>,
    pub(super) outputs: BTreeMap<Output, Place>,
    /// Where `[press.map]` stands, for what is missing, and its `write`, for what does not fit.
    pub(super) place: Place,
    pub(super) write_place: Place,
    pub(super) heartbeat_in: Option<Duration>,
}

impl LocatedMap {
    /// The registers of `"100..=163"` or `"100"`, counted as the map counts holding registers.
    pub(super) fn range(&self, text: &str) -> Result<RangeInclusive<u16>, String> {
        let first = self.map.address_base.first(RegisterTable::Holding);
        let address = |text: &str| {
            let number = text.trim().parse::<u32>().ok().and_then(|number| number.checked_sub(first));
            number.and_then(|address| u16::try_from(address).ok())
        };
        let range = match text.split_once("..=") {
            Some((start, end)) => address(start).zip(address(end)),
            None => address(text).map(|only| (only, only)),
        };
        let (start, end) = range.filter(|(start, end)| start <= end).ok_or_else(|| {
            format!("found {text:?}, expected registers like \"{}..={}\"", first + 100, first + 163)
        })?;
        Ok(start..=end)
    }
}

pub(super) fn read_map(mut table: TomlTable<'_>, profile: Profile) -> Result<LocatedMap, Reported> {
    let place = table.place().clone();
    let built_in = RegisterMap::of(profile);
    let bases = [
        (0, AddressBase::Zero),
        (1, AddressBase::One),
        (40_001, AddressBase::FiveDigits),
        (400_001, AddressBase::SixDigits),
    ];
    let address_base = table.integer("address_base").try_map(|found| {
        let base = bases.iter().find(|(number, _)| *number == found).map(|(_, base)| *base);
        base.ok_or_else(|| format!("found {found}, allowed 0, 1, 40001, 400001"))
    });
    let address_base = address_base.or(AddressBase::default())?;
    let orders = WordOrder::ALL.map(|order| (order.name(), order));
    let order = table.choice("word_order", &orders).or(WordOrder::default());
    let read =
        table.section("read").and_then(|block| read_block(block, built_in.read, address_base, MOST_READ));
    let write_place =
        if table.has("write") { table.table("write").located().required()?.place } else { place.clone() };
    let write = table.section("write").and_then(|block| {
        let document = block.document();
        let write = read_block(block, built_in.write, address_base, MOST_WRITTEN)?;
        match write.table {
            RegisterTable::Holding => Ok(write),
            RegisterTable::Input => {
                Err(document.fault(&write_place, "input registers cannot be written; use holding"))
            }
        }
    });

    let (read, write) = match (read, write) {
        (Ok(read), Ok(write)) => (read, write),
        (Err(reported), _) | (_, Err(reported)) => {
            let _ = (table.table("in").optional(), table.table("out").optional());
            table.finish();
            return Err(reported);
        }
    };
    let mut reader = FieldReader {
        order: order?,
        address_base,
        block: read,
        counter: Counter::default(),
        heartbeat_in: None,
    };
    let inputs = table.section("in").and_then(|fields| reader.fields(fields, built_in.inputs, Input::ALL));
    let (counter, heartbeat_in) = (reader.counter, reader.heartbeat_in);
    reader.block = write;
    let outputs =
        table.section("out").and_then(|fields| reader.fields(fields, built_in.outputs, Output::ALL));
    table.finish();
    let (Given { fields: inputs, places: input_places }, Given { fields: outputs, places: output_places }) =
        (inputs?, outputs?);
    let map = RegisterMap { profile, address_base, read, write, inputs, outputs, counter };
    Ok(LocatedMap { map, inputs: input_places, outputs: output_places, place, write_place, heartbeat_in })
}

fn read_block(
    mut table: TomlTable<'_>,
    built_in: Block,
    base: AddressBase,
    most: i64,
) -> Result<Block, Reported> {
    let document = table.document();
    let tables = [("holding", RegisterTable::Holding), ("input", RegisterTable::Input)];
    let kind = table.choice("table", &tables).or(built_in.table);
    let start = table.integer("start").located().optional();
    let count = table.integer("count").in_range(1..=most).map(|count| count as u16).or(built_in.count);
    table.finish();
    let (kind, count) = (kind?, count?);
    let start = match start? {
        None => built_in.start,
        Some(start) => {
            let first = i64::from(base.first(kind));
            let last = first + 65_536 - i64::from(count);
            if !(first..=last).contains(&start.value) {
                let message = format!("found {}, allowed {first} to {last}", start.value);
                return Err(document.fault(&start.place, message));
            }
            (start.value - first) as u16
        }
    };
    Ok(Block { table: kind, start, count })
}
