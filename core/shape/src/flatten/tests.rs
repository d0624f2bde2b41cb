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
