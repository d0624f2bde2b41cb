//! Kinematic forming model: strokes, their planning by equal bend bands, and the plate's handling between strokes.
//!
//! A stroke bends a strip by a given angle, of which a given share springs back; there is no moment-curvature law.
//! Equal bands at half their width from each other add up to a constant curvature.

use crate::{Band, Blank, PlateError, PlateState, Pose, Shape};
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64;
use serde::{Deserialize, Serialize};

/// Stroke of the press: the die bends the plate by `angle_deg` along a line; when it is
/// lifted, the share `springback` of the angle is lost.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stroke {
    /// Direction of the die, from u towards v.
    pub axis_deg: f64,
    /// Distance of the die from the plate's middle, positive towards the direction `axis_deg - 90`.
    pub at_mm: f64,
    /// Width of the strip that is bent.
    pub width_mm: f64,
    /// Angle under load.
    pub angle_deg: f64,
    /// Share of the angle that springs back, 0 to 1.
    pub springback: f64,
}

impl Stroke {
    /// Returns the bend band that remains after springback.
    fn band(&self) -> Band {
        Band {
            at_mm: self.at_mm,
            width_mm: self.width_mm,
            angle_deg: self.angle_deg * (1.0 - self.springback),
        }
    }
}

/// Orientation of a stroke's die on a plate that already has bends.
enum DieOrientation {
    /// Parallel to the axis, or antiparallel (positions change sign).
    Along { sign: f64 },
    /// Perpendicular to the axis, with the sign of its positions along the axis.
    Across { sign: f64 },
}

/// Tolerance of equal directions, degrees.
const SAME_DIRECTION_DEG: f64 = 1e-6;

fn die_orientation(die_deg: f64, axis_deg: f64) -> Option<DieOrientation> {
    let turned = (die_deg - axis_deg).rem_euclid(360.0);
    let near = |target: f64| (turned - target).abs() < SAME_DIRECTION_DEG;
    match () {
        () if near(0.0) || near(360.0) => Some(DieOrientation::Along { sign: 1.0 }),
        () if near(180.0) => Some(DieOrientation::Along { sign: -1.0 }),
        () if near(90.0) => Some(DieOrientation::Across { sign: 1.0 }),
        () if near(270.0) => Some(DieOrientation::Across { sign: -1.0 }),
        () => None,
    }
}

impl PlateState {
    /// Bends the plate by one stroke. The pose is unchanged; [`Handling`] models the movement between strokes.
    ///
    /// # Errors
    /// [`PlateError::Stroke`] when the plate has a shape not made by strokes, or when the die lies neither along nor
    /// across the dies before it: two oblique bends have no closed form.
    pub fn apply(&mut self, stroke: &Stroke) -> Result<(), PlateError> {
        let refuse = |reason| PlateError::Stroke { at_mm: stroke.at_mm, axis_deg: stroke.axis_deg, reason };
        if self.shape == Shape::Flat {
            self.shape =
                Shape::Bands { axis_deg: stroke.axis_deg, bands: Vec::new(), cross_bands: Vec::new() };
        }
        let Shape::Bands { axis_deg, bands, cross_bands } = &mut self.shape else {
            return Err(refuse("the plate has a closed shape; start from a flat one"));
        };
        let band = stroke.band();
        match die_orientation(stroke.axis_deg, *axis_deg) {
            Some(DieOrientation::Along { sign }) => bands.push(Band { at_mm: sign * band.at_mm, ..band }),
            Some(DieOrientation::Across { sign }) => {
                cross_bands.push(Band { at_mm: sign * band.at_mm, ..band })
            }
            None => return Err(refuse("the die must lie along or across the strokes before it")),
        }
        self.strokes += 1;
        Ok(())
    }
}

/// Parameters of a forming programme.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Plan {
    /// Strokes side by side, from edge to edge, at least 2.
    pub strokes_per_pass: u32,
    /// Number of passes over the plate; each pass bends an equal share.
    pub passes: u32,
    /// Share of the angle that the planner expects to spring back; the actual springback scatters about it.
    pub springback: f64,
    /// Standard deviation of the actual springback, relative to `springback`.
    pub springback_scatter: f64,
    /// Seed of the scatter.
    pub seed: u64,
}

impl Default for Plan {
    fn default() -> Self {
        Self { strokes_per_pass: 7, passes: 2, springback: 0.2, springback_scatter: 0.05, seed: 1 }
    }
}

/// Sequence of strokes that bends a flat plate to a target.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Programme {
    /// Strokes in order.
    pub strokes: Vec<Stroke>,
}

