//! Read access to a history: queries of its strokes and plates.

use std::path::{Path, PathBuf};

use jiff::Timestamp;
use rusqlite::{Connection, Params, Row, ToSql};

use crate::{Error, PlateRecord, Stroke, StrokeKey, Verdict, schema};

/// History opened for reading.
#[derive(Debug)]
pub struct Archive {
    connection: Connection,
    path: PathBuf,
}

/// Conditions of a query of strokes, combined by "and"; the default selects all.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Filter {
    /// Number of the physical plate.
    pub plate: Option<u32>,
    /// Part number of the press.
    pub part_id: Option<u32>,
    /// Accepted at this time or later.
    pub since: Option<Timestamp>,
    /// Accepted before this time.
    pub until: Option<Timestamp>,
    /// Verdict.
    pub verdict: Option<Verdict>,
    /// Largest number of strokes; the newest are kept.
    pub newest: Option<u32>,
}

impl Filter {
    /// Returns the query. It contains only the given conditions: SQLite finds no index for a condition that may be
    /// empty, and would read the whole record for the strokes of one plate.
    fn sql(&self) -> String {
        let conditions = [
            (self.plate.is_some(), "s.plate = :plate"),
            (self.part_id.is_some(), "p.part_id = :part_id"),
            (self.since.is_some(), "s.accepted >= :since"),
            (self.until.is_some(), "s.accepted < :until"),
            (self.verdict.is_some(), "s.verdict = :verdict"),
        ];
        let given: Vec<&str> = conditions.into_iter().filter(|it| it.0).map(|it| it.1).collect();
        let condition = if given.is_empty() { "1".to_owned() } else { given.join(" AND ") };
        let newest = if self.newest.is_some() { "LIMIT :newest" } else { "" };
        format!(
            "SELECT * FROM ({STROKE} JOIN plate p USING (plate) WHERE {condition} ORDER BY s.run_id DESC {newest}) \
             ORDER BY run_id"
        )
    }
}

/// Columns of a stroke, in the order in which [`stroke`] reads them.
const STROKE: &str = "SELECT s.run_id, s.press, s.session, s.stroke, s.attempt, s.plate, s.recipe, s.baseline, s.dry_run, \
                      s.accepted, s.scanned, s.finished, s.acked, s.ack, s.seq, s.verdict, s.reason, s.figures, s.data, \
                      s.publication, s.document, s.scan, s.scan_sha256 FROM stroke s";

/// Columns of a plate, in the order in which [`plate`] reads them.
const PLATE: &str = "SELECT p.plate, p.press, p.part_id, p.part_name, p.began, p.ended, \
                     (SELECT count(*) FROM stroke s WHERE s.plate = p.plate), \
                     (SELECT s.verdict FROM stroke s WHERE s.plate = p.plate AND s.verdict IS NOT NULL \
                      ORDER BY s.run_id DESC LIMIT 1) FROM plate p";

/// Condition of a stroke that was measured and can be compared with.
const MEASURED: &str = "s.verdict IS NOT NULL AND s.verdict <> 'not_measured'";

impl Archive {
    /// Opens a history for reading, also while a host writes it.
    ///
    /// # Errors
    /// [`Error::Unreachable`] when there is no such file, [`Error::Foreign`], [`Error::Storage`].
    pub fn open(path: &Path) -> Result<Self, Error> {
        Ok(Self::new(schema::open_reader(path)?, path))
    }

    pub(crate) fn new(connection: Connection, path: &Path) -> Self {
        Self { connection, path: path.to_owned() }
    }

    pub(crate) fn connection(&self) -> &Connection {
        &self.connection
    }

    pub(crate) fn connection_mut(&mut self) -> &mut Connection {
        &mut self.connection
    }

