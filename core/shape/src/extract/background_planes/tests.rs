use platen_numerics::random::Random;
use platen_scan::ScanHeader;

use super::super::mixed_pixels;
use super::*;

const STEP: f64 = 9e-4;
const NOISE: f64 = 3e-4;

/// Builds the scene of a level plate 3.5 m below the scanner, a table `below` it and the floor; `places` gives, by row,
/// the columns at which the plate and the table end. A beam sees a quarter of a step around its middle.
fn scene(below: f64, places: impl Fn(f64) -> [f64; 2]) -> (Window, Vec<Option<bool>>) {
    let header = ScanHeader {
        n_rows: 80,
        n_columns: 80,
        azimuth_step: STEP,
        elevation_start: -0.42,
        elevation_step: STEP,
        ..ScanHeader::default()
    };
    let beam = |column: usize, row: usize| {
        let (azimuth, elevation) = (STEP * column as f64, -0.42 - STEP * row as f64);
        Vec3::new(elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin())
    };
    let mut random = Random::new(7);
    let noise: Vec<f64> = (0..80 * 80).map(|_| NOISE * random.normal()).collect();
    let part = |at: f64, end: f64| ((at - end) / 0.5 + 0.5).clamp(0.0, 1.0);
    let share = |column: usize, row: usize| places(row as f64).map(|end| part(column as f64, end));
    let window = Window::of_ranges(header, |column, row| {
        let [plate, table] = share(column, row);
        let down = -beam(column, row).z;
        let (near, middle, far) = (3.5 / down, (3.5 + below) / down, 4.6 / down);
        let range = plate * near + (1.0 - plate) * (table * middle + (1.0 - table) * far);
        ((range + noise[column * 80 + row]) as f32, plate == 1.0)
    });
    let kinds = (0..80 * 80).map(|index| {
        let [plate, _] = share(index / 80, index % 80);
        let sees_the_edge = (0.1..0.9).contains(&plate);
        (plate == 0.0 || sees_the_edge).then_some(sees_the_edge)
    });
    (window, kinds.collect())
}

/// Counts the background cells classified as mixed, and the cells at the plate's edge classified as sound, each with
/// the total.
fn wrong(window: &Window, kinds: &[Option<bool>]) -> [[usize; 2]; 2] {
    let noise = Noise::estimate(window, &window.own);
    let mut pixels = mixed_pixels::classify(window, &noise, &Noise::of_background(window));
    mark_sound(window, &noise, &mut pixels);
    let mut counts = [[0; 2]; 2];
    let inner = |index: usize| [index / 80, index % 80].iter().all(|place| (4..76).contains(place));
    for index in (0..pixels.len()).filter(|index| inner(*index)) {
        match (kinds[index], pixels[index]) {
            (Some(false), pixel) if !window.own[index] => {
                counts[0][0] += usize::from(pixel == Pixel::Mixed);
                counts[0][1] += 1;
            }
            (Some(true), pixel) => {
                counts[1][0] += usize::from(pixel == Pixel::Sound);
                counts[1][1] += 1;
            }
            _ => {}
        }
    }
    counts
}

/// Asserts that nearly no background cell is classified as mixed, and nearly no cell at the edge as sound.
fn assert_kinds(window: &Window, kinds: &[Option<bool>]) {
    let [[mixed, background], [sound, edge]] = wrong(window, kinds);
    println!("background taken for mixed: {mixed} of {background}; edge taken for sound: {sound} of {edge}");
    assert!(mixed * 100 < background && sound * 20 < edge && edge > 15);
}

#[test]
fn a_strip_that_narrows_is_background() {
    // The table's strip is 8 cells wide at the bottom and ends at the top.
    let (window, kinds) = scene(0.25, |row| [40.0 - 0.62 * row + 25.0, 40.0 - 0.72 * row + 25.0]);
    assert_kinds(&window, &kinds);
}

#[test]
fn a_strip_of_one_cell_is_background_where_its_plane_shows_elsewhere() {
    // The table is wide at the bottom and one cell wide from row 16 on.
    let (window, kinds) = scene(0.25, |row| {
        let end = 65.0 - 0.62 * row;
        [end, if row < 64.0 { end - 1.2 } else { end - 12.0 }]
    });
    assert_kinds(&window, &kinds);
}

#[test]
fn a_strip_of_two_cells_is_background_though_its_plane_shows_nowhere_else() {
    let (window, kinds) = scene(0.25, |row| {
        let end = 65.0 - 0.62 * row;
        [end, end - 2.0]
    });
    assert_kinds(&window, &kinds);
}

#[test]
fn an_edge_without_a_strip_stays_mixed() {
    let (window, kinds) = scene(0.25, |row| [65.0 - 0.62 * row; 2]);
    assert_kinds(&window, &kinds);
}

#[test]
fn smooth_mixing_along_a_row_stays_mixed() {
    // The plate's edge crosses a column within 80 rows: the ranges down that column are straight.
    let (window, kinds) = scene(0.25, |row| [39.75 + 0.006 * row, -9.0]);
    assert_kinds(&window, &kinds);
}

