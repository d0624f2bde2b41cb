//! Tests of each error of the instrument alone, against its model.
#![expect(clippy::unwrap_used, reason = "a test that fails to build its plate must fail")]

use platen_sim_plate::{Plate, PlateState, Pose, Vec3};
use platen_sim_scanner::{
    Beam, Cyclic, Faces, Instrument, Label, Scene, SimColumn, SimLattice, SimState, Solid, WideErrors, scan,
    scan_all,
};
use std::ops::ControlFlow;

/// Returns a flat plate `distance` metres in front of the scanner, rotated by the incidence `incidence_deg`.
fn target(distance: f64, incidence_deg: f64) -> Scene {
    marked(distance, incidence_deg, Vec::new())
}

/// Returns the same with painted markers.
fn marked(distance: f64, incidence_deg: f64, markers_mm: Vec<[f64; 2]>) -> Scene {
    let mut state = PlateState::flat(2000.0, 2000.0, 20.0);
    let middle = [1e3 * distance, 0.0, 0.0];
    state.pose = Pose { centre_mm: middle, yaw_deg: 0.0, pitch_deg: -90.0 + incidence_deg, roll_deg: 0.0 };
    state.blank.markers_mm = markers_mm;
    Scene::of(Some(Plate::new(&state).unwrap()), Vec::new())
}

/// Returns a lattice of two degrees around the x axis.
fn narrow(step_deg: f64) -> SimLattice {
    let half = 1_f64.to_radians();
    SimLattice::covering(-half, 2.0 * half, -half, half, step_deg.to_radians())
}

/// Returns (true, measured) ranges of all valid cells on the plate's upper face that are not mixed.
fn ranges(columns: &[SimColumn]) -> Vec<(f64, f64)> {
    let cells = columns.iter().flat_map(|c| (0..c.state.len()).map(move |i| (c, i)));
    let sound = |c: &SimColumn, i: usize| {
        let truth = c.truth[i];
        c.state[i] == SimState::Valid && truth.label == Label::PlateTop && !truth.mixed
    };
    cells.filter(|(c, i)| sound(c, *i)).map(|(c, i)| (c.truth[i].range, f64::from(c.range_m[i]))).collect()
}

/// Returns mean, standard deviation and kurtosis of measured minus true.
fn moments(columns: &[SimColumn]) -> (f64, f64, f64) {
    let errors: Vec<f64> = ranges(columns).iter().map(|(truth, measured)| measured - truth).collect();
    let n = errors.len() as f64;
    assert!(n > 5000.0, "{n} cells");
    let mean = errors.iter().sum::<f64>() / n;
    let moment = |p: i32| errors.iter().map(|e| (e - mean).powi(p)).sum::<f64>() / n;
    (mean, moment(2).sqrt(), moment(4) / moment(2).powi(2))
}

fn noise(distance: f64, incidence_deg: f64, instrument: &Instrument) -> f64 {
    moments(&scan_all(&target(distance, incidence_deg), &narrow(0.02), instrument, 2)).1
}

#[test]
fn a_perfect_instrument_measures_the_truth() {
    let columns = scan_all(&target(8.0, 40.0), &narrow(0.05), &Instrument::perfect(), 1);
    for (truth, measured) in ranges(&columns) {
        assert!((truth - measured).abs() < 5e-7);
    }
    assert!(columns.iter().all(|c| c.state.iter().all(|s| *s == SimState::Valid)));
}

#[test]
fn noise_grows_with_range_and_incidence_as_data_sheets_say() {
    let instrument = Instrument::default();
    let reference = noise(10.0, 60.0, &instrument);
    assert!((reference / 0.5e-3 - 1.0).abs() < 0.03, "{reference}");
    // sqrt(0.25 + 0.75 (r / 10)^2)
    let far = noise(20.0, 60.0, &instrument) / reference;
    assert!((far - 3.25_f64.sqrt()).abs() < 0.06, "{far}");
    // (cos 60 / cos 80)^0.35
    let grazing = noise(10.0, 80.0, &instrument) / reference;
    assert!((1.38..1.52).contains(&grazing), "{grazing}");
    let doubled = noise(10.0, 60.0, &Instrument { range_sigma: 1e-3, ..instrument }) / reference;
    assert!((doubled - 2.0).abs() < 0.05, "{doubled}");
}

