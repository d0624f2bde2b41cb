//! Test rig: the simulated press and the product's press side on real sockets, with a scanner that only counts.
//!
//! The scanner requests the state of the plate at the press's second port and reports the number of its bends as a gap.
//! A result under the wrong stroke is therefore visible in the press's own count. All assertions are made on the
//! press's side.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use platen_model::Measure;
use platen_model::{Code, Figures, Measurement, Recalled, Record, StrokeKey, Verdict};
use platen_plant::press::{Link, Press};
use platen_press::{Answer, Command, Journal, Order, PressLink, Status, channels, run_press};
use platen_sim_plate::Plan;
use platen_sim_press::config::Timings;
use platen_sim_press::forming_model::PlateConfig;
use platen_sim_press::{Config, Counters, SimPress};
use tokio::io::{AsyncBufReadExt, AsyncWriteExt, BufReader};
use tokio::net::TcpStream;
use tokio::sync::{mpsc, watch};
use tokio::task::{JoinHandle, JoinSet};

/// Longer than the duration of any of these tests on a busy machine.
pub(crate) const LIMIT: Duration = Duration::from_secs(300);

/// Returns a press whose ram is very fast, with a programme of 70 light strokes. It waits a minute, not 2 s, for a host
/// without a heartbeat: the time until a host reconnects depends on its back-off and on the machine, and is tested in
/// virtual time.
pub(crate) fn quick() -> Config {
    let timings = Timings {
        cycle_ms: 2,
        down_ms: 4,
        up_ms: 4,
        between_ms: 0,
        restart_ms: 60,
        heartbeat_ms: 100,
        host_ms: 60_000,
        ..Timings::default()
    };
    let plan = Plan { passes: 10, ..Plan::default() };
    Config {
        baseline: false,
        timings,
        plate: PlateConfig { plan, ..PlateConfig::default() },
        ..Config::default()
    }
}

/// Returns the plant description of a press at `address`.
pub(crate) fn tcp(address: SocketAddr) -> Press {
    Press::pph1("Press 3", 3, Link::tcp(address.ip().to_string(), address.port(), 1))
}

/// Runs cells concurrently: each has a press, a line and a host of its own, and is idle most of the time.
pub(crate) async fn beside_each_other<F: Future<Output = ()> + Send + 'static>(
    cells: impl IntoIterator<Item = F>,
) {
    let mut cells: JoinSet<()> = cells.into_iter().collect();
    while let Some(cell) = cells.join_next().await {
        cell.unwrap();
    }
}

/// Journal in memory: the content of the disk, which survives the host.
#[derive(Clone, Debug)]
pub(crate) struct Memory {
    owner: u16,
    records: Arc<Mutex<Vec<Record>>>,
}

impl Memory {
    pub(crate) fn new(owner: u16) -> Self {
        Self { owner, records: Arc::default() }
    }

    /// Returns how often each stroke was accepted.
    pub(crate) fn accepted(&self) -> BTreeMap<StrokeKey, usize> {
        let mut accepted = BTreeMap::new();
        for record in self.records.lock().unwrap().iter() {
            if let Record::Accepted { key, .. } = record {
                *accepted.entry(*key).or_default() += 1;
            }
        }
        accepted
    }
}

impl Journal for Memory {
    type Error = Infallible;

    fn recall(&mut self) -> Result<Recalled, Infallible> {
        let mut recalled = Recalled::empty(self.owner);
        for record in self.records.lock().unwrap().iter() {
            recalled.replay(record);
        }
        Ok(recalled)
    }

    fn record(&mut self, record: &Record) -> Result<(), Infallible> {
        self.records.lock().unwrap().push(record.clone());
        Ok(())
    }
}

/// Orders and alarms that the host received.
#[derive(Clone, Debug, Default)]
pub(crate) struct Heard {
    pub(crate) scans: Arc<Mutex<Vec<StrokeKey>>>,
    pub(crate) alarms: Arc<Mutex<Vec<Code>>>,
    pub(crate) part_ends: Arc<Mutex<usize>>,
}

impl Heard {
    pub(crate) fn alarmed(&self, code: Code) -> bool {
        self.alarms.lock().unwrap().contains(&code)
    }
}

/// One run of the product's press side with a scanner that counts bends.
pub(crate) struct Host {
    pub(crate) status: watch::Receiver<Status>,
    pub(crate) heard: Heard,
    answers: mpsc::UnboundedSender<Answer>,
    run: JoinHandle<()>,
    desk: JoinHandle<()>,
}

impl Host {
    /// Starts on `press` with a scan of `scan`; the plate is requested at `cell`.
    pub(crate) fn start(press: Press, journal: Memory, cell: SocketAddr, scan: Duration) -> Self {
        let link = PressLink::new(&press);
        Self::on(press, link, journal, cell, scan)
    }

    /// Starts on an existing link.
    pub(crate) fn on(
        press: Press,
        link: PressLink,
        journal: Memory,
        cell: SocketAddr,
        scan: Duration,
    ) -> Self {
        let (host, side) = channels();
        let run = tokio::spawn(async move { run_press(press, link, journal, side).await.unwrap() });
        let heard = Heard::default();
        let answers = host.answers;
        let desk = tokio::spawn(desk(host.orders, answers.clone(), heard.clone(), cell, scan));
        Self { status: host.status, heard, answers, run, desk }
    }

    /// Ends it like a signal and waits for its last writes.
    pub(crate) async fn stop(self) {
        self.answers.send(Answer::Stop).unwrap();
        self.run.await.unwrap();
        self.desk.abort();
    }

    /// Ends it like a power cut.
    pub(crate) async fn kill(self) {
        self.run.abort();
        self.desk.abort();
        // Both were cancelled, which is their result.
        let _ = (self.run.await, self.desk.await);
    }