    /// Returns the path of the database.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the strokes selected by `filter`, oldest first.
    ///
    /// # Errors
    /// [`Error::Storage`], [`Error::Damaged`].
    pub fn strokes(&self, filter: &Filter) -> Result<Vec<Stroke>, Error> {
        let sql = filter.sql();
        let (since, until) = (filter.since.map(text), filter.until.map(text));
        let verdict = filter.verdict.map(Verdict::as_str);
        let values: [(&str, Option<&dyn ToSql>); 6] = [
            (":plate", filter.plate.as_ref().map(|it| it as _)),
            (":part_id", filter.part_id.as_ref().map(|it| it as _)),
            (":since", since.as_ref().map(|it| it as _)),
            (":until", until.as_ref().map(|it| it as _)),
            (":verdict", verdict.as_ref().map(|it| it as _)),
            (":newest", filter.newest.as_ref().map(|it| it as _)),
        ];
        let given: Vec<(&str, &dyn ToSql)> =
            values.into_iter().filter_map(|(name, value)| Some((name, value?))).collect();
        self.query(&sql, &given[..])
    }

    /// Returns one stroke.
    ///
    /// # Errors
    /// [`Error::NoSuchRun`], [`Error::Storage`], [`Error::Damaged`].
    pub fn stroke(&self, run_id: u32) -> Result<Stroke, Error> {
        let found = self.query(&format!("{STROKE} WHERE s.run_id = ?1"), [run_id])?.pop();
        found.ok_or_else(|| Error::NoSuchRun { path: self.path.clone(), run_id })
    }

    /// Returns the last accepted stroke of a press.
    ///
    /// # Errors
    /// [`Error::Storage`], [`Error::Damaged`].
    pub fn last(&self, press: u16) -> Result<Option<Stroke>, Error> {
        let sql = format!("{STROKE} WHERE s.press = ?1 ORDER BY s.run_id DESC LIMIT 1");
        Ok(self.query(&sql, [press])?.pop())
    }

    /// Returns the stroke to compare a run with: the last one measured on the same physical plate, without trials and
    /// other attempts of the same stroke. A baseline counts: it is the state before the first stroke.
    ///
    /// # Errors
    /// [`Error::NoSuchRun`], [`Error::Storage`], [`Error::Damaged`].
    pub fn before(&self, run_id: u32) -> Result<Option<Stroke>, Error> {
        let this = self.stroke(run_id)?;
        let sql = format!(
            "{STROKE} WHERE s.plate = ?1 AND s.run_id < ?2 AND {MEASURED} AND NOT s.dry_run \
             AND NOT (s.session = ?3 AND s.stroke = ?4) ORDER BY s.run_id DESC LIMIT 1"
        );
        Ok(self.query(&sql, (this.plate, run_id, this.key.session, this.key.stroke))?.pop())
    }

    /// Returns the scan of the blank that a run's (u, v) refer to: the last baseline measured on the same physical
    /// plate.
    ///
    /// # Errors
    /// [`Error::NoSuchRun`], [`Error::Storage`], [`Error::Damaged`].
    pub fn baseline(&self, run_id: u32) -> Result<Option<Stroke>, Error> {
        let this = self.stroke(run_id)?;
        let sql = format!(
            "{STROKE} WHERE s.plate = ?1 AND s.run_id < ?2 AND {MEASURED} AND s.baseline \
             ORDER BY s.run_id DESC LIMIT 1"
        );
        Ok(self.query(&sql, (this.plate, run_id))?.pop())
    }

    /// Returns all plates, oldest first.
    ///
    /// # Errors
    /// [`Error::Storage`].
    pub fn plates(&self) -> Result<Vec<PlateRecord>, Error> {
        self.rows(&format!("{PLATE} ORDER BY p.plate"), [], plate).map_err(Error::storage(&self.path))
    }

    /// Returns one plate; `None` where the record has none of this number.
    ///
    /// # Errors
    /// [`Error::Storage`].
    pub fn plate(&self, number: u32) -> Result<Option<PlateRecord>, Error> {
        let found = self.rows(&format!("{PLATE} WHERE p.plate = ?1"), [number], plate);
        Ok(found.map_err(Error::storage(&self.path))?.pop())
    }

    /// Reads strokes. The first column is the run id, so that the error of a damaged row contains it.
    fn query(&self, sql: &str, values: impl Params) -> Result<Vec<Stroke>, Error> {
        let rows = self
            .rows(sql, values, |row| Ok((row.get(0)?, stroke(row))))
            .map_err(Error::storage(&self.path))?;
        let damaged = |run_id, error: rusqlite::Error| Error::Damaged {
            path: self.path.clone(),
            run_id,
            why: error.to_string(),
        };
        rows.into_iter().map(|(run_id, stroke)| stroke.map_err(|error| damaged(run_id, error))).collect()
    }

