//! Tests of tasks and scans that cannot be judged, and of refusals.

use super::*;

fn refused(change: impl Fn(&mut Task)) -> String {
    let now = plate_of(TargetShape::Flat, Facing::Inside);
    let mut task = task(TargetShape::Flat, Facing::Inside, Seat::Gravity);
    change(&mut task);
    run(&now, &task).expect_err("must be refused").to_string()
}

#[test]
fn malformed_tasks_are_refused_in_one_sentence() {
    assert!(
        refused(|t| t.templates[0].line = "R9".into())
            .starts_with("template T1: no reference line has the name \"R9\"")
    );
    assert!(
        refused(|t| t.reference_lines[0].to = [3.2, 1.0]).starts_with(
            "template T1: line R1 leaves the plate at 3200, 1000 mm; the plate is 3000 x 2000 mm"
        )
    );
    assert!(
        refused(|t| t.templates[0].chord = 3.5)
            .starts_with("template T1: its chord of 3500 mm does not fit its line R1 of 3000 mm")
    );
    assert!(
        refused(|t| t.templates[0].centre = Centre::At(0.4))
            .starts_with("template T1: a chord centred at 400 mm extends beyond an end of R1")
    );
    let negative =
        |t: &mut Task| t.target.as_mut().expect("there").shape = TargetShape::Sphere { radius: -8.0 };
    assert!(refused(negative).starts_with("target: a radius of -8000 mm is no radius"));
}

#[test]
fn nothing_passes_without_a_target_or_a_template() {
    let now = plate_of(TargetShape::Flat, Facing::Inside);
    let mut task = task(TargetShape::Flat, Facing::Inside, Seat::Gravity);
    task.templates.clear();
    let report = run(&now, &task).expect("sound");
    assert_eq!(report.findings.verdict, Some(Verdict::CannotTell));
    assert_eq!(report.fields[0].name, "deviation");
    task.target = None;
    let report = run(&now, &task).expect("sound");
    assert_eq!(report.findings.verdict, Some(Verdict::CannotTell));
    assert_eq!(report.findings.says, ["cannot tell: the plate file names no target"]);
}

#[test]
fn a_contact_or_the_largest_gap_out_of_sight_cannot_be_judged() {
    let task = task(cylinder(8.0), Facing::Inside, Seat::Gravity);
    let over = plate_of(cylinder(7.9), Facing::Inside);
    assert_eq!(finding(&over, &task).verdict, Verdict::Pass);
    let found = finding(&hidden(&over, 0.4, 0.6), &task);
    assert_eq!(found.verdict, Verdict::CannotTell);
    assert_eq!(
        found.says,
        "cannot tell: the board touches 0.5 m from the left edge where the plate was not seen; clear that place \
         and scan again"
    );
    assert!(!found.contacts[0].seen && found.contacts[1].seen);
    let found = finding(&hidden(&over, 1.4, 1.6), &task);
    assert!(found.says.starts_with("cannot tell: the gap is largest 1.5 m"), "{}", found.says);
    assert_eq!(finding(&hidden(&over, 0.8, 1.2), &task).verdict, Verdict::Pass);
}

#[test]
fn a_gap_within_its_uncertainty_of_the_limit_cannot_be_judged() {
    let mut task = task(cylinder(8.0), Facing::Inside, Seat::Gravity);
    let now = plate_of(cylinder(7.0), Facing::Inside);
    let gap = finding(&now, &task).max_gap;
    task.sigma_true = Some(0.2e-3);
    let verdict = |limit: f64| {
        let mut task = task.clone();
        task.templates[0].limit = limit;
        finding(&now, &task).verdict
    };
    assert_eq!(verdict(gap - 0.45e-3), Verdict::Fail);
    assert_eq!(verdict(gap - 0.35e-3), Verdict::CannotTell);
    assert_eq!(verdict(gap + 0.35e-3), Verdict::CannotTell);
    assert_eq!(verdict(gap + 0.45e-3), Verdict::Pass);
}
