//! Tests of `[press]`: accepted values, and every conflict with both fields.

#![allow(clippy::unwrap_used, clippy::panic, reason = "helpers of tests")]

use platen_plant::press::{
    AddressBase, Input, Mode, Output, Press, Profile, RegisterMap, RegisterPlace, RegisterType, Role,
    Transport, WordOrder,
};
use platen_plant::{PlantFile, Unit};

const LINK: &str =
    "[press]\nname = \"Press 3\"\npress_id = 3\n[press.link]\nhost = \"192.0.2.10\"\nunit = 1\n";

#[track_caller]
fn taken(text: &str) -> Press {
    match PlantFile::parse("p.toml", &format!("{LINK}{text}")) {
        Ok(plant) => plant.press.unwrap(),
        Err(faults) => panic!("{faults}"),
    }
}

/// Checks that `text` is refused; `text` begins on line 7.
#[track_caller]
fn refused(text: &str, expected: &[&str]) {
    let faults = PlantFile::parse("p.toml", &format!("{LINK}{text}")).err().unwrap();
    let found: Vec<_> = faults.as_slice().iter().map(ToString::to_string).collect();
    assert_eq!(found, expected);
}

#[test]
fn the_least_that_must_be_said() {
    let press = taken("");
    assert_eq!(press.map, RegisterMap::pph1());
    assert_eq!((press.role, press.mode, press.press_id), (Role::Client, Mode::Measure, 3));
    assert_eq!(press.write.to_string(), "100..=163");
    assert_eq!(press.link.transport.to_string(), "192.0.2.10:502");
    assert_eq!(press.timeouts.heartbeat_in.as_millis(), 2000);
}

#[test]
fn every_property_of_a_field_can_be_said() {
    let press = taken(
        r#"
[press.map]
address_base = 40001
word_order = "CDAB"
read = { start = 40201, count = 40 }
write = { start = 40301, count = 70 }
[press.map.in]
heartbeat = { at = 33, timeout_ms = 5000 }
trigger = { at = "34.0", active = "low", debounce_reads = 3 }
stroke_id = { at = "@40236", wrap = 9999, zero = "stroke" }
stroke_id_tail = "none"
thickness = { at = 36, type = "f32", unit = "in", min = 0.1, max = 5 }
clear_to_scan = { const = 1 }
part_id = { order = "ABCD" }
part_name = { length = 6 }
[press.map.out]
dev_max = { at = 64, type = "i32", scale = 1, unit = "um", invalid = "0x80000000", from = "gap.max" }
station = { count = 4 }
status_ready = { at = "@40303.15" }
[press.write]
allow = ["40301..=40370"]
max_writes_per_s = 5
"#,
    );
    let map = &press.map;
    assert_eq!((map.address_base, map.read.start, map.write.start), (AddressBase::FiveDigits, 200, 300));
    assert_eq!(press.timeouts.heartbeat_in.as_millis(), 5000);
    let trigger = map.input(Input::Trigger).unwrap();
    assert_eq!(
        (trigger.place, trigger.active_low, trigger.debounce_reads),
        (RegisterPlace::Bit(34, 0), true, 3)
    );
    assert_eq!(map.input(Input::StrokeId).unwrap().place, RegisterPlace::Register(35));
    assert_eq!((map.counter.wrap, map.counter.first), (9999, 0));
    assert_eq!(map.input(Input::StrokeIdTail), None);
    let thickness = map.input(Input::Thickness).unwrap();
    assert_eq!(
        (thickness.kind, thickness.scale, thickness.unit),
        (RegisterType::F32, 1.0, Unit::find("in").unwrap())
    );
    assert_eq!((thickness.order, thickness.min, thickness.max), (WordOrder::Cdab, Some(0.1), Some(5.0)));
    assert_eq!(map.input(Input::ClearToScan).unwrap().place, RegisterPlace::Constant(1.0));
    assert_eq!(map.input(Input::PartId).unwrap().order, WordOrder::Abcd);
    assert_eq!(map.input(Input::PartName).unwrap().kind, RegisterType::Ascii { registers: 6 });
    let dev_max = map.output(Output::DevMax).unwrap();
    assert_eq!((dev_max.kind, dev_max.invalid), (RegisterType::I32, Some(0x8000_0000)));
    assert_eq!(dev_max.from.unwrap().name(), "gap.max");
    assert_eq!(map.output(Output::StatusReady).unwrap().place, RegisterPlace::Bit(2, 15));
    assert_eq!((press.write.to_string().as_str(), press.write.max_writes_per_s), ("300..=369", 5));
}

