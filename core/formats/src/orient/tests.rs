//! One lattice of known angles, stored in every way a file may store it: the same cells must come back.

use std::borrow::Cow;
use std::f64::consts::TAU;

use platen_scan::{Direction, Lattice};

use super::*;
use crate::{Columns, ReadError};

const ROWS: u32 = 30;
const COLUMNS: u32 = 40;
const STEP: f64 = 0.01;
/// Columns cross the seam of the azimuth.
const AZIMUTH: f64 = 3.0;
const ELEVATION: f64 = 0.2;

/// Changes of the lattice on its way into the file.
#[derive(Clone, Copy)]
struct Stored {
    swap: bool,
    flip_rows: bool,
    flip_columns: bool,
    scale: f64,
    mirror: Mirror,
    offset: (u32, u32),
    row_by_row: bool,
    sparse: bool,
}

const PLAIN: Stored = Stored {
    swap: false,
    flip_rows: false,
    flip_columns: false,
    scale: 1.0,
    mirror: Mirror::None,
    offset: (0, 0),
    row_by_row: false,
    sparse: false,
};

fn missing(row: u32, column: u32) -> bool {
    (row + 2 * column).is_multiple_of(7)
}

fn point(row: u32, column: u32) -> [f64; 3] {
    // Real beams do not form an ideal lattice: a small wobble on both angles.
    let wobble = 1e-4 * f64::from((row * 7 + column * 3) % 5);
    let direction = Direction {
        azimuth: AZIMUTH + STEP * f64::from(column) + wobble,
        elevation: ELEVATION - STEP * f64::from(row) - wobble,
    };
    let range = 6.0 + 0.02 * f64::from(row) + 0.01 * f64::from(column);
    direction.unit().map(|c| c * range)
}

fn cells(stored: Stored) -> Vec<RawCell> {
    let mut cells = Vec::new();
    let mut store = |row: u32, column: u32| {
        let gap = missing(row, column);
        if gap && stored.sparse {
            return;
        }
        let (r, c) = (
            if stored.flip_rows { ROWS - 1 - row } else { row },
            if stored.flip_columns { COLUMNS - 1 - column } else { column },
        );
        let (r, c) = if stored.swap { (c, r) } else { (r, c) };
        let [x, y, z] = if gap { [0.0; 3] } else { point(row, column).map(|v| v * stored.scale) };
        let xyz = match stored.mirror {
            Mirror::None => [x, y, z],
            Mirror::X => [-x, y, z],
            Mirror::Y => [x, -y, z],
        };
        let intensity = f64::from(row * 50);
        let (row, column) = (r + stored.offset.0, c + stored.offset.1);
        cells.push(RawCell {
            row,
            column,
            position: Position::Cartesian(xyz),
            intensity,
            state: State::Valid,
        });
    };
    if stored.row_by_row {
        (0..ROWS).for_each(|row| (0..COLUMNS).for_each(|column| store(row, column)));
    } else {
        (0..COLUMNS).for_each(|column| (0..ROWS).for_each(|row| store(row, column)));
    }
    cells
}

fn xyz(cell: &RawCell) -> [f64; 3] {
    match cell.position {
        Position::Cartesian(xyz) => xyz,
        Position::Spherical(range, direction) => direction.unit().map(|c| c * range),
    }
}

fn converted(cells: &[RawCell]) -> Converted {
    let (mut to_spherical, mut converted) = (ToSpherical::default(), Converted::default());
    cells.iter().for_each(|cell| to_spherical.append(cell, &mut converted));
    converted
}

fn plan(cells: &[RawCell], expected: &Expected) -> Result<Plan, OrientError> {
    let mut survey = Survey::default();
    survey.add(&converted(cells))?;
    survey.decide(expected)
}

fn assemble(plan: &Plan, cells: &[RawCell]) -> Result<Lattice, ReadError> {
    let mut lattice = Lattice::new(plan.header.clone());
    let cells = converted(cells).cells;
    let mut columns = Columns::new(plan, Box::new(std::iter::once(Ok(Cow::Owned(cells)))));
    let mut n_columns = 0;
    for column in &mut columns {
        let column = column?;
        lattice.push(&column).unwrap();
        n_columns += 1;
        for row in (0..column.len()).filter(|row| column.state[*row] == State::NoReturn) {
            let values = [column.range_m[row], column.azimuth[row], column.elevation[row]];
            assert_eq!(
                (values, column.intensity[row]),
                ([0.0; 3], 0),
                "a cell without direction holds values"
            );
        }
    }
    let end = columns.finish()?;
    assert_eq!((n_columns, lattice.n_valid() as u64), (end.columns, end.points));
    Ok(lattice)
}

