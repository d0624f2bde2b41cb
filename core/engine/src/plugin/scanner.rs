//! Scanner drivers: the host pulls a scan column by column.

use std::time::Duration;

use platen_plant::OptionValue;
use platen_scan::{Column, Outcome, ScanEnd, ScanHeader, State, Window};
use platen_sdk::exchange::Payload;

use super::{Emitted, Instance, JobSpec, Kind, Library, PluginError, RunningJob};

/// Largest lattice accepted: beyond the finest scanner's 17,351 x 40,960 cells.
const MAX_ROWS: u32 = 1 << 16;
const MAX_COLUMNS: u32 = 1 << 17;

/// A configured scanner driver.
#[derive(Debug)]
pub struct Scanner(Instance);

impl Scanner {
    /// Creates a driver from checked options.
    ///
    /// # Errors
    /// As [`Instance::create`].
    pub fn create(library: &Library, values: &[OptionValue]) -> Result<Self, PluginError> {
        Instance::create(library, Kind::Scanner, values).map(Self)
    }

    /// Returns the instance, to open it.
    pub fn instance(&self) -> &Instance {
        &self.0
    }

    /// Returns the duration of a scan, if the driver can estimate it.
    ///
    /// # Errors
    /// [`PluginError::Hangs`].
    pub fn estimate(
        &self,
        window: Option<&Window>,
        limit: Duration,
    ) -> Result<Option<Duration>, PluginError> {
        let seconds = self.0.estimate_s(window, limit)?;
        Ok(seconds.and_then(|s| Duration::try_from_secs_f64(s).ok()))
    }

    /// Starts a scan and waits for its header.
    ///
    /// # Errors
    /// The driver's reason, the deadline, or the fault in the data that it sent.
    pub fn start(&self, spec: JobSpec, window: Option<&Window>) -> Result<RunningScan<'_>, PluginError> {
        let window = window.map(|window| self.0.input(window, None)).transpose()?;
        let mut job = self.0.run(spec, window.as_slice())?;
        let Some(frame) = job.next_frame() else {
            job.finish()?;
            return Err(job.misbehaved(NO_END));
        };
        if !frame.is::<ScanHeader>() {
            return Err(job.misbehaved(out_of_turn(&frame)));
        }
        let header: ScanHeader = decode(&mut job, &frame)?;
        check(&header).map_err(|what| job.misbehaved(what))?;
        Ok(RunningScan { job, seen: Vec::new(), columns: 0, points: 0, header, end: None })
    }
}

/// Scan in progress: an iterator over its columns in any order, checked against the header. Nothing follows an error.
///
/// Cancelling the job's token or reaching its deadline ends the scan with an error. Dropping it before its end cancels
/// the job and waits for the driver.
#[derive(Debug)]
pub struct RunningScan<'a> {
    job: RunningJob<'a>,
    header: ScanHeader,
    /// Columns that have arrived.
    seen: Vec<bool>,
    columns: u32,
    points: u64,
    end: Option<ScanEnd>,
}

const NO_END: &str = "the scan has no end";

impl RunningScan<'_> {
    /// Returns size, angles and notes of the lattice.
    pub fn header(&self) -> &ScanHeader {
        &self.header
    }

    /// Waits for the end of the scan; columns not taken are checked and dropped. Only `Ok` means a complete scan.
    ///
    /// # Errors
    /// The driver's reason, the deadline, or the fault in the data that it sent.
    pub fn finish(&mut self) -> Result<ScanEnd, PluginError> {
        self.by_ref().try_for_each(|column| column.map(drop))?;
        match self.end {
            Some(end) => Ok(end),
            None => Err(self.job.misbehaved(NO_END)),
        }
    }

    /// Counts a column; each arrives once, within the bounds of the header.
    fn count(&mut self, column: &Column) -> Result<(), String> {
        let index = column.index;
        if index >= MAX_COLUMNS {
            return Err(format!("column {index} of at most {MAX_COLUMNS}"));
        }
        let place = index as usize;
        if self.seen.len() <= place {
            self.seen.resize((place + 1).next_power_of_two(), false);
        }
        if std::mem::replace(&mut self.seen[place], true) {
            return Err(format!("column {index} twice"));
        }
        let (_, most) = self.header.intensity_range;
        if let Some(intensity) = column.intensity.iter().max().filter(|found| **found > most) {
            return Err(format!("intensity {intensity} in column {index}, at most {most} by its header"));
        }
        self.columns += 1;
        self.points += column.state.iter().filter(|state| **state == State::Valid).count() as u64;
        Ok(())
    }

    fn next_column(&mut self) -> Result<Option<Column>, PluginError> {
        while let Some(frame) = self.job.next_frame() {
            let job = &mut self.job;
            if self.end.is_some() {
                return Err(job.misbehaved(format!("{} after the scan's end", frame.format)));
            }
            if frame.is::<Column>() {
                let column: Column = decode(job, &frame)?;
                column.check(self.header.n_rows).map_err(|e| job.misbehaved(e.to_string()))?;
                self.count(&column).map_err(|what| self.job.misbehaved(what))?;
                return Ok(Some(column));
            }
            if !frame.is::<ScanEnd>() {
                return Err(job.misbehaved(out_of_turn(&frame)));
            }
            let end: ScanEnd = decode(job, &frame)?;
            if end.outcome != Outcome::Complete {
                return Err(job.misbehaved("success without a complete scan"));
            }
            if (end.columns, end.points) != (self.columns, self.points) {
                return Err(job.misbehaved(format!(
                    "{} columns with {} valid cells, of which its end says {} and {}",
                    self.columns, self.points, end.columns, end.points
                )));
            }
            self.end = Some(end);
        }
        self.job.finish()?;
        if self.end.is_some() { Ok(None) } else { Err(self.job.misbehaved(NO_END)) }
    }
}

impl Iterator for RunningScan<'_> {
    type Item = Result<Column, PluginError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.next_column().transpose()
    }
}

fn out_of_turn(frame: &Emitted) -> String {
    format!("a frame {} out of turn", frame.format)
}

fn decode<T: Payload>(job: &mut RunningJob<'_>, frame: &Emitted) -> Result<T, PluginError> {
    frame.decode().map_err(|e| job.misbehaved(format!("a malformed {}: {e}", frame.format)))
}

fn check(header: &ScanHeader) -> Result<(), String> {
    if !(1..=MAX_ROWS).contains(&header.n_rows) || header.n_columns > MAX_COLUMNS {
        return Err(format!("a lattice of {} x {} cells", header.n_rows, header.n_columns));
    }
    if header.intensity_range.0 > header.intensity_range.1 {
        return Err(format!("intensities from {} to {}", header.intensity_range.0, header.intensity_range.1));
    }
    let steps = [header.azimuth_step, header.elevation_step];
    let starts = [header.azimuth_start, header.elevation_start];
    if steps.iter().all(|s| s.is_finite() && *s > 0.0 && *s < 1.0) && starts.iter().all(|s| s.is_finite()) {
        Ok(())
    } else {
        Err(format!("angular steps {steps:?} from {starts:?} rad"))
    }
}
