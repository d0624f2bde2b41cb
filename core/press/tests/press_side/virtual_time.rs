//! Whole press side against the simulated PLC in virtual time: faults of the PLC program, of the link, restarts.

use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use crate::simulated_plc::memory::{Chaos, MemoryLink};
use crate::simulated_plc::plc::{H, Habits, P};
use crate::simulated_plc::{Memory, Plc, SharedPlc};
use platen_model::{Acknowledgement, Code, StrokeKey};
use platen_plant::press::{Link, Mode, Press};
use platen_press::{Answer, HostSide, RunError, channels, run_press};
use tokio::task::JoinHandle;

const MS: fn(u64) -> Duration = Duration::from_millis;

/// Simulated PLC and journal, with hosts that can be killed and started again.
struct Cell {
    plc: SharedPlc,
    journal: Memory,
    chaos: Chaos,
    seed: u64,
    mode: Mode,
    scans: Arc<Mutex<Vec<StrokeKey>>>,
    alarms: Arc<Mutex<Vec<Code>>>,
}

struct Host {
    run: JoinHandle<Result<(), RunError<crate::simulated_plc::Full>>>,
    scanner: JoinHandle<()>,
    answers: tokio::sync::mpsc::UnboundedSender<Answer>,
    status: tokio::sync::watch::Receiver<platen_press::Status>,
    reachable: Arc<std::sync::atomic::AtomicBool>,
    reset_next: Arc<std::sync::atomic::AtomicBool>,
    lose_withdrawal: Arc<std::sync::atomic::AtomicBool>,
}

impl Cell {
    fn new(first_stroke: u16) -> Self {
        let plc: SharedPlc = Arc::new(Mutex::new(Plc::new(3, first_stroke)));
        tokio::spawn(crate::simulated_plc::run_plc(plc.clone()));
        let journal = Memory::new(7);
        let (scans, alarms) = (Arc::default(), Arc::default());
        Self { plc, journal, chaos: Chaos::default(), seed: 1, mode: Mode::Measure, scans, alarms }
    }

    fn habits(first_stroke: u16, habits: Habits) -> Self {
        let cell = Self::new(first_stroke);
        cell.plc().habits = habits;
        cell
    }

    fn plc(&self) -> std::sync::MutexGuard<'_, Plc> {
        self.plc.lock().unwrap()
    }

    fn start(&self) -> Host {
        self.start_on(&self.journal, 3)
    }

    fn start_on(&self, journal: &Memory, press_id: u16) -> Host {
        let mut press = Press::pph1("Press 3", press_id, Link::tcp("memory", 502, 1));
        press.mode = self.mode;
        let link = MemoryLink::new(self.plc.clone(), self.chaos, self.seed);
        let reachable = Arc::clone(&link.reachable);
        let reset_next = Arc::clone(&link.reset_next);
        let lose_withdrawal = Arc::clone(&link.lose_withdrawal);
        let (HostSide { orders, answers, status }, side) = channels();
        let (scans, alarms) = (Arc::clone(&self.scans), Arc::clone(&self.alarms));
        let scanner =
            tokio::spawn(crate::simulated_plc::host(orders, answers.clone(), MS(40), MS(10), scans, alarms));
        let run = tokio::spawn(run_press(press, link, journal.clone(), side));
        Host { run, scanner, answers, status, reachable, reset_next, lose_withdrawal }
    }

    /// Makes `strokes` more strokes and waits until the PLC has finished them.
    async fn strokes(&self, strokes: usize) {
        self.plc().to_do = strokes;
        crate::simulated_plc::until(Duration::from_secs(600 * strokes as u64), "strokes", || {
            self.plc().idle()
        })
        .await;
    }

    /// Asserts the invariants on the PLC's side; returns the numbers of results and scans.
    fn check(&self) -> (usize, usize) {
        let plc = self.plc();
        assert_eq!(plc.outside, 0, "writes outside the allowed registers");
        assert_eq!(plc.swapped, 0, "a result that changed while it was valid");
        for result in &plc.results {
            let measured = result.status & 1 << 12 == 0;
            assert!(
                !measured || result.dev_max == result.stroke % 30_000,
                "another stroke's figure: {result:?}"
            );
            assert!(measured || result.dev_max == 0x8000, "a figure without a measurement: {result:?}");
        }
        let mut scans = self.scans.lock().unwrap().clone();
        let n_scans = scans.len();
        scans.sort();
        scans.dedup();
        assert_eq!(scans.len(), n_scans, "a stroke was scanned twice");
        (plc.results.len(), n_scans)
    }

    fn alarmed(&self, code: Code) -> usize {
        self.alarms.lock().unwrap().iter().filter(|&&alarm| alarm == code).count()
    }
}

