//! Tests of the press against a minimal host, over real sockets.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod host;

use std::time::Duration;

use host::{Host, counted};
use platen_sim_press::config::Timings;
use platen_sim_press::faults::StrokeFaults;
use platen_sim_press::{Cause, Command, Config, Counters, SimPress};
use tokio::io::{AsyncBufReadExt, AsyncWriteExt, BufReader};
use tokio::net::TcpStream;
use tokio_modbus::client::{Context, tcp};
use tokio_modbus::prelude::*;

const LIMIT: Duration = Duration::from_secs(30);

fn quick() -> Config {
    let timings = Timings {
        cycle_ms: 2,
        down_ms: 4,
        up_ms: 4,
        between_ms: 0,
        restart_ms: 30,
        heartbeat_ms: 50,
        ..Timings::default()
    };
    Config { strokes: 12, timings, ..Config::default() }
}

async fn connect(press: &SimPress) -> Context {
    tcp::connect_slave(press.modbus().unwrap(), Slave(1)).await.unwrap()
}

/// Runs the minimal host against `config` until the press is done.
async fn run(config: Config) -> (SimPress, Counters) {
    let press = SimPress::start(config).await.unwrap();
    let host = Host::on(connect(&press).await);
    let host = tokio::spawn(host.run(counted));
    let counters = press.until("done", LIMIT, |counters| counters.done).await.unwrap();
    host.abort();
    (press, counters)
}

fn assert_right(counters: &Counters) {
    assert_eq!(counters.wrong, Vec::<String>::new());
    assert_eq!(
        (counters.writes_outside, counters.writes_before_sync, counters.duplicates, counters.changed),
        (0, 0, 0, 0)
    );
    assert_eq!(counters.owners, [4711]);
    for taken in &counters.taken {
        assert_eq!(u32::from(taken.words[55]), 1000 + taken.bends, "stroke {}", taken.stroke_id);
        assert_eq!(taken.words[4], taken.stroke_id);
    }
}

#[tokio::test]
async fn strokes_follow_each_other_and_results_land_under_their_numbers() {
    let (press, counters) = run(quick()).await;
    assert_right(&counters);
    assert_eq!((counters.baselines, counters.strokes, counters.taken.len()), (1, 12, 13));
    let numbers: Vec<u16> = counters.taken.iter().map(|taken| taken.stroke_id).collect();
    assert_eq!(numbers, (1..=13).collect::<Vec<_>>());
    assert_eq!(counters.taken[0].cause, Cause::Baseline);
    assert_eq!(press.p_block()[2] & 1 << 7, 1 << 7, "part_end stands at the end");
}

#[tokio::test]
async fn the_counter_wraps_past_zero() {
    let (_press, counters) = run(Config { stroke_id: 65_530, baseline: false, ..quick() }).await;
    assert_right(&counters);
    let numbers: Vec<u16> = counters.taken.iter().map(|taken| taken.stroke_id).collect();
    assert_eq!(numbers, [65_531, 65_532, 65_533, 65_534, 65_535, 1, 2, 3, 4, 5, 6, 7]);
}

#[tokio::test]
async fn bad_habits_do_not_lose_a_stroke_of_a_host_that_goes_by_numbers() {
    let every = |change: fn(&mut StrokeFaults)| {
        let mut faults = StrokeFaults::default();
        change(&mut faults);
        faults
    };
    let cases = [
        ("torn", every(|f| f.torn = 1.0)),
        ("bounce", every(|f| f.bounce = 1.0)),
        ("repeated trigger", every(|f| f.repeat_trigger = 1.0)),
        ("skip", every(|f| f.skip = 1.0)),
        ("counter back", every(|f| f.counter_back = 1.0)),
        ("no acknowledge", every(|f| f.no_ack = 1.0)),
    ];
    for (name, stroke_faults) in cases {
        let (_press, counters) = run(Config { stroke_faults, strokes: 5, ..quick() }).await;
        assert_right(&counters);
        assert_eq!((counters.strokes, counters.taken.len()), (5, 6), "{name}");
        assert_eq!(counters.skipped, if name == "skip" { 5 } else { 0 }, "{name}");
    }
}

#[tokio::test]
async fn a_host_that_ignores_the_tail_is_caught() {
    let config = Config {
        stroke_faults: StrokeFaults { torn: 1.0, torn_ms: 5_000, ..StrokeFaults::default() },
        baseline: false,
        wait_ready: false,
        ..quick()
    };
    let press = SimPress::start(config).await.unwrap();
    press.until("a trigger", LIMIT, |counters| counters.strokes == 1).await.unwrap();
    let mut client = connect(&press).await;
    let p = client.read_holding_registers(0, 32).await.unwrap().unwrap();
    assert_ne!(p[3], p[31]);
    client.write_single_register(103, p[3]).await.unwrap().unwrap();
    press.until("a wrong value", LIMIT, |counters| counters.wrong_values == 1).await.unwrap();
}