#[test]
fn heavy_tails_keep_the_standard_deviation() {
    let lattice = narrow(0.01);
    let kurtosis = |tail_dof| {
        let instrument = Instrument { tail_dof, ..Instrument::default() };
        moments(&scan_all(&target(10.0, 60.0), &lattice, &instrument, 2))
    };
    let (_, sigma, flat) = kurtosis(None);
    let (_, heavy_sigma, heavy) = kurtosis(Some(6.0));
    assert!((flat - 3.0).abs() < 0.2, "{flat}");
    // Student's t with 6 degrees of freedom: kurtosis 6.
    assert!((4.5..8.5).contains(&heavy) && (heavy_sigma / sigma - 1.0).abs() < 0.04, "{heavy} {heavy_sigma}");
}

#[test]
fn a_share_of_the_ranges_has_wide_errors_and_the_others_keep_theirs() {
    let lattice = narrow(0.01);
    let wide = WideErrors { share: 0.05, factor: 4.0 };
    let of = |wide_errors| {
        let instrument = Instrument { wide_errors, ..Instrument::default() };
        scan_all(&target(10.0, 60.0), &lattice, &instrument, 2)
    };
    let (plain, mixed) = (ranges(&of(None)), ranges(&of(Some(wide))));
    let pairs = plain.iter().zip(&mixed).map(|((truth, a), (_, b))| (a - truth, b - truth));
    let (mut n, mut changed) = (0.0, 0.0);
    for (a, b) in pairs.filter(|(a, _)| a.abs() > 2e-4) {
        n += 1.0;
        if (a - b).abs() > 1e-6 {
            changed += 1.0;
            assert!((b / a - 4.0).abs() < 0.05, "{a} {b}");
        }
    }
    assert!((changed / n - 0.05_f64).abs() < 0.01, "{changed} of {n}");
}

/// At a quarter of the reflectivity the amplitude is half, and the noise is that of a weaker echo (4^0.35).
#[test]
fn a_dark_plate_is_measured_with_more_noise() {
    let of = |reflectivity: f64| {
        let scene = target(8.0, 40.0).with_plate_reflectivity(reflectivity);
        let columns = scan_all(&scene, &narrow(0.02), &Instrument::default(), 2);
        let middle = columns[columns.len() / 2].intensity.iter().map(|i| f64::from(*i)).fold(0.0, f64::max);
        (moments(&columns).1, middle)
    };
    let (bright, dark) = (of(0.6), of(0.15));
    assert!((dark.0 / bright.0 / 4_f64.powf(0.35) - 1.0).abs() < 0.04, "{dark:?} {bright:?}");
    assert!((dark.1 / bright.1 - 0.5).abs() < 0.02, "{dark:?} {bright:?}");
}

#[test]
fn echoes_are_lost_by_chance_and_in_the_mirror_lobe() {
    let lost = |incidence_deg, instrument: &Instrument| {
        let columns = scan_all(&target(8.0, incidence_deg), &narrow(0.02), instrument, 2);
        let states: Vec<SimState> = columns.into_iter().flat_map(|c| c.state).collect();
        states.iter().filter(|s| **s == SimState::NoEcho).count() as f64 / states.len() as f64
    };
    let by_chance = lost(50.0, &Instrument::default());
    assert!((0.004..0.02).contains(&by_chance), "{by_chance}");
    let bright = Instrument { specular_lobe: Some(5_f64.to_radians()), ..Instrument::default() };
    assert!(lost(0.0, &bright) > 0.9 && lost(50.0, &bright) < 0.02);
}

