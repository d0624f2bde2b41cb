mod boundary_springs;
mod least_energy;
mod membrane;

use crate::chart::elastic;
use crate::membrane::{Membrane, Strained};
use least_energy::sphere_of_least_energy;
use platen_numerics::random::Random;
use platen_shape::flatten::closed_form::*;
use platen_shape::flatten::{check_fit, cotangents, first_turned, fixed_boundary};
use platen_shape::{Chart, DiskMesh, Vec3};

fn chart(plate: &ClosedForm) -> Chart {
    let chart = elastic(&plate.mesh().unwrap(), 0.3, || Ok(())).unwrap();
    assert_eq!(first_turned(&plate.parts.triangles, &chart.uv), None);
    chart
}

fn harmonic_errors(plate: &ClosedForm) -> [f64; 2] {
    let mesh = plate.mesh().unwrap();
    plate.errors(&fixed_boundary(&mesh, &cotangents(&mesh)).unwrap())
}

/// Returns the mean and the largest reported uncertainty, metres.
fn uncertainty(chart: &Chart) -> [f64; 2] {
    let lengths: Vec<_> = chart.sigma.iter().flatten().map(|s| s[0].hypot(s[1])).collect();
    [lengths.iter().sum::<f64>() / lengths.len() as f64, lengths.iter().copied().fold(0.0, f64::max)]
}

fn with_sigma(mut plate: ClosedForm, sigma: f64) -> ClosedForm {
    plate.parts.edge_sigma = [sigma; 4];
    plate.parts.corner_sigma = [[sigma; 2]; 4];
    plate
}

/// A plate that was cut out of square, with bowed edges, and rolled: the springs act across its real edges.
#[test]
fn a_plate_cut_off_its_rectangle_keeps_its_places() {
    let size = [4.0, 3.0];
    let mut plate = with_sigma(ClosedForm::new(|[u, v]| [u, v, 0.0], size, [60, 45], 0.3, 3), 1e-5);
    let cut = |[u, v]: [f64; 2]| {
        let (s, t) = (u / size[0], v / size[1]);
        [u + 4e-3 * s + 3e-3 * t + 8e-3 * s * t * (1.0 - t), v - 3e-3 * t - 4e-3 * t * s * (1.0 - s)]
    };
    let rolled = cylinder(5.0, 0.4);
    plate.uv.iter_mut().for_each(|p| *p = cut(*p));
    plate.parts.vertices = plate.uv.iter().map(|&p| rolled(p).into()).collect();
    let n = plate.parts.boundary.len();
    plate.parts.places.copy_from_slice(&plate.uv[..n]);
    let [mean, max] = plate.errors(&chart(&plate).uv);
    // Found: 2.8 and 7.9 um, of the mesh.
    assert!(mean < 6e-6 && max < 1.6e-5, "mean {mean:e}, max {max:e}");
    // On the rectangle the corner (W, H) alone is 7 mm off.
    plate.parts.places = platen_shape::Blank::rectangle(size[0], size[1]).places(
        plate.parts.corners.map(|at| at as usize),
        &plate.parts.arc,
        plate.parts.edge_length,
    );
    assert!(plate.errors(&chart(&plate).uv)[0] > 1e-3);
}

#[test]
fn a_flat_plate_keeps_its_places() {
    let plate = ClosedForm::new(|[u, v]| [1.0, u, v], [5.0, 2.0], [50, 20], 0.3, 3);
    let chart = chart(&plate);
    assert!(plate.errors(&chart.uv)[1] < 1e-12);
    assert!(strain(&plate, &chart).iter().flatten().all(|e| e.abs() < 1e-12));
}

#[test]
fn developable_plates_are_exact_to_second_order_of_the_mesh() {
    let check = |surface: &dyn Fn([f64; 2]) -> [f64; 3], size: [f64; 2]| {
        let error = |n: u32| {
            let plate = ClosedForm::new(surface, size, [3 * n, 2 * n], 0.0, 0);
            plate.errors(&chart(&plate).uv)[1]
        };
        let [coarse, fine] = [error(8), error(32)];
        // Found: 1.6 to 5.7 um.
        assert!(fine < 1.2e-5, "{fine:e} m");
        assert!(coarse / fine > 12.0, "order {}", (coarse / fine).log2() / 2.0);
    };
    check(&cylinder(8.0, 0.5), [3.0, 2.5]);
    check(&cone([-7.0, 1.0], 0.6), [3.0, 2.0]);
    check(&half_bent(5.0, 2.5), [5.0, 2.5]);
}

