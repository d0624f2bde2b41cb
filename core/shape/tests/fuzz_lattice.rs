//! Fuzz test with thousands of small random scans: no panic, no hang, and no number that is not finite.

#[path = "support/harmonic.rs"]
mod harmonic;
#[path = "support/synthetic.rs"]
mod synthetic;

use harmonic::Harmonic;
use platen_scan::State;
use platen_shape::extract::Extractor;
use platen_shape::outline::outline;
use platen_shape::{Patch, Vec3, measure};
use synthetic::{Plate, Random, Scene};

/// Scans of some ten thousand cells, and of a few hundred, where every border and every least count is near.
const SCANS: u64 = 300;
const SMALL_SCANS: u64 = 10_000;

fn scene(seed: u64, steps: [f64; 2]) -> Scene {
    let mut random = Random::new(seed);
    let mut between = |low: f64, high: f64| low + (high - low) * random.uniform();
    let plate = Plate {
        width: between(0.2, 0.6),
        height: between(0.2, 0.5),
        thickness: between(0.0, 0.02),
        radius: Some(between(-1.0, 1.0)).filter(|r| r.abs() > 0.4),
        centre: Vec3::new(between(0.8, 1.6), between(-0.2, 0.2), between(-1.5, -0.3)),
        turn: between(-3.0, 3.0),
        tilt: between(-0.4, 0.4),
    };
    let step = between(steps[0], steps[1]);
    let person = [between(0.5, 1.5), between(-0.3, 0.3), between(0.01, 0.2), -2.0, between(-1.5, 0.5)];
    Scene {
        people: if between(0.0, 1.0) < 0.5 { vec![person] } else { Vec::new() },
        floor: between(-3.0, -1.0),
        step,
        footprint: between(0.0, 0.5) * step,
        sigma: between(0.0, 1.0).powi(6) * 0.02,
        tails: between(0.0, 0.2),
        dropouts: between(0.0, 1.0).powi(6),
        seed,
        ..Scene::of(plate)
    }
}

fn is_finite(patch: &Patch) -> bool {
    let finite = |v: &Vec3| v.iter().all(|c| c.is_finite());
    patch.samples.iter().all(|s| finite(&s.point) && s.sigma.is_finite())
        && patch.crossings.iter().all(|c| [c.inside, c.outside, c.normal].iter().all(finite))
}

#[test]
fn nothing_panics_and_all_numbers_are_finite() {
    let (mut patches, mut outlines, mut measurements) = (0, 0, 0);
    let seeds = (0..SCANS).map(|seed| (seed, [3e-3, 8e-3]));
    for (seed, steps) in seeds.chain((SCANS..SCANS + SMALL_SCANS).map(|seed| (seed, [1e-2, 5e-2]))) {
        let scene = scene(seed, steps);
        let (header, mut columns) = scene.scan();
        let mut random = Random::new(seed ^ 0xf00d);
        if random.uniform() < 0.2 {
            // Noise without any surface.
            for column in &mut columns {
                column.range_m.iter_mut().for_each(|r| *r *= 0.5 + random.uniform());
                column
                    .state
                    .iter_mut()
                    .for_each(|s| *s = if random.uniform() < 0.1 { State::NoReturn } else { *s });
            }
        }
        let mut extractor = Extractor::new(&header, &scene.spec());
        for column in &columns {
            assert_eq!(extractor.push(column), column.check(header.n_rows), "seed {seed}");
        }
        let Ok(patch) = extractor.finish() else { continue };
        assert!(is_finite(&patch), "seed {seed}");
        patches += 1;
        let Ok(outline) = outline(&patch, &scene.spec()) else { continue };
        let points =
            outline.edges.iter().flat_map(|e| &e.points).chain(outline.corners.iter().map(|c| &c.point));
        assert!(points.into_iter().all(|p| p.iter().all(|c| c.is_finite())), "seed {seed}");
        assert!(outline.corners.iter().all(|c| c.sigma.iter().all(|s| s.is_finite())), "seed {seed}");
        outlines += 1;
        let mut clock = std::time::Duration::default;
        if scene.spec().thickness > 0.0
            && let Ok(m) =
                measure(&patch, &outline, &scene.spec(), &scene.spec().rectangle(), &mut Harmonic, &mut clock)
        {
            assert!(m.corners.iter().all(|p| p.iter().all(|c| c.is_finite())), "seed {seed}");
            assert!(m.surface.spline().control.iter().flatten().all(|c| c.is_finite()), "seed {seed}");
            assert!(m.chart.uv.iter().flatten().all(|c| c.is_finite()), "seed {seed}");
            measurements += 1;
        }
    }
    println!("{patches} patches, {outlines} outlines, {measurements} measurements");
    // The test would be empty if hardly any scan reached these stages.
    assert!(patches > SCANS / 20 && outlines > SCANS / 50 && measurements > SCANS / 100);
}
