//! The next bend: first line of the plan, guarded, with its depth and intervals.

use nalgebra::DVector;
use platen_model::{Advice, CannotAdvise, NextBend, PlannedBend, PlateHistory, Step, Verdict};

use crate::board::{Board, Gap};
use crate::learner::{LEAST_ANGLE, Learner};
use crate::planner::{Plan, Planner, Worst};
use crate::press_capability::PressCapability;
use crate::press_law::PressLaw;
use crate::situation::Situation;

/// Choices of a shop.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// Largest bend of one stroke, radians.
    pub largest: f64,
    /// Order of the lines.
    pub order: Order,
    /// The guard against bending too far is on; off for the study of what it is worth.
    pub guard: bool,
    /// Strokes teach the depth law; off for the study of what that is worth.
    pub learns: bool,
}

/// Order of the lines of a plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// From the last bend onward, then from the first edge again.
    Onward,
    /// From both ends to the middle.
    EndsIn,
}

/// Half widths of intervals in standard deviations: 95 %, and one side at 99.5 % for the guard.
const P95: f64 = 1.96;
const GUARD: f64 = 2.6;
/// Half width of the 95 % interval of the place of a bend, metres.
const MISPLACED: f64 = 0.018;
/// Largest error of the height by linear theory, share of a gap: a chord of 2 m on a radius of 9 m has 0.3 % more sagitta than its parabola,
/// and the face lies half a thickness, 0.2 % of the radius, off the middle.
const SECOND_ORDER: f64 = 0.006;
/// Distance of a new bend from an old one, metres, unless nothing else reaches the limit.
const FROM_OLD: f64 = 0.07;
/// Error of the place, metres, and arm of an error of the angle under a board, metres: one bend misplaced and misjudged.
const RESERVE: [f64; 2] = [0.010, 0.5];
const RESERVE_SHARE: f64 = 0.45;
/// Smallest bend that is advised, radians: a smaller one can hardly be told from none.
const LEAST_BEND: f64 = 1.6 * LEAST_ANGLE;
/// Missing turn below which a plate that is bent too far is turned over, radians.
const TURN_OVER: f64 = 0.040;
/// Share of the angle at which the first stroke aims when neither like plates nor a stroke taught anything.
const CAUTIOUS: f64 = 0.6;
/// Standard deviation of an angle, share of it, on a press that does not tell its depth.
const BY_EYE: f64 = 0.25;
/// Mean yield strength of structural steel where the plate file names none, pascals.
const YIELD: f64 = 440e6;
/// Largest angle between a bend and the lines, radians: others are not of a stroke.
const ASKEW: f64 = 0.26;

/// Returns the advice after the last stroke of the record.
#[must_use]
pub fn advise(settings: &Settings, record: &PlateHistory, situation: &Situation) -> Advice {
    let passes = |verdict: Verdict| verdict == Verdict::Pass;
    let past = match Past::new(settings, record, situation) {
        Ok(past) => past,
        Err(reason) => return cannot(reason),
    };
    let mut says = past.says(record);
    let advice = if !record.templates.is_empty() && record.templates.iter().all(|it| passes(it.verdict)) {
        Advice { strokes_left: Some([0, 0]), ..of(Step::Done) }
    } else if past.learner.as_ref().is_some_and(Learner::is_surprised) {
        cannot(CannotAdvise::PressUnlikeRecord)
    } else {
        Adviser::new(settings, record, situation, &past).next()
    };
    says.splice(0..0, advice.says);
    let model = advice.model.or_else(|| past.learner.as_ref().map(|it| it.model(settings.largest)));
    Advice { says, model, ..advice }
}

/// Returns the angle that a told depth at the line x is expected to leave, radians, and half its 95 % interval, from the strokes of the
/// history; `None` without a die.
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
        if learner.depth(middle, sag) < depth { low = middle } else { high = middle }
    }
    Some([low, P95 * learner.sigma_told(low)])
}

/// Returns the depth for a bend of this angle along the line x, as [`advise`] would, metres; `None` where no depth can be told.
#[must_use]
pub fn depth_at(
    settings: &Settings,
    record: &PlateHistory,
    situation: &Situation,
    x: f64,
    angle: f64,
) -> Option<f64> {
    let past = Past::new(settings, record, situation).ok()?;
    let opening = record.die.as_ref()?.opening;
    past.learner.as_ref().map(|learner| learner.depth(angle, situation.sag(x, opening, &past.bends)))
}

pub(crate) fn of(step: Step) -> Advice {
    Advice { step, strokes_left: None, plan: Vec::new(), too_far: Vec::new(), says: Vec::new(), model: None }
}

