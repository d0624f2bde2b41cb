//! Conflicts between the fields of a map, each reported with both fields.

use std::collections::BTreeMap;

use super::field::Name;
use super::map::LocatedMap;
use crate::Place;
use crate::document::{Document, Reported};
use crate::press::{
    Block, Input, Output, Profile, RegisterField, RegisterPlace, RegisterTable, RegisterType, WriteAllow,
};

/// Reports every conflict of a map.
pub(super) fn map(document: &Document, located: &LocatedMap, write: &WriteAllow) -> Result<(), Reported> {
    let map = &located.map;
    let mut faults = Faults { document, located, found: None };
    faults.direction(&map.inputs, &located.inputs, &map.read);
    faults.direction(&map.outputs, &located.outputs, &map.write);
    faults.blocks();
    faults.allowed(write);
    faults.roles();
    faults.found.map_or(Ok(()), Err)
}

struct Faults<'a> {
    document: &'a Document,
    located: &'a LocatedMap,
    found: Option<Reported>,
}

impl Faults<'_> {
    fn add(&mut self, place: &Place, message: String) {
        self.found = Some(self.document.fault(place, message));
    }

    /// Returns kind and address of a register of a block, as the file counts.
    fn register(&self, block: &Block, offset: u32) -> String {
        let first = self.located.map.address_base.first(block.table);
        format!("{} register {}", block.table.name(), first + u32::from(block.start) + offset)
    }

    /// Reports fields that cross the end of their block or share a register.
    fn direction<N: Name>(
        &mut self,
        fields: &BTreeMap<N, RegisterField>,
        places: &BTreeMap<N, Place>,
        block: &Block,
    ) {
        let mut taken: Vec<Vec<(N, Option<u8>)>> = vec![Vec::new(); usize::from(block.count)];
        for (&name, field) in fields {
            let Some(offset) = field.place.offset() else { continue };
            let end = u32::from(offset) + u32::from(field.registers());
            if end > u32::from(block.count) {
                let place = places.get(&name).unwrap_or(&self.located.place).clone();
                let (needs, last) =
                    (self.register(block, end - 1), self.register(block, u32::from(block.count) - 1));
                self.add(&place, format!("`{}` needs {needs}, but its block ends with {last}", name.name()));
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
    fn clash<N: Name>(
        &mut self,
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
        let place = at(reported).unwrap_or(&self.located.place).clone();
        self.add(&place, format!("{register}{bit} is `{}` already ({by}); move one", first.0.name()));
    }

    /// Reports an overlap of the blocks: the host must not write registers of the press.
    fn blocks(&mut self) {
        let (read, write) = (self.located.map.read, self.located.map.write);
        let (ours, theirs) = (write.addresses(), read.addresses());
        let start = ours.start.max(theirs.start);
        if read.table == RegisterTable::Holding && start < ours.end.min(theirs.end) {
            let register = self.register(&read, start - theirs.start);
            let place = self.located.write_place.clone();
            self.add(
                &place,
                format!("{register} lies in the block that the press writes; the host must not write there"),
            );
        }
    }

    /// Reports outputs outside the allow-list.
    fn allowed(&mut self, write: &WriteAllow) {
        let block = self.located.map.write;
        for (name, field) in &self.located.map.outputs {
            let Some(offset) = field.place.offset() else { continue };
            let inside = field.registers() > 0
                && u32::from(offset) + u32::from(field.registers()) <= u32::from(block.count);
            if inside && write.check(block.start + offset, field.registers()).is_err() {
                let register = self.register(&block, u32::from(offset));
                let place = self.located.outputs.get(name).unwrap_or(&self.located.write_place).clone();
                self.add(&place, format!("`{name}` at {register} is not in press.write.allow ({write})"));
            }
        }
    }

    /// Reports missing or unusable fields of the handshake.
    fn roles(&mut self) {
        let map = &self.located.map;
        let needs_ids = map.profile == Profile::Pph1;
        let inputs: &[Input] = if needs_ids { &[Input::Trigger, Input::StrokeId] } else { &[Input::Trigger] };
        let outputs: &[Output] = if needs_ids {
            &[Output::StatusBusy, Output::StatusResultValid, Output::AckStrokeId, Output::ResultStrokeId]
        } else {
            &[Output::StatusBusy, Output::StatusResultValid]
        };
        let profile = map.profile.name();
        let missing_in = inputs
            .iter()
            .filter(|name| !map.inputs.contains_key(name))
            .map(|&name| (name.name(), self.located.inputs.get(&name)));
        let missing_out = outputs
            .iter()
            .filter(|name| !map.outputs.contains_key(name))
            .map(|&name| (name.name(), self.located.outputs.get(&name)));
        let missing: Vec<_> = missing_in
            .chain(missing_out)
            .map(|(name, place)| (name, place.unwrap_or(&self.located.place).clone()))
            .collect();
        for (name, place) in missing {
            self.add(&place, format!("the profile {profile} cannot do without `{name}`"));
        }
        let constant = map
            .inputs
            .get(&Input::Trigger)
            .is_some_and(|field| matches!(field.place, RegisterPlace::Constant(_)));
        if constant {
            let place = self.located.inputs.get(&Input::Trigger).unwrap_or(&self.located.place).clone();
            self.add(&place, "a trigger that never changes triggers nothing".to_owned());
        }
        for (name, field) in &map.outputs {
            let too_wide = *name == Output::ResultSeq && field.kind.registers() > 1;
            let text = matches!(field.kind, RegisterType::Ascii { .. });
            if too_wide || text {
                let place = self.located.outputs.get(name).unwrap_or(&self.located.place).clone();
                self.add(&place, format!("`{name}` must be a number in one register"));
            }
        }
    }
}
