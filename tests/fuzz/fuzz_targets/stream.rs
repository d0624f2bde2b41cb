//! Fuzz target of the scan bridge protocol: any bytes in any pieces give frames, messages and columns, or an error.
#![no_main]

#[path = "../../../drivers/faro-stream/src/column.rs"]
#[allow(dead_code, reason = "the session that uses the rest is not built here")]
mod column;
#[path = "../../../drivers/faro-stream/src/error.rs"]
#[allow(dead_code, reason = "the session that uses the rest is not built here")]
mod error;
#[path = "../../../drivers/faro-stream/src/message.rs"]
#[allow(dead_code, reason = "the session that uses the rest is not built here")]
mod message;
#[path = "../../../drivers/faro-stream/src/wire.rs"]
#[allow(dead_code, reason = "the session that uses the rest is not built here")]
mod wire;

use column::Layout;
use message::{Capabilities, Configured, Refusal, ScanBegin, ScanEnd, Status};
use wire::{Decoder, encode};

/// Decodes the bytes of a connection in pieces; the first byte determines their size.
fn raw(data: &[u8]) {
    let [size, bytes @ ..] = data else { return };
    let mut decoder = Decoder::default();
    for piece in bytes.chunks(usize::from(*size) + 1) {
        decoder.push(piece);
        loop {
            match decoder.next() {
                Ok(Some(frame)) => assert!(frame.payload.len() <= wire::MAX_PAYLOAD),
                Ok(None) => break,
                Err(_) => return,
            }
        }
    }
}

/// Checks that payloads framed here are decoded unchanged, in pieces of any size.
fn framed(data: &[u8]) {
    let [size, bytes @ ..] = data else { return };
    let payloads: Vec<&[u8]> = bytes.split(|byte| *byte == 0).collect();
    let sent: Vec<u8> = payloads.iter().enumerate().flat_map(|(n, p)| encode(7, 3, n as u64, p)).collect();
    let (mut decoder, mut came) = (Decoder::default(), 0);
    for piece in sent.chunks(usize::from(*size) + 1) {
        decoder.push(piece);
        while let Some(frame) = decoder.next().expect("what was framed") {
            assert!(frame.sound() && frame.payload == payloads[came]);
            came += 1;
        }
    }
    assert_eq!(came, payloads.len());
}

/// Parses messages: the text as each kind, and the columns of a lattice if the text contains a valid one.
fn messages(data: &[u8]) {
    let _ = serde_json::from_slice::<Capabilities>(data);
    let _ = serde_json::from_slice::<Configured>(data);
    let _ = serde_json::from_slice::<Refusal>(data);
    let _ = serde_json::from_slice::<Status>(data);
    let _ = serde_json::from_slice::<ScanEnd>(data);
    if let Ok(layout) = serde_json::from_slice::<ScanBegin>(data).map_err(|_| ()).and_then(|b| Layout::new(b).map_err(|_| ())) {
        let _ = layout.header("fuzz");
        columns(&layout, data);
    }
}

fn columns(layout: &Layout, payload: &[u8]) {
    if let Ok((number, column)) = layout.column(payload) {
        assert!(number < layout.begin().columns && column.index < layout.begin().columns);
        // A range beyond that of any scanner is refused by the host; lengths and rows must fit.
        let n = column.len();
        assert!(column.first_row as usize + n <= layout.begin().rows as usize);
        assert!([column.azimuth.len(), column.elevation.len(), column.intensity.len(), column.state.len()] == [n; 4]);
    }
}

const BEGIN: &str = r#"{"job":"j","rows":40,"columns":30,"azimuth_start":0.1,"azimuth_step":-0.001,"elevation_start":-0.5,
"elevation_step":0.001,"values":"VALUES","range_unit_m":0.00001,"intensity":[0,2047]}"#;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let [mode, rest @ ..] = data else { return };
    platen_fuzz::within(data.len(), || match mode % 5 {
        0 => raw(rest),
        1 => framed(rest),
        2 => messages(rest),
        other => {
            let values = if other == 3 { "range" } else { "polar" };
            let begin = serde_json::from_str(&BEGIN.replace("VALUES", values)).expect("a sound message");
            columns(&Layout::new(begin).expect("a sound lattice"), rest);
        }
    });
});
