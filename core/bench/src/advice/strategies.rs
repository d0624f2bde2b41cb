//! Bending strategies of the study: the advice, complete or with parts removed, and four strategies of a shop.
//!
//! A shop sees the same gaps and the same map of missing curvature. It has a depth table that is exact for the mean
//! steel, and sees the sag of the plate in the die. It presses deeper where a stroke had no effect, and turns a plate
//! over where it is bent too far.

use std::time::{Duration, Instant};

use platen_advice::board::{Board, Gap};
use platen_advice::press_law::PressLaw;
use platen_advice::{Order as Onward, Settings, Situation, advise};
use platen_model::{
    Bend, Die, LikePlates, PlateHistory, PressModel, PressedStroke, Seat, Steel, Step, TemplateFinding,
    Verdict, WantedBend,
};
use platen_sim_plate::{FibreSteel, FibreStrip};

use super::hidden_plate::{HiddenPlate, OPENING, Order, Pressed, Scan, Shop, THICKNESS, UNCERTAINTY, YIELD};

/// Number of strokes after which a plate is given up.
pub(super) const GIVEN_UP: usize = 60;

/// Strategy for bending a plate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Strategy {
    /// Two passes of 60 and 85 %, then half of the closing angle beside the largest gap.
    TwoPassesGap,
    /// Two passes of 60 and 85 %, then the worst place of the map.
    TwoPassesMap,
    /// One pass, then the worst place of the map.
    OnePassMap,
    /// The same, with the depth corrected by hand after each stroke.
    ByHand,
    /// The advice.
    Advice(Advised),
}

/// Advice without some of its parts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Advised {
    /// Largest bend, given as the feed at which the target has it, metres.
    pub(super) feed: f64,
    /// Starts from earlier plates of the same class.
    pub(super) like: bool,
    /// Learns from strokes.
    pub(super) learns: bool,
    /// The press reports its depth.
    pub(super) depth: bool,
    /// Limits a bend so that the plate is not bent too far.
    pub(super) guard: bool,
    /// Plans again after each stroke.
    pub(super) replans: bool,
}

impl Default for Advised {
    fn default() -> Self {
        Self { feed: 0.3, like: true, learns: true, depth: true, guard: true, replans: true }
    }
}

impl Strategy {
    pub(super) fn name(&self) -> String {
        match self {
            Self::TwoPassesGap => "two passes, rule of the largest gap".into(),
            Self::TwoPassesMap => "two passes, map".into(),
            Self::OnePassMap => "one pass, map".into(),
            Self::ByHand => "one pass, map, depth by hand".into(),
            Self::Advice(it) => {
                let whole = Advised { feed: it.feed, ..Advised::default() };
                let part = match () {
                    () if *it == whole => "",
                    () if !it.like => ", no like plates",
                    () if !it.learns => ", never learns",
                    () if !it.depth => ", depth not reported",
                    () if !it.guard => ", no guard",
                    () => ", first plan kept",
                };
                format!("advice, feed {:.0} mm{part}", 1e3 * it.feed)
            }
        }
    }

    pub(super) fn of_shops() -> [Self; 4] {
        [Self::TwoPassesGap, Self::TwoPassesMap, Self::OnePassMap, Self::ByHand]
    }

    /// Returns variants of the advice, each without one of its parts.
    pub(super) fn parts() -> Vec<Self> {
        let whole = Advised::default();
        let without = [
            whole,
            Advised { like: false, ..whole },
            Advised { learns: false, ..whole },
            Advised { replans: false, ..whole },
            Advised { depth: false, ..whole },
            Advised { guard: false, ..whole },
        ];
        without.map(Self::Advice).to_vec()
    }
}

/// Outcome for one plate.
#[derive(Debug, Clone, Default)]
pub(super) struct Outcome {
    pub(super) strokes: usize,
    pub(super) turned_over: usize,
    pub(super) too_far: bool,
    pub(super) finished: bool,
    /// True gap at the end, metres.
    pub(super) gap: f64,
    /// Advised strokes with an outcome inside their intervals, and all advised strokes: angle, gap, angle of the third
    /// stroke.
    pub(super) inside: [(usize, usize); 3],
    pub(super) not_advised: usize,
    pub(super) said_too_coarse: bool,
    pub(super) said_look: bool,
    /// Depth law of the press as learned.
    pub(super) model: Option<PressModel>,
    pub(super) advise: Duration,
}

/// Depth table of a shop: angle and depth on a flat plate of the mean steel.
pub(super) struct DepthTable(Vec<[f64; 2]>);

