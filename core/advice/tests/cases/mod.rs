//! Plates of one curvature profile between two strokes, for the tests of the advice.
#![allow(dead_code, reason = "each test binary uses its share")]

use platen_advice::bend_lines::BendLines;
use platen_advice::board::Board;
use platen_advice::{Advice, Order, Settings, Situation, advise};
use platen_model::{
    Bend, Centre, Die, Facing, LikePlates, PlateHistory, PressedStroke, RadiusOf, ReferenceLine, Seat, Steel,
    Target, TargetShape, Task, Template, TemplateFinding, Verdict,
};

/// A plate that is bent to a cylinder along v.
pub(crate) struct Case {
    /// Extent along u, across the bends, metres.
    pub(crate) width: f64,
    /// Radius of the target, metres.
    pub(crate) radius: f64,
    /// Places of the boards along v, metres.
    pub(crate) boards: Vec<f64>,
    pub(crate) settings: Settings,
    pub(crate) die: Option<Die>,
    pub(crate) steel: Option<Steel>,
    pub(crate) strokes: Vec<PressedStroke>,
    pub(crate) like: Option<LikePlates>,
    pub(crate) may_turn_over: bool,
    pub(crate) tells_depth: bool,
    pub(crate) supports_changed: bool,
}

impl Default for Case {
    /// Returns a plate of 3 m at a radius of 9 m with one board in the middle and no stroke yet.
    fn default() -> Self {
        Self {
            width: 3.0,
            radius: 9.0,
            boards: vec![1.25],
            settings: Settings {
                largest: 0.033,
                strain: 0.05,
                order: Order::EndsIn,
                guard: true,
                learns: true,
            },
            die: Some(Die { id: 1, opening: 0.36, edge: 0.2, punch_radius: None }),
            steel: Some(Steel { grade: None, yield_strength: 440e6, heat: None }),
            strokes: Vec::new(),
            like: None,
            may_turn_over: false,
            tells_depth: true,
            supports_changed: false,
        }
    }
}

impl Case {
    fn task(&self) -> Task {
        let line = |(k, v): (usize, &f64)| ReferenceLine {
            name: format!("L{k}"),
            from: [0.0, *v],
            to: [self.width, *v],
        };
        let reference_lines: Vec<ReferenceLine> = self.boards.iter().enumerate().map(line).collect();
        let template = |line: &ReferenceLine| Template {
            name: line.name.replace('L', "T"),
            line: line.name.clone(),
            chord: 2.0,
            centre: Centre::Worst,
            limit: 3e-3,
            seat: Seat::Gravity,
            source: None,
        };
        Task {
            plate: "P".into(),
            width: self.width,
            height: 2.5,
            thickness: 0.036,
            target: Some(Target {
                shape: TargetShape::Cylinder { radius: self.radius, axis: std::f64::consts::FRAC_PI_2 },
                radius_of: RadiusOf::Mid,
                scanned_face: Facing::Inside,
            }),
            templates: reference_lines.iter().map(template).collect(),
            reference_lines,
            stations: Vec::new(),
            sigma_correlated: 0.0,
            sigma_true: None,
            supports: Vec::new(),
            supports_changed: self.supports_changed,
        }
    }

    /// Returns the advice on a plate with this curvature across its lines at (u, v), 1/m.
    pub(crate) fn advice(&self, curvature: impl Fn(f64, f64) -> f64) -> Advice {
        let task = self.task();
        let lines = BendLines::of_task(&task).unwrap();
        let board = |template: &Template| {
            let line = task.reference_lines.iter().find(|line| line.name == template.line).unwrap();
            let difference = |_, [u, v]: [f64; 2]| curvature(u, v) - 1.0 / self.radius;
            Board::new(template, 0.2e-3, line.from, line.to, difference)
        };
        let boards: Vec<Board> = task.templates.iter().map(board).collect();
        let history = PlateHistory {
            templates: boards.iter().map(finding).collect(),
            die: self.die.clone(),
            steel: self.steel.clone(),
            strokes: self.strokes.clone(),
            like: self.like,
            may_turn_over: self.may_turn_over,
            tells_depth: self.tells_depth,
            task,
        };
        let situation = Situation { lines, boards, side: 1.0, blank: Vec::new() };
        advise(&self.settings, &history, &situation)
    }
}

/// Returns the finding of a board, as given by the comparison `template`.
fn finding(board: &Board) -> TemplateFinding {
    let gap = board.worst(board.height());
    let passes = gap.gap + board.uncertainty <= board.limit;
    TemplateFinding {
        name: board.name.clone(),
        line: board.name.replace('T', "L"),
        seat: Seat::Gravity,
        rocks: false,
        max_gap: gap.gap,
        uncertainty: board.uncertainty,
        max_gap_at: board.place(gap.place),
        contacts: Vec::new(),
        start: 0.0,
        gap: Vec::new(),
        limit: board.limit,
        sense: if passes { 0 } else { -1 },
        verdict: if passes { Verdict::Pass } else { Verdict::Fail },
        says: String::new(),
    }
}

/// Returns a stroke of this depth that left a bend across u at (u, angle).
pub(crate) fn stroke(u: f64, angle: f64, depth: f64) -> PressedStroke {
    let bend = Bend { at: [u, 1.25], direction: std::f64::consts::FRAC_PI_2, angle, sigma: 0.3e-3 };
    PressedStroke { depth: Some(depth), bends: vec![bend], ..PressedStroke::default() }
}

/// Returns the curvature of bends (u, angle), each 0.1 m long, 1/m.
pub(crate) fn bends(bends: &[[f64; 2]]) -> impl Fn(f64, f64) -> f64 {
    move |u, _| bends.iter().filter(|[at, _]| (u - at).abs() < 0.05).map(|[_, angle]| angle / 0.1).sum()
}
