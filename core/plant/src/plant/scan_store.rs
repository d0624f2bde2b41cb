//! Table `[scan_store]`: folder to which raw scans are copied under their SHA-256, and the rule that selects them.

use std::path::{Path, PathBuf};

use crate::TomlTable;
use crate::document::Reported;

/// Default classes of scans that are stored.
const WHICH: [StoredScans; 4] =
    [StoredScans::Baseline, StoredScans::Last, StoredScans::CannotTell, StoredScans::NotMeasured];

/// Names of the classes of scans.
const NAMES: [(&str, StoredScans); 4] = [
    ("baseline", StoredScans::Baseline),
    ("last", StoredScans::Last),
    ("cannot_tell", StoredScans::CannotTell),
    ("not_measured", StoredScans::NotMeasured),
];

/// Store of raw scans beyond the time for which all of them are kept.
#[derive(Debug, Clone, PartialEq)]
pub struct ScanStore {
    /// Folder, which holds `scans/ab/SHA256.e57`.
    pub folder: PathBuf,
    /// Classes of scans that are stored.
    pub which: Vec<StoredScans>,
    /// Share of all other scans that is stored, 0 to 1.
    pub share: f64,
}

/// Class of scans.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StoredScans {
    /// Of the blank.
    Baseline,
    /// Last one of a plate.
    Last,
    /// Verdict `cannot_tell`.
    CannotTell,
    /// Verdict `not_measured`.
    NotMeasured,
}

impl ScanStore {
    pub(super) fn read(mut table: TomlTable<'_>, plant_folder: &Path) -> Result<Self, Reported> {
        let document = table.document();
        let folder = table.name("folder").map(|folder| plant_folder.join(folder)).required();
        let which = table.strings("which").optional();
        let share = table.number("share").in_range(0.0..=1.0).or(0.0);
        table.finish();
        let which = which?.map(|names| {
            let class = |name: &str| NAMES.iter().find(|(known, _)| *known == name).map(|(_, class)| *class);
            let classes = names.iter().map(|name| {
                class(&name.value).ok_or_else(|| {
                    let known = NAMES.map(|(known, _)| known).join(", ");
                    document.fault(&name.place, format!("found {:?}, expected one of {known}", name.value))
                })
            });
            classes.collect::<Result<Vec<_>, _>>()
        });
        Ok(Self {
            folder: folder?,
            which: which.transpose()?.unwrap_or_else(|| WHICH.to_vec()),
            share: share?,
        })
    }
}
