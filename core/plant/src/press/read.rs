//! Reader of `[press]`: every key is checked on its own here, their conflicts in [`check`].

mod check;
mod field;
mod link;
mod map;

use std::time::Duration;

use super::{
    AddressBase, Mode, NoAck, OnMissed, OnStorageFull, Policy, Press, Profile, Role, Timeouts, WriteAllow,
};
use crate::document::Reported;
use crate::{Located, TomlTable};
use map::{LocatedMap, parse_range, read_base, read_map};

/// One day: no time limit of a press is longer.
const DAY_MS: i64 = 86_400_000;

impl Press {
    /// Reads the table `[press]`.
    pub(crate) fn read(mut table: TomlTable<'_>) -> Result<Self, Reported> {
        let document = table.document();
        let name = table.name("name").required();
        let press_id = table.integer("press_id").in_range(0..=65_535).map(|id| id as u16).required();
        let role = table.choice("role", &[("client", Role::Client), ("server", Role::Server)]).located();
        let role = role.optional();
        let mode = table.choice("mode", &Mode::ALL).or(Mode::default());
        let profiles = [Profile::Pph1, Profile::Word, Profile::Bits].map(|profile| (profile.name(), profile));
        let profile = table.choice("profile", &profiles).or(Profile::default());
        let link = table.table("link").required().and_then(link::read);
        // With an unknown profile the fields are read as changes of the default map; their conflicts wait.
        let (base, map) = match table.section("map") {
            Ok(mut table) => {
                let base = read_base(&mut table);
                (base, profile.and(read_map(table, profile.unwrap_or_default(), base)))
            }
            Err(reported) => (Err(reported), Err(reported)),
        };
        let write = table.section("write").and_then(|table| read_write(table, base, &map));
        let timeouts = table.section("timeouts").and_then(read_timeouts);
        let policy = table.section("policy").and_then(read_policy);
        table.finish();

        let served = match (&role, &link) {
            (Ok(Some(Located { value: Role::Server, place })), Ok((link, transport_place)))
                if link.is_serial() =>
            {
                let message = "the host serves Modbus TCP only, but link.type is not tcp";
                Err(document.fault(transport_place.as_ref().unwrap_or(place), message))
            }
            _ => Ok(()),
        };
        let (map, write) = (map?, write?);
        check::map(document, &map, &write)?;
        served?;
        let (link, _) = link?;
        let mut timeouts = timeouts?;
        timeouts.heartbeat_in = map.heartbeat_in.unwrap_or(timeouts.heartbeat_in);
        Ok(Self {
            name: name?,
            press_id: press_id?,
            role: role?.map_or(Role::default(), |role| role.value),
            mode: mode?,
            link,
            write,
            map: map.map,
            timeouts,
            policy: policy?,
            advice: None,
        })
    }
}

/// Reads a key in milliseconds.
fn ms(table: &mut TomlTable<'_>, key: &str, least: i64) -> Result<Option<Duration>, Reported> {
    let field = table.integer(key).in_range(least..=DAY_MS);
    field.map(|ms| Duration::from_millis(ms.unsigned_abs())).optional()
}

fn read_timeouts(mut table: TomlTable<'_>) -> Result<Timeouts, Reported> {
    let default = Timeouts::default();
    let scan = ms(&mut table, "scan_ms", 1);
    let evaluate = ms(&mut table, "evaluate_ms", 1);
    let ack = ms(&mut table, "ack_ms", 1);
    let clear = ms(&mut table, "clear_ms", 1);
    let heartbeat = ms(&mut table, "heartbeat_ms", 10);
    table.finish();
    Ok(Timeouts {
        scan: scan?,
        evaluate: evaluate?.unwrap_or(default.evaluate),
        ack: ack?.unwrap_or(default.ack),
        clear: clear?.unwrap_or(default.clear),
        heartbeat: heartbeat?.unwrap_or(default.heartbeat),
        heartbeat_in: default.heartbeat_in,
    })
}

fn read_policy(mut table: TomlTable<'_>) -> Result<Policy, Reported> {
    let missed = [("warn", OnMissed::Warn), ("error", OnMissed::Error), ("block", OnMissed::Block)];
    let on_missed_stroke = table.choice("on_missed_stroke", &missed).or(OnMissed::default());
    let full = [("degrade", OnStorageFull::Degrade), ("stop", OnStorageFull::Stop)];
    let on_storage_full = table.choice("on_storage_full", &full).or(OnStorageFull::default());
    let no_ack = [("next-stroke", NoAck::NextStroke), ("hold", NoAck::Hold)];
    let no_ack = table.choice("no_ack", &no_ack).or(NoAck::default());
    table.finish();
    Ok(Policy { on_missed_stroke: on_missed_stroke?, on_storage_full: on_storage_full?, no_ack: no_ack? })
}

/// Reads `[press.write]`; addresses are in the addressing of the map.
fn read_write(
    mut table: TomlTable<'_>,
    base: Result<AddressBase, Reported>,
    map: &Result<LocatedMap, Reported>,
) -> Result<WriteAllow, Reported> {
    let document = table.document();
    let allow = table.strings("allow").optional();
    let rate = table.integer("max_writes_per_s").in_range(1..=10_000).optional();
    table.finish();
    let allow = match allow? {
        None => map.as_ref().map(|map| WriteAllow::block(&map.map.write)).map_err(|reported| *reported),
        Some(texts) => {
            let range = |text: &Located<String>| {
                parse_range(&text.value, base?).map_err(|message| document.fault(&text.place, message))
            };
            let ranges: Vec<_> = texts.iter().map(range).collect();
            ranges.into_iter().collect::<Result<Vec<_>, _>>().map(WriteAllow::new)
        }
    };
    let mut write = allow?;
    if let Some(rate) = rate? {
        write.max_writes_per_s = rate.unsigned_abs() as u32;
    }
    Ok(write)
}
