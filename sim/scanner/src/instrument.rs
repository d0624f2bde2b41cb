//! The scanner's errors.

use crate::ray::{Hit, Label};

/// Error model of a scanner. Lengths in metres, angles in radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instrument {
    /// Standard deviation of a range at 10 m on mill-scaled steel at 60 degrees incidence, the way plates are seen. Data
    /// sheets: 0.5 mm with filtering to 1.7 mm at full rate.
    pub range_sigma: f64,
    /// Degrees of freedom of the range error; `None` is normal, 3 has heavy tails. The standard deviation stays `range_sigma`'s.
    pub tail_dof: Option<f64>,
    /// Angle over which the beam's intensity falls to 1/e^2, full width.
    pub footprint: f64,
    /// Standard deviation of each reported angle against the beam's own.
    pub angular_sigma: f64,
    /// Share of echoes lost whatever they hit.
    pub dropout: f64,
    /// Cyclic range error of a phase measurement.
    pub cyclic: Option<Cyclic>,
    /// Half width of the mirror lobe of the plate: echoes within it overload the receiver.
    pub specular_lobe: Option<f64>,
    /// Two faces of the mirror turn.
    pub faces: Option<Faces>,
    /// The head turns clockwise: columns are measured from the last to the first.
    pub clockwise: bool,
    /// Columns at the start of each face before the laser is warm: their ranges scatter by centimetres.
    pub warm_up_columns: u32,
    /// Nothing nearer and nothing farther is measured.
    pub reach: [f64; 2],
    /// Seed of every random number.
    pub seed: u64,
}

/// Range error `amplitude` * sin(2 pi range / period + phase).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cyclic {
    /// Metres.
    pub amplitude: f64,
    /// Metres.
    pub period: f64,
    /// Radians.
    pub phase: f64,
}

/// A scan of two faces: each turn of the mirror measures a column of both, half a turn of the head apart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Faces {
    /// First column of the other face by growing azimuth: of the back face, of the front face where the head turns
    /// clockwise.
    pub seam_column: u32,
    /// Angle of the beam against the mirror's plane; changes sign between the faces.
    pub collimation: f64,
    /// Tilt of the mirror axis; changes sign between the faces.
    pub trunnion: f64,
    /// How the scanner moved between the faces, metres.
    pub moved: [f64; 3],
}

impl Default for Instrument {
    /// A phase scanner with filtering on, one face, no systematic errors.
    fn default() -> Self {
        Self {
            range_sigma: 0.5e-3,
            tail_dof: None,
            footprint: 0.3e-3,
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
    /// An instrument that makes no error at all.
    pub fn perfect() -> Self {
        Self { range_sigma: 0.0, footprint: 0.0, dropout: 0.0, ..Self::default() }
    }
}

/// Diffuse reflectivity at 905 nm to 1550 nm, from common knowledge: mill scale is dark, painted walls bright.
pub(crate) fn reflectivity(label: Label) -> f64 {
    match label {
        Label::Nothing => 0.0,
        Label::PlateTop | Label::PlateUnderside => 0.35,
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

/// Reflectivity of marker paint.
pub(crate) const MARKER_REFLECTIVITY: f64 = 0.05;

/// Echo that [`Instrument::range_sigma`] refers to: mill scale at 60 degrees.
const REFERENCE_STRENGTH: f64 = 0.35 * 0.5;

/// Share of the variance at 10 m that does not depend on range (jitter of the electronics).
const RANGE_FLOOR: f64 = 0.25;

/// Standard deviation falls with this power of the echo's strength. A data sheet with 0.6 mm at 90 % and 1.2 mm at 10 % (10 m) gives
/// 0.32, at 25 m 0.38.
const STRENGTH_POWER: f64 = 0.35;

/// Echo of a hit relative to a white wall head-on at the same distance.
pub(crate) fn strength(hit: &Hit, marker: bool) -> f64 {
    let reflectivity = if marker { MARKER_REFLECTIVITY } else { reflectivity(hit.label) };
    reflectivity * hit.cos_incidence
}

impl Instrument {
    /// Standard deviation of a range on an echo of this strength.
    pub(crate) fn sigma_at(&self, range: f64, strength: f64) -> f64 {
        let by_range = (RANGE_FLOOR + (1.0 - RANGE_FLOOR) * (range / 10.0).powi(2)).sqrt();
        // An echo below a thousandth of the reference is lost anyway.
        let weak = (REFERENCE_STRENGTH / strength.max(1e-3 * REFERENCE_STRENGTH)).powf(STRENGTH_POWER);
        self.range_sigma * by_range * weak
    }

    /// Probability that the echo of a hit is lost: everywhere a little, more when it is weak, and inside the mirror lobe.
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

    /// Systematic error of a range.
    pub(crate) fn bias(&self, range: f64) -> f64 {
        self.cyclic.map_or(0.0, |c| c.amplitude * (std::f64::consts::TAU * range / c.period + c.phase).sin())
    }
}
