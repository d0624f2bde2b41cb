//! Simulated PLC of a press with the host's scanner and journal, for real sockets and for virtual time.

pub(crate) mod memory;
pub(crate) mod plc;
pub(crate) mod server;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use platen_model::Measure;
use platen_model::{Acknowledgement, Figures, Measurement, Recalled, Record, StrokeKey, Verdict};
use platen_press::{Answer, Command, Journal, Order};
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender};

pub(crate) use plc::Plc;

pub(crate) type SharedPlc = Arc<Mutex<Plc>>;

/// Journal in memory that outlives the host.
#[derive(Debug, Clone)]
pub(crate) struct Memory {
    pub(crate) records: Arc<Mutex<Vec<Record>>>,
    pub(crate) full: Arc<Mutex<bool>>,
    /// Planned power cut: index of the record, and whether the cut precedes it.
    cut: Arc<Mutex<Option<(usize, bool)>>>,
    dead: Arc<AtomicBool>,
    owner: u16,
}

#[derive(Debug, thiserror::Error)]
#[error("disk full")]
pub(crate) struct Full;

impl Memory {
    pub(crate) fn new(owner: u16) -> Self {
        let (records, full, cut, dead) = Default::default();
        Self { records, full, cut, dead, owner }
    }

    /// Plans a power cut just before or just after the record with this index is written.
    pub(crate) fn dies_at(&self, record: usize, before: bool) {
        *self.cut.lock().unwrap() = Some((record, before));
    }

    pub(crate) fn died(&self) -> bool {
        self.dead.load(Ordering::SeqCst)
    }

    /// Ends the power cut.
    pub(crate) fn revive(&self) {
        *self.cut.lock().unwrap() = None;
        self.dead.store(false, Ordering::SeqCst);
    }

    pub(crate) fn acked(&self) -> Vec<(StrokeKey, Acknowledgement)> {
        let records = self.records.lock().unwrap();
        let acked = records.iter().filter_map(|record| match record {
            Record::Acked { key, how } => Some((*key, *how)),
            _ => None,
        });
        acked.collect()
    }
}

impl Journal for Memory {
    type Error = Full;

    fn recall(&mut self) -> Result<Recalled, Full> {
        let mut recalled = Recalled::empty(self.owner);
        for record in self.records.lock().unwrap().iter() {
            recalled.replay(record);
        }
        Ok(recalled)
    }

    fn record(&mut self, record: &Record) -> Result<(), Full> {
        if *self.full.lock().unwrap() {
            return Err(Full);
        }
        let mut records = self.records.lock().unwrap();
        let cut = self.cut.lock().unwrap().filter(|(at, _)| *at == records.len());
        // After the cut nothing is written and no answer is sent.
        let lost = self.died() || cut.is_some_and(|(_, before)| before);
        if !lost {
            records.push(record.clone());
        }
        drop(records);
        if lost || cut.is_some() {
            self.dead.store(true, Ordering::SeqCst);
            // An intended panic, without a message.
            std::panic::resume_unwind(Box::new("the power is cut"));
        }
        Ok(())
    }
}

/// Returns the measurement of the simulated scanner: the stroke number in hundredths of a millimetre.
pub(crate) fn measurement(key: StrokeKey) -> Measurement {
    let figure = f64::from(key.stroke % 30_000) * 1e-5;
    Measurement {
        judgement: (if key.stroke.is_multiple_of(2) { Verdict::Pass } else { Verdict::Fail }).into(),
        figures: Figures { values: [(Measure::DeviationMax, figure)].into(), stations: Vec::new() },
        scanned_at: None,
        warning: None,
    }
}

/// Runs a host that scans and evaluates after fixed times and lists the scanned strokes.
pub(crate) async fn host(
    mut orders: UnboundedReceiver<Order>,
    answers: UnboundedSender<Answer>,
    scan: Duration,
    judge: Duration,
    scans: Arc<Mutex<Vec<StrokeKey>>>,
    alarms: Arc<Mutex<Vec<platen_model::Code>>>,
) {
    let ready = Answer::Scanner { ready: Ok(()), estimate: Some(Duration::from_secs(20)) };
    let _ = answers.send(ready);
    while let Some(order) = orders.recv().await {
        let later = |wait: Duration, answer: Answer| {
            let answers = answers.clone();
            tokio::spawn(async move {
                tokio::time::sleep(wait).await;
                let _ = answers.send(answer);
            });
        };
        match order {
            Order::Command(Command::Scan { key, .. }) => {
                scans.lock().unwrap().push(key);
                later(scan, Answer::Acquired(key));
            }
            Order::Command(Command::Evaluate(key)) => {
                later(judge, Answer::Result(key, Box::new(measurement(key))))
            }
            Order::Alarm { code, .. } => alarms.lock().unwrap().push(code),
            Order::Command(Command::Cancel(_) | Command::PartEnd) | Order::Seen(_) => {}
        }
    }
}

/// Runs one cycle of the PLC program every 5 ms.
pub(crate) async fn run_plc(plc: SharedPlc) {
    let start = tokio::time::Instant::now();
    let mut interval = tokio::time::interval(Duration::from_millis(5));
    interval.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
    loop {
        interval.tick().await;
        plc.lock().unwrap().cycle(start.elapsed());
    }
}

/// Waits until the condition holds, at most `limit`.
pub(crate) async fn until(limit: Duration, what: &str, mut holds: impl FnMut() -> bool) {
    let waited = tokio::time::timeout(limit, async {
        while !holds() {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    });
    assert!(waited.await.is_ok(), "{what}: not within {limit:?}");
}