#[test]
fn cyclic_error_has_its_period() {
    let cyclic = Cyclic { amplitude: 0.4e-3, period: 0.6, phase: 0.3 };
    let instrument = Instrument { cyclic: Some(cyclic), range_sigma: 0.0, ..Instrument::default() };
    for (truth, measured) in ranges(&scan_all(&target(9.0, 70.0), &narrow(0.05), &instrument, 1)) {
        let expected = 0.4e-3 * (std::f64::consts::TAU * truth / 0.6 + 0.3).sin();
        assert!((measured - truth - expected).abs() < 1e-6);
    }
}

#[test]
fn angular_noise_shows_as_range_noise_on_a_tilted_plate() {
    let instrument = Instrument { range_sigma: 0.0, angular_sigma: 0.1e-3, ..Instrument::default() };
    let columns = scan_all(&target(10.0, 60.0), &narrow(0.02), &instrument, 2);
    // The reported direction deviates from the beam's by 0.1 mrad: 1 mm across the beam, tan(60) of it along.
    let mut sum = 0.0;
    let mut n = 0.0;
    for column in &columns {
        for i in 0..column.truth.len() {
            let flat = column.elevation[i].cos() * column.azimuth[i].cos();
            let normal = Vec3::new(-0.5, 0.0, 0.75_f64.sqrt());
            let face = Vec3::new(10.0, 0.0, 0.0) + normal * 0.01;
            let direction = Vec3::new(
                flat,
                column.elevation[i].cos() * column.azimuth[i].sin(),
                column.elevation[i].sin(),
            );
            let nominal = normal.dot(&face) / normal.dot(&direction);
            sum += (column.truth[i].range - nominal).powi(2);
            n += 1.0;
        }
    }
    let found = f64::sqrt(sum / n) / (1e-3 * 60_f64.to_radians().tan());
    assert!((found - 1.0).abs() < 0.05, "{found}");
}

#[test]
fn ranges_mix_where_the_footprint_straddles_an_edge() {
    // Azimuths beyond the spot see one surface only.
    let cells = at_an_edge(0.005, Beam::Truncated);
    assert!(cells.iter().all(|(azimuth, mixed)| !mixed || *azimuth < 0.21e-3));
    let mixed = cells.iter().filter(|(_, mixed)| *mixed).count();
    assert!(mixed > 500, "{mixed}");
}

#[test]
fn a_beam_with_wings_mixes_beyond_its_width() {
    // The columns on both sides of the one at the edge are 0.22 mrad from it, 1.1 of the beam's radii; one of them has
    // a neighbour on the other surface.
    let mixed = |beam: Beam| {
        let cells = at_an_edge(0.0125, beam);
        let beside = cells.into_iter().filter(|(azimuth, _)| (0.21e-3..0.23e-3).contains(azimuth));
        beside.filter(|(_, mixed)| *mixed).count()
    };
    assert!(mixed(Beam::Winged) > 50, "{}", mixed(Beam::Winged));
    assert_eq!(mixed(Beam::Truncated), 0);
}

/// Scans a board's edge at y = 0, 3 m before a wall, with a beam of 0.2 mrad to each side. Returns for each cell its
/// distance from the edge, radians, and whether both surfaces are mixed, which is also visible in its range.
fn at_an_edge(step_deg: f64, beam: Beam) -> Vec<(f64, bool)> {
    let board = Solid::upright(Vec3::new(7.0, 1.0, 0.0), Vec3::new(0.02, 2.0, 2.0), 0.0);
    let wall = Solid::upright(Vec3::new(10.1, 0.0, 0.0), Vec3::new(0.2, 4.0, 4.0), 0.0);
    let scene = Scene::of(None, vec![(Label::Cabinet, board), (Label::Wall, wall)]);
    let instrument =
        Instrument { footprint: 0.4e-3, beam, range_sigma: 0.0, dropout: 0.0, ..Instrument::default() };
    let cell = |column: &SimColumn, i: usize| {
        let (range, mixed) = (f64::from(column.range_m[i]), column.truth[i].mixed);
        assert!(
            if mixed { (6.99..10.02).contains(&range) } else { !(7.01..=9.99).contains(&range) },
            "{range}"
        );
        (column.azimuth[i].abs(), mixed)
    };
    let columns = scan_all(&scene, &narrow(step_deg), &instrument, 1);
    columns.iter().flat_map(|column| (0..column.truth.len()).map(move |i| cell(column, i))).collect()
}

