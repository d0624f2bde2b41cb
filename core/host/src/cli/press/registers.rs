//! Commands `dump`, `watch` and `probe-order`: contents of the registers.

use std::process::ExitCode;
use std::time::Instant;

use platen_plant::press::{Block, Press, RegisterTable};
use platen_press::{Client, LinkError, ModbusLink, Reading, describe_inputs, describe_outputs, readings};

use super::super::run::{runtime, stop_signal};
use super::{CliError, Common, Failure, output};

use serde_json::{Map, Value as Json, json};

/// Registers in one read of a range: few, so that a missing one hides few others.
const CHUNK: u32 = 8;

/// Zero-based addresses, the end excluded.
pub(super) type Range = std::ops::Range<u32>;

/// Parses `0..200`.
pub(super) fn range(text: &str) -> Result<Range, String> {
    let wrong = || format!("`{text}` is no range of registers; write 0..200");
    let (first, end) = text.split_once("..").ok_or_else(wrong)?;
    let number = |text: &str| text.parse::<u32>().ok().filter(|&n| n <= 65_536).ok_or_else(wrong);
    let range = number(first)?..number(end)?;
    if range.is_empty() { Err(wrong()) } else { Ok(range) }
}

pub(super) struct Blocks {
    pub(super) press: Vec<u16>,
    pub(super) host: Vec<u16>,
}

pub(super) async fn read(press: &Press, client: &mut Client<ModbusLink>) -> Result<Blocks, LinkError> {
    if !client.connected() {
        client.connect().await?;
    }
    let (p, h) = (&press.map.read, &press.map.write);
    Ok(Blocks { press: client.read(p, p.count).await?, host: client.read(h, h.count).await? })
}

/// Returns side, name and value of the fields of both blocks, the press's first.
fn fields(press: &Press, blocks: &Blocks) -> Vec<(&'static str, String, String)> {
    let inputs = describe_inputs(&press.map, &blocks.press).into_iter();
    let outputs = describe_outputs(&press.map, &blocks.host).into_iter();
    let inputs = inputs.map(|(name, value)| ("press", name.to_string(), value));
    inputs.chain(outputs.map(|(name, value)| ("host", name.to_string(), value))).collect()
}

fn raw(block: &Block, words: &[u16]) -> Vec<(u16, u16)> {
    (block.start..).zip(words.iter().copied()).collect()
}

pub(super) fn dump(
    common: &Common,
    press: &Press,
    as_words: bool,
    range: Option<&Range>,
) -> Result<(), Failure> {
    let mut client = super::client(press)?;
    if let Some(range) = range {
        let words = runtime()?.block_on(read_range(&mut client, range.clone()))?;
        return dump_range(common, range, &words);
    }
    let blocks = runtime()?.block_on(read(press, &mut client))?;
    if common.json {
        let mut named = Map::new();
        for (side, name, value) in fields(press, &blocks) {
            let side = named.entry(side).or_insert_with(|| json!({}));
            side[name] = Json::String(value);
        }
        return Ok(output::json(&json!({
            "fields": named,
            "words": { "press": raw(&press.map.read, &blocks.press), "host": raw(&press.map.write, &blocks.host) },
        }))?);
    }
    if as_words {
        let row = |side: &'static str| {
            move |(address, word): (u16, u16)| {
                vec![side.to_owned(), address.to_string(), word.to_string(), format!("{word:04X}")]
            }
        };
        let inputs = raw(&press.map.read, &blocks.press).into_iter().map(row("press"));
        let outputs = raw(&press.map.write, &blocks.host).into_iter().map(row("host"));
        return Ok(output::titled("block | address | word | hex", inputs.chain(outputs))?);
    }
    let rows =
        fields(press, &blocks).into_iter().map(|(side, name, value)| vec![side.to_owned(), name, value]);
    Ok(output::titled("block | field | value", rows)?)
}

/// Reads any holding registers; if the press refuses a chunk, its registers are read one by one.
async fn read_range(client: &mut Client<ModbusLink>, range: Range) -> Result<Vec<(u32, u16)>, LinkError> {
    client.connect().await?;
    let mut words = Vec::new();
    let mut at = range.start;
    while at < range.end {
        let mut count = CHUNK.min(range.end - at);
        let found = match holding(client, at, count).await {
            Err(LinkError::Exception { .. }) if count > 1 => {
                count = 1;
                holding(client, at, 1).await
            }
            other => other,
        };
        match found {
            Ok(found) => words.extend((at..).zip(found)),
            Err(LinkError::Exception { .. }) => {}
            Err(error) => return Err(error),
        }
        at += count;
    }
    Ok(words)
}

async fn holding(client: &mut Client<ModbusLink>, start: u32, count: u32) -> Result<Vec<u16>, LinkError> {
    // Both fit: ranges end at 65536, chunks are short.
    let block = Block { table: RegisterTable::Holding, start: start as u16, count: count as u16 };
    client.read(&block, block.count).await
}

