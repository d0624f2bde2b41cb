//! Tests of the place of the next hit on closed-form fields: a cylinder of radius 9 m with flat bands, and a template
//! of 3 mm on 2 m.

use platen_model::{Findings, Seat, TemplateFinding};

use super::*;

const SIDE: usize = 101;
const SIZE: [f64; 2] = [3.0, 2.5];
/// Curvature that is missing in a flat band, 1/m.
const FLAT: f64 = 1.0 / 9.0;
/// Curvature that opens 1 mm under the template, 1/m.
const ONE_MM: f64 = 8.0 * 1e-3 / 4.0;

fn plate(axis_deg: f64) -> PlateFile {
    let text = format!(
        "[plate]\nid = \"A\"\nwidth_mm = 3000.0\nheight_mm = 2500.0\nthickness_mm = 30.0\n\
         [target]\nshape = \"cylinder\"\nradius_mm = 9000.0\naxis_deg = {axis_deg:?}\nradius_of = \"mid\"\n\
         scanned_face = \"inside\"\n\
         [[reference_line]]\nname = \"R\"\nfrom_mm = [0.0, 1250.0]\nto_mm = [3000.0, 1250.0]\n\
         [[template]]\nname = \"T\"\nline = \"R\"\nchord_mm = 2000.0\nlimit_mm = 3.0\n"
    );
    PlateFile::parse("plate.toml", &text).unwrap()
}

/// Returns a report on the missing curvature by place; `None` where unseen, unchanged where 0.
fn report(missing: impl Fn(f64, f64) -> Option<f64>) -> Report {
    let at = |k: usize, i: usize| SIZE[i] * k as f64 / (SIDE - 1) as f64;
    let nodes: Vec<_> = (0..SIDE * SIDE).map(|k| missing(at(k % SIDE, 0), at(k / SIDE, 1))).collect();
    let state = |value: &Option<f64>| match value {
        None => NodeState::Unseen,
        Some(0.0) => NodeState::Unchanged,
        Some(_) => NodeState::Seen,
    };
    let field = Field {
        name: "curvature_deficit".into(),
        unit: "1/m".into(),
        nodes: [SIDE; 2],
        components: 1,
        state: nodes.iter().map(state).collect(),
        values: nodes.iter().map(|value| value.unwrap_or(f64::NAN)).collect(),
    };
    Report::new(Findings::default(), vec![field])
}

fn next(report: &Report) -> Next {
    Next::new(&[report], &plate(90.0), Verdict::Fail)
}

fn place(report: &Report) -> NextPlace {
    next(report).place().cloned().unwrap_or_else(|| panic!("{:?}", next(report)))
}

fn none(report: &Report) -> NoNext {
    match next(report) {
        Next::Nowhere { none } => none,
        Next::Place(place) => panic!("{place:?}"),
    }
}

fn near(found: f64, expected: f64, by: f64) {
    assert!((found - expected).abs() <= by, "{found}, expected {expected} within {by}");
}

fn within(x: f64, band: [f64; 2]) -> bool {
    band[0] - 1e-9 <= x && x <= band[1] + 1e-9
}

#[test]
fn a_flat_band_on_a_cylinder_is_the_place_and_its_gap_that_of_a_beam() {
    for middle in [0.3, 0.9, 2.1, 2.7] {
        let band = [middle - 0.3, middle + 0.3];
        let place = place(&report(|u, _| Some(if within(u, band) { FLAT } else { 0.0 })));
        // Found: within 6 mm, of nodes 30 mm apart and candidates 60 mm apart.
        near(place.at_mm[0], 1000.0 * middle, 12.0);
        near(place.at_mm[1], 1250.0, 1.0);
        // c^2 / 8 dk (b - b^2 / 4) for a band of b, c = 2; the band's edges lie half a node step further out.
        near(place.gap_mm, 1000.0 * 0.5 * FLAT * (0.6 - 0.09), 1.5);
        near(place.extent_mm[0], 573.0, 30.0);
        assert_eq!((place.limit_mm, place.chord_mm, place.uncertainty_mm), (3.0, 2000.0, None));
    }
}

#[test]
fn along_an_oblique_line_the_band_is_found_across_it() {
    let along = [0.5_f64.sqrt(), -0.5_f64.sqrt()];
    for middle in [-0.6, 0.0, 0.6] {
        let way = |u: f64, v: f64| (u - 1.5) * along[0] + (v - 1.25) * along[1];
        let band = [middle - 0.3, middle + 0.3];
        let report = report(|u, v| Some(if within(way(u, v), band) { FLAT } else { 0.0 }));
        let next = Next::new(&[&report], &plate(45.0), Verdict::Fail);
        let [u, v] = next.place().unwrap().at_mm;
        near(1000.0 * way(u / 1000.0, v / 1000.0), 1000.0 * middle, 40.0);
    }
}

