//! Tests of faults between bridge and driver: the scan is complete, or fails with the reason.

use serde_json::json;

use super::bridge::*;
use crate::error::Error;
use crate::session::Session;
use crate::wire::{Frame, kind};

fn all(frames: Vec<Frame>) -> Vec<Option<Frame>> {
    frames.into_iter().map(Some).collect()
}

/// Passes the greeting; breaks the connection after `n` frames of any longer answer.
fn break_after(n: usize, frames: Vec<Frame>) -> Vec<Option<Frame>> {
    if frames.len() == 1 {
        return all(frames);
    }
    frames.into_iter().take(n).map(Some).chain([None]).collect()
}

/// Runs a session in which `change` alters the frames that answer the first request for columns.
fn spoiled(change: impl Fn(&mut Vec<Frame>)) -> Result<Got, Error> {
    let mut done = false;
    run(&BRIDGE, |_, mut frames| {
        if frames.len() > 2 && !std::mem::replace(&mut done, true) {
            change(&mut frames);
        }
        all(frames)
    })
}

#[track_caller]
fn survives(change: impl Fn(&mut Vec<Frame>)) -> Got {
    let got = spoiled(change).unwrap();
    check(&BRIDGE, &got);
    got
}

#[track_caller]
fn fails(sentence: &str, change: impl Fn(&mut Vec<Frame>)) {
    let error = spoiled(change).unwrap_err().to_string();
    assert!(error.contains(sentence), "{error}");
}

/// Index of a column among the frames, after Status and ScanBegin.
const FIRST: usize = 2;

#[test]
fn drop_mid_scan_at_any_frame_goes_on_where_it_stopped() {
    for cut in 0..=BRIDGE.columns as usize + 3 {
        let mut frames_so_far = 0;
        let got = run(&BRIDGE, |connection, frames| {
            if connection > 1 {
                return all(frames);
            }
            let mut arriving = Vec::new();
            for frame in frames {
                if frames_so_far == cut {
                    arriving.push(None);
                    break;
                }
                frames_so_far += 1;
                arriving.push(Some(frame));
            }
            arriving
        });
        let got = got.unwrap_or_else(|error| panic!("cut after {cut} frames: {error}"));
        check(&BRIDGE, &got);
        assert_eq!(got.connections, 2, "cut after {cut} frames");
    }
}

#[test]
fn a_link_that_breaks_after_every_third_frame_brings_the_scan_in_the_end() {
    let got = run(&BRIDGE, |_, frames| break_after(3, frames)).unwrap();
    check(&BRIDGE, &got);
    // One column, then two at a time, then the end alone.
    assert_eq!(got.connections, 8);
}

#[test]
fn corrupt_columns_are_asked_for_again() {
    let got = survives(|frames| {
        for k in [0, 3, 12] {
            frames[FIRST + k].payload[30] ^= 4;
        }
    });
    assert_eq!(got.connections, 1);
}

#[test]
fn corrupt_json_breaks_the_connection_and_nothing_else() {
    let got = survives(|frames| frames[1].payload[5] ^= 4);
    assert_eq!(got.connections, 2);
}

#[test]
fn missing_column_is_asked_for_again() {
    survives(|frames| {
        frames.remove(FIRST + 4);
        frames.drain(FIRST + 7..FIRST + 10);
    });
}

#[test]
fn shuffled_columns_are_put_in_their_places() {
    survives(|frames| {
        let end = frames.len() - 1;
        frames[FIRST..end].reverse();
        frames.swap(FIRST + 1, FIRST + 6);
    });
}

#[test]
fn repeated_columns_count_once() {
    survives(|frames| {
        let again = frames[FIRST + 2].clone();
        frames.insert(FIRST + 5, again.clone());
        frames.insert(FIRST + 6, again);
    });
}

#[test]
fn late_frames_of_another_scan_are_passed_over() {
    survives(|frames| {
        let mut late = frame(kind::COLUMN, SCAN - 1, vec![1; 80]);
        frames.insert(FIRST + 3, late.clone());
        late.kind = kind::SCAN_END;
        late.payload = br#"{"outcome": "aborted", "columns": 0, "points": 0, "digest": 0}"#.to_vec();
        late.crc = crc32c::crc32c(&late.payload);
        frames.insert(FIRST + 4, late);
        let mut begin = BRIDGE.begin();
        begin["job"] = json!("yesterday");
        frames.insert(1, text(kind::SCAN_BEGIN, SCAN - 1, &begin));
    });
}

