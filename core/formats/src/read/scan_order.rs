//! Recovery of rows and columns of hits stored without them, from the order of measurement.
//!
//! A hit is a stored point with a range. A column is measured in one sweep: the elevation advances step by step in one
//! direction and falls back at the end of the column, while the azimuth advances by one step.
//!
//! Real angles do not form an even lattice: on the pump sample they drift by more than a step over the scan, and by a
//! quarter of a step from column to column. Rounding to a grid therefore fails, but the drift from one column to the
//! next is small. Each hit is compared with the angles of its row in the previous columns, and a hit in a new row with
//! its neighbour in the same column.
//!
//! The steps are estimated robustly, by medians and a lower quantile over the first million hits. Limit: a cloud is
//! refused when more than one hit in a thousand lies between two rows or columns.

use platen_scan::{Direction, wrap_azimuth};

/// Distance from the nearest row or column, in steps, above which a hit is ambiguous.
const DOUBTFUL: f64 = 0.4;
/// Largest share of ambiguous hits.
const MAX_DOUBTFUL: f64 = 1e-3;
/// Least distance of two hits of different columns, azimuth steps.
const NEXT_COLUMN: f64 = 0.6;
/// Number of rows within which the azimuth of a column does not drift.
const NEIGHBOURS: usize = 8;
/// Number of columns within which the elevation of a row does not drift.
const LATELY: i64 = 4;
/// Number of rows reserved below the first, for hits lower than the lowest of the sample.
const MARGIN: f64 = 64.0;
/// Largest number of hits in a column.
const MAX_COLUMN: usize = 1 << 17;
/// Number of rows of a stretch, which share one mean step.
const STRETCH: f64 = 16.0;
/// Least number of steps for a separate mean.
const ENOUGH: f64 = 32.0;
/// Number of hits from which the steps are estimated.
pub(crate) const SAMPLE: usize = 1 << 20;

/// Reason why there is no lattice.
pub(crate) type Reason = String;

/// Steps of a lattice, signed in the order of measurement.
///
/// The elevation step is a mean of thousands for every stretch of [`STRETCH`] rows: across a gap of hundreds of rows a
/// single mean for all rows would be wrong by half a row.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Steps {
    /// Elevation at which the first stretch begins.
    start: f64,
    /// Mean step of the elevation.
    elevation: f64,
    /// Row at the end of every stretch.
    rows: Vec<f64>,
    azimuth: f64,
}

/// A hit with its row and column, and the caller's record of it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Placed<T> {
    pub(crate) row: u32,
    pub(crate) column: u32,
    pub(crate) record: T,
}

impl Steps {
    /// Estimates the steps from hits in the order of measurement; [`SAMPLE`] hits suffice.
    pub(crate) fn estimate(hits: &[Direction]) -> Result<Self, Reason> {
        let moves = |angle: fn(&Direction) -> f64| -> Vec<f64> {
            hits.windows(2).map(|pair| wrap_azimuth(angle(&pair[1]) - angle(&pair[0]))).collect()
        };
        let (elevations, azimuths) = (moves(|d| d.elevation), moves(|d| d.azimuth));
        let up = median(elevations.clone()).ok_or("fewer than two hits")?.signum();
        // Where cells are missing a step may be that of two rows or more, but seldom are all steps.
        let along = elevations.iter().map(|e| e * up).filter(|e| *e > 0.0);
        let one = quantile(along.collect(), 0.1).unwrap_or(0.0);
        let sideways = median(azimuths.iter().map(|a| a.abs()).collect()).unwrap_or(0.0);
        if one <= sideways {
            return Err("the hits do not follow each other along columns".to_owned());
        }
        let single = elevations.iter().enumerate().filter(|(_, e)| (0.5..1.5).contains(&(*e * up / one)));
        let single: Vec<(usize, f64)> = single.map(|(i, e)| (i, *e)).collect();
        let elevation = single.iter().map(|(_, e)| e).sum::<f64>() / single.len() as f64;
        let (low, high) = ends(hits.iter().map(|d| d.elevation / elevation));
        let within_a_column = high - low < MAX_COLUMN as f64;
        if !within_a_column {
            return Err(format!(
                "one step of the elevation is {elevation:e} rad: no scanner has so many rows"
            ));
        }
        let mut steps = Self { start: low * elevation, elevation, rows: Vec::new(), azimuth: 0.0 };
        steps.rows = steps.stretches(hits, &single, high - low);
        steps.azimuth = steps.azimuth_step(hits, &elevations)?;
        Ok(steps)
    }

