//! Plant file: press, scanner, algorithms, and the folders of plate files and results.
//!
//! Everything but `[scanner]` and `[press]` has a default, so that a scan can be measured without a plant file.
//! Relative paths start at the folder of the plant file.

mod advice;
mod calibration;
mod forward;
mod frame;
mod output;
mod plugin_use;
mod scan_store;
mod screen;

pub use advice::{AdviceUse, Show};
pub use calibration::CalibrationUse;
pub use forward::{Forward, SinkKind, SinkUse};
pub use frame::{Frame, RegionOfInterest, RigidTransform};
pub use output::{KeepScans, Output};
pub use plugin_use::{PluginUse, Worker};
pub use scan_store::{ScanStore, StoredScans};
pub use screen::Screen;

use std::path::{Path, PathBuf};

use platen_model::Die;
use platen_model::units::metres;

use crate::document::{Document, Reported};
use crate::press::{Input, Press};
use crate::{Error, Fault, Faults, Located, TomlTable};

/// Flattening used if the plant file specifies none.
const FLATTENING: &str = "elastic";
/// Comparisons used if the plant file lists none; `comparison = []` requests none.
const COMPARISONS: [&str; 2] = ["displacement", "template"];

/// The comparison whose figures fill the press's registers, unless another has `fills_registers = true`.
const REGISTER_SOURCE: &str = "template";

/// Words of `window` in `[scanner]`.
const WINDOWS: [(&str, ScanWindow); 3] =
    [("plate", ScanWindow::Plate), ("region", ScanWindow::Region), ("everything", ScanWindow::Everything)];

/// Largest range error of a scanner that measures plates, millimetres: a larger figure is probably in another unit.
const LARGEST_RANGE_ERROR_MM: f64 = 20.0;

/// Part of the field of view that is scanned by a driver that plans its scans (one that estimates their time).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ScanWindow {
    /// Surroundings of the last stroke's plate with a margin. For a new plate it is the region of interest; if a plate
    /// has moved out, that region is scanned once more.
    #[default]
    Plate,
    /// Region of interest.
    Region,
    /// Choice of the driver.
    Everything,
}

/// Checked plant file. Options of plugins are not checked yet: the plugins declare them.
#[derive(Debug, Clone, PartialEq)]
pub struct PlantFile {
    /// Its path; empty without a file.
    pub file: PathBuf,
    /// Name for people; the file's name where none is given.
    pub name: String,
    /// Seed of every random choice, so that a measurement can be repeated to the last bit.
    pub seed: u64,
    /// Press; required to run, not to measure a file.
    pub press: Option<Press>,
    /// Scanner driver; required to run, not to measure a file.
    pub scanner: Option<PluginUse>,
    /// Part of the dome that is scanned.
    pub scan_window: ScanWindow,
    /// Position of the scanner relative to press and plate.
    pub frame: Frame,
    /// Range error of the scanner until it is calibrated, one sigma, metres, in place of its driver's.
    pub range_error: Option<f64>,
    /// Calibration of the scanner; without it the range error of its data sheet is in the uncertainties.
    pub calibration: Option<CalibrationUse>,
    /// Folder of the plate files.
    pub plates: PathBuf,
    /// Flattening: the map of the mesh to (u, v).
    pub flattening: PluginUse,
    /// Comparisons after each stroke, in this order.
    pub comparisons: Vec<PluginUse>,
    /// The comparison whose figures fill the press's registers: its place among `comparisons`.
    pub register_source: Option<usize>,
    /// Advice for the next stroke; without the table none is given.
    pub advice: Option<AdviceUse>,
    /// Dies of the press.
    pub dies: Vec<Die>,
    /// Purpose for which the codes of crews are recorded; without it none is.
    pub crews: Option<Crews>,
    /// Destination of results.
    pub output: Output,
    /// Browser pages; without the table none are served.
    pub screen: Option<Screen>,
    /// Destinations of the record; without the table nothing leaves the host.
    pub forward: Option<Forward>,
    /// Store of raw scans by rule; without the table none are stored.
    pub scan_store: Option<ScanStore>,
}

/// Recording of crew codes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Crews {
    /// Purpose for which they are recorded.
    pub purpose: String,
    /// Whether `platen forward` sends them.
    pub forward: bool,
}

/// Use of a plugin: the table of the plant file that specifies it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PluginRole {
    /// `[scanner]`.
    Scanner,
    /// `[flattening]`.
    Flattening,
    /// `[[comparison]]`.
    Comparison,
    /// `[advice]`.
    Advisor,
}

