//! The press's journal, kept in the history.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use jiff::Timestamp;
use platen_history::{Accepted, Error, Finished, History, Stage as Kept};
use platen_press::{
    Acked, Entry, Journal, Language, Publication, Recalled, Record, Stage, StrokeData, StrokeKey, Verdict,
};

/// The history as the press side's journal.
#[derive(Debug)]
pub(super) struct Adapter(pub(super) Arc<Mutex<History>>);

pub(super) fn kept_key(key: StrokeKey) -> platen_history::StrokeKey {
    let StrokeKey { press, session, stroke, attempt } = key;
    platen_history::StrokeKey { press, session, stroke, attempt }
}

impl Journal for Adapter {
    type Error = Error;

    fn recall(&mut self) -> Result<Recalled, Error> {
        let history = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let kept = history.recall()?;
        Ok(Recalled {
            owner: kept.owner,
            result_seq: kept.result_seq,
            run_id: kept.run_id,
            last: kept.last.as_ref().map(entry),
            attempts: kept.attempts,
        })
    }

    fn record(&mut self, record: &Record) -> Result<(), Error> {
        let mut history = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let now = Timestamp::now();
        match record {
            Record::Accepted { key, run_id, data } => history.accept(&accepted(*key, *run_id, data), now),
            Record::Scanned { key } => history.scanned(kept_key(*key), now),
            Record::Finished(publication) => history.finish(&finished(publication), now),
            Record::Acked { key, how } => {
                let how = match how {
                    Acked::Explicit => "explicit",
                    Acked::NextStroke => "next_stroke",
                    Acked::Never => "never",
                };
                history.acked(kept_key(*key), how, now)
            }
        }
    }
}

fn entry(kept: &platen_history::Stroke) -> Entry {
    let key = kept.key;
    Entry {
        key: StrokeKey { press: key.press, session: key.session, stroke: key.stroke, attempt: key.attempt },
        run_id: kept.run_id,
        // Written by this program as JSON; what cannot be read any more is as good as nothing said.
        data: serde_json::from_str(&kept.data).unwrap_or_default(),
        stage: match kept.stage() {
            Kept::Accepted => Stage::Accepted,
            Kept::Scanned => Stage::Scanned,
            Kept::Finished => Stage::Finished,
            Kept::Acked => Stage::Acked,
        },
        publication: kept.publication.as_deref().and_then(|text| serde_json::from_str(text).ok()),
    }
}

fn accepted(key: StrokeKey, run_id: u32, data: &StrokeData) -> Accepted {
    Accepted {
        key: kept_key(key),
        run_id,
        part_id: data.part_id,
        part_name: data.part_name.clone(),
        recipe: data.recipe_id,
        baseline: data.baseline,
        dry_run: data.dry_run,
        data: serde_json::to_string(data).unwrap_or_default(),
    }
}

fn finished(publication: &Publication) -> Finished {
    let measurement = &publication.measurement;
    let (verdict, reason) = match measurement.verdict {
        Verdict::Pass => (platen_history::Verdict::Pass, None),
        Verdict::Fail => (platen_history::Verdict::Fail, None),
        Verdict::CannotTell => (platen_history::Verdict::CannotTell, None),
        Verdict::NotMeasured(code) => (
            platen_history::Verdict::NotMeasured,
            Some(format!("{}: {}", code.number(), code.alarm().text(Language::En))),
        ),
    };
    let mut figures: BTreeMap<String, f64> = measurement
        .figures
        .values
        .iter()
        .map(|(measure, value)| (measure.name().to_owned(), *value))
        .collect();
    for (number, station) in measurement.figures.stations.iter().enumerate() {
        figures.extend(station.map(|value| (format!("station.{}", number + 1), value)));
    }
    Finished {
        key: kept_key(publication.key),
        run_id: publication.run_id,
        seq: publication.seq,
        verdict,
        reason,
        figures,
        publication: serde_json::to_string(publication).unwrap_or_default(),
    }
}
