//! Values of the fields of a packet's points as arrays, with selection of the first echo of each beam.

use std::ops::RangeInclusive;

/// Values of the fields of a packet, by point; empty for fields that the file does not have.
#[derive(Debug, Default)]
pub(super) struct Values {
    pub(super) position: [Vec<f64>; 3],
    pub(super) intensity: Vec<f64>,
    pub(super) row: Vec<i64>,
    pub(super) column: Vec<i64>,
    pub(super) state: Vec<i64>,
    pub(super) echo: Vec<i64>,
}

impl Values {
    /// Returns the first point, among first echoes, whose number is outside of `wanted`, and that number.
    pub(super) fn first_outside(&self, numbers: &[i64], wanted: RangeInclusive<i64>) -> Option<(usize, i64)> {
        let is_first = |point: usize| self.echo.get(point).is_none_or(|echo| *echo <= 0);
        let mut outside = numbers.iter().enumerate().filter(|(_, number)| !wanted.contains(number));
        outside.find(|(point, _)| is_first(*point)).map(|(point, number)| (point, *number))
    }

    /// Keeps the first `n` points.
    pub(super) fn truncate(&mut self, n: usize) {
        let Self { position, intensity, row, column, state, echo } = self;
        position.iter_mut().chain([intensity]).for_each(|numbers| numbers.truncate(n));
        [row, column, state, echo].into_iter().for_each(|numbers| numbers.truncate(n));
    }

    /// Removes the second and later echoes of beams.
    pub(super) fn keep_first_echoes(&mut self) {
        let Self { position, intensity, row, column, state, echo } = self;
        if echo.iter().any(|echo| *echo > 0) {
            position.iter_mut().chain([intensity]).for_each(|numbers| retain_first_echoes(numbers, echo));
            [row, column, state].into_iter().for_each(|numbers| retain_first_echoes(numbers, echo));
        }
    }
}

/// Keeps the values of first echoes.
fn retain_first_echoes<T>(values: &mut Vec<T>, echo: &[i64]) {
    let mut echoes = echo.iter();
    values.retain(|_| echoes.next().is_some_and(|echo| *echo <= 0));
}
