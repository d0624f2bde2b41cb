//! Tests with invalid frames, which a bridge must reject (section 1 of the protocol).

use super::client::{ABORT, ANSWER, CONFIGURE, CONFIGURED, Client, encode, seal};
use super::{BridgeSubject, Test};
use crate::Verdict;

pub(super) const TESTS: &[Test] = &[
    Test::new("frame.critical", "an unknown critical frame: Error `unknown_type`, then closed", critical),
    Test::new("frame.magic", "a wrong magic: closed", |subject| spoilt(subject, |frame| frame[0] ^= 1)),
    Test::new("frame.version", "another major version: closed", |subject| {
        spoilt(subject, |frame| {
            frame[4] = 9;
            seal(frame);
        })
    }),
    Test::new("frame.header", "a wrong header checksum: closed", |subject| {
        spoilt(subject, |frame| frame[12] ^= 1)
    }),
    Test::new("frame.length", "a payload of 2 MiB: closed before it has come", |subject| {
        spoilt(subject, |frame| {
            frame[8..12].copy_from_slice(&(2_u32 << 20).to_le_bytes());
            seal(frame);
        })
    }),
    Test::new("frame.sequence", "a frame number left out: closed", |subject| {
        spoilt(subject, |frame| {
            frame[16] ^= 4;
            seal(frame);
        })
    }),
    Test::new("frame.payload", "a wrong payload checksum: closed", |subject| {
        spoilt(subject, |frame| {
            if let Some(last) = frame.last_mut() {
                *last ^= 1;
            }
        })
    }),
    Test::new("frame.noise", "200 connections with noise, then Hello is answered", noise),
];

fn critical(subject: &BridgeSubject) -> Result<(), Verdict> {
    let mut client = Client::controller(subject)?;
    client.send_payload(0x80FE, 0, b"")?;
    client.expect_error("unknown_type")?;
    client.expect_close()
}

/// Sends a damaged Configure after Hello.
fn spoilt(subject: &BridgeSubject, spoil: fn(&mut [u8])) -> Result<(), Verdict> {
    let mut client = Client::controller(subject)?;
    let mut frame = encode(CONFIGURE, 0, client.sequence(), subject.settings.to_string().as_bytes());
    spoil(&mut frame);
    client.send_raw(&frame)?;
    client.expect_close()?;
    still_serves(subject)
}

fn noise(subject: &BridgeSubject) -> Result<(), Verdict> {
    let mut random = fastrand::Rng::with_seed(1);
    for round in 0..200 {
        let mut client = Client::connect(subject)?;
        let length = random.usize(..400);
        let mut bytes: Vec<u8> = std::iter::repeat_with(|| random.u8(..)).take(length).collect();
        if round % 2 == 0 {
            bytes = encode(random.u16(..) | ABORT, random.u32(..), 0, &bytes);
        }
        // The bridge may have closed already.
        let _ = client.send_raw(&bytes);
    }
    still_serves(subject)
}

fn still_serves(subject: &BridgeSubject) -> Result<(), Verdict> {
    let mut client = Client::controller(subject)?;
    client.send(CONFIGURE, 0, &subject.settings)?;
    client.expect(CONFIGURED, ANSWER).map(drop)
}
