//! Tests of sections 1 to 4 of the protocol that need no scan: Hello, lease, Configure, Status.

use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};
use std::time::{Duration, Instant};

use serde_json::{Value as Json, json};

use super::client::{
    ANSWER, CAPABILITIES, CLIENT, CONFIGURE, CONFIGURED, Client, ERROR, HEARTBEAT, HELLO, START, encode,
    fault,
};
use super::{BridgeSubject, Test};
use crate::Verdict;

pub(super) const TESTS: &[Test] = &[
    Test::new("hello.answered", "Hello is answered with Capabilities of version 1.0", answered),
    Test::new("hello.version", "no common version: Error `version`, then closed", version),
    Test::new("hello.first", "a command before Hello: Error `unknown_type`, then closed", first),
    Test::new("hello.once", "a second Hello: Error `unknown_type`, then closed", once),
    Test::new("hello.json", "a Hello that is no JSON: Error `config`, then closed", no_json),
    Test::new("hello.unknown", "unknown members and uncritical frames are skipped", unknown),
    Test::new("lease.busy", "a second controller: Error `busy` with retry_ms, then closed", busy),
    Test::new("lease.same", "the same client again gets the lease, its first connection ends", same_client),
    Test::new("lease.monitor", "a monitor: Status, and Error `denied` for Configure and Start", monitor),
    Test::new("status.rate", "Status at least once a second", rate),
    Test::new("discovery.answered", "a Hello of a monitor by UDP is answered with Capabilities", discovered),
    Test::new("configure.answered", "Configure is answered with the settings and the duration", configured),
    Test::new("configure.impossible", "impossible settings: Error `config` that names others", impossible),
];

fn answered(subject: &BridgeSubject) -> Result<(), Verdict> {
    let mut client = Client::connect(subject)?;
    client.say_hello(CLIENT, "controller")?;
    let capabilities = client.expect(CAPABILITIES, ANSWER)?.json()?;
    if capabilities["version"] != json!([1, 0]) {
        return fault(format!("Capabilities name version {}", capabilities["version"]));
    }
    type Is = fn(&Json) -> bool;
    let kinds: [(&str, Is); 8] = [
        ("model", Json::is_string),
        ("serial", Json::is_string),
        ("live", Json::is_boolean),
        ("modes", |modes| modes.as_array().is_some_and(|modes| !modes.is_empty())),
        ("max_rows", Json::is_u64),
        ("max_columns", Json::is_u64),
        ("faces", |faces| faces == 1 || faces == 2),
        ("kept_scans", |kept| kept.as_u64().is_some_and(|kept| kept > 0)),
    ];
    match kinds.into_iter().find(|(member, is)| !is(&capabilities[member])) {
        Some((member, _)) => fault(format!("{member} of Capabilities is {}", capabilities[member])),
        None => Ok(()),
    }
}

fn version(subject: &BridgeSubject) -> Result<(), Verdict> {
    let mut client = Client::connect(subject)?;
    let hello = json!({"versions": [[7, 0], [7, 4]], "client": CLIENT, "role": "controller"});
    client.send(HELLO, 0, &hello)?;
    client.expect_error("version")?;
    client.expect_close()
}

fn first(subject: &BridgeSubject) -> Result<(), Verdict> {
    let mut client = Client::connect(subject)?;
    client.send_payload(HEARTBEAT, 0, b"")?;
    client.send(CONFIGURE, 0, &subject.settings)?;
    client.expect_error("unknown_type")?;
    client.expect_close()
}

fn once(subject: &BridgeSubject) -> Result<(), Verdict> {
    let mut client = Client::controller(subject)?;
    client.say_hello(CLIENT, "controller")?;
    client.expect_error("unknown_type")?;
    client.expect_close()
}

fn no_json(subject: &BridgeSubject) -> Result<(), Verdict> {
    let mut client = Client::connect(subject)?;
    client.send_payload(HELLO, 0, b"{\"versions\": [[1, 0], [1, 0]")?;
    client.expect_error("config")?;
    client.expect_close()
}

fn unknown(subject: &BridgeSubject) -> Result<(), Verdict> {
    let mut client = Client::connect(subject)?;
    let hello = json!({"versions": [[1, 0], [1, 9]], "client": CLIENT, "role": "controller", "mood": "good"});
    client.send(HELLO, 0, &hello)?;
    client.expect(CAPABILITIES, ANSWER)?;
    let mut client = Client::controller(subject)?;
    client.send_payload(0x00FE, 0, b"what no bridge knows")?;
    client.send(CONFIGURE, 0, &subject.settings)?;
    client.expect(CONFIGURED, ANSWER).map(drop)
}

