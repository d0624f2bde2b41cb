//! Tests of the whole target laid on the plate, of stations, and of invariance to the pose of the plate.

use platen_model::{Quantity, Station};

use super::*;

const NODES: usize = PlateGrid::SIDE;

#[test]
fn the_target_lies_on_a_plate_of_its_own_shape() {
    for shape in [cylinder(6.0), TargetShape::Sphere { radius: 8.0 }, TargetShape::Flat] {
        let report = run(&plate_of(shape, Facing::Outside), &task(shape, Facing::Outside, Seat::Gravity))
            .expect("sound");
        let field = &report.fields[0];
        assert_eq!((field.nodes, field.components), ([NODES; 2], 1));
        assert!(field.values.iter().all(|d| *d < 1e-9 && *d > -3e-5), "{shape:?}");
        assert_eq!(figure(&report, "in_tolerance"), 1.0);
    }
}

#[test]
fn a_sphere_on_a_flatter_one_touches_in_the_middle() {
    let [plate, target] = [9.0, 8.0].map(|radius| TargetShape::Sphere { radius });
    let report =
        run(&plate_of(plate, Facing::Inside), &task(target, Facing::Inside, Seat::Gravity)).expect("sound");
    assert_eq!(figure(&report, "deviation.rocks"), 1.0);
    // The corner lies sqrt(3.25) / 2 m from the middle, where the spheres touch. The opening at the corner along the
    // target's normal follows from the distance of the plate's corner from the target's centre.
    let [r, t] = [9.0 - THICKNESS / 2.0, 8.0 - THICKNESS / 2.0];
    let half_diagonal = 0.5 * (WIDTH * WIDTH + HEIGHT * HEIGHT).sqrt();
    let angle = half_diagonal / 9.0;
    let corner = [r * angle.sin(), r * (1.0 - angle.cos())];
    let away = t - corner[0].hypot(t - corner[1]);
    let gap = figure(&report, "deviation.gap");
    // Found: 2.4 um.
    assert!((gap + away).abs() < 5e-6, "{gap} {away}");
    // The best fit has deviations of both signs; the difference of their extremes is about the opening in the seat.
    let [max, min] = ["deviation.max", "deviation.min"].map(|name| figure(&report, name));
    assert!(max > 0.2 * gap && min < -0.2 * gap, "{max} {min}");
    // Found: 0.19 mm; the two poses have different normals.
    assert!((max - min - gap).abs() < 0.4e-3, "{max} {min} {gap}");
    assert!(figure(&report, "deviation.rms") < 0.5 * gap);
    assert!((figure(&report, "curvature.deviation") - (8.0 / 9.0 - 1.0)).abs() < 5e-5);
    let corner = [figure(&report, "deviation.min_u"), figure(&report, "deviation.min_v")];
    assert!([0.0, WIDTH].contains(&corner[0]) && [0.0, HEIGHT].contains(&corner[1]), "{corner:?}");
}

#[test]
fn a_sphere_on_a_rounder_one_lies_on_its_corners() {
    let [plate, target] = [7.0, 8.0].map(|radius| TargetShape::Sphere { radius });
    let report =
        run(&plate_of(plate, Facing::Inside), &task(target, Facing::Inside, Seat::Gravity)).expect("sound");
    assert_eq!(figure(&report, "deviation.rocks"), 0.0);
    let deepest = report.findings.figures.iter().find(|f| f.name == "deviation.gap").expect("there");
    let at = deepest.at.expect("a place");
    // Found: the node in the middle; the next ones are 30 and 20 mm away.
    assert!((at[0] - 1.5).abs() < 0.01 && (at[1] - 1.0).abs() < 0.01, "{at:?}");
    let value = &report.fields[0].values;
    let corners = [0, NODES - 1, NODES * (NODES - 1), NODES * NODES - 1].map(|i| value[i]);
    assert!(corners.iter().filter(|d| d.abs() < 1e-9).count() >= 3, "{corners:?}");
}

#[test]
fn stations_say_deviation_gap_and_missing_curvature() {
    let mut task = task(cylinder(8.0), Facing::Outside, Seat::Gravity);
    let station = |name: &str, at, quantity| Station { name: name.into(), at, quantity };
    task.stations = vec![
        station("D", [0.6, 0.4], Quantity::Deviation),
        station("G", [1.5, 1.1], Quantity::Gap),
        station("K", [1.0, 1.0], Quantity::CurvatureDeficit),
    ];
    let report = run(&plate_of(cylinder(9.0), Facing::Outside), &task).expect("sound");
    let node = report.fields[0].values[20 * NODES + 20];
    assert!((figure(&report, "station.D") - node).abs() < 1e-12);
    assert!((figure(&report, "station.G") - report.findings.templates[0].max_gap).abs() < 1e-12);
    // Positive: bend more.
    let deficit = figure(&report, "station.K");
    // Found: 5e-5 1/m.
    assert!((deficit - (1.0 / 8.0 - 1.0 / 9.0)).abs() < 1e-4, "{deficit}");
}

#[test]
fn of_several_templates_the_one_with_the_most_gap_per_limit_is_the_figure() {
    let mut task = task(cylinder(8.0), Facing::Inside, Seat::Gravity);
    let first = task.templates[0].clone();
    task.templates.push(Template { name: "T2".into(), chord: 1.5, limit: 0.0005, ..first });
    let report = run(&plate_of(cylinder(9.0), Facing::Inside), &task).expect("sound");
    assert_eq!(figure(&report, "gap.line"), 2.0);
    assert_eq!(figure(&report, "gap.max"), report.findings.templates[1].max_gap);
    assert_eq!(figure(&report, "tolerance"), 0.0005);
    assert_eq!(figure(&report, "sense"), -1.0);
    assert!(report.findings.says[0].starts_with("T2: under-bent"), "{:?}", report.findings.says);
}

