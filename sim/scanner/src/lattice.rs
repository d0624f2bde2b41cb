//! Regular lattice of scan directions.

use platen_sim_plate::{Plate, Side, Vec3};

/// Lowest elevation of a scanner, degrees: its own base obstructs the view below.
pub const LOWEST_DEG: f64 = -62.5;

/// Regular lattice of directions, radians: columns by increasing azimuth (counter-clockwise from +x), rows from the top
/// down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SimLattice {
    /// Azimuth of column 0.
    pub azimuth_start: f64,
    /// Angle between columns.
    pub azimuth_step: f64,
    /// Number of columns.
    pub n_columns: u32,
    /// Elevation of row 0.
    pub elevation_start: f64,
    /// Angle between rows, positive.
    pub elevation_step: f64,
    /// Number of rows.
    pub n_rows: u32,
}

impl SimLattice {
    /// Returns the lattice of one step that covers azimuths from `azimuth_start` over `azimuth_width` and elevations
    /// between `elevation_min` and `elevation_max`. At least 2 x 2 cells.
    pub fn covering(
        azimuth_start: f64,
        azimuth_width: f64,
        elevation_min: f64,
        elevation_max: f64,
        step: f64,
    ) -> Self {
        let cells = |width: f64| ((width / step).floor() as u32 + 1).max(2);
        Self {
            azimuth_start,
            azimuth_step: step,
            n_columns: cells(azimuth_width),
            elevation_start: elevation_max,
            elevation_step: step,
            n_rows: cells(elevation_max - elevation_min),
        }
    }

    /// Returns the lattice of one step that covers `points` (scanner frame) and `margin` radians around them. The
    /// points must lie within half a turn.
    pub fn around(points: &[Vec3], margin: f64, step: f64) -> Self {
        let middle = points.iter().sum::<Vec3>();
        let middle = middle.y.atan2(middle.x);
        let (mut azimuth, mut elevation) = ([0.0_f64; 2], [f64::INFINITY, f64::NEG_INFINITY]);
        for point in points {
            let turned = point.y.atan2(point.x) - middle;
            let ahead = turned.sin().atan2(turned.cos());
            azimuth = [azimuth[0].min(ahead), azimuth[1].max(ahead)];
            let up = point.z.atan2(point.x.hypot(point.y));
            elevation = [elevation[0].min(up), elevation[1].max(up)];
        }
        let start = middle + azimuth[0] - margin;
        let width = azimuth[1] - azimuth[0] + 2.0 * margin;
        Self::covering(start, width, elevation[0] - margin, elevation[1] + margin, step)
    }

    /// Returns the lattice that covers a plate and `margin` radians around it, or the place of a plate in an empty
    /// press.
    pub fn of_plate(plate: Option<&Plate>, margin: f64, step: f64) -> Self {
        Self::around(&outline(plate), margin, step).on_encoder()
    }

    /// Aligns the lattice to multiples of the step, as an encoder does, and removes the rows that lie
    /// below [`LOWEST_DEG`].
    #[must_use]
    pub fn on_encoder(&self) -> Self {
        let down_to = |angle: f64, step: f64| (angle / step).floor() * step;
        let elevation_start = down_to(self.elevation_start, self.elevation_step);
        let rows = ((elevation_start - LOWEST_DEG.to_radians()) / self.elevation_step) as u32 + 1;
        Self {
            azimuth_start: down_to(self.azimuth_start, self.azimuth_step),
            elevation_start,
            n_rows: self.n_rows.min(rows).max(2),
            ..*self
        }
    }

    /// Returns the nominal azimuth of a column, not wrapped.
    pub fn azimuth(&self, column: u32) -> f64 {
        self.azimuth_start + self.azimuth_step * f64::from(column)
    }

    /// Returns the nominal elevation of a row.
    pub fn elevation(&self, row: u32) -> f64 {
        self.elevation_start - self.elevation_step * f64::from(row)
    }

    /// Returns the number of cells.
    pub fn n_cells(&self) -> usize {
        self.n_columns as usize * self.n_rows as usize
    }
}

/// Returns points on a plate's outline; for an empty press, those of a typical plate.
fn outline(plate: Option<&Plate>) -> Vec<Vec3> {
    let Some(plate) = plate else {
        return [(4.0, -1.5), (4.0, 1.5), (8.0, -1.5), (8.0, 1.5)]
            .map(|(x, y)| Vec3::new(x, y, -3.6))
            .to_vec();
    };
    let at = |side: Side, i: u32| plate.side_uv(side, f64::from(i) / 8.0);
    let points = Side::ALL.into_iter().flat_map(|side| (0..=8).map(move |i| at(side, i)));
    points.map(|[u, v]| plate.top(u, v)).collect()
}

/// Returns the unit vector of a direction.
pub(crate) fn unit(azimuth: f64, elevation: f64) -> Vec3 {
    let ((sin_az, cos_az), (sin_el, cos_el)) = (azimuth.sin_cos(), elevation.sin_cos());
    Vec3::new(cos_el * cos_az, cos_el * sin_az, sin_el)
}