impl Host {
    async fn stop(self) {
        self.answers.send(Answer::Stop).unwrap();
        self.run.await.unwrap().unwrap();
    }

    /// Kills the host without a last write.
    async fn kill(self) {
        self.run.abort();
        self.scanner.abort();
        let _ = self.run.await;
    }
}

async fn habit(first_stroke: u16, habits: Habits, strokes: usize) -> Cell {
    let cell = Cell::habits(first_stroke, habits);
    let host = cell.start();
    cell.strokes(strokes).await;
    host.stop().await;
    assert_eq!(cell.check(), (strokes, strokes));
    cell
}

#[tokio::test(start_paused = true)]
async fn a_bouncing_trigger_is_one_stroke() {
    habit(0, Habits { bounce: true, ..Habits::default() }, 40).await;
}

#[tokio::test(start_paused = true)]
async fn a_trigger_that_stays_is_one_stroke() {
    habit(0, Habits { keeps_trigger: true, ..Habits::default() }, 40).await;
}

#[tokio::test(start_paused = true)]
async fn a_press_that_never_acknowledges_still_gets_every_result() {
    let cell = habit(0, Habits { no_ack: true, ..Habits::default() }, 40).await;
    let acked = cell.journal.acked();
    assert_eq!(acked.len(), 39);
    assert!(acked.iter().all(|(_, how)| *how == Acknowledgement::NextStroke));
}

#[tokio::test(start_paused = true)]
async fn a_counter_that_jumps_by_two_is_one_missed_stroke() {
    let cell = habit(0, Habits { jump_at: Some(20), ..Habits::default() }, 40).await;
    assert_eq!(cell.alarmed(Code::MissedStroke), 1);
    assert_eq!(cell.plc().regs[109], 1, "missed_count");
}

#[tokio::test(start_paused = true)]
async fn the_counter_wraps_to_one() {
    let cell = habit(65_525, Habits::default(), 30).await;
    assert_eq!(cell.alarmed(Code::MissedStroke), 0);
    assert_eq!(cell.plc().results.last().unwrap().stroke, 20);
}

#[tokio::test(start_paused = true)]
async fn a_counter_set_back_with_a_new_session_is_no_missed_stroke() {
    let cell = habit(500, Habits { back_at: Some(15), ..Habits::default() }, 40).await;
    assert_eq!(cell.alarmed(Code::MissedStroke) + cell.alarmed(Code::CounterBack), 0);
}

#[tokio::test(start_paused = true)]
async fn a_torn_block_is_read_again() {
    habit(0, Habits { torn_cycles: 12, ..Habits::default() }, 20).await;
}

#[tokio::test(start_paused = true)]
async fn a_press_that_moves_during_the_scan_gets_not_measured() {
    let cell = habit(0, Habits { unclear_after_ms: Some(20), ..Habits::default() }, 3).await;
    let errors: Vec<_> = cell.plc().results.iter().map(|result| result.error).collect();
    assert_eq!(errors, [Code::NotClear.number(); 3]);
}

/// Soak test: 10,000 strokes with 1 % late answers, 0.5 % resets and 0.5 % lost answers to requests that were carried
/// out.
#[tokio::test(start_paused = true)]
async fn ten_thousand_strokes_on_a_bad_link() {
    let seed = 0x5EED;
    let mut cell = Cell::new(60_000);
    cell.chaos = Chaos { late: 10, reset: 5, lost: 5 };
    cell.seed = seed;
    let host = cell.start();
    cell.strokes(10_000).await;
    let status = host.status.borrow().clone();
    host.stop().await;
    assert_eq!(cell.check(), (10_000, 10_000), "seed {seed}");
    assert!(cell.plc().gave_up.is_empty(), "seed {seed}");
    assert_eq!(cell.alarmed(Code::MissedStroke), 0, "seed {seed}");
    assert!(status.counts.poisoned > 1000, "the link was bad: {:?}", status.counts);
}