#[tokio::test]
async fn writes_outside_and_before_sync_are_counted() {
    let press = SimPress::start(Config { automatic: false, ..quick() }).await.unwrap();
    let mut client = connect(&press).await;
    client.write_single_register(100, 1).await.unwrap().unwrap();
    let counters = press.counters();
    assert_eq!((counters.writes, counters.writes_before_sync, counters.writes_outside), (1, 1, 0));
    client.read_holding_registers(0, 32).await.unwrap().unwrap();
    client.read_holding_registers(100, 64).await.unwrap().unwrap();
    for address in [99, 163, 164] {
        client.write_multiple_registers(address, &[0, 0]).await.unwrap().unwrap();
    }
    let counters = press.counters();
    assert_eq!((counters.writes, counters.writes_before_sync, counters.writes_outside), (4, 1, 3));
    assert_eq!(client.read_holding_registers(190, 20).await.unwrap(), Err(ExceptionCode::IllegalDataAddress));
    client.set_slave(Slave(2));
    assert_eq!(client.read_holding_registers(0, 1).await.unwrap(), Err(ExceptionCode::GatewayTargetDevice));
}

#[tokio::test]
async fn a_rescan_is_a_new_attempt_of_the_same_stroke() {
    let press = SimPress::start(Config { baseline: false, automatic: false, ..quick() }).await.unwrap();
    assert!(press.command(Command::Rescan).is_err(), "nothing to scan again yet");
    let host = tokio::spawn(Host::on(connect(&press).await).run(counted));
    press.command(Command::Stroke).unwrap();
    press.until("the stroke", LIMIT, |counters| counters.taken.len() == 1).await.unwrap();
    press.command(Command::Rescan).unwrap();
    let counters = press.until("the rescan", LIMIT, |counters| counters.taken.len() == 2).await.unwrap();
    let identities: Vec<_> =
        counters.taken.iter().map(|taken| (taken.stroke_id, taken.attempt, taken.bends)).collect();
    assert_eq!(identities, [(1, 0, 1), (1, 1, 1)]);
    host.abort();
}

#[tokio::test]
async fn a_restart_voids_the_registers_and_begins_a_session() {
    let press = SimPress::start(Config { automatic: false, ..quick() }).await.unwrap();
    press.until("a cycle", LIMIT, |counters| counters.now_ms > 0).await.unwrap();
    let before = press.p_block();
    press.command(Command::Restart).unwrap();
    assert_eq!(press.p_block(), [0; 32]);
    let after = loop {
        press.until("a cycle", LIMIT, |_| true).await.unwrap();
        tokio::task::yield_now().await;
        if press.p_block()[0] == 1 {
            break press.p_block();
        }
    };
    assert_ne!(before[4], after[4], "session");
    assert_eq!(after[3], 0, "stroke number");
}

#[tokio::test]
async fn the_plate_is_served_as_it_lies() {
    let press = SimPress::start(Config { automatic: false, ..quick() }).await.unwrap();
    let stream = TcpStream::connect(press.control()).await.unwrap();
    let (reader, mut writer) = stream.into_split();
    let mut lines = BufReader::new(reader).lines();
    let mut ask = async |line: &str| -> serde_json::Value {
        writer.write_all(format!("{line}\n").as_bytes()).await.unwrap();
        serde_json::from_str(&lines.next_line().await.unwrap().unwrap()).unwrap()
    };
    let flat = ask(r#"{"get":"plate"}"#).await;
    assert_eq!(flat["plate"]["shape"]["shape"], "flat");
    assert_eq!(ask(r#"{"do":"stroke"}"#).await["ok"], true);
    let bent = ask(r#"{"get":"plate"}"#).await;
    assert_eq!((&bent["plate"]["strokes"], &bent["plate"]["shape"]["shape"]), (&1.into(), &"bands".into()));
    assert_eq!(ask(r#"{"get":"stats"}"#).await["stats"]["plates_served"], 2);
    assert_eq!(ask(r#"{"do":{"counter":77}}"#).await["ok"], true);
    assert!(ask(r#"{"get":"nonsense"}"#).await["error"].is_string());
    assert_eq!(ask(r#"{"do":"part_end"}"#).await["ok"], true);
    assert_eq!(ask(r#"{"get":"plate"}"#).await["plate"], serde_json::Value::Null);
}
