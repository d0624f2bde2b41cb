//! Conflicts between the fields of a map, each reported with both fields.

use std::cell::Cell;
use std::collections::BTreeMap;

use super::map::LocatedMap;
use crate::Place;
use crate::document::{Document, Reported};
use crate::press::names::FieldName;
use crate::press::{
    Block, Input, Output, Profile, RegisterField, RegisterPlace, RegisterTable, RegisterType, WriteAllow,
};

/// Reports every conflict of a map.
pub(super) fn map(document: &Document, located: &LocatedMap, write: &WriteAllow) -> Result<(), Reported> {
    let map = &located.map;
    let faults = Conflicts { document, located, found: Cell::new(None) };
    faults.direction(&map.inputs, &located.inputs, &map.read);
    faults.direction(&map.outputs, &located.outputs, &map.write);
    faults.blocks();
    faults.allowed(write);
    faults.roles();
    faults.found.get().map_or(Ok(()), Err)
}

struct Conflicts<'a> {
    document: &'a Document,
    located: &'a LocatedMap,
    found: Cell<Option<Reported>>,
}

impl Conflicts<'_> {
    /// Reports a fault at `place`, else at `[press.map]`.
    fn add(&self, place: Option<&Place>, message: impl Into<String>) {
        self.found.set(Some(self.document.fault(place.unwrap_or(&self.located.place), message)));
    }

    /// Returns kind and address of a register of a block, in the addressing of the file.
    fn register(&self, block: &Block, offset: u32) -> String {
        let first = self.located.map.address_base.first(block.table);
        format!("{} register {}", block.table.name(), first + u32::from(block.start) + offset)
    }

    /// Reports fields that cross the end of their block or share a register.
    fn direction<N: FieldName>(
        &self,
        fields: &BTreeMap<N, RegisterField>,
        places: &BTreeMap<N, Place>,
        block: &Block,
    ) {
        let mut taken: Vec<Vec<(N, Option<u8>)>> = vec![Vec::new(); usize::from(block.count)];
        for (&name, field) in fields {
            let Some(offset) = field.place.offset() else { continue };
            let end = u32::from(offset) + u32::from(field.registers());
            if end > u32::from(block.count) {
                let (needs, last) =
                    (self.register(block, end - 1), self.register(block, u32::from(block.count) - 1));
                self.add(
                    places.get(&name),
                    format!("`{}` needs {needs}, but its block ends with {last}", name.name()),
                );
                continue;
            }
            let bit = if let RegisterPlace::Bit(_, bit) = field.place { Some(bit) } else { None };
            let mut clash = None;
            let registers = taken.iter_mut().enumerate().take(end as usize).skip(usize::from(offset));
            for (register, holders) in registers {
                let other =
                    holders.iter().find(|(_, other)| bit.is_none() || other.is_none() || bit == *other);
                clash = clash.or(other.map(|&(other, other_bit)| (register, other, other_bit)));
                holders.push((name, bit));
            }
            if let Some((register, other, other_bit)) = clash {
                self.clash((name, bit), (other, other_bit), self.register(block, register as u32), places);
            }
        }
    }

    /// Reports a shared register, at the later of the fields that the file gives.
    fn clash<N: FieldName>(
        &self,
        one: (N, Option<u8>),
        other: (N, Option<u8>),
        register: String,
        places: &BTreeMap<N, Place>,
    ) {
        let at = |(name, _): (N, Option<u8>)| places.get(&name);
        let later = at(other).map(|place| place.offset) > at(one).map(|place| place.offset);
        let (reported, first) = if later { (other, one) } else { (one, other) };
        let bit = reported.1.and(first.1).map(|bit| format!(" bit {bit}")).unwrap_or_default();
        let by = match at(first) {
            Some(place) => self.document.locate(place),
            None => "built-in".to_owned(),
        };
        self.add(at(reported), format!("{register}{bit} is `{}` already ({by}); move one", first.0.name()));
    }

    /// Reports an overlap of the blocks: the host must not write registers of the press.
    fn blocks(&self) {
        let (read, write) = (self.located.map.read, self.located.map.write);
        let (ours, theirs) = (write.addresses(), read.addresses());
        let start = ours.start.max(theirs.start);
        if read.table == RegisterTable::Holding && start < ours.end.min(theirs.end) {
            let register = self.register(&read, start - theirs.start);
            self.add(
                Some(&self.located.write_place),
                format!("{register} lies in the block that the press writes; the host must not write there"),
            );
        }
    }

    /// Reports outputs outside the allow-list.
    fn allowed(&self, write: &WriteAllow) {
        let block = self.located.map.write;
        for (name, field) in &self.located.map.outputs {
            let Some(offset) = field.place.offset() else { continue };
            let inside = field.registers() > 0
                && u32::from(offset) + u32::from(field.registers()) <= u32::from(block.count);
            if inside && write.check(block.start + offset, field.registers()).is_err() {
                let register = self.register(&block, u32::from(offset));
                let place = self.located.outputs.get(name).or(Some(&self.located.write_place));
                self.add(place, format!("`{name}` at {register} is not in press.write.allow ({write})"));
            }
        }
    }

    /// Reports missing or unusable fields of the handshake.
    fn roles(&self) {
        let located = self.located;
        let map = &located.map;
        let numbered = map.profile == Profile::Pph1;
        let inputs = &[Input::Trigger, Input::StrokeId][..if numbered { 2 } else { 1 }];
        let outputs =
            [Output::StatusBusy, Output::StatusResultValid, Output::AckStrokeId, Output::ResultStrokeId];
        let outputs = &outputs[..if numbered { 4 } else { 2 }];
        let missing_in = inputs.iter().filter(|name| !map.inputs.contains_key(name));
        let missing_out = outputs.iter().filter(|name| !map.outputs.contains_key(name));
        let missing = missing_in
            .map(|name| (name.name(), located.inputs.get(name)))
            .chain(missing_out.map(|name| (name.name(), located.outputs.get(name))));
        for (name, place) in missing {
            self.add(place, format!("the profile {} requires `{name}`", map.profile.name()));
        }
        let trigger = map.inputs.get(&Input::Trigger);
        if trigger.is_some_and(|field| matches!(field.place, RegisterPlace::Constant(_))) {
            self.add(located.inputs.get(&Input::Trigger), "a constant trigger starts no stroke");
        }
        for (name, field) in &map.outputs {
            let too_wide = *name == Output::ResultSeq && field.kind.registers() > 1;
            let text = matches!(field.kind, RegisterType::Ascii { .. });
            if too_wide || text {
                self.add(located.outputs.get(name), format!("`{name}` must be a number in one register"));
            }
        }
    }
}
