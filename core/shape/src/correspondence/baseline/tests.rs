use super::*;
use crate::flatten::closed_form::{ClosedForm, cone, cylinder, half_bent, sphere_of_fibres};

/// Returns a blank of 4004 x 2997 mm; its diagonals differ by 5 mm, one edge bulges by 2 mm and one is hollow by 1 mm.
fn real() -> Blank {
    let corners = [[-3e-3, 0.75e-3], [4.001, 2.25e-3], [4.003, 2.99925], [-1e-3, 2.99775]];
    Blank { corners, bows: [0.0, 2e-3, -1e-3, 0.0], ..Blank::rectangle(4.0, 3.0) }
}

/// Returns the mesh of a plate cut as `blank` and bent by `surface`; its boundary vertices are evenly spaced on the
/// blank's outline.
fn bent(blank: &Blank, surface: impl Fn([f64; 2]) -> [f64; 3]) -> ClosedForm {
    let mut plate = ClosedForm::new(|[u, v]| [u, v, 0.0], [4.0, 3.0], [100, 75], 0.3, 1);
    let (n, places) = (plate.parts.boundary.len(), plate.parts.places.clone());
    for (uv, ordered) in plate.uv[..n].iter_mut().zip(&places) {
        *uv = *ordered;
    }
    plate.uv.iter_mut().for_each(|p| *p = stretched(blank, *p));
    plate.parts.vertices = plate.uv.iter().map(|&p| surface(p).into()).collect();
    plate
}

/// Maps the rectangle to the blank by blending the four edges (Coons).
fn stretched(blank: &Blank, [u, v]: [f64; 2]) -> [f64; 2] {
    let (s, t) = (u / 4.0, v / 3.0);
    let [bottom, right, top, left] =
        [blank.place(0, s), blank.place(1, t), blank.place(2, 1.0 - s), blank.place(3, 1.0 - t)];
    let [a, b, c, d] = blank.corners;
    [0, 1].map(|k| {
        (1.0 - t) * bottom[k] + t * top[k] + (1.0 - s) * left[k] + s * right[k]
            - ((1.0 - s) * ((1.0 - t) * a[k] + t * d[k]) + s * ((1.0 - t) * b[k] + t * c[k]))
    })
}

/// Returns the largest distance between two outlines.
fn apart(a: &Blank, b: &Blank) -> f64 {
    let at = |k: usize| (k % 4, (k / 4) as f64 / 100.0);
    let distance = |k: usize| {
        let ((edge, share), [p, q]) = (at(k), [a, b].map(|blank| blank.place(at(k).0, at(k).1)));
        debug_assert!(edge < 4 && share <= 1.0);
        (p[0] - q[0]).hypot(p[1] - q[1])
    };
    (0..404).map(distance).fold(0.0, f64::max)
}

#[test]
fn a_bulge_lies_outside_its_edge() {
    let mut blank = Blank::rectangle(4.0, 2.0);
    blank.bows = [0.5; 4];
    let middles = [0, 1, 2, 3].map(|edge| blank.place(edge, 0.5));
    assert_eq!(middles, [[2.0, -0.5], [4.5, 1.0], [2.0, 2.5], [-0.5, 1.0]]);
    assert_eq!(blank.place(2, 0.25), [3.0, 2.375]);
    assert_eq!([0, 1, 2, 3].map(|edge| blank.place(edge, 0.0)), blank.corners);
}

#[test]
fn the_measures_of_a_real_blank() {
    let blank = real();
    let [width, height] = blank.size();
    assert!((width - 4.004).abs() < 1e-6 && (height - 2.997).abs() < 1e-5, "{width} {height}");
    assert!((blank.diagonal_difference() - 5e-3).abs() < 1e-4, "{}", blank.diagonal_difference());
}

#[test]
fn the_outline_of_flat_and_rolled_blanks_is_measured() {
    let check = |name: &str, surface: &dyn Fn([f64; 2]) -> [f64; 3], bound: f64| {
        let found = Blank::of_mesh(&bent(&real(), surface).mesh().unwrap()).unwrap();
        let apart = apart(&found, &real());
        println!("{name}: {:.4} mm", apart * 1e3);
        assert!(apart < bound, "{name}: {apart:e} m");
    };
    check("flat", &|[u, v]| [0.6 * u - 0.8 * v, 1.0, 0.8 * u + 0.6 * v], 5e-6);
    check("rolled to R 5 m", &cylinder(5.0, 0.4), 3e-5);
    check("half bent to R 5 m", &half_bent(5.0, 2.0), 3e-5);
    check("cone", &cone([-7.0, 1.0], 0.6), 3e-5);
}

/// Fibres that keep their length in one direction are as far from least energy as a material law can be.
#[test]
fn a_blank_curved_two_ways_is_refused_when_the_law_of_the_material_matters() {
    let sphere = |radius: f64| {
        let plate = bent(&real(), sphere_of_fibres(radius, [4.0, 3.0])).mesh().unwrap();
        Blank::of_mesh(&plate).map(|found| apart(&found, &real()))
    };
    let shallow = sphere(80.0).unwrap();
    assert!((0.3e-3..0.5e-3).contains(&shallow), "{shallow:e}");
    assert!(matches!(sphere(40.0), Err(BlankError::Curved { .. })), "{:?}", sphere(40.0));
}

#[test]
fn another_plate_is_refused() {
    let other = Blank { corners: [[-0.025, 0.0], [4.025, 0.0], [4.025, 3.0], [-0.025, 3.0]], ..real() };
    let error = Blank::of_mesh(&bent(&other, |[u, v]| [u, v, 0.0]).mesh().unwrap()).unwrap_err();
    assert!(matches!(error, BlankError::OffSize { off, .. } if (off - 0.025).abs() < 1e-5), "{error:?}");
    assert_eq!(
        error.to_string(),
        "the blank is 4050.0 x 3000.0 mm and up to 25.0 mm off its rectangle as ordered, 20 mm at most; check width_mm and \
         height_mm, or which plate was scanned"
    );
}

#[test]
fn a_mesh_lies_on_the_outline_it_is_given() {
    let blank = real();
    let plate = bent(&blank, cylinder(5.0, 0.4));
    let (corners, arc) = (plate.parts.corners.map(|at| at as usize), &plate.parts.arc);
    for (at, place) in blank.places(corners, arc, plate.parts.edge_length).into_iter().enumerate() {
        let truth = plate.uv[at];
        assert!((truth[0] - place[0]).hypot(truth[1] - place[1]) < 1e-9, "vertex {at}: {place:?} {truth:?}");
    }
}