    /// Returns the row at the end of every stretch, from the mean single step within each.
    fn stretches(&self, hits: &[Direction], single: &[(usize, f64)], length: f64) -> Vec<f64> {
        let n = (length / STRETCH) as usize + 1;
        let mut sums = vec![(0.0, 0.0); n];
        for (i, step) in single {
            let stretch = (hits[*i].elevation - self.start) / self.elevation / STRETCH;
            let sum = &mut sums[(stretch as usize).min(n - 1)];
            *sum = (sum.0 + step, sum.1 + 1.0);
        }
        let mut row = MARGIN;
        let rows = sums.into_iter().map(|(sum, steps)| {
            let step = if steps < ENOUGH { self.elevation } else { sum / steps };
            row += STRETCH * self.elevation / step;
            row
        });
        rows.collect()
    }

    /// Returns the median azimuth step from column to column; columns are separated where the elevation falls back.
    fn azimuth_step(&self, hits: &[Direction], elevations: &[f64]) -> Result<f64, Reason> {
        let falls_back = |(i, e): (usize, &f64)| (e / self.elevation < -0.5).then_some(i + 1);
        let breaks: Vec<usize> = elevations.iter().enumerate().filter_map(falls_back).collect();
        let column = |pair: &[usize]| {
            let first = hits[pair[0]].azimuth;
            let turns = hits[pair[0]..pair[1]].iter().map(|d| wrap_azimuth(d.azimuth - first));
            median(turns.collect()).map(|middle| first + middle)
        };
        let columns: Vec<f64> = breaks.windows(2).filter_map(column).collect();
        let moves = columns.windows(2).map(|pair| wrap_azimuth(pair[1] - pair[0])).collect();
        median(moves).filter(|step| *step != 0.0).ok_or_else(|| "fewer than three columns".to_owned())
    }

    /// Returns the row of an elevation on a lattice whose rows do not drift from column to column.
    fn even(&self, elevation: f64) -> f64 {
        let stretches = (elevation - self.start) / self.elevation / STRETCH;
        let here = (stretches.max(0.0) as usize).min(self.rows.len() - 1);
        let begin = if here == 0 { MARGIN } else { self.rows[here - 1] };
        begin + (stretches - here as f64) * (self.rows[here] - begin)
    }
}

/// Latest hit of a row.
#[derive(Debug, Clone, Copy)]
struct Seen {
    /// Distance of the elevation from the even lattice, rows.
    off: f64,
    azimuth: f64,
    column: i64,
}

/// A hit of known row whose column is not known yet.
#[derive(Debug, Clone, Copy)]
struct Waiting<T> {
    hit: Direction,
    record: T,
    row: usize,
    /// Distance of the elevation from the even lattice, rows.
    off: f64,
    /// True when the hit is ambiguous.
    doubtful: bool,
    /// Column as determined by the latest hit of the row.
    column: Option<f64>,
}

/// Assigns rows and columns to hits, column by column.
#[derive(Debug)]
pub(crate) struct Placer<T> {
    steps: Steps,
    rows: Vec<Option<Seen>>,
    waiting: Vec<Waiting<T>>,
    /// Number and first azimuth of the previous column.
    before: Option<(i64, f64)>,
    hits: u64,
    doubtful: u64,
}

impl<T: Copy> Placer<T> {
    pub(crate) fn new(steps: Steps) -> Self {
        Self { steps, rows: Vec::new(), waiting: Vec::new(), before: None, hits: 0, doubtful: 0 }
    }

