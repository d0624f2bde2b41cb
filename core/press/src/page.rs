//! The register map in force as a page for the programmer of the press: Markdown, CSV, and the program to write.

use std::collections::BTreeMap;
use std::fmt::Write;

use platen_plant::press::{
    Block, Field, Input, Kind, Output, Parity, Place, Press, Role, Table, Transport, Unit,
};

use crate::reference_program;

/// One field on the page.
struct Row {
    offset: Option<u16>,
    bit: Option<u8>,
    name: &'static str,
    field: Field,
    meaning: &'static str,
    /// The number that the plant file asks for elsewhere than in the field.
    must_be: Option<u16>,
}

fn rows<N: Copy>(fields: &BTreeMap<N, Field>, about: impl Fn(N) -> (&'static str, &'static str)) -> Vec<Row> {
    let row = |(&name, field): (&N, &Field)| {
        let (name, meaning) = about(name);
        let bit = if let Place::Bit(_, bit) = field.place { Some(bit) } else { None };
        Row { offset: field.place.offset(), bit, name, field: field.clone(), meaning, must_be: None }
    };
    let mut rows: Vec<_> = fields.iter().map(row).collect();
    rows.sort_by_key(|row| (row.offset.is_none(), row.offset, row.bit));
    rows
}

fn inputs(press: &Press) -> Vec<Row> {
    let mut rows = rows(&press.map.inputs, |input: Input| (input.name(), input.meaning()));
    for row in rows.iter_mut().filter(|row| row.name == Input::PressId.name()) {
        row.must_be = Some(press.press_id);
    }
    rows
}

fn outputs(press: &Press) -> Vec<Row> {
    rows(&press.map.outputs, |output: Output| (output.name(), output.meaning()))
}

impl Row {
    /// Zero-based addresses on the wire: `120` or `108..=109`; with the bit, `102.3`.
    fn address(&self, block: &Block) -> String {
        let Some(offset) = self.offset else { return "-".into() };
        self.numbers(u32::from(block.start) + u32::from(offset))
    }

    /// The same in Modicon notation.
    fn modicon(&self, block: &Block) -> String {
        let Some(offset) = self.offset else { return "-".into() };
        let first = if block.table == Table::Holding { 400_001 } else { 300_001 };
        self.numbers(first + u32::from(block.start) + u32::from(offset))
    }

    fn numbers(&self, first: u32) -> String {
        match (self.bit, self.field.registers()) {
            (Some(bit), _) => format!("{first}.{bit}"),
            (None, 1) => first.to_string(),
            (None, n) => format!("{first}..={}", first + u32::from(n) - 1),
        }
    }

    fn kind(&self) -> String {
        let field = &self.field;
        let list = if field.count > 1 { format!("{} x ", field.count) } else { String::new() };
        let order =
            if matches!(field.kind, Kind::U32 | Kind::I32 | Kind::F32) { field.order.name() } else { "" };
        let text = if let Kind::Ascii { registers } = field.kind {
            format!(" {}", 2 * registers)
        } else {
            String::new()
        };
        format!("{list}{}{text} {order}", field.kind.name()).trim_end().to_owned()
    }

    /// What one raw step means.
    fn step(&self) -> String {
        let field = &self.field;
        match (field.unit, field.scale) {
            (Unit::One, 1.0) => String::new(),
            (Unit::One, scale) => scale.to_string(),
            (unit, scale) => format!("{scale} {}", unit.name()),
        }
    }

    /// Everything else that must be known about the field.
    fn notes(&self) -> String {
        let field = &self.field;
        let mut notes = Vec::new();
        if let Some(number) = self.must_be {
            notes.push(format!("must be {number}"));
        }
        if let Place::Constant(number) = field.place {
            notes.push(format!("always {number}"));
        }
        if let Some(expected) = field.expect {
            notes.push(format!("must be {expected}"));
        }
        if let Some(invalid) = field.invalid {
            notes.push(format!("{invalid:#X} = no value").replace("0X", "0x"));
        }
        if field.min.is_some() || field.max.is_some() {
            let limit = |limit: Option<f64>| limit.map_or(String::new(), |limit| limit.to_string());
            notes.push(format!("plausible {}..{} {}", limit(field.min), limit(field.max), field.unit.name()));
        }
        if field.active_low {
            notes.push("0 = yes".into());
        }
        if let Some(measure) = field.from {
            notes.push(format!("shows {measure}"));
        }
        notes.join("; ")
    }
}

