//! Next bend: the first line of the plan, guarded against bending too far, with its depth and intervals.
//!
//! | part | contents |
//! |---|---|
//! | `guard` | bends small enough that the plate can still be finished if they come out larger than intended |
//! | `outlook` | gap after a bend, with its interval |

mod guard;
mod outlook;

use nalgebra::DVector;
use platen_model::units::mm;
use platen_model::{Advice, CannotAdvise, NextBend, PlannedBend, PlateHistory, Sentence, Step, Verdict};

use crate::board::{Board, Gap};
use crate::learner::{LEAST_ANGLE, Learner, PLACE};
use crate::past::Past;
use crate::planner::{Plan, Planner, Worst};
use crate::remarks;
use crate::settings::{Order, Settings};
use crate::situation::Situation;
use crate::strain::angle_of_strain;

/// Half width of a 95 % interval, standard deviations.
const P95: f64 = 1.96;
/// Least distance of a new bend from an old one, metres, unless no other bend reaches the limit.
const FROM_OLD: f64 = 0.07;
/// Error of the place, metres, and arm of an error of the angle under a board, metres: one bend misplaced and
/// misjudged.
const RESERVE: [f64; 2] = [0.010, 0.5];
const RESERVE_SHARE: f64 = 0.45;
/// Smallest bend that is advised, radians: a smaller one can hardly be detected.
const LEAST_BEND: f64 = 1.6 * LEAST_ANGLE;
/// Missing turn (total bend angle) below which a plate that is bent too far is turned over, radians.
const TURN_OVER: f64 = 0.040;
/// Share that decides whether templates disagree: the plan leaves at least this share of the largest gap's excess over
/// the limit, or the best bends along whole lines leave an excess of this share of the limit.
const HELPS: f64 = 0.7;
const DISAGREES: f64 = 0.2;
/// Relative standard deviation of an angle on a press that does not report its depth.
const BY_EYE: f64 = 0.25;

/// Returns the advice after the last stroke of the history.
#[must_use]
pub fn advise(settings: &Settings, history: &PlateHistory, situation: &Situation) -> Advice {
    let past = match Past::new(settings, history, situation) {
        Ok(past) => past,
        Err(reason) => return cannot(reason),
    };
    let advice = if passes(history) {
        done()
    } else if history.task.supports_changed {
        cannot(CannotAdvise::SupportsChanged)
    } else if past.learner.as_ref().is_some_and(Learner::is_surprised) {
        cannot(CannotAdvise::PressUnlikeRecord)
    } else {
        Adviser::new(settings, history, situation, &past).next()
    };
    let says = [remarks::of_press(&past, history), advice.says, remarks::of_strokes(&past, history)].concat();
    let model = advice.model.or_else(|| {
        past.learner.as_ref().map(|it| it.model(0.5 * situation.lines.length(), settings.largest))
    });
    Advice { says, model, ..advice }
}

/// Returns whether the last scan has templates and every one of them passes.
pub(crate) fn passes(history: &PlateHistory) -> bool {
    !history.templates.is_empty() && history.templates.iter().all(|it| it.verdict == Verdict::Pass)
}

pub(crate) fn of(step: Step) -> Advice {
    Advice { step, strokes_left: None, plan: Vec::new(), too_far: Vec::new(), says: Vec::new(), model: None }
}

pub(crate) fn done() -> Advice {
    Advice { strokes_left: Some([0, 0]), ..of(Step::Done) }
}

pub(crate) fn cannot(reason: CannotAdvise) -> Advice {
    of(Step::Cannot { reason })
}

/// Returns the record of an advice that was not ready at the next stroke.
#[must_use]
pub fn too_late() -> Advice {
    cannot(CannotAdvise::TooLate)
}

