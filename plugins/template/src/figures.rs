//! Named figures of the comparison, as in the press's register map.

use platen_model::{Figure, Quantity, Task};
use platen_shape::{EXPANDED, Surface, TargetSurface};

use crate::deviation::Deviation;
use crate::evaluation::{Evaluated, Evaluator};

/// Templates whose distances from a station differ by less than this cross there, metres: half the usual distance of
/// points under a template.
const CROSSING: f64 = 5e-3;

/// Nodes along each side for the mean curvature, those of the result's grid.
const GRID: usize = 21;

/// Returns the figures of the whole plate's deviation: from the best-fitting target, whose two extremes measure the
/// difference of the shapes, and from the target in its seat.
pub(crate) fn of_deviation(
    deviation: &Deviation,
    evaluator: &Evaluator<'_>,
    tolerance: Option<f64>,
) -> Vec<Figure> {
    let Evaluator { now, target, scanner, trials } = *evaluator;
    let seen: Vec<usize> = (0..deviation.uv.len()).filter(|&i| deviation.seen[i]).collect();
    let value = |i: &usize| deviation.fitted[*i];
    let extreme =
        |sign: f64| seen.iter().copied().max_by(|a, b| (sign * value(a)).total_cmp(&(sign * value(b))));
    let (Some(max), Some(min)) = (extreme(1.0), extreme(-1.0)) else { return Vec::new() };
    let n = seen.len() as f64;
    let rms = (seen.iter().map(|i| value(i).powi(2)).sum::<f64>() / n).sqrt();
    let mut sizes: Vec<f64> = seen.iter().map(|i| value(i).abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let p95 = sizes[(0.95 * (n - 1.0)).round() as usize];

    let deepest = seen
        .iter()
        .copied()
        .fold(min, |deepest, i| if deviation.value[i] < deviation.value[deepest] { i } else { deepest });

    // The best fit depends on all points: its uncertainty is negligible compared with that of one point.
    let placed = |name: &str, i: usize| {
        let [u, v] = deviation.uv[i];
        let figure = Figure::new(name, deviation.fitted[i], "m");
        let sigma = now.sigma_point(u, v).hypot(scanner.of_heights([1.0]));
        figure.uncertainty(EXPANDED * sigma).at([u, v])
    };
    let mut figures = vec![
        placed("deviation.max", max),
        placed("deviation.min", min),
        Figure::new("deviation.rms", rms, "m"),
        Figure::new("deviation.p95", p95, "m"),
        Figure::new("deviation.max_u", deviation.uv[max][0], "m"),
        Figure::new("deviation.max_v", deviation.uv[max][1], "m"),
        Figure::new("deviation.min_u", deviation.uv[min][0], "m"),
        Figure::new("deviation.min_v", deviation.uv[min][1], "m"),
        Figure::new("deviation.gap", -deviation.value[deepest], "m")
            .uncertainty(EXPANDED * deviation.sigma(now, target, deviation.uv[deepest], scanner, trials))
            .at(deviation.uv[deepest]),
        Figure::new("deviation.rocks", f64::from(u8::from(deviation.rocks)), "1"),
    ];
    if let Some(tolerance) = tolerance {
        let within = seen.iter().filter(|&&i| -deviation.value[i] <= tolerance).count() as f64 / n;
        figures.extend([Figure::new("tolerance", tolerance, "m"), Figure::new("in_tolerance", within, "1")]);
    }
    figures
}

/// Returns the figures of the template with the largest gap relative to its limit, and each template's radius, sagitta
/// and play.
pub(crate) fn of_templates(evaluated: &[Evaluated]) -> Vec<Figure> {
    let share = |j: &Evaluated| j.finding.max_gap.abs() / j.finding.limit;
    let Some(worst) =
        (0..evaluated.len()).reduce(|a, b| if share(&evaluated[b]) > share(&evaluated[a]) { b } else { a })
    else {
        return Vec::new();
    };
    let finding = &evaluated[worst].finding;
    let mut figures = vec![
        Figure::new("gap.max", finding.max_gap, "m").uncertainty(finding.uncertainty).at(finding.max_gap_at),
        Figure::new("gap.uncertainty", finding.uncertainty, "m"),
        Figure::new("gap.u", finding.max_gap_at[0], "m"),
        Figure::new("gap.v", finding.max_gap_at[1], "m"),
        Figure::new("gap.line", (worst + 1) as f64, "1"),
        Figure::new("sense", f64::from(finding.sense), "1"),
    ];
    for j in evaluated {
        let named = |what: &str| format!("template.{}.{what}", j.finding.name);
        figures.extend(j.radius.map(|radius| Figure::new(named("radius"), radius, "m")));
        figures.push(Figure::new(named("sagitta"), j.sagitta, "m"));
        figures.push(Figure::new(named("rocking"), j.rocking, "rad"));
    }
    figures
}

/// Returns the mean curvature of the plate in the direction of bending, relative to the target's, minus one: -0.1 is a
/// tenth too little. `None` for a flat target.
pub(crate) fn of_curvature(now: &Surface, target: &TargetSurface) -> Option<Figure> {
    let (mut is, mut wanted) = (0.0, 0.0);
    for i in 0..GRID * GRID {
        let at = |k: usize, length: f64| length * k as f64 / (GRID - 1) as f64;
        let (u, v) = (at(i % GRID, now.width()), at(i / GRID, now.height()));
        if now.mask().seen(u, v) {
            let [measured, goal] = bending(now, target, [u, v]);
            is += measured;
            wanted += goal;
        }
    }
    // 1e-6 1/m in the mean: a radius of 1000 km.
    let flat = wanted.abs() <= 1e-6 * (GRID * GRID) as f64;
    (!flat).then(|| Figure::new("curvature.deviation", is / wanted - 1.0, "1"))
}

/// Returns the figures of the stations, except those that were not seen or have no template.
pub(crate) fn of_stations(
    task: &Task,
    evaluator: &Evaluator<'_>,
    deviation: &Deviation,
    evaluated: &[Evaluated],
) -> Vec<Figure> {
    let Evaluator { now, target, scanner, trials } = *evaluator;
    let mut figures = Vec::new();
    for station in &task.stations {
        let [u, v] = station.at;
        let figure = |value: f64, unit: &str, sigma: f64| {
            let figure = Figure::new(format!("station.{}", station.name), value, unit);
            figure.uncertainty(EXPANDED * sigma).at(station.at)
        };
        match station.quantity {
            Quantity::Gap => figures.extend(nearest_place(station.at, evaluated).map(|(template, place)| {
                let [gap, uncertainty] = evaluator.gap_at(template, place);
                figure(gap, "m", uncertainty / EXPANDED)
            })),
            _ if !now.mask().seen(u, v) => {}
            Quantity::Deviation => figures.push(figure(
                deviation.at(now, target, station.at),
                "m",
                deviation.sigma(now, target, station.at, scanner, trials),
            )),
            Quantity::CurvatureDeficit => {
                let sigma = now.sigma_curvature(u, v);
                let direction = target.bending(u, v);
                let fit = match direction {
                    Some([x, y]) => (x * x * sigma[0]).hypot(2.0 * x * y * sigma[2]).hypot(y * y * sigma[1]),
                    None => sigma[0].max(sigma[1]),
                };
                let sigma = fit.hypot(scanner.of_curvature(now, station.at, direction));
                figures.push(figure(target.deficit(&now.curvature(u, v), u, v), "1/m", sigma));
            }
        }
    }
    figures
}

/// Returns the curvatures of plate and target in the target's direction of bending, positive in the sense in which the
/// target bends; the mean curvature if the target has no such direction.
fn bending(now: &Surface, target: &TargetSurface, [u, v]: [f64; 2]) -> [f64; 2] {
    let goal = target.curvature(u, v);
    let direction = target.bending(u, v);
    [now.curvature(u, v), goal].map(|k| {
        let along = direction.map_or(0.5 * (k.u + k.v), |direction| k.along(direction));
        along * target.side()
    })
}

/// Returns the template nearest to `station` (the first of several that cross there) and the nearest point under it.
fn nearest_place(station: [f64; 2], evaluated: &[Evaluated]) -> Option<(&Evaluated, usize)> {
    let nearest = |template: &Evaluated| {
        let distance = |k: usize| {
            let [u, v] = template.places[k];
            (u - station[0]).hypot(v - station[1])
        };
        let places = (0..template.places.len()).map(|k| (k, distance(k)));
        places.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, f64::INFINITY))
    };
    let of_each: Vec<(usize, f64)> = evaluated.iter().map(nearest).collect();
    let least = of_each.iter().map(|(_, distance)| *distance).reduce(f64::min)?;
    let first = of_each.iter().position(|(_, distance)| *distance <= least + CROSSING)?;
    Some((&evaluated[first], of_each[first].0))
}
