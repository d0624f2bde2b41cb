//! Properties of the advice on plates of one curvature profile: mirrored plates get mirrored advice, finished ones "enough".
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

use platen_advice::bend_lines::BendLines;
use platen_advice::board::Board;
use platen_advice::{Advice, Order, Settings, Situation, advise};
use platen_model::{
    Centre, Die, Facing, PlateHistory, RadiusOf, ReferenceLine, Seat, Steel, Step, Target, TargetShape, Task,
    Template, TemplateFinding, Verdict,
};

const WIDTH: f64 = 3.0;
const HEIGHT: f64 = 2.5;
const RADIUS: f64 = 9.0;
const SETTINGS: Settings = Settings { largest: 0.033, order: Order::EndsIn, guard: true, learns: true };

fn task() -> Task {
    Task {
        plate: "P".into(),
        width: WIDTH,
        height: HEIGHT,
        thickness: 0.036,
        target: Some(Target {
            shape: TargetShape::Cylinder { radius: RADIUS, axis: std::f64::consts::FRAC_PI_2 },
            radius_of: RadiusOf::Mid,
            scanned_face: Facing::Inside,
        }),
        reference_lines: vec![ReferenceLine { name: "L".into(), from: [0.0, 1.25], to: [WIDTH, 1.25] }],
        templates: vec![Template {
            name: "T".into(),
            line: "L".into(),
            chord: 2.0,
            centre: Centre::Worst,
            limit: 3e-3,
            seat: Seat::Gravity,
            source: None,
        }],
        stations: Vec::new(),
        sigma_correlated: 0.0,
        sigma_true: None,
        supports: Vec::new(),
        supports_changed: false,
    }
}

/// Advice on a plate with this curvature across its lines, 1/m.
fn advice_on(curvature: impl Fn(f64) -> f64) -> Advice {
    let task = task();
    let lines = BendLines::of_task(&task).unwrap();
    let board = Board::new(&task.templates[0], 0.2e-3, [0.0, 1.25], [WIDTH, 1.25], |x, _| {
        curvature(x) - 1.0 / RADIUS
    });
    let gap = board.worst(board.height());
    let passes = gap.gap + board.uncertainty <= board.limit;
    let found = TemplateFinding {
        name: "T".into(),
        line: "L".into(),
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
    };
    let history = PlateHistory {
        task,
        templates: vec![found],
        die: Some(Die { id: 1, opening: 0.36, edge: 0.2 }),
        steel: Some(Steel { grade: None, yield_strength: 440e6, heat: None }),
        strokes: Vec::new(),
        like: None,
        may_turn_over: false,
    };
    let situation = Situation { lines, boards: vec![board], side: 1.0, blank: Vec::new() };
    advise(&SETTINGS, &history, &situation)
}

/// A plate with some of the bends of a stroke each, 0.1 m long, at random places and of random angles.
fn bent(seed: u64) -> impl Fn(f64) -> f64 {
    let mut random = fastrand::Rng::with_seed(seed);
    let bends: Vec<[f64; 2]> =
        (0..random.usize(0..7)).map(|_| [0.25 + 2.5 * random.f64(), 0.01 + 0.02 * random.f64()]).collect();
    move |x| bends.iter().filter(|[at, _]| (x - at).abs() < 0.05).map(|[_, angle]| angle / 0.1).sum()
}

/// Places along u, metres, and angles of the plan, from the left.
fn plan(advice: &Advice, place: impl Fn(f64) -> f64) -> Vec<[f64; 2]> {
    let bends = advice.plan.iter().map(|bend| [place(0.5 * (bend.line[0][0] + bend.line[1][0])), bend.angle]);
    let mut bends: Vec<[f64; 2]> = bends.collect();
    bends.sort_by(|a, b| a[0].total_cmp(&b[0]));
    bends
}

/// A flat plate is its own mirror image: of its two best plans it gets one.
#[test]
fn a_mirrored_plate_gets_a_mirrored_plan() {
    for seed in 1..=100 {
        let plate = bent(seed);
        let (one, other) = (advice_on(&plate), advice_on(|x| plate(WIDTH - x)));
        assert_eq!(one.strokes_left, other.strokes_left, "seed {seed}");
        let flat = (0..300).all(|k| plate(0.01 * f64::from(k)) == 0.0);
        let (left, right) = (plan(&one, |u| u), plan(&other, |u| WIDTH - u));
        for (a, b) in left.iter().flatten().zip(right.iter().flatten()) {
            // Found: 4e-12.
            assert!(flat || (a - b).abs() < 1e-11, "seed {seed}:\n{left:.4?}\n{right:.4?}");
        }
    }
}

#[test]
fn a_finished_plate_gets_enough() {
    for off in [-0.01, 0.0, 0.01] {
        let advice = advice_on(|_| (1.0 + off) / RADIUS);
        assert_eq!((advice.step, advice.strokes_left), (Step::Done, Some([0, 0])), "{off}");
    }
}
