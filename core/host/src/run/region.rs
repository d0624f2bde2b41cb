//! Scan windows: the part of the scanner's field of view where the plate can be, instead of the whole hall.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use platen_plant::ScanWindow;
use platen_scan::{Window, wrap_azimuth};
use platen_shape::outline::Outline;
use platen_shape::{RegionOfInterest, Scanned, Vec3};

/// Margin round the last stroke's plate, metres: its edges rise by some centimetres in a stroke, and a press feeds it
/// by a few decimetres. If the plate has moved farther, the scan is repeated in the base window.
const ROOM: f64 = 0.5;

#[derive(Debug, Clone)]
pub(super) struct Region {
    choice: ScanWindow,
    /// Window for a plate without a previous scan: the region of interest; `None` is the whole field of view.
    pub(super) base: Option<Window>,
    /// Window round the last stroke's plate, margin included.
    pub(super) plate: Option<Window>,
}

impl Region {
    pub(super) fn new(choice: ScanWindow, region: Option<&RegionOfInterest>) -> Self {
        let base = region.filter(|_| choice != ScanWindow::Everything).and_then(of_box);
        Self { choice, base, plate: None }
    }

    pub(super) fn saw(&mut self, outline: &Outline) {
        if self.choice == ScanWindow::Plate {
            self.plate = round(outline.edges.iter().flat_map(|edge| &edge.points));
        }
    }
}

/// Returns whether the plate reaches the border of the window, so that a part of it may lie outside.
pub(super) fn is_cut_off(scanned: &Scanned) -> bool {
    let header = &scanned.header;
    let columns = scanned.warm_up_columns + 1..header.n_columns.saturating_sub(1);
    let rows = 1..header.n_rows.saturating_sub(1);
    scanned.patch.samples.iter().any(|s| !columns.contains(&s.column) || !rows.contains(&s.row))
}

/// Returns the directions of a box; `None` if the scanner is in, above or below it.
fn of_box(region: &RegionOfInterest) -> Option<Window> {
    let (min, max) = (region.min, region.max);
    // Points of its plan view that are nearest to the scanner and farthest from it.
    let near = |k: usize| 0.0_f64.clamp(min[k], max[k]);
    let far = |k: usize| min[k].abs().max(max[k].abs());
    let (near, far) = (near(0).hypot(near(1)), far(0).hypot(far(1)));
    if near == 0.0 {
        return None;
    }
    let steepest = |z: f64, down: bool| z.atan2(if (z < 0.0) == down { near } else { far });
    let corners = [(min.x, min.y), (max.x, min.y), (max.x, max.y), (min.x, max.y)];
    let (azimuth_start, azimuth_width) = azimuths(corners.map(|(x, y)| (y.atan2(x), 0.0)).into_iter())?;
    Some(Window {
        azimuth_start,
        azimuth_width,
        elevation_min: steepest(min.z, true),
        elevation_max: steepest(max.z, false),
    })
}

/// Returns the directions of points with a margin round each; `None` if the points surround the scanner.
fn round<'a>(points: impl Iterator<Item = &'a Vec3> + Clone) -> Option<Window> {
    let room = |distance: f64| (ROOM / distance.max(ROOM)).asin();
    let azimuth = |p: &Vec3| (p.y.atan2(p.x), room(p.x.hypot(p.y)));
    let (azimuth_start, azimuth_width) = azimuths(points.clone().map(azimuth))?;
    let elevation = |p: &Vec3| (p.z.atan2(p.x.hypot(p.y)), room(p.norm()));
    let low = points.clone().map(|p| elevation(p).0 - elevation(p).1).fold(f64::INFINITY, f64::min);
    let high = points.map(|p| elevation(p).0 + elevation(p).1).fold(f64::NEG_INFINITY, f64::max);
    let (elevation_min, elevation_max) = (low.max(-FRAC_PI_2), high.min(FRAC_PI_2));
    Some(Window { azimuth_start, azimuth_width, elevation_min, elevation_max })
}

