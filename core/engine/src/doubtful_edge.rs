//! Sensitivity analysis of template verdicts to a doubtful edge of the plate: a verdict that depends on it is
//! withdrawn.
//!
//! The material coordinates (u, v) of the plate are derived from its edges. An edge is doubtful if its measured length
//! differs by d from the length that was cut. One of its ends is then in the wrong place by up to d along u (or along
//! v), and the coordinates of the plate with it.
//!
//! Method (own): the judging comparisons are repeated with every reference line moved by d to either side. A line is
//! cut off where it leaves the plate, so that a template that reaches the edge also loses the doubtful strip. A
//! template whose verdict is not the same in all repetitions gets `cannot_tell`.
//!
//! Limits: only edges found by `edge_doubts` are treated as doubtful. All coordinates are moved by the same amount, not
//! in proportion to their distance from the edge.

use platen_model::{Centre, Report, Task, Template, Verdict};
use platen_shape::EdgeDoubt;

use crate::pipeline::Pipeline;
use crate::plugin::{PluginError, Surfaces};

/// Withdraws the verdicts that depend on where the doubtful edges lie.
pub fn withdraw_verdicts(
    pipeline: &Pipeline,
    task: &Task,
    surfaces: Surfaces<'_>,
    doubts: &[EdgeDoubt],
    reports: &mut [Result<Report, PluginError>],
) {
    let tasks = moved_tasks(task, doubts);
    if tasks.is_empty() {
        return;
    }
    for (comparison, report) in pipeline.comparisons.iter().zip(reports) {
        let Ok(report) = report else { continue };
        if report.findings.templates.is_empty() {
            continue;
        }
        let others = tasks.iter().map(|(by, task)| (*by, comparison.compare(task, surfaces).ok()));
        withdraw(report, &others.collect::<Vec<_>>());
    }
}

/// Returns copies of the task with its lines moved by each doubt to either side, each with the amount of its movement
/// in metres.
fn moved_tasks(task: &Task, doubts: &[EdgeDoubt]) -> Vec<(f64, Task)> {
    let along = |axis: usize| {
        let of_axis = doubts.iter().filter(|doubt| doubt.edge % 2 == axis);
        of_axis.map(|doubt| (doubt.length - doubt.cut).abs()).reduce(f64::max)
    };
    let doubtful = (0..2).filter_map(|axis| along(axis).map(|by| (axis, by)));
    doubtful.flat_map(|(axis, by)| [-by, by].map(|signed| (by, moved(task, axis, signed)))).collect()
}

/// Returns the task with every line moved along u (axis 0) or v (axis 1) and cut off at the plate's edges. Templates
/// that are longer than the rest of their line are shortened to it.
fn moved(task: &Task, axis: usize, by: f64) -> Task {
    let mut task = task.clone();
    let size = [task.width, task.height];
    for line in &mut task.reference_lines {
        for end in [&mut line.from, &mut line.to] {
            end[axis] = (end[axis] + by).clamp(0.0, size[axis]);
        }
    }
    let lines = &task.reference_lines;
    task.templates = task.templates.iter().map(|template| fitted(template, lines)).collect();
    task
}

fn fitted(template: &Template, lines: &[platen_model::ReferenceLine]) -> Template {
    let mut template = template.clone();
    let Some(line) = lines.iter().find(|line| line.name == template.line) else { return template };
    let length = line.length();
    template.chord = template.chord.min(length);
    if let Centre::At(at) = &mut template.centre {
        let half = 0.5 * template.chord;
        *at = at.max(half).min(length - half);
    }
    template
}

/// Sets to `cannot_tell` the templates whose verdict differs in one of `others` (amount of the movement in metres, and
/// report).
fn withdraw(report: &mut Report, others: &[(f64, Option<Report>)]) {
    let findings = &mut report.findings;
    let (mut names, mut said) = (Vec::new(), Vec::new());
    for template in &mut findings.templates {
        let same = |other: &Report| {
            let known = other.findings.templates.iter().find(|known| known.name == template.name);
            known.is_some_and(|known| known.verdict == template.verdict)
        };
        let changed = others.iter().find(|(_, other)| !other.as_ref().is_some_and(same));
        let Some((by, _)) = changed.filter(|_| template.verdict != Verdict::CannotTell) else { continue };
        template.verdict = Verdict::CannotTell;
        template.says = format!(
            "cannot tell: the verdict changes when its line is moved by the {:.1} mm by which an edge is doubtful; scan again \
             from where that edge is seen better",
            by * 1000.0
        );
        said.push(format!("{}: {}", template.name, template.says));
        names.push(template.name.clone());
    }
    if said.is_empty() {
        return;
    }
    findings.verdict = findings.templates.iter().map(|template| template.verdict).max();
    // The sentences of the withdrawn verdicts begin with the same names.
    let is_withdrawn = |line: &String| names.iter().any(|name| line.starts_with(&format!("{name}: ")));
    findings.says.retain(|line| !is_withdrawn(line));
    findings.says.splice(0..0, said);
}

