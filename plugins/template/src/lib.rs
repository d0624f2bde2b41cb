//! Comparison `template`: would the wooden template fit?
//!
//! A template is a board whose edge is the target's section along a reference line. It is laid on the fitted face
//! as a rigid body, contact and not best fit. With x along the board from its middle and d(x) the plate above the board's
//! edge in the section plane, the board lies on a + b x >= d(x), and the gap is a + b x - d(x).
//!
//! | `seat` in the plate file | the board |
//! |---|---|
//! | `gravity` | lies as low as it can at its middle: on the edge of d's upper hull that spans the middle. Contacts closer than a quarter of the chord: it rocks and is judged balanced |
//! | `balanced` | has equal gaps at both ends |
//! | `held` | is set with both ends on the plate; the gap has a sign |
//!
//! A gap passes or fails its limit only outside its 95 % uncertainty: noise of the fit at the places that decide the gap,
//! with how it goes together, the plant's correlated error and the scanner's own bias. A contact or the largest gap where the
//! plate was not seen cannot be judged. With several boards, the figures `gap.*` are those of the one with the most gap
//! per limit.
//!
//! The target as a whole is laid on the plate too, rigid and from the scanner's side; the field `deviation` is measured minus
//! target along the target's normal in that seat, so none is above zero; `deviation.gap` is the most that is open under
//! it, `in_tolerance` the share of the plate where no more than the tolerance is. As one sign is missing there, the
//! press's pair `deviation.max` and `.min`, with `.rms` and `.p95`, is that of the best fit instead, in which
//! the places of the plate lie above and below the target.
//!
//! ```toml
//! [[comparison]]
//! plugin = "template"
//! [comparison.options]
//! tolerance_mm = 6.0
//! ```
//!
//! | key | meaning |
//! |---|---|
//! | `tolerance_mm` | deviation that `in_tolerance` allows; the smallest limit of the templates unless given |
//! | `search` | also slide the first template's board over the whole plate, along u and along v |
//!
//! Figures beside the press's: `template.NAME.radius` and `.sagitta` of the plate under the board, `.rocking` its play from
//! one tilt to the other, `gap.worst_along_u` and `gap.worst_along_v`, `station.NAME`.

mod deviation;
mod figures;
mod judge;
mod programme;
mod seat;
mod section;

use platen_model::{Centre, Figure, Findings, Task, Template, Verdict};
use platen_model::{Field, NodeState, Report};
use platen_sdk::{Comparison, Error, ErrorKind, Info, Inputs, Job, PlateGrid, Result};
use platen_shape::TargetSurface;

use deviation::Deviation;
use judge::{Judge, Judged};
use section::Line;

platen_sdk::options! {
    /// Options of `template`.
    pub struct Options {
        /// Deviation that counts as within tolerance; the smallest limit of the templates unless given.
        tolerance_mm: Option<f64>, unit "mm", min 0.0, max 1000.0;
        /// Whether the first template's board is also slid over the whole plate.
        search: bool = true;
    }
}

struct TemplateGap(Options);

/// Places on the very edge of the plate, metres.
const ON_EDGE: f64 = 1e-6;

impl Comparison for TemplateGap {
    const INFO: Info = Info::new(
        c"template",
        c"Template",
        c"Lays boards with the target's section, and the whole target, on the plate and judges the gaps.",
        c"1.0.0",
    );
    type Options = Options;

    fn new(options: Options) -> Result<Self> {
        Ok(Self(options))
    }

    fn compare(&mut self, job: &Job<'_>, inputs: &Inputs) -> Result<Report> {
        compare(&self.0, inputs, &|| job.check())
    }
}

/// `check` fails when the job was cancelled.
fn compare(options: &Options, inputs: &Inputs, check: &dyn Fn() -> Result<()>) -> Result<Report> {
    let (task, now) = (&inputs.task, &inputs.now);
    let Some(target) = &task.target else {
        return Ok(unjudged("cannot tell: the plate file names no target"));
    };
    let target = TargetSurface::new(target, task.width, task.height, task.thickness)
        .map_err(|e| Error::new(ErrorKind::Config, e.to_string()))?;
    let judge = Judge {
        now,
        target: &target,
        sigma_correlated: task.sigma_correlated,
        sigma_true: task.sigma_true.unwrap_or(0.0),
    };
    let boards = task.templates.iter().map(|t| on_line(task, t)).collect::<Result<Vec<_>>>()?;
    let mut judged = Vec::new();
    for (template, (line, centre)) in task.templates.iter().zip(&boards) {
        check()?;
        let centre = match centre {
            Centre::At(centre) => *centre,
            Centre::Worst => judge.worst(line, template.chord, template.seat).0,
        };
        judged.push(judge.judge(template, line, centre));
    }
    let deviation = Deviation::new(now, &target, check)?;

    let limits = task.templates.iter().map(|t| t.limit);
    let tolerance = options.tolerance_mm.map(|mm| mm / 1000.0).or_else(|| limits.reduce(f64::min));
    let mut found = figures::of_deviation(&deviation, now, &target, tolerance);
    found.extend(figures::of_templates(&judged));
    found.extend(figures::of_curvature(now, &target));
    found.extend(figures::of_stations(task, now, &target, &deviation, &judged));
    let mut says = says(&judged);
    if let (true, Some(template)) = (options.search, task.templates.first()) {
        let (anywhere, sentence) = search(&judge, task, template, check)?;
        found.extend(anywhere);
        says.extend(sentence);
    }
    let verdict = judged.iter().map(|j| j.finding.verdict).max().unwrap_or(Verdict::CannotTell);
    let templates = judged.into_iter().map(|j| j.finding).collect();
    let findings = Findings { verdict: Some(verdict), says, figures: found, templates };
    Ok(Report::new(findings, vec![field(PlateGrid::new(now), deviation)]))
}