/// 0.24 mm in the mean, 0.38 mm at most, when the fibres keep their length. So is the stated uncertainty.
#[test]
fn on_a_sphere_of_stiff_fibres_the_error_is_the_uncertainty() {
    let size = [2.5, 5.0];
    let plate = with_sigma(ClosedForm::new(sphere_of_fibres(10.0, size), size, [50, 100], 0.3, 2), 1e-6);
    let chart = chart(&plate);
    let ([mean, max], [said_mean, said_max]) = (plate.errors(&chart.uv), uncertainty(&chart));
    assert!((0.22e-3..0.25e-3).contains(&mean) && (0.36e-3..0.41e-3).contains(&max), "{mean:e} {max:e}");
    assert!(
        // Found: 0.7 % and 0.02 % apart, by the grid of the bound.
        (said_mean / mean - 1.0).abs() < 0.015 && (said_max / max - 1.0).abs() < 0.015,
        "{said_mean:e} {said_max:e}"
    );
}

/// Comparison with a minimum found without a mesh. The harmonic map is wrong by a millimetre there.
#[test]
fn on_a_sphere_of_least_energy_it_is_right() {
    for (radius, size) in [(10.0, [2.5, 5.0]), (8.0, [3.0, 2.5]), (15.0, [5.0, 2.5])] {
        let truth = sphere_of_least_energy(radius, size, 0.3);
        let plate = with_sigma(ClosedForm::new(truth, size, [60, 60], 0.3, 2), 1e-5);
        let [mean, max] = plate.errors(&chart(&plate).uv);
        let [harmonic, _] = harmonic_errors(&plate);
        // Found: at most 3.9 and 20 um.
        assert!(mean < 8e-6 && max < 4e-5, "R {radius} {size:?}: mean {mean:e}, max {max:e}");
        assert!(harmonic > 30.0 * mean, "harmonic {harmonic:e}");
    }
}

/// The strain of a sphere of stiff fibres is known: none along the fibres, shrinkage across them. The reported strain
/// differs by the material law, but its incompatibility does not: any law has the sphere's Gaussian curvature.
#[test]
fn the_strain_is_compatible_with_the_curvature_of_the_sphere() {
    let (radius, size, n) = (10.0, [2.5, 2.5], 40);
    let plate = ClosedForm::new(sphere_of_least_energy(radius, size, 0.3), size, [n; 2], 0.0, 0);
    let strain = strain(&plate, &chart(&plate));
    let at = |i: u32, j: u32| {
        let near = |p: &[f64; 2], q: [f64; 2]| (p[0] - q[0]).hypot(p[1] - q[1]) < 1e-9;
        let place = [size[0] * f64::from(i) / f64::from(n), size[1] * f64::from(j) / f64::from(n)];
        strain[plate.uv.iter().position(|p| near(p, place)).unwrap()]
    };
    // St. Venant's compatibility at the centre, differences over 4 cells: E_uu,vv + E_vv,uu - 2 E_uv,uv = -K.
    let (c, d) = (n / 2, 4);
    let step = size[0] * f64::from(d) / f64::from(n);
    let second = |k: usize, (i, j): (u32, u32)| {
        (at(c + i, c + j)[k] - 2.0 * at(c, c)[k] + at(c - i, c - j)[k]) / (step * step)
    };
    let mixed = at(c + d, c + d)[2] - at(c + d, c - d)[2] - at(c - d, c + d)[2] + at(c - d, c - d)[2];
    let owed = second(0, (0, d)) + second(1, (d, 0)) - 2.0 * mixed / (4.0 * step * step);
    // Found: 1.1 %, of the differences over 4 cells.
    assert!((owed * radius * radius + 1.0).abs() < 0.023, "{} of -K", owed * radius * radius);
}

/// The outline lies 0.2 mm too far inside on all sides: on a rolled plate its own dimensions correct this.
#[test]
fn a_wrong_inset_is_shared_by_the_edges() {
    let (size, inset) = ([3.0, 2.5], 2e-4);
    let seen =
        |[u, v]: [f64; 2]| [inset + u * (1.0 - 2.0 * inset / 3.0), inset + v * (1.0 - 2.0 * inset / 2.5)];
    let mut plate =
        ClosedForm::new(|p| cylinder(6.0, 0.3)(seen(p)), size, [60, 50], 0.3, 2).with_noise(5e-5, 3);
    plate.uv.iter_mut().for_each(|p| *p = seen(*p));
    let error = |sigma: f64| plate.errors(&chart(&with_sigma(plate.clone(), sigma)).uv)[0];
    let [hard, soft] = [error(1e-6), error(2e-4)];
    assert!(hard > 1.4e-4 && soft < 1.5e-5, "held hard {hard:e} m, softly {soft:e} m");
}