    /// Adds the next hit; returns the previous column when the hit begins a new one.
    pub(crate) fn push(&mut self, hit: Direction, record: T) -> Result<Vec<Placed<T>>, Reason> {
        let mut placed = Vec::new();
        let mut here = self.find_row(hit, record, self.waiting.last().map(|last| last.off));
        if self.waiting.last().is_some_and(|last| self.begins_column(last, &here)) {
            placed = self.flush()?;
            here = self.find_row(hit, record, None);
        }
        if here.row >= MAX_COLUMN || self.waiting.last().is_some_and(|last| here.row <= last.row) {
            return Err("the hits of a column do not follow each other".to_owned());
        }
        self.waiting.push(here);
        Ok(placed)
    }

    /// Ends the scan; returns the last column.
    pub(crate) fn finish(mut self) -> Result<Vec<Placed<T>>, Reason> {
        let placed = self.flush()?;
        if self.doubtful as f64 > MAX_DOUBTFUL * self.hits as f64 {
            return Err(format!("{} of {} hits lie between two rows or columns", self.doubtful, self.hits));
        }
        Ok(placed)
    }

    /// Returns whether the elevation falls back, or the azimuth advances by more than its drift within a column.
    fn begins_column(&self, last: &Waiting<T>, here: &Waiting<T>) -> bool {
        let falls_back = (here.hit.elevation - last.hit.elevation) / self.steps.elevation < -0.5;
        let moves_on = match (last.column, here.column) {
            (Some(last), Some(here)) => here - last,
            _ if here.row < last.row + NEIGHBOURS => self.columns(last.hit.azimuth, here.hit.azimuth),
            _ => 0.0,
        };
        // Near the zenith azimuths are uncertain.
        falls_back || moves_on * here.hit.elevation.cos() > NEXT_COLUMN
    }

    /// Returns the number of columns between two azimuths.
    fn columns(&self, from: f64, to: f64) -> f64 {
        wrap_azimuth(to - from) / self.steps.azimuth
    }

    /// Finds the row of a hit; `off` is the distance of the previous hit of its column from the even lattice.
    fn find_row(&self, hit: Direction, record: T, off: Option<f64>) -> Waiting<T> {
        let even = self.steps.even(hit.elevation);
        let near = off.or_else(|| self.nearest(even)).unwrap_or(0.0);
        let guess = (even - near).round().max(0.0) as usize;
        let exact = even - self.lately(guess).map_or(near, |seen| seen.off);
        let row = exact.round().max(0.0) as usize;
        Waiting {
            hit,
            record,
            row,
            off: even - row as f64,
            doubtful: (exact - row as f64).abs() > DOUBTFUL,
            column: self.lately(row).map(|seen| seen.column as f64 + self.columns(seen.azimuth, hit.azimuth)),
        }
    }

    /// Returns the latest hit of a row within the last columns.
    fn lately(&self, row: usize) -> Option<Seen> {
        let seen = self.rows.get(row).copied().flatten()?;
        let (before, _) = self.before?;
        (before - seen.column < LATELY).then_some(seen)
    }

    /// Returns the distance from the even lattice of the nearest row hit within the last columns.
    fn nearest(&self, even: f64) -> Option<f64> {
        let here = (even.max(0.0) as usize).min(MAX_COLUMN);
        let off = |row: usize| Some(self.lately(row)?.off);
        (0..self.rows.len().max(here))
            .find_map(|away| here.checked_sub(away).and_then(off).or_else(|| off(here + away)))
    }

    fn flush(&mut self) -> Result<Vec<Placed<T>>, Reason> {
        let waiting = std::mem::take(&mut self.waiting);
        let Some(first) = waiting.first() else { return Ok(Vec::new()) };
        let column = self.find_column(&waiting, first.hit.azimuth)?;
        self.before = Some((column, first.hit.azimuth));
        self.hits += waiting.len() as u64;
        self.doubtful += waiting.iter().filter(|here| here.doubtful).count() as u64;
        let top = waiting.last().map_or(0, |last| last.row + 1);
        if self.rows.len() < top {
            self.rows.resize(top, None);
        }
        let number = u32::try_from(column).map_err(|_| "more columns than any scanner has".to_owned())?;
        let place = |here: Waiting<T>| {
            self.rows[here.row] = Some(Seen { off: here.off, azimuth: here.hit.azimuth, column });
            Placed { row: here.row as u32, column: number, record: here.record }
        };
        Ok(waiting.into_iter().map(place).collect())
    }

