//! Files of the demo: the files of `config/` with the assigned ports and an output folder of their own.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};

use super::operator::{MOST_ADVISED, Operator};
use crate::cli::{CliError, output};

const PRESS: &str = include_str!("../../../../../config/sim-press.toml");
const PLANT: &str = include_str!("../../../../../config/sim-plant.toml");
const PLATE: &str = include_str!("../../../../../config/plates/plate-009.toml");

/// Die of the demo's press.
const DIE: &str = "\n[[die]]\nid = 4\nopening_mm = 360.0\nedge_mm = 200.0\n";
/// Time limits for a slow or emulated computer; a demo waits for nothing else.
const TIMEOUTS: &str =
    "\n[press.timeouts]    # a slow computer may take its time\nscan_ms = 120000\nevaluate_ms = 120000\n";

/// Creates the demo's folder with its plate file; it replaces the folder of an earlier demo only.
pub(super) fn prepare(out: &Path) -> Result<(), CliError> {
    output::fresh_folder(out, "demo")?;
    std::fs::create_dir(out.join("plates"))?;
    Ok(std::fs::write(out.join("plates/plate-009.toml"), PLATE)?)
}

/// Writes the press's file. It contains a pause between two strokes (seconds) if one is given, and a ram that is driven
/// to ordered depths if strokes are advised.
pub(super) fn press_file(
    out: &Path,
    pace_s: Option<u32>,
    advice: Option<Operator>,
    seed: u64,
) -> Result<PathBuf, CliError> {
    let path = out.join("press.toml");
    let pause = pace_s.map(|s| format!("\n[timings]\nbetween_ms = {}\n", u64::from(s) * 1000));
    let mut text = PRESS.to_owned();
    if advice.is_some() {
        text = text
            .replace("strategy = \"closed_loop\"", "strategy = \"operator\"")
            .replace("strokes = 14 ", &format!("strokes = {MOST_ADVISED} "));
        text.push_str(&format!("\n[plate.ram]\nseed = {seed}\n"));
    }
    std::fs::write(&path, format!("{text}{}", pause.unwrap_or_default()))?;
    Ok(path)
}

/// Writes the plant file with the assigned ports.
pub(super) fn plant_file(
    out: &Path,
    modbus: SocketAddr,
    plate: SocketAddr,
    advice: Option<Operator>,
) -> Result<PathBuf, CliError> {
    let path = out.join("plant.toml");
    let mut text = PLANT
        .replace("port = 15020", &format!("port = {}", modbus.port()))
        .replace("127.0.0.1:15021", &plate.to_string())
        .replace("folder = \"../platen-results\"", "folder = \"results\"");
    text.push_str(TIMEOUTS);
    if let Some(operator) = advice {
        let show = if operator == Operator::Follow { "screen" } else { "shadow" };
        text.push_str(&format!("\n[advice]\nplugin = \"line-bends\"\nshow = \"{show}\"\ndeadline_ms = 30000    # a busy computer may take its time; 2000 by default\n{DIE}"));
    }
    std::fs::write(&path, text)?;
    Ok(path)
}
