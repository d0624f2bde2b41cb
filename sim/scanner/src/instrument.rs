//! Error model of the scanner: range noise, mixed pixels, lost echoes, cyclic and two-face errors, warm-up.

use crate::beam::Beam;
use crate::ray::{Hit, Label};

/// Parameters of the error model. Lengths in metres, angles in radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instrument {
    /// Standard deviation of a range at 10 m on mill-scaled steel at 60 degrees incidence, a typical view of a plate.
    /// Data sheets: 0.5 mm with filtering to 1.7 mm at full rate.
    pub range_sigma: f64,
    /// Degrees of freedom of the range error (Student's t, scaled to the same variance); `None`: normal distribution.
    pub tail_dof: Option<f64>,
    /// Share of the ranges with a wide error; `None`: none.
    pub wide_errors: Option<WideErrors>,
    /// Full angular width of the beam at 1/e^2 of its intensity.
    pub footprint: f64,
    /// Cross section of the beam.
    pub beam: Beam,
    /// Standard deviation of each reported angle against the true direction of the beam.
    pub angular_sigma: f64,
    /// Probability that any echo is lost.
    pub dropout: f64,
    /// Cyclic range error of a phase measurement.
    pub cyclic: Option<Cyclic>,
    /// Half width of the specular lobe of the plate: echoes within it overload the receiver.
    pub specular_lobe: Option<f64>,
    /// Errors of a scan with two faces; `None`: one face.
    pub faces: Option<Faces>,
    /// Clockwise rotation of the head: columns are measured from the last to the first.
    pub clockwise: bool,
    /// Columns at the start of each face measured before the laser is warm; their ranges scatter by centimetres.
    pub warm_up_columns: u32,
    /// Shortest and longest range measured.
    pub reach: [f64; 2],
    /// Seed of all random numbers.
    pub seed: u64,
}

/// Contaminated normal distribution of the range error (Tukey 1960): a share of the ranges has a larger standard
/// deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WideErrors {
    /// Share of the ranges, 0 to 1.
    pub share: f64,
    /// Factor of their standard deviation.
    pub factor: f64,
}

/// Cyclic range error `amplitude` * sin(2 pi range / period + phase).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cyclic {
    /// Metres.
    pub amplitude: f64,
    /// Metres.
    pub period: f64,
    /// Radians.
    pub phase: f64,
}

/// Errors of a scan of two faces: each turn of the mirror measures a column of both, half a turn of the head apart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Faces {
    /// First column of the second face by increasing azimuth: of the back face, or of the front face where the head
    /// rotates clockwise.
    pub seam_column: u32,
    /// Collimation error: angle of the beam against the mirror's plane; changes sign between the faces.
    pub collimation: f64,
    /// Trunnion error: tilt of the mirror axis; changes sign between the faces.
    pub trunnion: f64,
    /// Displacement of the scanner between the faces, metres.
    pub moved: [f64; 3],
}

impl Default for Instrument {
    /// Returns a phase scanner with filtering, one face and no systematic errors.
    fn default() -> Self {
        Self {
            range_sigma: 0.5e-3,
            tail_dof: None,
            wide_errors: None,
            footprint: 0.3e-3,
            beam: Beam::Truncated,
            angular_sigma: 0.0,
            dropout: 0.006,
            cyclic: None,
            specular_lobe: None,
            faces: None,
            clockwise: false,
            warm_up_columns: 0,
            reach: [0.6, 130.0],
            seed: 1,
        }
    }
}

impl Instrument {
    /// Returns an instrument without errors.
    pub fn perfect() -> Self {
        Self { range_sigma: 0.0, footprint: 0.0, dropout: 0.0, ..Self::default() }
    }
}

/// Returns the diffuse reflectivity at 905 nm to 1550 nm; typical values: mill scale is dark, painted walls are bright.
/// The reflectivity of the plate's faces is a property of the scene.
pub(crate) fn reflectivity(label: Label, plate: f64) -> f64 {
    match label {
        Label::Nothing => 0.0,
        Label::PlateTop | Label::PlateUnderside => plate,
        Label::PlateSide => 0.4,
        Label::Die | Label::Table => 0.25,
        Label::Press => 0.5,
        Label::Floor => 0.3,
        Label::Wall => 0.8,
        Label::Cabinet => 0.6,
        Label::Person => 0.4,
        Label::Chain => 0.2,
    }
}

/// Reflectivity of a plate's faces unless a scene has another.
pub(crate) const PLATE_REFLECTIVITY: f64 = 0.35;

/// Reflectivity of marker paint.
pub(crate) const MARKER_REFLECTIVITY: f64 = 0.05;

/// Strength of the reference echo of [`Instrument::range_sigma`]: mill scale at 60 degrees.
const REFERENCE_STRENGTH: f64 = 0.35 * 0.5;

/// Share of the variance at 10 m that is independent of range (jitter of the electronics).
const RANGE_FLOOR: f64 = 0.25;

/// Exponent of the echo's strength in the standard deviation. A data sheet with 0.6 mm at 90 % and 1.2 mm at 10 % (10
/// m) gives 0.32, at 25 m 0.38.
const STRENGTH_POWER: f64 = 0.35;

impl Instrument {
    /// Returns the standard deviation of a range for an echo of this strength.
    pub(crate) fn sigma_at(&self, range: f64, strength: f64) -> f64 {
        let by_range = (RANGE_FLOOR + (1.0 - RANGE_FLOOR) * (range / 10.0).powi(2)).sqrt();
        // Echoes below a thousandth of the reference are lost anyway.
        let weak = (REFERENCE_STRENGTH / strength.max(1e-3 * REFERENCE_STRENGTH)).powf(STRENGTH_POWER);
        self.range_sigma * by_range * weak
    }

    /// Returns the probability that an echo is lost: the constant dropout, weakness of the echo, and the specular lobe
    /// combined.
    pub(crate) fn loss(&self, hit: &Hit, strength: f64) -> f64 {
        if self.dropout == 0.0 {
            return 0.0;
        }
        let weak = (0.05 / strength.max(1e-6) * (hit.range / 30.0).powi(2)).min(1.0);
        let mirror = match self.specular_lobe {
            Some(lobe) if hit.label == Label::PlateTop => {
                (-(hit.cos_incidence.min(1.0).acos() / lobe).powi(2)).exp()
            }
            _ => 0.0,
        };
        1.0 - (1.0 - self.dropout) * (1.0 - weak * 0.1) * (1.0 - mirror)
    }

    /// Returns the standard deviation of the systematic error over many ranges, metres: the figure of a data sheet.
    #[must_use]
    pub fn range_error(&self) -> f64 {
        self.cyclic.map_or(0.0, |cyclic| cyclic.amplitude.abs() / std::f64::consts::SQRT_2)
    }

    /// Returns the systematic error of a range.
    pub(crate) fn bias(&self, range: f64) -> f64 {
        self.cyclic.map_or(0.0, |c| c.amplitude * (std::f64::consts::TAU * range / c.period + c.phase).sin())
    }
}
