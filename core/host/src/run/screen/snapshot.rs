//! Snapshot for the pages, as a function of the press side's status and of the events of dispatcher and worker.
//!
//! | rule | where |
//! |---|---|
//! | R3: out of step with the press, no result: the press may have made another stroke | [`Facts::result`] |
//! | R4: from the acceptance of a stroke on, no result until its own is in the registers | [`Facts::result`] |
//! | R5: after the end of the part, and for another part, recipe, session or stroke at the press, no result | [`in_hand`] |
//! | R6: another `boot` after every start | [`Facts::new`] |

use std::collections::BTreeMap;

use jiff::Timestamp;
use platen_model::{Code, Publication, Severity, StrokeData, StrokeKey};
use platen_plant::press::{Mode, Press};
use platen_press::{LinkState, PressImage, Status, Work};
use platen_report::advice::AdviceRecord;
use platen_report::history_view::worst_template;
use platen_screen::{
    AdvicePart, HostPart, LastAdvice, PlatePart, PressPart, RecordPart, ResultPart, SCHEMA, ScannerPart,
    ScannerState, ShownAlarm, Snapshot, Stage, StripPart, StrokePart, Worst,
};

use super::{Event, MeasuredStroke};

/// Strokes of the strip, the newest: a snapshot stays small however long a plate takes.
const STRIP: usize = 32;

/// State of the host as dispatcher and worker last reported it.
#[derive(Debug)]
pub(super) struct Facts {
    boot: String,
    press: String,
    mode: Mode,
    scanner: ScannerPart,
    hand: Option<Hand>,
    measured: Option<MeasuredStroke>,
    /// Result of an earlier start whose record has been searched for.
    recalled: Option<u32>,
    /// Stroke after which the position of the next hit has been bent before.
    again: Option<u32>,
    /// Newest advice.
    advice: Option<Box<AdviceRecord>>,
    /// Record of the last stroke of a part that has ended.
    ended: Option<u32>,
    raised: BTreeMap<Code, u64>,
    /// Active alarms, with their start times.
    standing: BTreeMap<Code, i64>,
}

/// Stroke in progress.
#[derive(Debug)]
struct Hand {
    key: StrokeKey,
    run_id: u32,
    data: Box<StrokeData>,
    since_ms: i64,
    scanned_percent: Option<u8>,
}

fn now_ms() -> i64 {
    Timestamp::now().as_millisecond()
}

impl Facts {
    pub(super) fn new(press: &Press) -> Self {
        Self {
            boot: format!("{}-{}-{}", env!("CARGO_PKG_VERSION"), std::process::id(), now_ms()),
            press: press.name.clone(),
            mode: press.mode,
            scanner: ScannerPart { state: ScannerState::Unknown, estimate_s: None },
            hand: None,
            measured: None,
            recalled: None,
            again: None,
            advice: None,
            ended: None,
            raised: BTreeMap::new(),
            standing: BTreeMap::new(),
        }
    }

    pub(super) fn take(&mut self, event: Event) {
        match event {
            Event::Accepted { key, run_id, data } => {
                self.hand = Some(Hand { key, run_id, data, since_ms: now_ms(), scanned_percent: None });
            }
            Event::Scanned { key, percent } => {
                if let Some(hand) = self.hand.as_mut().filter(|hand| hand.key == key) {
                    hand.scanned_percent = Some(percent);
                }
            }
            Event::PartEnded => self.ended = self.hand.as_ref().map(|hand| hand.run_id).or(self.recalled),
            Event::Alarm(code) => *self.raised.entry(code).or_default() += 1,
            Event::Scanner { ready, estimate_s } => {
                let state = match ready {
                    Ok(()) => ScannerState::Ready,
                    Err(Code::CalibrationInvalid) => ScannerState::NotCalibrated,
                    Err(_) => ScannerState::NotReady,
                };
                self.scanner = ScannerPart { state, estimate_s };
            }
            Event::Measured(measured) => self.measured = Some(*measured),
            Event::Again(run_id) => self.again = Some(run_id),
            Event::Advised(record) => self.advice = Some(record),
        }
    }

    /// Records the active alarms and their start times.
    pub(super) fn observe(&mut self, status: &Status) {
        let now: Vec<Code> =
            [status.link_error, status.host.error, status.host.warning].into_iter().flatten().collect();
        self.standing.retain(|code, _| now.contains(code));
        for code in now {
            self.standing.entry(code).or_insert_with(now_ms);
        }
    }

