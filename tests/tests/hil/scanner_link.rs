//! Every fault of link, bridge and scanner that is known, on a real socket: the driver library as the host loads it
//! against the simulator's bridge, which shares no code with it. The scan survives to the last bit, or fails within
//! its deadline with one sentence.
//!
//! | fault | test | outcome |
//! |---|---|---|
//! | link cut, at any column | `drop_mid_scan_at_every_column`, `drop_often` | survived: resumed, no column twice |
//! | bridge or vendor's library crashed | `sdk_crash_bridge_killed` | "the bridge refuses (gone): scan .. is not kept here" |
//! | nobody let in after a cut | `reconnect_too_fast` | survived |
//! | reply to Start lost | `double_start_when_the_reply_is_lost` | survived: two Starts, one scan |
//! | delay, silence | `slow`, `stalled_longer_than_the_driver_waits` | survived |
//! | flipped bits | `corrupt_frame`, `corrupt_end`, `corrupt_header` | survived: asked for again |
//! | frame too long | `oversize` | survived: reconnected |
//! | columns missing, shuffled, repeated | `missing_column`, `shuffled`, `repeated` | survived |
//! | frames of another scan | `late_frames` | survived |
//! | several of these together | `everything_at_once` | survived |
//! | column without content | `zero_length` | "a column of 0 bytes is shorter than its fixed part" |
//! | column twice, different | `torn_column` | "received twice with different content" |
//! | digest of other columns | `wrong_digest` | "received .. but ScanEnd states .." |
//! | unknown frame | `unknown_frames` | skipped, or "unknown to version 1.0" |
//! | other version | `version_mismatch` | "uses version 2.0 of the protocol, this driver 1.0" |
//! | scan's end never told | `event_lost` | "no scan in time" at the deadline |
//! | lease held by a dead client | `lease_stuck` | survived, or "busy: held by press-4" at the deadline |
//! | scanner off or starting | `asleep` | survived, or "the scanner is starting up" at the deadline |
//! | connected late | `connect_late`, `connect_later_than_the_driver_waits` | survived |
//! | mirror not up to speed | `start_stall` | survived, or "did not reach its speed in 5 attempts" |
//! | status stale, progress jumps | `stale_status_and_progress_jump` | survived |
//! | parameters altered | `params_altered` | survived, noted in the scan |
//! | impossible parameters | `impossible_settings_are_refused_with_what_is_possible` | "choose a lower rate" |
//! | bridge's disk full | `slow_consumer_spool_overflow` | "refuses (overflow)" |
//! | library, card missing; card full | `sdk_missing`, `card_missing`, `storage_full` | its sentence |
//! | pushed while scanning | `tilted_while_scanning` | "the scanner was moved" |
//! | battery, temperature, dirt | `battery_low_temperature_contamination_are_warnings` | survived, said as progress |
//! | clock wrong, jumps | `clock_jump` | survived |
//! | another scanner | `wrong_scanner` | "SIM9999 answers, SIM0001 is expected" |
//! | no bridge | `nobody_there` | "no scan in time: the connection broke" |

use std::sync::OnceLock;
use std::time::{Duration, Instant};

use crate::stream::{COARSE, LIMIT, WINDOW, bridge, cells, driver, head, scan, start};
use platen_engine::plugin::PluginError;
use platen_sim_scanner::stream::{Bridge, BridgeConfig, BridgeCounters};

type Cells = Vec<(Option<u64>, Option<[u64; 2]>, u16)>;

/// The scan that nothing disturbed.
fn undisturbed() -> &'static (Cells, u32, u64) {
    static SCAN: OnceLock<(Cells, u32, u64)> = OnceLock::new();
    SCAN.get_or_init(|| {
        let bridge = bridge(&[]);
        let (lattice, end) = scan(&driver(bridge.address(), COARSE), Some(&WINDOW), LIMIT).unwrap();
        assert!(lattice.n_columns() > 25 && lattice.n_valid() > 700, "{} cells", lattice.n_valid());
        assert_eq!(bridge.counters().scans, 1);
        (cells(&lattice), end.columns, end.points)
    })
}

/// The scan comes whole, from one scan of the head.
#[track_caller]
fn survives_on(bridge: &Bridge) -> BridgeCounters {
    let (lattice, end) = scan(&driver(bridge.address(), COARSE), Some(&WINDOW), LIMIT).unwrap();
    let (reference, columns, points) = undisturbed();
    assert_eq!((end.columns, end.points), (*columns, *points));
    assert!(cells(&lattice) == *reference, "another lattice");
    let counters = bridge.counters();
    assert_eq!(counters.scans, 1, "{counters:?}");
    counters
}

