//! Tests of level 2: options, reference inputs, equal answers, plausible answers.

use platen_engine::plugin::{Kind, PluginError};
use platen_plant::{OptionDecl, OptionType, OptionValue, Value};

use crate::answer::{self, Any, charts, digest, reports};
use crate::reference;
use crate::subject::{Subject, failed};
use crate::{Test, Verdict};

/// Number of random option sets.
const RANDOM_SETS: usize = 20;
/// Accuracy of the positions (u, v) on a plate that was bent without stretching, metres.
const EXACT: f64 = 1e-5;

pub(super) const TESTS: &[Test] = &[
    Test {
        name: "options.default",
        level: 2,
        demands: "it is created with its default options",
        run: by_default,
    },
    Test {
        name: "options.each",
        level: 2,
        demands: "each choice and each end of a range is taken or refused with a sentence",
        run: each,
    },
    Test { name: "options.random", level: 2, demands: "so are random sets of options", run: random },
    Test { name: "answer.given", level: 2, demands: "it answers the reference inputs", run: given },
    Test {
        name: "answer.silent",
        level: 2,
        demands: "without a word on standard output or error",
        run: silent,
    },
    Test {
        name: "answer.same",
        level: 2,
        demands: "a second process answers the same, to the last bit",
        run: same,
    },
    Test {
        name: "answer.again",
        level: 2,
        demands: "the same instance answers the same a second time",
        run: again,
    },
    Test {
        name: "answer.beside",
        level: 2,
        demands: "two instances at work do not disturb each other",
        run: beside,
    },
    Test {
        name: "sense.lengths",
        level: 2,
        demands: "a plate bent without stretching keeps its lengths within 0.01 mm",
        run: lengths,
    },
    Test {
        name: "sense.figures",
        level: 2,
        demands: "a comparison says something: a figure, a field or a sentence",
        run: figures,
    },
];

fn given(subject: &Subject) -> Result<(), Verdict> {
    digest(subject).map(drop).map_err(|error| error.0)
}

fn silent(subject: &Subject) -> Result<(), Verdict> {
    if subject.library()?.facts().printed.is_some() {
        return Err(Verdict::LeftOut("load.silent has not passed".into()));
    }
    let printed = answer::after(subject, |instance| instance.worker_state().and_then(|state| state.printed))?;
    match printed {
        None => Ok(()),
        Some(line) => Err(failed(format!("it printed {line:?}; use the host's log"))),
    }
}

fn by_default(subject: &Subject) -> Result<(), Verdict> {
    subject.instance(subject.values()?).map(drop).map_err(failed)
}

/// Creates the plugin with these values; it may refuse them.
fn may_refuse(subject: &Subject, values: &[OptionValue]) -> Result<(), Verdict> {
    match subject.instance(values) {
        Ok(_) => Ok(()),
        Err(PluginError::RefusedOptions { message, .. }) if !message.trim().is_empty() => Ok(()),
        Err(error) => {
            let given: Vec<String> =
                values.iter().map(|value| format!("{} = {:?}", value.name, value.value)).collect();
            Err(failed(format!("with {}: {error}", given.join(", "))))
        }
    }
}

/// Returns the values with one of them changed.
fn with(values: &[OptionValue], name: &str, value: Value) -> Vec<OptionValue> {
    let mut values = values.to_vec();
    values.retain(|other| other.name != name);
    values.push(OptionValue { name: name.to_owned(), value, given: true });
    values
}

/// Returns values at the limits of an option.
fn edges(option: &OptionDecl) -> Vec<Value> {
    let ends = || [option.min, option.max].into_iter().flatten();
    match option.kind {
        OptionType::Bool => vec![Value::Bool(false), Value::Bool(true)],
        OptionType::Int => ends().map(|end| Value::Int(end as i64)).collect(),
        OptionType::Float => ends().map(Value::Float).collect(),
        OptionType::Duration => ends().map(Value::Duration).collect(),
        OptionType::Choice => option.choices.iter().map(|choice| Value::String(choice.clone())).collect(),
        OptionType::String | OptionType::Path | OptionType::Floats => Vec::new(),
    }
}

fn each(subject: &Subject) -> Result<(), Verdict> {
    let values = subject.values()?;
    for option in &subject.descriptor()?.options {
        for edge in edges(option) {
            may_refuse(subject, &with(values, &option.name, edge))?;
        }
    }
    Ok(())
}

fn random(subject: &Subject) -> Result<(), Verdict> {
    let mut random = fastrand::Rng::with_seed(subject.settings.seed);
    let values = subject.values()?;
    let declared = &subject.descriptor()?.options;
    for _ in 0..if declared.is_empty() { 0 } else { RANDOM_SETS } {
        let mut set = values.to_vec();
        for option in declared {
            let (low, high) = (option.min.unwrap_or(-1e3), option.max.unwrap_or(1e3));
            let number = low + (high - low) * random.f64();
            let value = match option.kind {
                OptionType::Int => Some(Value::Int(number as i64)),
                OptionType::Float => Some(Value::Float(number)),
                OptionType::Duration => Some(Value::Duration(number.max(0.0))),
                _ => random.choice(edges(option)),
            };
            if let Some(value) = value {
                set = with(&set, &option.name, value);
            }
        }
        may_refuse(subject, &set)?;
    }
    Ok(())
}

fn same(subject: &Subject) -> Result<(), Verdict> {
    let answer = || digest(subject).map_err(|error| Verdict::LeftOut(error.to_string()));
    if subject.kind()? == Kind::Scanner && subject.descriptor()?.hardware {
        return Err(Verdict::LeftOut("no two scans of a device are the same".into()));
    }
    if answer()? == answer()? { Ok(()) } else { Err(failed("the second answer is another")) }
}

fn again(subject: &Subject) -> Result<(), Verdict> {
    let limit = subject.settings.limit;
    let unanswered = |verdict| match verdict {
        Verdict::Failed(why) => Verdict::LeftOut(why),
        other => other,
    };
    let mut one = Any::of(subject, limit)?;
    let first = one.answer(limit).map_err(unanswered)?;
    let second = one.answer(limit);
    if first == second? {
        Ok(())
    } else {
        Err(failed("the second answer is another: it remembers the first"))
    }
}

fn beside(subject: &Subject) -> Result<(), Verdict> {
    let alone = digest(subject).map_err(|error| Verdict::LeftOut(error.to_string()))?;
    let answers = std::thread::scope(|scope| {
        let other = scope.spawn(|| digest(subject));
        [digest(subject), other.join().unwrap_or_else(|_| digest(subject))]
    });
    for answer in answers {
        if answer.map_err(|error| error.0)? != alone {
            return Err(failed("beside another instance it answers otherwise"));
        }
    }
    Ok(())
}

fn lengths(subject: &Subject) -> Result<(), Verdict> {
    let charts = charts(&mut subject.flattening(subject.settings.limit)?)?;
    for ((name, plate), chart) in reference::meshes().iter().zip(charts) {
        let [_, most] = plate.errors(&chart.uv);
        if most > EXACT {
            return Err(failed(format!(
                "{name}: material lies up to {:.3} mm from its place",
                1000.0 * most
            )));
        }
    }
    Ok(())
}

fn figures(subject: &Subject) -> Result<(), Verdict> {
    let reports = reports(&subject.comparison(subject.settings.limit)?)?;
    let silent = |report: &platen_model::Report| {
        report.fields.is_empty() && report.findings.figures.is_empty() && report.findings.says.is_empty()
    };
    if reports.iter().all(silent) { Err(failed("it says nothing in any situation")) } else { Ok(()) }
}
