//! Corners and edges of the sample plates, against their truth. Left out when the samples are absent.

mod support;

use platen_shape::outline::{OutlineError, outline};

#[test]
fn corners_are_where_the_truth_has_them() {
    for folder in support::plate_folders() {
        let sample = support::read(&folder);
        let patch = support::extract(&sample, 0..sample.columns.len()).unwrap();
        let outline = outline(&patch, &sample.spec).unwrap();
        let off = |k: usize| (outline.corners[k].point - support::vec3(&sample.truth["corners_m"][k])).norm();
        let rms_mm = ((0..4).map(|k| off(k).powi(2)).sum::<f64>() / 4.0).sqrt() * 1000.0;
        println!("{}: corners {rms_mm:.2} mm rms", folder.display());
        assert!(rms_mm < 0.9, "{rms_mm}");
    }
}

#[test]
fn a_hint_between_two_edges_and_another_size_are_refused() {
    let Some(folder) = support::plate_folders().into_iter().next() else { return };
    let mut sample = support::read(&folder);
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