#[track_caller]
fn survives(faults: &[&str]) -> BridgeCounters {
    survives_on(&bridge(faults))
}

/// The scan fails with this sentence, within its deadline.
#[track_caller]
fn fails(faults: &[&str], sentence: &str) {
    fails_within(LIMIT, faults, sentence);
}

#[track_caller]
fn fails_within(limit: Duration, faults: &[&str], sentence: &str) {
    let bridge = bridge(faults);
    let started = Instant::now();
    let error = scan(&driver(bridge.address(), COARSE), Some(&WINDOW), limit).unwrap_err();
    assert!(error.to_string().contains(sentence), "{error}");
    assert!(!matches!(error, PluginError::Hangs { .. }));
    // Two seconds of grace: the machine may be busy.
    assert!(started.elapsed() < limit + Duration::from_secs(2), "{:?}", started.elapsed());
}

#[test]
fn drop_mid_scan_at_every_column() {
    let columns = undisturbed().1;
    for column in 0..=columns {
        let counters = survives(&[&format!("drop-mid-scan={column}")]);
        assert_eq!((counters.cuts, counters.connections), (1, 2), "cut before column {column}: {counters:?}");
        assert!(counters.columns_sent == columns, "none is sent twice: {counters:?}");
    }
}

#[test]
fn drop_often() {
    let counters = survives(&["drop-often=7"]);
    assert!(counters.cuts >= 4 && counters.starts == 1, "{counters:?}");
}

#[test]
fn sdk_crash_bridge_killed() {
    // What a bridge has forgotten cannot be resumed, and is not scanned again under the same name.
    fails(&["bridge-killed=12"], "the bridge refuses (gone): scan ");
}

#[test]
fn reconnect_too_fast() {
    let counters = survives(&["drop-mid-scan=9", "reconnect-too-fast=700"]);
    assert_eq!(counters.cuts, 1);
}

#[test]
fn double_start_when_the_reply_is_lost() {
    let counters = survives(&["reply-lost"]);
    assert_eq!((counters.starts, counters.scans), (2, 1));
}

#[test]
fn slow() {
    survives(&["slow=15"]);
}

#[test]
fn stalled_longer_than_the_driver_waits() {
    let counters = survives(&["stalled=5000"]);
    assert!(counters.connections >= 2, "{counters:?}");
}

#[test]
fn corrupt_frame() {
    let counters = survives(&["corrupt-frame=3"]);
    assert!(counters.resumes >= 1 && counters.connections == 1, "{counters:?}");
}

#[test]
fn corrupt_end() {
    assert_eq!(survives(&["corrupt-end"]).connections, 2);
}

#[test]
fn corrupt_header() {
    assert_eq!(survives(&["corrupt-header=5"]).connections, 2);
}

#[test]
fn oversize() {
    assert_eq!(survives(&["oversize=5"]).connections, 2);
}

#[test]
fn missing_column() {
    let counters = survives(&["missing-column=4"]);
    assert_eq!((counters.resumes, counters.connections), (1, 1));
}

#[test]
fn shuffled() {
    survives(&["shuffled=40"]);
}

#[test]
fn repeated() {
    survives(&["repeated=2"]);
}

#[test]
fn late_frames() {
    survives(&["late-frames"]);
}

#[test]
fn everything_at_once() {
    survives(&[
        "drop-often=11",
        "corrupt-frame=5",
        "missing-column=5",
        "repeated=3",
        "shuffled=8",
        "late-frames",
        "reply-lost",
    ]);
}

#[test]
fn zero_length() {
    fails(
        &["zero-length=5"],
        "the bridge violates the protocol: a column of 0 bytes is shorter than its fixed part",
    );
}

#[test]
fn torn_column() {
    fails(&["torn-column=5"], "received twice with different content");
}

#[test]
fn wrong_digest() {
    fails(&["wrong-digest"], "ScanEnd states");
}

#[test]
fn unknown_frames() {
    survives(&["unknown-frame=4"]);
    fails(&["unknown-command=4"], "frames of type 0x8777, unknown to version 1.0");
}

#[test]
fn version_mismatch() {
    fails(&["version-mismatch"], "the bridge uses version 2.0 of the protocol, this driver 1.0");
}

