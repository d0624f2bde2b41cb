//! Host as a service: its notifications to systemd, a backup taken while it runs, and the record restored from it.

use std::os::unix::net::UnixDatagram;
use std::time::Duration;

use platen_tests::program;
use serde_json::Value as Json;

use crate::cell::{Host, Press, assert_clean, plant, until};

/// Returns the standard output of the program as JSON; the program must succeed.
#[track_caller]
fn json(arguments: &[&str]) -> Json {
    let output = program("platen").args(arguments).arg("--json").output().unwrap();
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Returns its error line; the program must fail with this exit code.
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
    // A stopped host does not reset the watchdog: there is no timer beside the cycle.
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
    assert!(last.contains("STOPPING=1\nWATCHDOG_USEC=0\n"), "{last}");
}

/// Forwarder of a plant, ended with the test.
struct Forwarder(std::process::Child);

impl Drop for Forwarder {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The server is missing: the host reports it, nothing is lost, one forwarder has the cursors, and an alarm is an event
/// of the record.
#[test]
fn a_sink_that_is_away_is_told_by_the_host_and_forgotten_by_none() {
    let folder = tempfile::tempdir().unwrap();
    let mut press = Press::start(folder.path(), "strokes = 9\nautomatic = false\nbaseline = false");
    let plant = plant(folder.path(), &press.modbus, &format!("cell = \"{}\"", press.plate));
    // A port that was free a moment ago, and cannot be used by another program while it is bound without listening.
    let held = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let port = held.local_addr().unwrap().port();
    drop(held);
    let mut text = std::fs::read_to_string(&plant).unwrap();
    text += &format!(
        "[forward]\nsite = \"kure\"\npress = \"press-3\"\n[[forward.sink]]\ntype = \"postgresql\"\nhost = \"127.0.0.1\"\nport = {port}\ntls = false\n\
         [[forward.sink]]\ntype = \"mqtt\"\nhost = \"127.0.0.1\"\nport = {port}\ntls = false\n"
    );
    std::fs::write(&plant, text).unwrap();
    let mut host = Host::start(&plant);
    stroke(&mut press, 1);
    let sinks =
        |host: &Host| host.status().and_then(|status| status["status"]["forward"].as_object().cloned());
    let before = until("the host's word", || sinks(&host));
    assert_eq!((&before["running"], before["sinks"].as_array().map(Vec::len)), (&Json::from(false), Some(0)));
    let start =
        || program("platen").arg("forward").arg(&plant).stderr(std::process::Stdio::piped()).spawn().unwrap();
    let mut forwarder = Forwarder(start());
    let state = until("both sinks away, with what is to be sent", || {
        let state = sinks(&host)?;
        let all = state["sinks"].as_array()?.iter().all(|it| it["backlog"] == 3 && it["error"].is_string());
        (all && state["sinks"].as_array()?.len() == 2).then_some(state)
    });
    for sink in state["sinks"].as_array().unwrap() {
        assert!(sink["error"].as_str().unwrap().contains(&format!("127.0.0.1:{port}: ")), "{sink}");
    }
    let second = start().wait_with_output().unwrap();
    let said = String::from_utf8(second.stderr).unwrap();
    assert!(second.status.code() == Some(1) && said.contains("another platen forward has it"), "{said}");
    let ended = std::process::Command::new("kill").arg(forwarder.0.id().to_string()).status();
    assert!(ended.unwrap().success());
    assert_eq!(until("its end", || forwarder.0.try_wait().unwrap()).code(), Some(0));

    // The press ends: the alarm is recorded, where the forwarder finds it.
    drop(press);
    let file = folder.path().join("results/history.sqlite");
    let noted = until("the alarm on record", || {
        platen_history::Archive::open(&file).unwrap().events(0, 10).unwrap().into_iter().next()
    });
    assert!(noted.kind == "alarm" && noted.text.starts_with("10"), "{noted:?}");
    assert_eq!(host.stop(), Some(0), "{}", host.log());
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
    // The digest of a scan follows its result.
    until("stroke 2 acknowledged, its scan kept", || {
        let record = Host::history(&plant);
        ["ack", "scan_sha256"].iter().all(|it| record[1][it].is_string()).then_some(())
    });
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
    // Its documents are at the places in the record: a report of the plate can be made from them.
    json(&["history", "report", file, "1"]);
    let stats = press.stats();
    assert_clean(&stats, &host.log());
    assert_eq!(stats["owners"], restored["owners"][0], "the press saw both owner numbers");

    // A damaged file of the backup is reported.
    let document = backup.join("run-000001/result.json");
    let text = std::fs::read_to_string(&document).unwrap();
    std::fs::remove_file(&document).unwrap();
    std::fs::write(&document, text.replace("fail", "pass")).unwrap();
    let said = refused(&["history", "verify", copy], 1);
    assert!(said.contains("run-000001/result.json: is not what was backed up"), "{said}");
}

#[test]
fn a_host_asked_to_stop_waits_for_the_end_of_the_plate() {
    let folder = tempfile::tempdir().unwrap();
    let mut press =
        Press::start(folder.path(), "strokes = 9\nautomatic = false\nbaseline = false\nparts = 2");
    let plant = plant(folder.path(), &press.modbus, &format!("cell = \"{}\"", press.plate));
    let file = plant.to_str().unwrap();
    let mut host = Host::start(&plant);
    stroke(&mut press, 1);
    until("stroke 1 acknowledged", || Host::history(&plant)[0]["ack"].is_string().then_some(()));
    assert_eq!(json(&["stop", file, "--when-idle"])["when_idle"], true);
    until("the request in the state", || (host.status()?["status"]["stop_asked"] == true).then_some(()));
    // The plate continues, and so does the host.
    stroke(&mut press, 2);
    until("stroke 2 acknowledged", || Host::history(&plant)[1]["ack"].is_string().then_some(()));
    assert_eq!(host.status().unwrap()["running"], true, "{}", host.log());
    press.ask(r#"{"do":"part_end"}"#);
    assert_eq!(host.wait(), Some(0), "{}", host.log());
    assert_clean(&press.stats(), &host.log());
    assert!(refused(&["stop", file], 1).contains("no host runs with this plant file"));

    let mut host = Host::start(&plant);
    until("the host to be ready", || (press.host_status() & 1 == 1).then_some(()));
    json(&["stop", file]);
    assert_eq!(host.wait(), Some(0), "{}", host.log());
    assert_clean(&press.stats(), &host.log());
}