/// Planner and press of one plate.
struct Adviser<'a> {
    settings: &'a Settings,
    history: &'a PlateHistory,
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
        history: &'a PlateHistory,
        situation: &'a Situation,
        past: &'a Past,
    ) -> Self {
        let reach = history.die.as_ref().map_or(0.2, |die| die.edge.max(0.5 * die.opening + 0.02));
        let planner = Planner::new(&situation.lines, &situation.boards, situation.side, reach);
        let heights = planner.heights();
        Self { settings, history, situation, past, planner, reach, heights }
    }

    /// Returns the next bend of the plan, or the reason why there is none.
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
                single(&|line| self.is_free(line)).or_else(|| single(&|line| self.may_bend(line)))
            }
        };
        let Some(plan) = plan else {
            return match self.is_too_far(&worst.gap) {
                true => Advice { too_far, ..self.turn_over() },
                false => Advice { too_far, ..cannot(self.nowhere()) },
            };
        };
        let next = self.choose(&plan);
        let (line, angle) = self.safe(plan.bends[next]);
        let angle = angle.min(self.angle_left(line));
        let Some(bend) = self.bend(line, angle) else { return cannot(CannotAdvise::EdgeOutOfReach) };
        let n = u32::try_from(plan.bends.len()).unwrap_or(u32::MAX);
        let in_order = plan.bends[next..].iter().chain(&plan.bends[..next]);
        let planned = |&(line, angle): &(usize, f64)| self.ends(line).map(|line| PlannedBend { line, angle });
        let coarse = self.past.press(self.history).is_some_and(|press| press.is_too_coarse());
        let re_hit = self.is_old(line).then(|| Sentence::new(remarks::RE_HIT, &[]));
        let flatten = too_far.first().map(|at| {
            let [u, v] = at.map(|it| format!("{:.0}", mm(it)));
            Sentence::new(remarks::FLATTEN_LAST, &[&u, &v])
        });
        Advice {
            // On a press that is too coarse the next strokes cannot be predicted.
            strokes_left: (!coarse).then_some([n, n + 2]),
            plan: in_order.filter_map(planned).collect(),
            too_far,
            says: flatten.into_iter().chain(re_hit).collect(),
            model: self.past.learner.as_ref().map(|it| it.model(self.planner.grid[line], angle)),
            ..of(Step::Bend(bend))
        }
    }

    /// Returns whether a gap is on a plate that is bent too far.
    fn is_too_far(&self, gap: &Gap) -> bool {
        gap.hollow == (self.situation.side > 0.0)
    }

    /// Returns the worst place under each board that is bent too far, also where the plate is flatter elsewhere under
    /// the same board.
    fn too_far(&self) -> Vec<[f64; 2]> {
        let far = self.situation.boards.iter().filter_map(|board| {
            let far = board.gaps(&board.height).filter(|gap| self.is_too_far(gap) && gap.gap > board.limit);
            far.reduce(|a, b| if b.gap > a.gap { b } else { a }).map(|gap| board.place(gap.place))
        });
        far.collect()
    }

    /// Returns the reverse bend that helps most, where the plate may be turned over.
    fn turn_over(&self) -> Advice {
        if !self.history.may_turn_over {
            return cannot(CannotAdvise::BentTooFar);
        }
        let back = self.planner.reverse(&self.heights);
        let Some((mut bend, line)) = back.and_then(|(line, angle)| Some((self.bend(line, angle)?, line)))
        else {
            return cannot(CannotAdvise::BentTooFar);
        };
        let sag = self.sag(self.planner.grid[line]);
        bend.depth =
            self.depth_law().map(|learner| learner.depth(self.planner.grid[line], -bend.angle, -sag));
        bend.depth_not_beyond = None;
        Advice { strokes_left: Some([1, 3]), ..of(Step::TurnOver(bend)) }
    }

    /// Returns a sentence when each board could be mended by whole lines, but not all by the same.
    fn disagreement(&self, worst: &Worst, plan: &Plan) -> Option<Sentence> {
        let boards = &self.situation.boards;
        let left = self.planner.least_excess(&self.heights);
        let helps = plan.excess < HELPS * worst.excess && left < DISAGREES * boards[worst.board].limit;
        if boards.len() < 2 || helps || left <= 0.0 {
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
        let texts = if self.is_too_far(&worst.gap) { remarks::MORE_BENT } else { remarks::FLATTER };
        let gap = format!("{:.1}", mm(worst.gap.gap));
        boards.iter().all(|board| alone(board) <= 0.0).then(|| Sentence::new(texts, &[&board.name, &gap]))
    }

    /// Returns whether a line lies on an old bend. The fitted surface rounds a sharp kink, so that gaps beside a re-hit
    /// are less certain.
    fn is_old(&self, line: usize) -> bool {
        self.past.bends.iter().any(|(x, _)| (x - self.planner.grid[line]).abs() < FROM_OLD)
    }

    /// Returns the angle that the face along a line can still take, radians.
    fn angle_left(&self, line: usize) -> f64 {
        let (x, thickness) = (self.planner.grid[line], self.history.task.thickness);
        let beside = self.past.bends.iter().filter(|(at, _)| (at - x).abs() < thickness);
        let bent: f64 = beside.map(|(_, angle)| angle.abs()).sum();
        let radius = self.history.die.as_ref().and_then(|die| die.punch_radius);
        angle_of_strain(thickness, radius.unwrap_or(0.0), self.settings.strain) - bent
    }

    /// Returns whether the face along a line can take another bend.
    fn may_bend(&self, line: usize) -> bool {
        self.angle_left(line) >= LEAST_BEND
    }

    /// Returns whether a line can be bent and lies on no old bend.
    fn is_free(&self, line: usize) -> bool {
        !self.is_old(line) && self.may_bend(line)
    }

    /// Returns why no line can be bent.
    fn nowhere(&self) -> CannotAdvise {
        let any = self.planner.single(&self.heights, LEAST_BEND, self.settings.largest, &|_| true);
        if any.is_some() { CannotAdvise::StrainReached } else { CannotAdvise::EdgeOutOfReach }
    }

    /// Returns the plan with the fewest bends, on old bends only where no other reaches the limit.
    fn plan(&self) -> Plan {
        let reserve = |angle: f64| self.reserve(angle);
        let largest = self.settings.largest;
        let plan = self.planner.plan(&self.heights, largest, reserve, |line| self.is_free(line));
        if plan.excess <= 0.0 {
            return plan;
        }
        let anywhere = self.planner.plan(&self.heights, largest, reserve, |line| self.may_bend(line));
        if anywhere.excess < plan.excess { anywhere } else { plan }
    }

    /// Returns the index of the bend to make first: of those that are not small corrections, the first in the shop's
    /// order.
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

    /// Returns the standard deviation of the angle that a stroke for `angle` along a line leaves, radians.
    fn sigma(&self, line: usize, angle: f64) -> f64 {
        self.depth_law().map_or(BY_EYE * angle, |learner| learner.sigma(self.planner.grid[line], angle))
    }

    /// Returns the standard deviation of the place of a bend about its line, metres.
    fn place_sigma(&self) -> f64 {
        self.past.learner.as_ref().map_or(PLACE.0, Learner::place_sigma)
    }

    /// Returns the learned depth law where a depth can be advised: over a known die, on a press that reports its depth.
    fn depth_law(&self) -> Option<&Learner> {
        let reported = self.history.strokes.is_empty() || self.past.depth_reported;
        self.past.learner.as_ref().filter(|_| self.history.tells_depth && reported)
    }

    /// Returns the distance from the limit that a bend of this angle must keep, metres: the effect under a board of its
    /// errors of place and angle, beside the last bend, where the next bends lie.
    fn reserve(&self, angle: f64) -> f64 {
        let x = self.past.last.unwrap_or(0.5 * self.situation.lines.length());
        let sigma = self.depth_law().map_or(BY_EYE * angle, |learner| learner.sigma_beside(x, angle));
        RESERVE_SHARE * (angle * RESERVE[0]).hypot(RESERVE[1] * sigma)
    }

    /// Returns the sag of the plate at x in the die, metres.
    fn sag(&self, x: f64) -> f64 {
        let opening = self.history.die.as_ref().map_or(0.0, |die| die.opening);
        self.situation.sag(x, opening, &self.past.bends)
    }

    /// Returns the ends of the line to be pressed, offset from the wanted line by the mean distance of the bends from
    /// their lines, in the opposite direction.
    fn ends(&self, line: usize) -> Option<[[f64; 2]; 2]> {
        let off = self.past.learner.as_ref().map_or(0.0, Learner::off_mark);
        self.situation.lines.ends(self.planner.grid[line] - off)
    }

    /// Returns the bend along a line with its depth and intervals; `None` where the line to be pressed misses the
    /// plate.
    fn bend(&self, line: usize, angle: f64) -> Option<NextBend> {
        let x = self.planner.grid[line];
        let (sigma, sag) = (self.sigma(line, angle.abs()), self.sag(x));
        let learner = self.depth_law();
        let [c, s] = self.situation.lines.direction(x);
        let (gap_after, board) = self.gap_after(line, angle, sigma);
        let board = &self.situation.boards[board];
        Some(NextBend {
            line: self.ends(line)?,
            direction: s.atan2(c).rem_euclid(std::f64::consts::PI),
            angle,
            angle_95: [angle - P95 * sigma, angle + P95 * sigma],
            place_95: Some(P95 * self.place_sigma()),
            depth: learner.map(|learner| learner.depth(x, angle.max(0.0), sag)),
            depth_not_beyond: learner.map(|learner| learner.depth(x, self.deepest(line, angle), sag)),
            gap_after,
            template: board.name.clone(),
            limit: board.limit,
        })
    }
}