/// Repeated kills of the host in all states: each stroke is delivered or reported as not measured.
#[tokio::test(start_paused = true)]
async fn a_host_that_is_killed_loses_no_stroke() {
    for seed in 1..=40u64 {
        let cell = Cell::new(0);
        cell.plc().to_do = 20;
        let mut kills = 0;
        while !cell.plc().idle() {
            let host = cell.start();
            let life = 37 + (seed * 7919 + kills * 104_729) % 160;
            tokio::time::sleep(MS(life)).await;
            kills += 1;
            host.kill().await;
            assert!(kills < 2000, "seed {seed}: the strokes never end");
        }
        let (results, scans) = cell.check();
        assert_eq!(results, 20, "seed {seed}: a stroke was lost, {kills} kills");
        let interrupted = cell.plc().results.iter().filter(|result| result.status & 1 << 12 != 0).count();
        assert!(
            scans + interrupted >= 20,
            "seed {seed}: {scans} scans, {interrupted} reported as interrupted"
        );
    }
}

#[tokio::test(start_paused = true)]
async fn a_press_that_restarts_is_not_written_to_before_it_is_known() {
    let cell = Cell::new(0);
    let host = cell.start();
    cell.strokes(5).await;
    let writes = {
        let mut plc = cell.plc();
        plc.restart(0xB002);
        plc.regs[P] = 0;
        plc.writes
    };
    tokio::time::sleep(MS(3000)).await;
    assert!(cell.plc().writes <= writes + 1, "at most the write that was under way");
    assert_eq!(cell.alarmed(Code::MapVersion), 1);
    cell.plc().regs[P] = 1;
    cell.strokes(5).await;
    host.stop().await;
    assert_eq!(cell.check(), (10, 10));
    assert_eq!(cell.alarmed(Code::MissedStroke), 0);
}

#[tokio::test(start_paused = true)]
async fn a_link_cut_in_the_middle_of_a_scan_delivers_once() {
    let cell = Cell::new(0);
    let host = cell.start();
    cell.strokes(3).await;
    cell.plc().to_do = 1;
    crate::simulated_plc::until(MS(2000), "the fourth scan", || cell.scans.lock().unwrap().len() == 4).await;
    host.reachable.store(false, Ordering::SeqCst);
    tokio::time::sleep(MS(1500)).await;
    assert_eq!(cell.plc().results.len(), 3);
    let waits = || host.status.borrow().metrics.result_waits;
    assert!(waits().is_some_and(|since| since > MS(1000)), "{:?}", waits());
    host.reachable.store(true, Ordering::SeqCst);
    crate::simulated_plc::until(MS(2000), "the result after the link is back", || cell.plc().idle()).await;
    crate::simulated_plc::until(MS(1000), "no result to wait", || waits().is_none()).await;
    host.stop().await;
    assert_eq!(cell.check(), (4, 4));
}

#[tokio::test(start_paused = true)]
async fn a_result_that_could_not_be_withdrawn_is_withdrawn_before_the_next_one() {
    let cell = Cell::habits(0, Habits { no_ack: true, ..Habits::default() });
    let host = cell.start();
    cell.strokes(3).await;
    // The third result is still valid when the fourth stroke is measured without a link.
    host.lose_withdrawal.store(true, Ordering::SeqCst);
    cell.plc().to_do = 1;
    crate::simulated_plc::until(MS(20_000), "the lost link", || !host.reachable.load(Ordering::SeqCst)).await;
    tokio::time::sleep(MS(1000)).await;
    assert_eq!(cell.scans.lock().unwrap().len(), 4);
    host.reachable.store(true, Ordering::SeqCst);
    crate::simulated_plc::until(MS(20_000), "the fourth result", || cell.plc().idle()).await;
    host.stop().await;
    assert_eq!(cell.check(), (4, 4));
}