fn unjudged(why: &str) -> Report {
    let findings =
        Findings { verdict: Some(Verdict::CannotTell), says: vec![why.into()], ..Findings::default() };
    Report::new(findings, Vec::new())
}

/// The line of a template, and where its board lies on it.
fn on_line(task: &Task, template: &Template) -> Result<(Line, Centre)> {
    let refuse =
        |what: String| Err(Error::new(ErrorKind::Config, format!("template {}: {what}", template.name)));
    let Some(line) = task.reference_lines.iter().find(|line| line.name == template.line) else {
        return refuse(format!("no reference line is called {:?}", template.line));
    };
    let mm = |metres: f64| (metres * 1000.0).round();
    let inside = |[u, v]: [f64; 2]| {
        let on = |x: f64, length: f64| (-ON_EDGE..=length + ON_EDGE).contains(&x);
        on(u, task.width) && on(v, task.height)
    };
    if let Some([u, v]) = [line.from, line.to].into_iter().find(|end| !inside(*end)) {
        let (name, width, height) = (&line.name, mm(task.width), mm(task.height));
        return refuse(format!(
            "line {name} leaves the plate at {}, {} mm; the plate is {width} x {height} mm",
            mm(u),
            mm(v)
        ));
    }
    let board = Line::new(&line.name, line.from, line.to);
    let (chord, length) = (template.chord, board.length);
    if chord.is_nan() || chord <= 0.0 || chord > length + ON_EDGE {
        let (chord, length) = (mm(chord), mm(length));
        return refuse(format!("a board of {chord} mm does not fit its line {} of {length} mm", line.name));
    }
    if let Centre::At(at) = template.centre {
        let (first, last) = (0.5 * chord, length - 0.5 * chord);
        if !(first - ON_EDGE..=last + ON_EDGE).contains(&at) {
            let (at, first, last) = (mm(at), mm(first), mm(last));
            return refuse(format!(
                "a board round {at} mm hangs over an end of {}; its middle must lie from {first} to {last} mm",
                line.name
            ));
        }
    }
    Ok((board, template.centre))
}

/// One sentence for each board, the worst first.
fn says(judged: &[Judged]) -> Vec<String> {
    if judged.is_empty() {
        return vec!["cannot tell: the plate file names no template".into()];
    }
    let mut order: Vec<&Judged> = judged.iter().collect();
    order.sort_by(|a, b| {
        let (a, b) = (&a.finding, &b.finding);
        b.verdict.cmp(&a.verdict).then((b.max_gap.abs() / b.limit).total_cmp(&(a.max_gap.abs() / a.limit)))
    });
    order.iter().map(|j| format!("{}: {}", j.finding.name, j.finding.says)).collect()
}

/// The template's board slid over the whole plate.
fn search(
    judge: &Judge<'_>,
    task: &Task,
    template: &Template,
    check: &dyn Fn() -> Result<()>,
) -> Result<(Vec<Figure>, Option<String>)> {
    /// Lines in each direction.
    const LINES: usize = 21;
    let (mut found, mut sentence) = (Vec::new(), None);
    let [w, h] = [task.width, task.height];
    let at = |k: usize, length: f64| length * k as f64 / (LINES - 1) as f64;
    let along_u: Vec<Line> = (0..LINES).map(|k| Line::new("u", [0.0, at(k, h)], [w, at(k, h)])).collect();
    let along_v: Vec<Line> = (0..LINES).map(|k| Line::new("v", [at(k, w), 0.0], [at(k, w), h])).collect();
    let mut largest = template.limit;
    for (name, lines) in [("gap.worst_along_u", along_u), ("gap.worst_along_v", along_v)] {
        let mut worst: Option<(f64, [f64; 2])> = None;
        for line in lines.iter().filter(|line| line.length >= template.chord) {
            check()?;
            let (centre, gap) = judge.worst(line, template.chord, template.seat);
            if worst.is_none_or(|(most, _)| gap > most) {
                worst = Some((gap, line.at(centre)));
            }
        }
        let Some((gap, place)) = worst else { continue };
        found.push(figures::at(name, gap, "m", place));
        if gap > largest {
            largest = gap;
            sentence = Some(format!(
                "largest gap anywhere: {:.1} mm under a {:.1} m board along {} round u {:.0}, v {:.0} mm",
                gap * 1000.0,
                template.chord,
                lines[0].name,
                place[0] * 1000.0,
                place[1] * 1000.0
            ));
        }
    }
    Ok((found, sentence))
}

fn field(grid: PlateGrid, deviation: Deviation) -> Field {
    let state = deviation.seen.iter().map(|seen| if *seen { NodeState::Seen } else { NodeState::Unseen });
    grid.scalar("deviation", "m", deviation.value, state.collect())
}

platen_sdk::export!(comparison TemplateGap);

#[cfg(test)]
mod tests;