/// The page as Markdown: both blocks, the rules, and the reference program.
pub fn map_markdown(press: &Press) -> String {
    let map = &press.map;
    let mut page = format!(
        "# Registers of {}\n\nProfile {}, press_id {}. ",
        press.name,
        map.profile.name(),
        press.press_id
    );
    page += "Addresses are zero-based, as on the wire; beside them in 6-digit notation. ";
    page += "Each block travels in one transaction.\n\n## Connection\n\n";
    for line in connection(press) {
        let _ = writeln!(page, "- {line}");
    }
    let functions = |table| if table == Table::Holding { "function 3" } else { "function 4" };
    let (read, write) = (&map.read, &map.write);
    let (to_host, to_press) = if press.role == Role::Server {
        ("the press writes", format!("the press reads {} registers with function 3", write.count))
    } else {
        ("the host reads", format!("the host writes {} registers with function 16", write.count))
    };
    let by = if press.role == Role::Server { "function 16" } else { functions(read.table) };
    section(
        &mut page,
        &format!(
            "Press to host: {to_host} {} register{} with {by}",
            read.count,
            if read.count == 1 { "" } else { "s" }
        ),
        read,
        &inputs(press),
    );
    section(&mut page, &format!("Host to press: {to_press}"), write, &outputs(press));
    let _ = write!(page, "\nThe host changes registers {} (zero-based) and no others. ", press.write);
    page += "Registers without a row are reserved: leave them 0.\n\n## Rules\n\n";
    for rule in rules(press) {
        let _ = writeln!(page, "- {rule}");
    }
    let _ = write!(
        page,
        "\n## Reference program (IEC 61131-3 Structured Text)\n\n```\n{}```\n",
        reference_program(press)
    );
    page
}

/// How the two find each other.
fn connection(press: &Press) -> Vec<String> {
    let (link, ms) = (&press.link, |time: std::time::Duration| time.as_millis());
    let mut lines = Vec::new();
    match (&link.transport, press.role) {
        (Transport::Tcp(socket), Role::Server) => {
            lines.push(format!(
                "The host is the Modbus TCP server at {}:{}, unit {}; the press is the client.",
                socket.host, socket.port, link.unit
            ));
            lines.push(
                "Write your block and read the host's in turn, every 20 to 100 ms, each whole in one request. Without a \
                 write for 2 s the host takes the press for gone."
                    .into(),
            );
        }
        (Transport::Tcp(socket), Role::Client) => lines.push(format!(
            "The press is the Modbus TCP server at {}:{}, unit {}. One connection is held open.",
            socket.host, socket.port, link.unit
        )),
        (Transport::RtuOverTcp(socket, _), _) => lines.push(format!(
            "The press is a Modbus RTU slave, unit {}, behind the gateway {}:{} that passes RTU frames unchanged.",
            link.unit, socket.host, socket.port
        )),
        (Transport::Rtu(serial, _), _) => lines.push(format!(
            "The press is a Modbus RTU slave, unit {}: {} baud, 8 data bits, {} parity, {} stop bit{}.",
            link.unit,
            serial.baud,
            match serial.parity {
                Parity::Even => "even",
                Parity::Odd => "odd",
                Parity::None => "no",
            },
            serial.stop_bits,
            if serial.stop_bits == 1 { "" } else { "s" }
        )),
    }
    if press.role == Role::Client {
        let most = press.write.max_writes_per_s;
        lines.push(format!(
            "The host polls every {} ms, expects each answer within {} ms and writes at most {most} times a second.",
            ms(link.poll),
            ms(link.response_timeout)
        ));
    }
    lines
}

fn section(page: &mut String, title: &str, block: &Block, rows: &[Row]) {
    let _ = write!(
        page,
        "\n## {title}\n\n| address | 6-digit | name | type | 1 step | meaning | notes |\n|---|---|---|---|---|---|---|\n"
    );
    for row in rows {
        let (address, modicon, kind, step, notes) =
            (row.address(block), row.modicon(block), row.kind(), row.step(), row.notes());
        let _ = writeln!(
            page,
            "| {address} | {modicon} | {} | {kind} | {step} | {} | {notes} |",
            row.name, row.meaning
        );
    }
}

/// The page as CSV: one line per field.
pub fn map_csv(press: &Press) -> String {
    let mut csv = String::from("direction,address,six_digit,name,type,step,meaning,notes\n");
    let sides = [
        ("press to host", &press.map.read, inputs(press)),
        ("host to press", &press.map.write, outputs(press)),
    ];
    for (direction, block, rows) in sides {
        for row in rows {
            let (address, modicon, kind, step, notes) =
                (row.address(block), row.modicon(block), row.kind(), row.step(), row.notes());
            let _ = writeln!(
                csv,
                "{direction},{address},{modicon},{},{kind},{step},\"{}\",\"{notes}\"",
                row.name, row.meaning
            );
        }
    }
    csv
}

