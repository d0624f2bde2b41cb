//! Reader of `[press.link]`.

use std::net::IpAddr;
use std::path::PathBuf;
use std::time::Duration;

use super::ms;
use crate::document::Reported;
use crate::press::{Link, Parity, Quiet, Serial, Socket, Transport};
use crate::{Located, Place, TomlTable};

/// Type of the link.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Way {
    Tcp,
    Rtu,
    RtuOverTcp,
}

/// Reads the link, and the place of its type.
pub(super) fn read(mut table: TomlTable<'_>) -> Result<(Link, Option<Place>), Reported> {
    let document = table.document();
    let ways = [("tcp", Way::Tcp), ("rtu", Way::Rtu), ("rtu-over-tcp", Way::RtuOverTcp)];
    let way = table.choice("type", &ways).located().optional();
    let unit = table.integer("unit").in_range(0..=255).map(|unit| unit as u8).required();
    let connect_timeout = ms(&mut table, "connect_timeout_ms", 1);
    let response_timeout = ms(&mut table, "response_timeout_ms", 1);
    let pause_after_connect = ms(&mut table, "pause_after_connect_ms", 0);
    let pause_between_requests = ms(&mut table, "pause_between_requests_ms", 0);
    let poll = ms(&mut table, "poll_ms", 1);
    let backoff = table.vector::<2>("backoff_ms").check(|[least, most]| {
        let rises = *least >= 1.0 && least <= most && *most <= 60_000.0;
        if rises { Ok(()) } else { Err("must be two rising times between 1 and 60000".to_owned()) }
    });
    let backoff = backoff.optional();
    let quiet_place = table.integer("quiet_ms").in_range(1..=10_000).located().optional();

    let kind = way.as_ref().map(|way| way.as_ref().map_or(Way::Tcp, |way| way.value));
    // A link of unknown type may have the keys of every type.
    let transport = match kind {
        Ok(Way::Tcp) => read_socket(&mut table, true).map(Transport::Tcp),
        Ok(Way::RtuOverTcp) => read_socket(&mut table, false).map(Transport::rtu_over_tcp),
        Ok(Way::Rtu) => read_serial(&mut table).map(Transport::rtu),
        Err(&reported) => {
            table.excuse_missing(reported);
            let _ = (read_socket(&mut table, true), read_serial(&mut table));
            Err(reported)
        }
    };
    table.finish();
    let (transport, way) = (transport?, way?);
    let link = Link::new(transport, unit?);
    let backoff = backoff?.map(|times| times.map(|ms| Duration::from_secs_f64(ms / 1000.0)));
    let [backoff_min, backoff_max] = backoff.unwrap_or([link.backoff_min, link.backoff_max]);
    let mut link = Link {
        connect_timeout: connect_timeout?.unwrap_or(link.connect_timeout),
        response_timeout: response_timeout?.unwrap_or(link.response_timeout),
        pause_after_connect: pause_after_connect?.unwrap_or(link.pause_after_connect),
        pause_between_requests: pause_between_requests?.unwrap_or(link.pause_between_requests),
        poll: poll?.unwrap_or(link.poll),
        backoff_min,
        backoff_max,
        ..link
    };
    if let Some(Located { value, place }) = quiet_place? {
        let quiet = Duration::from_millis(value.unsigned_abs());
        if !link.is_serial() {
            return Err(
                document.fault(&place, "only lines with RTU frames need silence; remove it or set type")
            );
        }
        if quiet <= link.response_timeout {
            let limit = link.response_timeout.as_millis();
            let message = format!(
                "found {value}, must be above response_timeout_ms ({limit}): an answer that comes later than that \
                 would be taken for the next one"
            );
            return Err(document.fault(&place, message));
        }
        link.set_quiet(quiet);
    } else if let Some(quiet) = link.quiet().filter(|quiet| *quiet <= link.response_timeout) {
        link.set_quiet(quiet.max(link.response_timeout.mul_f64(1.5)));
    }
    Ok((link, way.map(|way| way.place)))
}

impl Link {
    fn set_quiet(&mut self, time: Duration) {
        match &mut self.transport {
            Transport::Tcp(_) => {}
            Transport::Rtu(_, Quiet(quiet)) | Transport::RtuOverTcp(_, Quiet(quiet)) => *quiet = time,
        }
    }
}

fn read_socket(table: &mut TomlTable<'_>, with_peers: bool) -> Result<Socket, Reported> {
    let host = table.name("host").required();
    let port = table.integer("port").in_range(1..=65_535).map(|port| port as u16).or(502);
    let peers = if with_peers { read_peers(table) } else { Ok(Vec::new()) };
    Ok(Socket { peers: peers?, ..Socket::new(host?, port?) })
}

fn read_peers(table: &mut TomlTable<'_>) -> Result<Vec<IpAddr>, Reported> {
    let document = table.document();
    let peers = table.strings("peers").optional()?.unwrap_or_default();
    let address = |peer: &Located<String>| {
        peer.value.parse().map_err(|_| {
            let message = format!("found {:?}, expected an IP address like \"192.0.2.10\"", peer.value);
            document.fault(&peer.place, message)
        })
    };
    peers.iter().map(address).collect()
}

fn read_serial(table: &mut TomlTable<'_>) -> Result<Serial, Reported> {
    let device = table.name("device").map(PathBuf::from).required();
    let baud =
        table.integer("baud").in_range(300..=4_000_000).map(|baud| baud.unsigned_abs() as u32).required();
    let parities = [("even", Parity::Even), ("odd", Parity::Odd), ("none", Parity::None)];
    let parity = table.choice("parity", &parities).or(Parity::default());
    let stop_bits = table.integer("stop_bits").in_range(1..=2).map(|bits| bits as u8).or(1);
    let echo = table.bool("echo").or(false);
    let rs485 = table.bool("rs485").or(false);
    let serial = Serial::new(device?, baud?);
    Ok(Serial { parity: parity?, stop_bits: stop_bits?, echo: echo?, rs485: rs485?, ..serial })
}
