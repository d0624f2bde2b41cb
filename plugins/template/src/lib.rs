//! Comparison `template`: the gap under a template, by one-sided contact, and the deviation from the whole target.
//!
//! A template is a gauge whose edge is the target's section along a reference line, `chord_mm` long. Shops check a bent
//! plate by laying the template on the plate and measuring the gap. This comparison computes that contact on the fitted
//! surface. It models a rigid body that rests on the plate, not a best fit. The method is this project's own.
//!
//! # Method
//!
//! *Seat of a template.* Let x be the distance along the template from its middle, and d(x) the height of the plate
//! over the template's edge in the section plane. The template rests on the lowest line a + b x >= d(x), and the gap is
//! a + b x - d(x). The seats are:
//!
//! | `seat` in the plate file | position of the template |
//! |---|---|
//! | `gravity` | lowest at its middle: the edge of the upper convex hull of d that spans the middle. With contacts closer than a quarter of the chord the template rocks, and the balanced seat is judged; where it lies flush (within 0.01 mm) it does not rock |
//! | `balanced` | equal gaps at both ends, one contact |
//! | `held` | both ends set on the plate; the gap has a sign |
//!
//! *Verdict.* The gap passes or fails its limit only if it differs from the limit by more than its 95 % uncertainty
//!
//! ```text
//! U = 1.96 sqrt(s_fit^2 + s_corr^2 w'w / 2 + s_true^2)
//! ```
//!
//! where
//!
//! - s_fit is the fit's standard deviation of w'z; z are the heights at the points that determine the gap, w their
//!   weights, with their covariances;
//! - s_corr is the plant's correlated error of a position for a pair of scans, of which a single scan has half the
//!   variance;
//! - s_true is the scanner's error of a gap on a known artefact.
//!
//! U is at least the value of a Monte Carlo method (JCGM 101:2008). It uses 64 plates that differ from the measured one
//! by drawn errors of the fit and by a wave of s_corr over the range, of any phase and a period of 0.8 to 1.4 m. On
//! each of them the template has its own seat. The value is the half width that contains 95 % of their gaps. A template
//! that is about to rock, or to fall on another contact, has either of two gaps; the weights w do not show this.
//!
//! The uncertainties of deviations contain the same errors for the whole target. They do not contain the uncertainty of
//! the positions (u, v) themselves. If a part of the plate was not seen, they also contain the change of the seat on
//! the whole surface, as the fit continues it there. The uncertainties of stations contain the same errors; that of a
//! curvature contains the second derivative of a correlated error whose period is 1 m of range.
//!
//! A contact or the largest gap in an area that was not seen gives `cannot_tell`. With several templates the figures
//! `gap.*` are those of the template with the largest gap relative to its limit.
//!
//! *Seat of the target.* The whole target is laid on the plate as a rigid surface, from the scanner's side. Its
//! direction is that of the least-squares rigid fit of all material points. Its height and tilts solve the linear
//! program "lowest over the middle of the plate, nowhere through the plate". The field `deviation` is measured minus
//! target along the target's normal in that seat, so no value is above zero. `deviation.gap` is the largest opening
//! under the target, and `in_tolerance` the share of the plate within the tolerance. The pair `deviation.max`,
//! `deviation.min` of the press, with `.rms` and `.p95`, refers to the best fit instead, which has deviations of both
//! signs.
//!
//! # Example
//!
//! ```toml
//! [[comparison]]
//! plugin = "template"
//! [comparison.options]
//! tolerance_mm = 6.0
//! ```
//!
//! # Options
//!
//! | key | unit | default | range | meaning |
//! |---|---|---|---|---|
//! | `tolerance_mm` | mm | smallest limit of the templates | 0 to 1000 | deviation that `in_tolerance` allows |
//! | `search` | | `true` | | also slide the first template over the whole plate, along u and along v |
//!
//! The templates themselves, `[[template]]`, and `[target]` are part of the plate file.
//!
//! # Figures
//!
//! | figure | unit | meaning |
//! |---|---|---|
//! | `gap.max`, `gap.uncertainty`, `gap.u`, `gap.v`, `gap.line` | m, 1 | largest gap relative to its limit, its uncertainty, place and template number |
//! | `sense` | 1 | -1 under-bent, 1 bent too far, 0 passed |
//! | `template.NAME.radius`, `.sagitta`, `.rocking` | m, m, rad | radius and sagitta of the plate under the template; range of tilts while it touches |
//! | `deviation.max`, `.min`, `.rms`, `.p95`, `.max_u`, ... | m | deviation from the best-fitting target |
//! | `deviation.gap`, `deviation.rocks`, `tolerance`, `in_tolerance` | m, 1 | target in its seat |
//! | `curvature.deviation` | 1 | mean curvature in the bending direction, relative to the target's, minus one |
//! | `gap.worst_along_u`, `gap.worst_along_v` | m | result of `search` |
//! | `station.NAME` | m, 1/m | figures of the plate file's stations |
//!
//! # Limits and errors
//!
//! Sideways curvature of an oblique line (a helix) is ignored, as with a real straight template. Refused are: a target
//! with an impossible radius; a template on an unknown line, longer than its line, or beyond an end of it; a line that
//! leaves the plate; a plate that was seen on one side of its middle only.

