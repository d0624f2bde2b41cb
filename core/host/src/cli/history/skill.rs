//! Command `platen history skill`: figures of crews, which are identified by codes and not by names.

use std::path::PathBuf;

use clap::Args;
use platen_report::skill::{CrewSkill, Difference, LEAST_PLATES, Skill};

use super::{CliError, Common, open, output};

#[derive(Debug, Args)]
pub(super) struct Command {
    /// Plant file, with [crews]
    plant: PathBuf,
}

pub(super) fn run(common: &Common, command: &Command) -> Result<(), CliError> {
    let (plant, archive) = open(&command.plant)?;
    let Some(purpose) = plant.crews.as_ref().map(|crews| &crews.purpose) else {
        return Err(CliError::Usage(format!(
            "{}: has no [crews]: figures of crews are off; agree on their purpose, then write it there",
            command.plant.display()
        )));
    };
    let skill = Skill::of(&archive)?;
    if common.json {
        return output::json(&serde_json::json!({ "purpose": purpose, "skill": skill }));
    }
    output::line(&format!("purpose: {purpose}"))?;
    if skill.crews.is_empty() {
        output::line("no finished plate of one crew with advice (shadow suffices) is on record")?;
    } else {
        output::titled(
            "class | crew | plates | excess strokes | turn efficiency | unevenness of angles | of feeds | idle hits | hardness mm",
            skill.crews.iter().map(row),
        )?;
    }
    skill.differences.iter().try_for_each(|it| output::line(&difference(it)))?;
    match skill.left_out {
        0 => Ok(()),
        n => output::line(&format!(
            "{n} finished plates left out: no crew, several crews, or no advice from the blank on"
        )),
    }
}

fn row(crew: &CrewSkill) -> Vec<String> {
    let percent = |share: f64| format!("{:.0} %", 100.0 * share);
    let mut row = vec![crew.class.clone(), crew.crew.to_string(), crew.plates.to_string()];
    match &crew.figures {
        Some(it) => row.extend([
            format!("{:.2} ({:.2} to {:.2})", it.excess[1], it.excess[0], it.excess[2]),
            it.turn_efficiency.map_or_else(String::new, percent),
            it.unevenness[0].map_or_else(String::new, percent),
            it.unevenness[1].map_or_else(String::new, percent),
            percent(it.idle_hits),
            format!("{:.2}", it.hardness_mm),
        ]),
        None => row.push(format!("{LEAST_PLATES} plates needed")),
    }
    row
}

fn difference(it: &Difference) -> String {
    let [low, ratio, high] = it.ratio;
    let [a, b] = it.crews;
    let word = if it.is_significant() { "differ" } else { "no difference is significant" };
    format!(
        "{}: strokes of crew {a} over crew {b} at equal hardness {ratio:.2} ({low:.2} to {high:.2}): {word}",
        it.class
    )
}
