//! Tests of strokes, programmes and documents.
#![expect(clippy::unwrap_used, reason = "a test that fails to build its plate must fail")]

use platen_sim_plate::{
    Handling, Plan, Plate, PlateError, PlateState, Pose, Programme, Reply, Request, Shape, Stroke,
};

fn bent(target: &Shape, plan: &Plan) -> PlateState {
    let mut state = PlateState::flat(3000.0, 2500.0, 36.0);
    let programme = Programme::toward(target, &state.blank, plan).unwrap();
    for stroke in &programme.strokes {
        state.apply(stroke).unwrap();
    }
    state
}

fn exact() -> Plan {
    Plan { springback_scatter: 0.0, ..Plan::default() }
}

#[test]
fn a_whole_programme_leaves_the_target() {
    for target in [
        Shape::Cylinder { radius_mm: 9000.0, axis_deg: 110.0 },
        Shape::Sphere { radius_mm: 11_000.0 },
        Shape::Torus { axis_deg: 0.0, radius_mm: 20_000.0, cross_radius_mm: -8000.0 },
    ] {
        let bent = Plate::new(&bent(&target, &exact())).unwrap();
        let wanted =
            Plate::new(&PlateState { shape: target.clone(), ..PlateState::flat(3000.0, 2500.0, 36.0) })
                .unwrap();
        for (u, v) in [(0.0, 0.0), (0.4, 1.9), (1.5, 1.25), (3.0, 2.5), (2.9, 0.1)] {
            let off = (bent.top(u, v) - wanted.top(u, v)).norm();
            assert!(off < 1e-9, "{target:?} at {u} {v}: {off:e}");
        }
    }
}

#[test]
fn every_stroke_bends_by_what_springback_leaves() {
    let stroke = Stroke { axis_deg: 90.0, at_mm: 200.0, width_mm: 300.0, angle_deg: 2.0, springback: 0.25 };
    let mut state = PlateState::flat(3000.0, 2500.0, 36.0);
    let before = Plate::new(&state).unwrap();
    state.apply(&stroke).unwrap();
    let after = Plate::new(&state).unwrap();
    let angle = |u: f64| after.normal(u, 1.0).angle(&before.normal(u, 1.0)).to_degrees();
    assert!((after.normal(0.0, 1.0).angle(&after.normal(3.0, 1.0)).to_degrees() - 1.5).abs() < 1e-9);
    assert!(angle(0.0) < 1e-6 && (angle(3.0) - 1.5).abs() < 1e-9);
    // The part left of the band has not moved.
    assert!((after.top(0.5, 2.0) - before.top(0.5, 2.0)).norm() < 1e-12);
    assert!((after.top(2.9, 2.0) - before.top(2.9, 2.0)).norm() > 0.02);
    assert_eq!(state.strokes, 1);
}

#[test]
fn a_turned_die_bends_at_the_same_place() {
    let stroke =
        |axis_deg, at_mm| Stroke { axis_deg, at_mm, width_mm: 300.0, angle_deg: 2.0, springback: 0.0 };
    let plate = |second: Stroke| {
        let mut state = PlateState::flat(3000.0, 2500.0, 36.0);
        state.apply(&stroke(90.0, -600.0)).unwrap();
        state.apply(&second).unwrap();
        Plate::new(&state).unwrap()
    };
    let (there, back) = (plate(stroke(90.0, 200.0)), plate(stroke(270.0, -200.0)));
    let (across, across_back) = (plate(stroke(180.0, 300.0)), plate(stroke(0.0, -300.0)));
    for (u, v) in [(0.1, 0.2), (1.7, 2.3), (2.8, 1.1)] {
        assert!((there.top(u, v) - back.top(u, v)).norm() < 1e-12);
        assert!((across.top(u, v) - across_back.top(u, v)).norm() < 1e-9);
    }
    // A die at 180 degrees bends along v, at v = middle + 300 mm.
    assert!(
        across.curvature(0.5, 1.55, 0.0).kappa_v > 0.1
            && across.curvature(0.5, 0.95, 0.0).kappa_v.abs() < 1e-3
    );
}

#[test]
fn what_has_no_closed_form_is_refused() {
    let stroke = Stroke { axis_deg: 90.0, at_mm: 0.0, width_mm: 300.0, angle_deg: 2.0, springback: 0.0 };
    let mut state = PlateState::flat(3000.0, 2500.0, 36.0);
    state.apply(&stroke).unwrap();
    let before = state.clone();
    let oblique = state.apply(&Stroke { axis_deg: 60.0, ..stroke }).unwrap_err();
    assert!(matches!(oblique, PlateError::Stroke { .. }));
    assert_eq!(state, before);
    state.shape = Shape::Sphere { radius_mm: 9000.0 };
    assert!(state.apply(&stroke).is_err());
    let cone = Shape::Cone { axis_deg: 0.0, radius_start_mm: 5000.0, radius_end_mm: 6000.0 };
    assert!(matches!(
        Programme::toward(&cone, &state.blank, &exact()),
        Err(PlateError::Target { target: "cone" })
    ));
}

#[test]
fn programmes_and_places_repeat_with_their_seed() {
    let target = Shape::Cylinder { radius_mm: 9000.0, axis_deg: 90.0 };
    let plan = |seed| Plan { seed, ..Plan::default() };
    assert_eq!(bent(&target, &plan(3)), bent(&target, &plan(3)));
    assert_ne!(bent(&target, &plan(3)), bent(&target, &plan(4)));
    let (handling, home) = (Handling::default(), Pose::default());
    assert_eq!(handling.place(&home, 5), handling.place(&home, 5));
    assert_ne!(handling.place(&home, 5), handling.place(&home, 6));
}

#[test]
fn documents_survive_json_bit_for_bit() {
    let state = bent(&Shape::Sphere { radius_mm: 11_000.0 }, &Plan::default());
    let line = serde_json::to_string(&Reply::Plate(Some(state.clone().into()))).unwrap();
    assert_eq!(serde_json::from_str::<Reply>(&line).unwrap(), Reply::Plate(Some(state.into())));
    assert_eq!(serde_json::to_string(&Request::Plate).unwrap(), r#"{"get":"plate"}"#);
    assert_eq!(serde_json::from_str::<Reply>(r#"{"plate":null}"#).unwrap(), Reply::Plate(None));
}

#[test]
fn a_description_reads_as_toml() {
    let text = r#"
        [blank]
        width_mm = 4000.0
        height_mm = 2500.0
        thickness_mm = 40.0
        markers_mm = [[1000.0, 500.0]]
        [shape]
        shape = "steps"
        axis_deg = 90.0
        curvature_per_m = 0.1666
        steps = [{ at_mm = 100.0, width_mm = 300.0, change_per_m = -0.1666 }]
        [pose]
        centre_mm = [6500.0, 0.0, -3600.0]
        yaw_deg = 85.0
    "#;
    let state: PlateState = toml::from_str(text).unwrap();
    assert!(Plate::new(&state).is_ok());
    let wrong = text.replace("yaw_deg", "jaw_deg");
    assert!(toml::from_str::<PlateState>(&wrong).unwrap_err().to_string().contains("jaw_deg"));
}