#[test]
fn a_torn_column_ends_the_scan() {
    fails("column 2 received twice with different content", |frames| {
        let mut other = BRIDGE.column(2);
        other[30] ^= 1;
        frames.insert(FIRST + 5, frame(kind::COLUMN, SCAN, other));
    });
}

#[test]
fn a_digest_or_a_count_that_disagrees_ends_the_scan() {
    for member in ["digest", "points", "columns"] {
        fails("ScanEnd states", |frames| {
            let mut end = BRIDGE.end();
            end[member] = json!(end[member].as_u64().unwrap() + 1);
            *frames.last_mut().unwrap() = text(kind::SCAN_END, SCAN, &end);
        });
    }
}

#[test]
fn columns_that_never_come_end_the_scan() {
    let stubborn = run(&BRIDGE, |_, mut frames| {
        frames.retain(|frame| frame.kind != kind::COLUMN || frame.payload[0] != 7);
        all(frames)
    });
    assert!(stubborn.unwrap_err().to_string().contains("1 columns missing after 3 requests"));
}

#[test]
fn another_scan_for_the_same_job_ends_it() {
    let mut number = SCAN;
    let restarted = run(&BRIDGE, |connection, mut frames| {
        if connection == 2 {
            number = SCAN + 1;
        }
        frames.iter_mut().filter(|frame| frame.scan == SCAN).for_each(|frame| frame.scan = number);
        break_after(6, frames)
    });
    assert!(restarted.unwrap_err().to_string().contains("scan 42 started for the job of scan 41"));
}

#[test]
fn an_aborted_or_failed_scan_says_so() {
    fails("the scan ended as failed: mirror stalled", |frames| {
        let end =
            json!({"outcome": "failed", "reason": "mirror stalled", "columns": 3, "points": 1, "digest": 0});
        *frames.last_mut().unwrap() = text(kind::SCAN_END, SCAN, &end);
    });
}

#[test]
fn no_trailer_no_scan() {
    let endless = run(&BRIDGE, |_, mut frames| {
        frames.retain(|frame| frame.kind != kind::SCAN_END);
        all(frames)
    });
    assert!(matches!(endless, Err(Error::TooLate(_))));
}

#[test]
fn a_busy_bridge_is_asked_again_and_a_refusal_is_final() {
    let busy = json!({"code": "busy", "text": "held by press-4", "retry_ms": 10});
    let got = survives(|frames| frames.insert(0, text(kind::ERROR, 0, &busy)));
    assert_eq!(got.connections, 2);
    fails("the bridge refuses (scanner): no card in it", |frames| {
        frames.insert(0, text(kind::ERROR, 0, &json!({"code": "scanner", "text": "no card in it"})));
    });
    fails("the bridge refuses (gone)", |frames| {
        frames.insert(3, text(kind::ERROR, 0, &json!({"code": "gone"})));
    });
}

#[test]
fn unknown_frames_are_passed_over_or_refused_as_their_type_says() {
    survives(|frames| frames.insert(3, frame(0x0777, 0, vec![1, 2, 3])));
    fails("frames of type 0x8777", |frames| frames.insert(3, frame(0x8777, 0, vec![1, 2, 3])));
}

#[test]
fn the_wrong_scanner_or_version_is_not_asked_for_a_scan() {
    let refuse = |capabilities, serial: &str| {
        let mut session =
            Session::new(crate::session::Request { serial: Some(serial.to_owned()), ..request() });
        session.connected();
        session.frame(&text(kind::CAPABILITIES, 0, &capabilities)).unwrap_err().to_string()
    };
    let wrong = refuse(json!({"version": [1, 0], "serial": "S2"}), "S1");
    assert!(wrong.contains("scanner S2 answers, S1 is expected"), "{wrong}");
    let newer = refuse(json!({"version": [2, 1], "serial": "S1"}), "S1");
    assert!(newer.contains("uses version 2.1"), "{newer}");
}