#[track_caller]
fn check(stored: Stored, expected: &Expected) -> Plan {
    let cells = cells(stored);
    let plan = plan(&cells, expected).unwrap();
    let lattice = assemble(&plan, &cells).unwrap();
    assert_eq!((lattice.n_rows(), lattice.n_columns()), (ROWS as usize, COLUMNS as usize));
    for column in 0..COLUMNS {
        for row in 0..ROWS {
            let cell = lattice.cell(column as usize, row as usize);
            let Some(found) = lattice.point(cell) else {
                assert!(missing(row, column), "({row}, {column}) is lost");
                continue;
            };
            assert!(!missing(row, column), "({row}, {column}) was never measured");
            let truth = point(row, column);
            for k in 0..3 {
                assert!((found[k] - truth[k]).abs() < 2e-6, "({row}, {column}): {found:?} for {truth:?}");
            }
        }
    }
    assert!((plan.header.azimuth_step - STEP).abs() < 1e-5);
    assert!((plan.header.elevation_step - STEP).abs() < 1e-5);
    assert!((plan.header.azimuth_start - AZIMUTH).abs() < 1e-3);
    plan
}

#[test]
fn a_lattice_in_order_stays_as_it_is() {
    let plan = check(PLAIN, &Expected::default());
    assert!(!plan.swapped && !plan.rows_flipped && !plan.columns_flipped);
    assert_eq!((plan.unit, plan.header.intensity_range), (Unit::Metre, (0, 2047)));
    let notes = plan.header.notes.join("\n");
    assert!(
        notes.contains("row with elevation -0.999") && notes.contains("column with azimuth +0.999"),
        "{notes}"
    );
}

#[test]
fn every_order_of_rows_and_columns_gives_the_same_cells() {
    for bits in 0..32_u32 {
        let bit = |k: u32| bits >> k & 1 == 1;
        let stored = Stored {
            swap: bit(0),
            flip_rows: bit(1),
            flip_columns: bit(2),
            row_by_row: bit(3),
            sparse: bit(4),
            offset: (5, 1000),
            ..PLAIN
        };
        let plan = check(stored, &Expected::default());
        assert_eq!((plan.swapped, plan.rows_flipped), (stored.swap, stored.flip_rows));
        assert_eq!(plan.columns_flipped, stored.flip_columns);
    }
}

#[test]
fn millimetres_are_recognised_and_said() {
    let plan = check(Stored { scale: 1000.0, ..PLAIN }, &Expected::default());
    assert_eq!(plan.unit, Unit::Millimetre);
    assert!(plan.header.notes.iter().any(|note| note.contains("millimetres")));
}

#[test]
fn a_unit_that_no_scanner_writes_is_refused() {
    for (scale, side) in [(1e6, "above"), (1e-3, "below")] {
        let refused = plan(&cells(Stored { scale, ..PLAIN }), &Expected::default());
        assert!(matches!(refused, Err(OrientError::Unit { side: s, .. }) if s == side), "{refused:?}");
    }
}

#[test]
fn a_left_handed_frame_is_mirrored_back() {
    for mirror in [Mirror::X, Mirror::Y] {
        check(Stored { mirror, ..PLAIN }, &Expected { mirror, ..Expected::default() });
    }
}

#[test]
fn a_mirrored_scan_is_found_when_the_turn_is_known() {
    let turn = Some(Turn::CounterClockwise);
    let expected = Expected { turn, ..Expected::default() };
    check(PLAIN, &expected);
    let refused = plan(&cells(Stored { mirror: Mirror::Y, ..PLAIN }), &expected);
    assert!(matches!(refused, Err(OrientError::Mirrored { .. })), "{refused:?}");
}