impl DepthTable {
    pub(super) fn new() -> Self {
        let steel = FibreSteel { yield_strength: YIELD, thickness: THICKNESS };
        let strip = FibreStrip::new(0.6, |_| steel, |_| 0.0);
        let press = HiddenPlate::press_of_shop();
        let angles = (0..=20).map(|k| 1e-3 * f64::from(2 + 3 * k));
        Self(angles.map(|angle| [angle, strip.depth_for(&press, 0.3, angle)]).collect())
    }

    fn depth(&self, angle: f64) -> f64 {
        let k = self.0.partition_point(|[at, _]| *at < angle).clamp(1, self.0.len() - 1);
        let ([a, d], [b, e]) = (self.0[k - 1], self.0[k]);
        d + (angle - a) / (b - a) * (e - d)
    }
}

/// Returns the depth law of the orders' steel and die.
pub(super) fn law() -> PressLaw {
    let steel = Steel { grade: None, yield_strength: YIELD, heat: None };
    PressLaw::new(&die(), &steel, THICKNESS)
}

fn die() -> Die {
    Die { id: 1, opening: OPENING, edge: 0.2, punch_radius: None }
}

/// Bends one plate.
pub(super) fn bend(
    strategy: Strategy,
    order: &Order,
    shop: &Shop,
    seed: u64,
    table: &DepthTable,
    like: Option<&LikePlates>,
) -> Outcome {
    let plate = HiddenPlate::new(order, shop, seed);
    let outcome = Outcome::default();
    let mut job = Job { order, shop, plate, table, outcome, strokes: Vec::new(), correction: 0.0 };
    match strategy {
        Strategy::Advice(advised) => job.by_advice(advised, like),
        _ => job.by_shop(strategy),
    }
    let boards = job.plate.boards();
    job.outcome.gap = worst(&boards).0.gap;
    job.outcome
}

/// Plate in progress.
struct Job<'a> {
    order: &'a Order,
    shop: &'a Shop,
    plate: HiddenPlate<'a>,
    table: &'a DepthTable,
    outcome: Outcome,
    /// Strokes in the form of the record.
    strokes: Vec<PressedStroke>,
    /// Depth that the operator adds to the table, metres.
    correction: f64,
}

