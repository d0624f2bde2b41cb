//! Driven ram: a plate of fibre steel under a press with realistic errors, and an operator who orders strokes to a
//! depth.
//!
//! The steel determines the angle that remains after unloading ([`FibreStrip`]). The shape of the plate receives it as
//! a bend band of a third of the die's opening, the reach of the plastic hinge under three-point bending.

use std::f64::consts::TAU;

use platen_sim_plate::{Blank, FibreSteel, FibreStrip, Press, Stroke};
use rand_distr::{Distribution as _, Normal, Open01};
use rand_pcg::Pcg64;
use serde::{Deserialize, Serialize};

/// True properties of steel, die and ram. Every key has a default.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct RamConfig {
    /// Number of the die set, as reported to the host.
    pub die_id: u16,
    /// Distance between the shoulders.
    pub opening_mm: f64,
    /// Mean yield strength.
    pub yield_mpa: f64,
    /// Standard deviation of the yield strength from plate to plate, share.
    pub yield_scatter: f64,
    /// Standard deviation of the yield strength along a plate, share.
    pub yield_within: f64,
    /// Mean excess of the plates' thickness over the ordered one.
    pub thicker_mm: f64,
    /// Standard deviation of the thickness from plate to plate.
    pub thickness_scatter_mm: f64,
    /// Standard deviation of the thickness along a plate.
    pub thickness_within_mm: f64,
    /// Depth at which the ram touches a flat plate of nominal thickness.
    pub zero_mm: f64,
    /// Travel of the frame under one meganewton per metre of line.
    pub frame_mm: f64,
    /// Standard deviation of the ram about the ordered depth.
    pub ram_scatter_mm: f64,
    /// Standard deviation of the place of a bend.
    pub place_scatter_mm: f64,
    /// Offset of the die from its mark.
    pub off_mark_mm: f64,
    /// Seed of plates and scatter.
    pub seed: u64,
}

impl Default for RamConfig {
    fn default() -> Self {
        Self {
            die_id: 4,
            opening_mm: 360.0,
            yield_mpa: 440.0,
            yield_scatter: 0.1,
            yield_within: 0.03,
            thicker_mm: 0.0,
            thickness_scatter_mm: 0.4,
            thickness_within_mm: 0.3,
            zero_mm: 0.2,
            frame_mm: 0.2,
            ram_scatter_mm: 0.1,
            place_scatter_mm: 8.0,
            off_mark_mm: 5.0,
            seed: 1,
        }
    }
}

/// Stroke ordered by the operator.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct OrderedStroke {
    /// Direction of the die, from u towards v.
    pub axis_deg: f64,
    /// Distance of the die from the plate's middle, positive towards the direction `axis_deg - 90`.
    pub at_mm: f64,
    /// Depth below the touch on a flat plate of nominal thickness.
    pub depth_mm: f64,
    /// With the plate turned over.
    #[serde(default)]
    pub turned_over: bool,
}

/// Ram, die and the steel of one plate.
#[derive(Clone, Debug)]
pub struct DrivenRam {
    config: RamConfig,
    strip: FibreStrip,
    /// Direction of the first stroke; the strip runs across it.
    axis_deg: f64,
    press: Press,
    random: Pcg64,
    /// Depth of the last stroke, as reported by the press.
    pub reported_mm: Option<f64>,
}

impl DrivenRam {
    /// Creates the ram with a flat plate; the steel is drawn for `part`.
    #[must_use]
    pub fn new(config: &RamConfig, blank: &Blank, part: u32, axis_deg: f64) -> Self {
        let mut random = Pcg64::new(u128::from(config.seed) << 32 | u128::from(part), 0x72_616d);
        let (sin, cos) = axis_deg.to_radians().sin_cos();
        let length = 1e-3 * (blank.width_mm * sin.abs() + blank.height_mm * cos.abs());
        let thickness = 1e-3 * blank.thickness_mm;
        let scatter = 1.0 + config.yield_scatter * draw(1.0, &mut random);
        let thicker = 1e-3 * (config.thicker_mm + draw(config.thickness_scatter_mm, &mut random));
        let yields = along_plate(config.yield_within, &mut random);
        let thickens = along_plate(1e-3 * config.thickness_within_mm, &mut random);
        let steel = |x: f64| FibreSteel {
            yield_strength: 1e6 * config.yield_mpa * scatter * (1.0 + yields(x)),
            thickness: thickness + thicker + thickens(x),
        };
        let press = Press {
            opening: 1e-3 * config.opening_mm,
            compliance: 1e-9 * config.frame_mm,
            zero: 1e-3 * config.zero_mm,
            nominal_thickness: thickness,
        };
        let strip = FibreStrip::new(length, steel, |_| 0.0);
        Self { config: config.clone(), strip, axis_deg, press, random, reported_mm: None }
    }

    /// Returns the number of the die set.
    #[must_use]
    pub fn die_id(&self) -> u16 {
        self.config.die_id
    }

    /// Presses as ordered, with the errors of this press; returns the stroke with the angle that remains.
    pub fn press(&mut self, order: &OrderedStroke) -> Stroke {
        let reached_mm = order.depth_mm + draw(self.config.ram_scatter_mm, &mut self.random);
        let place_mm = draw(self.config.place_scatter_mm, &mut self.random) + self.config.off_mark_mm;
        // On a die in the opposite direction positions are counted the other way.
        let along = (order.axis_deg - self.axis_deg).to_radians().cos().signum();
        let at_mm = along * order.at_mm + place_mm;
        let length = self.strip.step() * self.strip.curvature().count() as f64;
        let x = 1e-3 * at_mm + 0.5 * length;
        let angle = self.strip.press(&self.press, x, 1e-3 * reached_mm, order.turned_over);
        self.reported_mm = Some(reached_mm + draw(0.03, &mut self.random));
        Stroke {
            axis_deg: self.axis_deg,
            at_mm,
            width_mm: self.config.opening_mm / 3.0,
            angle_deg: angle.to_degrees(),
            springback: 0.0,
        }
    }
}

/// Draws a variation along a plate, x in metres: two waves 2 to 6 m long, of this standard deviation together.
fn along_plate(sigma: f64, random: &mut Pcg64) -> impl Fn(f64) -> f64 + use<> {
    let mut share = || -> f64 { Open01.sample(random) };
    let waves = [1.0, 2.0].map(|n| [n * (1.0 + 0.5 * share()), TAU * share()]);
    move |x| sigma * waves.iter().map(|[number, phase]| (number * x + phase).sin()).sum::<f64>()
}

fn draw(sigma: f64, random: &mut Pcg64) -> f64 {
    Normal::new(0.0, sigma).map_or(0.0, |normal| normal.sample(random))
}
