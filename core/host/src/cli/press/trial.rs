//! Command `test`: the handshake at the real press, step by step, with a substitute for scanner and evaluation.
//!
//! Results have the bit `simulated` set: a press that follows the rules of the register map displays them and does not
//! use them.

use std::process::ExitCode;
use std::time::Duration;

use platen_model::{Code, Figures, Language, Measure, Measurement, StrokeKey, Verdict};
use platen_plant::press::{Mode, Press};
use platen_press::{
    Answer, Command, HostSide, LinkState, MemoryJournal, Order, PressLink, Status, channels, run_press,
};

use super::super::run::{runtime, stop_signal};
use super::{Common, Failure, output};
use crate::progress;

use serde_json::json;
use tokio::sync::mpsc;

/// Returns a result whose figures identify its stroke: the number as gap, the session as its place.
pub fn stand_in(key: StrokeKey) -> Measurement {
    let [high, low] = key.session.to_be_bytes().map(f64::from);
    let values = [
        (Measure::GapMax, f64::from(key.stroke % 60_000) * 1e-5),
        (Measure::GapU, low * 1e-3),
        (Measure::GapV, high * 1e-3),
        (Measure::Sense, -1.0),
    ];
    let figures = Figures { values: values.into(), stations: Vec::new() };
    Measurement { judgement: Verdict::Fail.into(), figures, scanned_at: None, warning: None }
}

/// Order that the substitute received.
#[derive(Debug)]
pub enum Seen {
    /// Scan of a stroke.
    Scan(StrokeKey),
    /// Alarm with its detail.
    Alarm(Code, Option<String>),
}

/// Answers every order at once in place of scanner and evaluation, and forwards scans and alarms until the press side
/// ends.
pub async fn serve(
    mut orders: mpsc::UnboundedReceiver<Order>,
    answers: mpsc::UnboundedSender<Answer>,
    seen: mpsc::UnboundedSender<Seen>,
) {
    // A closed channel is the end of its listener.
    let answer = |answer: Answer| drop(answers.send(answer));
    let forward = |what: Seen| drop(seen.send(what));
    answer(Answer::Scanner { ready: Ok(()), estimate: Some(Duration::from_secs(10)) });
    while let Some(order) = orders.recv().await {
        match order {
            Order::Command(Command::Scan { key, .. }) => {
                forward(Seen::Scan(key));
                answer(Answer::Acquired(key));
            }
            Order::Command(Command::Evaluate(key)) => answer(Answer::Result(key, Box::new(stand_in(key)))),
            Order::Alarm { code, detail, .. } => forward(Seen::Alarm(code, detail)),
            Order::Command(Command::Cancel(_) | Command::PartEnd) | Order::Seen(_) => {}
        }
    }
}

/// One step of the handshake: measured figure and its limit.
#[derive(serde::Serialize)]
struct Step {
    #[serde(rename = "step")]
    what: String,
    figure: String,
    limit: String,
    good: bool,
}

#[derive(Default)]
struct Report {
    steps: Vec<Step>,
}

impl Report {
    fn add(
        &mut self,
        what: impl Into<String>,
        figure: impl Into<String>,
        limit: impl Into<String>,
        good: bool,
    ) {
        let step = Step { what: what.into(), figure: figure.into(), limit: limit.into(), good };
        progress::phase(&format!("{}: {}", step.what, step.figure));
        self.steps.push(step);
    }

    fn good(&self) -> bool {
        self.steps.iter().all(|step| step.good)
    }
}

/// Runs the trial; exit code 0 when every step is within its limit.
pub(super) fn run(
    common: &Common,
    mut press: Press,
    strokes: u32,
    patience: Duration,
) -> Result<ExitCode, Failure> {
    press.mode = Mode::Simulate;
    let report = runtime()?.block_on(trial(&press, strokes, patience))?;
    progress::done();
    if common.json {
        output::json(&json!({ "press": press.name, "steps": report.steps, "good": report.good() }))?;
    } else {
        let rows = report.steps.iter().map(|Step { what, figure, limit, good }| {
            let verdict = if *good { "good" } else { "NOT GOOD" };
            vec![what.clone(), figure.clone(), limit.clone(), verdict.to_owned()]
        });
        output::titled("step | seen | limit | ", rows)?;
        output::line(if report.good() { "the handshake works" } else { "the handshake does not work yet" })?;
    }
    Ok(ExitCode::from(u8::from(!report.good())))
}

async fn trial(press: &Press, strokes: u32, patience: Duration) -> Result<Report, Failure> {
    let (HostSide { orders, answers, mut status }, side) = channels();
    let (observer, mut seen) = mpsc::unbounded_channel();
    let journal = MemoryJournal::new(jiff::Timestamp::now().subsec_nanosecond() as u16 | 1);
    tokio::spawn(serve(orders, answers.clone(), observer));
    let ended = tokio::spawn(run_press(press.clone(), PressLink::new(press), journal, side));
    let mut stop = stop_signal()?;
    let mut report = Report::default();
    let tried = tokio::select! {
        tried = strokes_of(press, strokes, patience, &mut status, &mut report) => tried,
        _ = stop.changed() => Err("stopped".into()),
    };
    let missed = status.borrow().metrics.missed;
    report.add("missed strokes", missed.to_string(), "0", missed == 0);
    // The press side may have ended by itself.
    let _ = answers.send(Answer::Stop);
    let _ = ended.await;
    if let Err(why) = tried {
        let mut alarms = Vec::new();
        while let Ok(what) = seen.try_recv() {
            if let Seen::Alarm(code, detail) = what {
                let alarm = code.alarm();
                let detail = detail.map_or(String::new(), |detail| format!(" ({detail})"));
                alarms.push(format!("{code}{detail}; {}", alarm.remedy(Language::En)));
            }
        }
        let newest = alarms.pop().map_or(String::new(), |alarm| format!("; newest alarm: {alarm}"));
        if report.steps.len() <= 1 {
            return Err(Failure::Handshake(format!("{}: {why}{newest}", press.name)));
        }
        report.add("end", format!("{why}{newest}"), format!("{strokes} to make"), false);
    }
    Ok(report)
}

