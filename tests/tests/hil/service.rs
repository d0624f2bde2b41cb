//! The host as a service: what it tells systemd, a backup taken while it runs, and the record restored from it.

use std::os::unix::net::UnixDatagram;
use std::time::Duration;

use platen_tests::program;
use serde_json::Value as Json;

use crate::cell::{Host, Press, assert_clean, plant, until};

/// Standard output of the program as JSON, which must succeed.
#[track_caller]
fn json(arguments: &[&str]) -> Json {
    let output = program("platen").args(arguments).arg("--json").output().unwrap();
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Its error line, where it must fail with this exit code.
#[track_caller]
fn refused(arguments: &[&str], code: i32) -> String {
    let output = program("platen").args(arguments).output().unwrap();
    assert_eq!(output.status.code(), Some(code), "{arguments:?}");
    String::from_utf8(output.stderr).unwrap()
}

#[test]
fn systemd_hears_ready_then_the_cycle_then_stopping() {
    let folder = tempfile::tempdir().unwrap();
    let press = Press::start(folder.path(), "automatic = false");
    let plant = plant(folder.path(), &press.modbus, &format!("cell = \"{}\"", press.plate));
    let path = folder.path().join("notify");
    let socket = UnixDatagram::bind(&path).unwrap();
    socket.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    let heard = || {
        let mut bytes = [0; 4096];
        let n = socket.recv(&mut bytes).unwrap();
        String::from_utf8(bytes[..n].to_vec()).unwrap()
    };
    let mut host = Host::notifying(&plant, &path);
    assert!(heard().starts_with("READY=1\n"), "{}", host.log());
    let mut fed = 0;
    let mut said = String::new();
    while fed < 3 || !said.contains("STATUS=idle") {
        let now = heard();
        fed += now.matches("WATCHDOG=1").count();
        said += &now;
    }
    // A host that does not run feeds nothing: no ticker beside the cycle.
    host.signal("STOP");
    socket.set_nonblocking(true).unwrap();
    while socket.recv(&mut [0; 4096]).is_ok() {}
    socket.set_nonblocking(false).unwrap();
    socket.set_read_timeout(Some(Duration::from_millis(2500))).unwrap();
    assert!(socket.recv(&mut [0; 4096]).is_err());
    host.signal("CONT");
    socket.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    assert!(heard().contains("WATCHDOG=1"));
    assert_eq!(host.stop(), Some(0), "{}", host.log());
    socket.set_nonblocking(true).unwrap();
    let mut last = String::new();
    let mut bytes = [0; 4096];
    while let Ok(n) = socket.recv(&mut bytes) {
        last += std::str::from_utf8(&bytes[..n]).unwrap();
    }
    assert!(last.contains("STOPPING=1"), "{last}");
}

/// Makes a stroke and waits for its result.
fn stroke(press: &mut Press, taken: usize) {
    until("the host to be ready", || (press.host_status() & 1 == 1).then_some(()));
    press.ask(r#"{"do":"stroke"}"#);
    press.wait_taken(taken);
}

#[test]
fn a_record_goes_on_from_a_backup_taken_while_its_host_ran() {
    let folder = tempfile::tempdir().unwrap();
    let mut press = Press::start(folder.path(), "strokes = 9\nautomatic = false\nbaseline = false");
    let plant = plant(folder.path(), &press.modbus, &format!("cell = \"{}\"", press.plate));
    let mut host = Host::start(&plant);
    stroke(&mut press, 1);
    stroke(&mut press, 2);
    until("stroke 2 acknowledged", || Host::history(&plant)[1]["ack"].is_string().then_some(()));
    let backup = folder.path().join("backup");
    let (file, copy) = (plant.to_str().unwrap(), backup.to_str().unwrap());
    let made = json(&["history", "backup", file, copy]);
    assert_eq!((&made["strokes"], &made["last_run"]), (&Json::from(2), &Json::from(2)));
    assert!(refused(&["history", "backup", file, copy], 2).contains("exists already"));
    // The stroke after the backup is lost with the machine.
    stroke(&mut press, 3);
    assert_eq!(host.stop(), Some(0), "{}", host.log());
    let lost = Host::history(&plant);
    assert!(refused(&["history", "restore", copy, file], 2).contains("nothing was changed"));
    std::fs::remove_dir_all(folder.path().join("results")).unwrap();

    assert_eq!(json(&["history", "verify", copy])["strokes"], 2);
    let restored = json(&["history", "restore", copy, file]);
    assert_eq!(restored["strokes"], 2);
    assert_eq!(Host::history(&plant)[..], lost[..2]);
    let mut host = Host::start(&plant);
    stroke(&mut press, 4);
    assert_eq!(host.stop(), Some(0), "{}", host.log());
    let now = Host::history(&plant);
    assert_eq!((now.len(), &now[2]["run_id"]), (3, &lost[2]["run_id"]), "the run id comes again");
    assert_ne!(now[2]["key"], lost[2]["key"]);
    // Its documents are where the record says: a report of the plate can be made of them.
    json(&["history", "report", file, "1"]);
    let stats = press.stats();
    assert_clean(&stats, &host.log());
    assert_eq!(stats["owners"], restored["owners"][0], "the press saw both owner numbers");

    // A file of the backup that was damaged is named.
    let document = backup.join("run-000001/result.json");
    let text = std::fs::read_to_string(&document).unwrap();
    std::fs::remove_file(&document).unwrap();
    std::fs::write(&document, text.replace("fail", "pass")).unwrap();
    let said = refused(&["history", "verify", copy], 1);
    assert!(said.contains("run-000001/result.json: is not what was backed up"), "{said}");
}
