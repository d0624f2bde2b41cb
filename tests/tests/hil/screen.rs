//! Tests of the pages of the real `platen run` beside the simulated press.
//!
//! In `tests/peers/screen` a browser reads them.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::path::Path;

use serde_json::Value as Json;

use crate::cell::{Host, Press, plant, until};

/// Writes a plant with pages on a port chosen by the system.
fn plant_with_pages(folder: &Path, press: &Press) -> std::path::PathBuf {
    let path = plant(folder, &press.modbus, &format!("cell = \"{}\"", press.plate));
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, format!("{text}[screen]\nlisten = \"127.0.0.1:0\"\n")).unwrap();
    path
}

/// Returns the address of a host's pages: `127.0.0.1:PORT`.
pub(crate) fn address(host: &Host) -> String {
    until("the address of the pages", || {
        let status = host.status()?;
        let pages = status["status"]["pages"].as_str()?;
        Some(pages.strip_prefix("http://")?.trim_end_matches('/').to_owned())
    })
}

pub(crate) fn get(address: &str, path: &str) -> String {
    let mut stream = TcpStream::connect(address).unwrap();
    write!(stream, "GET {path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n").unwrap();
    let mut text = Vec::new();
    stream.read_to_end(&mut text).unwrap();
    let text = String::from_utf8_lossy(&text);
    let (head, body) = text.split_once("\r\n\r\n").unwrap();
    assert!(head.starts_with("HTTP/1.1 200"), "{path}: {head}\n{body}");
    body.to_owned()
}

pub(crate) fn state(address: &str) -> Json {
    serde_json::from_str(&get(address, "/api/v1/state")).unwrap()
}

#[test]
fn a_result_is_on_the_page_until_the_next_trigger_and_the_end_of_the_part() {
    let folder = tempfile::tempdir().unwrap();
    let mut press = Press::start(folder.path(), "strokes = 9\nautomatic = false");
    let mut host = Host::start(&plant_with_pages(folder.path(), &press));
    let at = address(&host);
    until("ready", || (state(&at)["press"]["ready"] == true).then_some(()));
    assert!(state(&at)["result"].is_null() && get(&at, "/").contains("READY"));

    press.ask(r#"{"do":"baseline"}"#);
    press.wait_taken(1);
    let shown = until("the result", || Some(state(&at)).filter(|state| !state["result"].is_null()));
    let run = &shown["result"]["run"];
    let record: Json = serde_json::from_str(&get(&at, &format!("/api/v1/strokes/{run}"))).unwrap();
    assert_eq!(shown["result"]["verdict"], record["verdict"]);
    assert_eq!(shown["result"]["next"], record["next"]);
    assert!(get(&at, "/").contains("BEND MORE"), "a blank");
    assert!(get(&at, &format!("/strokes/{run}/deviation.svg?lang=ja&units=in")).starts_with("<svg"));
    for page in ["/strokes", "/strokes?plate=1", "/engineer", "/metrics", "/plates/1/report.html"] {
        get(&at, page);
    }

    press.ask(r#"{"do":"stroke"}"#);
    until("no result during a stroke", || state(&at)["result"].is_null().then_some(()));
    press.wait_taken(2);
    until("the next result", || {
        (state(&at)["stroke"]["number"] == 2 && !state(&at)["result"].is_null()).then_some(())
    });
    press.ask(r#"{"do":"part_end"}"#);
    until("no result after the end of the part", || {
        let state = state(&at);
        (state["result"].is_null() && state["plate"].is_null()).then_some(())
    });
    assert_eq!(host.stop(), Some(0), "{}", host.log());
    assert!(TcpStream::connect(&at).is_err(), "the port is closed with the host");
}

#[test]
fn the_operator_sees_how_far_a_scan_is() {
    let folder = tempfile::tempdir().unwrap();
    let mut press = Press::start(folder.path(), "strokes = 9\nautomatic = false");
    let path = plant_with_pages(folder.path(), &press);
    let text = std::fs::read_to_string(&path).unwrap();
    // A scan of some seconds.
    std::fs::write(&path, text.replace("cell = ", "time_scale = 0.1\ncell = ")).unwrap();
    let mut host = Host::start(&path);
    let at = address(&host);
    until("ready", || (state(&at)["press"]["ready"] == true).then_some(()));
    press.ask(r#"{"do":"baseline"}"#);
    let share = || {
        let state = state(&at);
        assert!(state["stroke"]["scanned_percent"].is_null() || state["stroke"]["stage"] == "scanning");
        state["stroke"]["scanned_percent"].as_u64()
    };
    let first = until("a share of the scan", || share().filter(|percent| *percent > 0));
    assert!(get(&at, "/").contains(" %"), "beside the word for scanning");
    until("more of it", || share().filter(|percent| *percent > first));
    press.wait_taken(1);
    assert_eq!(share(), None);
    assert_eq!(host.stop(), Some(0), "{}", host.log());
}

#[test]
fn after_a_restart_no_result_is_shown_without_its_stroke() {
    let folder = tempfile::tempdir().unwrap();
    let mut press = Press::start(folder.path(), "strokes = 9\nautomatic = false");
    let path = plant_with_pages(folder.path(), &press);
    let host = Host::start(&path);
    let at = address(&host);
    until("ready", || (state(&at)["press"]["ready"] == true).then_some(()));
    press.ask(r#"{"do":"baseline"}"#);
    press.wait_taken(1);
    let boot = state(&at)["boot"].clone();
    host.kill();
    let mut host = Host::start(&path);
    let again = until("the pages of the new host", || Some(address(&host)).filter(|now| *now != at));
    until("ready", || (state(&again)["press"]["ready"] == true).then_some(()));
    let now = state(&again);
    assert_ne!(now["boot"], boot);
    // Acknowledged before the kill: the stroke has ended, and nothing of it is shown. A result is never shown without
    // its stroke.
    assert!(now["result"].is_null() || now["stroke"]["number"] == 1, "{now:#}");
    assert_eq!(host.stop(), Some(0), "{}", host.log());
}