mod deviation;
mod evaluation;
mod figures;
mod linear_program;
mod scanner_sigma;
mod section;
mod target_seat;
mod trials;

use platen_model::{Centre, Figure, Findings, NodeState, Report, Task, Template, Verdict};
use platen_sdk::{Comparison, Error, ErrorKind, Info, Inputs, Job, PlateGrid, Result};
use platen_shape::TargetSurface;

use deviation::Deviation;
use evaluation::{Evaluated, Evaluator, FEW_PLACES};
use scanner_sigma::ScannerSigma;
use section::Line;
use trials::Trials;

platen_sdk::options! {
    /// Options of `template`.
    pub struct Options {
        /// Deviation that counts as within tolerance; default: the smallest limit of the templates.
        tolerance_mm: Option<f64>, unit "mm", min 0.0, max 1000.0;
        /// Whether the first template is also slid over the whole plate.
        search: bool = true;
    }
}

struct TemplateGap(Options);

/// Rounding allowed for points on the edge of the plate, metres.
const ON_EDGE: f64 = 1e-6;

impl Comparison for TemplateGap {
    const INFO: Info = Info::new(
        c"template",
        c"Template",
        c"Lays templates with the target's section, and the whole target, on the plate and judges the gaps.",
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

/// Compares the plate with its target. `check` fails when the job was cancelled.
fn compare(options: &Options, inputs: &Inputs, check: &dyn Fn() -> Result<()>) -> Result<Report> {
    let (task, now) = (&inputs.task, &inputs.now);
    let Some(target) = &task.target else {
        let says = vec!["cannot tell: the plate file names no target".into()];
        let findings = Findings { verdict: Some(Verdict::CannotTell), says, ..Findings::default() };
        return Ok(Report::new(findings, Vec::new()));
    };
    let target = TargetSurface::new(target, task.width, task.height, task.thickness)
        .map_err(|e| Error::new(ErrorKind::Config, e.to_string()))?;
    let scanner = ScannerSigma::of(task);
    let trials = Trials::draw(now, scanner);
    let evaluator = Evaluator { now, target: &target, scanner, trials: &trials };
    let lines = task.templates.iter().map(|t| on_line(task, t)).collect::<Result<Vec<_>>>()?;
    let mut evaluated = Vec::new();
    for (template, (line, centre)) in task.templates.iter().zip(&lines) {
        check()?;
        evaluated.push(evaluator.evaluate(template, line, *centre));
    }
    let deviation = Deviation::new(now, &target, &trials, check)?;

    let limits = task.templates.iter().map(|t| t.limit);
    let tolerance = options.tolerance_mm.map(|mm| mm / 1000.0).or_else(|| limits.reduce(f64::min));
    let mut found = figures::of_deviation(&deviation, &evaluator, tolerance);
    found.extend(figures::of_templates(&evaluated));
    found.extend(figures::of_curvature(now, &target));
    found.extend(figures::of_stations(task, &evaluator, &deviation, &evaluated));
    let mut says = says(&evaluated);
    if let (true, Some(template)) = (options.search, task.templates.first()) {
        let (anywhere, sentence) = search(&evaluator, task, template, check)?;
        found.extend(anywhere);
        says.extend(sentence);
    }
    let verdict = evaluated.iter().map(|j| j.finding.verdict).max().unwrap_or(Verdict::CannotTell);
    let templates = evaluated.into_iter().map(|j| j.finding).collect();
    let findings = Findings { verdict: Some(verdict), says, figures: found, templates };
    let state = deviation.seen.into_iter().map(NodeState::from).collect();
    let field = PlateGrid::new(now).scalar("deviation", "m", deviation.value, state);
    Ok(Report::new(findings, vec![field]))
}

/// Returns the line of a template and the position of the template on it.
///
/// # Errors
/// [`ErrorKind::Config`] when the line is unknown or leaves the plate, or the template does not fit on it.
fn on_line(task: &Task, template: &Template) -> Result<(Line, Centre)> {
    let refuse =
        |what: String| Err(Error::new(ErrorKind::Config, format!("template {}: {what}", template.name)));
    let Some(line) = task.reference_lines.iter().find(|line| line.name == template.line) else {
        return refuse(format!("no reference line has the name {:?}", template.line));
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
    let on_plate = Line::new(&line.name, line.from, line.to);
    let (chord, length) = (template.chord, on_plate.length);
    if chord.is_nan() || chord <= 0.0 || chord > length + ON_EDGE {
        let (chord, length) = (mm(chord), mm(length));
        return refuse(format!("its chord of {chord} mm does not fit its line {} of {length} mm", line.name));
    }
    if let Centre::At(at) = template.centre {
        let (first, last) = (0.5 * chord, length - 0.5 * chord);
        if !(first - ON_EDGE..=last + ON_EDGE).contains(&at) {
            let (at, first, last) = (mm(at), mm(first), mm(last));
            return refuse(format!(
                "a chord centred at {at} mm extends beyond an end of {}; its centre must lie from {first} to {last} mm",
                line.name
            ));
        }
    }
    Ok((on_plate, template.centre))
}

/// Returns one sentence for each template, the worst first.
fn says(evaluated: &[Evaluated]) -> Vec<String> {
    if evaluated.is_empty() {
        return vec!["cannot tell: the plate file names no template".into()];
    }
    let mut order: Vec<&Evaluated> = evaluated.iter().collect();
    order.sort_by(|a, b| {
        let (a, b) = (&a.finding, &b.finding);
        b.verdict.cmp(&a.verdict).then((b.max_gap.abs() / b.limit).total_cmp(&(a.max_gap.abs() / a.limit)))
    });
    order.iter().map(|j| format!("{}: {}", j.finding.name, j.finding.says)).collect()
}

/// Slides a template over the whole plate: reports the worst gap along u and along v, and a sentence if it exceeds the
/// limit.
fn search(
    evaluator: &Evaluator<'_>,
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
            let (centre, gap) = evaluator.worst(line, template.chord, template.seat, FEW_PLACES);
            if worst.is_none_or(|(most, _)| gap > most) {
                worst = Some((gap, line.at(centre)));
            }
        }
        let Some((gap, place)) = worst else { continue };
        found.push(Figure::new(name, gap, "m").at(place));
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

platen_sdk::export!(comparison TemplateGap);

#[cfg(test)]
mod tests;
