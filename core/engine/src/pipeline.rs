//! Pipeline of a plant: its plugins, loaded and configured, and the coordinate frames of scanner and press.

use std::time::Duration;

use platen_numerics::join::join;
use platen_plant::plant::RigidTransform;
use platen_plant::{
    Error as PlantError, Faults, OptionValue, PlantFile, PlateFile, PluginUse, Value, Worker, check_options,
};
use platen_shape::{PlateSpec, RegionOfInterest, Vec3};

use crate::plugin::{
    Catalogue, Comparison, Flattening, Instance, Isolation, Library, Limits, PluginError, Scanner, Settings,
};

/// Deadline of a flattening or a comparison without a press; with one, its `timeouts.evaluate_ms`.
const EVALUATION_LIMIT: Duration = Duration::from_secs(10);

/// Configured plugins of a plant, ready to measure.
#[derive(Debug)]
pub struct Pipeline {
    /// Maps the mid-surface mesh to (u, v).
    pub flattening: Flattening,
    /// Comparisons, in the order of the plant file.
    pub comparisons: Vec<Comparison>,
    /// Index of the comparison whose figures fill the press's registers.
    pub register_source: Option<usize>,
    /// Approximate direction of growing u at a plate's first scan, scanner frame.
    pub u_axis: Option<Vec3>,
    /// Origin of the press, scanner frame, where the plant file has `press_from_scanner`.
    pub press: Option<Vec3>,
    /// The axis about which the press turns a plate, scanner frame.
    pub press_z: Vec3,
    /// Region of interest, scanner frame.
    pub region: Option<RegionOfInterest>,
}

/// Reason why a plant cannot measure.
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

/// Loads the library that a plant file names and checks its options.
///
/// # Errors
/// The library cannot be used, or every fault of its options.
pub fn load(catalogue: &Catalogue, wanted: &PluginUse) -> Result<(Library, Vec<OptionValue>), PipelineError> {
    let library = catalogue.load(&wanted.plugin)?.with(settings(&wanted.worker));
    let values = check_options(&wanted.plugin, &wanted.options, &library.descriptor().options)?;
    Ok((library, values))
}

/// Loads a library with its default options except these.
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

fn settings(wanted: &Worker) -> Settings {
    let isolation = if wanted.in_process { Isolation::InProcess } else { Isolation::Process };
    let limits = Limits { memory: wanted.memory_mib << 20, files: wanted.files, pool: wanted.pool_mib << 20 };
    Settings { isolation, limits }
}

/// Creates a comparison outside a plant.
///
/// # Errors
/// The library cannot be used, or every fault of its options.
pub fn comparison(catalogue: &Catalogue, wanted: &PluginUse) -> Result<Comparison, PipelineError> {
    let (library, values) = load(catalogue, wanted)?;
    Ok(Comparison::create(&library, &values, EVALUATION_LIMIT)?)
}

impl Pipeline {
    /// Loads the plugins that the plant file names.
    ///
    /// # Errors
    /// The first plugin that cannot be used.
    pub fn of(plant: &PlantFile, catalogue: &Catalogue) -> Result<Self, PipelineError> {
        let limit = plant.press.as_ref().map_or(EVALUATION_LIMIT, |press| press.timeouts.evaluate);
        let flattening = || {
            let (library, values) = load(catalogue, &plant.flattening)?;
            Ok::<_, PipelineError>(Flattening::create(&library, &values, limit)?)
        };
        let comparison = |wanted: &PluginUse| {
            let (library, values) = load(catalogue, wanted)?;
            Ok::<_, PipelineError>(Comparison::create(&library, &values, limit)?)
        };
        // Two processes start at a time.
        let (flattening, comparisons) =
            join(flattening, || plant.comparisons.iter().map(comparison).collect::<Result<_, _>>());
        Ok(Self {
            flattening: flattening?,
            comparisons: comparisons?,
            register_source: plant.register_source,
            u_axis: plant.frame.u_axis.map(Vec3::from),
            press: press_origin(&plant.frame.press_from_scanner),
            // The rotation's last row is the press frame's z axis in the scanner frame.
            press_z: plant.frame.press_from_scanner.rotation[2].into(),
            region: plant
                .frame
                .region_of_interest
                .map(|r| RegionOfInterest { min: r.min.into(), max: r.max.into() }),
        })
    }

    /// Returns the plugins that evaluate a scan.
    pub fn instances(&self) -> impl Iterator<Item = &Instance> {
        std::iter::once(self.flattening.instance()).chain(self.comparisons.iter().map(Comparison::instance))
    }

    /// Makes sure that every plugin has its worker.
    ///
    /// # Errors
    /// The first that is out of use.
    pub fn revive(&self) -> Result<(), PluginError> {
        self.instances().try_for_each(Instance::revive)
    }

    /// Returns the plate for the geometry: size, edges, direction of u, region of interest.
    pub fn spec(&self, plate: &PlateFile) -> PlateSpec {
        PlateSpec {
            width: plate.plate.width,
            height: plate.plate.height,
            thickness: plate.plate.thickness,
            face_inset: plate.plate.face_inset,
            root_face: plate.plate.root_face,
            u_axis: self.u_axis,
            region: self.region,
        }
    }
}

/// Returns the press's origin in the scanner frame; `None` for the identity, where the two frames are one.
fn press_origin(press_from_scanner: &RigidTransform) -> Option<Vec3> {
    let RigidTransform { rotation, translation } = *press_from_scanner;
    let back = |axis: usize| -(0..3).map(|row| rotation[row][axis] * translation[row]).sum::<f64>();
    (*press_from_scanner != RigidTransform::default()).then(|| Vec3::new(back(0), back(1), back(2)))
}

/// Loads the driver that the plant file names; `faro-file` without one.
///
/// # Errors
/// The library cannot be used, or every fault of its options.
pub fn scanner(plant: &PlantFile, catalogue: &Catalogue) -> Result<Scanner, PipelineError> {
    let file_driver = PluginUse::by_default("faro-file");
    let (library, values) = load(catalogue, plant.scanner.as_ref().unwrap_or(&file_driver))?;
    Ok(Scanner::create(&library, &values)?)
}
