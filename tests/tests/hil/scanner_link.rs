//! Faults of link, bridge and scanner: the driver library `faro-stream`, loaded as by the host, against the simulator's
//! bridge on a socket.
//!
//! Driver and bridge share no code. A scan either survives, which means that its lattice equals that of an undisturbed
//! scan bit for bit, or fails before its deadline with one sentence that states the cause.
//!
//! | fault | test | outcome |
//! |---|---|---|
//! | link cut at any column, or often | `a_scan_is_resumed_after_a_cut_at_any_column`, `a_scan_is_resumed_after_many_cuts` | survived: resumed, no column twice |
//! | bridge restarted without its scans | `a_scan_lost_by_a_restarted_bridge_fails` | "the bridge refuses (gone): scan .. is not kept here" |
//! | connections refused after a cut | `connections_refused_after_a_cut_are_tried_again` | survived |
//! | reply to Start lost | `a_lost_reply_to_start_causes_no_second_scan` | survived: two Starts, one scan |
//! | columns delayed, silence | `delayed_columns_are_waited_for`, `a_silence_beyond_the_time_limit_reconnects` | survived |
//! | flipped bits | `a_corrupt_column_is_requested_again`, `a_corrupt_scan_end_reconnects`, `a_corrupt_frame_header_reconnects` | survived: requested again, or reconnected |
//! | frame too long | `an_oversized_frame_reconnects` | survived: reconnected |
//! | columns missing, shuffled, repeated | `a_missing_column_is_requested_again`, `shuffled_columns_are_sorted`, `repeated_columns_are_used_once` | survived |
//! | frames of another scan | `frames_of_another_scan_are_ignored` | survived |
//! | several of these together | `seven_faults_of_the_link_together` | survived |
//! | empty column | `an_empty_column_fails_the_scan` | "a column of 0 bytes is shorter than its fixed part" |
//! | column twice with different content | `two_contents_of_one_column_fail_the_scan` | "received twice with different content" |
//! | wrong digest | `a_wrong_digest_fails_the_scan` | "received .. but ScanEnd states .." |
//! | unknown frame | `unknown_frames_are_skipped_unless_critical` | skipped, or "unknown to version 1.0" |
//! | another version of the protocol | `another_protocol_version_is_refused` | "uses version 2.0 of the protocol, this driver 1.0" |
//! | ScanEnd never sent | `a_missing_scan_end_fails_at_the_deadline` | "no scan in time" at the deadline |
//! | lease held by another client | `a_lease_held_by_another_client_is_waited_for` | survived, or "busy: held by press-4" at the deadline |
//! | scanner off or starting | `a_scanner_that_starts_up_is_waited_for` | survived, or "the scanner is starting up" at the deadline |
//! | connection answered late | `a_late_answer_to_the_connection_is_waited_for`, `an_answer_to_the_connection_beyond_the_time_limit_reconnects` | survived |
//! | mirror below its speed | `a_mirror_below_its_speed_is_waited_for` | survived, or "did not reach its speed in 5 attempts" |
//! | status and progress never change | `a_stale_status_and_progress_change_nothing` | survived |
//! | measuring rate altered | `a_rate_altered_by_the_scanner_is_noted` | survived, noted in the scan |
//! | impossible settings | `impossible_settings_are_refused_with_the_reason` | "requires a mirror frequency of 762 Hz" |
//! | bridge's disk full | `a_full_disk_of_the_bridge_is_reported` | "refuses (overflow)" |
//! | library, card missing; card full | `a_missing_vendor_library_is_reported`, `a_missing_memory_card_is_reported`, `a_full_memory_card_is_reported` | the sentence of each |
//! | scanner moved during the scan | `a_scanner_moved_during_the_scan_is_reported` | "the scanner was moved" |
//! | low battery, temperature, contamination | `battery_temperature_and_contamination_are_warnings` | survived |
//! | clock wrong and jumping | `a_wrong_clock_changes_nothing` | survived |
//! | another scanner | `another_scanner_is_refused` | "SIM9999 answers, SIM0001 is expected" |
//! | no bridge | `a_missing_bridge_fails_at_the_deadline` | "no scan in time: the connection broke" |

use std::sync::OnceLock;
use std::time::{Duration, Instant};

use crate::stream::{COARSE, LIMIT, WINDOW, bridge, cells, driver, head, scan, start};
use platen_engine::plugin::PluginError;
use platen_sim_scanner::stream::{Bridge, BridgeConfig, BridgeCounters};

type Cells = Vec<(Option<u64>, Option<[u64; 2]>, u16)>;

/// Returns cells, columns and points of a scan without a fault, made once.
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

/// Asserts that the scan equals the undisturbed one and was made once.
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

