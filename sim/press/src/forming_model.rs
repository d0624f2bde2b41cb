//! Forming model: choice of the next bend and its effect on the plate.
//!
//! The forming is kinematic (`platen_sim_plate::Stroke`): prescribed angle and springback share, no moment-curvature
//! law. The first strokes follow a programme planned for a share of the target's curvature. With
//! [`Strategy::ClosedLoop`] the press stops as soon as a result passes and, after the programme, corrects the place of
//! the largest template gap.
//!
//! Correction: a template of chord L on a plate that is bent too little everywhere touches in its middle and has gaps
//! at its ends, so the bend belongs between the plate's middle and the place of the gap. Where the plate is bent too
//! far, the template rests on its ends and has a gap in its middle; there it is bent back. A bend by the angle a in the
//! middle of the template moves its ends by a L / 4. The press applies half of the closing angle and measures again.

use platen_sim_plate::{Blank, Handling, Plan, PlateState, Pose, Programme, Shape, Stroke};
use serde::{Deserialize, Serialize};

use crate::Result;
use crate::driven_ram::{DrivenRam, OrderedStroke, RamConfig};
use crate::registers::{HBlock, Verdict};

/// Share of the closing angle that is applied; half avoids bending too far.
const CORRECTION: f64 = 0.5;
/// Largest number of rescans after a result without figures.
const RESCANS: u16 = 2;

/// Selection of the next bend.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Strategy {
    /// Executes the programme in order, independent of the results.
    #[default]
    Programme,
    /// Corrects the place of the largest gap until a result passes.
    ClosedLoop,
    /// Presses to a depth as ordered at the control port, until a result passes.
    Operator,
}

/// Plate, target and forming programme.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct PlateConfig {
    /// Blank.
    pub blank: Blank,
    /// Cylinder, sphere or torus; radii of the mid-surface.
    pub target: Shape,
    /// Share of the target's curvature that the programme bends, 0 to 1.
    pub share: f64,
    /// Plan of the programme.
    pub plan: Plan,
    /// Nominal pose of the plate.
    pub pose: Pose,
    /// Movement between strokes.
    pub handling: Handling,
    /// Chord of the template, for the corrections.
    pub chord_mm: f64,
    /// Steel, die and ram of the strategy `operator`.
    pub ram: RamConfig,
}

impl Default for PlateConfig {
    fn default() -> Self {
        Self {
            blank: Blank { width_mm: 4000.0, height_mm: 4000.0, thickness_mm: 35.0, ..Blank::default() },
            target: Shape::Cylinder { radius_mm: 12_017.5, axis_deg: 90.0 },
            share: 1.0,
            plan: Plan::default(),
            pose: Pose::default(),
            handling: Handling::default(),
            chord_mm: 2_000.0,
            ram: RamConfig::default(),
        }
    }
}

/// Next action on a plate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Next {
    /// Bends the plate.
    Bend(Stroke),
    /// Requests another scan: the last result had no figures.
    Rescan,
    /// Waits for an order.
    Wait,
    /// Ends the part.
    End,
}

/// Plate being formed from flat to its target.
#[derive(Clone, Debug)]
pub struct FormingModel {
    config: PlateConfig,
    strategy: Strategy,
    programme: Vec<Stroke>,
    state: PlateState,
    last: Option<HBlock>,
    corrections: usize,
    ram: DrivenRam,
    /// Stroke that was ordered but not yet made.
    ordered: Option<Stroke>,
}

impl FormingModel {
    /// Creates a flat plate and a programme towards its target.
    ///
    /// # Errors
    /// [`crate::Error::Plate`] when the target cannot be reached by strokes or the blank is impossible.
    pub fn new(config: &PlateConfig, strategy: Strategy, part: u32) -> Result<Self> {
        let mut programme = Programme::toward(&config.target, &config.blank, &config.plan)?.strokes;
        for stroke in &mut programme {
            stroke.angle_deg *= config.share;
        }
        let pose = config.handling.place(&config.pose, 0);
        let state = PlateState { blank: config.blank.clone(), shape: Shape::Flat, pose, strokes: 0 };
        let axis_deg = programme.first().map_or(90.0, |stroke| stroke.axis_deg);
        let ram = DrivenRam::new(&config.ram, &config.blank, part, axis_deg);
        Ok(Self {
            config: config.clone(),
            strategy,
            programme,
            state,
            last: None,
            corrections: 0,
            ram,
            ordered: None,
        })
    }

