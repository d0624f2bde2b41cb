use super::closed_form::*;
use super::*;

fn plate() -> ClosedForm {
    ClosedForm::new(cylinder(6.0, 0.4), [3.0, 2.0], [12, 8], 0.3, 7)
}

#[test]
fn a_bent_plate_has_the_edges_of_its_rectangle() {
    let plate = plate();
    let mesh = plate.mesh().unwrap();
    check_fit(&mesh).unwrap();
    for (length, side) in mesh.edge_length.iter().zip([3.0, 2.0, 3.0, 2.0]) {
        assert!((length - side).abs() < 1e-6, "{length} {side}");
    }
    for (&v, place) in mesh.boundary.iter().zip(&mesh.places) {
        let truth = plate.uv[v as usize];
        assert!((truth[0] - place[0]).hypot(truth[1] - place[1]) < 1e-6);
    }
    let edges = edges_of_vertices(&mesh);
    let corners = mesh.corners.map(|at| mesh.boundary[at as usize] as usize);
    assert_eq!(corners.map(|v| plate.uv[v]), [[0.0, 0.0], [3.0, 0.0], [3.0, 2.0], [0.0, 2.0]]);
    assert_eq!(corners.map(|v| edges[v]), [0b1001, 0b0011, 0b0110, 0b1100]);
    assert_eq!(interior(&mesh).1.len(), 11 * 7);
}

#[test]
fn turned_triangles_are_found() {
    let plate = plate();
    assert_eq!(first_turned(&plate.parts.triangles, &plate.uv), None);
    let mirrored: Vec<_> = plate.uv.iter().map(|p| [3.0 - p[0], p[1]]).collect();
    assert_eq!(first_turned(&plate.parts.triangles, &mirrored), Some(0));
}

#[test]
fn the_fixed_boundary_solve_keeps_linear_maps() {
    for cells in [[20, 13], [1, 1], [2, 2]] {
        let plate = ClosedForm::new(|[u, v]| [u, v, 0.0], [3.0, 2.0], cells, 0.3, 1);
        let mesh = plate.mesh().unwrap();
        let uv = fixed_boundary(&mesh, &cotangents(&mesh)).unwrap();
        assert!(plate.errors(&uv)[1] < 1e-12, "{:?}", plate.errors(&uv));
    }
}

fn refusal(spoil: impl FnOnce(&mut ClosedForm)) -> String {
    let mut plate = plate();
    spoil(&mut plate);
    check_fit(&plate.mesh().unwrap()).unwrap_err().to_string()
}

#[test]
fn what_does_not_fit_its_rectangle_is_refused() {
    let is = |error: String, says: &str| assert!(error.contains(says), "{error}");
    is(refusal(|p| p.parts.width = 2.0), "edge 0 is 3.000 m long, its side of the rectangle 2.000 m");
    is(refusal(|p| p.parts.vertices[20] = p.parts.vertices[19]), "degenerate");
}

#[test]
fn a_triangle_on_one_edge_is_refused() {
    let vertices = [[0.0, 0.0], [0.5, -0.01], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let mut plate = ClosedForm::new(|[u, v]| [u, v, 0.0], [1.0, 1.0], [1, 1], 0.0, 0);
    plate.parts.vertices = vertices.map(|[x, y]| crate::Vec3::new(x, y, 0.0)).to_vec();
    plate.parts.triangles = vec![[0, 2, 3], [0, 3, 4], [0, 1, 2]];
    plate.parts.boundary = (0..5).collect();
    plate.parts.corners = [0, 2, 3, 4];
    plate.parts.arc = vec![0.0, 0.5, 0.0, 0.0, 0.0];
    plate.parts.places.insert(1, [0.5, 0.0]);
    assert_eq!(check_fit(&plate.mesh().unwrap()), Err(UnfitMesh::Ear { triangle: 2, edge: 0 }));
}

fn chart_of(plate: &ClosedForm, weights: &[[f64; 3]]) -> Chart {
    Chart { uv: fixed_boundary(&plate.mesh().unwrap(), weights).unwrap(), sigma: None }
}

#[test]
fn a_right_chart_of_a_bent_plate_is_where_a_membrane_puts_it() {
    let plate = ClosedForm::new(cylinder(6.0, 0.4), [3.0, 2.0], [60, 40], 0.3, 7);
    let mesh = plate.mesh().unwrap();
    let found = Misplacement::of(&mesh, &chart_of(&plate, &cotangents(&mesh))).unwrap();
    // Found: 3.2 um, strains of 1.2e-5 and 4.5e-6, caused by the mesh.
    assert!(found.largest() < 6.4e-6 && found.strain < 2.4e-5 && found.explained < 9e-6, "{found:?}");
}

#[test]
fn a_chart_that_puts_material_elsewhere_is_measured_and_beyond_reason_refused() {
    let plate = ClosedForm::new(cylinder(6.0, 0.4), [3.0, 2.0], [60, 40], 0.3, 7);
    let mesh = plate.mesh().unwrap();
    let moved = |metres: f64| {
        let shift = |[u, v]: [f64; 2]| {
            let bump = (std::f64::consts::PI * u / 3.0).sin() * (std::f64::consts::PI * v / 2.0).sin();
            [u + metres * bump, v]
        };
        Chart { uv: plate.uv.iter().map(|p| shift(*p)).collect(), sigma: None }
    };
    for metres in [1e-4, 1e-3] {
        let found = Misplacement::of(&mesh, &moved(metres)).unwrap().largest();
        assert!((found / metres - 1.0).abs() < 0.1, "{found} of {metres}");
    }
    for chart in [moved(4e-3), chart_of(&plate, &vec![[1.0; 3]; mesh.triangles.len()])] {
        chart.check(&mesh).unwrap();
        let error = Misplacement::of(&mesh, &chart).unwrap_err().to_string();
        assert!(error.contains("it strains the plate by"), "{error}");
    }
}

#[test]
fn a_chart_with_a_moved_edge_or_an_uncertainty_that_is_none_is_refused() {
    let plate = plate();
    let mesh = plate.mesh().unwrap();
    let refused = |spoil: &dyn Fn(&mut Chart)| {
        let mut chart = Chart { uv: plate.uv.clone(), sigma: Some(vec![[0.0; 2]; plate.uv.len()]) };
        chart.check(&mesh).unwrap();
        spoil(&mut chart);
        chart.check(&mesh).unwrap_err().to_string()
    };
    for sigma in [f64::NAN, -1.0, f64::INFINITY] {
        let error = refused(&|chart| chart.sigma.as_mut().unwrap()[5] = [0.0, sigma]);
        assert!(error.contains("vertex 5 has a standard deviation"), "{error}");
    }
    let vertex = mesh.boundary[3] as usize;
    let error = refused(&|chart| chart.uv[vertex][1] -= 0.01);
    assert!(error.contains("edge 0 lies up to 10.0 mm off"), "{error}");
}