/// Asserts that the scan fails with this sentence before its deadline.
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
fn a_scan_is_resumed_after_a_cut_at_any_column() {
    let columns = undisturbed().1;
    for column in 0..=columns {
        let counters = survives(&[&format!("drop-mid-scan={column}")]);
        assert_eq!((counters.cuts, counters.connections), (1, 2), "cut before column {column}: {counters:?}");
        assert!(counters.columns_sent == columns, "none is sent twice: {counters:?}");
    }
}

#[test]
fn a_scan_is_resumed_after_many_cuts() {
    let counters = survives(&["drop-often=7"]);
    assert!(counters.cuts >= 4 && counters.starts == 1, "{counters:?}");
}

#[test]
fn a_scan_lost_by_a_restarted_bridge_fails() {
    // A scan that the restarted bridge no longer has cannot be resumed, and is not repeated under the same identity.
    fails(&["bridge-killed=12"], "the bridge refuses (gone): scan ");
}

#[test]
fn connections_refused_after_a_cut_are_tried_again() {
    let counters = survives(&["drop-mid-scan=9", "reconnect-too-fast=700"]);
    assert_eq!(counters.cuts, 1);
}

#[test]
fn a_lost_reply_to_start_causes_no_second_scan() {
    let counters = survives(&["reply-lost"]);
    assert_eq!((counters.starts, counters.scans), (2, 1));
}

#[test]
fn delayed_columns_are_waited_for() {
    survives(&["slow=15"]);
}

#[test]
fn a_silence_beyond_the_time_limit_reconnects() {
    let counters = survives(&["stalled=5000"]);
    assert!(counters.connections >= 2, "{counters:?}");
}

#[test]
fn a_corrupt_column_is_requested_again() {
    let counters = survives(&["corrupt-frame=3"]);
    assert!(counters.resumes >= 1 && counters.connections == 1, "{counters:?}");
}

#[test]
fn a_corrupt_scan_end_reconnects() {
    assert_eq!(survives(&["corrupt-end"]).connections, 2);
}

#[test]
fn a_corrupt_frame_header_reconnects() {
    assert_eq!(survives(&["corrupt-header=5"]).connections, 2);
}

#[test]
fn an_oversized_frame_reconnects() {
    assert_eq!(survives(&["oversize=5"]).connections, 2);
}

#[test]
fn a_missing_column_is_requested_again() {
    let counters = survives(&["missing-column=4"]);
    assert_eq!((counters.resumes, counters.connections), (1, 1));
}

#[test]
fn shuffled_columns_are_sorted() {
    survives(&["shuffled=40"]);
}

#[test]
fn repeated_columns_are_used_once() {
    survives(&["repeated=2"]);
}

#[test]
fn frames_of_another_scan_are_ignored() {
    survives(&["late-frames"]);
}