pub(crate) fn cannot(reason: CannotAdvise) -> Advice {
    of(Step::Cannot { reason })
}

/// What the strokes so far left and taught.
struct Past {
    /// Coordinate and angle of each bend.
    bends: Vec<(f64, f64)>,
    last: Option<f64>,
    /// `None` without a die opening.
    learner: Option<Learner>,
    depth_told: bool,
    marks: usize,
}

impl Past {
    fn new(settings: &Settings, record: &PlateHistory, situation: &Situation) -> Result<Self, CannotAdvise> {
        let steel = record.steel.clone().unwrap_or(platen_model::Steel {
            grade: None,
            yield_strength: YIELD,
            heat: None,
        });
        let law = record.die.as_ref().map(|die| PressLaw::new(die, &steel, record.task.thickness));
        let mut past = Self {
            bends: Vec::new(),
            last: None,
            learner: law.map(|law| Learner::new(law, record.like.as_ref())),
            depth_told: record.strokes.iter().any(|stroke| stroke.depth.is_some()),
            marks: 0,
        };
        for stroke in &record.strokes {
            if stroke.not_measured {
                return Err(CannotAdvise::BendsUnknown);
            }
            past.learn(stroke, situation, law.map_or(0.0, |law| law.opening()), settings.learns);
        }
        Ok(past)
    }

