//! Command `press`: a press on Modbus.

use crate::error::Error;
use crate::toml_file;
use clap::Args;
use platen_sim_press::config::LinkConfig;
use platen_sim_press::{Config, SimPress};
use std::io::Write;
use std::net::SocketAddr;
use std::path::PathBuf;
use tokio::signal::unix::{SignalKind, signal};

/// Options of the press; they override the file.
#[derive(Debug, Args)]
pub(crate) struct Command {
    /// Read press, plate and faults from this TOML file; default: a press with one 4 x 4 m plate
    config: Option<PathBuf>,
    /// Serve Modbus TCP on this port; 0 lets the system choose
    #[arg(long, value_name = "PORT")]
    modbus_port: Option<u16>,
    /// Serve the plate (control port) on this port; 0 lets the system choose
    #[arg(long, value_name = "PORT")]
    plate_port: Option<u16>,
    /// Limit the strokes per part
    #[arg(long)]
    strokes: Option<u32>,
    /// Set the seed of springback, sessions and faults
    #[arg(long)]
    seed: Option<u64>,
    /// End when standard input closes, so that the press does not outlive its parent process
    #[arg(long)]
    with_parent: bool,
}

impl Command {
    /// Returns the file's configuration with the options applied.
    fn config(&self) -> Result<Config, Error> {
        let mut config = self.config.as_deref().map_or_else(|| Ok(Config::default()), toml_file::read)?;
        if let Some(port) = self.modbus_port {
            config.link = LinkConfig::Tcp { port };
        }
        config.control_port = self.plate_port.unwrap_or(config.control_port);
        config.strokes = self.strokes.unwrap_or(config.strokes);
        if let Some(seed) = self.seed {
            config.seed = seed;
            config.plate.plan.seed = seed;
            config.plate.handling.seed = seed;
        }
        Ok(config)
    }
}

/// Runs the press until it is stopped.
pub(crate) async fn run(command: &Command) -> Result<(), Error> {
    let press = start(command).await?;
    announce(Some(&press), None)?;
    run_until_stopped(press, command).await
}

/// Starts the press.
pub(crate) async fn start(command: &Command) -> Result<SimPress, Error> {
    Ok(SimPress::start(command.config()?).await?)
}

/// Waits until the press ends or a stop is requested.
pub(crate) async fn run_until_stopped(mut press: SimPress, command: &Command) -> Result<(), Error> {
    tokio::select! {
        ended = press.ended() => ended?,
        stopped = stop_requested(command.with_parent) => stopped?,
    }
    if let Ok(counters) = serde_json::to_string(&press.counters()) {
        tracing::info!(%counters, "press stopped");
    }
    Ok(())
}

/// Waits for SIGTERM, Ctrl-C or, if requested, the end of standard input.
pub(crate) async fn stop_requested(with_parent: bool) -> Result<(), Error> {
    let mut terminate = signal(SignalKind::terminate())?;
    tokio::select! {
        _ = terminate.recv() => {}
        interrupted = tokio::signal::ctrl_c() => interrupted?,
        () = stdin_closed(), if with_parent => {}
    }
    Ok(())
}

/// Prints the addresses of the ports in one line. A press on a serial line has no Modbus port.
pub(crate) fn announce(press: Option<&SimPress>, scanner: Option<SocketAddr>) -> Result<(), Error> {
    let mut line = serde_json::Map::new();
    if let Some(press) = press {
        line.insert("modbus".into(), press.modbus().map(|address| address.to_string()).into());
        line.insert("plate".into(), press.control().to_string().into());
    }
    if let Some(scanner) = scanner {
        line.insert("scanner".into(), scanner.to_string().into());
    }
    let line = serde_json::Value::from(line);
    let mut out = std::io::stdout().lock();
    writeln!(out, "{line}")?;
    out.flush()?;
    Ok(())
}

/// Waits for the end of standard input, in a separate thread: the runtime could not end while one of its
/// threads reads it.
async fn stdin_closed() {
    let (closed, wait) = tokio::sync::oneshot::channel();
    std::thread::spawn(move || {
        let ended = std::io::copy(&mut std::io::stdin(), &mut std::io::sink());
        // An error means that the press has ended for another reason.
        let _ = closed.send(ended);
    });
    let _ = wait.await;
}
