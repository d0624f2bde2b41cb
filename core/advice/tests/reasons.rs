//! Reasons for no advice, and sentences about press and plate: each in both languages, without unknown numbers.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod cases;

use cases::{Case, bends, stroke};
use platen_advice::{Advice, Settings};
use platen_model::{CannotAdvise, Die, Language, LikePlates, NextBend, PressedStroke, Step, WantedBend};

fn reason(advice: &Advice) -> CannotAdvise {
    match advice.step {
        Step::Cannot { reason } => reason,
        ref step => panic!("{step:?}"),
    }
}

fn bend(advice: &Advice) -> &NextBend {
    match &advice.step {
        Step::Bend(bend) => bend,
        step => panic!("{step:?}"),
    }
}

#[track_caller]
fn says(advice: &Advice, en: &str) {
    let says = advice.says.iter().find(|says| says.en.contains(en));
    let says = says.unwrap_or_else(|| panic!("no {en:?} in {:?}", advice.says));
    assert!(!says.ja.is_empty() && !says.ja.is_ascii(), "{says:?}");
}

const REASONS: [CannotAdvise; 11] = [
    CannotAdvise::NoTarget,
    CannotAdvise::NoTemplate,
    CannotAdvise::Unseen,
    CannotAdvise::BendsUnknown,
    CannotAdvise::TemplatesDisagree,
    CannotAdvise::EdgeOutOfReach,
    CannotAdvise::PressUnlikeRecord,
    CannotAdvise::BentTooFar,
    CannotAdvise::SupportsChanged,
    CannotAdvise::StrainReached,
    CannotAdvise::TooLate,
];

#[test]
fn each_reason_has_its_number_and_its_sentence_in_both_languages() {
    for (k, reason) in REASONS.into_iter().enumerate() {
        assert_eq!(usize::from(reason.number()), k + 1);
        let [en, ja] = [Language::En, Language::Ja].map(|language| reason.texts().of(language));
        assert!(en.is_ascii() && !ja.is_ascii(), "{en} {ja}");
    }
}

#[test]
fn a_stroke_that_was_not_measured_ends_the_advice() {
    let lost = PressedStroke { not_measured: true, ..PressedStroke::default() };
    let case = Case { strokes: vec![lost], ..Case::default() };
    assert_eq!(reason(&case.advice(|_, _| 0.0)), CannotAdvise::BendsUnknown);
}

#[test]
fn other_supports_end_the_advice_until_they_stand_again() {
    let case = Case { supports_changed: true, ..Case::default() };
    assert_eq!(reason(&case.advice(|_, _| 0.0)), CannotAdvise::SupportsChanged);
    // The verdict is kept.
    assert_eq!(case.advice(|_, _| 1.0 / 9.0).step, Step::Done);
}

/// The middle is flat, the ends are finished: a whole line would bend all three.
#[test]
fn three_boards_that_disagree_are_not_averaged() {
    let case = Case { boards: vec![0.1, 1.25, 2.4], ..Case::default() };
    let advice = case.advice(|_, v| if (v - 1.25).abs() < 0.5 { 0.8 / 9.0 } else { 1.0 / 9.0 });
    assert_eq!(reason(&advice), CannotAdvise::TemplatesDisagree);
    says(&advice, "under T1 the plate is flatter than under the other templates");
    // All three equally flat: a plan.
    bend(&case.advice(|_, _| 0.8 / 9.0));
}

#[test]
fn a_plate_bent_too_far_is_turned_over_only_where_that_is_allowed() {
    let too_far = |_: f64, _: f64| 1.15 / 9.0;
    let advice = Case::default().advice(too_far);
    assert_eq!(reason(&advice), CannotAdvise::BentTooFar);
    assert!(!advice.too_far.is_empty(), "its zones are named");
    let advice = Case { may_turn_over: true, ..Case::default() }.advice(too_far);
    assert!(matches!(&advice.step, Step::TurnOver(bend) if bend.angle < 0.0), "{:?}", advice.step);
}