    /// Returns the present state of the plate.
    #[must_use]
    pub fn state(&self) -> &PlateState {
        &self.state
    }

    /// Accepts the operator's order for the next stroke.
    pub fn order(&mut self, order: &OrderedStroke) {
        self.ordered = Some(self.ram.press(order));
    }

    /// Returns die set and depth of the last stroke, as reported by the press; `None` before a driven stroke.
    #[must_use]
    pub fn reported(&self) -> Option<(u16, f64)> {
        (self.strategy == Strategy::Operator)
            .then(|| (self.ram.die_id(), self.ram.reported_mm.unwrap_or(0.0)))
    }

    /// Records the latest result.
    pub fn record_result(&mut self, result: &HBlock) {
        self.last = Some(*result);
    }

    /// Returns the next action; `attempt` is the number of rescans of the last stroke.
    #[must_use]
    pub fn next(&self, attempt: u16) -> Next {
        let made = usize::try_from(self.state.strokes).unwrap_or(usize::MAX);
        let planned = self.programme.get(made).copied();
        match (self.strategy, planned, &self.last) {
            (Strategy::Programme, None, _) => Next::End,
            (Strategy::ClosedLoop | Strategy::Operator, _, Some(last))
                if made > 0 && last.verdict() == Verdict::Pass =>
            {
                Next::End
            }
            (Strategy::Operator, _, _) => self.ordered.map_or(Next::Wait, Next::Bend),
            (_, Some(stroke), _) => Next::Bend(stroke),
            (Strategy::ClosedLoop, None, Some(last)) => match self.correction(last) {
                Some(stroke) => Next::Bend(stroke),
                None if attempt < RESCANS => Next::Rescan,
                None => Next::End,
            },
            (Strategy::ClosedLoop, None, None) => Next::End,
        }
    }

    /// Bends the plate and moves it as handling between strokes does.
    ///
    /// # Errors
    /// [`crate::Error::Plate`] when the stroke is oblique to the strokes before it.
    pub fn bend(&mut self, stroke: &Stroke) -> Result<()> {
        self.ordered = None;
        if usize::try_from(self.state.strokes).is_ok_and(|made| made >= self.programme.len()) {
            self.corrections += 1;
        }
        self.state.apply(stroke)?;
        self.state.pose = self.config.handling.place(&self.config.pose, self.state.strokes);
        Ok(())
    }

    /// Returns a stroke by half the closing angle: between the plate's middle and the place of the gap, or at that
    /// place if the plate is bent too far. Targets bent in two directions are corrected alternately.
    fn correction(&self, last: &HBlock) -> Option<Stroke> {
        let (gap_mm, [u_mm, v_mm]) = (last.gap_max_mm()?, last.gap_at_mm()?);
        if last.sense() == 0 {
            return None;
        }
        let axes = self.axes_deg();
        let axis_deg = axes[self.corrections % axes.len()];
        let model = self.programme.iter().find(|stroke| stroke.axis_deg == axis_deg)?;
        let (sin, cos) = axis_deg.to_radians().sin_cos();
        let blank = &self.config.blank;
        let across_mm = (u_mm - blank.width_mm / 2.0) * sin - (v_mm - blank.height_mm / 2.0) * cos;
        let closing_deg = (4.0 * gap_mm / self.config.chord_mm).to_degrees();
        let wanted_deg = -f64::from(last.sense()) * CORRECTION * closing_deg;
        let springback = self.config.plan.springback;
        let at_mm = if last.sense() < 0 { across_mm / 2.0 } else { across_mm };
        Some(Stroke { at_mm, angle_deg: wanted_deg / (1.0 - springback), springback, ..*model })
    }

    /// Returns the directions of the die in the programme, in order of appearance.
    fn axes_deg(&self) -> Vec<f64> {
        let mut axes = Vec::new();
        for stroke in &self.programme {
            if !axes.contains(&stroke.axis_deg) {
                axes.push(stroke.axis_deg);
            }
        }
        axes
    }
}
