//! Simulated scans with known truth, acquired through the library of the driver `simulated`.
//!
//! Scan and truth come from one call of the driver: the columns over the plugin boundary, the truth through the file of
//! its option `truth_file`. Every seed has errors of its own and shifts and turns the plate, so that its edges lie
//! differently on the lattice each time.

use std::path::{Path, PathBuf};
use std::time::Duration;

use platen_engine::pipeline;
use platen_engine::plugin::{Catalogue, JobSpec, Scanner};
use platen_engine::stroke::NotMeasured;
use platen_host::cli::CliError;
use platen_model::units::metres;
use platen_plant::Value;
use platen_scan::{Column, ScanHeader};
use platen_shape::extract::Extractor;
use platen_shape::{Blank, Patch, PlateSpec, Vec3};

use crate::accuracy::Truth;

/// Time limit of a scan; a full dome takes minutes on a slow machine.
pub(super) const SCAN_LIMIT: Duration = Duration::from_secs(3600);
/// Angle between cells of the scans of `accuracy`, degrees: 6 mm at 7 m.
const STEP_DEG: f64 = 0.05;
/// Margin scanned round the plates, degrees: wide enough for the edges.
const MARGIN_DEG: f64 = 2.0;
/// Largest shift of the plate from seed to seed, metres: many lattice steps.
const SHIFT: f64 = 0.05;
/// Largest turn of the plate, degrees.
const TURN_DEG: f64 = 3.0;

/// Plate in front of the scanner.
#[derive(Debug, Clone)]
pub(super) struct Scene {
    /// Name in tables and files.
    pub(super) name: String,
    /// Extent along u and v and thickness, millimetres.
    pub(super) size_mm: [f64; 3],
    /// The `[shape]` table of the simulator's description.
    pub(super) shape: String,
    /// Centre of the mid-surface in the scanner frame, millimetres.
    pub(super) centre_mm: [f64; 3],
    /// Distance of the face's edge inside the mid-surface's edge, and height of the root face between the flanks of the
    /// bevel, millimetres; 0 for square edges.
    pub(super) bevel_mm: [f64; 2],
    /// Sagittas of the edges v = 0, u = W, v = H, u = 0, positive outwards, millimetres.
    pub(super) bows_mm: [f64; 4],
    /// Direction of u, counter-clockwise from the line of sight, degrees.
    pub(super) yaw_deg: f64,
}

/// Settings of a scan.
#[derive(Debug, Clone, Copy)]
pub(super) struct Setting {
    /// Angle between cells, degrees.
    pub(super) step_deg: f64,
    /// Margin scanned round the plate, degrees.
    pub(super) margin_deg: f64,
    /// Standard deviation of a range at 10 m, millimetres.
    pub(super) noise_mm: f64,
    /// Seed of all errors.
    pub(super) seed: u64,
    /// Number of threads that cast rays.
    pub(super) threads: usize,
}

impl Setting {
    /// Returns the settings of the scans of `accuracy`.
    pub(super) fn of_accuracy(noise_mm: f64, seed: u64) -> Self {
        Self { step_deg: STEP_DEG, margin_deg: MARGIN_DEG, noise_mm, seed, threads: 1 }
    }
}

/// Scan in memory, with its truth.
#[derive(Debug)]
pub(super) struct Shot {
    pub(super) header: ScanHeader,
    /// The lattice.
    pub(super) columns: Vec<Column>,
    /// True shape of the plate.
    pub(super) truth: Truth,
    /// Specification of the plate.
    pub(super) spec: PlateSpec,
    /// Its blank as it was cut, as an exact scan of it would give it.
    pub(super) blank: Blank,
}

impl Scene {
    /// Returns (u, v) of nine markers, millimetres.
    fn markers_mm(&self) -> Vec<[f64; 2]> {
        let [width, height, _] = self.size_mm;
        let shares = [0.1, 0.5, 0.9];
        shares.iter().flat_map(|v| shares.map(|u| [u * width, v * height])).collect()
    }

    /// Returns the specification of the plate.
    pub(super) fn spec(&self) -> PlateSpec {
        let [width, height, thickness] = self.size_mm.map(metres);
        let (sin, cos) = self.yaw_deg.to_radians().sin_cos();
        PlateSpec {
            width,
            height,
            thickness,
            face_inset: metres(self.bevel_mm[0]),
            root_face: metres(self.bevel_mm[1]),
            u_axis: Some(Vec3::new(cos, sin, 0.0)),
            region: None,
        }
    }

