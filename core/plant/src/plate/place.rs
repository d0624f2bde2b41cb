//! Points and names on the plate.

use std::collections::BTreeMap;

use crate::document::Reported;
use crate::unit::{metres, millimetres};
use crate::{Place, TomlTable};

/// Original rectangle of the plate, metres.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rectangle {
    pub(super) width: f64,
    pub(super) height: f64,
}

impl Rectangle {
    /// Returns the length of the straight line through the middle in the direction `angle` (from u towards v), metres.
    pub(super) fn through_middle(&self, angle: f64) -> f64 {
        let along = |extent: f64, share: f64| if share == 0.0 { f64::INFINITY } else { extent / share.abs() };
        along(self.width, angle.cos()).min(along(self.height, angle.sin()))
    }
}

/// Reads a point of the plate, edges included; returns metres.
pub(super) fn point(
    table: &mut TomlTable<'_>,
    key: &str,
    plate: Option<Rectangle>,
) -> Result<[f64; 2], Reported> {
    table.vector::<2>(key).try_map(|at| on_plate(at, plate)).required()
}

/// Reads two or more points of the plate, edges included; returns metres.
pub(super) fn points(
    table: &mut TomlTable<'_>,
    key: &str,
    plate: Option<Rectangle>,
) -> Result<Vec<[f64; 2]>, Reported> {
    let points = table.vectors::<2>(key).try_map(|points| match points.len() {
        0 | 1 => Err("a line needs two points or more".to_owned()),
        _ => points.into_iter().map(|at| on_plate(at, plate)).collect(),
    });
    points.required()
}

/// Returns a point in metres, if it lies on the plate.
fn on_plate([u_mm, v_mm]: [f64; 2], plate: Option<Rectangle>) -> Result<[f64; 2], String> {
    let (u, v) = (metres(u_mm), metres(v_mm));
    match plate {
        Some(Rectangle { width, height }) if !(0.0..=width).contains(&u) || !(0.0..=height).contains(&v) => {
            let (width, height) = (millimetres(width), millimetres(height));
            Err(format!("found [{u_mm}, {v_mm}], outside the plate of {width} x {height} mm"))
        }
        _ => Ok([u, v]),
    }
}

/// Names used so far in one array of tables, each with its place.
#[derive(Debug, Default)]
pub(super) struct Names {
    /// Number of the table being read, from 1.
    pub(super) number: usize,
    taken: BTreeMap<String, Place>,
}

impl Names {
    /// Reads the table's name, which must differ from those of earlier tables.
    pub(super) fn take(&mut self, table: &mut TomlTable<'_>) -> Result<String, Reported> {
        let name = table.name("name").located().required()?;
        self.claim(table, name.value, name.place)
    }

    /// Records that `name` is taken at `place`.
    pub(super) fn claim(
        &mut self,
        table: &TomlTable<'_>,
        name: String,
        place: Place,
    ) -> Result<String, Reported> {
        let document = table.document();
        if let Some(first) = self.taken.get(&name) {
            let first = document.locate(first);
            return Err(
                document.fault(&place, format!("{name:?} is taken already, at {first}; choose another"))
            );
        }
        self.taken.insert(name.clone(), place);
        Ok(name)
    }
}
