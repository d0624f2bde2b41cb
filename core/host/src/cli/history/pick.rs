//! Reference to a stroke on the command line: run id, or plate and stroke.

use std::str::FromStr;

use platen_history::{Archive, Filter, Stroke};
use platen_report::history_view;

use crate::cli::CliError;

/// Reference to a stroke: run id, or `plate:stroke`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum RunRef {
    /// Run id, the key of the record.
    Run(u32),
    /// Number of the plate in the history, and the stroke's label as in list and report.
    OfPlate(u32, String),
}

impl FromStr for RunRef {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("found {text}, expected a run id (1042) or plate:stroke (12:3, 12:blank)");
        match text.split_once(':') {
            None => text.parse().map(Self::Run).map_err(|_| wrong()),
            Some((_, "")) => Err(wrong()),
            Some((plate, stroke)) => {
                plate.parse().map(|plate| Self::OfPlate(plate, stroke.to_owned())).map_err(|_| wrong())
            }
        }
    }
}

impl RunRef {
    /// Returns the stroke; the newest one where a plate has several with this label.
    pub(super) fn find(&self, archive: &Archive) -> Result<Stroke, CliError> {
        match self {
            Self::Run(run_id) => Ok(archive.stroke(*run_id)?),
            Self::OfPlate(plate, name) => {
                let strokes = archive.strokes(&Filter { plate: Some(*plate), ..Filter::default() })?;
                let names: Vec<String> = strokes.iter().map(history_view::label).collect();
                let found = strokes.into_iter().rev().find(|stroke| history_view::label(stroke) == *name);
                found.ok_or_else(|| {
                    let known = if names.is_empty() { "no strokes".to_owned() } else { names.join(", ") };
                    CliError::Usage(format!("plate {plate} has no stroke {name}; it has {known}"))
                })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::RunRef;

    #[test]
    fn a_stroke_is_named_by_run_or_by_plate_and_stroke() {
        assert_eq!("1042".parse(), Ok(RunRef::Run(1042)));
        assert_eq!("12:3".parse(), Ok(RunRef::OfPlate(12, "3".into())));
        assert_eq!("12:blank".parse(), Ok(RunRef::OfPlate(12, "blank".into())));
        for wrong in ["", "x", "-1", "12:", ":3", "a:3"] {
            let error = wrong.parse::<RunRef>().unwrap_err();
            assert!(error.ends_with("expected a run id (1042) or plate:stroke (12:3, 12:blank)"), "{error}");
        }
    }
}