#[test]
fn links_of_each_kind() {
    let text = "[press]\nname = \"P\"\npress_id = 0\n[press.link]\ntype = \"rtu\"\nunit = 7\ndevice = \"/dev/ttyUSB0\"\n\
                baud = 19200\nparity = \"none\"\nstop_bits = 2\necho = true\nquiet_ms = 900\n";
    let press = PlantFile::parse("p.toml", text).unwrap().press.unwrap();
    let Transport::Rtu(serial, quiet) = &press.link.transport else { panic!("{:?}", press.link) };
    assert_eq!((serial.baud, serial.stop_bits, serial.echo), (19_200, 2, true));
    assert_eq!(quiet.0.as_millis(), 900);
    assert_eq!(press.link.response_timeout.as_millis(), 298, "3 x 139 characters of 11 bits and 60 ms");
    let gateway = text.replace("\"rtu\"", "\"rtu-over-tcp\"").replace("device", "host");
    let faults = PlantFile::parse("p.toml", &gateway).err().unwrap().to_string();
    assert!(faults.contains("p.toml:8:1: press.link.baud: unknown key"), "{faults}");
    refused(
        "type = \"rtu-over-tcp\"\nquiet_ms = 400\n",
        &[
            "p.toml:8:12: press.link.quiet_ms: found 400, must be above response_timeout_ms (500): an answer that comes \
           later than that would be taken for the next one",
        ],
    );
}

#[test]
fn minimal_profiles() {
    let press = taken("[press.map]\nread = { start = 10 }\nwrite = { start = 50 }\n").map;
    assert_eq!((press.read.start, press.write.start), (10, 50));
    for (name, profile) in [("word", Profile::Word), ("bits", Profile::Bits)] {
        let text = LINK.replace("press_id = 3\n", &format!("press_id = 3\nprofile = \"{name}\"\n"));
        let press = PlantFile::parse("p.toml", &text).unwrap().press.unwrap();
        assert_eq!(press.map, RegisterMap::of(profile));
        assert!(!press.map.counts_strokes());
    }
}

#[test]
fn every_conflict_at_once_with_both_fields() {
    refused(
        r#"[press.map.in]
thickness = { at = 20, unit = "mm", scale = 0.01 }
die_id = { at = 33 }
press_force = { at = 20 }
part_id = { at = 31 }
abort = { at = "2.1" }
rescan = { at = "2.16" }
[press.map.out]
dev_min = { at = 10 }
owner = { at = 63, type = "u32" }
result_stroke_id = "none"
[press.write]
allow = ["100..=150"]
"#,
        &[
            "p.toml:9:17: press.map.in.die_id.at: found register 33 of its block, which has 0 to 31",
            "p.toml:13:17: press.map.in.rescan.at: found bit 16, a register has bits 0 to 15",
        ],
    );
    refused(
        r#"[press.map.in]
thickness = { at = 20, unit = "mm", scale = 0.01 }
press_force = { at = 20 }
part_id = { at = 31 }
abort = { at = "2.1" }
[press.map.out]
dev_min = { at = 10 }
owner = { at = 63, type = "u32" }
result_stroke_id = "none"
[press.write]
allow = ["100..=159"]
"#,
        &[
            "p.toml:7:8: press.map: `attempt_echo` at holding register 161 is not in press.write.allow (100..=159)",
            "p.toml:7:8: press.map: `sense` at holding register 160 is not in press.write.allow (100..=159)",
            "p.toml:9:15: press.map.in.press_force: holding register 20 is `thickness` already (p.toml:8:13); move one",
            "p.toml:10:11: press.map.in.part_id: `part_id` needs holding register 32, but its block ends with holding register 31",
            "p.toml:11:9: press.map.in.abort: holding register 2 bit 1 is `trigger` already (built-in); move one",
            "p.toml:13:11: press.map.out.dev_min: holding register 110 is `dev_max` already (built-in); move one",
            "p.toml:14:9: press.map.out.owner: `owner` needs holding register 164, but its block ends with holding register 163",
            "p.toml:15:20: press.map.out.result_stroke_id: the profile pph-1 requires `result_stroke_id`",
        ],
    );
}
