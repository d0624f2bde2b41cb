//! Table `[output]`: folder of results and storage time of raw scans.

use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::document::Reported;
use crate::node::NodeKind;
use crate::table::number;
use crate::{TomlTable, Unit};

/// Default storage time. Raw scans are some tens of megabytes each: a month of strokes fits a usual disk.
const KEEP_SCANS: Duration = Duration::from_secs(30 * 86_400);

/// Destination of results.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Output {
    /// Folder that gets one folder per measurement.
    pub folder: PathBuf,
    /// The history's database file.
    pub history: PathBuf,
    /// Storage time of raw scans.
    pub keep_scans: KeepScans,
}

/// Storage time of raw scans.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KeepScans {
    /// For ever.
    Always,
    /// This long; zero keeps none.
    For(Duration),
}

impl Output {
    pub(super) fn in_folder(folder: &Path) -> Self {
        let results = folder.join("results");
        let history = results.join("history.sqlite");
        Self { folder: results, history, keep_scans: KeepScans::For(KEEP_SCANS) }
    }

    pub(super) fn read(mut table: TomlTable<'_>, plant_folder: &Path) -> Result<Self, Reported> {
        let default = Self::in_folder(plant_folder);
        let folder = table.name("folder").map(|folder| plant_folder.join(folder)).or(default.folder);
        let history = table.name("history").map(|history| plant_folder.join(history)).optional();
        let keep_scans = table.node("keep_scans").try_map(|node| match (&node.kind, number(node)) {
            (NodeKind::String(word), _) if word == "always" => Ok(KeepScans::Always),
            (NodeKind::String(text), _) => {
                Unit::DAY.read(text).map_err(|fault| format!("{fault}, or \"always\"")).and_then(keep)
            }
            (_, Some(days)) => keep(days),
            _ => Err(format!("found {}, expected a time like \"30 d\", or \"always\"", node.describe())),
        });
        let keep_scans = keep_scans.or(default.keep_scans);
        table.finish();
        let folder = folder?;
        let history = history?.unwrap_or_else(|| folder.join("history.sqlite"));
        Ok(Self { folder, history, keep_scans: keep_scans? })
    }
}

fn keep(days: f64) -> Result<KeepScans, String> {
    Duration::try_from_secs_f64(Unit::DAY.to(days, Unit::SECOND))
        .map(KeepScans::For)
        .map_err(|_| format!("found {days} d, must be at least 0; \"always\" keeps them for ever"))
}
