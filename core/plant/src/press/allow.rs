//! Allow-list of registers that may be written.

use std::fmt;
use std::ops::RangeInclusive;

use super::Block;

/// Allow-list of holding registers, with the largest rate of writes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WriteAllow {
    ranges: Vec<RangeInclusive<u16>>,
    /// Largest number of write requests in a second.
    pub max_writes_per_s: u32,
}

/// Write that the allow-list refuses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Refused {
    /// First register of the request.
    pub start: u16,
    /// Registers of the request.
    pub count: u16,
}

impl WriteAllow {
    /// Default of [`max_writes_per_s`](Self::max_writes_per_s): two heartbeats and six strokes of eight writes. This is
    /// far more than a press makes and far less than its controller can process.
    pub const MAX_WRITES_PER_S: u32 = 50;

    /// Allows these registers at the default rate. Neighbouring and overlapping ranges become one.
    pub fn new(ranges: impl IntoIterator<Item = RangeInclusive<u16>>) -> Self {
        let mut sorted: Vec<_> = ranges.into_iter().filter(|range| !range.is_empty()).collect();
        sorted.sort_by_key(|range| *range.start());
        let mut ranges: Vec<RangeInclusive<u16>> = Vec::with_capacity(sorted.len());
        for range in sorted {
            match ranges.last_mut() {
                Some(last) if u32::from(*range.start()) <= u32::from(*last.end()) + 1 => {
                    *last = *last.start()..=*last.end().max(range.end());
                }
                _ => ranges.push(range),
            }
        }
        Self { ranges, max_writes_per_s: Self::MAX_WRITES_PER_S }
    }

    /// Allows the registers of a block.
    pub fn block(block: &Block) -> Self {
        Self::new((block.count > 0).then(|| block.start..=block.start.saturating_add(block.count - 1)))
    }

    /// Checks that one request may write `count` registers from `start` on.
    ///
    /// # Errors
    /// [`Refused`] when a register lies outside, when there is none, or when the request crosses the last address.
    pub fn check(&self, start: u16, count: u16) -> Result<(), Refused> {
        let refused = Refused { start, count };
        let last = count.checked_sub(1).and_then(|more| start.checked_add(more)).ok_or(refused)?;
        let inside = self.ranges.iter().any(|range| *range.start() <= start && last <= *range.end());
        if inside { Ok(()) } else { Err(refused) }
    }

    /// Returns the ranges, sorted and disjoint.
    pub fn ranges(&self) -> &[RangeInclusive<u16>] {
        &self.ranges
    }
}

impl fmt::Display for WriteAllow {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, range) in self.ranges.iter().enumerate() {
            let comma = if i == 0 { "" } else { ", " };
            write!(f, "{comma}{}..={}", range.start(), range.end())?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn allows_what_lies_inside_one_merged_range() {
        let allow = WriteAllow::new([110..=119, 100..=109, 200..=200]);
        assert_eq!(allow.ranges(), [100..=119, 200..=200]);
        assert_eq!(allow.check(100, 20), Ok(()));
        assert_eq!(allow.check(108, 4), Ok(()));
        assert_eq!(allow.check(200, 1), Ok(()));
        for (start, count) in [(99, 1), (99, 2), (119, 2), (200, 2), (100, 0), (65535, 2)] {
            assert_eq!(allow.check(start, count), Err(Refused { start, count }));
        }
    }

    #[test]
    fn an_empty_block_allows_nothing() {
        let allow =
            WriteAllow::block(&Block { table: crate::press::RegisterTable::Holding, start: 0, count: 0 });
        assert!(allow.check(0, 1).is_err());
    }
}
