//! Journal of the press side: conversion of its records to rows of the database and back.

use std::collections::BTreeMap;

use jiff::Timestamp;
use platen_model::{Entry, Language, Publication, Recalled, Record, StrokeData, StrokeKey};

use crate::history::{Accepted, Finished, History, RECENT_RUNS};
use crate::{Error, Stroke};

impl History {
    /// Returns the state of the journal: the last stroke and the numbers in use.
    ///
    /// # Errors
    /// [`Error::Storage`], [`Error::Damaged`].
    pub fn recall(&self) -> Result<Recalled, Error> {
        let connection = self.archive().connection();
        let journal = "SELECT owner, result_seq, (SELECT ifnull(max(run_id), 0) FROM stroke) \
                       FROM journal WHERE press = ?1";
        let (owner, result_seq, run_id) = connection
            .query_row(journal, [self.press()], |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?)))
            .map_err(self.storage())?;
        let last = self.archive().last(self.press())?;
        let attempts = match &last {
            Some(last) => self.attempts(last).map_err(self.storage())?,
            None => BTreeMap::new(),
        };
        Ok(Recalled { owner, result_seq, run_id, last: last.map(entry), attempts })
    }

    fn attempts(&self, last: &Stroke) -> rusqlite::Result<BTreeMap<u16, u16>> {
        let sql = "SELECT stroke, max(attempt) FROM stroke \
                   WHERE press = ?1 AND session = ?2 AND run_id > ?3 GROUP BY stroke";
        let mut statement = self.archive().connection().prepare_cached(sql)?;
        let oldest = i64::from(last.run_id) - i64::from(RECENT_RUNS);
        let rows = statement
            .query_map((last.key.press, last.key.session, oldest), |row| Ok((row.get(0)?, row.get(1)?)))?;
        rows.collect()
    }

    /// Records one step of a stroke. The same step again changes nothing.
    ///
    /// # Errors
    /// [`Error::Contradiction`] when the step does not follow from the recorded steps; [`Error::Storage`].
    pub fn record(&mut self, record: &Record, now: Timestamp) -> Result<(), Error> {
        match record {
            Record::Accepted { key, run_id, data } => self.accept(&accepted(*key, *run_id, data), now),
            Record::Scanned { key } => self.scanned(*key, now),
            Record::Finished(publication) => self.finish(&finished(publication), now),
            Record::Acked { key, how } => self.acked(*key, how.as_str(), now),
        }
    }
}

fn entry(stroke: Stroke) -> Entry {
    Entry {
        key: stroke.key,
        run_id: stroke.run_id,
        data: stroke.press_data(),
        stage: stroke.stage(),
        publication: stroke.publication.as_deref().and_then(|text| serde_json::from_str(text).ok()),
    }
}

fn accepted(key: StrokeKey, run_id: u32, data: &StrokeData) -> Accepted {
    Accepted {
        key,
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
        key: publication.key,
        run_id: publication.run_id,
        seq: publication.seq,
        verdict: measurement.verdict(),
        reason: measurement
            .reason()
            .map(|code| format!("{}: {}", code.number(), code.alarm().text(Language::En))),
        figures,
        publication: serde_json::to_string(publication).unwrap_or_default(),
    }
}
