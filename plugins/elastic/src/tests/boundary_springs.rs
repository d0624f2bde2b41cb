//! Test of energy and gradient of the boundary springs against their sum over the plate.

use crate::boundary_springs::BoundarySprings;
use platen_shape::flatten::closed_form::ClosedForm;

#[test]
fn a_shifted_plate_stretches_the_springs_across_its_shift() {
    let mut plate = ClosedForm::new(|[u, v]| [u, v, 0.0], [3.0, 2.0], [7, 5], 0.3, 1);
    let sigma = |k: usize| 1e-3 * (1.0 + k as f64);
    plate.parts.edge_sigma = [0, 1, 2, 3].map(sigma);
    plate.parts.corner_sigma = [4, 6, 8, 10].map(|k| [sigma(k), sigma(k + 1)]);
    let (strain, shift) = (1e-3, 1e-4);
    let springs = BoundarySprings::new(&plate.mesh().unwrap(), strain);
    // Edges u = W and u = 0, then at each corner the edge along u, which leaves the corners 0 and 2.
    for (axis, held_by) in [(0, [1, 3, 4, 7, 8, 11]), (1, [0, 2, 5, 6, 9, 10])] {
        let mut x = plate.uv.clone();
        x.iter_mut().for_each(|p| p[axis] += shift);
        let stiffness: f64 = held_by.iter().map(|&k| strain * strain * 6.0 / (sigma(k) * sigma(k))).sum();
        let energy = 0.5 * stiffness * shift * shift;
        assert!((springs.energy(&x) / energy - 1.0).abs() < 1e-9, "axis {axis}");
        let mut gradient = vec![[0.0; 2]; x.len()];
        springs.add_gradient(&x, &mut gradient);
        let force: f64 = gradient.iter().map(|g| g[axis]).sum();
        assert!((force / (stiffness * shift) - 1.0).abs() < 1e-9, "axis {axis}");
    }
}
