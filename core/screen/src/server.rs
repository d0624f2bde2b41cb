//! HTTP server of the pages: a listener with limits, on a thread and runtime of its own with a lower priority.
//!
//! The press side therefore never waits for it. It answers GET and HEAD alone.

mod access;
pub(crate) mod assets;
mod connection;
mod routes;
mod stream;

pub use access::{Access, Token, TokenError};

use std::net::SocketAddr;
use std::sync::Arc;

use tokio::net::TcpListener;
use tokio::sync::oneshot;

use crate::Source;

/// Increase of the thread's nice value.
const NICE: i32 = 10;

/// Reason why the pages cannot be served.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the message of a variant names its fields")]
pub enum ServerError {
    /// The address is in use, or does not belong to this computer.
    #[error(
        "[screen]: {listen} cannot be opened: {source}; is another host running, or the address not of this computer?"
    )]
    Listen { listen: SocketAddr, source: std::io::Error },
    /// The system has no thread or runtime for it.
    #[error("[screen]: no thread for the pages: {0}")]
    Thread(std::io::Error),
}

/// Open address, before pages are served.
#[derive(Debug)]
pub struct Listener {
    listener: std::net::TcpListener,
    address: SocketAddr,
}

impl Listener {
    /// Opens an address.
    ///
    /// # Errors
    /// The address is in use, or does not belong to this computer.
    pub fn open(listen: SocketAddr) -> Result<Self, ServerError> {
        let open = || {
            let listener = std::net::TcpListener::bind(listen)?;
            listener.set_nonblocking(true)?;
            let address = listener.local_addr()?;
            Ok(Self { listener, address })
        };
        open().map_err(|source| ServerError::Listen { listen, source })
    }

    /// Returns the address with the port that the system has chosen.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }
}

/// Running server; ends when dropped.
#[derive(Debug)]
pub struct Server {
    _stop: oneshot::Sender<()>,
}

impl Server {
    /// Serves pages from the source, on a thread of its own.
    ///
    /// # Errors
    /// The system has no thread for it.
    pub fn start(listener: Listener, access: Access, source: Arc<dyn Source>) -> Result<Self, ServerError> {
        let Listener { listener, address } = listener;
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .max_blocking_threads(routes::RECORD_QUERIES)
            .build()
            .map_err(ServerError::Thread)?;
        let (stop, stopped) = oneshot::channel::<()>();
        let router = routes::router(source, access.at(address));
        let serve = move || {
            // Without the permission to lower it, the pages keep the priority of the host.
            let _ = rustix::process::nice(NICE);
            runtime.block_on(async {
                let listener = match TcpListener::from_std(listener) {
                    Ok(listener) => listener,
                    Err(error) => return tracing::error!("pages: {error}"),
                };
                tokio::select! {
                    () = connection::accept(listener, router) => {}
                    _ = stopped => {}
                }
            });
        };
        std::thread::Builder::new().name("screen".into()).spawn(serve).map_err(ServerError::Thread)?;
        Ok(Self { _stop: stop })
    }
}