#[cfg(test)]
mod tests {
    use super::*;
    use platen_model::{Findings, ReferenceLine, Seat, TemplateFinding};

    fn task() -> Task {
        let line = |name: &str, from, to| ReferenceLine { name: name.into(), from, to };
        let template = |line: &str, chord, centre| Template {
            name: line.into(),
            line: line.into(),
            chord,
            centre: Centre::At(centre),
            limit: 0.003,
            seat: Seat::Gravity,
            source: None,
        };
        Task {
            plate: "A".into(),
            width: 3.0,
            height: 2.0,
            thickness: 0.03,
            target: None,
            reference_lines: vec![
                line("whole", [0.0, 1.0], [3.0, 1.0]),
                line("across", [2.0, 0.0], [2.0, 2.0]),
            ],
            templates: vec![template("whole", 3.0, 1.5), template("across", 1.0, 1.0)],
            stations: Vec::new(),
            sigma_correlated: 0.0,
            sigma_true: None,
            supports: Vec::new(),
            supports_changed: false,
        }
    }

    #[test]
    fn lines_move_by_the_doubt_and_stay_on_the_plate() {
        let doubt = |edge, length, cut| EdgeDoubt { edge, length, sigma: 1e-4, cut };
        assert!(moved_tasks(&task(), &[]).is_empty());
        // Two doubts along u: the larger one counts.
        let tasks = moved_tasks(&task(), &[doubt(0, 3.004, 3.0), doubt(2, 2.99, 3.0)]);
        let by: Vec<f64> = tasks.iter().map(|(by, _)| (by * 1e3).round()).collect();
        assert_eq!(by, [10.0, 10.0]);
        let ends = |k: usize, line: usize| {
            let line = &tasks[k].1.reference_lines[line];
            [line.from, line.to].map(|end| end.map(|x| (x * 1e3).round()))
        };
        assert_eq!(ends(0, 0), [[0.0, 1000.0], [2990.0, 1000.0]]);
        assert_eq!(ends(1, 0), [[10.0, 1000.0], [3000.0, 1000.0]]);
        assert_eq!(ends(1, 1), [[2010.0, 0.0], [2010.0, 2000.0]]);
        // The template as long as its line is shortened, the other stays.
        let [whole, across] = [0, 1].map(|k| &tasks[0].1.templates[k]);
        assert!((whole.chord - 2.99).abs() < 1e-9 && whole.centre == Centre::At(0.5 * whole.chord));
        assert_eq!(*across, task().templates[1]);
    }

    fn report(verdicts: [Verdict; 2]) -> Report {
        let finding = |name: &str, verdict| TemplateFinding {
            name: name.into(),
            line: name.into(),
            seat: Seat::Gravity,
            rocks: false,
            max_gap: 0.002,
            uncertainty: 1e-4,
            max_gap_at: [1.0, 1.0],
            contacts: Vec::new(),
            start: 0.0,
            gap: Vec::new(),
            limit: 0.003,
            sense: 0,
            verdict,
            says: "as measured".into(),
        };
        let templates = vec![finding("whole", verdicts[0]), finding("across", verdicts[1])];
        let says = vec!["whole: as measured".into(), "across: as measured".into(), "anywhere".into()];
        let verdict = verdicts.into_iter().max();
        Report::new(Findings { verdict, says, templates, ..Findings::default() }, Vec::new())
    }

    #[test]
    fn a_verdict_that_changes_is_withdrawn_and_no_other() {
        use Verdict::{CannotTell, Fail, Pass};
        let withdrawn = |verdicts, others: &[[Verdict; 2]]| {
            let mut found = report(verdicts);
            let others: Vec<_> = others.iter().map(|other| (0.004, Some(report(*other)))).collect();
            withdraw(&mut found, &others);
            found
        };
        assert_eq!(withdrawn([Pass, Pass], &[[Pass, Pass]; 2]), report([Pass, Pass]));
        let one = withdrawn([Pass, Pass], &[[Pass, Pass], [CannotTell, Pass]]).findings;
        assert_eq!(one.verdict, Some(CannotTell));
        assert_eq!([one.templates[0].verdict, one.templates[1].verdict], [CannotTell, Pass]);
        assert!(one.says[0].starts_with("whole: cannot tell") && one.says[0].contains("4.0 mm"));
        assert_eq!(one.says[1..], ["across: as measured", "anywhere"]);
        // A failure that disappears with a movement is withdrawn; one that remains is kept.
        assert_eq!(withdrawn([Fail, Pass], &[[Pass, Pass]]).findings.verdict, Some(CannotTell));
        assert_eq!(withdrawn([Fail, Pass], &[[Fail, CannotTell]]).findings.verdict, Some(Fail));
        // A repetition that failed is not evidence.
        let mut found = report([Pass, Pass]);
        withdraw(&mut found, &[(0.004, None)]);
        assert_eq!(found.findings.verdict, Some(CannotTell));
    }
}
