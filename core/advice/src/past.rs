//! Effect of the strokes so far: the bends in the plate, and the state of the depth law learned from them.

use platen_model::{Bend, CannotAdvise, PlateHistory, PressedStroke, Steel};

use crate::learner::Learner;
use crate::press_capability::PressCapability;
use crate::press_law::PressLaw;
use crate::settings::Settings;
use crate::situation::Situation;

/// Mean yield strength of structural steel where the plate file names none, pascals.
pub(crate) const YIELD: f64 = 440e6;
/// Largest angle between a bend and the lines, radians: other bends were not made by a stroke.
const ASKEW: f64 = 0.26;
/// Half width of a 95 % interval, standard deviations.
const P95: f64 = 1.96;
/// Number of standard deviations of the ram below the advised depth from which a stroke counts as stopped short.
const SHORT: f64 = 3.0;

/// Bends, state of the depth law and last stroke of a plate.
#[derive(Debug)]
pub(crate) struct Past {
    /// Coordinate and angle of each bend.
    pub(crate) bends: Vec<(f64, f64)>,
    /// Coordinate of the last stroke.
    pub(crate) last: Option<f64>,
    /// State of the depth law; `None` without a die opening.
    pub(crate) learner: Option<Learner>,
    /// True when the press reported the depth of a stroke.
    pub(crate) depth_reported: bool,
    /// Number of strokes whose place was used to locate the die.
    pub(crate) marks: usize,
    /// Distance by which the last stroke stopped short of the advised depth, metres.
    pub(crate) short: Option<f64>,
}

impl Past {
    /// Evaluates the strokes of a history in their order.
    ///
    /// # Errors
    /// [`CannotAdvise::BendsUnknown`] after a stroke whose bends are not known.
    pub(crate) fn new(
        settings: &Settings,
        history: &PlateHistory,
        situation: &Situation,
    ) -> Result<Self, CannotAdvise> {
        let unnamed = || Steel { grade: None, yield_strength: YIELD, heat: None };
        let steel = history.steel.clone().unwrap_or_else(unnamed);
        let law = history.die.as_ref().map(|die| PressLaw::new(die, &steel, history.task.thickness));
        let mut past = Self {
            bends: Vec::new(),
            last: None,
            learner: law.map(|law| Learner::new(law, history.like.as_ref())),
            depth_reported: history.strokes.iter().any(|stroke| stroke.depth.is_some()),
            marks: 0,
            short: None,
        };
        for stroke in &history.strokes {
            if stroke.not_measured {
                return Err(CannotAdvise::BendsUnknown);
            }
            past.learn(stroke, situation, law.map_or(0.0, |law| law.opening()), settings.learns);
        }
        Ok(past)
    }

    fn learn(&mut self, stroke: &PressedStroke, situation: &Situation, opening: f64, learns: bool) {
        let lines = &situation.lines;
        let wanted = stroke.wanted.as_ref().map(|wanted| (lines.coordinate(wanted.at), wanted));
        let of_stroke = |bend: &&Bend| {
            let [c, s] = lines.direction(lines.coordinate(bend.at));
            let (sin, cos) = bend.direction.sin_cos();
            (c * sin - s * cos).abs() < ASKEW.sin()
        };
        let bend = stroke.bends.iter().find(of_stroke);
        let made = bend.map(|bend| (lines.coordinate(bend.at), bend.angle * situation.side, bend.sigma));
        let place = made.map(|made| made.0).or(wanted.map(|wanted| wanted.0));
        self.short = None;
        if let (Some(learner), Some(depth), Some(x)) = (&mut self.learner, stroke.depth, place) {
            let sag = situation.sag(x, opening, &self.bends);
            // A bend backwards was made with the plate turned over. It follows another law, since the steel was first
            // bent the other way.
            if learns && made.is_none_or(|(_, angle, _)| angle > 0.0) {
                learner.observe(x, depth, sag, made.map(|(_, angle, sigma)| (angle, sigma)));
            }
            if let Some(off) = wanted.and_then(|(_, wanted)| wanted.depth).map(|wanted| depth - wanted) {
                // A stroke that stopped short is not evidence of the scatter.
                if off > -SHORT * learner.ram_sigma() {
                    learner.observe_ram(off);
                } else {
                    self.short = Some(-off);
                }
            }
            if let (Some((wanted, _)), Some((made, ..))) = (wanted, made) {
                learner.observe_mark(made - wanted);
                self.marks += 1;
            }
        }
        let along = stroke.bends.iter().filter(of_stroke);
        self.bends.extend(along.map(|bend| (lines.coordinate(bend.at), bend.angle * situation.side)));
        self.last = place.or(self.last);
    }

    /// Returns the press capability under the first template; `None` without a die or a template.
    pub(crate) fn press(&self, history: &PlateHistory) -> Option<PressCapability> {
        let (die, board) = (history.die.as_ref()?, history.task.templates.first()?);
        Some(PressCapability::new(self.learner.as_ref()?.ram_sigma(), die.opening, board.chord, board.limit))
    }
}

/// Returns the angle that a given depth at the line x is expected to leave, radians, and half its 95 % interval, from
/// the strokes of the history; `None` without a die.
#[must_use]
pub fn expected_angle(
    settings: &Settings,
    history: &PlateHistory,
    lines: &Situation,
    x: f64,
    depth: f64,
) -> Option<[f64; 2]> {
    let past = Past::new(settings, history, lines).ok()?;
    let opening = history.die.as_ref()?.opening;
    let (learner, sag) = (past.learner.as_ref()?, lines.sag(x, opening, &past.bends));
    // The depth grows with the angle.
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if learner.depth(x, middle, sag) < depth { low = middle } else { high = middle }
    }
    Some([low, P95 * learner.sigma_reported(x, low)])
}

/// Returns the depth for a bend of this angle along the line x, as advised by [`advise`](crate::advise), metres; `None`
/// where no depth can be given.
#[must_use]
pub fn depth_at(
    settings: &Settings,
    history: &PlateHistory,
    situation: &Situation,
    x: f64,
    angle: f64,
) -> Option<f64> {
    let past = Past::new(settings, history, situation).ok()?;
    let opening = history.die.as_ref()?.opening;
    past.learner.as_ref().map(|learner| learner.depth(x, angle, situation.sag(x, opening, &past.bends)))
}
