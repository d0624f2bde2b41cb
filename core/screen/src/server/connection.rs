//! Connection limits of the server, which bound the load by its readers.
//!
//! - at most 64 connections, and at most 16 from one address
//! - 5 s for the head of a request, of at most 16 kB
//! - a reader that accepts no data for 10 s is disconnected

use std::collections::HashMap;
use std::net::{IpAddr, SocketAddr};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use axum::Router;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::net::{TcpListener, TcpStream};
use tokio_io_timeout::TimeoutStream;

/// Largest number of connections, and of connections from one address other than loopback, where a proxy may act for
/// many readers.
const CONNECTIONS: usize = 64;
const CONNECTIONS_OF_ONE: usize = 16;
/// Longest time for the head of a request.
const HEAD_TIME: Duration = Duration::from_secs(5);
/// Largest head of a request, bytes.
const HEAD_SIZE: usize = 16 * 1024;
/// Longest time for which a reader may accept no data.
const STALLED: Duration = Duration::from_secs(10);
/// Pause after a failure to accept a connection because the system has no file descriptors.
const PAUSE: Duration = Duration::from_millis(200);

/// Address of the reader of a request.
#[derive(Debug, Clone, Copy)]
pub(super) struct Peer(pub(super) IpAddr);

/// Open connections by address.
#[derive(Debug, Clone, Default)]
struct Open(Arc<Mutex<HashMap<IpAddr, usize>>>);

/// One of the open connections; closed when dropped.
struct Slot {
    open: Open,
    ip: IpAddr,
}

impl Open {
    /// Takes a slot, if one is free.
    fn slot(&self, ip: IpAddr) -> Option<Slot> {
        let mut open = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let of_one = open.get(&ip).copied().unwrap_or(0);
        if open.values().sum::<usize>() >= CONNECTIONS || !ip.is_loopback() && of_one >= CONNECTIONS_OF_ONE {
            return None;
        }
        open.insert(ip, of_one + 1);
        Some(Slot { open: self.clone(), ip })
    }
}

impl Drop for Slot {
    fn drop(&mut self) {
        let mut open = self.open.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(n) = open.get_mut(&self.ip) {
            *n -= 1;
        }
        open.retain(|_, n| *n > 0);
    }
}

/// Serves connections without end.
pub(super) async fn accept(listener: TcpListener, router: Router) {
    let open = Open::default();
    loop {
        match listener.accept().await {
            Ok((stream, peer)) => match open.slot(peer.ip()) {
                Some(slot) => {
                    let router = router.clone();
                    tokio::spawn(async move {
                        serve(stream, peer, router).await;
                        drop(slot);
                    });
                }
                None => tracing::warn!(%peer, "pages: too many connections; this one is closed"),
            },
            Err(error) => {
                tracing::warn!("pages: {error}");
                tokio::time::sleep(PAUSE).await;
            }
        }
    }
}

async fn serve(stream: TcpStream, peer: SocketAddr, router: Router) {
    // An event is one small write; without this option it could only be late by the peer's delayed acknowledgement.
    let _ = stream.set_nodelay(true);
    let mut stream = TimeoutStream::new(stream);
    stream.set_write_timeout(Some(STALLED));
    let service = TowerToHyperService::new(router.layer(axum::Extension(Peer(peer.ip()))));
    let served = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEAD_TIME)
        .max_buf_size(HEAD_SIZE)
        .serve_connection(TokioIo::new(Box::pin(stream)), service)
        .await;
    if let Err(error) = served {
        tracing::debug!(%peer, "pages: {error}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slots_are_limited_and_come_back() {
        let open = Open::default();
        let one: IpAddr = "192.0.2.1".parse().unwrap();
        let slots: Vec<Slot> = (0..=CONNECTIONS_OF_ONE).map_while(|_| open.slot(one)).collect();
        assert_eq!(slots.len(), CONNECTIONS_OF_ONE);
        let here: Vec<Slot> =
            (0..=CONNECTIONS).map_while(|_| open.slot(IpAddr::from([127, 0, 0, 1]))).collect();
        assert_eq!(here.len(), CONNECTIONS - CONNECTIONS_OF_ONE);
        drop(slots);
        assert!(open.slot(one).is_some());
    }
}
