//! Discovery of bridges, section 8 of `PROTOCOL.md`: Hello is sent to an address, which may be that of a whole network,
//! and the answers are collected.

use std::io::ErrorKind;
use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr, ToSocketAddrs, UdpSocket};
use std::time::{Duration, Instant};

use platen_sdk::Device;

use crate::error::{Error, Result};
use crate::message::{Capabilities, Hello};
use crate::session::{json, parse};
use crate::wire::{Decoder, MAX_PAYLOAD, VERSION, encode, kind};

/// Time in which answers are collected.
const WAIT: Duration = Duration::from_secs(1);

/// Returns the bridges that answer at an address.
pub(crate) fn bridges(address: &str, client: &str) -> Result<Vec<Device>> {
    let broken = |error: std::io::Error| Error::Broken(error.to_string());
    let mut addresses = address.to_socket_addrs().map_err(broken)?;
    let to = addresses.next().ok_or_else(|| Error::Broken("the name has no address".to_owned()))?;
    let any: SocketAddr =
        if to.is_ipv4() { (Ipv4Addr::UNSPECIFIED, 0).into() } else { (Ipv6Addr::UNSPECIFIED, 0).into() };
    let socket = UdpSocket::bind(any).map_err(broken)?;
    socket.set_broadcast(true).map_err(broken)?;
    let hello = Hello { versions: [VERSION; 2], client, role: "monitor" };
    socket.send_to(&encode(kind::HELLO, 0, 0, &json(&hello)), to).map_err(broken)?;
    let until = Instant::now() + WAIT;
    let mut found: Vec<Device> = Vec::new();
    let mut datagram = vec![0; MAX_PAYLOAD.min(1 << 16)];
    while let Some(left) = until.checked_duration_since(Instant::now()).filter(|left| !left.is_zero()) {
        socket.set_read_timeout(Some(left)).map_err(broken)?;
        match socket.recv_from(&mut datagram) {
            Ok((length, from)) => found.extend(device(&datagram[..length], from)),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            // The time has elapsed, or no program listens at a single address.
            Err(_) => break,
        }
    }
    found.sort_by(|a, b| a.value.cmp(&b.value));
    found.dedup();
    Ok(found)
}

/// Returns the bridge that sent a datagram; `None` if the datagram is not from a bridge.
fn device(datagram: &[u8], from: SocketAddr) -> Option<Device> {
    let mut decoder = Decoder::default();
    decoder.push(datagram);
    let frame = decoder.next().ok()??;
    if frame.kind != kind::CAPABILITIES || !frame.sound() {
        return None;
    }
    let capabilities: Capabilities = parse(&frame).ok()?;
    let about = format!("{} {}", capabilities.model, capabilities.serial);
    Some(Device { option: "address".to_owned(), value: from.to_string(), about: about.trim().to_owned() })
}