    fn find_column(&mut self, waiting: &[Waiting<T>], azimuth: f64) -> Result<i64, Reason> {
        let Some((before, azimuth_before)) = self.before else { return Ok(0) };
        let estimate = median(waiting.iter().filter_map(|here| here.column).collect())
            .unwrap_or_else(|| before as f64 + self.columns(azimuth_before, azimuth));
        let column = estimate.round() as i64;
        if column <= before {
            return Err("the columns do not follow each other".to_owned());
        }
        if (estimate - column as f64).abs() > DOUBTFUL {
            self.doubtful += waiting.len() as u64;
        }
        Ok(column)
    }
}

fn ends(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
}

fn median(values: Vec<f64>) -> Option<f64> {
    quantile(values, 0.5)
}

/// Returns the value below which the given share of the values lies.
fn quantile(mut values: Vec<f64>, share: f64) -> Option<f64> {
    let rank = (values.len() as f64 * share) as usize;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(rank, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A lattice with drifting angles and gaps; the result must be its rows and columns, less a common offset.
    #[track_caller]
    fn check(up: f64, round: f64, gap: fn(u32, u32) -> bool, wander: f64) -> Result<(), Reason> {
        let (elevation, azimuth) = (1.2e-3 * up, 4.4e-3 * round);
        let hit = |row: u32, column: u32| {
            let (r, c) = (f64::from(row), f64::from(column));
            Direction {
                elevation: elevation * (r - 200.0 + wander * ((r / 60.0).sin() + c / 60.0)),
                azimuth: wrap_azimuth(3.0 + azimuth * (c + wander * (r / 90.0).cos())),
            }
        };
        let cells: Vec<(u32, u32)> = (0..120)
            .flat_map(|column| (0..400).map(move |row| (row, column)))
            .filter(|(row, column)| !gap(*row, *column))
            .collect();
        let hits: Vec<Direction> = cells.iter().map(|(row, column)| hit(*row, *column)).collect();
        let steps = Steps::estimate(&hits)?;
        let mut placer = Placer::new(steps);
        let mut placed = Vec::new();
        for (row, column) in &cells {
            placed.extend(placer.push(hit(*row, *column), ())?);
        }
        placed.extend(placer.finish()?);
        let offset = (placed[0].row - cells[0].0, placed[0].column + 10 - cells[0].1);
        for (found, (row, column)) in placed.iter().zip(&cells) {
            assert_eq!((found.row - offset.0, found.column + 10 - offset.1), (*row, *column));
        }
        assert_eq!(placed.len(), cells.len());
        Ok(())
    }

    #[test]
    fn rows_and_columns_come_back_though_the_angles_wander() {
        for up in [-1.0, 1.0] {
            for round in [-1.0, 1.0] {
                for wander in [0.0, 0.5, 1.0] {
                    check(up, round, |_, _| false, wander).unwrap();
                    check(up, round, |row, column| (row * 7 + column * 13) % 5 < 2, wander).unwrap();
                    check(up, round, |row, column| row > 150 && row < 300 && column < 60, wander).unwrap();
                    check(up, round, |_, column| (50..60).contains(&column), wander).unwrap();
                }
            }
        }
    }

    #[test]
    fn a_cloud_in_no_order_is_refused() {
        let mut state = 1_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let hits: Vec<Direction> =
            (0..5000).map(|_| Direction { azimuth: random(), elevation: random() }).collect();
        let placed = Steps::estimate(&hits).and_then(|steps| {
            let mut placer = Placer::new(steps);
            hits.iter().try_for_each(|hit| placer.push(*hit, ()).map(drop))?;
            placer.finish()
        });
        assert!(placed.is_err());
    }
}
