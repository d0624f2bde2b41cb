//! Table `[frame]`: position of the scanner relative to press and plate.

use crate::TomlTable;
use crate::document::Reported;
use crate::unit::metres;

/// Largest deviation from orthonormal of a rotation written with three digits.
const ROTATION_SLACK: f64 = 2e-3;

/// Position of the scanner relative to press and plate.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Frame {
    /// Transform from the scanner frame to the press frame. The press turns plates about its z axis; with this axis
    /// `plate_rot` carries (0, 0) from stroke to stroke.
    pub press_from_scanner: RigidTransform,
    /// Rough direction of growing u, scanner frame, any length; decides which corner is (0, 0).
    pub u_axis: Option<[f64; 3]>,
    /// Box that contains the plate.
    pub region_of_interest: Option<RegionOfInterest>,
}

/// Axis-parallel box in the scanner frame, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RegionOfInterest {
    /// Smallest x, y, z.
    pub min: [f64; 3],
    /// Largest x, y, z.
    pub max: [f64; 3],
}

/// A rotation, then a translation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigidTransform {
    /// Rows of the rotation matrix, orthonormal, right-handed.
    pub rotation: [[f64; 3]; 3],
    /// Metres.
    pub translation: [f64; 3],
}

impl Default for RigidTransform {
    /// Returns the identity.
    fn default() -> Self {
        Self { rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], translation: [0.0; 3] }
    }
}

impl Frame {
    pub(super) fn read(mut table: TomlTable<'_>) -> Result<Self, Reported> {
        let press_from_scanner = table.section("press_from_scanner").and_then(RigidTransform::read);
        let u_axis = table.vector::<3>("u_axis").check(|axis| match dot(axis, axis) > 0.0 {
            true => Ok(()),
            false => Err("found [0, 0, 0], which has no direction".to_owned()),
        });
        let u_axis = u_axis.optional();
        let region = table.table("region_of_interest").optional();
        let region = region.and_then(|table| table.map(RegionOfInterest::read).transpose());
        table.finish();
        Ok(Self { press_from_scanner: press_from_scanner?, u_axis: u_axis?, region_of_interest: region? })
    }
}

impl RegionOfInterest {
    fn read(mut table: TomlTable<'_>) -> Result<Self, Reported> {
        let min = table.vector::<3>("min_mm").required();
        let max = table.vector::<3>("max_mm").located().required();
        let document = table.document();
        table.finish();
        let (min, max) = (min?, max?);
        let mut ordered = Ok(());
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            let (min, above) = (min[axis], max.value[axis]);
            if min >= above {
                let message = format!("{name} is {above}, must be above the {min} of min_mm");
                ordered = Err(document.fault(&max.place, message));
            }
        }
        ordered?;
        Ok(Self { min: min.map(metres), max: max.value.map(metres) })
    }
}

impl RigidTransform {
    fn read(mut table: TomlTable<'_>) -> Result<Self, Reported> {
        let default = Self::default();
        let rotation = table.matrix::<3, 3>("rotation").try_map(orthonormal).or(default.rotation);
        let translation =
            table.vector::<3>("translation_mm").map(|mm| mm.map(metres)).or(default.translation);
        table.finish();
        Ok(Self { rotation: rotation?, translation: translation? })
    }
}

/// Returns the rotation by Gram-Schmidt orthonormalisation of the rows.
fn orthonormal(rows: [[f64; 3]; 3]) -> Result<[[f64; 3]; 3], String> {
    let [x, y, z] = rows;
    for (i, j) in [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)] {
        let (product, expected) = (dot(&rows[i], &rows[j]), if i == j { 1.0 } else { 0.0 });
        if (product - expected).abs() > ROTATION_SLACK {
            return Err(match i == j {
                true => {
                    format!("row {} has length {:.4}, a rotation's rows have length 1", i + 1, product.sqrt())
                }
                false => {
                    format!("rows {} and {} are not at a right angle, as a rotation's are", i + 1, j + 1)
                }
            });
        }
    }
    if dot(&cross(&x, &y), &z) < 0.0 {
        return Err("is a mirror image, not a rotation; turn the sign of one row".to_owned());
    }
    let x = unit(x);
    let along = dot(&x, &y);
    let y = unit([0, 1, 2].map(|i| y[i] - along * x[i]));
    Ok([x, y, cross(&x, &y)])
}

fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: &[f64; 3], b: &[f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(a: [f64; 3]) -> [f64; 3] {
    let length = dot(&a, &a).sqrt();
    a.map(|x| x / length)
}