fn busy(subject: &BridgeSubject) -> Result<(), Verdict> {
    let mut holder = Client::controller(subject)?;
    let mut other = Client::connect(subject)?;
    other.say_hello("another client", "controller")?;
    let error = other.expect_error("busy")?;
    if error["retry_ms"].as_u64().is_none_or(|ms| ms > 5000) {
        return fault(format!("Error `busy` names retry_ms {}, the lease has 5 s", error["retry_ms"]));
    }
    other.expect_close()?;
    holder.send(CONFIGURE, 0, &subject.settings)?;
    holder.expect(CONFIGURED, ANSWER).map(drop)
}

fn same_client(subject: &BridgeSubject) -> Result<(), Verdict> {
    let earlier = Client::controller(subject)?;
    let mut later = Client::controller(subject)?;
    earlier.expect_close()?;
    later.send(CONFIGURE, 0, &subject.settings)?;
    later.expect(CONFIGURED, ANSWER).map(drop)
}

fn monitor(subject: &BridgeSubject) -> Result<(), Verdict> {
    let _holder = Client::controller(subject)?;
    let mut monitor = Client::hello(subject, "a monitor", "monitor")?;
    let mut start = subject.settings.clone();
    start["job"] = json!(format!("{}-denied", subject.run));
    for (kind, message) in [(CONFIGURE, &subject.settings), (START, &start)] {
        monitor.send(kind, 0, message)?;
        monitor.expect_error("denied")?;
    }
    silence(&mut monitor)
}

fn rate(subject: &BridgeSubject) -> Result<(), Verdict> {
    silence(&mut Client::controller(subject)?)
}

/// Checks for 3 s that Status arrives in time; half a second is allowed for the network.
fn silence(client: &mut Client) -> Result<(), Verdict> {
    let start = Instant::now();
    while start.elapsed() < Duration::from_secs(3) {
        if let Some(frame) = client.next(Duration::from_millis(500))? {
            return fault(format!("{} came unasked", super::client::name(frame.kind)));
        }
    }
    match client.longest_silence {
        Duration::ZERO => fault("no Status within 3 s"),
        longest if longest > Duration::from_millis(1500) => {
            fault(format!("{} ms without a Status", longest.as_millis()))
        }
        _ => Ok(()),
    }
}

fn discovered(subject: &BridgeSubject) -> Result<(), Verdict> {
    let here: SocketAddr = if subject.address.is_ipv4() {
        (Ipv4Addr::UNSPECIFIED, 0).into()
    } else {
        (Ipv6Addr::UNSPECIFIED, 0).into()
    };
    let hello = json!({"versions": [[1, 0], [1, 0]], "client": CLIENT, "role": "monitor"});
    let mut answer = [0; 65536];
    let ask = |answer: &mut [u8]| {
        let socket = UdpSocket::bind(here)?;
        socket.set_read_timeout(Some(Duration::from_secs(1)))?;
        // Not a datagram of the protocol: to be ignored.
        socket.send_to(b"hello?", subject.address)?;
        socket.send_to(&encode(HELLO, 0, 0, hello.to_string().as_bytes()), subject.address)?;
        socket.recv_from(answer)
    };
    let Ok((length, _)) = ask(&mut answer) else {
        return Err(Verdict::LeftOut("no answer within 1 s: it cannot be found, which is allowed".into()));
    };
    let payload = answer[..length].get(32..length.saturating_sub(4)).unwrap_or_default();
    if encode(CAPABILITIES, 0, 0, payload) != answer[..length] {
        return fault("the answer is not one Capabilities frame of number 0");
    }
    match serde_json::from_slice::<Json>(payload) {
        Ok(capabilities) if capabilities["serial"].is_string() => Ok(()),
        _ => fault("its Capabilities are no JSON object with a serial number"),
    }
}

fn configured(subject: &BridgeSubject) -> Result<(), Verdict> {
    let mut client = Client::controller(subject)?;
    client.send(CONFIGURE, 0, &subject.settings)?;
    let configured = client.expect(CONFIGURED, ANSWER)?.json()?;
    let known = ["divisor", "rate_kpts"].into_iter().all(|member| configured[member].is_u64());
    let lasts = configured["duration_s"].as_f64().is_some_and(|s| s > 0.0);
    if known && lasts { Ok(()) } else { fault(format!("Configured is {configured}")) }
}

fn impossible(subject: &BridgeSubject) -> Result<(), Verdict> {
    let mut client = Client::controller(subject)?;
    let mut settings = subject.settings.clone();
    settings["divisor"] = json!(3_000_000);
    client.send(CONFIGURE, 0, &settings)?;
    client.expect_error("config")?;
    // A query; the connection is kept.
    client.send(CONFIGURE, 0, &subject.settings)?;
    match client.next(ANSWER)? {
        Some(frame) if frame.kind == CONFIGURED => Ok(()),
        Some(frame) if frame.kind == ERROR => {
            fault(format!("then the settings were refused: {}", frame.json()?))
        }
        _ => fault("the connection ended after Error `config`"),
    }
}
