//! The plate under the ram: which bend comes next, and what it does to the plate.
//!
//! The first strokes follow a programme planned for a share of the target's curvature. With
//! [`Strategy::ClosedLoop`] the press stops as soon as a result passes and, when the programme is through, corrects
//! where the results say the template stands open.
//!
//! Correction: a board of chord L on a plate that is bent too little everywhere touches in its middle and opens at
//! its ends, so the bend belongs between the plate's middle and the place of the gap. Where the plate is bent too far
//! the board rests on its ends and opens in its middle: there it is bent back. A bend by the angle a in the
//! middle of the board moves its ends by a L / 4; the press bends half of that angle and looks again.

use platen_sim_plate::{Blank, Handling, Plan, PlateState, Pose, Programme, Shape, Stroke};
use serde::{Deserialize, Serialize};

use crate::Result;
use crate::registers::{HBlock, Verdict};

/// Share of the angle that would close the gap at once; half keeps the press from bending too far.
const CORRECTION: f64 = 0.5;
/// Rescans asked for when a result without figures leaves the press blind.
const RESCANS: u16 = 2;

/// How the next bend is chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Strategy {
    /// The programme of bends, one after the other, whatever the results say.
    #[default]
    Programme,
    /// Where the result says that the plate is open, until it passes.
    ClosedLoop,
}

/// The plate, its target and how it is bent there.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct PlateConfig {
    /// The blank.
    pub blank: Blank,
    /// Cylinder, sphere or torus; radii of the mid-surface.
    pub target: Shape,
    /// Share of the target's curvature that the programme bends, 0 to 1.
    pub share: f64,
    /// The programme.
    pub plan: Plan,
    /// Where the plate lies.
    pub pose: Pose,
    /// How it moves between strokes.
    pub handling: Handling,
    /// Chord of the template that the press reckons corrections with.
    pub chord_mm: f64,
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
        }
    }
}

/// What the press does next with this plate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Next {
    /// Bend.
    Bend(Stroke),
    /// Ask for another scan: the last result had no figures.
    Rescan,
    /// Leave it.
    End,
}

/// One plate on its way from flat to its target.
#[derive(Clone, Debug)]
pub struct FormingModel {
    config: PlateConfig,
    strategy: Strategy,
    programme: Vec<Stroke>,
    state: PlateState,
    last: Option<HBlock>,
    corrections: usize,
}

impl FormingModel {
    /// A flat plate and a programme toward its target.
    ///
    /// # Errors
    /// [`crate::Error::Plate`] when the target cannot be reached by strokes or the blank is impossible.
    pub fn new(config: &PlateConfig, strategy: Strategy) -> Result<Self> {
        let mut programme = Programme::toward(&config.target, &config.blank, &config.plan)?.strokes;
        for stroke in &mut programme {
            stroke.angle_deg *= config.share;
        }
        let pose = config.handling.place(&config.pose, 0);
        let state = PlateState { blank: config.blank.clone(), shape: Shape::Flat, pose, strokes: 0 };
        Ok(Self { config: config.clone(), strategy, programme, state, last: None, corrections: 0 })
    }

    /// The plate as it lies now.
    #[must_use]
    pub fn state(&self) -> &PlateState {
        &self.state
    }

    /// Keeps the latest result.
    pub fn record_result(&mut self, result: &HBlock) {
        self.last = Some(*result);
    }

    /// What comes next; `attempt` counts the rescans of the last stroke.
    #[must_use]
    pub fn next(&self, attempt: u16) -> Next {
        let made = usize::try_from(self.state.strokes).unwrap_or(usize::MAX);
        let planned = self.programme.get(made).copied();
        match (self.strategy, planned, &self.last) {
            (Strategy::Programme, None, _) => Next::End,
            (Strategy::ClosedLoop, _, Some(last)) if made > 0 && last.verdict() == Verdict::Pass => Next::End,
            (_, Some(stroke), _) => Next::Bend(stroke),
            (Strategy::ClosedLoop, None, Some(last)) => match self.correction(last) {
                Some(stroke) => Next::Bend(stroke),
                None if attempt < RESCANS => Next::Rescan,
                None => Next::End,
            },
            (Strategy::ClosedLoop, None, None) => Next::End,
        }
    }

    /// Bends the plate; it does not lie where it lay before.
    ///
    /// # Errors
    /// [`crate::Error::Plate`] when the stroke lies across the strokes before it at an odd angle.
    pub fn bend(&mut self, stroke: &Stroke) -> Result<()> {
        if usize::try_from(self.state.strokes).is_ok_and(|made| made >= self.programme.len()) {
            self.corrections += 1;
        }
        self.state.apply(stroke)?;
        self.state.pose = self.config.handling.place(&self.config.pose, self.state.strokes);
        Ok(())
    }

    /// A stroke by half the angle that would close the gap: between the plate's middle and the open place, or at
    /// that place where the plate is bent too far.
    /// Targets bent in two directions are corrected in them by turns.
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

    /// Directions of the die in the programme, in order of appearance.
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
