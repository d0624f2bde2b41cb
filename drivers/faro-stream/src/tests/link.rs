//! The socket: a bridge on a port of the system's choice.

use std::io::{Read, Write};
use std::net::TcpListener;

use serde_json::{Value, json};

use super::bridge::request;
use crate::device::ask;
use crate::error::Error;
use crate::wire::{Decoder, encode, kind};

/// A bridge that takes one connection and answers each frame as `answer` says; it hangs up on `None`.
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
                // Byte by byte: frames need not come in one piece.
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
    assert_eq!(ask(&address, &request(), &request().settings), Ok(Some(97.5)));
}

#[test]
fn a_bridge_that_refuses_or_hangs_up_is_told_apart() {
    let refusing = serve(|_, _| Some((kind::ERROR, json!({"code": "busy", "text": "held by press-4"}))));
    let refused = ask(&refusing, &request(), &request().settings).unwrap_err();
    assert_eq!(refused.to_string(), "the bridge is busy: held by press-4");
    let silent = serve(|_, _| None);
    assert!(matches!(ask(&silent, &request(), &request().settings), Err(Error::Broken(_))));
    let nobody = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    assert!(matches!(ask(&nobody, &request(), &request().settings), Err(Error::Broken(_))));
}