    /// Returns whether the record of a result is present or expected, or has been searched for.
    pub(super) fn knows(&self, run_id: u32) -> bool {
        let is_in_hand = self.hand.as_ref().is_some_and(|hand| hand.run_id == run_id);
        is_in_hand || self.recalled == Some(run_id) || self.record_of(run_id).is_some()
    }

    /// Adds the record of a result that was published before this start.
    pub(super) fn recall(
        &mut self,
        run_id: u32,
        measured: Option<MeasuredStroke>,
        advice: Option<AdviceRecord>,
    ) {
        self.recalled = Some(run_id);
        self.advice = advice.map(Box::new).or(self.advice.take());
        self.measured = measured.or(self.measured.take());
    }

    /// Returns the newest measured stroke.
    pub(super) fn measured(&self) -> Option<&MeasuredStroke> {
        self.measured.as_ref()
    }

    /// Returns how often each alarm was raised since the start.
    pub(super) fn raised(&self) -> &BTreeMap<Code, u64> {
        &self.raised
    }

    pub(super) fn snapshot(&self, status: &Status, seq: u64) -> Snapshot {
        let in_step = status.state.link == LinkState::Online;
        let result = self.result(status);
        let measured = result.and_then(|result| self.record_of(result.run_id));
        let mode = Mode::ALL.into_iter().find(|(_, mode)| *mode == self.mode).map_or("", |(name, _)| name);
        let simulated = self.measured.as_ref().is_some_and(|measured| measured.record.scan.simulated);
        Snapshot {
            schema: SCHEMA,
            boot: self.boot.clone(),
            seq,
            host: HostPart {
                version: env!("CARGO_PKG_VERSION"),
                mode,
                state: status.state.to_string(),
                simulated: simulated || status.host.simulated,
            },
            press: PressPart {
                name: self.press.clone(),
                in_step,
                alive: status.host.warning != Some(Code::PressStale),
                ready: status.host.ready,
            },
            scanner: self.scanner.clone(),
            record: RecordPart {
                complete: !status.host.storage_degraded && status.metrics.journal_failed == 0,
                lost: status.metrics.journal_failed,
            },
            plate: self.plate(status, measured),
            stroke: self.stroke(status),
            result: result.map(|result| self.shown(result, measured)),
            strip: measured.map(strip).unwrap_or_default(),
            alarms: self.alarms(),
        }
    }

