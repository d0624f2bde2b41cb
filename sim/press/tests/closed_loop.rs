//! Closed-loop test: the press bends by the results until the template fits; the results are computed from the
//! closed-form plate.
#![expect(clippy::unwrap_used, reason = "a plate that cannot be bent must fail the test")]

use platen_sim_plate::{Plan, Plate, Shape};
use platen_sim_press::HBlock;
use platen_sim_press::forming_model::{FormingModel, Next, PlateConfig, Strategy};
use platen_sim_press::registers::{h, status};

const CHORD: f64 = 2.0;
const LIMIT: f64 = 0.003;
/// Points on each half of a template: every 50 mm, between which the plates here rise by less than 0.05 mm.
const N: i32 = 20;

/// Contact of a template of the target's radius at one place of the plate: largest gap, its position along the line,
/// and the sense.
#[derive(Clone, Copy, Debug)]
struct Gap {
    gap: f64,
    at: f64,
    sense: i16,
}

/// Places the template on `surface(s)` (height over the line, metres) from -CHORD/2 to CHORD/2. It rests on the edge of
/// the upper convex hull below its middle.
fn lay(radius: f64, surface: impl Fn(f64) -> f64) -> Gap {
    let points: Vec<(f64, f64)> = (-N..=N)
        .map(|i| {
            let s = f64::from(i) / f64::from(N) * CHORD / 2.0;
            (s, surface(s) - (radius - (radius * radius - s * s).sqrt()))
        })
        .collect();
    let mut hull: Vec<(f64, f64)> = Vec::new();
    for &(x, y) in &points {
        while let [.., a, b] = hull[..]
            && (b.1 - a.1) * (x - a.0) <= (y - a.1) * (b.0 - a.0)
        {
            hull.pop();
        }
        hull.push((x, y));
    }
    let edge = hull.windows(2).find(|edge| edge[1].0 >= 0.0).unwrap();
    let slope = (edge[1].1 - edge[0].1) / (edge[1].0 - edge[0].0);
    let gap = |&(s, d): &(f64, f64)| edge[0].1 + slope * (s - edge[0].0) - d;
    let worst = points.iter().max_by(|a, b| gap(a).total_cmp(&gap(b))).unwrap();
    let sense = match gap(worst) {
        gap if gap <= LIMIT => 0,
        _ if worst.0.abs() > CHORD / 4.0 => -1,
        _ => 1,
    };
    Gap { gap: gap(worst), at: worst.0, sense }
}

/// Returns the result of the worst template on lines along u and along v through the plate's middle, centred at
/// `centres`.
fn measure(model: &FormingModel, radii: [Option<f64>; 2], centres: &[f64]) -> HBlock {
    let plate = Plate::new(model.state()).unwrap();
    let half = 2.0;
    let mut worst: Option<(Gap, [f64; 2])> = None;
    for (along_v, radius) in radii.into_iter().enumerate().filter_map(|(i, r)| Some((i == 1, r?))) {
        for centre in centres {
            let uv = |s: f64| if along_v { [half, centre + s] } else { [centre + s, half] };
            let [u, v] = uv(0.0);
            let (origin, normal) = (plate.top(u, v), plate.normal(u, v));
            let gap = lay(radius, |s| {
                let [u, v] = uv(s);
                (plate.top(u, v) - origin).dot(&normal)
            });
            if worst.is_none_or(|(worst, _)| gap.gap > worst.gap) {
                worst = Some((gap, uv(gap.at)));
            }
        }
    }
    let (gap, at) = worst.unwrap();
    let mut words = [0; 64];
    words[h::STATUS] = status::RESULT_VALID | if gap.sense == 0 { status::PASS } else { status::FAIL };
    words[h::GAP_MAX] = (gap.gap * 1e5).round() as u16;
    words[h::GAP_U] = ((at[0] * 1e3).round() as i16).cast_unsigned();
    words[h::GAP_V] = ((at[1] * 1e3).round() as i16).cast_unsigned();
    words[h::SENSE] = gap.sense.cast_unsigned();
    HBlock(words)
}

/// Bends until the press ends the part; returns the number of strokes and the gaps in millimetres.
fn press(config: &PlateConfig, radii: [Option<f64>; 2], centres: &[f64]) -> (bool, Vec<f64>) {
    let mut model = FormingModel::new(config, Strategy::ClosedLoop, 1).unwrap();
    let mut gaps = Vec::new();
    for _ in 0..80 {
        let result = measure(&model, radii, centres);
        gaps.push(result.gap_max_mm().unwrap());
        model.record_result(&result);
        match model.next(0) {
            Next::Bend(stroke) => model.bend(&stroke).unwrap(),
            Next::Rescan | Next::Wait => return (false, gaps),
            Next::End => return (result.sense() == 0, gaps),
        }
    }
    (false, gaps)
}

#[test]
fn the_press_bends_until_the_template_fits() {
    let inside = |radius_mm: f64| (radius_mm - 17.5) * 1e-3;
    let middle = [2.0];
    let everywhere = [1.0, 1.25, 1.5, 1.75, 2.0, 2.25, 2.5, 2.75, 3.0];
    for share in [0.8, 1.0, 1.1] {
        for (name, target, radii) in [
            (
                "along u",
                Shape::Cylinder { radius_mm: 12_017.5, axis_deg: 90.0 },
                [Some(inside(12_017.5)), None],
            ),
            ("along v", Shape::Cylinder { radius_mm: 8_017.5, axis_deg: 0.0 }, [None, Some(inside(8_017.5))]),
            ("sphere", Shape::Sphere { radius_mm: 12_017.5 }, [Some(inside(12_017.5)); 2]),
        ] {
            for centres in [&middle[..], &everywhere[..]] {
                let plan = Plan { passes: 1, springback_scatter: 0.1, ..Plan::default() };
                let config = PlateConfig { target: target.clone(), share, plan, ..PlateConfig::default() };
                let (fits, gaps) = press(&config, radii, centres);
                let tail = &gaps[gaps.len().saturating_sub(12)..];
                println!(
                    "{name} {share} {}: {fits} after {} strokes {tail:.2?}",
                    centres.len(),
                    gaps.len() - 1
                );
                assert!(fits, "{name}, {share} of the target, {} templates: {tail:.2?}", centres.len());
            }
        }
    }
}
