//! Answers of a plugin to the reference inputs, and their digest, which is equal only for answers that agree to the
//! last bit.

use std::time::Duration;

use platen_engine::plugin::{
    Advisor, CancelToken, Comparison, Flattening, Instance, JobSpec, Kind, Scanner, Surfaces,
};
use platen_model::Report;
use platen_shape::{Chart, Flatten};
use sha2::{Digest as _, Sha256};

use crate::Verdict;
use crate::reference;
use crate::subject::{Subject, failed};

/// Reason why there is no answer.
#[derive(Debug, thiserror::Error)]
#[error("{}", match .0 { Verdict::Failed(why) | Verdict::LeftOut(why) | Verdict::Warned(why) => why, Verdict::Passed => "" })]
pub(crate) struct NoAnswer(pub(crate) Verdict);

/// New instance of any kind.
pub(crate) enum Any {
    Flattening(Flattening),
    Comparison(Comparison),
    Advisor(Advisor),
    Scanner(Scanner),
}

impl Any {
    /// Returns an instance whose jobs have this deadline.
    pub(crate) fn of(subject: &Subject, limit: Duration) -> Result<Self, Verdict> {
        Ok(match subject.kind()? {
            Kind::Flattening => Self::Flattening(subject.flattening(limit)?),
            Kind::Comparison => Self::Comparison(subject.comparison(limit)?),
            Kind::Advisor => Self::Advisor(subject.advisor(limit)?),
            Kind::Scanner => Self::Scanner(subject.scanner()?),
        })
    }

    pub(crate) fn instance(&self) -> &Instance {
        match self {
            Self::Flattening(one) => one.instance(),
            Self::Comparison(one) => one.instance(),
            Self::Advisor(one) => one.instance(),
            Self::Scanner(one) => one.instance(),
        }
    }

    /// Returns a digest of the answers to all reference inputs.
    pub(crate) fn answer(&mut self, limit: Duration) -> Result<String, Verdict> {
        match self {
            Self::Flattening(one) => of_flattening(one),
            Self::Comparison(one) => of_comparison(one),
            Self::Advisor(one) => of_advisor(one),
            Self::Scanner(one) => of_scanner(one, limit),
        }
    }
}

/// Returns a digest of all answers of a new instance.
pub(crate) fn digest(subject: &Subject) -> Result<String, NoAnswer> {
    let limit = subject.settings.limit;
    Any::of(subject, limit).and_then(|mut any| any.answer(limit)).map_err(NoAnswer)
}

/// Returns the result of `look` at a new instance after it has answered.
pub(crate) fn after<T>(subject: &Subject, look: impl Fn(&Instance) -> T) -> Result<T, Verdict> {
    let limit = subject.settings.limit;
    let mut any = Any::of(subject, limit)?;
    any.answer(limit)?;
    Ok(look(any.instance()))
}

fn hex(sha: Sha256) -> String {
    sha.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Returns the charts of the reference meshes.
pub(crate) fn charts(flattening: &mut Flattening) -> Result<Vec<Chart>, Verdict> {
    let mut charts = Vec::new();
    for (name, plate) in reference::meshes() {
        let mesh = plate.mesh().map_err(failed)?;
        charts.push(flattening.flatten(&mesh).map_err(|error| failed(format!("{name}: {error}")))?);
    }
    Ok(charts)
}

pub(crate) fn of_flattening(flattening: &mut Flattening) -> Result<String, Verdict> {
    let mut sha = Sha256::new();
    for chart in charts(flattening)? {
        let numbers = chart.uv.iter().chain(chart.sigma.iter().flatten()).flatten();
        numbers.for_each(|x| sha.update(x.to_bits().to_le_bytes()));
    }
    Ok(hex(sha))
}

/// Inputs of a comparison, by name: before, baseline, target, share of the plate that is seen.
pub(crate) const SITUATIONS: [(&str, bool, bool, bool, f64); 5] = [
    ("a plate, the stroke before and its blank", true, true, true, 1.0),
    ("no stroke before", false, true, true, 1.0),
    ("no scan of the blank", true, false, true, 1.0),
    ("no target", true, true, false, 1.0),
    ("a third of the plate unseen", true, true, true, 0.67),
];

/// Returns the reports of the reference situations.
pub(crate) fn reports(comparison: &Comparison) -> Result<Vec<Report>, Verdict> {
    let mut reports = Vec::new();
    for (name, before, baseline, target, seen) in SITUATIONS {
        let surface = |radius: f64, seen: f64| {
            reference::surface(radius, seen).ok_or_else(|| failed("the kit has no reference surface"))
        };
        let (now, earlier, blank) = (surface(6.5, seen)?, surface(7.0, 1.0)?, surface(1e4, 1.0)?);
        let surfaces =
            Surfaces { now: &now, before: before.then_some(&earlier), baseline: baseline.then_some(&blank) };
        let report = comparison.compare(&reference::task(target), surfaces);
        reports.push(report.map_err(|error| failed(format!("{name}: {error}")))?);
    }
    Ok(reports)
}

pub(crate) fn of_comparison(comparison: &Comparison) -> Result<String, Verdict> {
    let mut sha = Sha256::new();
    for report in reports(comparison)? {
        sha.update(format!("{:?}", report.findings));
        for field in &report.fields {
            sha.update(&field.name);
            field.values.iter().for_each(|x| sha.update(x.to_bits().to_le_bytes()));
        }
    }
    Ok(hex(sha))
}

/// Inputs of an advisor, by name: radius of the plate, metres; share of the plate that is seen; strokes so far.
const ADVISED: [(&str, f64, f64, usize); 4] = [
    ("a flat plate", 1e4, 1.0, 0),
    ("a plate half way, after three strokes", 9.0, 1.0, 3),
    ("a plate bent too far", 5.0, 1.0, 3),
    ("a third of the plate unseen", 9.0, 0.67, 3),
];

/// Returns a digest of the advice in the reference situations.
pub(crate) fn of_advisor(advisor: &Advisor) -> Result<String, Verdict> {
    let mut sha = Sha256::new();
    for (name, radius, seen, strokes) in ADVISED {
        let surface = |radius, seen| {
            reference::surface(radius, seen).ok_or_else(|| failed("the kit has no reference surface"))
        };
        let (now, blank) = (surface(radius, seen)?, surface(1e4, 1.0)?);
        let history = reference::history(strokes);
        let advice = advisor.advise(&history, &now, Some(&blank), CancelToken::default());
        sha.update(format!("{:?}", advice.map_err(|error| failed(format!("{name}: {error}")))?));
    }
    Ok(hex(sha))
}

pub(crate) fn of_scanner(scanner: &Scanner, limit: Duration) -> Result<String, Verdict> {
    let mut scan = scanner.start(JobSpec::untriggered(limit), None).map_err(failed)?;
    // Columns come in any order.
    let mut columns = Vec::new();
    for column in &mut scan {
        let column = column.map_err(failed)?;
        let mut sha = Sha256::new();
        column.range_m.iter().for_each(|x| sha.update(x.to_bits().to_le_bytes()));
        column.intensity.iter().for_each(|x| sha.update(x.to_le_bytes()));
        columns.push((column.index, hex(sha)));
    }
    scan.finish().map_err(failed)?;
    columns.sort();
    let mut sha = Sha256::new();
    columns.iter().for_each(|(index, column)| sha.update(format!("{index} {column}")));
    Ok(hex(sha))
}
