//! Second pass: columns of the oriented lattice, in the order in which the file completes them.

use std::borrow::Cow;

use platen_scan::{Column, ScanEnd};

use super::error::Result;
use crate::orient::{Assembly, Plan, SphericalCells};

/// Cells in the order of the file. No batch follows an error.
pub(crate) type Batches<'a> = Box<dyn Iterator<Item = Result<Cow<'a, SphericalCells>>> + 'a>;

/// Columns of an oriented lattice, each once, as soon as the file has completed it. No column follows an error.
pub struct Columns<'a> {
    assembly: Assembly<'a>,
    batches: Batches<'a>,
    batch: Cow<'a, SphericalCells>,
}

impl<'a> Columns<'a> {
    /// Starts the second pass over the cells.
    pub(crate) fn new(plan: &'a Plan, batches: Batches<'a>) -> Self {
        Self { assembly: Assembly::new(plan), batches, batch: Cow::default() }
    }

    /// Returns the share of cells read, 0 to 1.
    pub fn share(&self) -> f64 {
        self.assembly.share()
    }

    /// Returns the trailer; columns not taken are read and dropped.
    ///
    /// # Errors
    /// As the columns.
    pub fn finish(&mut self) -> Result<ScanEnd> {
        self.try_for_each(|column| column.map(drop))?;
        Ok(self.assembly.end())
    }

    fn next_column(&mut self) -> Result<Option<Column>> {
        loop {
            if let Some(column) = self.assembly.next(&self.batch)? {
                return Ok(Some(column));
            }
            self.batch = match self.batches.next() {
                Some(batch) => batch?,
                None => break,
            };
        }
        self.batch = Cow::default();
        Ok(self.assembly.next_empty()?)
    }
}

impl Iterator for Columns<'_> {
    type Item = Result<Column>;

    fn next(&mut self) -> Option<Self::Item> {
        self.next_column().transpose()
    }
}