/// Waits for a state of the host.
///
/// # Errors
/// `what` did not occur in time, or the press side ended.
async fn until(
    status: &mut tokio::sync::watch::Receiver<Status>,
    what: &str,
    patience: Duration,
    holds: impl FnMut(&Status) -> bool,
) -> Result<Status, String> {
    match tokio::time::timeout(patience, status.wait_for(holds)).await {
        Ok(Ok(status)) => Ok(status.clone()),
        Ok(Err(_)) => Err("the press side ended".into()),
        Err(_) => Err(format!("{what} did not come in {} s", patience.as_secs_f64())),
    }
}

async fn strokes_of(
    press: &Press,
    strokes: u32,
    patience: Duration,
    status: &mut tokio::sync::watch::Receiver<Status>,
    report: &mut Report,
) -> Result<(), String> {
    let connect = press.link.connect_timeout + press.link.backoff_max + Duration::from_secs(5);
    let online = |status: &Status| status.state.link == LinkState::Online;
    let first = until(status, "the press in step", connect, online).await?;
    report.add("in step", first.state.to_string(), "right press, right map, no other host", true);
    if let Some(beat) = first.press.as_ref().and_then(|it| it.heartbeat) {
        let moved = |status: &Status| {
            status.press.as_ref().and_then(|it| it.heartbeat).is_some_and(|now| now != beat)
        };
        let limit = press.timeouts.heartbeat_in;
        let moves = until(status, "a heartbeat", limit, moved).await;
        let text = moves.map_or_else(|why| why, |_| "moves".into());
        report.add(
            "heartbeat of the press",
            text.clone(),
            format!("{} s", limit.as_secs_f64()),
            text == "moves",
        );
    }
    let ready = until(status, "ready", connect, |status| status.host.ready).await;
    let text = ready.as_ref().map_or_else(Clone::clone, |_| "yes".into());
    report.add("ready for strokes", text, "enable is set", ready.is_ok());
    ready?;
    let published = |status: &Status| status.metrics.measured + status.metrics.not_measured;
    let mut seen = 0;
    while seen < u64::from(strokes) {
        progress::phase(&format!("make stroke {} of {strokes} at the press", seen + 1));
        until(status, "the next stroke", patience, |status| status.metrics.strokes > seen).await?;
        let limit = press.link.response_timeout * 4 + Duration::from_secs(2);
        let after = until(status, "the result", limit, |status| published(status) > seen).await?;
        // If strokes come faster than the status is read, it shows only the last of them.
        seen = published(&after);
        one_stroke(press, &after, report);
        acknowledged(press, seen, status, report).await?;
    }
    Ok(())
}

/// Reports the times of the stroke whose result has just been written.
fn one_stroke(press: &Press, status: &Status, report: &mut Report) {
    let ms = |time: Option<Duration>| {
        time.map_or("-".into(), |time| format!("{:.0} ms", time.as_secs_f64() * 1000.0))
    };
    let key = status.host.result.as_ref().map(|result| result.key);
    let name = key.map_or("stroke".into(), |key| format!("stroke {}", key.stroke));
    let limit = press.link.poll * 3 + Duration::from_millis(20) + press.link.response_timeout;
    let busy = status.metrics.trigger_to_busy.last();
    report.add(
        format!("{name}: trigger to busy"),
        ms(busy),
        ms(Some(limit)),
        busy.is_some_and(|time| time <= limit),
    );
    let error = status.host.error;
    let text = error.map_or_else(|| ms(status.metrics.stroke_to_result.last()), |code| code.to_string());
    report.add(format!("{name}: result"), text, "no error", error.is_none());
}

/// Reports the acknowledge. A press that refuses simulated results, as it should, sends none; the step passes in either
/// case.
async fn acknowledged(
    press: &Press,
    n: u64,
    status: &mut tokio::sync::watch::Receiver<Status>,
    report: &mut Report,
) -> Result<(), String> {
    let limit = press.timeouts.ack;
    let done = |status: &Status| {
        status.metrics.result_to_ack.count + status.metrics.ack_timeouts >= n || status.metrics.strokes > n
    };
    let seen = until(status, "the acknowledge", limit + Duration::from_secs(2), done).await?;
    let acked = seen.metrics.ack_timeouts == 0;
    let text = match seen.metrics.result_to_ack.last() {
        Some(time) if acked => format!("after {:.0} ms", time.as_secs_f64() * 1000.0),
        _ => "none, as is right for a press that refuses simulated results".into(),
    };
    report.add("acknowledge", text, format!("{} s", limit.as_secs_f64()), true);
    Ok(())
}
