//! Decision from the sums of the first pass: axes, directions, unit, cut of a full circle.

use std::f64::consts::TAU;

use platen_scan::{ScanHeader, wrap_azimuth};

use super::fit::{self, Fit, Line};
use super::intensity::Scale;
use super::survey::{FAR, MIN_FILL, NEAR, stored_range};
use super::{Expected, Mirror, OrientError, Survey, Turn};

/// Least correlation of row with elevation and of column with azimuth.
const MIN_CORRELATION: f64 = 0.99;

/// Least number of rows and of columns with valid cells.
const MIN_LINES: u32 = 3;

/// Unit of length of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Unit {
    /// Coordinates as stored.
    Metre,
    /// Coordinates divided by 1000.
    Millimetre,
}

/// Orientation of a stored lattice.
#[derive(Debug, Clone)]
pub(crate) struct Plan {
    /// Size, angles, intensity range and one sentence per decision; the reader adds the instrument.
    pub(crate) header: ScanHeader,
    /// The file's rows are columns.
    pub(crate) swapped: bool,
    /// Row 0 was at the bottom.
    pub(crate) rows_flipped: bool,
    /// Columns ran clockwise.
    pub(crate) columns_flipped: bool,
    /// Unit of the file.
    pub(crate) unit: Unit,
    /// Correction of the frame.
    pub(crate) mirror: Mirror,
    pub(super) intensity: Scale,
    pub(super) warm_up_columns: u32,
    pub(super) first_row: u32,
    pub(super) first_column: u32,
    /// Column (after flipping) that becomes column 0 of a full circle.
    pub(super) cut: u32,
    /// Number of cells of each normalised column.
    pub(super) cells: Vec<u32>,
}

impl Survey {
    /// Decides the orientation of the lattice.
    ///
    /// # Errors
    /// Every variant of [`OrientError`] except those of single cells.
    pub(crate) fn decide(self, expected: &Expected) -> Result<Plan, OrientError> {
        self.check_size()?;
        let (swapped, down, round) = self.choose_axes()?;
        let (rows, columns) = if swapped { (&self.columns, &self.rows) } else { (&self.rows, &self.columns) };
        let (row_range, column_range) = (stored_range(rows), stored_range(columns));
        let (n_rows, n_columns) = (row_range.len() as u32, column_range.len() as u32);

        let rows_flipped = down.step > 0.0;
        let azimuth = mirrored(round, expected.mirror);
        let columns_flipped = azimuth.step < 0.0;
        check_turn(columns_flipped, expected.turn)?;
        let unit = self.unit()?;
        let (intensity, intensity_note) = Scale::choose(expected.intensity, &self.intensity);

        let top = if rows_flipped { row_range.end - 1 } else { row_range.start };
        let first = if columns_flipped { column_range.end - 1 } else { column_range.start };
        let step = azimuth.step.abs();
        let start = azimuth.start + azimuth.step * first as f64;
        let closed = is_closed(n_columns, step);
        let cut = match expected.cut_azimuth {
            Some(cut) if closed => ((cut - start).rem_euclid(TAU) / step).ceil() as u32 % n_columns,
            _ => 0,
        };

        let mut cells: Vec<u32> = columns[column_range.clone()].iter().map(|line| line.cells).collect();
        if columns_flipped {
            cells.reverse();
        }
        cells.rotate_left(cut as usize);

        let header = ScanHeader {
            n_rows,
            n_columns,
            azimuth_start: wrap_azimuth(start + step * f64::from(cut)),
            azimuth_step: step,
            elevation_start: down.start + down.step * top as f64,
            elevation_step: down.step.abs(),
            intensity_range: intensity.range,
            ..ScanHeader::default()
        };
        let mut plan = Plan {
            header,
            swapped,
            rows_flipped,
            columns_flipped,
            unit,
            mirror: expected.mirror,
            intensity,
            warm_up_columns: 0,
            first_row: row_range.start as u32,
            first_column: column_range.start as u32,
            cut,
            cells,
        };
        plan.header.notes = plan.sentences(&down, &round, closed, &self);
        let empty = columns[column_range].iter().filter(|line| line.valid == 0).count();
        if empty > 0 {
            plan.header.notes.push(format!("{empty} of {n_columns} columns hold no measurement"));
        }
        plan.header.notes.extend(intensity_note);
        Ok(plan)
    }

    fn check_size(&self) -> Result<(), OrientError> {
        let filled = |lines: &[Line]| lines.iter().filter(|line| line.valid > 0).count() as u32;
        let (n_rows, n_columns) = (filled(&self.rows), filled(&self.columns));
        if n_rows < MIN_LINES || n_columns < MIN_LINES {
            return Err(OrientError::TooSmall { valid: self.valid, n_rows, n_columns });
        }
        let places = stored_range(&self.rows).len() as f64 * stored_range(&self.columns).len() as f64;
        if (self.cells as f64) < MIN_FILL * places { Err(self.too_sparse()) } else { Ok(()) }
    }