/// Returns the virtual time from `change` to the next ready state.
async fn in_step_after(host: &mut Host, change: impl FnOnce(&mut Host)) -> Duration {
    let connects = host.status.borrow().counts.connects;
    change(host);
    let start = tokio::time::Instant::now();
    let back = |status: &platen_press::Status| status.counts.connects > connects && status.host.ready;
    tokio::time::timeout(MS(60_000), host.status.wait_for(back)).await.unwrap().unwrap();
    start.elapsed()
}

#[tokio::test(start_paused = true)]
async fn a_press_that_was_away_is_found_within_two_seconds() {
    let cell = Cell::new(0);
    let mut host = cell.start();
    cell.strokes(2).await;
    for away in [50, 700, 5_000, 30_000, 61_300] {
        host.reachable.store(false, Ordering::SeqCst);
        tokio::time::sleep(MS(away)).await;
        let took = in_step_after(&mut host, |host| host.reachable.store(true, Ordering::SeqCst)).await;
        println!("away {away} ms: in step {} ms after it was back", took.as_millis());
        assert!(took <= MS(2000), "{took:?} after {away} ms");
    }
    host.stop().await;
    assert_eq!(cell.check(), (2, 2));
}

#[tokio::test(start_paused = true)]
async fn a_single_reset_costs_little() {
    let cell = Cell::new(0);
    let mut host = cell.start();
    cell.strokes(2).await;
    for _ in 0..20 {
        tokio::time::sleep(MS(1000)).await;
        let took = in_step_after(&mut host, |host| host.reset_next.store(true, Ordering::SeqCst)).await;
        // One poll and one status report until detection; reconnection without a pause.
        assert!(took <= MS(20 + 200 + 30), "{took:?}");
    }
    host.stop().await;
    cell.check();
}

/// Response time on a clean link: 99 % within three polls and 20 ms, on the PLC's clock.
#[tokio::test(start_paused = true)]
async fn trigger_to_busy_on_a_clean_link() {
    let cell = Cell::new(0);
    let host = cell.start();
    cell.strokes(1000).await;
    host.stop().await;
    let mut times = cell.plc().accept_ms.clone();
    times.sort_unstable();
    let p99 = times[times.len() * 99 / 100];
    println!(
        "trigger to busy: median {} ms, 99 % within {p99} ms, most {} ms",
        times[times.len() / 2],
        times[times.len() - 1]
    );
    assert!(p99 <= 3 * 20 + 20, "{p99} ms");
}

/// Kill of the host just before and just after each record of a stroke is written.
#[tokio::test(start_paused = true)]
async fn a_host_killed_round_each_record_of_the_journal() {
    for dies_before in [true, false] {
        for record in 0..12 {
            let cell = Cell::new(0);
            cell.plc().to_do = 3;
            cell.journal.dies_at(record, dies_before);
            let host = cell.start();
            crate::simulated_plc::until(MS(10_000), "the record", || cell.journal.died()).await;
            host.kill().await;
            cell.journal.revive();
            let host = cell.start();
            crate::simulated_plc::until(MS(60_000), "the strokes", || cell.plc().idle()).await;
            host.stop().await;
            let (results, scans) = cell.check();
            let interrupted = cell.plc().results.iter().filter(|result| result.status & 1 << 12 != 0).count();
            let point = format!("record {record}, {}", if dies_before { "before" } else { "after" });
            assert_eq!(results, 3, "{point}: a stroke was lost");
            assert!(
                scans + interrupted >= 3 && interrupted <= 1,
                "{point}: {scans} scans, {interrupted} interrupted"
            );
            let mut seqs: Vec<_> = cell.plc().results.iter().map(|result| result.seq).collect();
            seqs.dedup();
            assert_eq!(seqs.len(), 3, "{point}: a result came twice");
        }
    }
}

#[tokio::test(start_paused = true)]
async fn a_second_host_stands_back_and_the_first_goes_on() {
    let cell = Cell::new(0);
    let first = cell.start();
    cell.strokes(2).await;
    let second = cell.start_on(&Memory::new(8), 3);
    tokio::time::sleep(MS(3000)).await;
    assert_eq!(second.status.borrow().link_error, Some(Code::SecondHost));
    assert_eq!(second.status.borrow().counts.writes, 0);
    cell.strokes(5).await;
    assert_eq!(first.status.borrow().link_error, None);
    second.stop().await;
    first.stop().await;
    assert_eq!(cell.check(), (7, 7));
}

