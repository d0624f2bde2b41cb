//! Value of one key, in one of three states: missing, found or already reported.

use std::fmt::Display;
use std::ops::RangeInclusive;

use crate::document::{Document, Reported};
use crate::source::Place;

/// Value of one key. Checks chain; [`TomlKey::required`], [`TomlKey::optional`] or [`TomlKey::or`] ends the chain.
#[derive(Debug)]
#[must_use = "end the chain with required(), optional() or or()"]
pub struct TomlKey<'d, T> {
    document: &'d Document,
    place: Place,
    state: Result<Option<T>, Reported>,
    /// Fault that explains a missing value, which is then not reported.
    excuse: Option<Reported>,
}

/// Value with its place, for checks against other keys.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Located<T> {
    /// Value.
    pub value: T,
    /// Place.
    pub place: Place,
}

impl<'d, T> TomlKey<'d, T> {
    pub(crate) fn new(
        document: &'d Document,
        place: Place,
        state: Result<Option<T>, Reported>,
        excuse: Option<Reported>,
    ) -> Self {
        Self { document, place, state, excuse }
    }

    /// Converts the value; the text of a refusal becomes the fault.
    pub fn try_map<U>(self, convert: impl FnOnce(T) -> Result<U, String>) -> TomlKey<'d, U> {
        let Self { document, place, state, excuse } = self;
        let state = state.and_then(|value| {
            value.map(convert).transpose().map_err(|message| document.fault(&place, message))
        });
        TomlKey { document, place, state, excuse }
    }

    /// Converts the value.
    pub fn map<U>(self, convert: impl FnOnce(T) -> U) -> TomlKey<'d, U> {
        self.try_map(|value| Ok(convert(value)))
    }

    /// Refuses the value with the text that `check` returns.
    pub fn check(self, check: impl FnOnce(&T) -> Result<(), String>) -> Self {
        self.try_map(|value| check(&value).map(|()| value))
    }

    /// Adds the place.
    pub fn located(self) -> TomlKey<'d, Located<T>> {
        let place = self.place.clone();
        self.map(|value| Located { value, place })
    }

    /// Returns the value; a missing one is a fault.
    ///
    /// # Errors
    /// [`Reported`] when it is missing or was refused.
    pub fn required(self) -> Result<T, Reported> {
        let Self { document, place, state, excuse } = self;
        state?.ok_or_else(|| excuse.unwrap_or_else(|| document.absent(&place, "missing")))
    }

    /// Returns the value if it is there.
    ///
    /// # Errors
    /// [`Reported`] when it was refused.
    pub fn optional(self) -> Result<Option<T>, Reported> {
        self.state
    }

    /// Returns the value or its default.
    ///
    /// # Errors
    /// [`Reported`] when it was refused.
    pub fn or(self, default: T) -> Result<T, Reported> {
        Ok(self.state?.unwrap_or(default))
    }
}

impl<T: PartialOrd + Display> TomlKey<'_, T> {
    /// Refuses values outside `range`.
    pub fn in_range(self, range: RangeInclusive<T>) -> Self {
        self.check(|value| match range.contains(value) {
            true => Ok(()),
            false => Err(format!("found {value}, allowed {} to {}", range.start(), range.end())),
        })
    }

    /// Refuses values that are not above `limit`.
    pub fn above(self, limit: T) -> Self {
        self.check(|value| match *value > limit {
            true => Ok(()),
            false => Err(format!("found {value}, must be above {limit}")),
        })
    }

    /// Refuses values below `limit`.
    pub fn at_least(self, limit: T) -> Self {
        self.check(|value| match *value >= limit {
            true => Ok(()),
            false => Err(format!("found {value}, must be at least {limit}")),
        })
    }
}