    /// Returns whether rows and columns are swapped, with the fits of elevation and azimuth.
    fn choose_axes(&self) -> Result<(bool, Fit, Fit), OrientError> {
        let nothing = Fit { correlation: 0.0, start: 0.0, step: 0.0, spread: 0.0 };
        let fits = |rows: &[Line], columns: &[Line]| {
            (fit::elevation(rows).unwrap_or(nothing), fit::azimuth(columns).unwrap_or(nothing))
        };
        let (down, round) = fits(&self.rows, &self.columns);
        let (down_swapped, round_swapped) = fits(&self.columns, &self.rows);
        let score = |a: &Fit, b: &Fit| a.correlation.abs().min(b.correlation.abs());
        if score(&down, &round) > MIN_CORRELATION {
            Ok((false, down, round))
        } else if score(&down_swapped, &round_swapped) > MIN_CORRELATION {
            Ok((true, down_swapped, round_swapped))
        } else {
            Err(OrientError::NotALattice {
                rows_elevation: down.correlation,
                columns_azimuth: round.correlation,
                columns_elevation: down_swapped.correlation,
                rows_azimuth: round_swapped.correlation,
            })
        }
    }

    /// Returns the unit in which half of the ranges lie within those of scanners.
    fn unit(&self) -> Result<Unit, OrientError> {
        let half = self.valid / 2;
        let refuse = |side, limit| Err(OrientError::Unit { valid: self.valid, side, limit });
        if self.above_far_mm > half {
            refuse("above", FAR * 1000.0)
        } else if self.above_far > half {
            Ok(Unit::Millimetre)
        } else if self.below_near > half {
            refuse("below", NEAR)
        } else {
            Ok(Unit::Metre)
        }
    }
}

impl Plan {
    fn sentences(&self, down: &Fit, round: &Fit, closed: bool, survey: &Survey) -> Vec<String> {
        let mut notes = Vec::new();
        let mut note = |sentence: String| notes.push(sentence);
        let (n_rows, n_columns) = (self.header.n_rows, self.header.n_columns);
        if self.swapped {
            note("rows and columns are swapped in the file: its columns follow elevation".to_owned());
        }
        note(format!(
            "row 0 is at the {} of the file (correlation of row with elevation {:+.6}){}",
            if self.rows_flipped { "bottom" } else { "top" },
            down.correlation,
            if self.rows_flipped { ": rows reversed" } else { "" },
        ));
        note(format!(
            "columns run {} in the file (correlation of column with azimuth {:+.6}){}",
            if round.step < 0.0 { Turn::Clockwise } else { Turn::CounterClockwise }.name(),
            round.correlation,
            if self.columns_flipped { ": columns reversed" } else { "" },
        ));
        note(format!(
            "steps {:.4} deg down a column and {:.4} deg between columns, line means within {:.4} and {:.4} deg of an even lattice",
            down.step.abs().to_degrees(),
            round.step.abs().to_degrees(),
            down.spread.to_degrees(),
            round.spread.to_degrees(),
        ));
        match self.mirror {
            Mirror::None => {}
            Mirror::X => note("the frame is left-handed: x mirrored".to_owned()),
            Mirror::Y => note("the frame is left-handed: y mirrored".to_owned()),
        }
        if self.unit == Unit::Millimetre {
            note(format!(
                "the file is in millimetres ({} of {} ranges above {FAR}): divided by 1000",
                survey.above_far, survey.valid
            ));
        }
        if closed {
            note(format!(
                "the columns close a full circle, cut open at azimuth {:.2} deg",
                self.header.azimuth_start.to_degrees()
            ));
        } else if f64::from(n_columns) * self.header.azimuth_step > TAU {
            note(format!(
                "{n_columns} columns cover more than a full circle: the overlap was measured twice"
            ));
        }
        if self.first_row > 0 || self.first_column > 0 {
            note(format!(
                "row and column numbers begin at {} and {}: counted from there",
                self.first_row, self.first_column
            ));
        }
        if survey.unflagged > 0 {
            note(format!("{} cells at the origin count as missing though not flagged", survey.unflagged));
        }
        if survey.not_finite > 0 {
            note(format!("{} cells without finite coordinates count as missing", survey.not_finite));
        }
        let missing = u64::from(n_rows) * u64::from(n_columns) - survey.cells;
        if missing > 0 {
            note(format!("{missing} of {n_rows} x {n_columns} cells are not stored and count as missing"));
        }
        notes
    }
}

/// Returns the fit of azimuth in the right-handed frame.
fn mirrored(round: Fit, mirror: Mirror) -> Fit {
    match mirror {
        Mirror::None => round,
        Mirror::Y => Fit { start: -round.start, step: -round.step, ..round },
        Mirror::X => Fit { start: TAU / 2.0 - round.start, step: -round.step, ..round },
    }
}

fn check_turn(clockwise: bool, expected: Option<Turn>) -> Result<(), OrientError> {
    let found = if clockwise { Turn::Clockwise } else { Turn::CounterClockwise };
    match expected {
        Some(expected) if expected != found => {
            Err(OrientError::Mirrored { found: found.name(), expected: expected.name() })
        }
        _ => Ok(()),
    }
}

/// Returns whether the last column is the neighbour of the first.
fn is_closed(n_columns: u32, step: f64) -> bool {
    (f64::from(n_columns) * step - TAU).abs() < 0.5 * step
}
