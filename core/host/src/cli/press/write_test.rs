//! Command `write-test`: writes a pattern to each figure of the host's block, for comparison with the screen of the
//! press.
//!
//! Status, echoes, heartbeat and counters stay 0, so that no press accepts the pattern as a result. Every write is
//! checked against the allow-list. At the end all figures hold their "no value" word again.

use std::io::{BufRead, IsTerminal, Write};
use std::process::ExitCode;
use std::time::Duration;

use platen_model::{Figures, Measurement, Publication, StrokeKey, Verdict};
use platen_plant::press::{Mode, Output, Press};
use platen_press::{Client, HostImage, LinkError, ModbusLink, PressImage, describe_outputs};

use super::super::run::runtime;
use super::{CliError, Common, Failure, output};

use serde_json::json;

/// Time of the check for a running host: at least two heartbeats.
const WATCH: Duration = Duration::from_millis(1500);

struct Written {
    field: Output,
    shows: String,
    read_back: bool,
    confirmed: Option<bool>,
}

/// Runs the test; exit code 0 if every pattern was read back and none was rejected at the screen.
pub(super) fn run(common: &Common, press: &Press) -> Result<ExitCode, Failure> {
    let mut press = press.clone();
    if !press.mode.writes() {
        press.mode = Mode::Simulate;
    }
    let mut client = super::client(&press)?;
    let interactive = std::io::stdin().is_terminal() && !common.json;
    let runtime = runtime()?;
    runtime.block_on(alone(&press, &mut client))?;
    let mut written = Vec::new();
    for (step, field) in figures(&press).into_iter().enumerate() {
        let done = runtime.block_on(show(&press, &mut client, field, step))?;
        written.push(done);
        if let (true, Some(last)) = (interactive, written.last_mut()) {
            last.confirmed = Some(confirm(last)?);
        }
    }
    let blank = HostImage::default().encode(&press.map, 0);
    runtime.block_on(write(&press, &mut client, &blank))?;
    let good = written.iter().all(|it| it.read_back && it.confirmed != Some(false));
    if common.json {
        let row = |it: &Written| json!({ "field": it.field.name(), "shows": it.shows, "read_back": it.read_back, "confirmed": it.confirmed });
        output::json(&json!({ "fields": written.iter().map(row).collect::<Vec<_>>(), "good": good }))?;
    } else {
        let yes = |it: bool| if it { "yes" } else { "NO" }.to_owned();
        let rows = written.iter().map(|it| {
            let confirmed = it.confirmed.map_or_else(|| "-".into(), yes);
            vec![it.field.name().into(), it.shows.clone(), yes(it.read_back), confirmed]
        });
        output::titled("field | written | read back | on the screen", rows)?;
    }
    Ok(ExitCode::from(u8::from(!good)))
}

/// Returns the fields that hold a figure, in the order of their registers.
fn figures(press: &Press) -> Vec<Output> {
    let holds = |output: &Output| output.measure().is_some() || *output == Output::Station;
    let mut figures: Vec<_> = press.map.outputs.keys().copied().filter(holds).collect();
    figures.sort_by_key(|output| press.map.output(*output).and_then(|field| field.place.offset()));
    figures
}

/// Returns a result in which only this field has a figure; the figure differs in every step.
fn image(press: &Press, field: Output, step: usize) -> HostImage {
    let Some(place) = press.map.output(field) else { return HostImage::default() };
    let raw = (11 * (step + 1)) as f64;
    let number = |index: u16| (raw + f64::from(index)) * place.scale * place.unit.factor();
    let figures = match place.from.or(field.measure()) {
        Some(measure) => Figures { values: [(measure, number(0))].into(), stations: Vec::new() },
        None => Figures {
            values: Default::default(),
            stations: (0..place.count).map(|index| Some(number(index))).collect(),
        },
    };
    let measurement =
        Measurement { judgement: Verdict::CannotTell.into(), figures, scanned_at: None, warning: None };
    let key = StrokeKey { press: press.press_id, session: 0, stroke: 0, attempt: 0 };
    let result = Publication { key, run_id: 0, seq: 0, recipe_id: None, measurement };
    HostImage { result: Some(result), ..HostImage::default() }
}