#[tokio::test(start_paused = true)]
async fn a_dead_hosts_registers_are_taken_over() {
    let cell = Cell::new(0);
    let first = cell.start();
    cell.strokes(2).await;
    first.kill().await;
    let second = cell.start_on(&Memory::new(8), 3);
    cell.strokes(2).await;
    second.stop().await;
    assert_eq!(cell.check().0, 4);
}

#[tokio::test(start_paused = true)]
async fn the_wrong_press_is_never_written_to() {
    let cell = Cell::new(0);
    let host = cell.start_on(&cell.journal, 4);
    tokio::time::sleep(MS(10_000)).await;
    assert_eq!(host.status.borrow().link_error, Some(Code::PressId));
    assert_eq!(cell.alarmed(Code::PressId), 1, "one alarm per cause");
    host.stop().await;
    assert_eq!(cell.plc().writes, 0);
}

/// A controller refuses one register of the result: ready is withdrawn, and the reason is written to the registers that
/// it accepts.
#[tokio::test(start_paused = true)]
async fn ready_is_withdrawn_after_a_refused_register() {
    for (refused, withdrawn) in [(30, true), (2, false)] {
        let cell = Cell::new(0);
        let host = cell.start();
        tokio::time::sleep(MS(1000)).await;
        assert_eq!(cell.plc().regs[H + 2] & 1, 1, "ready");
        cell.plc().habits.refuses = Some(refused);
        cell.plc().to_do = 1;
        tokio::time::sleep(MS(2000)).await;
        assert_eq!(host.status.borrow().link_error, Some(Code::IllegalAddress));
        let (ready, error, writes) = {
            let plc = cell.plc();
            (plc.regs[H + 2] & 1 == 1, plc.regs[H + 6], plc.writes)
        };
        assert_eq!((ready, error == Code::IllegalAddress as u16), (!withdrawn, true));
        tokio::time::sleep(MS(10_000)).await;
        assert_eq!(cell.plc().writes, writes, "nothing else is written until the reset");
        host.stop().await;
    }
}

#[tokio::test(start_paused = true)]
async fn listening_and_dry_runs_never_write() {
    for mode in [Mode::Off, Mode::Listen, Mode::DryRun] {
        let mut cell = Cell::new(0);
        cell.mode = mode;
        let host = cell.start();
        tokio::time::sleep(MS(25_000)).await;
        let counts = host.status.borrow().counts.clone();
        assert!(mode == Mode::Off || counts.requests > 1000, "{mode:?}: {counts:?}");
        host.stop().await;
        assert_eq!(cell.plc().writes, 0, "{mode:?}");
    }
}

#[tokio::test(start_paused = true)]
async fn a_full_disk_stops_no_result_and_is_reported() {
    let cell = Cell::new(0);
    let host = cell.start();
    cell.strokes(2).await;
    *cell.journal.full.lock().unwrap() = true;
    cell.strokes(3).await;
    assert_eq!(cell.alarmed(Code::StorageFailed), 1);
    let status = cell.plc().results.last().unwrap().status;
    assert_ne!(status & 1 << 10, 0, "storage_degraded");
    assert!(host.status.borrow().metrics.journal_failed >= 3);
    *cell.journal.full.lock().unwrap() = false;
    cell.strokes(2).await;
    assert_eq!(cell.plc().results.last().unwrap().status & 1 << 10, 0);
    host.stop().await;
    assert_eq!(cell.check(), (7, 7));
}

#[tokio::test(start_paused = true)]
async fn the_registers_are_safe_after_a_stop_in_the_middle_of_a_scan() {
    let cell = Cell::new(0);
    let host = cell.start();
    cell.plc().to_do = 1;
    crate::simulated_plc::until(MS(2000), "a scan", || cell.scans.lock().unwrap().len() == 1).await;
    host.stop().await;
    let plc = cell.plc();
    assert_eq!((plc.regs[102], plc.regs[106]), (0, 0), "status and error_code");
}