#[test]
fn event_lost() {
    fails_within(Duration::from_secs(3), &["event-lost"], "no scan in time: the scan was still running");
}

#[test]
fn lease_stuck() {
    survives(&["lease-stuck=1500"]);
    fails_within(Duration::from_secs(2), &["lease-stuck=100000"], "the bridge is busy: held by press-4");
}

#[test]
fn asleep() {
    survives(&["asleep=1200"]);
    fails_within(Duration::from_secs(2), &["asleep=100000"], "the scanner is starting up");
}

#[test]
fn connect_late() {
    survives(&["connect-late=1500"]);
}

#[test]
fn connect_later_than_the_driver_waits() {
    assert_eq!(survives(&["connect-late=6000"]).connections, 2);
}

/// A hundredth of a real scanner's time.
fn scaled(faults: &[&str]) -> Bridge {
    start(faults, BridgeConfig { time_scale: 0.01, ..BridgeConfig::default() }, head())
}

#[test]
fn start_stall() {
    survives_on(&scaled(&["start-stall=2"]));
    let bridge = scaled(&["start-stall=6"]);
    let error = scan(&driver(bridge.address(), COARSE), Some(&WINDOW), LIMIT).unwrap_err().to_string();
    assert!(error.contains("(scanner): the mirror did not reach its speed in 5 attempts"), "{error}");
}

#[test]
fn stale_status_and_progress_jump() {
    survives_on(&scaled(&["stale-status"]));
    survives_on(&scaled(&["progress-jump"]));
}

#[test]
fn params_altered() {
    let bridge = bridge(&["params-altered"]);
    let (lattice, _) =
        scan(&driver(bridge.address(), "divisor = 16\nrate_kpts = 244"), Some(&WINDOW), LIMIT).unwrap();
    let notes = &lattice.header().notes;
    assert!(notes.iter().any(|note| note.contains("244 was requested, the scanner set 122")), "{notes:?}");
}

#[test]
fn impossible_settings_are_refused_with_what_is_possible() {
    let bridge = bridge(&[]);
    let error = scan(&driver(bridge.address(), "divisor = 32\nrate_kpts = 976"), Some(&WINDOW), LIMIT);
    let error = error.unwrap_err().to_string();
    assert!(error.contains("(config): 1/32 at 976 kpts/s requires a mirror frequency of 762 Hz"), "{error}");
}

#[test]
fn slow_consumer_spool_overflow() {
    fails(&["overflow=3"], "the bridge refuses (overflow): the bridge's disk is full");
}

#[test]
fn sdk_missing() {
    fails(&["sdk-missing"], "the scanner's library is not registered on this computer");
}

#[test]
fn card_missing() {
    fails(&["card-missing"], "there is no card in the scanner");
}

#[test]
fn storage_full() {
    fails(&["storage-full=8"], "the scan ended as failed: the memory card is full");
}

#[test]
fn tilted_while_scanning() {
    fails(&["tilted=8"], "the scan ended as failed: the scanner was moved: its inclination changed");
}

#[test]
fn battery_low_temperature_contamination_are_warnings() {
    for fault in ["battery-low", "temperature", "contamination"] {
        survives(&[fault]);
    }
}

#[test]
fn clock_jump() {
    survives(&["clock-jump"]);
}

#[test]
fn wrong_scanner() {
    let bridge = bridge(&["wrong-scanner"]);
    let scanner = driver(bridge.address(), &format!("{COARSE}\nserial = \"SIM0001\""));
    let error = scan(&scanner, Some(&WINDOW), LIMIT).unwrap_err().to_string();
    assert!(error.contains("scanner SIM9999 answers, SIM0001 is expected"), "{error}");
    assert_eq!(bridge.counters().scans, 0);
}

#[test]
fn a_bridge_that_sends_after_the_fact_gives_the_same_scan() {
    survives_on(&start(&[], BridgeConfig { live: false, ..BridgeConfig::default() }, head()));
    let cut = BridgeConfig { live: false, time_scale: 0.01, ..BridgeConfig::default() };
    survives_on(&start(&["drop-mid-scan=13"], cut, head()));
}

#[test]
fn nobody_there() {
    let nobody = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let limit = Duration::from_secs(1);
    let error = scan(&driver(nobody, COARSE), Some(&WINDOW), limit).unwrap_err().to_string();
    assert!(error.contains("no scan in time: the connection broke"), "{error}");
}
