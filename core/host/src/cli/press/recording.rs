//! Commands `record` and `replay`: changes of both blocks as JSON lines, and a replay of them to the handshake.
//!
//! A line is a read with changed contents. It has `t_mono_us` since the start, `t_utc`, `dir` (read), `unit`, `fc`,
//! `addr` and `words`; instead of the words a failed read has `exception` or `error`.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use platen_plant::press::{Block, Press, RegisterTable};
use platen_press::{Client, LinkError, ModbusLink, Sample, Side};

use super::super::run::{runtime, stop_signal};
use super::{CliError, Common, Failure, output};
use crate::progress;

use serde::{Deserialize, Serialize};
use serde_json::json;

/// Read with changed contents, or a failed one.
#[derive(Debug, Serialize, Deserialize)]
struct Line {
    t_mono_us: u64,
    t_utc: jiff::Timestamp,
    dir: String,
    unit: u8,
    fc: u8,
    addr: u16,
    #[serde(skip_serializing_if = "Option::is_none", default)]
    words: Option<Vec<u16>>,
    #[serde(skip_serializing_if = "Option::is_none", default)]
    exception: Option<u8>,
    #[serde(skip_serializing_if = "Option::is_none", default)]
    error: Option<String>,
}

impl Line {
    fn new(press: &Press, block: &Block, start: Instant, read: Result<Vec<u16>, LinkError>) -> Self {
        let (words, exception, error) = match read {
            Ok(words) => (Some(words), None, None),
            Err(LinkError::Exception { code, .. }) => (None, Some(code), None),
            Err(error) => (None, None, Some(error.to_string())),
        };
        Self {
            t_mono_us: u64::try_from(start.elapsed().as_micros()).unwrap_or(u64::MAX),
            t_utc: jiff::Timestamp::now(),
            dir: "read".into(),
            unit: press.link.unit,
            fc: if block.table == RegisterTable::Holding { 3 } else { 4 },
            addr: block.start,
            words,
            exception,
            error,
        }
    }

    fn repeats(&self, other: &Self) -> bool {
        (&self.words, self.exception, &self.error) == (&other.words, other.exception, &other.error)
    }
}

pub(super) fn record(
    common: &Common,
    press: &Press,
    file: &Path,
    for_time: Option<Duration>,
) -> Result<(), Failure> {
    let mut client = super::client(press)?;
    let refused = |error: std::io::Error| CliError::Failed(format!("{}: {error}", file.display()));
    let mut out = std::io::BufWriter::new(std::fs::File::create(file).map_err(refused)?);
    let (start, mut lines) = (Instant::now(), 0u64);
    runtime()?.block_on(async {
        let mut stop = stop_signal()?;
        let mut last: [Option<Line>; 2] = [None, None];
        while for_time.is_none_or(|limit| start.elapsed() < limit) {
            for (block, last) in [press.map.read, press.map.write].iter().zip(&mut last) {
                let line = Line::new(press, block, start, look(&mut client, block).await);
                if last.as_ref().is_some_and(|last| last.repeats(&line)) {
                    continue;
                }
                let text = serde_json::to_string(&line).map_err(std::io::Error::other)?;
                writeln!(out, "{text}").and_then(|()| out.flush()).map_err(refused)?;
                lines += 1;
                progress::phase(&format!("{lines} lines"));
                *last = Some(line);
            }
            tokio::select! {
                () = tokio::time::sleep(press.link.poll) => {}
                _ = stop.changed() => break,
            }
        }
        Ok::<_, CliError>(())
    })?;
    progress::done();
    let seconds = start.elapsed().as_secs_f64();
    let text = format!("{}: {lines} lines in {seconds:.0} s", file.display());
    Ok(output::either(common, &json!({ "file": file, "lines": lines, "seconds": seconds }), &text)?)
}

async fn look(client: &mut Client<ModbusLink>, block: &Block) -> Result<Vec<u16>, LinkError> {
    if !client.connected() {
        client.connect().await?;
    }
    client.read(block, block.count).await
}

/// Reads the blocks of a recording.
///
/// # Errors
/// A faulty line, with its number.
fn load(press: &Press, file: &Path) -> Result<Vec<Sample>, CliError> {
    let unreadable = |error: std::io::Error| CliError::Usage(format!("{}: {error}", file.display()));
    let lines = BufReader::new(std::fs::File::open(file).map_err(unreadable)?).lines();
    let mut samples = Vec::new();
    for (number, line) in (1..).zip(lines) {
        let place = |what: String| CliError::Usage(format!("{}:{number}: {what}", file.display()));
        let line: Line =
            serde_json::from_str(&line.map_err(unreadable)?).map_err(|error| place(error.to_string()))?;
        let Some(words) = line.words else { continue };
        let side = match line.addr {
            addr if addr == press.map.read.start => Side::Press,
            addr if addr == press.map.write.start => Side::Host,
            addr => return Err(place(format!("no block of this plant file starts at {addr}"))),
        };
        samples.push(Sample { at: Duration::from_micros(line.t_mono_us), side, words });
    }
    Ok(samples)
}

/// Replays a recording; exit code 0 when the handshake accepts the strokes that the recorded host accepted.
pub(super) fn replay(common: &Common, press: &Press, file: &Path) -> Result<ExitCode, Failure> {
    let samples = load(press, file)?;
    let replayed = platen_press::replay(press, &samples);
    let name = |&(session, stroke): &(u16, u16)| format!("{session}/{stroke}");
    let names = |strokes: &[(u16, u16)]| strokes.iter().map(name).collect::<Vec<_>>();
    if common.json {
        let transitions = replayed.transitions.iter().map(|(at, transition, stroke)| {
            json!({ "at_s": at.as_secs_f64(), "transition": format!("{transition:?}"), "stroke": stroke })
        });
        let alarms =
            replayed.alarms.iter().map(|(at, code)| json!({ "at_s": at.as_secs_f64(), "code": code }));
        output::json(&json!({
            "samples": samples.len(), "accepted": names(&replayed.accepted), "recorded": names(&replayed.recorded),
            "missed": replayed.missed, "torn": replayed.torn, "agrees": replayed.agrees(),
            "transitions": transitions.collect::<Vec<_>>(), "alarms": alarms.collect::<Vec<_>>(),
        }))?;
        return Ok(ExitCode::from(u8::from(!replayed.agrees())));
    }
    for (at, transition, stroke) in &replayed.transitions {
        let stroke = stroke.map_or(String::new(), |key| format!("  {key}"));
        output::line(&format!("{:9.3} s  {transition:?}{stroke}", at.as_secs_f64()))?;
    }
    for (at, code) in &replayed.alarms {
        output::line(&format!("{:9.3} s  alarm {code}", at.as_secs_f64()))?;
    }
    output::line(&format!(
        "{} strokes accepted, {} missed, {} torn reads",
        replayed.accepted.len(),
        replayed.missed,
        replayed.torn
    ))?;
    if replayed.recorded.is_empty() {
        output::line("this recording has no answers of a host")?;
    } else if replayed.agrees() {
        output::line("the recorded host accepted the same strokes")?;
    } else {
        let (now, then) = (names(&replayed.accepted).join(" "), names(&replayed.recorded).join(" "));
        output::line(&format!("the recorded host accepted others\n  now:  {now}\n  then: {then}"))?;
    }
    Ok(ExitCode::from(u8::from(!replayed.agrees())))
}
