//! Simulated plate press as a Modbus server.
//!
//! The press serves the register map PPH-1 over Modbus TCP ("MODBUS Messaging on TCP/IP Implementation Guide V1.0b"),
//! RTU framing over TCP, or RTU on a serial line. The services follow the "MODBUS Application Protocol V1.1b3". Its
//! program ([`program::Program`]) is the press side of the handshake, executed cyclically as in a PLC. Each stroke
//! bends a simulated plate ([`forming_model::FormingModel`]), which is served on a second port ([`control`]) to the
//! simulated scanner. [`counters::Counters`] record the behaviour of the host as observed by the press; tests assert on
//! them. [`faults`] lists the faults that can be injected.
//!
//! **Invariants.** No code is shared with the host: registers, checksum, handshake and framing are written a second
//! time from their specification. [`press::Press::step`] reads no clock and no socket. Equal seeds give equal faults.
//!
//! ```no_run
//! # async fn example() -> Result<(), platen_sim_press::Error> {
//! use platen_sim_press::{Config, SimPress};
//! use std::time::Duration;
//!
//! let press = SimPress::start(Config { strokes: 5, ..Config::default() }).await?;
//! println!("Modbus at {:?}, plate at {}", press.modbus(), press.control());
//! let counters = press.until("all strokes", Duration::from_secs(60), |counters| counters.done).await?;
//! assert_eq!(counters.writes_outside, 0);
//! # Ok(())
//! # }
//! ```

mod answer_faults;
pub mod config;
pub mod control;
pub mod counters;
pub mod driven_ram;
mod error;
pub mod faults;
pub mod forming_model;
pub mod frame;
mod modbus_relay;
pub mod press;
pub mod program;
mod pty;
pub mod registers;
mod server;
mod shared;

use std::net::SocketAddr;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use tokio::net::TcpListener;
use tokio::task::JoinSet;
use tokio::time::MissedTickBehavior;

pub use config::Config;
pub use control::Command;
pub use counters::Counters;
pub use error::Error;
pub use program::Cause;
pub use registers::HBlock;

use config::LinkConfig;
use frame::Framing;
use shared::Shared;

/// Result of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Running press; dropping it stops it.
#[derive(Debug)]
pub struct SimPress {
    shared: Arc<Shared>,
    modbus: Option<SocketAddr>,
    control: SocketAddr,
    tasks: JoinSet<Result<()>>,
}

impl SimPress {
    /// Opens the ports and starts the program.
    ///
    /// # Errors
    /// [`Error::Config`], [`Error::Plate`], and [`Error::Listen`] or [`Error::Serial`] when a port is unavailable.
    pub async fn start(config: Config) -> Result<Self> {
        let shared = Arc::new(Shared::new(&config)?);
        // The registers contain the map before a client can read them.
        shared.cycle()?;
        let mut tasks = JoinSet::new();
        let (private, server) = listen(SocketAddr::from(([127, 0, 0, 1], 0))).await?;
        tasks.spawn(forever(server::serve(private, config.unit, Arc::clone(&shared))));
        let modbus = match &config.link {
            LinkConfig::Tcp { port } | LinkConfig::RtuOverTcp { port } => {
                let framing =
                    if matches!(config.link, LinkConfig::Tcp { .. }) { Framing::Tcp } else { Framing::Rtu };
                let (listener, address) = listen(SocketAddr::new(config.bind, *port)).await?;
                tasks.spawn(forever(modbus_relay::serve_tcp(
                    listener,
                    framing,
                    config.unit,
                    server,
                    Arc::clone(&shared),
                )));
                Some(address)
            }
            LinkConfig::Rtu { device, baud } => {
                let (name, baud) = (device.display().to_string(), *baud);
                let open = move || modbus_relay::open_serial(&name, baud);
                let first = open().map_err(|source| serial_error(device, source))?;
                let serve = modbus_relay::serve_serial(first, open, config.unit, server, Arc::clone(&shared));
                tasks.spawn(forever(serve));
                None
            }
            LinkConfig::Pty { device } => {
                let path = device.clone();
                let open = move || pty::plug(&path);
                let first = open().map_err(|source| serial_error(device, source))?;
                let serve = modbus_relay::serve_serial(first, open, config.unit, server, Arc::clone(&shared));
                tasks.spawn(forever(serve));
                None
            }
        };
        let (listener, control) = listen(SocketAddr::new(config.bind, config.control_port)).await?;
        tasks.spawn(forever(control::serve(listener, Arc::clone(&shared))));
        tasks.spawn(run_program(Duration::from_millis(config.timings.cycle_ms), Arc::clone(&shared)));
        Ok(Self { shared, modbus, control, tasks })
    }

    /// Returns the address of the Modbus port; `None` on a serial line.
    #[must_use]
    pub fn modbus(&self) -> Option<SocketAddr> {
        self.modbus
    }

    /// Returns the address of the control port.
    #[must_use]
    pub fn control(&self) -> SocketAddr {
        self.control
    }

    /// Returns the counters since the start.
    #[must_use]
    pub fn counters(&self) -> Counters {
        self.shared.machine().press.counters.clone()
    }

    /// Returns the present H block.
    #[must_use]
    pub fn h_block(&self) -> HBlock {
        self.shared.machine().table.h_block()
    }

    /// Returns the present P block.
    #[must_use]
    pub fn p_block(&self) -> [u16; registers::P_LEN] {
        self.shared.machine().table.p_block()
    }

    /// Executes a command, as the control port does.
    ///
    /// # Errors
    /// [`Error::Refused`] when the state of the press does not permit it.
    pub fn command(&self, command: Command) -> Result<()> {
        control::execute(command, &self.shared)
    }

    /// Waits until `holds` is true of the counters, evaluated once per cycle.
    ///
    /// # Errors
    /// [`Error::Late`] with the counters after `limit`.
    pub async fn until(
        &self,
        what: &str,
        limit: Duration,
        holds: impl Fn(&Counters) -> bool,
    ) -> Result<Counters> {
        self.shared.until(what, limit, holds).await
    }

    /// Waits for the end of the press: [`Command::Stop`], or a failure of its program.
    ///
    /// # Errors
    /// [`Error::Plate`] when a stroke cannot be made.
    pub async fn ended(&mut self) -> Result<()> {
        tokio::select! {
            () = self.shared.stopped() => Ok(()),
            Some(Ok(ended)) = self.tasks.join_next() => ended,
        }
    }
}

fn serial_error(device: &Path, source: std::io::Error) -> Error {
    Error::Serial { device: device.display().to_string(), source }
}

async fn listen(address: SocketAddr) -> Result<(TcpListener, SocketAddr)> {
    let refused = |source| Error::Listen { address, source };
    let listener = TcpListener::bind(address).await.map_err(refused)?;
    let bound = listener.local_addr().map_err(refused)?;
    Ok((listener, bound))
}

async fn forever(task: impl Future<Output = ()>) -> Result<()> {
    task.await;
    Ok(())
}

/// Runs the program cyclically.
async fn run_program(cycle: Duration, shared: Arc<Shared>) -> Result<()> {
    let mut ticks = tokio::time::interval(cycle);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        ticks.tick().await;
        shared.cycle()?;
    }
}