/// Parts of a plant file that further checks need, whether or not other parts are faulty.
#[derive(Debug)]
pub struct Survey {
    /// The file, or all its faults.
    pub plant: Result<PlantFile, Faults>,
    /// Every plugin that is specified or implied.
    pub plugins: Vec<(PluginRole, PluginUse)>,
    /// Folder of the plate files, and the fault to report, with a message, at its place.
    pub plates: Option<(PathBuf, Fault)>,
    /// The file describes a press, so that the folder of the plate files must exist.
    pub has_press: bool,
}

impl Default for PlantFile {
    /// Returns the values of an empty plant file in the current folder.
    fn default() -> Self {
        Self {
            file: PathBuf::new(),
            name: "no plant file".to_owned(),
            seed: 1,
            press: None,
            scanner: None,
            scan_window: ScanWindow::default(),
            frame: Frame::default(),
            range_error: None,
            calibration: None,
            plates: PathBuf::from("plates"),
            flattening: PluginUse::by_default(FLATTENING),
            comparisons: COMPARISONS.map(PluginUse::by_default).to_vec(),
            register_source: COMPARISONS.iter().position(|name| *name == REGISTER_SOURCE),
            advice: None,
            dies: Vec::new(),
            crews: None,
            output: Output::in_folder(Path::new("")),
            screen: None,
            forward: None,
            scan_store: None,
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

    /// Returns the plate file of a recipe number: `plates/plate-017.toml` for 17.
    pub fn plate_path(&self, recipe: u16) -> PathBuf {
        plate_path(&self.plates, recipe)
    }

    fn take(document: Document, path: &Path) -> Result<Self, Faults> {
        Survey::of(document, path).plant
    }

    fn read(
        mut root: TomlTable<'_>,
        stem: &str,
        folder: &Path,
        survey: &mut Survey,
    ) -> Result<Self, Reported> {
        let default = Self::default();
        let document = root.document();
        let plant = root.section("plant").and_then(|mut table| {
            let name = table.name("name").or(stem.to_owned());
            let seed = table.integer("seed").at_least(0).map(i64::unsigned_abs).or(default.seed);
            table.finish();
            Ok((name?, seed?))
        });
        let mut named = |role, table: &mut TomlTable<'_>| {
            let plugin = PluginUse::read(table);
            survey.plugins.extend(plugin.iter().map(|plugin| (role, plugin.clone())));
            plugin
        };
        let scanner = root.table("scanner").optional().and_then(|table| {
            let Some(mut table) = table else { return Ok((None, default.scan_window, None)) };
            let scanner = named(PluginRole::Scanner, &mut table);
            let window = table.choice("window", &WINDOWS).or(default.scan_window);
            let range_error =
                table.number("range_error_mm").in_range(0.0..=LARGEST_RANGE_ERROR_MM).map(metres);
            let range_error = range_error.optional();
            table.finish();
            Ok((Some(scanner?), window?, range_error?))
        });
        let flattening = root.table("flattening").optional().and_then(|table| {
            let Some(mut table) = table else { return Ok(None) };
            let flattening = named(PluginRole::Flattening, &mut table);
            table.finish();
            flattening.map(Some)
        });
        let comparisons = root.tables("comparison").and_then(|tables| {
            let uses = tables.into_iter().map(|mut table| {
                let used = named(PluginRole::Comparison, &mut table);
                let fills_registers = table.bool("fills_registers").or(false);
                table.finish();
                let mut used = used?;
                used.fills_registers = fills_registers?;
                Ok(used)
            });
            uses.collect::<Vec<_>>().into_iter().collect::<Result<Vec<_>, _>>()
        });
        let advice = root.table("advice").optional().and_then(|table| {
            let Some(mut table) = table else { return Ok(None) };
            let plugin = named(PluginRole::Advisor, &mut table);
            AdviceUse::read(table, plugin).map(Some)
        });
        let dies = root.tables("die").and_then(|tables| {
            let dies: Vec<_> = tables.into_iter().map(advice::read_die).collect();
            dies.into_iter().collect::<Result<Vec<_>, _>>()
        });
        let crews = root.table("crews").optional().and_then(|table| {
            let Some(mut table) = table else { return Ok(None) };
            let purpose = table.name("purpose").required();
            let forward = table.bool("forward").or(false);
            table.finish();
            Ok(Some(Crews { purpose: purpose?, forward: forward? }))
        });
        let listed = root.has("comparison");
        if !root.has("flattening") {
            let flattening = PluginUse::implied(FLATTENING, document, root.place());
            survey.plugins.push((PluginRole::Flattening, flattening));
        }
        if !listed {
            let uses = COMPARISONS.map(|name| PluginUse::implied(name, document, root.place()));
            survey.plugins.extend(uses.map(|used| (PluginRole::Comparison, used)));
        }
        survey.has_press = root.has("press");
        let register_source = match &comparisons {
            Ok(uses) if listed => register_source(uses, document),
            _ => Ok(default.register_source),
        };
        let press = root.table("press").optional();
        let press = press.and_then(|table| table.map(Press::read).transpose());
        let frame = root.section("frame").and_then(Frame::read);
        let calibration = root.table("calibration").optional();
        let calibration =
            calibration.and_then(|table| table.map(|table| CalibrationUse::read(table, folder)).transpose());
        let plates = root.section("plates").and_then(|mut table| {
            let implied = Located { value: default.plates, place: table.place().clone() };
            let plates = table.name("folder").map(PathBuf::from).located().or(implied);
            table.finish();
            let Located { value, place } = plates?;
            let plates = folder.join(value);
            survey.plates = Some((plates.clone(), document.source().fault(&place, String::new())));
            Ok(plates)
        });
        let output = root.section("output").and_then(|table| Output::read(table, folder));
        let screen = root.table("screen").optional();
        let screen = screen.and_then(|table| table.map(|table| Screen::read(table, folder)).transpose());
        let forward = root.table("forward").optional();
        let forward = forward.and_then(|table| table.map(|table| Forward::read(table, folder)).transpose());
        let scan_store = root.table("scan_store").optional();
        let scan_store =
            scan_store.and_then(|table| table.map(|table| ScanStore::read(table, folder)).transpose());
        let root_place = &root.place().clone();
        root.finish();

        let (name, seed) = plant?;
        let (mut press, advice, crews) = (press?, advice?, crews?);
        if crews.is_none() && press.as_ref().is_some_and(|press| press.map.inputs.contains_key(&Input::Crew))
        {
            let message = "press.map.inputs.crew needs [crews] with its purpose: figures of crews are agreed on before they are recorded";
            return Err(document.fault(root_place, message));
        }
        if let Some(advice) = &advice {
            let registers = advice.registers(document, press.as_ref())?;
            if let Some(press) = &mut press {
                press.advice = registers;
            }
        }
        let (scanner, scan_window, range_error) = scanner?;
        Ok(Self {
            file: PathBuf::new(),
            name,
            seed,
            press,
            scanner,
            scan_window,
            frame: frame?,
            range_error,
            calibration: calibration?,
            plates: plates?,
            flattening: flattening?.unwrap_or(default.flattening),
            comparisons: if listed { comparisons? } else { default.comparisons },
            register_source: register_source?,
            advice: advice.map(|read| read.advice),
            dies: dies?,
            crews,
            output: output?,
            screen: screen?,
            forward: forward?,
            scan_store: scan_store?,
        })
    }
}

/// Returns the comparison whose figures go to the press: the one with `fills_registers`, else the one named
/// [`REGISTER_SOURCE`].
fn register_source(uses: &[PluginUse], document: &Document) -> Result<Option<usize>, Reported> {
    let asked = uses.iter().any(|used| used.fills_registers);
    let claims = |used: &PluginUse| if asked { used.fills_registers } else { used.plugin == REGISTER_SOURCE };
    let mut claims = uses.iter().enumerate().filter(|(_, used)| claims(used));
    let source = claims.next().map(|(place, _)| place);
    match claims.next() {
        None => Ok(source),
        Some((_, second)) => Err(document.report(second.fault(
            "a second comparison for the figures of the press's registers; set fills_registers = true on one",
        ))),
    }
}

impl Survey {
    /// Reads a plant file; `path` is the file's own.
    pub fn of(document: Document, path: &Path) -> Self {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut survey =
            Self { plant: Ok(PlantFile::default()), plugins: Vec::new(), plates: None, has_press: false };
        let plant = PlantFile::read(document.root(), &stem, folder, &mut survey);
        survey.plant = document.finish(plant).map(|plant| PlantFile { file: path.to_path_buf(), ..plant });
        survey
    }
}

fn plate_path(folder: &Path, recipe: u16) -> PathBuf {
    folder.join(format!("plate-{recipe:03}.toml"))
}

/// Returns the plate files of a folder with their recipe numbers, by number. Files with other names are ignored.
///
/// # Errors
/// [`Error::Unreadable`] when there is no such folder.
pub fn plate_files(folder: &Path) -> Result<Vec<(u16, PathBuf)>, Error> {
    let unreadable = |source| Error::Unreadable { path: folder.to_owned(), source };
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
        let recipe = stem.strip_prefix("plate-").and_then(|number| number.parse().ok());
        files
            .extend(recipe.filter(|recipe| plate_path(folder, *recipe) == path).map(|recipe| (recipe, path)));
    }
    files.sort();
    Ok(files)
}
