//! Rows and columns of successive cells: run-length encoding of their differences. In a run both advance by constant
//! steps.
//!
//! A file stored column by column has a run for each column, and one more for each gap. A run takes the memory of
//! less than three cells' rows and columns, and whether cells lie in one column is known without a comparison for each;
//! for speed and memory only: `tests::speed`.

/// Number of a line in a place: of its row, of its column.
pub(super) const ROW: usize = 0;
pub(super) const COLUMN: usize = 1;

/// Successive cells whose rows and columns advance by constant steps.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Run {
    /// Row and column of the first cell.
    first: [u32; 2],
    /// Steps from cell to cell; zero for one cell alone. Sums are modulo 2^32.
    step: [i32; 2],
    n: u32,
}

impl Run {
    fn of(cell: [u32; 2]) -> Self {
        Self { first: cell, step: [0; 2], n: 1 }
    }

    /// Returns the number of cells.
    pub(super) fn len(&self) -> usize {
        self.n as usize
    }

    /// Returns row and column of a cell, or of the one that would follow the last.
    fn at(&self, cell: u32) -> [u32; 2] {
        std::array::from_fn(|axis| sum(self.first[axis], self.step[axis].wrapping_mul(cell as i32)))
    }

    /// Returns row and column of every cell.
    pub(super) fn places(self) -> impl Iterator<Item = [u32; 2]> {
        (0..self.n).map(move |cell| self.at(cell))
    }

    /// Returns the cells from `from` on that lie in one line: all that follow, or one.
    fn within_line(&self, from: u32, axis: usize) -> Self {
        let stays = self.step[axis] == 0;
        let step = if stays { self.step } else { [0; 2] };
        Self { first: self.at(from), step, n: if stays { self.n - from } else { 1 } }
    }

    /// Returns the run in parts that each lie in one line.
    pub(super) fn by_line(self, axis: usize) -> impl Iterator<Item = Self> {
        let mut from = 0;
        std::iter::from_fn(move || {
            let part = (from < self.n).then(|| self.within_line(from, axis))?;
            from += part.n;
            Some(part)
        })
    }

    /// Returns the number of the first cell's line.
    pub(super) fn line(&self, axis: usize) -> u32 {
        self.first[axis]
    }

    /// Returns the lines of the first and of the last cell, and the step between neighbours. For a run that leaves the
    /// numbers of 32 bits the last one is beyond them.
    pub(super) fn lines(&self, axis: usize) -> (i64, i64, i64) {
        let (first, step) = (i64::from(self.first[axis]), i64::from(self.step[axis]));
        (first, first + step * (i64::from(self.n) - 1), step)
    }
}

fn sum(line: u32, step: i32) -> u32 {
    line.wrapping_add(step.cast_unsigned())
}

fn difference(to: u32, from: u32) -> i32 {
    to.wrapping_sub(from).cast_signed()
}

/// Rows and columns of successive cells.
#[derive(Debug, Clone, Default)]
pub(crate) struct Places {
    runs: Vec<Run>,
    n: usize,
}

impl Places {
    /// Returns the number of cells.
    pub(super) fn len(&self) -> usize {
        self.n
    }

    /// Returns the runs, in the order of the cells.
    pub(super) fn runs(&self) -> &[Run] {
        &self.runs
    }

    /// Returns the smallest number of a row.
    pub(crate) fn lowest_row(&self) -> u32 {
        self.runs.iter().flat_map(|run| run.places()).fold(u32::MAX, |lowest, [row, _]| lowest.min(row))
    }

    /// Appends a cell.
    #[inline]
    pub(crate) fn push(&mut self, row: u32, column: u32) {
        self.extend(std::iter::once([row, column]));
    }

    /// Appends cells by their rows and columns.
    #[inline]
    pub(crate) fn extend(&mut self, places: impl Iterator<Item = [u32; 2]>) {
        let mut run = self.runs.pop().unwrap_or_default();
        let (mut next, mut n) = (run.at(run.n), 0);
        for place in places {
            match run.n {
                0 => run = Run::of(place),
                1 => {
                    run.step = std::array::from_fn(|axis| difference(place[axis], run.first[axis]));
                    run.n = 2;
                }
                _ if place == next => run.n += 1,
                _ => {
                    self.runs.push(run);
                    run = Run::of(place);
                }
            }
            next = std::array::from_fn(|axis| sum(place[axis], run.step[axis]));
            n += 1;
        }
        self.n += n;
        self.runs.extend((run.n > 0).then_some(run));
    }