impl Job<'_> {
    fn stroke(&mut self, x: f64, depth: f64, backwards: bool) -> Pressed {
        let pressed = self.plate.press(x, depth, backwards);
        self.outcome.strokes += 1;
        self.outcome.turned_over += usize::from(backwards);
        let (gap, board) = worst(&self.plate.boards());
        self.outcome.too_far |= gap.hollow && gap.gap > self.order.task.templates[board].limit;
        let stroke = self.on_record(&pressed);
        self.strokes.push(stroke);
        pressed
    }

    /// Presses for an angle by the table. The operator corrects the depth after each stroke if `corrects`, else only
    /// after a stroke without effect.
    fn by_table(&mut self, x: f64, angle: f64, corrects: bool) {
        let backwards = angle < 0.0;
        let sag = if backwards { -self.plate.sag(x) } else { self.plate.sag(x) };
        let depth = self.table.depth(angle.abs()) + sag + self.correction;
        // The offset of the die is known in a shop.
        let pressed = self.stroke(x - self.shop.off_mark, depth, backwards);
        if corrects && !backwards {
            let off = (angle - pressed.angle).clamp(-0.02, 0.02);
            self.correction += 0.7 * off * 0.25 * OPENING;
        } else if pressed.seen.is_none() {
            self.correction += 0.5e-3;
        }
    }

    /// Bends the plate by a shop's strategy. The press is learned from its strokes in shadow mode, from a flat blank.
    fn by_shop(&mut self, strategy: Strategy) {
        self.by_habit(strategy);
        let scan = self.plate.scan();
        let situation = situation(self.order, &scan, Vec::new());
        let history = self.history(&situation.boards, true);
        self.outcome.model = advise(&settings(self.order, &Advised::default()), &history, &situation).model;
    }

    fn by_habit(&mut self, strategy: Strategy) {
        let passes: &[f64] = match strategy {
            Strategy::TwoPassesGap | Strategy::TwoPassesMap => &[0.6, 0.85],
            _ => &[1.0],
        };
        let corrects = strategy == Strategy::ByHand;
        let length = self.order.lines.length();
        let n = ((length - 0.4) / 0.2).round() as usize;
        for (k, share) in passes.iter().enumerate() {
            let done = if k > 0 { passes[k - 1] } else { 0.0 };
            for i in 0..=n {
                let x = 0.2 + (length - 0.4) * i as f64 / n as f64;
                // A half-bent plate is pressed where it is flat.
                let scan = self.plate.scan();
                let missing = share * self.order.curvature() - mean_curvature(&scan, x, 0.1);
                if missing > 0.3 * (share - done) * self.order.curvature() {
                    self.by_table(x, (share - done) * self.order.curvature() * 0.2, corrects);
                }
            }
        }
        while self.outcome.strokes < GIVEN_UP {
            let scan = self.plate.scan();
            let boards = self.order.boards(&|x| scan.curvature(x));
            let (gap, board) = worst(&boards);
            if gap.gap + UNCERTAINTY <= self.order.task.templates[board].limit {
                self.outcome.finished = true;
                return;
            }
            let closing = 4.0 * gap.gap / boards[board].chord();
            let at = self.order.lines.coordinate(boards[board].place(gap.place));
            let edge = |x: f64| x.clamp(0.2, length - 0.2);
            match (gap.hollow, strategy) {
                (true, _) => self.by_table(edge(at), -(0.5 * closing).clamp(6e-3, 0.03), corrects),
                (false, Strategy::TwoPassesGap) => {
                    let x = 0.5 * (at + 0.5 * length);
                    self.by_table(edge(x), (0.5 * closing).clamp(6e-3, 0.03), corrects);
                }
                (false, _) => {
                    let x = self.place_of_map(&scan);
                    self.by_table(x, (0.7 * closing).clamp(6e-3, 0.03), corrects);
                }
            }
        }
    }

    /// Returns the place where most curvature is missing, averaged over half a metre.
    fn place_of_map(&self, scan: &Scan) -> f64 {
        let length = self.order.lines.length();
        let n = ((length - 0.4) / 0.05) as usize;
        let places = (0..=n).map(|k| 0.2 + 0.05 * k as f64);
        let lacking = |x: &f64| mean_curvature(scan, *x, 0.25);
        places.reduce(|a, b| if lacking(&b) < lacking(&a) { b } else { a }).unwrap_or(0.5 * length)
    }

    fn by_advice(&mut self, advised: Advised, like: Option<&LikePlates>) {
        let settings = settings(self.order, &advised);
        let blank = blank_curvature(&self.plate.scan(), self.order);
        let mut kept: Option<Vec<(f64, f64)>> = None;
        while self.outcome.strokes < GIVEN_UP {
            let scan = self.plate.scan();
            let situation = situation(self.order, &scan, blank.clone());
            let like = like.copied().filter(|_| advised.like);
            let history = PlateHistory { like, ..self.history(&situation.boards, advised.depth) };
            let start = Instant::now();
            let advice = advise(&settings, &history, &situation);
            self.outcome.advise += start.elapsed();
            self.outcome.said_too_coarse |= advice.says.iter().any(|says| says.en.contains("too coarse"));
            self.outcome.said_look |= advice.says.iter().any(|says| says.en.contains("check its thickness"));
            self.outcome.model = advice.model.or(self.outcome.model);
            let (next, backwards) = match advice.step {
                Step::Done => {
                    self.outcome.finished = true;
                    return;
                }
                Step::Bend(next) => (next, false),
                Step::TurnOver(next) => (next, true),
                Step::Place { .. } | Step::Cannot { .. } => {
                    // Without advice the operator presses at the worst place of the map.
                    self.outcome.not_advised += 1;
                    let x = self.place_of_map(&scan);
                    let gap = worst(&situation.boards).0;
                    let angle = (0.35 * 4.0 * gap.gap / 2.0).clamp(6e-3, 0.03);
                    let depth = self.table.depth(angle) + self.plate.sag(x);
                    self.stroke(x, depth, false);
                    continue;
                }
            };
            let middle = [0, 1].map(|k| 0.5 * (next.line[0][k] + next.line[1][k]));
            let (mut x, mut angle, mut depth) = (self.order.lines.coordinate(middle), next.angle, next.depth);
            if !advised.replans && !backwards {
                let plan = kept.get_or_insert_with(|| {
                    let line = |bend: &platen_model::PlannedBend| {
                        let middle = [0, 1].map(|k| 0.5 * (bend.line[0][k] + bend.line[1][k]));
                        (self.order.lines.coordinate(middle), bend.angle)
                    };
                    advice.plan.iter().rev().map(line).collect()
                });
                if let Some(planned) = plan.pop() {
                    (x, angle) = planned;
                    depth = platen_advice::depth_at(&settings, &history, &situation, x, angle);
                }
            }
            let depth_wanted = depth.filter(|_| advised.depth).unwrap_or_else(|| {
                // Depth by the table, corrected by hand.
                self.table.depth(angle.abs()) + self.plate.sag(x) + self.correction
            });
            let pressed = self.stroke(x, depth_wanted, backwards);
            if !advised.depth {
                self.correction += 0.7 * (angle - pressed.angle).clamp(-0.02, 0.02) * 0.25 * OPENING;
            }
            let wanted = WantedBend { at: middle, angle, depth: depth.filter(|_| advised.depth) };
            // A stroke that stopped before its depth does not test an interval that is given for the wanted depth.
            let short = pressed.reported < depth_wanted - 0.5e-3;
            if !backwards && !short && advised.replans {
                let [angles, gaps, third] = &mut self.outcome.inside;
                let inside = usize::from((next.angle_95[0]..=next.angle_95[1]).contains(&pressed.angle));
                *angles = (angles.0 + inside, angles.1 + 1);
                if self.outcome.strokes == 3 {
                    *third = (inside, 1);
                }
                let gap = worst(&self.plate.boards()).0.gap;
                gaps.1 += 1;
                gaps.0 += usize::from((next.gap_after[0]..=next.gap_after[2]).contains(&gap));
            }
            if let Some(stroke) = self.strokes.last_mut() {
                stroke.wanted = Some(wanted);
            }
        }
    }

    /// Returns the history of the plate so far, with the present state of its templates, on a press that reports its
    /// depth or does not.
    fn history(&self, boards: &[Board], tells_depth: bool) -> PlateHistory {
        let depth = |stroke: &PressedStroke| stroke.depth.filter(|_| tells_depth);
        PlateHistory {
            task: self.order.task.clone(),
            templates: boards.iter().map(finding).collect(),
            die: Some(die()),
            steel: Some(Steel { grade: None, yield_strength: YIELD, heat: None }),
            strokes: self
                .strokes
                .iter()
                .map(|stroke| PressedStroke { depth: depth(stroke), ..stroke.clone() })
                .collect(),
            like: None,
            may_turn_over: true,
            tells_depth,
        }
    }

    /// Returns a stroke pressed without advice, in the form of the record.
    fn on_record(&self, pressed: &Pressed) -> PressedStroke {
        let bend = |[x, angle]: [f64; 2]| {
            let x = x.clamp(0.0, self.order.lines.length());
            let ends = self.order.lines.ends(x).unwrap_or([[x, 0.0]; 2]);
            let [c, s] = self.order.lines.direction(x);
            Bend {
                at: [0, 1].map(|k| 0.5 * (ends[0][k] + ends[1][k])),
                direction: s.atan2(c),
                angle,
                sigma: 0.3e-3,
            }
        };
        PressedStroke {
            depth: Some(pressed.reported),
            bends: pressed.seen.map(bend).into_iter().collect(),
            ..PressedStroke::default()
        }
    }
}

