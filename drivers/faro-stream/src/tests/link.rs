//! Tests of the socket with a bridge on a port chosen by the system.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use platen_scan::{Column, Lattice, ScanEnd, ScanHeader};
use platen_sdk::{Result, ScanReceiver};

use super::bridge::{BRIDGE, Got, check, request};
use crate::device::{ask, scan};
use crate::error::Error;
use crate::wire::{Decoder, encode, kind};

/// Starts a bridge that accepts one connection and answers each frame by `answer`; it closes on `None`.
fn serve(answer: impl Fn(u16, &Value) -> Option<(u16, Value)> + Send + 'static) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let (mut decoder, mut sequence) = (Decoder::default(), 0);
        let mut bytes = [0; 1000];
        while let Ok(n @ 1..) = stream.read(&mut bytes) {
            decoder.push(&bytes[..n]);
            while let Some(frame) = decoder.next().unwrap() {
                let asked = serde_json::from_slice(&frame.payload).unwrap_or(Value::Null);
                let Some((kind, value)) = answer(frame.kind, &asked) else { return };
                // Byte by byte, since frames need not arrive in one piece.
                for byte in encode(kind, 0, sequence, &serde_json::to_vec(&value).unwrap()) {
                    stream.write_all(&[byte]).unwrap();
                }
                sequence += 1;
            }
        }
    });
    address
}

#[test]
fn a_bridge_says_how_long_a_scan_takes() {
    let address = serve(|kind, asked| match kind {
        kind::HELLO => Some((kind::CAPABILITIES, json!({"version": [1, 0], "serial": "S1"}))),
        kind::CONFIGURE => {
            assert_eq!(*asked, json!({"divisor": 4, "rate_kpts": 244, "compression": 1}));
            Some((kind::CONFIGURED, json!({"duration_s": 97.5, "altered": []})))
        }
        other => panic!("{other:#06x}"),
    });
    assert_eq!(ask(&address, &request(), &request().settings, &mut None), Ok(Some(97.5)));
}

#[test]
fn a_bridge_that_refuses_or_hangs_up_is_distinguished() {
    let refusing = serve(|_, _| Some((kind::ERROR, json!({"code": "busy", "text": "held by press-4"}))));
    let refused = ask(&refusing, &request(), &request().settings, &mut None).unwrap_err();
    assert_eq!(refused.to_string(), "the bridge is busy: held by press-4");
    let silent = serve(|_, _| None);
    assert!(matches!(ask(&silent, &request(), &request().settings, &mut None), Err(Error::Broken(_))));
    let nobody = TcpListener::bind("127.0.0.77:0").unwrap().local_addr().unwrap().to_string();
    assert!(matches!(ask(&nobody, &request(), &request().settings, &mut None), Err(Error::Broken(_))));
}

/// Host with a deadline, which may cancel after some columns.
struct Taker {
    until: Instant,
    cancel_after: usize,
    header: Option<ScanHeader>,
    columns: Vec<Column>,
    end: Option<ScanEnd>,
}

impl Taker {
    fn new(limit: Duration) -> Self {
        let until = Instant::now() + limit;
        Self { until, cancel_after: usize::MAX, header: None, columns: Vec::new(), end: None }
    }
}

impl ScanReceiver for Taker {
    fn check(&self) -> Result<()> {
        if self.columns.len() < self.cancel_after {
            return Ok(());
        }
        Err(platen_sdk::Error::new(platen_sdk::ErrorKind::Cancelled, "cancelled"))
    }
    fn remaining(&self) -> Duration {
        self.until.saturating_duration_since(Instant::now())
    }
    fn progress(&self, _: f64, _: &str) {}
    fn begin(&mut self, header: &ScanHeader) -> Result<()> {
        assert!(self.header.replace(header.clone()).is_none());
        Ok(())
    }
    fn column(&mut self, column: &Column) -> Result<()> {
        self.columns.push(column.clone());
        Ok(())
    }
    fn end(&mut self, end: &ScanEnd) -> Result<()> {
        self.end = Some(*end);
        Ok(())
    }
}

/// Serves the scan; the first connections break after the given numbers of frames, later ones do not.
fn bridge(breaks: Vec<usize>) -> (String, std::sync::mpsc::Receiver<u16>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let (heard, asked) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        for (connection, stream) in listener.incoming().enumerate() {
            let left = breaks.get(connection).copied().unwrap_or(usize::MAX);
            serve_scan(stream.unwrap(), left, &heard);
        }
    });
    (address, asked)
}

/// Serves one connection until `left` frames were sent or the driver closes it.
fn serve_scan(mut stream: TcpStream, mut left: usize, heard: &std::sync::mpsc::Sender<u16>) {
    let (mut decoder, mut sequence) = (Decoder::default(), 0);
    let mut bytes = [0; 1000];
    while let Ok(n @ 1..) = stream.read(&mut bytes) {
        decoder.push(&bytes[..n]);
        while let Some(asked) = decoder.next().unwrap() {
            heard.send(asked.kind).unwrap();
            let quiet = matches!(asked.kind, kind::HEARTBEAT | kind::ABORT);
            let answers = if quiet { Vec::new() } else { BRIDGE.answer(asked.kind, &asked.payload) };
            for frame in answers {
                if left == 0
                    || stream.write_all(&encode(frame.kind, frame.scan, sequence, &frame.payload)).is_err()
                {
                    return;
                }
                left -= 1;
                sequence += 1;
            }
        }
    }
}

#[test]
fn a_scan_over_a_socket_goes_on_after_every_break() {
    let (address, asked) = bridge(vec![0, 1, 4, 9]);
    let mut taker = Taker::new(Duration::from_secs(60));
    scan(&address, request(), &mut taker).1.unwrap();
    let mut lattice = Lattice::new(taker.header.unwrap());
    taker.columns.iter().for_each(|column| lattice.push(column).unwrap());
    check(&BRIDGE, &Got { lattice, columns: taker.columns, end: taker.end.unwrap(), connections: 5 });
    let asked: Vec<u16> = asked.try_iter().filter(|kind| *kind != kind::HEARTBEAT).collect();
    assert_eq!(asked.iter().filter(|kind| **kind == kind::HELLO).count(), 5);
    assert_eq!(asked.iter().filter(|kind| **kind == kind::START).count(), 2, "{asked:x?}");
}

#[test]
fn a_cancelled_scan_is_aborted_at_the_bridge() {
    let (address, asked) = bridge(Vec::new());
    let mut taker = Taker { cancel_after: 3, ..Taker::new(Duration::from_secs(60)) };
    let cancelled = scan(&address, request(), &mut taker).1.unwrap_err();
    assert!(matches!(&cancelled, Error::Host(error) if error.kind() == platen_sdk::ErrorKind::Cancelled));
    let heard = asked.iter().find(|kind| *kind == kind::ABORT);
    assert_eq!(heard, Some(kind::ABORT));
    assert!(taker.end.is_none());
}

#[test]
fn nobody_there_ends_at_the_deadline_with_the_reason() {
    let nobody = TcpListener::bind("127.0.0.77:0").unwrap().local_addr().unwrap().to_string();
    let mut taker = Taker::new(Duration::from_millis(400));
    let late = scan(&nobody, request(), &mut taker).1.unwrap_err();
    assert!(late.to_string().starts_with("no scan in time: the connection broke: "), "{late}");
    assert!(taker.header.is_none());
}