fn rules(press: &Press) -> Vec<String> {
    let map = &press.map;
    let has = |input| map.inputs.contains_key(&input);
    let mut rules = Vec::new();
    if map.counts_strokes() {
        let counter = map.counter;
        rules.push(format!(
            "Set stroke_id before trigger. It counts by one, from {} to {}, then from {} again. Hold trigger until \
             ack_stroke_id equals stroke_id.",
            counter.first, counter.wrap, counter.first
        ));
        rules.push(
            "Use a result only if status_result_valid is 1, result_stroke_id is your stroke_id, session_echo your \
             session_id, result_seq equals result_seq_tail, the host's heartbeat moves, and status_simulated is 0."
                .into(),
        );
    } else {
        rules.push(
            "Stroke counting is not available on this press: a missed stroke cannot be noticed.".into(),
        );
        rules.push("Hold trigger until status_result_valid.".into());
    }
    if has(Input::StrokeIdTail) {
        rules.push("Write stroke_id_tail first and stroke_id last, in the same program cycle.".into());
    }
    if has(Input::SessionId) {
        rules.push("Draw session_id at random when the controller starts and when the part changes.".into());
    }
    if has(Input::Ack) {
        rules.push("Raise ack when the result is read; drop it when status_result_valid is 0.".into());
    } else if !map.counts_strokes() {
        rules.push("Drop trigger when the result is read: that is the acknowledge.".into());
    }
    if has(Input::Enable) {
        rules.push("Hold enable at 1 while strokes are to be measured; 0 during a scan gives it up.".into());
    }
    if has(Input::ClearToScan) {
        rules.push(
            "Raise clear_to_scan when ram and plate are at rest, and hold it until status_scan_done: only then is the \
             plate free to move."
                .into(),
        );
    }
    if has(Input::Baseline) {
        rules.push(
            "For a scan of the blank before its first stroke raise baseline together with trigger, under a stroke_id of \
             its own."
                .into(),
        );
    }
    if has(Input::Rescan) && has(Input::Attempt) {
        rules.push(
            "To measure the same stroke again count attempt up by one and raise rescan; stroke_id stays. The result is \
             the one whose attempt_echo is your attempt."
                .into(),
        );
    }
    if has(Input::PartEnd) {
        rules.push("Raise part_end for at least 0.5 s when the plate leaves.".into());
    }
    if has(Input::ErrorReset) {
        rules.push("Raise error_reset for at least 0.5 s to clear latched errors and missed_count.".into());
    }
    if map.outputs.contains_key(&Output::ErrorCode) {
        rules
            .push("The texts of error_code and warning_code: platen press map PLANT --format alarms.".into());
    }
    if has(Input::Heartbeat) {
        let limit = press.timeouts.heartbeat_in.as_secs_f64();
        rules.push(format!("Count heartbeat up at least every {} s.", limit / 4.0));
    }
    rules.push("A figure without a value holds its \"no value\" word, never 0.".into());
    rules.push("The host measures only: no output of it may start, stop or release motion.".into());
    rules
}

#[cfg(test)]
mod tests {
    use super::*;
    use platen_plant::press::{Link, RegisterMap};

    fn press() -> Press {
        Press::pph1("Press 3", 3, Link::tcp("192.0.2.10", 502, 1))
    }

    #[test]
    fn every_field_has_its_row_with_both_addresses() {
        let page = map_markdown(&press());
        for row in [
            "| 2.1 | 400003.1 | trigger | bool |  |",
            "| 8..=9 | 400009..=400010 | part_id | u32 ABCD |  |",
            "| 10..=17 | 400011..=400018 | part_name | ascii 16 |  |",
            "| 122..=141 | 400123..=400142 | station | 20 x i16 | 0.01 mm |",
            "| 114 | 400115 | in_tol | u16 | 0.1 % |",
        ] {
            assert!(page.contains(row), "{row} is not in\n{page}");
        }
        let fields = press().map.inputs.len() + press().map.outputs.len();
        assert_eq!(page.lines().filter(|line| line.starts_with("| ")).count(), fields + 2);
        assert_eq!(map_csv(&press()).lines().count(), fields + 1);
    }

    #[test]
    fn the_page_says_how_to_connect() {
        let mut other = press();
        let rtu = Link::rtu(platen_plant::press::Serial::new("/dev/ttyS0", 38_400), 7);
        other.link = rtu;
        assert!(map_markdown(&other).contains("unit 7: 38400 baud, 8 data bits, even parity, 1 stop bit."));
        let mut served = press();
        served.role = Role::Server;
        let page = map_markdown(&served);
        assert!(
            page.contains("server at 192.0.2.10:502") && page.contains("the press writes 32 registers"),
            "{page}"
        );
    }

    #[test]
    fn a_press_that_does_not_count_is_told_so() {
        let mut bare = press();
        bare.map = RegisterMap::word();
        assert!(map_markdown(&bare).contains("Stroke counting is not available"));
    }
}
