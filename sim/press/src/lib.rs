//! A Modbus server that behaves like a plate press.
//!
//! The press serves the register map PPH-1 over TCP, over RTU through TCP or on a serial line. Its program
//! ([`program::Program`]) is the press side of the handshake, run every few milliseconds as a controller runs its
//! own; at each stroke it bends a simulated plate ([`forming_model::FormingModel`]), which it shows on a second port
//! ([`control`]) to the simulated scanner. What the host does is counted on this side ([`counters::Counters`]): tests
//! assert there. [`faults`] lists what can be made to go wrong.
//!
//! **Invariants.** Nothing is shared with the host: registers, check sum, handshake and framing are written from the
//! page a second time. [`press::Press::step`] reads no clock and no socket. The same seed gives the same faults.
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

/// This crate's results.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// A running press; dropping it ends it.
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
    /// [`Error::Config`], [`Error::Plate`], and [`Error::Listen`] or [`Error::Serial`] when a port cannot be had.
    pub async fn start(config: Config) -> Result<Self> {
        let shared = Arc::new(Shared::new(&config)?);
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
                let device = device.display().to_string();
                let serial = modbus_relay::open_serial(&device, *baud)
                    .map_err(|source| Error::Serial { device: device.clone(), source })?;
                let serve = modbus_relay::serve_serial(
                    serial,
                    device,
                    *baud,
                    config.unit,
                    server,
                    Arc::clone(&shared),
                );
                tasks.spawn(forever(serve));
                None
            }
            LinkConfig::Pty { device } => {
                let refused = |source| Error::Serial { device: device.display().to_string(), source };
                let first = pty::plug(device).map_err(refused)?;
                let serve =
                    modbus_relay::serve_pty(first, device.clone(), config.unit, server, Arc::clone(&shared));
                tasks.spawn(forever(serve));
                None
            }
        };
        let (listener, control) = listen(SocketAddr::new(config.bind, config.control_port)).await?;
        tasks.spawn(forever(control::serve(listener, Arc::clone(&shared))));
        tasks.spawn(run_program(Duration::from_millis(config.timings.cycle_ms), Arc::clone(&shared)));
        Ok(Self { shared, modbus, control, tasks })
    }

    /// Where the host connects; `None` on a serial line.
    #[must_use]
    pub fn modbus(&self) -> Option<SocketAddr> {
        self.modbus
    }

    /// Where the plate is served.
    #[must_use]
    pub fn control(&self) -> SocketAddr {
        self.control
    }

    /// What the press has seen so far.
    #[must_use]
    pub fn counters(&self) -> Counters {
        self.shared.machine().press.counters.clone()
    }

    /// The H block as it stands.
    #[must_use]
    pub fn h_block(&self) -> HBlock {
        self.shared.machine().table.h_block()
    }

    /// The P block as it stands.
    #[must_use]
    pub fn p_block(&self) -> [u16; registers::P_LEN] {
        self.shared.machine().table.p_block()
    }

    /// Carries out a command, as the control port would.
    ///
    /// # Errors
    /// [`Error::Refused`] when it does not fit the state of the press.
    pub fn command(&self, command: Command) -> Result<()> {
        control::execute(command, &self.shared)
    }

    /// Waits until `holds` is true of what the press saw, looked at once a cycle.
    ///
    /// # Errors
    /// [`Error::Late`] with the counters when it does not come within `limit`.
    pub async fn until(
        &self,
        what: &str,
        limit: Duration,
        holds: impl Fn(&Counters) -> bool,
    ) -> Result<Counters> {
        self.shared.until(what, limit, holds).await
    }

    /// Resolves when the press ends: after [`Command::Stop`], or when its program fails.
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

/// Runs the program, cycle after cycle.
async fn run_program(cycle: Duration, shared: Arc<Shared>) -> Result<()> {
    let mut ticks = tokio::time::interval(cycle);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        ticks.tick().await;
        shared.cycle()?;
    }
}
