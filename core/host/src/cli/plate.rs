//! Command `platen plate new`: plate files and the list of blanks from the zones of a tank.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Subcommand};
use platen_tank::{Plate, Tank, Zone, blank_list, plate_file};

use super::{CliError, Common, output};

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  platen plate new --tank config/tank.toml --out plates --blanks blanks.csv\n  \
                        platen plate new --tank config/tank.toml --zone petal --out plates --json\n\n\
                        One plate file for each zone, plate-017.toml for recipe 17, as [plates] of a plant file wants them. Files that are \
                        there with another content are kept: nothing is written then."
)]
pub(super) struct Command {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Develop the zones of a tank file: blank, target, templates and trim lines of each plate
    New {
        /// Tank file
        #[arg(long)]
        tank: PathBuf,
        /// Only this zone
        #[arg(long)]
        zone: Option<String>,
        /// Folder for the plate files, made if missing
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
        /// Write the list of blanks, CSV
        #[arg(long, value_name = "FILE")]
        blanks: Option<PathBuf>,
    },
}

pub(super) fn run(common: &Common, command: &Command) -> Result<ExitCode, CliError> {
    let Verb::New { tank: path, zone: only, out, blanks } = &command.verb;
    let tank = Tank::load(path)?;
    let wanted = |zone: &&Zone| only.as_ref().is_none_or(|name| zone.name == *name);
    let plates: Vec<(&Zone, Plate)> =
        tank.zones.iter().filter(wanted).map(|zone| (zone, Plate::of(&tank, zone))).collect();
    if plates.is_empty() {
        let names: Vec<&str> = tank.zones.iter().map(|zone| zone.name.as_str()).collect();
        return Err(CliError::Usage(format!(
            "{}: has no such zone; it has {}",
            path.display(),
            names.join(", ")
        )));
    }
    let mut files: Vec<(PathBuf, Vec<u8>)> = Vec::new();
    for (zone, plate) in &plates {
        let path = out.join(format!("plate-{:03}.toml", zone.recipe));
        files.push((path, plate_file(&tank, zone, plate).into_bytes()));
    }
    if let Some(path) = blanks {
        let list = blank_list(&tank, plates.iter().map(|(zone, plate)| (*zone, plate)));
        files.push((path.clone(), list.map_err(CliError::Failed)?));
    }
    let changed = |(path, text): &&(PathBuf, Vec<u8>)| std::fs::read(path).is_ok_and(|found| found != *text);
    if let Some((path, _)) = files.iter().find(changed) {
        return Err(CliError::Usage(format!(
            "{}: is there with another content; nothing was written: move it away or name another folder",
            path.display()
        )));
    }
    std::fs::create_dir_all(out).map_err(|e| CliError::Failed(format!("{}: {e}", out.display())))?;
    for (path, text) in &files {
        std::fs::write(path, text).map_err(|e| CliError::Failed(format!("{}: {e}", path.display())))?;
    }
    if common.json {
        let zones: Vec<_> = plates
            .iter()
            .zip(&files)
            .map(|((zone, plate), (path, _))| document(&tank, zone, plate, path))
            .collect();
        output::json(&serde_json::json!({ "tank": tank.name, "zones": zones, "blanks": blanks }))?;
    } else {
        for ((zone, plate), (path, _)) in plates.iter().zip(&files) {
            print(&tank, zone, plate, path)?;
        }
        if let Some(path) = blanks {
            output::line(&format!("wrote {}", path.display()))?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Returns a sentence on the lines that are too short for the template of the rule, and on an empty rule.
fn not_judged(tank: &Tank, zone: &Zone, plate: &Plate) -> Option<String> {
    let Some(rule) = zone.rule.and_then(|rule| tank.rules.get(rule)) else {
        return Some("no rule: nothing will be judged".into());
    };
    let Some([chord, _]) = rule.limit else {
        return Some(format!(
            "rule {:?} is empty ({}): nothing will be judged until its figures are typed in",
            rule.name, rule.clause
        ));
    };
    let (_, short) = plate.templates(rule);
    (!short.is_empty()).then(|| {
        format!("without a template, shorter than the board of {:.0} mm: {}", 1e3 * chord, short.join(", "))
    })
}

fn document(tank: &Tank, zone: &Zone, plate: &Plate, path: &std::path::Path) -> serde_json::Value {
    let mm = |sides: [f64; 2]| sides.map(|side| 1e3 * side);
    serde_json::json!({
        "zone": zone.name, "file": path, "recipe": zone.recipe, "plates": zone.plates,
        "blank_mm": mm(plate.blank), "allowance_mm": 1e3 * plate.allowance, "mass_kg": plate.mass,
        "checks": plate.checks, "not_judged": not_judged(tank, zone, plate),
    })
}

fn print(tank: &Tank, zone: &Zone, plate: &Plate, path: &std::path::Path) -> Result<(), CliError> {
    let [width, height] = plate.blank.map(|side| 1e3 * side);
    output::line(&format!(
        "{}: {} plates, blank {width:.1} x {height:.1} x {:.1} mm, {:.0} kg, of which {:.0} mm at each edge are cut off",
        zone.name,
        zone.plates,
        1e3 * zone.thickness,
        plate.mass,
        1e3 * plate.allowance
    ))?;
    for check in &plate.checks {
        output::line(&format!("  {}: {:.1} {}", check.what, check.value, check.unit))?;
    }
    if let Some(why) = not_judged(tank, zone, plate) {
        output::line(&format!("  {why}"))?;
    }
    output::line(&format!("  wrote {}", path.display()))
}