#[test]
fn an_even_gap_is_placed_in_the_middle_and_counts_beyond_the_limit_only() {
    let even = |mm: f64| report(move |_, _| Some(mm * ONE_MM));
    let found = place(&even(3.1));
    near(found.gap_mm, 3.1, 2e-3);
    assert_eq!(found.at_mm, [1500.0, 1250.0]);
    assert_eq!(none(&even(2.9)), NoNext::NothingStandsOut);
}

#[test]
fn between_two_flat_bands_the_bend_is_not_the_place() {
    let bands = [[0.9, 1.38], [1.62, 2.1]];
    let flat = |u: f64| bands.iter().any(|band| within(u, *band));
    let [u, _] = place(&report(|u, _| Some(if flat(u) { FLAT } else { 0.0 }))).at_mm;
    assert!(flat(u / 1000.0), "{u}");
}

#[test]
fn a_plate_bent_too_far_has_no_place_unless_more_is_missing_elsewhere() {
    let bent = |left: f64, right: f64| report(move |u, _| Some(if u < 1.5 { left } else { right } * ONE_MM));
    assert_eq!(none(&bent(-20.0, -20.0)), NoNext::BentTooFar);
    assert_eq!(none(&bent(-20.0, 15.0)), NoNext::BentTooFar);
    assert!(place(&bent(-15.0, 20.0)).at_mm[0] > 1500.0);
    assert_eq!(none(&bent(-2.5, -2.5)), NoNext::NothingStandsOut, "within the limit");
}

#[test]
fn an_unseen_half_has_no_place_and_its_silence_is_no_good_news() {
    let half =
        |band: [f64; 2]| report(move |u, _| (u > 1.5).then(|| if within(u, band) { FLAT } else { 0.0 }));
    near(place(&half([2.1, 2.7])).at_mm[0], 2400.0, 60.0);
    assert_eq!(none(&half([0.3, 0.9])), NoNext::NotEnoughSeen);
    assert_eq!(none(&report(|_, _| None)), NoNext::NotEnoughSeen);
}

#[test]
fn below_the_level_of_detection_is_nothing() {
    let mut report = report(|_, _| Some(FLAT));
    report.fields[0].state.fill(NodeState::Unchanged);
    assert_eq!(none(&report), NoNext::NothingStandsOut);
}

#[test]
fn a_gap_within_its_uncertainty_is_no_place() {
    let mut report = report(|_, _| Some(5.0 * ONE_MM));
    let laid = |uncertainty: f64| TemplateFinding {
        name: "T".into(),
        line: "R".into(),
        seat: Seat::Gravity,
        rocks: false,
        max_gap: 5e-3,
        uncertainty,
        max_gap_at: [1.5, 1.25],
        contacts: Vec::new(),
        start: 0.5,
        gap: Vec::new(),
        limit: 3e-3,
        sense: -1,
        verdict: Verdict::Fail,
        says: String::new(),
    };
    report.findings.templates = vec![laid(0.4e-3), laid(0.7e-3)];
    near(place(&report).uncertainty_mm.unwrap(), 0.7, 1e-9);
    report.findings.templates = vec![laid(5.5e-3)];
    assert_eq!(none(&report), NoNext::NothingStandsOut);
}

#[test]
fn without_a_judge_there_is_no_place_and_after_a_pass_none_is_sought() {
    let report = report(|_, _| Some(FLAT));
    let of = |plate: &PlateFile, reports: &[&Report], verdict: Verdict| Next::new(reports, plate, verdict);
    let nowhere = |none: NoNext| Next::Nowhere { none };
    assert_eq!(of(&plate(90.0), &[&report], Verdict::Pass), nowhere(NoNext::Passed));
    assert_eq!(of(&plate(90.0), &[], Verdict::Fail), nowhere(NoNext::NoTarget));
    let untargeted = PlateFile { target: None, ..plate(90.0) };
    assert_eq!(of(&untargeted, &[&report], Verdict::CannotTell), nowhere(NoNext::NoTarget));
    let unjudged = PlateFile { templates: Vec::new(), ..plate(90.0) };
    assert_eq!(of(&unjudged, &[&report], Verdict::CannotTell), nowhere(NoNext::NoTarget));
}

#[test]
fn it_is_read_from_a_document_as_it_was_written() {
    let found = [next(&report(|_, _| Some(FLAT))), next(&report(|_, _| None))];
    for next in &found {
        let text = serde_json::to_string(next).unwrap();
        assert_eq!(serde_json::from_str::<Next>(&text).unwrap(), *next, "{text}");
    }
    assert_eq!(serde_json::to_string(&found[1]).unwrap(), r#"{"none":"not_enough_seen"}"#);
    assert!(
        found[0].says().starts_with("next hit around u 1500, v 1250 mm: 55.6 mm are missing"),
        "{}",
        found[0].says()
    );
}