#[test]
fn markers_are_dark() {
    let columns =
        scan_all(&marked(5.0, 30.0, vec![[1000.0, 1000.0]]), &narrow(0.02), &Instrument::default(), 1);
    let valid = |c: &SimColumn, i: usize| c.state[i] == SimState::Valid;
    let dark = columns
        .iter()
        .flat_map(|c| (0..c.state.len()).filter(move |i| valid(c, *i) && c.intensity[*i] < 600));
    // A disc of 40 mm at 5 m and 30 degrees: (8 mrad)^2 pi / 4 cos(30) over (0.35 mrad)^2 per cell.
    let expected = std::f64::consts::PI / 4.0 * (0.04_f64 / 5.0).powi(2) * 30_f64.to_radians().cos()
        / 0.02_f64.to_radians().powi(2);
    let found = dark.count() as f64;
    assert!((found / expected - 1.0).abs() < 0.1, "{found} {expected}");
}

#[test]
fn faces_disagree_by_twice_the_collimation_and_warm_up_scatters() {
    let collimation = 0.05e-3;
    let faces = Faces { seam_column: 100, collimation, trunnion: 0.0, moved: [0.0, 0.0, 1e-3] };
    let instrument =
        Instrument { faces: Some(faces), warm_up_columns: 10, range_sigma: 0.0, ..Instrument::default() };
    let scene = target(10.0, 60.0);
    let columns = scan_all(&scene, &narrow(0.01), &instrument, 2);
    assert!(columns.iter().all(|c| c.back_face == (c.index >= 100)));
    // In the same direction, the scanner of the back face stands 1 mm higher: 1 mm tan(60) in range.
    let perfect = scan_all(&scene, &narrow(0.01), &Instrument::perfect(), 2);
    let step = |index: usize| columns[index].truth[100].range - perfect[index].truth[100].range;
    assert!(step(50).abs() < 1e-5);
    assert!((step(150).abs() - 1e-3 * 60_f64.to_radians().tan()).abs() < 2e-5, "{}", step(150));
    let scatter = |range: std::ops::Range<usize>| {
        let errors = ranges(&columns[range]);
        (errors.iter().map(|(t, m)| (m - t).powi(2)).sum::<f64>() / errors.len() as f64).sqrt()
    };
    assert!((scatter(0..10) / 0.03 - 1.0).abs() < 0.1 && scatter(10..60) < 1e-5);
}

#[test]
fn scans_repeat_bit_for_bit_on_any_number_of_threads() {
    let instrument = Instrument { angular_sigma: 5e-5, tail_dof: Some(5.0), ..Instrument::default() };
    let (scene, lattice) = (target(6.0, 55.0), narrow(0.01));
    let one = scan_all(&scene, &lattice, &instrument, 1);
    assert_eq!(one.len(), 201);
    for threads in [2, 3, 7] {
        assert!(one == scan_all(&scene, &lattice, &instrument, threads), "{threads} threads");
    }
    assert!(one != scan_all(&scene, &lattice, &Instrument { seed: 2, ..instrument }, 1));
}

#[test]
fn a_scan_stops_when_requested() {
    let mut n = 0;
    let stopped = scan(&target(6.0, 55.0), &narrow(0.05), &Instrument::default(), 2, |_| {
        n += 1;
        if n == 5 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert!(stopped.is_break() && n == 5);
}
