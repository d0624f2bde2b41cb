//! What a plant measures with: its plugins, loaded and configured, and where it stands.

use std::time::Duration;

use platen_plant::PlateFile;
use platen_plant::plant::RigidTransform;
use platen_plant::{Error as PlantError, Faults, OptionValue, PlantFile, PluginUse, Value, check_options};
use platen_shape::{PlateSpec, RegionOfInterest, Vec3};

use crate::plugin::{Catalogue, Comparison, Flattening, Library, PluginError, Scanner};

/// Time that a flattening or a comparison may take; the press waits at most 10 s for both.
pub(crate) const EVALUATION_LIMIT: Duration = Duration::from_secs(10);

/// The plugins of a plant, ready to measure.
#[derive(Debug)]
pub struct Pipeline {
    /// Turns the mesh into (u, v).
    pub flattening: Flattening,
    /// What is compared, in this order.
    pub comparisons: Vec<Comparison>,
    /// Rough direction of growing u at a plate's first scan, scanner frame.
    pub u_axis: Option<Vec3>,
    /// Where the press stands, scanner frame, when the plant file says so.
    pub press: Option<Vec3>,
    /// The axis about which the press turns a plate, scanner frame.
    pub press_z: Vec3,
    /// Where the plate can be, scanner frame.
    pub region: Option<RegionOfInterest>,
}

/// Why a plant cannot measure.
#[derive(Debug, thiserror::Error)]
pub enum PipelineError {
    /// The plant or plate file is wrong.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// Options of a plugin are wrong.
    #[error("{0}")]
    Options(#[from] Faults),
    /// A plugin cannot be used.
    #[error(transparent)]
    Plugin(#[from] PluginError),
}

/// The library that a plant file names, with its options checked.
///
/// # Errors
/// The library cannot be used, or every fault of its options.
pub fn load(catalogue: &Catalogue, wanted: &PluginUse) -> Result<(Library, Vec<OptionValue>), PipelineError> {
    let library = catalogue.load(&wanted.plugin)?;
    let values = check_options(&wanted.plugin, &wanted.options, &library.descriptor().options)?;
    Ok((library, values))
}

/// A library with its defaults but for these options.
///
/// # Errors
/// The library cannot be used.
pub fn load_with<'a>(
    catalogue: &Catalogue,
    plugin: &str,
    options: impl IntoIterator<Item = (&'a str, Value)>,
) -> Result<(Library, Vec<OptionValue>), PipelineError> {
    let (library, mut values) = load(catalogue, &PluginUse::by_default(plugin))?;
    for (name, value) in options {
        values.retain(|known| known.name != name);
        values.push(OptionValue { name: name.to_owned(), value, given: true });
    }
    Ok((library, values))
}

/// A comparison that may take as long as one of a stroke.
///
/// # Errors
/// The library cannot be used, or every fault of its options.
pub fn comparison(catalogue: &Catalogue, wanted: &PluginUse) -> Result<Comparison, PipelineError> {
    let (library, values) = load(catalogue, wanted)?;
    Ok(Comparison::create(&library, &values, EVALUATION_LIMIT)?)
}

impl Pipeline {
    /// Loads what the plant file names.
    ///
    /// # Errors
    /// The first plugin that cannot be used.
    pub fn of(plant: &PlantFile, catalogue: &Catalogue) -> Result<Self, PipelineError> {
        let (library, values) = load(catalogue, &plant.flattening)?;
        let flattening = Flattening::create(&library, &values, EVALUATION_LIMIT)?;
        let comparisons = plant.comparisons.iter().map(|wanted| comparison(catalogue, wanted));
        let comparisons = comparisons.collect::<Result<_, PipelineError>>()?;
        Ok(Self {
            flattening,
            comparisons,
            u_axis: plant.frame.u_axis.map(Vec3::from),
            press: press_origin(&plant.frame.press_from_scanner),
            // The rotation's last row: what the press frame's z is in the scanner frame.
            press_z: plant.frame.press_from_scanner.rotation[2].into(),
            region: plant
                .frame
                .region_of_interest
                .map(|r| RegionOfInterest { min: r.min.into(), max: r.max.into() }),
        })
    }

    /// The plate as the geometry wants it.
    pub fn spec(&self, plate: &PlateFile) -> PlateSpec {
        PlateSpec {
            width: plate.plate.width,
            height: plate.plate.height,
            thickness: plate.plate.thickness,
            face_inset: plate.plate.face_inset,
            u_axis: self.u_axis,
            region: self.region,
        }
    }
}

/// The press's origin in the scanner frame; none where the plant file leaves the scanner in the press's frame.
fn press_origin(press_from_scanner: &RigidTransform) -> Option<Vec3> {
    let RigidTransform { rotation, translation } = *press_from_scanner;
    let back = |axis: usize| -(0..3).map(|row| rotation[row][axis] * translation[row]).sum::<f64>();
    (*press_from_scanner != RigidTransform::default()).then(|| Vec3::new(back(0), back(1), back(2)))
}

/// The driver that a plant file names, or `faro-file` where it names none.
///
/// # Errors
/// The library cannot be used, or every fault of its options.
pub fn scanner(plant: &PlantFile, catalogue: &Catalogue) -> Result<Scanner, PipelineError> {
    let file_driver = PluginUse::by_default("faro-file");
    let (library, values) = load(catalogue, plant.scanner.as_ref().unwrap_or(&file_driver))?;
    Ok(Scanner::create(&library, &values)?)
}
