//! Test of the strain rule: the strain of the face under a bend by the rule of the advice, compared with the fibre
//! model.

use platen_advice::strain::face_strain;
use platen_sim_plate::{FibreSteel, FibreStrip};

use super::hidden_plate::{HiddenPlate, THICKNESS, YIELD};

/// Fibres under a punch without width have a strain peak that no plate has, since a load spreads within the thickness.
/// Found: 0.77 % as the mean over a thickness, 1.00 % by the rule, 1.57 % in the peak at 20 mrad; 1.22, 1.55, 2.32 % at
/// 31; 1.71, 2.15, 3.04 % at 43; 3.83, 5.00, 5.47 % at 100.
#[test]
fn the_rule_for_the_strain_of_a_face_lies_between_the_fibres_mean_and_their_cusp() {
    let steel = FibreSteel { yield_strength: YIELD, thickness: THICKNESS };
    let press = HiddenPlate::press_of_shop();
    for angle in [0.020, 0.031, 0.043, 0.1] {
        let mut strip = FibreStrip::new(0.6, |_| steel, |_| 0.0);
        let depth = strip.depth_for(&press, 0.3, angle);
        strip.press(&press, 0.3, depth, false);
        let strains: Vec<f64> = strip.curvature().map(|curvature| 0.5 * THICKNESS * curvature).collect();
        let middle = &strains[strains.len() / 2 - 4..strains.len() / 2 + 4];
        let mean = middle.iter().sum::<f64>() / middle.len() as f64;
        let cusp = strains.iter().copied().fold(0.0, f64::max);
        let rule = face_strain(THICKNESS, 0.0, angle);
        println!(
            "{angle}: mean {:.2} %, rule {:.2} %, cusp {:.2} %",
            100.0 * mean,
            100.0 * rule,
            100.0 * cusp
        );
        assert!(mean < rule && rule < cusp, "{angle}: {mean} {rule} {cusp}");
    }
}
