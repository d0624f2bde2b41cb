//! Test of gaps from scans with a systematic error, after the scanner was calibrated on an artefact.

use platen_shape::inspection::calibration::{artefact_gaps, covering};

use super::*;

/// Amplitude of the systematic error, metres: as observed in the ranges of a phase scanner in the field.
const WAVE: f64 = 0.25e-3;

/// Returns a scan of a plate: 0.5 mm noise, and the scanner's range error, which depends on the position of the plate.
fn scan(radius: f64, seed: u64) -> Surface {
    let mut random = spread(seed ^ 0x5eed);
    let [phase, turn] = [random.f64(), random.f64()].map(|share| std::f64::consts::TAU * share);
    // The range changes by a metre over 1.2 m of a plate seen at 45 degrees; the period of its error is 0.8 m to 1.2 m.
    let wave_number = std::f64::consts::TAU / (0.8 + 0.4 * random.f64());
    let (sin, cos) = turn.sin_cos();
    let plate = goal(cylinder(radius), Facing::Inside);
    surface(16_700, 0.5e-3 * 0.1_f64.sqrt(), seed, |u, v| {
        let off = WAVE * (wave_number * (cos * u + sin * v) + phase).sin();
        (plate.point(u, v) + plate.normal(u, v) * off, plate.normal(u, v))
    })
}

#[test]
fn gaps_lie_within_their_uncertainty_after_calibration() {
    let shape = goal(cylinder(8.0), Facing::Inside);
    let gaps: Vec<_> = (0..12).flat_map(|seed| artefact_gaps(&scan(8.0, seed), &shape, 2.0, 0.0)).collect();
    let sigma_true = covering(&gaps);
    // Under a template the error is at most twice the wave, about two standard deviations.
    assert!((0.6 * WAVE..1.1 * WAVE).contains(&sigma_true), "{sigma_true}");

    let mut task = task(cylinder(8.0), Facing::Inside, Seat::Balanced);
    let (plates, mut before, mut after) = (200, 0, 0);
    for seed in 0..plates {
        // Every second plate is not bent enough; the radii differ enough from the target's that the gap has its sign.
        let radius = if seed % 2 == 0 { 9.0 + 0.01 * seed as f64 } else { 7.3 - 0.01 * seed as f64 };
        task.sigma_true = None;
        let truth =
            (contact::rise(radius - 0.5 * THICKNESS, 2.0) - contact::rise(8.0 - 0.5 * THICKNESS, 2.0)).abs();
        let now = scan(radius, 100 + seed);
        let uncalibrated = finding(&now, &task);
        task.sigma_true = Some(sigma_true);
        let found = finding(&now, &task);
        let off = (found.max_gap - truth).abs();
        before += u32::from(off <= uncalibrated.uncertainty);
        after += u32::from(off <= found.uncertainty);
    }
    println!(
        "systematic error of a gap {:.3} mm: {before} of {plates} gaps within their uncertainty before, {after} after",
        sigma_true * 1e3
    );
    // 190 expected; fewer than 183 of 200 has a chance of 1 in 100.
    assert!(after >= 183, "{after} of {plates}");
    assert!(before < 100, "the wave does not matter: {before} of {plates}");
}