    /// Appends a run.
    pub(super) fn append(&mut self, run: Run) {
        let continued = |last: &&mut Run| last.n > 1 && last.step == run.step && last.at(last.n) == run.first;
        if run.n == 1 {
            return self.extend(run.places());
        }
        match self.runs.last_mut().filter(continued) {
            Some(last) => last.n += run.n,
            None => self.runs.push(run),
        }
        self.n += run.len();
    }

    /// Removes all cells; keeps their room.
    pub(super) fn clear(&mut self) {
        self.runs.clear();
        self.n = 0;
    }
}

/// Successive cells of a set, from which those of one line at a time are taken.
#[derive(Debug, Default)]
pub(super) struct Cursor {
    /// Number of the run of the next cell, and of that cell in the run and in the set.
    run: usize,
    within: u32,
    cell: usize,
}

impl Cursor {
    /// Takes the next cells that lie in one line: their runs replace `taken`, their numbers are returned. Empty after
    /// the last.
    pub(super) fn take(&mut self, of: &Places, axis: usize, taken: &mut Places) -> std::ops::Range<usize> {
        let from = self.cell;
        taken.clear();
        while let Some(run) = of.runs.get(self.run) {
            let part = run.within_line(self.within, axis);
            if taken.runs.first().is_some_and(|first| first.line(axis) != part.line(axis)) {
                break;
            }
            taken.append(part);
            self.cell += part.len();
            self.within += part.n;
            if self.within == run.n {
                (self.run, self.within) = (self.run + 1, 0);
            }
        }
        from..self.cell
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(cells: &[[u32; 2]]) -> Places {
        let mut places = Places::default();
        cells.iter().for_each(|[row, column]| places.push(*row, *column));
        places
    }

    fn cells(places: &Places) -> Vec<[u32; 2]> {
        places.runs().iter().flat_map(|run| run.places()).collect()
    }

    /// Cells in no order, with neighbours in runs by chance.
    fn random(random: &mut fastrand::Rng) -> Vec<[u32; 2]> {
        let n = random.usize(0..60);
        let mut place = [random.u32(..), random.u32(..)];
        let mut step = [1, 0];
        let next = |_| {
            if random.u8(..) < 60 {
                step = [(); 2].map(|()| random.u32(0..3).wrapping_sub(1));
            }
            if random.u8(..) < 10 {
                place = [(); 2].map(|()| random.u32(..));
            }
            place = [0, 1].map(|axis| place[axis].wrapping_add(step[axis]));
            place
        };
        (0..n).map(next).collect()
    }

    #[test]
    fn every_cell_has_the_place_that_was_appended() {
        let mut rng = fastrand::Rng::with_seed(3);
        for _ in 0..500 {
            let [a, b] = [(); 2].map(|()| random(&mut rng));
            let mut places = of(&a);
            assert_eq!(cells(&places), a);
            of(&b).runs().iter().for_each(|run| places.append(*run));
            assert_eq!((cells(&places), places.len()), ([a, b].concat(), places.n));
        }
    }

    #[test]
    fn a_column_is_one_run_and_one_more_for_each_gap() {
        let column = |rows: std::ops::Range<u32>, column: u32| rows.map(move |row| [row, column]);
        let stored: Vec<_> = column(2..40, 5).chain(column(60..90, 5)).chain(column(0..9, 6)).collect();
        assert_eq!(of(&stored).runs().len(), 3);
    }

    #[test]
    fn cells_of_one_line_are_taken_together() {
        let mut rng = fastrand::Rng::with_seed(4);
        for axis in [ROW, COLUMN].repeat(300) {
            let stored = random(&mut rng);
            let (places, mut cursor, mut taken) = (of(&stored), Cursor::default(), Places::default());
            let expected: Vec<&[[u32; 2]]> = stored.chunk_by(|a, b| a[axis] == b[axis]).collect();
            for line in expected {
                let numbers = cursor.take(&places, axis, &mut taken);
                assert_eq!((&stored[numbers], &cells(&taken)[..]), (line, line));
            }
            assert!(cursor.take(&places, axis, &mut taken).is_empty());
        }
    }

    #[test]
    fn a_run_beyond_32_bits_is_so_by_its_last_line() {
        let half = 1 << 31;
        let places = of(&[[0, 7], [half, 7], [0, 7]]);
        let (first, last, _) = places.runs()[0].lines(ROW);
        assert_eq!((places.runs().len(), first), (1, 0));
        assert!(!(0..=i64::from(u32::MAX)).contains(&last));
    }
}