/// Two thirds of the plate are bent too far, the last third is flat: bending continues there, and the zone is reported.
#[test]
fn a_zone_that_is_bent_too_far_is_flattened_last() {
    let advice = Case::default().advice(|u, _| if u < 2.0 { 1.3 / 9.0 } else { 0.0 });
    assert!(bend(&advice).line[0][0] > 1.9, "{:?}", advice.step);
    assert!(!advice.too_far.is_empty());
    says(&advice, "flatten there last");
}

#[test]
fn what_is_learned_from_few_plates_and_strokes_is_said() {
    says(&Case::default().advice(|_, _| 0.0), "learned from 0 like plates and 0 strokes");
}

/// The last 600 mm are flat, and the die reaches to 700 mm from the end: bends beside that part are advised until no
/// bend helps.
#[test]
fn what_lies_beyond_the_reach_of_the_die_is_said() {
    let die = Die { id: 1, opening: 0.36, edge: 0.7, punch_radius: None };
    let case = Case { die: Some(die), ..Case::default() };
    let mut made: Vec<[f64; 2]> = Vec::new();
    for _ in 0..10 {
        let now = made.clone();
        let bent = bends(&now);
        let advice = case.advice(|u, v| if u > 2.4 { 0.0 } else { 1.0 / 9.0 } + bent(u, v));
        match &advice.step {
            Step::Bend(next) => made.push([next.line[0][0], next.angle]),
            step => {
                println!("after {made:.3?}: {step:?}");
                return assert_eq!(reason(&advice), CannotAdvise::EdgeOutOfReach);
            }
        }
    }
    panic!("bends for ever: {made:?}");
}

/// Three strokes in a row for which the depth law expects another angle than they left.
#[test]
fn a_press_unlike_its_record_ends_the_advice() {
    let sure =
        LikePlates { plates: 20, mean: [0.0; 2], covariance: [[1e-12, 0.0], [0.0, 1e-12]], ram_sigma: None };
    let strokes = [(0.5, 3e-3), (1.0, 6e-3), (1.5, 3e-3)].map(|(u, depth)| stroke(u, 0.03, depth)).to_vec();
    let bent: Vec<[f64; 2]> = strokes.iter().map(|it| [it.bends[0].at[0], it.bends[0].angle]).collect();
    let case = Case { strokes, like: Some(sure), ..Case::default() };
    assert_eq!(reason(&case.advice(bends(&bent))), CannotAdvise::PressUnlikeRecord);
}

/// A plate that was bent by 33 mrad every 50 mm: more would strain its face beyond the limit.
#[test]
fn a_face_strained_to_the_limit_is_not_bent_again() {
    let strokes: Vec<PressedStroke> = (0..60).map(|k| stroke(0.05 * f64::from(k), 0.033, 5e-3)).collect();
    let strained = |strain: f64, punch_radius: Option<f64>| {
        let case = Case { strokes: strokes.clone(), ..Case::default() };
        let settings = Settings { strain, guard: false, ..case.settings };
        let die = Die { punch_radius, ..case.die.clone().unwrap() };
        // Flattened between them.
        Case { settings, die: Some(die), ..case }.advice(|_, _| 0.4 / 9.0)
    };
    assert_eq!(reason(&strained(0.018, None)), CannotAdvise::StrainReached);
    let within = strained(0.05, None);
    let angle = bend(&within).angle;
    assert!(angle > 0.011, "{angle}");
    // A punch of 300 mm spreads the bends: the same limit is farther away.
    bend(&strained(0.018, Some(0.3)));
    // The last bend is no larger than the limit leaves: 0.022 allows 44 mrad in all.
    let last = strained(0.022, None);
    assert!(bend(&last).angle <= 0.044 - 0.033 + 1e-9, "{}", bend(&last).angle);
}