impl Programme {
    /// Plans strokes toward `target`: bands from edge to edge at half their width, so that all passes together
    /// leave the target's curvature everywhere, but for the scatter of the springback. Spheres and tori are bent
    /// in both directions, along the axis first.
    ///
    /// # Errors
    /// [`PlateError::Target`] for shapes that parallel strokes cannot reach; [`PlateError::Description`] for an
    /// invalid plan.
    pub fn toward(target: &Shape, blank: &Blank, plan: &Plan) -> Result<Self, PlateError> {
        let directions: Vec<(f64, f64)> = match *target {
            Shape::Cylinder { radius_mm, axis_deg } => vec![(axis_deg, radius_mm)],
            Shape::Sphere { radius_mm } => vec![(90.0, radius_mm), (180.0, radius_mm)],
            Shape::Torus { axis_deg, radius_mm, cross_radius_mm } => {
                vec![(axis_deg, cross_radius_mm), (axis_deg + 90.0, radius_mm)]
            }
            _ => return Err(PlateError::Target { target: target.name() }),
        };
        if plan.strokes_per_pass < 2 {
            let found = f64::from(plan.strokes_per_pass);
            return Err(PlateError::Description {
                key: "plan.strokes_per_pass",
                found,
                advice: "write 2 or more",
            });
        }
        if !(0.0..1.0).contains(&plan.springback) || !(0.0..1.0).contains(&plan.springback_scatter) {
            let found = plan.springback;
            return Err(PlateError::Description {
                key: "plan.springback",
                found,
                advice: "write shares of 0 to 1",
            });
        }
        let mut rng = Pcg64::new(u128::from(plan.seed), 0);
        let mut strokes = Vec::new();
        for _ in 0..plan.passes {
            for (axis_deg, radius_mm) in &directions {
                let curvature = crate::shape::curvature("target.radius_mm", *radius_mm)?;
                let share = curvature / f64::from(plan.passes);
                strokes.extend(pass(blank, plan, *axis_deg, share, &mut rng));
            }
        }
        Ok(Self { strokes })
    }
}

/// Returns one pass of strokes from edge to edge that adds `curvature` (1/m) everywhere.
fn pass(blank: &Blank, plan: &Plan, axis_deg: f64, curvature: f64, rng: &mut Pcg64) -> Vec<Stroke> {
    let (sin, cos) = axis_deg.to_radians().sin_cos();
    let extent_mm = blank.width_mm * sin.abs() + blank.height_mm * cos.abs();
    let spacing_mm = extent_mm / f64::from(plan.strokes_per_pass - 1);
    let wanted_deg = (curvature * spacing_mm * 1e-3).to_degrees();
    let stroke = |i: u32| Stroke {
        axis_deg,
        at_mm: f64::from(i) * spacing_mm - extent_mm / 2.0,
        width_mm: 2.0 * spacing_mm,
        angle_deg: wanted_deg / (1.0 - plan.springback),
        springback: (plan.springback * (1.0 + scatter(plan.springback_scatter, rng))).clamp(0.0, 0.99),
    };
    (0..plan.strokes_per_pass).map(stroke).collect()
}

/// Draws a normal deviate of standard deviation `sigma`, which is finite and not negative.
fn scatter(sigma: f64, rng: &mut Pcg64) -> f64 {
    Normal::new(0.0, sigma).map_or(0.0, |normal| normal.sample(rng))
}

/// Random movement of the plate while it is handled between strokes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Handling {
    /// Standard deviation of the position in the horizontal plane, each axis.
    pub slide_mm: f64,
    /// Standard deviation of the rotation about the vertical.
    pub turn_deg: f64,
    /// Standard deviation of the tilt about both horizontal axes.
    pub tilt_deg: f64,
    /// Seed.
    pub seed: u64,
}

impl Default for Handling {
    fn default() -> Self {
        Self { slide_mm: 4.0, turn_deg: 0.1, tilt_deg: 0.05, seed: 1 }
    }
}

impl Handling {
    /// Returns the pose after `strokes` strokes of a plate whose nominal pose is `home`; a pure function of its
    /// arguments.
    pub fn place(&self, home: &Pose, strokes: u32) -> Pose {
        let mut rng = Pcg64::new(u128::from(self.seed), u128::from(strokes));
        let mut about = |middle: f64, sigma: f64| middle + scatter(sigma.abs(), &mut rng);
        let [x, y, z] = home.centre_mm;
        Pose {
            centre_mm: [about(x, self.slide_mm), about(y, self.slide_mm), z],
            yaw_deg: about(home.yaw_deg, self.turn_deg),
            pitch_deg: about(home.pitch_deg, self.tilt_deg),
            roll_deg: about(home.roll_deg, self.tilt_deg),
        }
    }
}
