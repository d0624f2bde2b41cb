//! Comparison plugins: they compute a report from a task and the surfaces of a plate.

use std::collections::BTreeSet;
use std::time::Duration;

use platen_model::{Field, Findings, Report, Task};
use platen_plant::OptionValue;
use platen_sdk::exchange::DecodeError;
use platen_shape::Surface;

use super::worker::printable;
use super::{InputFrame, Instance, Kind, Library, PluginError};

/// A configured comparison.
#[derive(Debug)]
pub struct Comparison {
    instance: Instance,
    limit: Duration,
}

/// Longest name of a figure, characters.
const NAME: usize = 100;
/// Longest unit, characters.
const UNIT: usize = 20;
/// Longest sentence, characters; longer ones are cut.
const SENTENCE: usize = 500;
/// Most sentences; the first are the most important.
const SENTENCES: usize = 50;

/// Checks findings before they reach a screen or registers: unique names of figures, numbers, sentences without control
/// characters.
fn checked(mut findings: Findings) -> Result<Findings, String> {
    let mut names = BTreeSet::new();
    for figure in &findings.figures {
        let name = figure.name.as_str();
        if name.is_empty() || name.chars().count() > NAME || name.chars().any(char::is_control) {
            return Err(format!("a figure named {name:?}"));
        }
        if !names.insert(name) {
            return Err(format!("two figures named {name}"));
        }
        if figure.unit.chars().count() > UNIT || figure.unit.chars().any(char::is_control) {
            return Err(format!("figure {name} in the unit {:?}", figure.unit));
        }
        if let Some(uncertainty) = figure.uncertainty.filter(|it| !(it.is_finite() && *it >= 0.0)) {
            return Err(format!("figure {name} with the uncertainty {uncertainty}"));
        }
    }
    findings.says.truncate(SENTENCES);
    let templates =
        findings.templates.iter_mut().flat_map(|found| [&mut found.says, &mut found.name, &mut found.line]);
    for text in findings.says.iter_mut().chain(templates) {
        *text = printable(text).chars().take(SENTENCE).collect();
    }
    Ok(findings)
}

/// Surfaces of one plate, the inputs of a comparison.
#[derive(Debug, Clone, Copy)]
pub struct Surfaces<'a> {
    /// The plate now.
    pub now: &'a Surface,
    /// The plate at the stroke before.
    pub before: Option<&'a Surface>,
    /// The plate before the first stroke.
    pub baseline: Option<&'a Surface>,
}

impl Comparison {
    /// Creates a comparison from checked options; `limit` is the deadline of one plate.
    ///
    /// # Errors
    /// As [`Instance::create`].
    pub fn create(library: &Library, values: &[OptionValue], limit: Duration) -> Result<Self, PluginError> {
        let instance = Instance::create(library, Kind::Comparison, values)?;
        instance.open(limit)?;
        Ok(Self { instance, limit })
    }

    /// Returns the comparison with another deadline.
    #[must_use]
    pub fn with_limit(self, limit: Duration) -> Self {
        Self { limit, ..self }
    }

    /// Returns the name in plant files.
    pub fn name(&self) -> &str {
        self.instance.name()
    }

    /// Returns the instance.
    pub fn instance(&self) -> &Instance {
        &self.instance
    }

    /// Runs the comparison and checks its output.
    ///
    /// # Errors
    /// The plugin's reason, the deadline, or the violation in its output.
    pub fn compare(&self, task: &Task, surfaces: Surfaces<'_>) -> Result<Report, PluginError> {
        let input = |surface: &Surface, role| self.instance.input(surface, Some(role));
        let mut inputs = vec![self.instance.input(task, None)?, input(surfaces.now, c"now")?];
        for (surface, role) in [(surfaces.before, c"before"), (surfaces.baseline, c"baseline")] {
            inputs.extend(surface.map(|surface| input(surface, role)).transpose()?);
        }
        self.instance.twice(|| self.run(&inputs))
    }

    fn run(&self, inputs: &[InputFrame]) -> Result<Report, PluginError> {
        let mut job = self.instance.run(self.instance.evaluation(self.limit), inputs)?;
        let (mut findings, mut fields) = (None, Vec::new());
        while let Some(frame) = job.next_frame() {
            if frame.is::<Findings>() && findings.is_none() {
                let read = frame.decode::<Findings>();
                findings =
                    Some(read.map_err(|e| job.misbehaved(format!("findings that cannot be read: {e}")))?);
            } else if frame.is::<Field>() {
                let field = frame.decode().map_err(|e| match e {
                    DecodeError::Malformed(malformed) => {
                        job.misbehaved(format!("a malformed field: {malformed}"))
                    }
                    DecodeError::Invalid(_) => job.misbehaved("a field that does not fit its grid"),
                });
                fields.push(field?);
            } else {
                return Err(job.misbehaved(format!("a frame {} out of turn", frame.format)));
            }
        }
        job.finish()?;
        let findings = findings.ok_or_else(|| job.misbehaved("success without findings"))?;
        let findings = checked(findings).map_err(|what| job.misbehaved(what))?;
        Ok(Report { comparison: self.instance.name().to_owned(), findings, fields })
    }
}