    /// Returns the blank as it is cut.
    fn blank(&self) -> Blank {
        Blank { bows: self.bows_mm.map(metres), ..self.spec().rectangle() }
    }

    /// Returns the simulator's description of the plate in the pose of this seed.
    fn description(&self, seed: u64) -> String {
        let mut random = fastrand::Rng::with_seed(seed);
        let mut swing = |reach: f64| reach * (2.0 * random.f64() - 1.0);
        let centre = self.centre_mm.map(|mm| mm + 1000.0 * swing(SHIFT));
        let yaw = self.yaw_deg + swing(TURN_DEG);
        let ([width, height, thickness], [inset, root]) = (self.size_mm, self.bevel_mm);
        format!(
            "[blank]\nwidth_mm = {width:?}\nheight_mm = {height:?}\nthickness_mm = {thickness:?}\n\
             face_inset_mm = {inset:?}\nroot_face_mm = {root:?}\nbows_mm = {:?}\nmarkers_mm = {:?}\n\
             [shape]\n{}\n[pose]\ncentre_mm = {centre:?}\nyaw_deg = {yaw:?}\n",
            self.bows_mm,
            self.markers_mm(),
            self.shape,
        )
    }

    /// Scans into memory, with `more` options of the driver; description and truth stay in `folder`.
    pub(super) fn scan(
        &self,
        catalogue: &Catalogue,
        folder: &Path,
        setting: Setting,
        more: &[(&'static str, Value)],
    ) -> Result<Shot, CliError> {
        let (scanner, truth) = self.scanner(catalogue, folder, setting, more)?;
        let mut scan = scanner.start(JobSpec::untriggered(SCAN_LIMIT), None)?;
        let header = scan.header().clone();
        let columns = scan.by_ref().collect::<Result<_, _>>()?;
        scan.finish()?;
        let truth = Truth::read(&truth).map_err(|e| CliError::Failed(e.to_string()))?;
        Ok(Shot { header, columns, truth, spec: self.spec(), blank: self.blank() })
    }

    /// Starts the driver with this scene; returns it and the path of the truth file.
    pub(super) fn scanner(
        &self,
        catalogue: &Catalogue,
        folder: &Path,
        setting: Setting,
        more: &[(&'static str, Value)],
    ) -> Result<(Scanner, PathBuf), CliError> {
        let file = |ending: &str| -> Result<PathBuf, CliError> {
            let name =
                format!("{}-{}um-{}.{ending}", self.name, (1000.0 * setting.noise_mm).round(), setting.seed);
            Ok(std::path::absolute(folder.join(name))?)
        };
        let (plate, truth) = (file("toml")?, file("json")?);
        std::fs::write(&plate, self.description(setting.seed))?;
        let whole = |n: u64| Value::Int(i64::try_from(n).unwrap_or(i64::MAX));
        let options = [
            ("plate_file", Value::Path(plate)),
            ("truth_file", Value::Path(truth.clone())),
            ("step_deg", Value::Float(setting.step_deg)),
            ("margin_deg", Value::Float(setting.margin_deg)),
            ("noise_mm", Value::Float(setting.noise_mm)),
            ("seed", whole(setting.seed)),
            ("threads", whole(setting.threads as u64)),
            ("warm_up_columns", whole(0)),
        ];
        let options = options.into_iter().chain(more.iter().cloned());
        let (library, values) = pipeline::load_with(catalogue, "simulated", options)?;
        let scanner = Scanner::create(&library, &values)?;
        scanner.instance().open(SCAN_LIMIT)?;
        Ok((scanner, truth))
    }
}

impl Shot {
    /// Returns the number of cells of the lattice.
    pub(super) fn n_cells(&self) -> usize {
        self.columns.iter().map(Column::len).sum()
    }

    /// Extracts the plate's face from the lattice in memory.
    pub(super) fn extract(&self) -> Result<Patch, NotMeasured> {
        let mut extractor = Extractor::new(&self.header, &self.spec);
        for column in &self.columns {
            extractor.push(column)?;
        }
        Ok(extractor.finish()?)
    }
}
