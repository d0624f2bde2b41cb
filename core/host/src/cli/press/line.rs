//! Commands `check`, `ping` and `scan-unit`: tests of the link to the press.

use std::ops::RangeInclusive;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use platen_plant::press::{Block, Press, Role, Transport};
use platen_press::{LinkError, ROUND_TRIP_LIMITS_MS};

use super::super::run::runtime;
use super::{Common, Failure, client, output};
use crate::progress;

use serde_json::json;

pub(super) type Units = RangeInclusive<u8>;

/// Parses `1..10`, both ends included, or one number.
pub(super) fn units(text: &str) -> Result<Units, String> {
    let number = |text: &str| text.parse::<u8>().map_err(|e| format!("`{text}`: {e}; write 1..10"));
    match text.split_once("..") {
        Some((first, last)) => Ok(number(first)?..=number(last.trim_start_matches('='))?),
        None => number(text).map(|unit| unit..=unit),
    }
}

struct Exchange {
    what: &'static str,
    function: u8,
    registers: u16,
    /// Bytes of request and answer on a serial line.
    bytes: u32,
}

/// Returns the exchanges of the host with the press, most frequent first.
fn exchanges(press: &Press) -> Vec<Exchange> {
    let (read, write) = (press.map.read, press.map.write);
    let fast = if press.link.is_serial() { press.map.fast_count() } else { read.count };
    let reading = |what, registers: u16| {
        let function = if read.table == platen_plant::press::RegisterTable::Holding { 3 } else { 4 };
        Exchange { what, function, registers, bytes: 8 + 5 + 2 * u32::from(registers) }
    };
    let mut exchanges = vec![reading("poll", fast)];
    if fast < read.count {
        exchanges.push(reading("whole block at a trigger", read.count));
    }
    exchanges.push(Exchange { function: 3, ..reading("own block read back", write.count) });
    if press.mode.writes() {
        let bytes = 9 + 2 * u32::from(write.count) + 8;
        exchanges.push(Exchange { what: "result", function: 16, registers: write.count, bytes });
    }
    exchanges
}

/// Prints everything that follows from the plant file alone: allow-list, exchanges and their time on the line.
pub(super) fn check(common: &Common, press: &Press) -> Result<(), Failure> {
    let serial = match &press.link.transport {
        Transport::Rtu(serial, _) => Some(serial),
        Transport::Tcp(_) | Transport::RtuOverTcp(..) => None,
    };
    let ms = |time: Duration| time.as_secs_f64() * 1000.0;
    let line_ms = |exchange: &Exchange| serial.map(|serial| ms(serial.line_time(exchange.bytes)));
    let exchanges = exchanges(press);
    let polls = exchanges.first().and_then(line_ms).map(|line| line / ms(press.link.poll));
    if common.json {
        let rows: Vec<_> = exchanges
            .iter()
            .map(|it| json!({ "what": it.what, "function": it.function, "registers": it.registers, "line_ms": line_ms(it) }))
            .collect();
        return Ok(output::json(&json!({
            "press": press.name, "press_id": press.press_id, "profile": press.map.profile.name(),
            "link": press.link.transport.to_string(), "unit": press.link.unit,
            "server": press.role == Role::Server, "writes": press.mode.writes(),
            "may_write": press.write.to_string(), "max_writes_per_s": press.write.max_writes_per_s,
            "counts_strokes": press.map.counts_strokes(), "poll_ms": ms(press.link.poll),
            "response_timeout_ms": ms(press.link.response_timeout), "quiet_ms": press.link.quiet().map(ms),
            "exchanges": rows, "line_used_by_polling": polls,
        }))?);
    }
    let role =
        if press.role == Role::Server { "is the client of the host, which listens on" } else { "is read at" };
    output::line(&format!("{} {role} {} unit {}", press.name, press.link.transport, press.link.unit))?;
    let writes = if press.mode.writes() {
        format!(
            "holding registers {} and no others, {} times a second at most",
            press.write, press.write.max_writes_per_s
        )
    } else {
        "nothing in this mode (listen, dry-run or off)".to_owned()
    };
    output::line(&format!("profile {}; writes {writes}", press.map.profile.name()))?;
    if !press.map.counts_strokes() {
        output::line("this press has no stroke counter: a missed stroke cannot be detected")?;
    }
    let rows = exchanges.iter().map(|it| {
        let line = line_ms(it).map_or_else(|| "-".into(), |ms| format!("{ms:.0} ms"));
        vec![it.what.into(), it.function.to_string(), it.registers.to_string(), line]
    });
    output::titled("exchange | function | registers | line", rows)?;
    output::line(&format!(
        "poll every {:.0} ms, answers within {:.0} ms{}",
        ms(press.link.poll),
        ms(press.link.response_timeout),
        press
            .link
            .quiet()
            .map_or(String::new(), |quiet| format!(", {:.0} ms of silence after a fault", ms(quiet)))
    ))?;
    if let Some(share) = polls.filter(|share| *share > 0.5) {
        output::line(&format!("polling takes {:.0} % of the line; raise poll_ms or baud", 100.0 * share))?;
    }
    Ok(())
}