#[test]
fn no_depth_without_a_die_and_on_a_press_that_does_not_report_it() {
    let advice = Case { die: None, ..Case::default() }.advice(|_, _| 0.0);
    says(&advice, "names no [[die]]");
    assert_eq!((bend(&advice).depth, bend(&advice).depth_not_beyond), (None, None));
    let advice = Case { tells_depth: false, ..Case::default() }.advice(|_, _| 0.0);
    says(&advice, "the press does not report the depth of its ram");
    assert_eq!((bend(&advice).depth, bend(&advice).depth_not_beyond), (None, None));
    assert!(bend(&advice).angle > 0.0);
}

#[test]
fn a_first_stroke_far_off_asks_for_a_look_at_the_plate() {
    for (angle, word) in [(0.06, "more"), (0.005, "less")] {
        let case = Case { strokes: vec![stroke(0.5, angle, 5e-3)], ..Case::default() };
        let advice = case.advice(bends(&[[0.5, angle]]));
        says(&advice, &format!("bent {word} than expected: check its thickness and steel"));
    }
}

#[test]
fn a_short_stop_and_a_missed_stroke_are_said() {
    let mut short = stroke(0.5, 0.004, 3.5e-3);
    short.wanted = Some(WantedBend { at: [0.5, 1.25], angle: 0.02, depth: Some(4.3e-3) });
    let advice = Case { strokes: vec![short], ..Case::default() }.advice(bends(&[[0.5, 0.004]]));
    says(&advice, "stopped 0.8 mm short of the advised depth");
    let missed = PressedStroke { missed_before: true, depth: None, ..stroke(0.5, 0.02, 0.0) };
    let advice = Case { strokes: vec![missed], ..Case::default() }.advice(bends(&[[0.5, 0.02]]));
    says(&advice, "a stroke before the last one was not measured");
}

#[test]
fn a_die_off_its_mark_is_said_and_allowed_for() {
    let off = 0.03;
    let strokes: Vec<PressedStroke> = [0.3, 0.6, 0.9, 1.2]
        .into_iter()
        .map(|u| {
            let wanted = WantedBend { at: [u, 1.25], angle: 0.03, depth: None };
            PressedStroke { wanted: Some(wanted), ..stroke(u + off, 0.03, 4.6e-3) }
        })
        .collect();
    let bent: Vec<[f64; 2]> = strokes.iter().map(|it| [it.bends[0].at[0], it.bends[0].angle]).collect();
    let advice = Case { strokes, ..Case::default() }.advice(bends(&bent));
    says(&advice, "24 mm onward of the advised lines");
    // The bend must be at its planned place: the advised line lies before it.
    let model = advice.model.unwrap();
    assert!((model.off_mark - 0.024).abs() < 1e-9, "{}", model.off_mark);
}

/// A ram of 0.6 mm leaves 3.3 mm under a board of 2 m on a die of 360 mm.
#[test]
fn a_press_too_coarse_for_the_limit_is_promised_nothing() {
    let like = |ram| LikePlates {
        plates: 20,
        mean: [0.0; 2],
        covariance: [[1e-8, 0.0], [0.0, 1e-6]],
        ram_sigma: Some(ram),
    };
    let coarse = Case { like: Some(like(0.6e-3)), ..Case::default() }.advice(|_, _| 0.0);
    says(&coarse, "this press is too coarse for the limit");
    assert_eq!(coarse.strokes_left, None);
    let fine = Case { like: Some(like(0.1e-3)), ..Case::default() }.advice(|_, _| 0.0);
    assert!(fine.strokes_left.is_some() && fine.says.is_empty(), "{:?}", fine.says);
    let width = |advice: &Advice| bend(advice).angle_95[1] - bend(advice).angle_95[0];
    // The scatter of the ram adds to the variance of the rest, 4 / w of it to the angle. Found: 1.000.
    let added = (2.0 * 1.96 * 4.0 / 0.36_f64).powi(2) * (0.6e-3_f64.powi(2) - 0.1e-3_f64.powi(2));
    let ratio = (width(&coarse).powi(2) - width(&fine).powi(2)) / added;
    println!("{ratio}");
    assert!((ratio - 1.0).abs() < 0.03, "{ratio}");
}
