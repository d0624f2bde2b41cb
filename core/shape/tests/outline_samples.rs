//! Corners and edges of the sample plates, against their truth.

mod support;

use platen_shape::Vec3;
use platen_shape::extract::Patch;
use platen_shape::outline::{OutlineError, outline};
use platen_tests::samples;

#[test]
fn corners_are_where_the_truth_has_them() {
    let mut ratios = Vec::new();
    for folder in samples::plates() {
        let sample = support::read(&folder);
        let patch = support::extract(&sample, 0..sample.columns.len()).unwrap();
        let outline = outline(&patch, &sample.spec).unwrap();
        let off = |k: usize| (outline.corners[k].point - support::vec3(&sample.truth["corners_m"][k])).norm();
        let rms_mm = ((0..4).map(|k| off(k).powi(2)).sum::<f64>() / 4.0).sqrt() * 1000.0;
        println!("{}: corners {rms_mm:.2} mm rms", folder.display());
        // Found: 0.09 to 0.43 mm, at a lattice step of 8 mm.
        assert!(rms_mm < 0.82, "{rms_mm}");
        for k in 0..4 {
            let truth = |k: usize| support::vec3(&sample.truth["corners_m"][k % 4]);
            let corner = &outline.corners[k];
            let error = corner.point - truth(k);
            // Along the edge that leaves and against the one that arrives: both into the plate.
            let inwards =
                [truth(k + 1) - truth(k), truth(k + 3) - truth(k)].map(|v| v.normalize().dot(&error));
            let parts = [0, 1].map(|d| inwards[d] / corner.sigma[d]);
            println!("    inwards {:.2?} mm, {:.1?} standard deviations", inwards.map(|x| 1e3 * x), parts);
            ratios.extend(parts);
        }
    }
    if !ratios.is_empty() {
        let (n, sum) = (ratios.len() as f64, ratios.iter().sum::<f64>());
        let scatter = (ratios.iter().map(|x| x * x).sum::<f64>() / n).sqrt();
        println!("errors over stated deviations: mean {:.2}, rms {scatter:.2}", sum / n);
        // The errors scatter as stated, and no part of them is common to all edges.
        assert!((0.6..1.6).contains(&scatter) && (sum / n).abs() < 0.44);
    }
}

#[test]
fn a_hint_between_two_edges_and_another_size_are_refused() {
    let mut sample = support::read(&samples::plates()[0]);
    let patch = support::extract(&sample, 0..sample.columns.len()).unwrap();
    let edge = |k: usize| support::vec3(&sample.truth["corners_m"][k]);
    let (u, v) = ((edge(1) - edge(0)).normalize(), (edge(3) - edge(0)).normalize());
    sample.spec.u_axis = Some(u + 0.8 * v);
    let refusal = outline(&patch, &sample.spec).unwrap_err();
    println!("{refusal}");
    assert!(matches!(refusal, OutlineError::Hint { angle_deg } if (angle_deg - 38.7).abs() < 1.0));
    sample.spec.u_axis = Some(-u + 0.5 * v);
    let turned = outline(&patch, &sample.spec).unwrap();
    assert!((turned.corners[0].point - edge(2)).norm() < 0.005);
    sample.spec.u_axis = Some(v);
    let refusal = outline(&patch, &sample.spec).unwrap_err();
    println!("{refusal}");
    assert!(matches!(refusal, OutlineError::WrongSize { side: "width", .. }));
}

/// Crossings nearer to one edge than a limit are removed, up to a margin from its ends.
#[test]
fn an_edge_seen_at_its_ends_alone_is_reported_and_one_not_seen_is_refused() {
    let sample = support::read(&samples::plates()[0]);
    let patch = support::extract(&sample, 0..sample.columns.len()).unwrap();
    let corner = |k: usize| support::vec3(&sample.truth["corners_m"][k]);
    let (from, along) = (corner(0), (corner(1) - corner(0)).normalize());
    let length = (corner(1) - corner(0)).norm();
    let without = |near: f64, margin: f64| {
        let is_removed = |point: Vec3| {
            let at = (point - from).dot(&along);
            (point - from - along * at).norm() < near && (margin..length - margin).contains(&at)
        };
        let crossings = patch.crossings.iter().filter(|c| !is_removed(c.inside)).copied().collect();
        outline(&Patch { crossings, ..patch.clone() }, &sample.spec)
    };
    for (margin, seen) in [(0.1, true), (0.0, false)] {
        let found = without(0.1, margin).unwrap();
        for k in [0, 1] {
            let corner_found = &found.corners[k];
            let off = (corner_found.point - corner(k)).norm();
            let [a, b] = corner_found.sigma;
            println!("{margin} m: corner {k} {:.2} mm off, {:.2} stated", 1e3 * off, 1e3 * a.hypot(b));
            assert!(off < 2.0 * a.hypot(b) && corner_found.seen == seen, "{off} {corner_found:?}");
        }
    }
    let refused = without(0.15, 0.0).unwrap_err();
    assert!(matches!(refused, OutlineError::Corners { found: 2 }), "{refused}");
}