#[test]
fn seven_faults_of_the_link_together() {
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
fn an_empty_column_fails_the_scan() {
    fails(
        &["zero-length=5"],
        "the bridge violates the protocol: a column of 0 bytes is shorter than its fixed part",
    );
}

#[test]
fn two_contents_of_one_column_fail_the_scan() {
    fails(&["torn-column=5"], "received twice with different content");
}

#[test]
fn a_wrong_digest_fails_the_scan() {
    fails(&["wrong-digest"], "ScanEnd states");
}

#[test]
fn unknown_frames_are_skipped_unless_critical() {
    survives(&["unknown-frame=4"]);
    fails(&["unknown-command=4"], "frames of type 0x8777, unknown to version 1.0");
}

#[test]
fn another_protocol_version_is_refused() {
    fails(&["version-mismatch"], "the bridge uses version 2.0 of the protocol, this driver 1.0");
}

#[test]
fn a_missing_scan_end_fails_at_the_deadline() {
    fails_within(Duration::from_secs(3), &["event-lost"], "no scan in time: the scan was still running");
}

#[test]
fn a_lease_held_by_another_client_is_waited_for() {
    survives(&["lease-stuck=1500"]);
    fails_within(Duration::from_secs(2), &["lease-stuck=100000"], "the bridge is busy: held by press-4");
}

#[test]
fn a_scanner_that_starts_up_is_waited_for() {
    survives(&["asleep=1200"]);
    fails_within(Duration::from_secs(2), &["asleep=100000"], "the scanner is starting up");
}

#[test]
fn a_late_answer_to_the_connection_is_waited_for() {
    survives(&["connect-late=1500"]);
}

#[test]
fn an_answer_to_the_connection_beyond_the_time_limit_reconnects() {
    assert_eq!(survives(&["connect-late=6000"]).connections, 2);
}

/// Starts a bridge that scans in a hundredth of a real scanner's time.
fn scaled(faults: &[&str]) -> Bridge {
    start(faults, BridgeConfig { time_scale: 0.01, ..BridgeConfig::default() }, head())
}

#[test]
fn a_mirror_below_its_speed_is_waited_for() {
    survives_on(&scaled(&["start-stall=2"]));
    let bridge = scaled(&["start-stall=6"]);
    let error = scan(&driver(bridge.address(), COARSE), Some(&WINDOW), LIMIT).unwrap_err().to_string();
    assert!(error.contains("(scanner): the mirror did not reach its speed in 5 attempts"), "{error}");
}

#[test]
fn a_stale_status_and_progress_change_nothing() {
    survives_on(&scaled(&["stale-status"]));
    survives_on(&scaled(&["progress-jump"]));
}

#[test]
fn a_rate_altered_by_the_scanner_is_noted() {
    let bridge = bridge(&["params-altered"]);
    let (lattice, _) =
        scan(&driver(bridge.address(), "divisor = 16\nrate_kpts = 244"), Some(&WINDOW), LIMIT).unwrap();
    let notes = &lattice.header().notes;
    assert!(notes.iter().any(|note| note.contains("244 was requested, the scanner set 122")), "{notes:?}");
}

#[test]
fn impossible_settings_are_refused_with_the_reason() {
    let bridge = bridge(&[]);
    let error = scan(&driver(bridge.address(), "divisor = 32\nrate_kpts = 976"), Some(&WINDOW), LIMIT);
    let error = error.unwrap_err().to_string();
    assert!(error.contains("(config): 1/32 at 976 kpts/s requires a mirror frequency of 762 Hz"), "{error}");
}

#[test]
fn a_full_disk_of_the_bridge_is_reported() {
    fails(&["overflow=3"], "the bridge refuses (overflow): the bridge's disk is full");
}

#[test]
fn a_missing_vendor_library_is_reported() {
    fails(&["sdk-missing"], "the scanner's library is not registered on this computer");
}

#[test]
fn a_missing_memory_card_is_reported() {
    fails(&["card-missing"], "there is no card in the scanner");
}

#[test]
fn a_full_memory_card_is_reported() {
    fails(&["storage-full=8"], "the scan ended as failed: the memory card is full");
}

#[test]
fn a_scanner_moved_during_the_scan_is_reported() {
    fails(&["tilted=8"], "the scan ended as failed: the scanner was moved: its inclination changed");
}

#[test]
fn battery_temperature_and_contamination_are_warnings() {
    for fault in ["battery-low", "temperature", "contamination"] {
        survives(&[fault]);
        // The host receives it as a state of the instrument too. A bridge reports it once a second, so the scan takes
        // longer.
        let bridge = start(&[fault], BridgeConfig { time_scale: 0.1, ..BridgeConfig::default() }, head());
        let scanner = driver(bridge.address(), COARSE);
        scan(&scanner, Some(&WINDOW), LIMIT).unwrap();
        let health = scanner.instance().health().unwrap().unwrap();
        let temperature_c = if fault == "temperature" { 46.0 } else { 31.5 };
        let battery = if fault == "battery-low" { 0.04 } else { 0.8 };
        assert_eq!((health.temperature_c, health.battery), (Some(temperature_c), Some(battery)), "{fault}");
        assert!((health.tilt.unwrap().to_degrees() - 0.02).abs() < 1e-9, "{health:?}");
        assert_eq!(health.dirty, fault == "contamination", "{health:?}");
    }
}

#[test]
fn a_wrong_clock_changes_nothing() {
    survives(&["clock-jump"]);
}

#[test]
fn another_scanner_is_refused() {
    let bridge = bridge(&["wrong-scanner"]);
    let scanner = driver(bridge.address(), &format!("{COARSE}\nserial = \"SIM0001\""));
    let error = scan(&scanner, Some(&WINDOW), LIMIT).unwrap_err().to_string();
    assert!(error.contains("scanner SIM9999 answers, SIM0001 is expected"), "{error}");
    assert_eq!(bridge.counters().scans, 0);
}

#[test]
fn columns_sent_after_the_scan_give_the_same_lattice() {
    survives_on(&start(&[], BridgeConfig { live: false, ..BridgeConfig::default() }, head()));
    let cut = BridgeConfig { live: false, time_scale: 0.01, ..BridgeConfig::default() };
    survives_on(&start(&["drop-mid-scan=13"], cut, head()));
}

#[test]
fn a_missing_bridge_fails_at_the_deadline() {
    let limit = Duration::from_secs(1);
    let error = scan(&driver(platen_tests::unserved_address().unwrap(), COARSE), Some(&WINDOW), limit)
        .unwrap_err()
        .to_string();
    assert!(error.contains("no scan in time: the connection broke"), "{error}");
}
