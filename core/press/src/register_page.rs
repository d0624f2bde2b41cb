//! Register map in force as a page for the programmer of the press: Markdown, CSV, JSON, and the reference program.

mod alarms;
mod rules;

pub use alarms::alarms_csv;

use std::collections::BTreeMap;
use std::fmt::Write;

use platen_plant::Unit;
use platen_plant::press::{
    Block, Input, Output, Press, RegisterField, RegisterPlace, RegisterTable, RegisterType, Role,
};

use serde::Serialize;

use crate::reference_program;

/// One field on the page.
struct Row {
    offset: Option<u16>,
    bit: Option<u8>,
    name: &'static str,
    field: RegisterField,
    meaning: &'static str,
    /// Value that the plant file defines outside the field.
    must_be: Option<u16>,
}

fn rows<N: Copy>(
    fields: &BTreeMap<N, RegisterField>,
    about: impl Fn(N) -> (&'static str, &'static str),
) -> Vec<Row> {
    let row = |(&name, field): (&N, &RegisterField)| {
        let (name, meaning) = about(name);
        let bit = if let RegisterPlace::Bit(_, bit) = field.place { Some(bit) } else { None };
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
    /// Returns the zero-based addresses on the wire: `120` or `108..=109`; with the bit, `102.3`.
    fn address(&self, block: &Block) -> String {
        let Some(offset) = self.offset else { return "-".into() };
        self.numbers(u32::from(block.start) + u32::from(offset))
    }

    /// Returns the addresses in Modicon notation.
    fn modicon(&self, block: &Block) -> String {
        let Some(offset) = self.offset else { return "-".into() };
        let first = if block.table == RegisterTable::Holding { 400_001 } else { 300_001 };
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
        let order = if matches!(field.kind, RegisterType::U32 | RegisterType::I32 | RegisterType::F32) {
            field.order.name()
        } else {
            ""
        };
        let text = if let RegisterType::Ascii { registers } = field.kind {
            format!(" {}", 2 * registers)
        } else {
            String::new()
        };
        format!("{list}{}{text} {order}", field.kind.name()).trim_end().to_owned()
    }

    /// Returns the row of the page.
    fn show(&self, block: &Block) -> MapRow {
        MapRow {
            address: self.address(block),
            six_digit: self.modicon(block),
            name: self.name,
            kind: self.kind(),
            step: self.step(),
            meaning: self.meaning,
            notes: self.notes(),
        }
    }

    /// Returns the value of one raw step.
    fn step(&self) -> String {
        let field = &self.field;
        match (field.unit, field.scale) {
            (Unit::ONE, 1.0) => String::new(),
            (Unit::ONE, scale) => scale.to_string(),
            (unit, scale) => format!("{scale} {}", unit.symbol()),
        }
    }

    /// Returns the notes of the field.
    fn notes(&self) -> String {
        let field = &self.field;
        let mut notes = Vec::new();
        if let Some(number) = self.must_be {
            notes.push(format!("must be {number}"));
        }
        if let RegisterPlace::Constant(number) = field.place {
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
            notes.push(format!(
                "plausible {}..{} {}",
                limit(field.min),
                limit(field.max),
                field.unit.symbol()
            ));
        }
        if field.active_low {
            notes.push("0 = yes".into());
        }
        if let Some(measure) = field.from {
            notes.push(format!("shows {}", measure.name()));
        }
        notes.join("; ")
    }
}

/// Returns the page as Markdown: both blocks, the rules, and the reference program.
pub fn map_markdown(press: &Press) -> String {
    let map = &press.map;
    let mut page = format!(
        "# Registers of {}\n\nProfile {}, press_id {}. ",
        press.name,
        map.profile.name(),
        press.press_id
    );
    page += "Addresses are zero-based, as on the wire; beside them in 6-digit notation.\n";
    list(&mut page, "Connection", &rules::connection(press));
    list(&mut page, "How to read the tables", &rules::notation(press));
    let functions = |table| if table == RegisterTable::Holding { "function 3" } else { "function 4" };
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
    page += "Registers without a row are reserved: leave them 0.\n";
    list(&mut page, "Rules", &rules::rules(press));
    let _ = write!(
        page,
        "\n## Reference program (IEC 61131-3 Structured Text)\n\n```\n{}```\n",
        reference_program(press)
    );
    page
}

fn list(page: &mut String, title: &str, lines: &[String]) {
    let _ = write!(page, "\n## {title}\n\n");
    for line in lines {
        let _ = writeln!(page, "- {line}");
    }
}

fn section(page: &mut String, title: &str, block: &Block, rows: &[Row]) {
    let _ = write!(
        page,
        "\n## {title}\n\n| address | 6-digit | name | type | 1 step | meaning | notes |\n|---|---|---|---|---|---|---|\n"
    );
    for MapRow { address, six_digit, name, kind, step, meaning, notes } in
        rows.iter().map(|row| row.show(block))
    {
        let _ =
            writeln!(page, "| {address} | {six_digit} | {name} | {kind} | {step} | {meaning} | {notes} |");
    }
}

/// Returns the page as CSV: one line per field.
pub fn map_csv(press: &Press) -> String {
    let mut csv = String::from("direction,address,six_digit,name,type,step,meaning,notes\n");
    let sides = [
        ("press to host", &press.map.read, inputs(press)),
        ("host to press", &press.map.write, outputs(press)),
    ];
    for (direction, block, rows) in sides {
        for MapRow { address, six_digit, name, kind, step, meaning, notes } in
            rows.iter().map(|row| row.show(block))
        {
            let _ = writeln!(
                csv,
                "{direction},{address},{six_digit},{name},{kind},{step},\"{meaning}\",\"{notes}\""
            );
        }
    }
    csv
}

/// The page as data.
#[derive(Debug, Clone, Serialize)]
pub struct MapPage {
    /// Name of the press.
    pub press: String,
    /// Its number.
    pub press_id: u16,
    /// The built-in map that the plant file started from.
    pub profile: &'static str,
    /// Fields from the press to the host.
    pub press_to_host: Vec<MapRow>,
    /// Fields from the host to the press.
    pub host_to_press: Vec<MapRow>,
    /// Registers that the host may write, zero-based.
    pub may_write: String,
    /// Connection of host and press.
    pub connection: Vec<String>,
    /// Notation of the rows.
    pub notation: Vec<String>,
    /// Rules for the program of the press.
    pub rules: Vec<String>,
    /// The reference program, Structured Text.
    pub program: String,
}

/// One field of a block, as the page shows it.
#[derive(Debug, Clone, Serialize)]
pub struct MapRow {
    /// Zero-based, with the bit after a point; `-` for a field without a register.
    pub address: String,
    /// The same in 6-digit notation.
    pub six_digit: String,
    /// Name in the plant file.
    pub name: &'static str,
    /// Type, with the order of its words.
    #[serde(rename = "type")]
    pub kind: String,
    /// Value of one raw step; empty for a plain number.
    pub step: String,
    /// Meaning.
    pub meaning: &'static str,
    /// Notes.
    pub notes: String,
}

/// Returns the page as data.
pub fn map_page(press: &Press) -> MapPage {
    let show = |rows: Vec<Row>, block| rows.iter().map(|row| row.show(block)).collect();
    MapPage {
        press: press.name.clone(),
        press_id: press.press_id,
        profile: press.map.profile.name(),
        press_to_host: show(inputs(press), &press.map.read),
        host_to_press: show(outputs(press), &press.map.write),
        may_write: press.write.to_string(),
        connection: rules::connection(press),
        notation: rules::notation(press),
        rules: rules::rules(press),
        program: reference_program(press),
    }
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
        let data = map_page(&press());
        assert_eq!(data.press_to_host.len() + data.host_to_press.len(), fields);
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
    fn a_valid_result_is_known_by_the_bits_that_there_are() {
        let counting = map_markdown(&press());
        let all = "exactly one of status_pass, status_fail, status_cannot_tell and status_not_measured is 1";
        assert!(counting.contains(all), "{counting}");
        let mut bare = press();
        bare.map = RegisterMap::bits();
        assert!(map_markdown(&bare).contains("neither status_pass nor status_fail"));
    }

    #[test]
    fn the_page_of_a_press_that_does_not_count_states_it() {
        let mut bare = press();
        bare.map = RegisterMap::word();
        let page = map_markdown(&bare);
        assert!(page.contains("Stroke counting is not available"), "{page}");
        assert!(page.contains("keep it at 0 for at least 60 ms"), "two equal reads, every 20 ms: {page}");
        assert!(!page.contains("ack_stroke_id") && !page.contains("ABCD"), "{page}");
    }
}