    /// Resets faults like the operator.
    pub(crate) fn reset(&self) {
        self.answers.send(Answer::Reset).unwrap();
    }

    /// Waits until `holds` is true of the status.
    pub(crate) async fn until(&mut self, what: &str, holds: impl FnMut(&Status) -> bool) {
        let waited =
            tokio::time::timeout(LIMIT, self.status.wait_for(holds)).await.map(|found| found.map(|_| ()));
        let status = match waited {
            Ok(Ok(_)) => return,
            _ => self.status.borrow().clone(),
        };
        panic!("{what}: did not come; alarms {:?}, {status:?}", self.heard.alarms.lock().unwrap());
    }
}

/// Runs scanner and evaluation of the host.
async fn desk(
    mut orders: mpsc::UnboundedReceiver<Order>,
    answers: mpsc::UnboundedSender<Answer>,
    heard: Heard,
    cell: SocketAddr,
    scan: Duration,
) {
    let bends: Arc<Mutex<BTreeMap<StrokeKey, u32>>> = Arc::default();
    let answer = |answer| {
        // The press side may have ended; then the answer is not needed.
        let _ = answers.send(answer);
    };
    answer(Answer::Scanner { ready: Ok(()), estimate: Some(Duration::from_secs(20)) });
    while let Some(order) = orders.recv().await {
        match order {
            Order::Command(Command::Scan { key, .. }) => {
                heard.scans.lock().unwrap().push(key);
                let (answers, bends) = (answers.clone(), Arc::clone(&bends));
                tokio::spawn(async move {
                    let seen = look(cell).await;
                    tokio::time::sleep(scan).await;
                    let answer = match seen {
                        Some(strokes) => {
                            bends.lock().unwrap().insert(key, strokes);
                            Answer::Acquired(key)
                        }
                        None => Answer::Failed(key, Code::PlateNotFound),
                    };
                    let _ = answers.send(answer);
                });
            }
            Order::Command(Command::Evaluate(key)) => {
                let seen = bends.lock().unwrap().get(&key).copied();
                answer(match seen {
                    Some(strokes) => Answer::Result(key, Box::new(measurement(strokes))),
                    None => Answer::Failed(key, Code::EvaluationFailed),
                });
            }
            Order::Alarm { code, .. } => heard.alarms.lock().unwrap().push(code),
            Order::Command(Command::PartEnd) => *heard.part_ends.lock().unwrap() += 1,
            Order::Command(Command::Cancel(_)) | Order::Seen(_) => {}
        }
    }
}

/// Returns how often the plate in the press was bent; `None` while it moves or is missing.
async fn look(cell: SocketAddr) -> Option<u32> {
    let stream = TcpStream::connect(cell).await.unwrap();
    let (reader, mut writer) = stream.into_split();
    writer.write_all(b"{\"get\":\"plate\"}\n").await.unwrap();
    let line = BufReader::new(reader).lines().next_line().await.unwrap().unwrap();
    let reply: serde_json::Value = serde_json::from_str(&line).unwrap();
    reply["plate"]["strokes"].as_u64().map(|strokes| strokes.try_into().unwrap())
}

/// Returns a gap that identifies its bend; it never passes.
fn measurement(strokes: u32) -> Measurement {
    let values = BTreeMap::from([
        (Measure::GapMax, f64::from(1000 + strokes) * 1e-5),
        (Measure::GapU, 1.5),
        (Measure::GapV, -0.25),
        (Measure::Sense, -1.0),
    ]);
    let figures = Figures { values, stations: Vec::new() };
    Measurement { judgement: Verdict::Fail.into(), figures, scanned_at: None, warning: None }
}

/// Asserts the conditions that hold for every run, with any fault.
pub(crate) fn assert_clean(counters: &Counters) {
    let counts = [
        ("writes outside the H block", counters.writes_outside),
        ("writes before both blocks were read", counters.writes_before_sync),
        ("writes after registers without the map were read", counters.writes_while_void),
        ("results published twice", counters.duplicates),
        ("results that changed", counters.changed),
    ];
    for (what, count) in counts {
        assert_eq!(count, 0, "{what}: {counters:?}");
    }
    assert_eq!(counters.wrong, Vec::<String>::new(), "{counters:?}");
    for taken in &counters.taken {
        if taken.verdict == platen_sim_press::registers::Verdict::NotMeasured {
            continue;
        }
        let identity = (taken.stroke_id, taken.attempt);
        assert_eq!(u32::from(taken.words[55]), 1000 + taken.bends, "gap of {identity:?}");
        assert_eq!((taken.words[57], taken.words[58].cast_signed()), (1500, -250), "place of {identity:?}");
        assert_eq!((taken.words[4], taken.words[61]), identity);
    }
}

/// Starts the press and the host on it, and waits until all strokes are made.
pub(crate) async fn run(config: Config, scan: Duration) -> (SimPress, Host, Counters) {
    let press = SimPress::start(config).await.unwrap();
    let host = Host::start(tcp(press.modbus().unwrap()), Memory::new(7), press.control(), scan);
    let counters = done(&press, &host).await;
    (press, host, counters)
}

/// Waits until all strokes are made.
pub(crate) async fn done(press: &SimPress, host: &Host) -> Counters {
    match press.until("all strokes", LIMIT, |counters| counters.done).await {
        Ok(counters) => counters,
        Err(late) => {
            let (p, h, alarms) = (press.p_block(), press.h_block().0, host.heard.alarms.lock().unwrap());
            panic!("{late}; P {p:?}, H {h:?}, alarms {alarms:?}, {}", host.status.borrow().state)
        }
    }
}
