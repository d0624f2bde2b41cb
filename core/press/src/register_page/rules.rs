//! Texts of the register page besides its tables: connection, notation, and rules for the program of the press.

use platen_plant::press::{Input, Mode, Output, Parity, Press, RegisterType, Role, Transport};

/// Returns the paragraph about the connection.
pub(super) fn connection(press: &Press) -> Vec<String> {
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
    match press.mode {
        Mode::Off => lines.push("Mode off: the host leaves the press alone for now.".into()),
        Mode::Listen => lines.push("Mode listen: the host reads only for now, and writes nothing.".into()),
        Mode::DryRun => {
            lines.push("Mode dry-run: the host logs for now what it would write, and writes nothing.".into());
        }
        Mode::Simulate => {
            lines.push(
                "Mode simulate: every result is marked by status_simulated for now, and never true.".into(),
            );
        }
        Mode::Measure => {}
    }
    if press.role == Role::Client {
        let most = press.write.max_writes_per_s;
        lines.push(format!(
            "The host polls every {} ms, expects each answer within {} ms and writes at most {most} times a second.",
            ms(link.poll),
            ms(link.response_timeout)
        ));
        lines.push(exchange(press));
    }
    lines
}

/// Returns the requests as the press sees them.
fn exchange(press: &Press) -> String {
    let (map, serial) = (&press.map, press.link.is_serial());
    let fast = map.fast_count();
    let part = if serial && fast < map.read.count {
        format!(" On this line it reads only the first {fast} of its block while no stroke waits.")
    } else {
        String::new()
    };
    format!(
        "Each block is read in one request.{part} The host writes only what changes, the result first and the status last, \
         and reads its own block back with function 3."
    )
}

/// Returns the notation of bits, steps and types that the map has.
pub(super) fn notation(press: &Press) -> Vec<String> {
    let map = &press.map;
    let mut lines = vec![
        "The number after the point is a bit; bit 0 is the lowest of its register.".to_owned(),
        "1 step: what one count of the register means. i16 is signed, two's complement.".to_owned(),
    ];
    let fields = || map.inputs.values().chain(map.outputs.values()).filter(|f| f.place.offset().is_some());
    if fields().any(|field| matches!(field.kind, RegisterType::U32 | RegisterType::I32 | RegisterType::F32)) {
        lines.push(
            "32 bits in two registers, A the highest byte and D the lowest: ABCD has the high word in the first register, \
             CDAB in the second; BADC and DCBA are these with the bytes of each register swapped."
                .into(),
        );
    }
    if fields().any(|field| matches!(field.kind, RegisterType::Ascii { .. })) {
        lines.push("ascii: two characters a register, the first in its high byte; 0 after the last.".into());
    }
    if map.outputs.contains_key(&Output::GapU) || map.outputs.contains_key(&Output::MaxX) {
        lines.push("u, v: places on the flat blank, from its corner (0, 0); u runs along its width.".into());
    }
    lines
}

pub(super) fn rules(press: &Press) -> Vec<String> {
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
        let low = press.link.poll * (u32::from(debounce(press)) + 1);
        rules.push(format!(
            "Hold trigger until status_result_valid; then keep it at 0 for at least {} ms.",
            low.as_millis()
        ));
    }
    if has(Input::StrokeIdTail) {
        rules.push("Write stroke_id_tail first and stroke_id last, in the same program cycle.".into());
    }
    if has(Input::SessionId) {
        rules.push("Draw session_id at random when the controller starts and when the part changes.".into());
    }
    if has(Input::Ack) {
        rules.push(format!(
            "Raise ack when the result is read, within {} s; drop it when status_result_valid is 0.",
            press.timeouts.ack.as_secs_f64()
        ));
    } else if !map.counts_strokes() {
        rules.push("Drop trigger when the result is read: that is the acknowledge.".into());
    }
    rules.push(verdicts(press));
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
        rules.push(
            "As long as the result of a stroke that was not measured is valid, error_code says why it was not; else what \
             keeps the host from being ready. The texts of error_code and warning_code: platen press map PLANT --format \
             alarms."
                .into(),
        );
    }
    if has(Input::Heartbeat) {
        let limit = press.timeouts.heartbeat_in.as_secs_f64();
        rules.push(format!("Count heartbeat up at least every {} s.", limit / 4.0));
    }
    rules.push("A figure without a value holds its \"no value\" word, never 0.".into());
    rules.push("The host measures only: no output of it may start, stop or release motion.".into());
    rules
}

/// Returns the debouncing of the trigger.
fn debounce(press: &Press) -> u8 {
    press.map.inputs.get(&Input::Trigger).map_or(1, |field| field.debounce_reads)
}

/// Returns the meaning of the verdict bits that the map has.
fn verdicts(press: &Press) -> String {
    let has = |output: &Output| press.map.outputs.contains_key(output);
    let bits = [Output::StatusPass, Output::StatusFail, Output::StatusCannotTell, Output::StatusNotMeasured];
    let names: Vec<&str> = bits.iter().filter(|bit| has(bit)).map(|bit| bit.name()).collect();
    match names.as_slice() {
        [first @ .., last] if names.len() == bits.len() => {
            format!("With status_result_valid exactly one of {} and {last} is 1.", first.join(", "))
        }
        [] => "A valid result with status_error could not be measured.".into(),
        some => format!(
            "With status_result_valid and neither {} the plate was not measured, or not certainly enough to be judged.",
            some.join(" nor ")
        ),
    }
}