    fn learn(
        &mut self,
        stroke: &platen_model::PressedStroke,
        situation: &Situation,
        opening: f64,
        learns: bool,
    ) {
        let lines = &situation.lines;
        let wanted = stroke.wanted.as_ref().map(|wanted| (lines.coordinate(wanted.at), wanted));
        let of_stroke = |bend: &&platen_model::Bend| {
            let [c, s] = lines.direction(lines.coordinate(bend.at));
            let (sin, cos) = bend.direction.sin_cos();
            (c * sin - s * cos).abs() < ASKEW.sin()
        };
        let bend = stroke.bends.iter().find(of_stroke);
        let made = bend.map(|bend| (lines.coordinate(bend.at), bend.angle * situation.side, bend.sigma));
        let place = made.map(|made| made.0).or(wanted.map(|wanted| wanted.0));
        if let (Some(learner), Some(depth), Some(x)) = (&mut self.learner, stroke.depth, place) {
            let sag = situation.sag(x, opening, &self.bends);
            // A bend backwards was made with the plate turned over: another law, as the steel remembers its first direction.
            if learns && made.is_none_or(|(_, angle, _)| angle > 0.0) {
                learner.observe(depth, sag, made.map(|(_, angle, sigma)| (angle, sigma)));
            }
            if let Some(off) = wanted.and_then(|(_, wanted)| wanted.depth).map(|wanted| depth - wanted) {
                // A stroke that stopped short says nothing of the scatter.
                if off > -3.0 * learner.ram_sigma() {
                    learner.observe_ram(off);
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

    /// Returns what the strokes so far say of press and plate file.
    fn says(&self, record: &PlateHistory) -> Vec<String> {
        let mut says = Vec::new();
        let Some(learner) = &self.learner else {
            says.push("no depth: the plant file names no [[die]] of the number that the press tells".into());
            return says;
        };
        if !record.strokes.is_empty() && !self.depth_told {
            says.push("no depth: the press does not tell the depth of its ram (ram_depth)".into());
        }
        if record.steel.is_none() {
            says.push(format!("no [steel] in the plate file: {:.0} MPa assumed", YIELD * 1e-6));
        }
        if let [.., surprise] = learner.surprises[..]
            && surprise.abs() > P95
        {
            let way = if surprise > 0.0 { "more" } else { "less" };
            says.push(match learner.surprises.len() {
                1 => {
                    format!("the plate bent {way} than expected: check its thickness and steel, and the die")
                }
                _ => format!("the last stroke bent the plate {way} than expected"),
            });
        }
        let off = 1e3 * learner.off_mark();
        if self.marks >= 3 && off.abs() > 12.0 {
            says.push(format!(
                "the bends lie {:.0} mm {} of the advised lines; the advice allows for it",
                off.abs(),
                if off > 0.0 { "onward" } else { "back" }
            ));
        }
        if let (Some(die), Some(board)) = (&record.die, record.task.templates.first()) {
            let press = PressCapability::new(learner.ram_sigma(), die.opening, board.chord, board.limit);
            if press.is_too_coarse() {
                says.insert(0, press.words());
            }
        }
        says
    }
}

/// Planner and press of one plate.
struct Adviser<'a> {
    settings: &'a Settings,
    record: &'a PlateHistory,
    situation: &'a Situation,
    past: &'a Past,
    planner: Planner<'a>,
    /// Distance of the first and last line from the ends, metres.
    reach: f64,
    heights: DVector<f64>,
}

impl<'a> Adviser<'a> {
    fn new(
        settings: &'a Settings,
        record: &'a PlateHistory,
        situation: &'a Situation,
        past: &'a Past,
    ) -> Self {
        let reach = record.die.as_ref().map_or(0.2, |die| die.edge.max(0.5 * die.opening + 0.02));
        let planner = Planner::new(&situation.lines, &situation.boards, situation.side, reach);
        let heights = planner.heights();
        Self { settings, record, situation, past, planner, reach, heights }
    }

    fn next(&self) -> Advice {
        let Some(worst) = self.planner.worst(&self.heights) else {
            return cannot(CannotAdvise::NoTemplate);
        };
        let missing: f64 = self.planner.missing(&self.heights).iter().sum();
        let too_far = self.too_far();
        if self.is_too_far(&worst.gap) && worst.over > 0.0 && missing < TURN_OVER {
            return Advice { too_far, ..self.turn_over() };
        }
        let plan = self.plan();
        if let Some(says) = self.disagreement(&worst, &plan) {
            return Advice { says: vec![says], too_far, ..cannot(CannotAdvise::TemplatesDisagree) };
        }
        let plan = match plan.bends.is_empty() || plan.excess >= worst.excess {
            false => Some(plan),
            true => {
                let single = |free: &dyn Fn(usize) -> bool| {
                    self.planner.single(&self.heights, LEAST_BEND, self.settings.largest, free)
                };
                single(&|line| !self.is_old(line)).or_else(|| single(&|_| true))
            }
        };
        let Some(plan) = plan else {
            return match self.is_too_far(&worst.gap) {
                true => Advice { too_far, ..self.turn_over() },
                false => Advice { too_far, ..cannot(CannotAdvise::EdgeOutOfReach) },
            };
        };
        let next = self.choose(&plan);
        let (line, angle) = self.safe(plan.bends[next]);
        let bend = self.bend(line, angle);
        let n = u32::try_from(plan.bends.len()).unwrap_or(u32::MAX);
        let in_order = plan.bends[next..].iter().chain(&plan.bends[..next]);
        let planned = |&(line, angle): &(usize, f64)| self.ends(line).map(|line| PlannedBend { line, angle });
        Advice {
            strokes_left: Some([n, n + 2]),
            plan: in_order.filter_map(planned).collect(),
            too_far,
            model: self.past.learner.as_ref().map(|it| it.model(angle)),
            ..of(Step::Bend(bend))
        }
    }

    /// Returns whether a gap is on a plate that is bent too far.
    fn is_too_far(&self, gap: &Gap) -> bool {
        gap.hollow == (self.situation.side > 0.0)
    }

    /// Returns the places of the boards that are bent too far.
    fn too_far(&self) -> Vec<[f64; 2]> {
        let far = self.situation.boards.iter().filter_map(|board| {
            let gap = board.worst(&board.height);
            (self.is_too_far(&gap) && gap.gap > board.limit).then(|| board.place(gap.place))
        });
        far.collect()
    }

    fn turn_over(&self) -> Advice {
        if !self.record.may_turn_over {
            return cannot(CannotAdvise::BentTooFar);
        }
        match self.planner.reverse(&self.heights) {
            Some((line, angle)) => {
                let depth = self.past.learner.as_ref().filter(|_| self.depth_known());
                let sag = self.sag(self.planner.grid[line]);
                let mut bend = self.bend(line, angle);
                bend.depth = depth.map(|learner| learner.depth(-angle, -sag));
                bend.depth_not_beyond = None;
                Advice { strokes_left: Some([1, 3]), ..of(Step::TurnOver(bend)) }
            }
            None => cannot(CannotAdvise::BentTooFar),
        }
    }

    /// Returns a sentence when each board could be mended by whole lines, but not all by the same.
    fn disagreement(&self, worst: &Worst, plan: &Plan) -> Option<String> {
        let boards = &self.situation.boards;
        let helps = plan.excess < 0.7 * worst.excess;
        if boards.len() < 2 || helps || self.planner.least_excess(&self.heights) <= 0.0 {
            return None;
        }
        let alone = |board: &Board| {
            let planner = Planner::new(
                &self.situation.lines,
                std::slice::from_ref(board),
                self.situation.side,
                self.reach,
            );
            planner.least_excess(&planner.heights())
        };
        let board = &boards[worst.board];
        let bent = if self.is_too_far(&worst.gap) { "more bent" } else { "flatter" };
        boards.iter().all(|board| alone(board) <= 0.0).then(|| {
            format!(
                "under {} the plate is {bent} than under the other templates, by up to {:.1} mm of gap: no whole line mends it; shim the bed or tilt the ram",
                board.name,
                1e3 * worst.gap.gap
            )
        })
    }

    /// Returns whether a line lies on an old bend. The surface shows a sharp kink too round, so gaps beside a re-hit are less sure.
    fn is_old(&self, line: usize) -> bool {
        self.past.bends.iter().any(|(x, _)| (x - self.planner.grid[line]).abs() < FROM_OLD)
    }

    fn plan(&self) -> Plan {
        let reserve = |angle: f64| self.reserve(angle);
        let largest = self.settings.largest;
        let plan = self.planner.plan(&self.heights, largest, reserve, |line| !self.is_old(line));
        if plan.excess <= 0.0 {
            return plan;
        }
        let anywhere = self.planner.plan(&self.heights, largest, reserve, |_| true);
        if anywhere.excess < plan.excess { anywhere } else { plan }
    }

    /// Returns the index of the bend to make first: of those that are not small corrections, the first in the shop's order.
    fn choose(&self, plan: &Plan) -> usize {
        let mut angles: Vec<f64> = plan.bends.iter().map(|bend| bend.1).collect();
        angles.sort_by(f64::total_cmp);
        let median = angles[angles.len() / 2];
        let large = (0..plan.bends.len()).filter(|&k| plan.bends[k].1 >= 0.5 * median);
        let x = |k: usize| self.planner.grid[plan.bends[k].0];
        let length = self.situation.lines.length();
        let rank = |k: usize| match self.settings.order {
            Order::Onward => {
                let last = self.past.last.unwrap_or(0.0);
                if x(k) > last { x(k) - last } else { length + x(k) }
            }
            Order::EndsIn => x(k).min(length - x(k)),
        };
        large.reduce(|a, b| if rank(b) < rank(a) { b } else { a }).unwrap_or(0)
    }

    /// Returns a planned bend, smaller while the plate could not be finished if it came out larger than intended. Where even a small one is
    /// too much there, as near the end of a plate, it is the small bend anywhere that helps with the least hazard.
    fn safe(&self, (line, planned): (usize, f64)) -> (usize, f64) {
        let mut angle = planned.min(self.settings.largest * 1.03);
        let nothing_known = self.record.like.is_none() && self.record.strokes.is_empty();
        if nothing_known {
            angle *= CAUTIOUS;
        }
        if !self.settings.guard {
            return (line, angle.max(LEAST_BEND));
        }
        let finishes = |angle: f64| self.finishes(line, angle + GUARD * self.sigma(angle));
        while angle > LEAST_BEND {
            if finishes(angle) {
                return (line, angle);
            }
            angle *= 0.85;
        }
        match finishes(LEAST_BEND) {
            true => (line, LEAST_BEND),
            false => self.least_hazard().unwrap_or((line, LEAST_BEND)),
        }
    }

    /// Returns the smallest bend that lowers the largest gap and, if it came out larger than intended, bends the plate too far by the least;
    /// `None` where no such bend helps.
    fn least_hazard(&self) -> Option<(usize, f64)> {
        let now = self.planner.worst(&self.heights)?.excess;
        // Deeper after each stroke in a row that left no bend.
        let idle = self.record.strokes.iter().rev().take_while(|stroke| stroke.bends.is_empty()).count();
        let small = LEAST_ANGLE * (1.0 + 0.4 * idle as f64);
        let large = small + GUARD * self.sigma(small);
        let excess =
            |line: usize, angle: f64| self.planner.worst(&self.planner.bent(&self.heights, line, angle));
        let hazard = |line: usize| {
            let expected = excess(line, small)?.excess;
            let large = excess(line, large)?;
            let far = if self.is_too_far(&large.gap) { large.excess.max(0.0) } else { 0.0 };
            (expected < now).then_some(expected + far)
        };
        let least = |anywhere: bool| {
            let lines = (0..self.planner.grid.len()).filter(|line| anywhere || !self.is_old(*line));
            lines.filter_map(|line| Some((line, hazard(line)?))).min_by(|a, b| a.1.total_cmp(&b.1))
        };
        least(false).or_else(|| least(true)).map(|(line, _)| (line, small))
    }

    /// Returns whether the plate can still be finished by bends of one side after this one.
    fn finishes(&self, line: usize, angle: f64) -> bool {
        let before = self.planner.least_excess(&self.heights).max(0.0);
        let after = self.planner.bent(&self.heights, line, angle);
        self.planner.least_excess(&after) <= before
    }

    fn sigma(&self, angle: f64) -> f64 {
        match &self.past.learner {
            Some(learner) if self.depth_known() => learner.sigma(angle),
            _ => BY_EYE * angle,
        }
    }

    /// Returns whether a depth can be advised: the press tells its depth, or no stroke has been made yet.
    fn depth_known(&self) -> bool {
        self.past.learner.is_some() && (self.record.strokes.is_empty() || self.past.depth_told)
    }

    fn reserve(&self, angle: f64) -> f64 {
        RESERVE_SHARE * (angle * RESERVE[0]).hypot(RESERVE[1] * self.sigma(angle))
    }

    fn sag(&self, x: f64) -> f64 {
        let opening = self.record.die.as_ref().map_or(0.0, |die| die.opening);
        self.situation.sag(x, opening, &self.past.bends)
    }

    fn ends(&self, line: usize) -> Option<[[f64; 2]; 2]> {
        let off = self.past.learner.as_ref().map_or(0.0, Learner::off_mark);
        self.situation.lines.ends(self.planner.grid[line] - off)
    }

    fn bend(&self, line: usize, angle: f64) -> NextBend {
        let x = self.planner.grid[line];
        let (sigma, sag) = (self.sigma(angle.abs()), self.sag(x));
        let learner = self.past.learner.as_ref().filter(|_| self.depth_known());
        let [c, s] = self.situation.lines.direction(x);
        let (gap_after, board) = self.gap_after(line, angle, sigma);
        let board = &self.situation.boards[board];
        NextBend {
            line: self.ends(line).unwrap_or([[f64::NAN; 2]; 2]),
            direction: s.atan2(c).rem_euclid(std::f64::consts::PI),
            angle,
            angle_95: [angle - P95 * sigma, angle + P95 * sigma],
            depth: learner.map(|learner| learner.depth(angle.max(0.0), sag)),
            depth_not_beyond: learner.map(|learner| learner.depth(self.deepest(line, angle), sag)),
            gap_after,
            template: board.name.clone(),
            limit: board.limit,
        }
    }

    /// Returns the largest angle to intend whose 99 % value still lets the plate be finished.
    fn deepest(&self, line: usize, angle: f64) -> f64 {
        let finishes = |angle: f64| self.finishes(line, angle + GUARD * self.sigma(angle));
        let (mut low, mut high) = (angle, 2.0 * angle + 0.02);
        if finishes(high) {
            return high;
        }
        for _ in 0..8 {
            let middle = 0.5 * (low + high);
            if finishes(middle) { low = middle } else { high = middle }
        }
        low
    }

    /// Returns the largest gap after the bend: lower end of its interval, expected, upper end; and the board that it is expected under.
    fn gap_after(&self, line: usize, angle: f64, sigma: f64) -> ([f64; 3], usize) {
        let shift = (MISPLACED / (self.planner.grid.get(1).map_or(1.0, |x| x - self.planner.grid[0]))).ceil()
            as isize;
        let last = self.planner.grid.len() - 1;
        let worst = |angle: f64, shift: isize| {
            let line = line.saturating_add_signed(shift).min(last);
            self.planner.worst(&self.planner.bent(&self.heights, line, angle))
        };
        let middle = worst(angle, 0);
        let board = middle.map_or(0, |it| it.board);
        let mut gaps = [middle.map_or(0.0, |it| it.gap.gap); 3];
        for angle in [angle - P95 * sigma, angle, angle + P95 * sigma] {
            for shift in [-shift, 0, shift] {
                let gap = worst(angle, shift).map_or(0.0, |it| it.gap.gap);
                gaps = [gaps[0].min(gap), gaps[1], gaps[2].max(gap)];
            }
        }
        // A board on a far too flat plate may come to rest in either of two seats: which one, an error of the heights decides.
        let bent = self.planner.bent(&self.heights, line, angle);
        for (waves, sign) in [(1.0, 1.0), (1.0, -1.0), (2.0, 1.0), (2.0, -1.0)] {
            let gap =
                self.planner.worst(&self.planner.waved(&bent, waves, sign)).map_or(0.0, |it| it.gap.gap);
            gaps = [gaps[0].min(gap), gaps[1], gaps[2].max(gap)];
        }
        // Heights are linear in the angles to the second order alone.
        let known_to = |gap: f64| self.situation.boards[board].uncertainty + SECOND_ORDER * gap;
        let [low, gap, high] = gaps;
        ([(low - known_to(low)).max(0.0), gap, high + known_to(high)], board)
    }
}