#[test]
fn the_search_finds_a_gap_that_no_template_covers() {
    let now = plate_of(TargetShape::Cone { axis: 0.0, radius_start: 10.0, radius_end: 12.0 }, Facing::Inside);
    let mut task = task(cylinder(8.0), Facing::Inside, Seat::Gravity);
    task.target.as_mut().expect("there").shape = TargetShape::Cylinder { radius: 8.0, axis: 0.0 };
    let inputs = Inputs { task, now, before: None, baseline: None };
    let report = compare(&Options { tolerance_mm: None, search: true }, &inputs, &|| Ok(())).expect("sound");
    // Across the straight lines, at the far end of the cone, where its radius is 12 m.
    let worst = report.findings.figures.iter().find(|f| f.name == "gap.worst_along_v").expect("searched");
    let gap = 0.5 * (1.0 / 8.0 - 1.0 / 12.0);
    // Found: 0.17 mm; the formula is for small angles and the mid-surface.
    assert!((worst.value - gap).abs() < 0.35e-3 && worst.at.expect("a place")[0] == WIDTH, "{worst:?}");
    assert!(
        report.findings.says.iter().any(|s| s.starts_with("largest gap anywhere: 2")),
        "{:?}",
        report.findings.says
    );
}

/// Two of the corners on which the target lies were not seen: on the part that was seen the target lies lower there.
#[test]
fn a_seat_that_was_not_seen_is_in_the_uncertainty() {
    let [plate, target] = [7.0, 8.0].map(|radius| TargetShape::Sphere { radius });
    let plate = plate_of(plate, Facing::Inside);
    let mut task = task(target, Facing::Inside, Seat::Gravity);
    let station = |name: &str, at| Station { name: name.into(), at, quantity: Quantity::Deviation };
    task.stations = vec![station("A", [0.3, 1.0]), station("B", [1.5, 0.4]), station("C", [2.3, 1.6])];
    let part = hidden(&plate, 2.4, WIDTH);
    let [whole, part] = [&plate, &part].map(|now| run(now, &task).expect("sound"));
    for name in ["station.A", "station.B", "station.C"] {
        let [whole, seen] = [&whole, &part].map(|report| stated(report, name));
        let off = (seen.0 - whole.0).abs();
        println!("{name}: {seen:?}, on the whole plate {whole:?} m");
        // Found: 1.8, 8.7 and 13.3 mm off; the whole plate states micrometres.
        assert!(
            off > 1e-3 && off <= seen.1 && seen.1 < off + 2.0 * whole.1 + 1e-4,
            "{name}: {seen:?} {whole:?}"
        );
    }
}

/// A plate is bent to its target on one half and flat on the other. The target lies flush on the one half, and the
/// noise of the scan does not determine its seat. The possible effect on the other half is in the uncertainty.
#[test]
fn a_half_bent_plate_has_one_seat() {
    let bent = goal(cylinder(12.0), Facing::Outside);
    let half_bent = |u: f64, v: f64| {
        let from = u.max(0.5 * WIDTH);
        let (p, n) = (bent.point(from, v), bent.normal(from, v));
        let along_u = (bent.point(from, v + 1.0) - p).cross(&n);
        (p + along_u * (u - from), n)
    };
    let mut task = task(cylinder(12.0), Facing::Outside, Seat::Gravity);
    let station = |name: &str, at| Station { name: name.into(), at, quantity: Quantity::Deviation };
    task.stations = vec![station("A", [0.3, 1.0]), station("B", [1.5, 0.4]), station("C", [2.3, 1.6])];
    let known = run(&surface(20_000, 1e-6, 1, half_bent), &task).expect("sound");
    for seed in 1..=8 {
        let found = run(&surface(20_000, 3e-4, seed, half_bent), &task).expect("sound");
        for name in ["station.A", "station.B", "station.C"] {
            let [(known, _), (value, uncertainty)] = [&known, &found].map(|report| stated(report, name));
            let off = (value - known).abs();
            println!("{seed} {name}: {off:.3e} m off, {uncertainty:.3e} stated");
            // Found: 0.12 mm at most; 17 mm where three contacts of any solution of the linear program decide alone
            // whether it rocks.
            assert!(off <= uncertainty && off < 0.25e-3, "{seed} {name}: {value} {uncertainty} {known}");
        }
    }
}

/// Two templates cross at a station: its gap is that of the first, whichever template has a slightly nearer point.
#[test]
fn a_station_on_two_templates_belongs_to_the_first() {
    let mut task = task(cylinder(8.0), Facing::Inside, Seat::Gravity);
    task.reference_lines.push(ReferenceLine { name: "R2".into(), from: [1.5, 0.0], to: [1.5, HEIGHT] });
    let across = Template {
        name: "T2".into(),
        line: "R2".into(),
        chord: 1.2,
        centre: Centre::At(1.0),
        ..task.templates[0].clone()
    };
    task.templates.push(across);
    for at in [[1.5, 1.0], [1.502, 1.0], [1.5, 1.002]] {
        task.stations = vec![Station { name: "G".into(), at, quantity: Quantity::Gap }];
        let report = run(&plate_of(cylinder(7.0), Facing::Inside), &task).expect("sound");
        let [first, second] = [0, 1].map(|k| report.findings.templates[k].max_gap);
        assert!(
            (figure(&report, "station.G") - first).abs() < 0.05 * first && second < 0.1 * first,
            "{at:?}"
        );
    }
}
