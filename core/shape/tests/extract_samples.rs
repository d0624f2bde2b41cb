//! The face found in the sample plates, against their truth.

mod support;

use platen_shape::Vec3;
use platen_shape::extract::{Extractor, Refusal};
use platen_tests::samples;

/// Mixed pixels counted by the truth are not a loss, and a few samples of the side face are allowed.
#[test]
fn the_face_is_found_to_the_sample() {
    for folder in samples::plates() {
        let sample = support::read(&folder);
        let patch = support::extract(&sample, 0..sample.columns.len()).unwrap();
        let expected = sample.truth["counts"]["plate_top_valid_unmixed"].as_f64().unwrap();
        let ratio = patch.samples.len() as f64 / expected;
        let noise = sample.truth["lattice"]["sigma_plate_mm"].as_f64().unwrap() / 1000.0;
        println!("{}: {ratio:.4} of the truth, noise {:.4}", folder.display(), patch.noise / noise);
        // Found: 1.0004 to 1.0012, a few samples of the side faces; noise 0.998 to 1.026 of the truth.
        assert!((0.995..1.0024).contains(&ratio), "{ratio}");
        assert!((patch.noise / noise - 1.0).abs() < 0.053, "{} against {noise}", patch.noise);
        let plane = |point: Vec3| point.iter().all(|c| c.is_finite());
        assert!(patch.samples.iter().all(|s| plane(s.point) && s.sigma > 0.0));
    }
}

#[test]
fn the_order_of_arrival_does_not_matter() {
    for folder in samples::each("plates/p6_occluded") {
        let sample = support::read(&folder);
        let n = sample.columns.len();
        let forwards = support::extract(&sample, 0..n).unwrap();
        assert_eq!(forwards, support::extract(&sample, (0..n).rev()).unwrap());
        // 397 has no factor in common with the number of columns: every column comes once, far from the previous one.
        assert_ne!(n % 397, 0);
        assert_eq!(forwards, support::extract(&sample, (0..n).map(|i| i * 397 % n)).unwrap());
    }
}

/// An evaluated component is held in addition to the columns, with the same number of cells in either order of arrival.
/// Of the plate that the project ships, the first one, no cell is dropped.
#[test]
fn a_plate_is_evaluated_before_the_last_column_in_either_order() {
    let sample = support::read(&samples::each("plates/p1_cylinder")[0]);
    let held = |order: &mut dyn Iterator<Item = usize>| {
        let mut extractor = Extractor::new(&sample.header, &sample.spec);
        order.for_each(|i| extractor.push(&sample.columns[i]).unwrap());
        extractor.cells_held()
    };
    let n = sample.columns.len();
    let (forwards, backwards) = (held(&mut (0..n)), held(&mut (0..n).rev()));
    assert_ne!(n % 397, 0);
    let mixed = held(&mut (0..n).map(|i| i * 397 % n));
    println!("{forwards} cells held, {backwards} in reverse, {mixed} in no order");
    assert!(forwards == backwards && backwards > mixed);
}

#[test]
fn another_size_is_refused_with_both_sizes() {
    for folder in samples::each("plates/p4a_stroke") {
        let mut sample = support::read(&folder);
        (sample.spec.width, sample.spec.height) = (4.0, 2.5);
        let refusal = support::extract(&sample, 0..sample.columns.len()).err().unwrap();
        println!("{refusal}");
        let Refusal::WrongSize { found_mm, .. } = refusal else { panic!("{refusal}") };
        assert!((found_mm[0] - 3000.0).abs() < 60.0 && (found_mm[1] - 2500.0).abs() < 60.0);
    }
}
