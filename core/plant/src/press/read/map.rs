//! Reader of `[press.map]`: the built-in map of the profile with the changes of the file.

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

/// Register map with the places of its parts in the file.
#[derive(Debug)]
pub(super) struct LocatedMap {
    pub(super) map: RegisterMap,
    /// Places of the fields that the file gives; the others are the profile's.
    pub(super) inputs: BTreeMap<Input, Place>,
    pub(super) outputs: BTreeMap<Output, Place>,
    /// Places of `[press.map]`, for missing fields, and of its `write`, for conflicts of the block.
    pub(super) place: Place,
    pub(super) write_place: Place,
    pub(super) heartbeat_in: Option<Duration>,
}

/// Parses the holding registers of `"100..=163"` or `"100"`.
pub(super) fn parse_range(text: &str, base: AddressBase) -> Result<RangeInclusive<u16>, String> {
    let first = base.first(RegisterTable::Holding);
    let address = |text: &str| u16::try_from(text.trim().parse::<u32>().ok()?.checked_sub(first)?).ok();
    let (start, end) = text.split_once("..=").unwrap_or((text, text));
    let range = address(start).zip(address(end)).filter(|(start, end)| start <= end);
    let (start, end) = range.ok_or_else(|| {
        format!("found {text:?}, expected registers like \"{}..={}\"", first + 100, first + 163)
    })?;
    Ok(start..=end)
}

pub(super) fn read_base(table: &mut TomlTable<'_>) -> Result<AddressBase, Reported> {
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
    address_base.or(AddressBase::default())
}

/// Reads the rest of `[press.map]`. Where the base or a block is faulty, addresses are not checked.
pub(super) fn read_map(
    mut table: TomlTable<'_>,
    profile: Profile,
    base: Result<AddressBase, Reported>,
) -> Result<LocatedMap, Reported> {
    let place = table.place().clone();
    let built_in = RegisterMap::of(profile);
    let orders = WordOrder::ALL.map(|order| (order.name(), order));
    let order = table.choice("word_order", &orders).or(WordOrder::default());
    let read = table.section("read").and_then(|block| read_block(block, built_in.read, base, MOST_READ));
    let has_write = table.has("write");
    let write = table.section("write").and_then(|block| {
        let document = block.document();
        let block_place = if has_write { block.place().clone() } else { place.clone() };
        let write = read_block(block, built_in.write, base, MOST_WRITTEN)?;
        match write.table {
            RegisterTable::Holding => Ok((write, block_place)),
            RegisterTable::Input => {
                Err(document.fault(&block_place, "input registers cannot be written; use holding"))
            }
        }
    });
    let block = |block: Result<Block, Reported>| block.ok().zip(base.ok());
    let mut reader = FieldReader {
        order: order.unwrap_or_default(),
        block: block(read),
        counter: Counter::default(),
        heartbeat_in: None,
    };
    let inputs = table.section("in").and_then(|fields| reader.fields(fields, built_in.inputs));
    let (counter, heartbeat_in) = (reader.counter, reader.heartbeat_in);
    reader.block = block(write.as_ref().map(|(block, _)| *block).map_err(|reported| *reported));
    let outputs = table.section("out").and_then(|fields| reader.fields(fields, built_in.outputs));
    table.finish();
    let (address_base, read, (write, write_place)) = (base?, read?, write?);
    order?;
    let (Given { fields: inputs, places: input_places }, Given { fields: outputs, places: output_places }) =
        (inputs?, outputs?);
    let map = RegisterMap { profile, address_base, read, write, inputs, outputs, counter };
    Ok(LocatedMap { map, inputs: input_places, outputs: output_places, place, write_place, heartbeat_in })
}

fn read_block(
    mut table: TomlTable<'_>,
    built_in: Block,
    base: Result<AddressBase, Reported>,
    most: i64,
) -> Result<Block, Reported> {
    let document = table.document();
    let tables = [("holding", RegisterTable::Holding), ("input", RegisterTable::Input)];
    let kind = table.choice("table", &tables).or(built_in.table);
    let start = table.integer("start").located().optional();
    let count = table.integer("count").in_range(1..=most).map(|count| count as u16).or(built_in.count);
    table.finish();
    let (kind, count, start, base) = (kind?, count?, start?, base?);
    let start = match start {
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
