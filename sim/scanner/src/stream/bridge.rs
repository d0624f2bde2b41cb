//! Bridge: a listening port, and a thread for each connection.

use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::thread::JoinHandle;

use super::config::BridgeConfig;
use super::connection;
use super::counters::BridgeCounters;
use super::head::Head;
use super::shared::Shared;

/// Running bridge; dropping it stops it.
#[derive(Debug)]
pub struct Bridge {
    address: SocketAddr,
    shared: Arc<Shared>,
    port: Option<JoinHandle<()>>,
}

impl Bridge {
    /// Starts listening; scans are taken by `head`.
    ///
    /// # Errors
    /// The port is in use, or the folder of recordings cannot be created.
    pub fn start(config: BridgeConfig, head: Box<dyn Head>) -> std::io::Result<Self> {
        if let Some(folder) = &config.record {
            std::fs::create_dir_all(folder)?;
        }
        let listener = TcpListener::bind(config.address)?;
        let address = listener.local_addr()?;
        let shared = Arc::new(Shared::new(config, head));
        let port = {
            let shared = Arc::clone(&shared);
            std::thread::spawn(move || accept(&listener, &shared))
        };
        Ok(Self { address, shared, port: Some(port) })
    }

    /// Returns the address of the port.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Returns the counters since the start.
    pub fn counters(&self) -> BridgeCounters {
        self.shared.counts.read()
    }
}

impl Drop for Bridge {
    fn drop(&mut self) {
        self.shared.end();
        // Unblocks the thread that accepts connections.
        let _ = TcpStream::connect(self.address);
        if let Some(port) = self.port.take() {
            let _ = port.join();
        }
    }
}

fn accept(listener: &TcpListener, shared: &Arc<Shared>) {
    for stream in listener.incoming().flatten() {
        if shared.is_ending() {
            return;
        }
        let Some(number) = shared.admit(&stream) else { continue };
        let shared = Arc::clone(shared);
        std::thread::spawn(move || {
            connection::serve(stream, number, &shared);
            shared.remove(number);
        });
    }
}