/// Returns start and width of azimuths with a margin on both sides of each; they must lie within half a turn.
fn azimuths(directions: impl Iterator<Item = (f64, f64)> + Clone) -> Option<(f64, f64)> {
    let (sin, cos) = directions.clone().fold((0.0, 0.0), |(s, c), (a, _)| (s + a.sin(), c + a.cos()));
    let middle = f64::atan2(sin, cos);
    let turned = directions.map(|(azimuth, room)| (wrap_azimuth(azimuth - middle), room));
    let low = turned.clone().map(|(a, room)| a - room).fold(f64::INFINITY, f64::min);
    let high = turned.map(|(a, room)| a + room).fold(f64::NEG_INFINITY, f64::max);
    let width = high - low;
    (width < PI).then(|| (wrap_azimuth(middle + low), width.min(TAU)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use platen_scan::Direction;

    fn region(min: [f64; 3], max: [f64; 3]) -> RegionOfInterest {
        RegionOfInterest { min: min.into(), max: max.into() }
    }

    /// Checks points all over a box: its window must contain them all, and must not be wider than necessary.
    #[track_caller]
    fn check(min: [f64; 3], max: [f64; 3]) {
        let window = of_box(&region(min, max)).unwrap();
        let share = |k: usize, i: u32| min[k] + (max[k] - min[k]) * f64::from(i) / 20.0;
        let mut reached = [f64::INFINITY, f64::NEG_INFINITY];
        for i in 0..=20_u32.pow(3) + 3 * 20 * 21 {
            let point = [share(0, i % 21), share(1, i / 21 % 21), share(2, i / 441 % 21)];
            let direction = Direction::of(point);
            let slack = Window {
                azimuth_start: window.azimuth_start - 1e-12,
                azimuth_width: window.azimuth_width + 2e-12,
                elevation_min: window.elevation_min - 1e-12,
                elevation_max: window.elevation_max + 1e-12,
            };
            assert!(slack.contains(direction), "{point:?} {window:?}");
            reached = [reached[0].min(direction.elevation), reached[1].max(direction.elevation)];
        }
        assert!((reached[0] - window.elevation_min).abs() < 0.02, "{reached:?} {window:?}");
        assert!((reached[1] - window.elevation_max).abs() < 0.02, "{reached:?} {window:?}");
    }

    #[test]
    fn the_window_of_a_box_holds_the_box() {
        check([3.0, -2.0, -4.0], [9.0, 2.0, -1.0]);
        check([3.0, -2.0, -4.0], [9.0, 2.0, 1.0]);
        check([-9.0, -2.0, 0.5], [-3.0, 2.0, 1.0]);
        check([1.0, 5.0, -4.0], [4.0, 9.0, -3.0]);
        assert_eq!(
            of_box(&region([-1.0, -2.0, -4.0], [9.0, 2.0, -1.0])),
            None,
            "the scanner stands above it"
        );
    }

    #[test]
    fn the_window_round_a_plate_leaves_room_on_all_sides() {
        let corners =
            [[5.0, -1.0, -3.5], [5.0, 1.0, -3.5], [8.0, 1.0, -3.5], [8.0, -1.0, -3.5]].map(Vec3::from);
        let window = round(corners.iter()).unwrap();
        for corner in corners {
            for turn in 0..12 {
                let (sin, cos) = (f64::from(turn) * TAU / 12.0).sin_cos();
                for moved in [Vec3::new(cos, sin, 0.0), Vec3::new(cos, 0.0, sin), Vec3::new(0.0, cos, sin)] {
                    let point = corner + moved * (ROOM - 1e-9);
                    assert!(window.contains(Direction::of(point.into())), "{point} {window:?}");
                }
            }
        }
        let beyond = Vec3::new(5.0, -1.0 - 1.2 * ROOM, -3.5);
        assert!(!window.contains(Direction::of(beyond.into())));
        // Across the seam of the azimuth, and around the scanner.
        let behind = [[-5.0, -1.0, -3.0], [-5.0, 1.0, -3.0]].map(Vec3::from);
        assert!(round(behind.iter()).unwrap().contains(Direction { azimuth: PI, elevation: -0.5 }));
        let all_round = [[1.0, 0.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, -1.0]].map(Vec3::from);
        assert_eq!(round(all_round.iter()), None);
    }
}