#[test]
fn noise_across_a_smooth_surface_does_little() {
    let plate = ClosedForm::new(cylinder(6.0, 0.3), [3.0, 2.5], [75, 62], 0.3, 2).with_noise(5e-5, 3);
    let [mean, max] = plate.errors(&chart(&plate).uv);
    assert!(mean < 1e-5 && max < 1e-4, "{mean:e} {max:e}");
}

#[test]
fn the_chart_does_not_depend_on_where_the_plate_lies() {
    let plate = ClosedForm::new(sphere_of_fibres(9.0, [3.0, 2.5]), [3.0, 2.5], [30, 25], 0.3, 8);
    let mut moved = plate.clone();
    let (sin, cos) = 0.7_f64.sin_cos();
    let turn = |p: &Vec3| Vec3::new(cos * p.z - sin * p.x + 4.0, p.y - 7.0, cos * p.x + sin * p.z + 1.0);
    moved.parts.vertices.iter_mut().for_each(|p| *p = turn(p));
    let [a, b] = [chart(&plate), chart(&moved)];
    let apart = a.uv.iter().zip(&b.uv).map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1])).fold(0.0, f64::max);
    assert!(apart < 1e-9, "{apart:e}");
    assert_eq!(a, chart(&plate), "not the same to the last bit");
}

#[test]
fn it_stops_at_cancellation() {
    let plate = ClosedForm::new(sphere_of_fibres(9.0, [3.0, 2.5]), [3.0, 2.5], [9, 8], 0.3, 8);
    let stop = || platen_sdk::Error::new(platen_sdk::ErrorKind::Cancelled, "stop");
    let stopped = elastic(&plate.mesh().unwrap(), 0.3, || Err(stop()));
    assert_eq!(stopped.unwrap_err(), stop());
}

/// Small meshes of every kind, with noise up to the size of the cells: no panic, every number finite, no inverted
/// triangle.
#[test]
fn random_small_meshes_give_charts_or_are_refused() {
    let mut refused = 0;
    for seed in 0..2000 {
        let mut random = Random::new(seed);
        let cells = [1 + (random.unit() * 9.0) as u32, 1 + (random.unit() * 9.0) as u32];
        let size = [0.5 + 5.0 * random.unit(), 0.5 + 5.0 * random.unit()];
        let radius = 2.0 + 20.0 * random.unit();
        let smooth = random.unit() < 0.5;
        let noise = random.unit() * if smooth { 1e-3 } else { 0.3 };
        let plate = ClosedForm::new(sphere_of_fibres(radius, size), size, cells, 0.45 * random.unit(), seed)
            .with_noise(noise, seed);
        let mesh = plate.mesh().unwrap_or_else(|e| panic!("seed {seed}: {e}"));
        if check_fit(&mesh).is_err() {
            refused += 1;
            continue;
        }
        match elastic(&mesh, 0.3, || Ok(())) {
            Ok(chart) => {
                assert_eq!(first_turned(&mesh.triangles, &chart.uv), None, "seed {seed}");
                assert!(chart.sigma.iter().flatten().flatten().all(|x| x.is_finite()), "seed {seed}");
            }
            Err(e) => {
                assert!(!smooth, "seed {seed}: {e}");
                refused += 1;
            }
        }
    }
    // Found: 184 of 2000.
    assert!(refused < 370, "{refused} refused");
}

/// Returns Green's strain at every vertex.
fn strain(plate: &ClosedForm, chart: &Chart) -> Vec<[f64; 3]> {
    let mesh = plate.mesh().unwrap();
    strain_of_vertices(&mesh, &Membrane::new(&mesh, 0.3).strains(&chart.uv))
}

/// Returns the area-weighted mean strain of the triangles at each vertex: uu, vv, uv.
fn strain_of_vertices(mesh: &DiskMesh, strains: &[Strained]) -> Vec<[f64; 3]> {
    let mut sums = vec![(0.0, [0.0; 3]); mesh.vertices.len()];
    for (t, s) in mesh.triangles.iter().zip(strains) {
        for &v in t {
            let (area, sum) = &mut sums[v as usize];
            *area += s.area;
            (0..3).for_each(|k| sum[k] += s.area * s.strain[k]);
        }
    }
    sums.into_iter().map(|(area, sum)| sum.map(|s| s / area)).collect()
}
