//! Advisor `line-bends`: the next bend along a line, derived from the plate's target and its strokes up to the last
//! one.
//!
//! The method is this project's own; see `core/advice`.
//!
//! # Method
//!
//! On a cylinder and a cone every bend runs along a straight line of the target and adds a ramp to the plate's height
//! over it. After each stroke the plan is made again: it is the smallest number of bends, none of them backwards, after
//! which all templates pass. The depth of the next bend is computed from three-point bending with springback, and
//! corrected by what was learned from the strokes of this plate and of earlier plates of its class. On spheres and tori
//! the advice is the position and direction of the next bend.
//!
//! # Example
//!
//! ```toml
//! [advice]
//! plugin = "line-bends"
//! show = "screen"
//! [advice.options]
//! angle_max_deg = 1.9
//! [[die]]
//! id = 4
//! opening_mm = 360.0
//! ```
//!
//! # Options
//!
//! | key | unit | default | range | meaning |
//! |---|---|---|---|---|
//! | `angle_max_deg` | deg | target's curvature x 300 mm, at most 3 | 0.2 to 20 | largest bend of one stroke |
//! | `strain_max_percent` | % | 5 | 0.5 to 30 | largest strain of the face under the recorded bends, by the thickness and the die's `punch_radius_mm`; above it no bend is advised there |
//! | `order` | | `onward` | `onward`, `ends_in` | from the last bend onward, or from both ends to the middle |
//! | `depth` | | `true` | | advise a depth; requires the die's opening and a press that reports its depth (`ram_depth`) |
//!
//! # Limits and errors
//!
//! There is no depth without `[[die]]`, and no angle on double curvature. The guard against bending too far depends on
//! the templates of the plate file.

use platen_advice::{Order, Settings, advise_on_surfaces};
use platen_model::{Advice, Step};
use platen_sdk::{Advisor, AdvisorInputs, Info, Job, Result};
use platen_shape::TargetSurface;

platen_sdk::options! {
    /// Options of `line-bends`.
    pub struct Options {
        /// Largest bend of one stroke; default: the target's curvature over 300 mm, at most 3 degrees.
        angle_max_deg: Option<f64>, min 0.2, max 20.0;
        /// Largest strain of the face under the bends at one place, percent: beyond 5 codes of pressure vessels ask for a heat treatment.
        strain_max_percent: f64 = 5.0, unit "%", min 0.5, max 30.0;
        /// Order of the lines.
        order: String = "onward", choices ["onward", "ends_in"];
        /// Whether a depth is given.
        depth: bool = true;
    }
}

struct LineBends(Options);

/// Feed of a shop that makes the largest permitted bends, metres, and the largest bend without an option, radians.
const FEED: f64 = 0.3;
const LARGEST: f64 = 0.0524;

impl Advisor for LineBends {
    const INFO: Info = Info::new(
        c"line-bends",
        c"Line bends",
        c"Advises the next bend along a line: place, angle and depth with intervals, and when to stop.",
        c"1.0.0",
    );
    type Options = Options;

    fn new(options: Options) -> Result<Self> {
        Ok(Self(options))
    }

    fn advise(&mut self, job: &Job<'_>, inputs: &AdvisorInputs) -> Result<Advice> {
        job.check()?;
        let AdvisorInputs { history, now, baseline } = inputs;
        let task = &history.task;
        let curvature = task.target.as_ref().and_then(|target| {
            let target = TargetSurface::new(target, task.width, task.height, task.thickness).ok()?;
            Some(target.curvature(0.5 * task.width, 0.5 * task.height).strongest().abs())
        });
        let by_feed = (FEED * curvature.unwrap_or(0.0)).clamp(0.005, LARGEST);
        let settings = Settings {
            largest: self.0.angle_max_deg.map_or(by_feed, f64::to_radians),
            strain: 0.01 * self.0.strain_max_percent,
            order: if self.0.order == "ends_in" { Order::EndsIn } else { Order::Onward },
            guard: true,
            learns: true,
        };
        let mut advice = advise_on_surfaces(&settings, history, now, baseline.as_ref());
        if let (false, Step::Bend(bend) | Step::TurnOver(bend)) = (self.0.depth, &mut advice.step) {
            (bend.depth, bend.depth_not_beyond) = (None, None);
        }
        Ok(advice)
    }
}

platen_sdk::export!(advisor LineBends);