#[test]
fn a_full_circle_is_cut_where_asked() {
    let n = 90;
    let step = TAU / f64::from(n);
    let circle: Vec<RawCell> = (0..n)
        .flat_map(|column| (0..9).map(move |row| (row, column)))
        .map(|(row, column)| {
            let direction = Direction { azimuth: -step * f64::from(column), elevation: 0.1 * f64::from(row) };
            RawCell {
                row,
                column,
                position: Position::Cartesian(direction.unit().map(|c| c * 5.0)),
                intensity: 0.5,
                state: State::Valid,
            }
        })
        .collect();
    let cut_azimuth = Some(1.0);
    let plan = plan(&circle, &Expected { cut_azimuth, ..Expected::default() }).unwrap();
    let start = plan.header.azimuth_start;
    assert!((1.0..1.0 + step).contains(&start), "cut at {start}");
    let lattice = assemble(&plan, &circle).unwrap();
    for column in 0..n as usize {
        let seen = lattice.direction(lattice.cell(column, 4)).unwrap().azimuth;
        let off = platen_scan::wrap_azimuth(seen - start - step * column as f64);
        assert!(off.abs() < 1e-6, "column {column} at {seen}");
    }
}

#[test]
fn what_is_no_lattice_is_refused() {
    let sound = cells(PLAIN);
    let refuse = |change: &dyn Fn(usize, &mut RawCell)| {
        let mut cells = sound.clone();
        cells.iter_mut().enumerate().for_each(|(i, cell)| change(i, cell));
        plan(&cells, &Expected::default()).unwrap_err()
    };
    assert_eq!(
        refuse(&|_, cell| (cell.row, cell.column) = (0, 0)),
        OrientError::DuplicateCell { row: 0, column: 0 }
    );
    assert!(matches!(refuse(&|_, cell| cell.row = 1 << 20), OrientError::IndexOutOfRange { .. }));
    assert!(matches!(
        refuse(&|_, cell| cell.position = Position::Cartesian([f64::from(cell.row + 1), 0.0, 0.0])),
        OrientError::NotALattice { .. }
    ));
    assert!(matches!(
        refuse(&|_, cell| (cell.row, cell.column) = (cell.row * 100, cell.column * 100)),
        OrientError::TooSparse { .. }
    ));
    assert!(matches!(
        refuse(&|_, cell| cell.state = State::NoReturn),
        OrientError::TooSmall { valid: 0, .. }
    ));
    // A registered cloud: its origin is not the scanner.
    let registered = refuse(&|_, cell| {
        let [x, y, z] = xyz(cell);
        cell.position = Position::Cartesian([x + 30.0, y - 200.0, z]);
    });
    assert!(matches!(registered, OrientError::NotALattice { .. }), "{registered}");
}

#[test]
fn missing_cells_are_missing_however_they_are_written() {
    let mut cells = cells(PLAIN);
    let zeros = cells.iter().filter(|cell| xyz(cell) == [0.0; 3]).count();
    cells[1].position = Position::Cartesian([f64::NAN, 1.0, 1.0]);
    cells[2].position = Position::Cartesian([f64::INFINITY, 1.0, 1.0]);
    cells[3].state = State::DirectionOnly;
    let plan = plan(&cells, &Expected::default()).unwrap();
    let notes = plan.header.notes.join("\n");
    assert!(notes.contains(&format!("{zeros} cells at the origin")), "{notes}");
    assert!(notes.contains("2 cells without finite coordinates"), "{notes}");
    let lattice = assemble(&plan, &cells).unwrap();
    let state = |row: usize| lattice.state(lattice.cell(0, row));
    assert_eq!(
        [1, 2, 3, 4].map(state),
        [State::NoReturn, State::NoReturn, State::DirectionOnly, State::Valid]
    );
}

#[test]
fn columns_without_any_measurement_are_said() {
    let mut cells = cells(PLAIN);
    let half = cells.len() / 2;
    cells[half..].iter_mut().for_each(|cell| cell.position = Position::Cartesian([0.0; 3]));
    let plan = plan(&cells, &Expected::default()).unwrap();
    assert_eq!(plan.header.n_columns, COLUMNS);
    let notes = plan.header.notes.join("\n");
    assert!(notes.contains("20 of 40 columns hold no measurement"), "{notes}");
}

#[test]
fn a_second_pass_that_differs_is_noticed() {
    let cells = cells(PLAIN);
    let plan = plan(&cells, &Expected::default()).unwrap();
    let changed = |other: &[RawCell]| {
        matches!(assemble(&plan, other), Err(ReadError::Orient(OrientError::Changed { .. })))
    };
    assert!(changed(&cells[1..]));
    assert!(changed(&[&cells[..], &cells[..1]].concat()));
    let mut moved = cells.clone();
    moved[0].row = 99;
    assert!(changed(&moved));
}