    pub(crate) fn rows<T>(
        &self,
        sql: &str,
        values: impl Params,
        read: impl FnMut(&Row<'_>) -> rusqlite::Result<T>,
    ) -> rusqlite::Result<Vec<T>> {
        let mut statement = self.connection.prepare_cached(sql)?;
        let rows = statement.query_map(values, read)?;
        rows.collect()
    }
}

/// Reads the key from a row whose first columns are press, session, stroke, attempt.
pub(crate) fn key(row: &Row<'_>) -> rusqlite::Result<StrokeKey> {
    key_from(row, 0)
}

fn key_from(row: &Row<'_>, first: usize) -> rusqlite::Result<StrokeKey> {
    Ok(StrokeKey {
        press: row.get(first)?,
        session: row.get(first + 1)?,
        stroke: row.get(first + 2)?,
        attempt: row.get(first + 3)?,
    })
}

fn plate(row: &Row<'_>) -> rusqlite::Result<PlateRecord> {
    let verdict: Option<String> = row.get(7)?;
    Ok(PlateRecord {
        plate: row.get(0)?,
        press: row.get(1)?,
        part_id: row.get(2)?,
        part_name: row.get(3)?,
        began: time(row, 4)?,
        ended: optional_time(row, 5)?,
        strokes: row.get(6)?,
        verdict: verdict.as_deref().and_then(Verdict::from_text),
    })
}

fn stroke(row: &Row<'_>) -> rusqlite::Result<Stroke> {
    let path =
        |column: usize| Ok::<_, rusqlite::Error>(row.get::<_, Option<String>>(column)?.map(PathBuf::from));
    let verdict: Option<String> = row.get(15)?;
    let verdict = verdict.map(|verdict| {
        Verdict::from_text(&verdict).ok_or_else(|| wrong(15, format!("unknown verdict {verdict:?}")))
    });
    let figures: String = row.get(17)?;
    Ok(Stroke {
        run_id: row.get(0)?,
        key: key_from(row, 1)?,
        plate: row.get(5)?,
        recipe: row.get(6)?,
        baseline: row.get(7)?,
        dry_run: row.get(8)?,
        accepted: time(row, 9)?,
        scanned: optional_time(row, 10)?,
        finished: optional_time(row, 11)?,
        acked: optional_time(row, 12)?,
        ack: row.get(13)?,
        seq: row.get(14)?,
        verdict: verdict.transpose()?,
        reason: row.get(16)?,
        figures: serde_json::from_str(&figures).map_err(|error| wrong(17, error.to_string()))?,
        data: row.get(18)?,
        publication: row.get(19)?,
        document: path(20)?,
        scan: path(21)?,
        scan_sha256: row.get(22)?,
    })
}

/// Formats a time as stored in the tables: UTC, RFC 3339, milliseconds.
pub(crate) fn text(time: Timestamp) -> String {
    format!("{time:.3}")
}

pub(crate) fn time(row: &Row<'_>, column: usize) -> rusqlite::Result<Timestamp> {
    let text: String = row.get(column)?;
    text.parse().map_err(|error: jiff::Error| wrong(column, error.to_string()))
}

fn optional_time(row: &Row<'_>, column: usize) -> rusqlite::Result<Option<Timestamp>> {
    let there: Option<String> = row.get(column)?;
    there.map(|_| time(row, column)).transpose()
}

fn wrong(column: usize, why: String) -> rusqlite::Error {
    rusqlite::Error::FromSqlConversionFailure(column, rusqlite::types::Type::Text, why.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The advice queries the strokes of hundreds of plates after each stroke.
    #[test]
    fn strokes_of_a_plate_are_found_by_an_index() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("history.sqlite");
        drop(crate::History::open(&path, 1, Timestamp::UNIX_EPOCH).unwrap());
        let archive = Archive::open(&path).unwrap();
        let filter = Filter { plate: Some(1), ..Filter::default() };
        let sql = format!("EXPLAIN QUERY PLAN {}", filter.sql());
        let plan = archive.rows(&sql, &[(":plate", &1)], |row| row.get::<_, String>(3)).unwrap();
        assert!(plan.iter().any(|step| step.contains("stroke_plate")), "{plan:?}");
    }
}
