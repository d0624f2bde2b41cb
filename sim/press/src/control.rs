//! Control port: line-delimited JSON for the simulated scanner, tests and instructors.
//!
//! | line | answer |
//! |---|---|
//! | `{"get":"plate"}` | `{"plate":{...}}`, `{"plate":null}` when the press is empty, `{"error":"..."}` while the plate moves |
//! | `{"get":"stats"}` | `{"stats":{...}}`, the [`crate::counters::Counters`] |
//! | `{"get":"counts"}` | `{"counts":{...}}`, the same without the list of accepted results, whose number is `results` |
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
use crate::driven_ram::OrderedStroke;
use crate::faults::{LineFaults, StrokeFaults};
use crate::program::Cause;
use crate::shared::{Machine, Shared};

/// Command of a test or an instructor.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Command {
    /// Makes the next bend at once, whatever the state of the host.
    Stroke,
    /// Orders the next stroke of the strategy `operator`.
    Order(OrderedStroke),
    /// Requests a scan without a bend.
    Baseline,
    /// Requests another scan of the last stroke.
    Rescan,
    /// Ends the part.
    PartEnd,
    /// Starts a new session with the stroke counter at 0.
    NewSession,
    /// Sets the stroke counter within the session.
    Counter(u16),
    /// Switches automatic strokes on or off.
    Automatic(bool),
    /// Forces control bits to 1.
    Force(u16),
    /// Forces control bits to 0.
    Mask(u16),
    /// Changes the plant number, as if the cable led to another press.
    PressId(u16),
    /// Changes the map version.
    MapVersion(u16),
    /// Restarts the controller: resets connections, clears registers, then starts a new session.
    Restart,
    /// Freezes the registers for this time in milliseconds while reads are answered.
    HaltMs(u64),
    /// Holds back all answers for this time in milliseconds.
    FreezeMs(u64),
    /// Resets all connections.
    Cut,
    /// Unplugs the serial adapter; it returns after this time in milliseconds under another name.
    PullMs(u64),
    /// Replaces the faults of the line.
    LineFaults(LineFaults),
    /// Replaces the faults of the program from the next stroke on.
    StrokeFaults(StrokeFaults),
    /// Stops the press.
    Stop,
}

/// Request of a client, one line.
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

/// Accepts clients until the process ends.
pub(crate) async fn serve(listener: TcpListener, shared: Arc<Shared>) {
    loop {
        match listener.accept().await {
            Ok((client, _)) => {
                let shared = Arc::clone(&shared);
                tokio::spawn(async move {
                    let ended = serve_client(client, &shared).await;
                    tracing::debug!(?ended, "control client disconnected");
                });
            }
            Err(error) => {
                tracing::debug!(%error, "control port: connection not accepted");
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
        let mut reply = answer(&line, shared).await.to_string();
        reply.push('\n');
        writer.write_all(reply.as_bytes()).await?;
    }
    Ok(())
}

/// Returns the answer to one line; to a command when the registers show it.
async fn answer(line: &str, shared: &Shared) -> serde_json::Value {
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
        Ok(Line::Do(command)) => {
            let executed = execute(command, shared);
            shared.next_cycle().await;
            Ok(executed
                .map_or_else(|refused| error(refused.to_string()), |()| serde_json::json!({ "ok": true })))
        }
        Err(invalid) => Ok(error(format!("{invalid}; write for example {{\"get\":\"plate\"}}"))),
    };
    answered.unwrap_or_else(|unwritable| error(unwritable.to_string()))
}

/// Executes one command.
pub(crate) fn execute(command: Command, shared: &Shared) -> Result<()> {
    let mut machine = shared.machine();
    let now = shared.now();
    let Machine { press, table } = &mut *machine;
    match command {
        Command::Stroke => press.stroke(now)?,
        Command::Order(order) => press.order(&order)?,
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