    /// Returns the result of the present stroke (rules R3 to R5).
    fn result<'a>(&self, status: &'a Status) -> Option<&'a Publication> {
        let is_done = stage(status.state.work) == Stage::Done;
        let in_step = status.state.link == LinkState::Online;
        let result = status.host.result.as_ref().filter(|_| is_done && in_step)?;
        let data = self.hand.as_ref().filter(|hand| hand.run_id == result.run_id).map(|hand| &*hand.data);
        let is_last = (result.key.stroke, result.key.session, result.key.attempt)
            == (status.host.ack_stroke_id, status.host.session, status.host.attempt);
        let press = status.press.as_ref()?;
        (is_last && self.ended != Some(result.run_id) && in_hand(result, data, press)).then_some(result)
    }

    /// Returns the result with the additions from its document and the advice.
    fn shown(&self, result: &Publication, measured: Option<&MeasuredStroke>) -> ResultPart {
        let record = measured.map(|measured| &*measured.record);
        let worst = record.and_then(worst_template).map(|template| Worst {
            gap_mm: template.max_gap_mm,
            uncertainty_mm: template.uncertainty_mm,
            limit_mm: template.limit_mm,
            at_mm: template.max_gap_at_mm,
            sense: template.sense,
        });
        let reason = result.measurement.reason();
        ResultPart {
            run: result.run_id,
            verdict: result.measurement.verdict(),
            reason,
            why: reason.map(|code| ShownAlarm::new(code, 0, 0).text),
            worst,
            next: record.and_then(|record| record.next.clone()),
            again: self.again == Some(result.run_id),
            advice: self.advice_of(result.run_id),
            fields: measured.map(|m| m.fields.iter().map(|f| f.name.clone()).collect()).unwrap_or_default(),
        }
    }

    fn advice_of(&self, run_id: u32) -> Option<AdvicePart> {
        let record = self.advice.as_ref().filter(|record| record.run_id == run_id)?;
        let advice = record.advice.as_ref().map(AdvicePart::from)?;
        Some(AdvicePart { last: LastAdvice::of(record), ..advice })
    }

    fn record_of(&self, run_id: u32) -> Option<&MeasuredStroke> {
        self.measured.as_ref().filter(|measured| measured.run_id == run_id)
    }

    fn plate(&self, status: &Status, measured: Option<&MeasuredStroke>) -> Option<PlatePart> {
        let hand = self.hand.as_ref().filter(|hand| self.ended != Some(hand.run_id));
        let press = status.press.as_ref().map(|press| &press.data);
        let [part, recipe] = [hand.map(|hand| &*hand.data), press].map(|data| {
            let data = data?;
            Some((data.part_id, data.recipe_id, data.part_name.clone()))
        });
        let (part, recipe, name) = part.or(recipe).filter(|_| hand.is_some() || measured.is_some())?;
        let record = measured.map(|measured| &*measured.record);
        Some(PlatePart {
            id: record.map(|record| record.plate.clone()).or(name),
            part,
            recipe,
            size_mm: record.map(|record| [record.plate_file.width_mm, record.plate_file.height_mm]),
            press_side: record.and_then(|record| record.plate_file.press_side),
        })
    }

    fn stroke(&self, status: &Status) -> Option<StrokePart> {
        let number = status.host.ack_stroke_id;
        let stage = stage(status.state.work);
        let hand = self.hand.as_ref().filter(|hand| {
            hand.key.stroke == number
                && hand.key.session == status.host.session
                && hand.key.attempt == status.host.attempt
        });
        if number == 0 || hand.is_some_and(|hand| self.ended == Some(hand.run_id)) {
            return None;
        }
        Some(StrokePart {
            run: hand.map(|hand| hand.run_id),
            number,
            attempt: status.host.attempt,
            baseline: hand.is_some_and(|hand| hand.data.baseline),
            stage,
            since_ms: hand.map(|hand| hand.since_ms),
            scanned_percent: hand.and_then(|hand| hand.scanned_percent).filter(|_| stage == Stage::Scanning),
        })
    }

    fn alarms(&self) -> Vec<ShownAlarm> {
        let shown = |(code, since_ms): (&Code, &i64)| {
            ShownAlarm::new(*code, *since_ms, self.raised.get(code).copied().unwrap_or(1))
        };
        let mut alarms: Vec<ShownAlarm> = self.standing.iter().map(shown).collect();
        // Errors first, then by number.
        alarms.sort_by_key(|alarm| (alarm.severity != Severity::Error, alarm.code));
        alarms
    }
}

/// Returns whether a result belongs to the plate and stroke at the press, that is, the press reports no other session,
/// stroke, part or recipe.
fn in_hand(result: &Publication, data: Option<&StrokeData>, press: &PressImage) -> bool {
    let differs = |then: Option<u32>, now: Option<u32>| now.is_some() && then.is_some() && now != then;
    let recipe = |data: &StrokeData| data.recipe_id.map(u32::from);
    let waits = press.trigger && press.stroke_id != 0 && press.stroke_id != result.key.stroke;
    let session = press.session_id != 0 && press.session_id != result.key.session;
    let part = data.is_some_and(|data| differs(data.part_id, press.data.part_id));
    !(waits || session || part || differs(result.recipe_id.map(u32::from), recipe(&press.data)))
}

fn stage(work: Work) -> Stage {
    match work {
        Work::Accepted => Stage::Accepted,
        Work::Scanning => Stage::Scanning,
        Work::Evaluating => Stage::Measuring,
        Work::Aborted | Work::Publish => Stage::Ending,
        Work::Idle | Work::Blocked | Work::WaitAck | Work::Clear => Stage::Done,
    }
}

fn strip(measured: &MeasuredStroke) -> Vec<StripPart> {
    let part = |point: &platen_report::picture::StripPoint| StripPart {
        label: point.label.clone(),
        verdict: point.verdict,
        gap_mm: point.gap_mm,
    };
    measured.strokes[measured.strokes.len().saturating_sub(STRIP)..].iter().map(part).collect()
}

#[cfg(test)]
mod tests {
    use platen_model::{Measurement, Verdict};
    use platen_plant::PlantFile;
    use platen_press::{HostImage, State, channels};

    use super::*;

    const PLANT: &str = include_str!("../../../../../config/sim-plant.toml");