/// Measures the round trips of one register and tries a second connection.
pub(super) fn ping(common: &Common, press: &Press, count: u32) -> Result<(), Failure> {
    let mut client = client(press)?;
    let one = Block { count: 1, ..press.map.read };
    let (connect, mut trips, second, identity) = runtime()?.block_on(async {
        let start = Instant::now();
        client.connect().await?;
        let connect = start.elapsed();
        let mut trips = Vec::new();
        for _ in 0..count {
            let sent = Instant::now();
            match client.read(&one, 1).await {
                // A refusal is timed as an answer.
                Ok(_) | Err(LinkError::Exception { .. }) => trips.push(sent.elapsed()),
                Err(error) => return Err(Failure::from(error)),
            }
        }
        let mut other = super::client(press)?;
        let second = match &press.link.transport {
            Transport::Tcp(_) | Transport::RtuOverTcp(..) => {
                Some(other.connect().await.is_ok() && other.read(&one, 1).await.is_ok())
            }
            Transport::Rtu(..) => None,
        };
        // Most controllers refuse identification, some drop the connection.
        let identity = client.identify().await.unwrap_or_default().join(", ");
        Ok((connect, trips, second, identity))
    })?;
    trips.sort_unstable();
    let ms = |time: Duration| time.as_secs_f64() * 1000.0;
    let at = |share: f64| ms(trips[((trips.len() - 1) as f64 * share).round() as usize]);
    let (least, median, most) = (at(0.0), at(0.5), at(1.0));
    if common.json {
        return Ok(output::json(&json!({
            "peer": client.peer(), "connect_ms": ms(connect), "reads": trips.len(),
            "least_ms": least, "median_ms": median, "most_ms": most, "second_connection": second, "identity": identity,
            "round_trip_limits_ms": ROUND_TRIP_LIMITS_MS, "round_trips": client.counts().round_trips,
        }))?);
    }
    output::line(&format!("{}: connected in {:.1} ms", client.peer(), ms(connect)))?;
    output::line(&format!(
        "{} reads: {least:.1} ms at least, median {median:.1} ms, {most:.1} ms at most",
        trips.len()
    ))?;
    if !identity.is_empty() {
        output::line(&format!("identification of the controller: {identity}"))?;
    }
    match second {
        Some(true) => output::line("a second connection is answered: tools may run beside the host")?,
        Some(false) => {
            output::line("a second connection is not answered: stop the host before using these tools")?
        }
        None => output::line("a serial line has one master: stop the host before using these tools")?,
    }
    if at(0.99) > ms(press.link.response_timeout) / 2.0 {
        output::line("the slowest answer took more than half of response_timeout_ms: raise it")?;
    }
    Ok(())
}

/// Reads one register of each unit id; exit code 0 if at least one answers.
pub(super) fn scan_units(common: &Common, press: &Press, units: &Units) -> Result<ExitCode, Failure> {
    let one = Block { count: 1, ..press.map.read };
    let mut found = Vec::new();
    let runtime = runtime()?;
    for unit in units.clone() {
        progress::phase(&format!("unit {unit}"));
        let mut press = press.clone();
        press.link.unit = unit;
        let mut client = client(&press)?;
        let answer = runtime.block_on(async {
            client.connect().await?;
            client.read(&one, 1).await
        });
        match answer {
            Ok(words) => found.push((unit, format!("register {} is {}", one.start, words[0]))),
            // Answers of a gateway for absent units.
            Err(LinkError::Exception { code: 0x0A | 0x0B, .. }) => {}
            Err(LinkError::Exception { code, .. }) => found.push((unit, format!("exception {code:02X}"))),
            Err(LinkError::Timeout { .. } | LinkError::Mismatch { .. } | LinkError::Broken { .. }) => {}
            Err(
                error @ (LinkError::Connect { .. }
                | LinkError::ConnectTimeout { .. }
                | LinkError::Refused { .. }),
            ) => {
                progress::done();
                return Err(error.into());
            }
        }
    }
    progress::done();
    if common.json {
        let rows: Vec<_> =
            found.iter().map(|(unit, answer)| json!({ "unit": unit, "says": answer })).collect();
        output::json(&json!({ "units": rows }))?;
    } else if found.is_empty() {
        output::line(&format!("no unit from {} to {} answers", units.start(), units.end()))?;
    } else {
        for (unit, answer) in &found {
            output::line(&format!("unit {unit} answers: {answer}"))?;
        }
    }
    Ok(ExitCode::from(u8::from(found.is_empty())))
}

#[cfg(test)]
mod tests {
    use super::*;
    use platen_plant::press::{Link, Serial};

    #[test]
    fn units_are_a_range_or_one() {
        assert_eq!(units("1..10"), Ok(1..=10));
        assert_eq!(units("1..=10"), Ok(1..=10));
        assert_eq!(units("7"), Ok(7..=7));
        assert!(units("1..300").is_err() && units("").is_err());
    }

    /// At 19200 baud: 8 registers are 29 characters of 11 bits, 16.6 ms; 64 written are 145, 83 ms.
    #[test]
    fn the_line_budget_counts_every_character() {
        let serial = Serial::new("/dev/ttyUSB0", 19_200);
        let press = Press::pph1("Press 3", 3, Link::rtu(serial.clone(), 1));
        let budget: Vec<_> = exchanges(&press).iter().map(|it| (it.registers, it.bytes)).collect();
        assert_eq!(budget, [(8, 29), (32, 77), (64, 141), (64, 145)]);
        assert!((serial.line_time(29).as_secs_f64() - 0.016_6).abs() < 1e-4);
    }
}
