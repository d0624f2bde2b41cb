//! Set of stored cells: a bitmap per column that grows in both directions, in memory bounded by the number of cells.

use std::collections::VecDeque;

/// Number of words of 64 rows allowed regardless of the number of cells; lattices of usual filling stay far below.
const FREE_WORDS: u64 = 1 << 16;
/// Number of words allowed per cell: 16 words are 1024 rows for one cell.
const WORDS_PER_CELL: u64 = 16;

/// A set of (row, column).
#[derive(Debug, Default)]
pub(super) struct Occupancy {
    columns: Vec<Rows>,
    words: u64,
    cells: u64,
}

/// Rows of one column: bit `r % 64` of word `r / 64 - base`.
#[derive(Debug, Default)]
struct Rows {
    base: usize,
    words: VecDeque<u64>,
}

/// Result of an insertion.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Inserted {
    /// A new cell.
    New,
    /// A cell that the set contains already.
    Twice,
    /// A cell so far from all others that the bitmap would exceed its bound.
    TooFar,
}

impl Occupancy {
    /// Adds a cell.
    #[inline]
    pub(super) fn insert(&mut self, row: u32, column: u32) -> Inserted {
        let (column, word, bit) = (column as usize, row as usize / 64, 1 << (row % 64));
        let held =
            self.columns.get_mut(column).and_then(|rows| rows.words.get_mut(word.wrapping_sub(rows.base)));
        let held = match held {
            Some(held) => held,
            None => match self.reach(column, word) {
                Some(held) => held,
                None => return Inserted::TooFar,
            },
        };
        if *held & bit != 0 {
            return Inserted::Twice;
        }
        *held |= bit;
        self.cells += 1;
        Inserted::New
    }

    /// Extends a column to a word; `None` beyond the bound.
    #[cold]
    fn reach(&mut self, column: usize, word: usize) -> Option<&mut u64> {
        if column >= self.columns.len() {
            self.columns.resize_with(column + 1, Rows::default);
        }
        let rows = &mut self.columns[column];
        self.words += rows.missing(word) as u64;
        if self.words > FREE_WORDS + WORDS_PER_CELL * self.cells {
            return None;
        }
        rows.reach(word);
        rows.words.get_mut(word - rows.base)
    }
}

impl Rows {
    /// Returns the number of words to add until `word` is contained.
    fn missing(&self, word: usize) -> usize {
        if self.words.is_empty() {
            1
        } else if word < self.base {
            self.base - word
        } else {
            (word + 1).saturating_sub(self.base + self.words.len())
        }
    }

    fn reach(&mut self, word: usize) {
        if self.words.is_empty() {
            self.base = word;
        }
        while word < self.base {
            self.words.push_front(0);
            self.base -= 1;
        }
        while word >= self.base + self.words.len() {
            self.words.push_back(0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cell_is_new_once_whatever_the_order() {
        let mut seen = Occupancy::default();
        for row in (0..500).rev().chain(500..900) {
            assert_eq!(seen.insert(row, 7), Inserted::New, "row {row}");
        }
        assert_eq!(seen.insert(499, 7), Inserted::Twice);
        assert_eq!(seen.insert(499, 6), Inserted::New);
    }

    #[test]
    fn scattered_indices_buy_no_memory() {
        let mut seen = Occupancy::default();
        let mut refused = false;
        for column in 0..100_000_u32 {
            seen.insert(0, column);
            refused |= seen.insert(131_071, column) == Inserted::TooFar;
            if refused {
                break;
            }
        }
        assert!(refused && seen.words < 200_000);
    }
}
