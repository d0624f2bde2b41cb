//! The register map in force as a page for the programmer of the press: Markdown, CSV, and the program to write.

use std::collections::BTreeMap;
use std::fmt::Write;

use platen_plant::press::{Block, Field, Input, Kind, Output, Place, Press, Profile, Table, Unit};

/// One field on the page.
struct Row {
    offset: Option<u16>,
    bit: Option<u8>,
    name: &'static str,
    field: Field,
    meaning: &'static str,
}

fn rows<N: Copy>(fields: &BTreeMap<N, Field>, about: impl Fn(N) -> (&'static str, &'static str)) -> Vec<Row> {
    let row = |(&name, field): (&N, &Field)| {
        let (name, meaning) = about(name);
        let bit = if let Place::Bit(_, bit) = field.place { Some(bit) } else { None };
        Row { offset: field.place.offset(), bit, name, field: field.clone(), meaning }
    };
    let mut rows: Vec<_> = fields.iter().map(row).collect();
    rows.sort_by_key(|row| (row.offset.is_none(), row.offset, row.bit));
    rows
}

fn inputs(press: &Press) -> Vec<Row> {
    rows(&press.map.inputs, |input: Input| (input.name(), input.meaning()))
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
    page += "Each block travels in one transaction.\n";
    let functions = |table| if table == Table::Holding { "function 3" } else { "function 4" };
    let (read, write) = (&map.read, &map.write);
    let read_by = functions(read.table);
    section(
        &mut page,
        &format!("Press to host: the host reads {} registers with {read_by}", read.count),
        read,
        &inputs(press),
    );
    section(
        &mut page,
        &format!("Host to press: the host writes {} registers with function 16", write.count),
        write,
        &outputs(press),
    );
    let _ = write!(page, "\nThe host writes holding registers {} (zero-based) and no others. ", press.write);
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
    if has(Input::Heartbeat) {
        let limit = press.timeouts.heartbeat_in.as_secs_f64();
        rules.push(format!("Count heartbeat up at least every {} s.", limit / 4.0));
    }
    rules.push("A figure without a value holds its \"no value\" word, never 0.".into());
    rules.push("The host measures only: no output of it may start, stop or release motion.".into());
    rules
}

/// The program of the press that goes with the map: P is its block, H the host's.
pub fn reference_program(press: &Press) -> String {
    let map = &press.map;
    if map.profile != Profile::Pph1 {
        let ack = if map.inputs.contains_key(&Input::Ack) {
            "IF waiting AND valid THEN (* copy values, judge *) waiting := FALSE; P.ack := TRUE; END_IF;\n\
             IF P.ack AND NOT H.status_result_valid THEN P.ack := FALSE; END_IF;\n"
        } else {
            "IF waiting AND valid THEN (* copy values, judge *) waiting := FALSE; END_IF;\n"
        };
        return format!(
            "IF stroke_done AND NOT waiting THEN waiting := TRUE; tRes(IN := FALSE); END_IF;\n\
             accepted := waiting AND (accepted OR H.status_busy);\n\
             valid := accepted AND H.status_result_valid AND NOT H.status_busy;\n{ack}\
             P.trigger := waiting;\n\
             tRes(IN := waiting, PT := T#180s);  (* longer than the scan and evaluation limits together *)\n\
             IF tRes.Q THEN waiting := FALSE; alarm := TRUE; END_IF;  (* go on without a measurement *)\n\
             IF NOT waiting THEN accepted := FALSE; END_IF;\n"
        );
    }
    let has = |output| map.outputs.contains_key(&output);
    let tail =
        if map.inputs.contains_key(&Input::StrokeIdTail) { "P.stroke_id_tail := stroke_id; " } else { "" };
    let session =
        if has(Output::SessionEcho) { "\n            AND (H.session_echo = P.session_id)" } else { "" };
    let seq =
        if has(Output::ResultSeqTail) { "\n         AND (H.result_seq = H.result_seq_tail)" } else { "" };
    let simulated = if has(Output::StatusSimulated) { " AND NOT H.status_simulated" } else { "" };
    let wrap = map.counter;
    format!(
        "IF stroke_done AND NOT waiting THEN\n  \
           IF stroke_id >= {} THEN stroke_id := {}; ELSE stroke_id := stroke_id + 1; END_IF;\n  \
           {tail}P.stroke_id := stroke_id; waiting := TRUE; tAcc(IN := FALSE); tRes(IN := FALSE);\n\
         END_IF;\n\
         accepted := waiting AND (H.ack_stroke_id = stroke_id){session};\n\
         P.trigger := waiting AND NOT accepted;\n\
         tAlive(IN := H.heartbeat = lastBeat, PT := T#2s); lastBeat := H.heartbeat; hostAlive := NOT tAlive.Q;\n\
         tAcc(IN := waiting AND NOT accepted, PT := T#500ms);  (* alarm only: the host may be busy *)\n\
         tRes(IN := waiting, PT := T#180s);  (* longer than the scan and evaluation limits together *)\n\
         valid := accepted AND H.status_result_valid AND (H.result_stroke_id = stroke_id){seq}\n         \
           AND hostAlive{simulated};\n\
         IF valid THEN (* copy values, judge *) waiting := FALSE; P.ack := TRUE; END_IF;\n\
         IF P.ack AND NOT H.status_result_valid THEN P.ack := FALSE; END_IF;\n\
         IF waiting AND (tRes.Q OR NOT hostAlive) THEN waiting := FALSE; alarm := TRUE; END_IF;\n\
         (* then the stroke goes on without a measurement: the plant decides *)\n",
        wrap.wrap, wrap.first
    )
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
    fn the_program_asks_only_for_what_the_press_has() {
        assert!(reference_program(&press()).contains("H.session_echo = P.session_id"));
        let mut bare = press();
        bare.map.outputs.remove(&Output::SessionEcho);
        assert!(!reference_program(&bare).contains("session"));
        bare.map = RegisterMap::word();
        let program = reference_program(&bare);
        assert!(!program.contains("stroke_id") && !program.contains("P.ack"), "{program}");
        assert!(map_markdown(&bare).contains("Stroke counting is not available"));
    }
}