    /// Status in which stroke 4 of part 7, recipe 9, has passed and its result is in the registers.
    fn passed() -> (Facts, Status) {
        let press = PlantFile::parse("sim-plant.toml", PLANT).unwrap().press.unwrap();
        let key = StrokeKey { press: 3, session: 2, stroke: 4, attempt: 0 };
        let data = StrokeData { part_id: Some(7), recipe_id: Some(9), ..StrokeData::default() };
        let mut facts = Facts::new(&press);
        facts.take(Event::Accepted { key, run_id: 11, data: Box::new(data.clone()) });
        let result = Publication {
            key,
            run_id: 11,
            seq: 5,
            recipe_id: Some(9),
            measurement: Measurement {
                judgement: Verdict::Pass.into(),
                ..Measurement::not_measured(Code::ScanFailed)
            },
        };
        let (host, _side) = channels();
        let mut status = host.status.borrow().clone();
        status.state = State { link: LinkState::Online, work: Work::WaitAck };
        status.host = HostImage {
            ack_stroke_id: 4,
            session: 2,
            result: Some(result),
            valid: true,
            ..HostImage::default()
        };
        status.press = Some(PressImage { stroke_id: 4, session_id: 2, data, ..PressImage::default() });
        (facts, status)
    }

    fn verdict(facts: &Facts, status: &Status) -> Option<Verdict> {
        facts.snapshot(status, 0).result.map(|result| result.verdict)
    }

    /// Checks that a change of the status removes the pass.
    #[track_caller]
    fn hides(change: impl Fn(&mut Facts, &mut Status)) {
        let (mut facts, mut status) = passed();
        assert_eq!(verdict(&facts, &status), Some(Verdict::Pass));
        change(&mut facts, &mut status);
        assert_eq!(verdict(&facts, &status), None);
    }

    #[test]
    fn a_pass_stays_until_the_next_stroke() {
        let (facts, mut status) = passed();
        for work in [Work::WaitAck, Work::Clear, Work::Idle, Work::Blocked] {
            status.state.work = work;
            assert_eq!(verdict(&facts, &status), Some(Verdict::Pass), "{work:?}");
        }
    }

    #[test]
    fn from_the_acceptance_on_no_earlier_result_is_shown() {
        for work in [Work::Accepted, Work::Scanning, Work::Evaluating, Work::Aborted, Work::Publish] {
            hides(|_, status| status.state.work = work);
        }
        // The registers already contain the next stroke.
        hides(|_, status| status.host.ack_stroke_id = 5);
        hides(|_, status| status.host.attempt = 1);
    }

    #[test]
    fn out_of_step_no_result_is_shown() {
        for link in [LinkState::Offline, LinkState::Sync, LinkState::Boot, LinkState::Fault(Code::SecondHost)]
        {
            hides(|_, status| status.state.link = link);
        }
        hides(|_, status| status.press = None);
    }

    #[test]
    fn another_plate_or_stroke_at_the_press_hides_the_result() {
        hides(|facts, _| facts.take(Event::PartEnded));
        let press =
            |status: &mut Status, change: fn(&mut PressImage)| status.press.iter_mut().for_each(change);
        hides(|_, status| press(status, |press| press.data.part_id = Some(8)));
        hides(|_, status| press(status, |press| press.data.recipe_id = Some(10)));
        hides(|_, status| press(status, |press| press.session_id = 3));
        hides(|_, status| press(status, |press| (press.trigger, press.stroke_id) = (true, 5)));
        // A value that the press does not report hides nothing.
        let (facts, mut status) = passed();
        press(&mut status, |press| press.data = StrokeData::default());
        assert_eq!(verdict(&facts, &status), Some(Verdict::Pass));
    }

    #[test]
    fn an_alarm_keeps_the_time_since_when_it_stands() {
        let (mut facts, mut status) = passed();
        status.host.warning = Some(Code::PressStale);
        facts.observe(&status);
        let since = facts.snapshot(&status, 0).alarms[0].since_ms;
        facts.standing.insert(Code::PressStale, since - 1000);
        facts.take(Event::Alarm(Code::PressStale));
        facts.observe(&status);
        let alarm = facts.snapshot(&status, 0).alarms.remove(0);
        assert_eq!((alarm.since_ms, alarm.count), (since - 1000, 1));
        status.host.warning = None;
        facts.observe(&status);
        assert!(facts.snapshot(&status, 0).alarms.is_empty());
    }

    #[test]
    fn every_start_has_a_boot_of_its_own() {
        let (facts, status) = passed();
        let boot = facts.snapshot(&status, 0).boot;
        assert!(
            boot.contains(env!("CARGO_PKG_VERSION")) && boot.contains(&std::process::id().to_string()),
            "{boot}"
        );
    }
}