fn dump_range(common: &Common, range: &Range, words: &[(u32, u16)]) -> Result<(), Failure> {
    if common.json {
        return Ok(output::json(&json!({ "words": words }))?);
    }
    let row =
        |(address, word): &(u32, u16)| vec![address.to_string(), word.to_string(), format!("{word:04X}")];
    output::titled("address | word | hex", words.iter().map(row))?;
    let refused = range.len() - words.len();
    if refused > 0 {
        output::line(&format!("the press refused {refused} registers"))?;
    }
    Ok(())
}

pub(super) fn watch(common: &Common, press: &Press) -> Result<(), Failure> {
    let mut client = super::client(press)?;
    let start = Instant::now();
    let mut shown: Vec<(&str, String, String)> = Vec::new();
    let watched: Result<(), CliError> = runtime()?.block_on(async {
        let mut stop = stop_signal()?;
        loop {
            match read(press, &mut client).await {
                Ok(blocks) => {
                    let now = fields(press, &blocks);
                    for (side, name, value) in now.iter().filter(|field| !shown.contains(field)) {
                        let at_s = start.elapsed().as_secs_f64();
                        let line = if common.json {
                            json!({ "at_s": at_s, "block": side, "field": name, "value": value }).to_string()
                        } else {
                            format!("{at_s:9.3} s  {side:5}  {name} = {value}")
                        };
                        output::line(&line)?;
                    }
                    shown = now;
                }
                Err(error) => output::error(&error.to_string()),
            }
            tokio::select! {
                () = tokio::time::sleep(press.link.poll) => {}
                _ = stop.changed() => return Ok(()),
            }
        }
    });
    Ok(watched?)
}

/// Searches a number in all word orders at an address and its neighbours; exit code 0 when one reading is that number.
pub(super) fn probe_order(common: &Common, press: &Press, at: u16, expect: f64) -> Result<ExitCode, Failure> {
    let mut client = super::client(press)?;
    let around = runtime()?.block_on(async {
        client.connect().await?;
        let first = u32::from(at).saturating_sub(1);
        let words = read_words(&mut client, first, u32::from(at) + 3).await?;
        Ok::<_, LinkError>(if at == 0 { [&[0][..], &words].concat() } else { words })
    })?;
    let all: Vec<Reading> = readings(&around).into_iter().filter(|it| at > 0 || it.shift >= 0).collect();
    let right: Vec<&Reading> = all.iter().filter(|reading| reading.is(expect)).collect();
    let address = |reading: &Reading| i32::from(at) + i32::from(reading.shift);
    if common.json {
        let row = |it: &Reading| {
            json!({ "address": address(it), "type": it.kind.name(), "order": it.order.name(), "words": it.words,
                    "number": it.number, "match": it.is(expect) })
        };
        output::json(&json!({ "expect": expect, "readings": all.iter().map(row).collect::<Vec<_>>() }))?;
        return Ok(ExitCode::from(u8::from(right.is_empty())));
    }
    let rows = all.iter().map(|it| {
        let [a, b] = it.words;
        let (words, number) = (format!("{a:04X} {b:04X}"), format!("{:.6}", it.number));
        let sign = if it.is(expect) { "<- match" } else { "" };
        vec![
            address(it).to_string(),
            words,
            it.kind.name().into(),
            it.order.name().into(),
            number,
            sign.into(),
        ]
    });
    output::titled("address | words | type | order | number | ", rows)?;
    let counted_from = press.map.address_base.first(RegisterTable::Holding) as i32;
    for it in &right {
        output::line(&format!(
            "in the plant file: {{ at = \"@{}\", type = \"{}\", order = \"{}\" }}",
            counted_from + address(it),
            it.kind.name(),
            it.order.name()
        ))?;
    }
    if right.is_empty() {
        output::line(&format!("{expect} is not found at {at} or beside it in any order"))?;
    }
    Ok(ExitCode::from(u8::from(right.is_empty())))
}

/// Reads the registers from `first`, fewer where the table ends before `end`.
async fn read_words(client: &mut Client<ModbusLink>, first: u32, end: u32) -> Result<Vec<u16>, LinkError> {
    let mut words = Vec::new();
    for address in first..end.min(65_536) {
        match holding(client, address, 1).await {
            Ok(word) => words.extend(word),
            Err(LinkError::Exception { .. }) if !words.is_empty() => break,
            Err(error) => return Err(error),
        }
    }
    Ok(words)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_zero_based_and_not_empty() {
        assert_eq!(range("0..200"), Ok(0..200));
        assert_eq!(range("65535..65536"), Ok(65_535..65_536));
        for wrong in ["200", "5..5", "9..3", "0..65537", "a..b"] {
            assert!(range(wrong).is_err(), "{wrong}");
        }
    }
}
