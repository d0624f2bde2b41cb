//! The plant file: which scanner, which algorithms, where the plates and the results are.
//!
//! Everything but `[scanner]` and `[press]` has a default, so that a scan can be measured without a plant file.
//! Relative paths start at the folder of the plant file.

mod calibration;
mod frame;
mod output;
mod plugin_use;

pub use calibration::CalibrationUse;
pub use frame::{Frame, RegionOfInterest, RigidTransform};
pub use output::{KeepScans, Output};
pub use plugin_use::PluginUse;

use std::path::{Path, PathBuf};

use crate::document::{Document, Reported};
use crate::press::Press;
use crate::{Error, Faults, TomlTable};

/// Used where the plant file names no flattening.
const FLATTENING: &str = "elastic";
/// Used where the plant file lists no comparison; `comparison = []` asks for none.
const COMPARISONS: [&str; 2] = ["displacement", "template"];

/// Words of `window` in `[scanner]`.
const WINDOWS: [(&str, ScanWindow); 3] =
    [("plate", ScanWindow::Plate), ("region", ScanWindow::Region), ("everything", ScanWindow::Everything)];

/// Which part of the dome is scanned, by a driver that plans its scans (one that estimates their time).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ScanWindow {
    /// Where the last stroke's plate lay and some room round it; the region of interest for a new plate, and once more
    /// for a plate that has moved out.
    #[default]
    Plate,
    /// Always the region of interest.
    Region,
    /// What the driver scans by itself.
    Everything,
}

/// A checked plant file, but for the options of its plugins: those wait for the plugins' own declarations.
#[derive(Debug, Clone, PartialEq)]
pub struct PlantFile {
    /// Name for people; the file's name where none is given.
    pub name: String,
    /// From which every random choice is drawn, so that a measurement can be repeated to the last bit.
    pub seed: u64,
    /// The press and how it is reached; needed to run, not to measure a file.
    pub press: Option<Press>,
    /// Where scans come from; needed to run, not to measure a file.
    pub scanner: Option<PluginUse>,
    /// Which part of the dome it scans.
    pub scan_window: ScanWindow,
    /// How the scanner stands to the press and the plate.
    pub frame: Frame,
    /// What is known of the scanner; without it only its noise is in the uncertainties.
    pub calibration: Option<CalibrationUse>,
    /// Folder of the plate files.
    pub plates: PathBuf,
    /// Turns the mesh into (u, v).
    pub flattening: PluginUse,
    /// What is compared after each stroke, in this order.
    pub comparisons: Vec<PluginUse>,
    /// Where results go.
    pub output: Output,
}

impl Default for PlantFile {
    /// What an empty plant file in the current folder would say.
    fn default() -> Self {
        Self {
            name: "no plant file".to_owned(),
            seed: 1,
            press: None,
            scanner: None,
            scan_window: ScanWindow::default(),
            frame: Frame::default(),
            calibration: None,
            plates: PathBuf::from("plates"),
            flattening: PluginUse::by_default(FLATTENING),
            comparisons: COMPARISONS.map(PluginUse::by_default).to_vec(),
            output: Output::in_folder(Path::new("")),
        }
    }
}

impl PlantFile {
    /// Reads a plant file.
    ///
    /// # Errors
    /// [`Error::Unreadable`], or [`Error::Faulty`] with every fault of the file.
    pub fn load(path: &Path) -> Result<Self, Error> {
        Ok(Self::take(Document::load(path)?, path)?)
    }

    /// Checks the text of a plant file; `file` is its path.
    ///
    /// # Errors
    /// Every fault of the text.
    pub fn parse(file: &str, text: &str) -> Result<Self, Faults> {
        Self::take(Document::parse(file, text), Path::new(file))
    }

    /// The plate file of a recipe number: `plates/plate-017.toml` for 17.
    pub fn plate_path(&self, recipe: u16) -> PathBuf {
        self.plates.join(format!("plate-{recipe:03}.toml"))
    }

    /// All plate files with their recipe numbers, by number. Files of other names in the folder are left alone.
    ///
    /// # Errors
    /// [`Error::Unreadable`] when there is no such folder.
    pub fn plate_files(&self) -> Result<Vec<(u16, PathBuf)>, Error> {
        let unreadable = |source| Error::Unreadable { path: self.plates.clone(), source };
        let mut files = Vec::new();
        for entry in std::fs::read_dir(&self.plates).map_err(unreadable)? {
            let path = entry.map_err(unreadable)?.path();
            let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
            let recipe = stem.strip_prefix("plate-").and_then(|number| number.parse().ok());
            files.extend(
                recipe.filter(|recipe| self.plate_path(*recipe) == path).map(|recipe| (recipe, path)),
            );
        }
        files.sort();
        Ok(files)
    }

    fn take(document: Document, path: &Path) -> Result<Self, Faults> {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let folder = path.parent().unwrap_or(Path::new(""));
        let plant = Self::read(document.root(), &stem, folder);
        document.finish(plant)
    }

    fn read(mut root: TomlTable<'_>, stem: &str, folder: &Path) -> Result<Self, Reported> {
        let default = Self::default();
        let plant = root.section("plant").and_then(|mut table| {
            let name = table.name("name").or(stem.to_owned());
            let seed = table.integer("seed").at_least(0).map(i64::unsigned_abs).or(default.seed);
            table.finish();
            Ok((name?, seed?))
        });
        let scanner = root.table("scanner").optional();
        let window = |table: &mut TomlTable<'_>| table.choice("window", &WINDOWS).or(default.scan_window);
        let scanner =
            scanner.and_then(|table| table.map(|table| PluginUse::read_with(table, window)).transpose());
        let press = root.table("press").optional();
        let press = press.and_then(|table| table.map(Press::read).transpose());
        let frame = root.section("frame").and_then(Frame::read);
        let calibration = root.table("calibration").optional();
        let calibration =
            calibration.and_then(|table| table.map(|table| CalibrationUse::read(table, folder)).transpose());
        let plates = root.section("plates").and_then(|mut table| {
            let plates = table.name("folder").map(PathBuf::from).or(default.plates);
            table.finish();
            plates
        });
        let flattening = root.table("flattening").optional();
        let flattening = flattening.and_then(|table| table.map(PluginUse::read).transpose());
        let listed = root.has("comparison");
        let comparisons = root.tables("comparison").and_then(|tables| {
            let uses: Vec<_> = tables.into_iter().map(PluginUse::read).collect();
            uses.into_iter().collect::<Result<Vec<_>, _>>()
        });
        let output = root.section("output").and_then(|table| Output::read(table, folder));
        root.finish();

        let (name, seed) = plant?;
        let (scanner, scan_window) = scanner?.unzip();
        Ok(Self {
            name,
            seed,
            press: press?,
            scanner,
            scan_window: scan_window.unwrap_or(default.scan_window),
            frame: frame?,
            calibration: calibration?,
            plates: folder.join(plates?),
            flattening: flattening?.unwrap_or(default.flattening),
            comparisons: if listed { comparisons? } else { default.comparisons },
            output: output?,
        })
    }
}