#[test]
fn a_cell_amid_the_mixed_ones_of_an_edge_is_mixed() {
    // Every tenth beam that sees the edge returns the range of the table.
    let (mut window, kinds) = scene(0.25, |row| [39.75 + 0.006 * row, -9.0]);
    let behind: Vec<usize> =
        (0..kinds.len()).filter(|index| kinds[*index] == Some(true)).step_by(10).collect();
    for index in &behind {
        let beam = Vec3::from(window.points[*index]) / f64::from(window.cells[*index].range_m);
        let range = 3.75 / -beam.z;
        window.cells[*index].range_m = range as f32;
        window.inverse[*index] = 1.0 / range as f32;
        window.points[*index] = (beam * range).into();
    }
    assert!(behind.len() > 5);
    assert_kinds(&window, &kinds);
}

#[test]
fn a_part_of_the_plate_off_the_component_is_no_background() {
    // The last columns of the plate were not joined to it; the table is visible beyond.
    let (mut window, kinds) = scene(0.25, |row| [40.0 + 0.05 * row, -9.0]);
    for row in 0..80 {
        let end = (40.0 + 0.05 * row as f64) as usize;
        (end..(end + 3).min(80)).for_each(|column| window.own[column * 80 + row] = false);
    }
    assert_kinds(&window, &kinds);
}

#[test]
fn the_plane_of_a_table_is_between_the_plate_and_the_floor() {
    // Of the beams of a row that see the end of the table, a beam in front of its plane also sees the plate.
    let (window, _) = scene(0.25, |row| {
        let end = 65.0 - 0.62 * row;
        [end, if row < 64.0 { end - 1.2 } else { end - 12.0 }]
    });
    let noise = Noise::estimate(&window, &window.own);
    let mut pixels = mixed_pixels::classify(&window, &noise, &Noise::of_background(&window));
    let background = mark_sound(&window, &noise, &mut pixels);
    let (row, floor) = (20, 10);
    let beam = |column: usize| BackgroundCell::of(&window, &noise, 80 * column + row);
    let down = -beam(50).direction.z;
    let [plate, before, behind, floor] = [
        beam(50).with_range(3.5 / down),
        beam(50).with_range(3.7 / down),
        beam(50).with_range(4.0 / down),
        beam(floor),
    ];
    let between = |place, behind| background.between(place, behind).collect::<PlaneSet>();
    let planes = between(plate, floor);
    assert!(!planes.is_empty());
    assert!(background.is_behind(planes, &behind) && !background.is_behind(planes, &before));
    assert!(between(behind, floor).is_empty() && between(plate, before).is_empty());
}

#[test]
fn alone_on_a_plane_of_few_is_by_chance() {
    let header = ScanHeader { n_rows: 8, n_columns: 50, ..ScanHeader::default() };
    let window = Window::of_ranges(header, |_, _| (9.0, false));
    // Every second of 50 mixed pixels along a row is on the plane of a strip; two side by side are on another plane,
    // and one alone on a third.
    let mixed: Vec<usize> = (0..50).map(|column| 8 * column + 4).collect();
    let (mut pixels, mut on) = (vec![Pixel::Sound; 400], vec![None; 400]);
    mixed.iter().for_each(|index| pixels[*index] = Pixel::Mixed);
    mixed.iter().step_by(2).for_each(|index| on[*index] = Some(0));
    [11, 12].iter().for_each(|k| on[mixed[*k]] = Some(1));
    on[mixed[31]] = Some(2);
    assert_eq!(by_chance(&window, &pixels, &mixed, &on), [mixed[31]]);
    // Beside a sound cell of its plane it is the end of that plane.
    on[mixed[31] + 1] = Some(2);
    assert!(by_chance(&window, &pixels, &mixed, &on).is_empty());
}

/// A table of which 120 mm are visible in front of a plate, and a strip 3.5 m behind that. The first plane is tilted: at
/// both ends of the border the cells off it have errors to one side.
#[test]
fn a_narrow_border_predicts_its_strip_whatever_plane_it_was_found_by() {
    let mut random = Random::new(11);
    let mut cell = |ahead: f64, column: u32| {
        let point = Vec3::new(ahead, 0.016 * (f64::from(column) - 150.0), -5.0);
        let (inverse, sigma) = (1.0 / point.norm(), 8e-4 / point.norm_squared());
        let inverse = inverse + sigma * random.normal();
        BackgroundCell { place: [column, 0], direction: point.normalize(), inverse, sigma }
    };
    let places = |from: f64, rows: u32| {
        (0..rows).flat_map(move |row| (0..300).map(move |column| (from + 0.01 * f64::from(row), column)))
    };
    let border: Vec<BackgroundCell> = places(7.8, 12).map(|(ahead, column)| cell(ahead, column)).collect();
    let strip: Vec<BackgroundCell> = places(11.3, 1).map(|(ahead, column)| cell(ahead, column)).collect();
    for tilt in [-0.05, 0.0, 0.05_f64] {
        let found_by = Vec3::new(tilt, 0.0, -1.0) / (5.0 + 7.855 * tilt);
        let held = |plane: Option<BackgroundPlane>| {
            let plane = plane.unwrap();
            strip.iter().filter(|cell| plane.depth(cell).abs() <= BOUND).count()
        };
        let once = held(BackgroundPlane::fit(&border, |cell| cell.is_on(&found_by)));
        let found = held(BackgroundPlane::fit_near(&border, found_by));
        println!("tilt {tilt}: {found} of 300 cells of the strip, after one fit {once}");
        assert!(found > 285);
    }
}