/// Connects; refuses a press other than the plant file's.
async fn reach(press: &Press, client: &mut Client<ModbusLink>) -> Result<(), Failure> {
    client.connect().await?;
    let words = client.read(&press.map.read, press.map.read.count).await?;
    match PressImage::decode(&press.map, press.press_id, &words).map(|image| image.wrong) {
        Ok(Some(wrong)) => Err(Failure::Handshake(format!(
            "{}: {} is {}, the plant file has {}: is this the right press?",
            client.peer(),
            wrong.input,
            wrong.found,
            wrong.expected
        ))),
        Ok(None) | Err(_) => Ok(()),
    }
}

/// Refuses to write to a press to which a host is writing.
async fn alone(press: &Press, client: &mut Client<ModbusLink>) -> Result<(), Failure> {
    reach(press, client).await?;
    let block = press.map.write;
    let before = client.read(&block, block.count).await?;
    tokio::time::sleep(WATCH).await;
    if client.read(&block, block.count).await? != before {
        let text = "a host is writing to this press: stop it before a write-test";
        return Err(CliError::Failed(text.into()).into());
    }
    Ok(())
}

async fn write(press: &Press, client: &mut Client<ModbusLink>, words: &[u16]) -> Result<(), LinkError> {
    let block = press.map.write;
    for range in press.write.ranges() {
        let start = u32::from(*range.start()).max(block.addresses().start);
        let end = (u32::from(*range.end()) + 1).min(block.addresses().end);
        if start < end {
            let offsets =
                (start - block.addresses().start) as usize..(end - block.addresses().start) as usize;
            client.guarded_write(start as u16, &words[offsets]).await?;
        }
    }
    Ok(())
}

async fn show(
    press: &Press,
    client: &mut Client<ModbusLink>,
    field: Output,
    step: usize,
) -> Result<Written, Failure> {
    if !client.connected() {
        reach(press, client).await?;
    }
    let words = image(press, field, step).encode(&press.map, 0);
    write(press, client, &words).await?;
    let block = press.map.write;
    let found = client.read(&block, block.count).await?;
    let value = |words: &[u16]| {
        let mut outputs = describe_outputs(&press.map, words).into_iter();
        outputs.find(|(name, _)| *name == field).map(|(_, value)| value)
    };
    let shows = value(&words).unwrap_or_default();
    Ok(Written { field, read_back: value(&found).as_ref() == Some(&shows), shows, confirmed: None })
}

fn confirm(written: &Written) -> Result<bool, CliError> {
    let mut terminal = std::io::stderr();
    write!(terminal, "{} = {}: does the press show it? [Y/n] ", written.field, written.shows)?;
    terminal.flush()?;
    let mut answer = String::new();
    std::io::stdin().lock().read_line(&mut answer)?;
    Ok(!answer.trim().eq_ignore_ascii_case("n"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use platen_plant::press::Link;

    /// Checks that no pattern is a valid result: status, echoes, sequence and owner are 0 in every step.
    #[test]
    fn a_pattern_is_never_a_result() {
        let press = Press::pph1("Press 3", 3, Link::tcp("192.0.2.10", 502, 1));
        let blank = HostImage::default().encode(&press.map, 0);
        let fields = figures(&press);
        assert!(fields.len() > 15, "{fields:?}");
        for (step, field) in fields.into_iter().enumerate() {
            let words = image(&press, field, step).encode(&press.map, 0);
            assert_eq!(words[1..10], [0; 9], "{field}");
            assert_eq!(words[49], 0, "{field}");
            let changed = words.iter().zip(&blank).filter(|(a, b)| a != b).count();
            let place = press.map.output(field).unwrap();
            assert!(
                changed <= usize::from(place.registers()) + 1,
                "{field}: its registers and the check sum"
            );
            assert!(changed >= 2, "{field}");
        }
    }
}
