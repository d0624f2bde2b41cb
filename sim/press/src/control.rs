//! The second port: line-delimited JSON for whoever wants to know about the plate and for tests.
//!
//! | line | answer |
//! |---|---|
//! | `{"get":"plate"}` | `{"plate":{...}}`, `{"plate":null}` when no plate lies in the press, `{"error":"..."}` while it moves |
//! | `{"get":"stats"}` | `{"stats":{...}}`, a [`crate::counters::Counters`] |
//! | `{"get":"counts"}` | `{"counts":{...}}`, the same without the results taken, whose number is `results` |
//! | `{"get":"registers"}` | `{"registers":{"p":[..],"h":[..]}}` |
//! | `{"do":"stroke"}`, `{"do":{"counter":65530}}`, any [`Command`] | `{"ok":true}` or `{"error":"..."}` |

use std::io;
use std::sync::Arc;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tokio::io::{AsyncBufReadExt, AsyncWriteExt, BufReader};
use tokio::net::{TcpListener, TcpStream};
use tokio::time::Instant;

use crate::Result;
use crate::faults::{LineFaults, StrokeFaults};
use crate::program::Cause;
use crate::shared::{Machine, Shared};

/// What a test, or an instructor, can have the press do.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Command {
    /// The next bend at once, whatever the host is doing.
    Stroke,
    /// A scan of the plate as it lies.
    Baseline,
    /// The last stroke again.
    Rescan,
    /// The part leaves.
    PartEnd,
    /// A new session; the counter starts again from 0.
    NewSession,
    /// The last stroke number, within the session.
    Counter(u16),
    /// Strokes by themselves, or only on request.
    Automatic(bool),
    /// Control bits held up, whatever the program does.
    Force(u16),
    /// Control bits held down.
    Mask(u16),
    /// Another plant number, as if the cable led to another press.
    PressId(u16),
    /// Another map version.
    MapVersion(u16),
    /// Connections reset, registers 0, then a new session.
    Restart,
    /// The registers stand still for so many milliseconds, while reads are answered.
    HaltMs(u64),
    /// Nothing is answered for so many milliseconds; then everything.
    FreezeMs(u64),
    /// All connections are reset.
    Cut,
    /// The serial adapter is pulled and comes back after so many milliseconds, under another name.
    PullMs(u64),
    /// Faults of the line from now on.
    LineFaults(LineFaults),
    /// Faults of the program from the next stroke on.
    StrokeFaults(StrokeFaults),
    /// The press ends.
    Stop,
}

/// One line from a client.
#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum Line {
    Get(Get),
    Do(Command),
}

#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum Get {
    Plate,
    Stats,
    Counts,
    Registers,
}

/// Accepts clients for ever.
pub(crate) async fn serve(listener: TcpListener, shared: Arc<Shared>) {
    loop {
        match listener.accept().await {
            Ok((client, _)) => {
                let shared = Arc::clone(&shared);
                tokio::spawn(async move {
                    let ended = serve_client(client, &shared).await;
                    tracing::debug!(?ended, "control client left");
                });
            }
            Err(error) => {
                tracing::debug!(%error, "control port");
                tokio::time::sleep(Duration::from_millis(50)).await;
            }
        }
    }
}

async fn serve_client(client: TcpStream, shared: &Shared) -> io::Result<()> {
    client.set_nodelay(true)?;
    let (reader, mut writer) = client.into_split();
    let mut lines = BufReader::new(reader).lines();
    while let Some(line) = lines.next_line().await? {
        let mut reply = answer(&line, shared).to_string();
        reply.push('\n');
        writer.write_all(reply.as_bytes()).await?;
    }
    Ok(())
}

/// The answer to one line.
fn answer(line: &str, shared: &Shared) -> serde_json::Value {
    let error = |text: String| serde_json::json!({ "error": text });
    let answered = match serde_json::from_str(line) {
        Ok(Line::Get(Get::Plate)) => {
            let press = &mut shared.machine().press;
            press.counters.plates_served += 1;
            serde_json::to_value(press.plate())
        }
        Ok(Line::Get(Get::Stats)) => serde_json::to_value(&shared.machine().press.counters)
            .map(|counters| serde_json::json!({ "stats": counters })),
        Ok(Line::Get(Get::Counts)) => {
            let (counters, results) = shared.machine().press.counters.counts();
            serde_json::to_value(&counters).map(|mut counts| {
                counts["results"] = results.into();
                serde_json::json!({ "counts": counts })
            })
        }
        Ok(Line::Get(Get::Registers)) => {
            let machine = shared.machine();
            let (p, h) = (machine.table.p_block(), machine.table.h_block().0.to_vec());
            Ok(serde_json::json!({ "registers": { "p": p, "h": h } }))
        }
        Ok(Line::Do(command)) => match execute(command, shared) {
            Ok(()) => Ok(serde_json::json!({ "ok": true })),
            Err(refused) => Ok(error(refused.to_string())),
        },
        Err(misread) => Ok(error(format!("{misread}; ask {{\"get\":\"plate\"}}"))),
    };
    answered.unwrap_or_else(|unwritable| error(unwritable.to_string()))
}

/// Carries out one command.
pub(crate) fn execute(command: Command, shared: &Shared) -> Result<()> {
    let now = shared.now();
    let mut machine = shared.machine();
    let Machine { press, table } = &mut *machine;
    match command {
        Command::Stroke => press.stroke(now)?,
        Command::Baseline => press.request(Cause::Baseline, now)?,
        Command::Rescan => press.request(Cause::Rescan, now)?,
        Command::PartEnd => press.end_part(now),
        Command::NewSession => press.new_session(0),
        Command::Counter(stroke_id) => press.set_counter(stroke_id),
        Command::Automatic(automatic) => press.automatic = automatic,
        Command::Force(bits) => press.forced = bits,
        Command::Mask(bits) => press.masked = bits,
        Command::PressId(press_id) => press.set_identity(Some(press_id), None),
        Command::MapVersion(version) => press.set_identity(None, Some(version)),
        Command::Restart => {
            press.restart(table, now);
            drop(machine);
            shared.cut();
        }
        Command::HaltMs(ms) => press.halted_until = Some(now + Duration::from_millis(ms)),
        Command::FreezeMs(ms) => {
            shared.line().frozen_until = Some(Instant::now() + Duration::from_millis(ms));
        }
        Command::Cut => shared.cut(),
        Command::PullMs(ms) => {
            shared.line().pulled_until = Some(Instant::now() + Duration::from_millis(ms));
            shared.cut();
        }
        Command::LineFaults(faults) => shared.line().faults = faults,
        Command::StrokeFaults(faults) => press.set_stroke_faults(faults),
        Command::Stop => {
            shared.stop.send_replace(true);
        }
    }
    Ok(())
}