/// Returns the settings of a shop that bends by this advice.
pub(super) fn settings(order: &Order, advised: &Advised) -> Settings {
    Settings {
        largest: (order.curvature() * advised.feed).min(3.0_f64.to_radians()),
        // The default of `line-bends`.
        strain: 0.05,
        order: Onward::Onward,
        guard: advised.guard,
        learns: advised.learns,
    }
}

/// Returns the plate as measured by a scan.
fn situation(order: &Order, scan: &Scan, blank: Vec<f64>) -> Situation {
    Situation { lines: order.lines, boards: order.boards(&|x| scan.curvature(x)), side: 1.0, blank }
}

/// Returns the largest gap and its template.
fn worst(boards: &[Board]) -> (Gap, usize) {
    let each = boards.iter().enumerate().map(|(k, board)| (board.worst(board.height()), k));
    let worst = each.reduce(|a, b| if b.0.gap > a.0.gap { b } else { a });
    worst.unwrap_or((Gap { gap: 0.0, hollow: false, place: 0 }, 0))
}

/// Returns the finding of a template in the form of the comparison `template`.
fn finding(board: &Board) -> TemplateFinding {
    let gap = board.worst(board.height());
    let passes = gap.gap + UNCERTAINTY <= board.limit;
    TemplateFinding {
        name: board.name.clone(),
        line: String::new(),
        seat: Seat::Gravity,
        rocks: false,
        max_gap: gap.gap,
        uncertainty: UNCERTAINTY,
        max_gap_at: board.place(gap.place),
        contacts: Vec::new(),
        start: 0.0,
        gap: Vec::new(),
        limit: board.limit,
        sense: if passes {
            0
        } else if gap.hollow {
            1
        } else {
            -1
        },
        verdict: if passes { Verdict::Pass } else { Verdict::Fail },
        says: String::new(),
    }
}

fn blank_curvature(scan: &Scan, order: &Order) -> Vec<f64> {
    let n = (order.lines.length() / platen_advice::board::STEP).round() as usize;
    (0..=n).map(|k| scan.curvature(platen_advice::board::STEP * k as f64)).collect()
}

fn mean_curvature(scan: &Scan, x: f64, half: f64) -> f64 {
    (0..=10).map(|k| scan.curvature(x - half + 0.2 * half * f64::from(k))).sum::<f64>() / 11.0
}
