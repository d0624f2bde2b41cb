//! Export of the comparisons' fields on a regular grid over the plate: CSV for spreadsheets, PLY and VTK for mesh
//! viewers.
//!
//! Positions are on the scanned face in the scanner frame, in metres; (u, v) and fields have the units in their names.
//! Nodes without data are empty cells in CSV and NaN in the meshes.

mod vtk;

use ply_rs_bw::ply::{
    Addable as _, DefaultElement, ElementDef, Encoding, Ply, Property, PropertyDef, PropertyType, ScalarType,
};
use ply_rs_bw::writer::Writer;

use platen_model::units::{mm, mm_pair, readable};
use platen_model::{Field, NodeState, Report};
use platen_shape::Surface;

/// Nodes along u and v, as in the fields of our comparisons.
const NODES: [usize; 2] = [101, 101];

/// Regular grid over the plate, v outer, u inner, edges included, with the fields as columns.
#[derive(Debug, Clone)]
pub struct PlateTable {
    nodes: Vec<Node>,
    columns: Vec<Column>,
}

#[derive(Debug, Clone, Copy)]
struct Node {
    /// Mid-surface coordinates, metres.
    uv: [f64; 2],
    /// Position on the scanned face, scanner frame, metres.
    face: [f64; 3],
    seen: bool,
}

#[derive(Debug, Clone)]
struct Column {
    /// Name with its unit, e.g. `deviation_mm`.
    name: String,
    values: Vec<Option<f64>>,
}

impl PlateTable {
    /// Samples a measured surface and the fields of its comparisons; a field on other nodes is interpolated.
    pub fn new(surface: &Surface, reports: &[&Report]) -> Self {
        let along = |k: usize, n: usize, length: f64| length * k as f64 / (n - 1) as f64;
        let node = |k: usize| {
            let u = along(k % NODES[0], NODES[0], surface.width());
            let v = along(k / NODES[0], NODES[1], surface.height());
            Node { uv: [u, v], face: surface.face(u, v).into(), seen: surface.mask().seen(u, v) }
        };
        let fields = reports.iter().flat_map(|report| &report.fields);
        Self {
            nodes: (0..NODES[0] * NODES[1]).map(node).collect(),
            columns: fields.flat_map(columns).collect(),
        }
    }

    /// Writes CSV: u_mm, v_mm, x_m, y_m, z_m, seen, then a column for each component of a field; empty cells without
    /// data.
    ///
    /// # Errors
    /// An error of the CSV writer.
    pub fn csv(&self) -> csv::Result<Vec<u8>> {
        let mut table = csv::Writer::from_writer(Vec::new());
        let names = self.columns.iter().map(|column| column.name.as_str());
        table.write_record(["u_mm", "v_mm", "x_m", "y_m", "z_m", "seen"].into_iter().chain(names))?;
        for (k, Node { uv, face, seen }) in self.nodes.iter().enumerate() {
            let place = mm_pair(*uv).map(|mm| format!("{mm:.3}"));
            let face = face.map(|metres| format!("{metres:.6}"));
            let seen = u8::from(*seen).to_string();
            let values = self.columns.iter().map(|column| column.values[k]);
            let values = values.map(|value| value.map(|value| format!("{value:.6}")).unwrap_or_default());
            table.write_record(place.into_iter().chain(face).chain([seen]).chain(values))?;
        }
        table.into_inner().map_err(|e| e.into_error().into())
    }

    /// Writes a triangle mesh as binary little-endian PLY: positions in metres, every column as a scalar field in
    /// CloudCompare's naming (`scalar_deviation_mm`), NaN without data. Triangles with unseen nodes are left out, so a
    /// hole in the data is a hole in the mesh.
    ///
    /// # Errors
    /// An error of the PLY writer, as text.
    pub fn ply(&self) -> Result<Vec<u8>, String> {
        let scalar = |name: &str, kind: ScalarType| PropertyDef::new(name.into(), PropertyType::Scalar(kind));
        let mut vertex = ElementDef::new("vertex".into());
        for axis in AXES {
            vertex.properties.add(scalar(axis, ScalarType::Double));
        }
        for name in self.scalars() {
            vertex.properties.add(scalar(&name, ScalarType::Float));
        }
        let mut face = ElementDef::new("face".into());
        let list = PropertyType::List(ScalarType::UChar, ScalarType::Int);
        face.properties.add(PropertyDef::new(FACE.into(), list));

        let mut ply = Ply::<DefaultElement>::new();
        ply.header.encoding = Encoding::BinaryLittleEndian;
        ply.header
            .comments
            .push(concat!("platen ", env!("CARGO_PKG_VERSION"), ", scanned face, metres").into());
        ply.header.elements.add(vertex);
        ply.header.elements.add(face);
        ply.payload.insert("vertex".into(), (0..self.nodes.len()).map(|k| self.vertex(k)).collect());
        let triangle = |corners: [usize; 3]| {
            let mut element = DefaultElement::new();
            element.insert(FACE.into(), Property::ListInt(corners.map(|k| k as i32).to_vec()));
            element
        };
        ply.payload.insert("face".into(), self.triangles().into_iter().map(triangle).collect());
        let mut bytes = Vec::new();
        Writer::new().write_ply(&mut bytes, &mut ply).map_err(|e| e.to_string())?;
        Ok(bytes)
    }

    fn scalars(&self) -> impl Iterator<Item = String> {
        let own = ["u_mm", "v_mm"].into_iter();
        own.chain(self.columns.iter().map(|column| column.name.as_str())).map(|name| format!("scalar_{name}"))
    }

    fn vertex(&self, k: usize) -> DefaultElement {
        let Node { uv, face, .. } = self.nodes[k];
        let mut element = DefaultElement::new();
        for (axis, value) in AXES.iter().zip(face) {
            element.insert((*axis).into(), Property::Double(value));
        }
        let own = uv.map(|metres| Some(mm(metres))).into_iter();
        let values = own.chain(self.columns.iter().map(|column| column.values[k]));
        for (name, value) in self.scalars().zip(values) {
            element.insert(name, Property::Float(value.map_or(f32::NAN, |value| value as f32)));
        }
        element
    }

    /// Returns two triangles for each square of four seen nodes, counter-clockwise from the scanner.
    fn triangles(&self) -> Vec<[usize; 3]> {
        let [n_u, n_v] = NODES;
        let squares = (0..(n_u - 1) * (n_v - 1)).map(|k| k / (n_u - 1) * n_u + k % (n_u - 1));
        let seen = |corner: usize| {
            [corner, corner + 1, corner + n_u, corner + n_u + 1].iter().all(|k| self.nodes[*k].seen)
        };
        squares
            .filter(|corner| seen(*corner))
            .flat_map(|k| [[k, k + 1, k + n_u + 1], [k, k + n_u + 1, k + n_u]])
            .collect()
    }
}

const AXES: [&str; 3] = ["x", "y", "z"];
/// Common name of a face's corner indices in PLY.
const FACE: &str = "vertex_indices";

/// Returns one column for each component of a field, lengths in millimetres.
fn columns(field: &Field) -> Vec<Column> {
    let (suffix, factor) = readable(&field.unit);
    let one = |component: usize| {
        let part = match field.components {
            1 => String::new(),
            3 => format!("_{}", AXES[component]),
            _ => format!("_{component}"),
        };
        let value = |k: usize| {
            let share = |k: usize, n: usize| k as f64 / (n - 1) as f64;
            let (u, v) = (share(k % NODES[0], NODES[0]), share(k / NODES[0], NODES[1]));
            let (state, value) = field.sample(u, v, component);
            (state != NodeState::Unseen).then_some(value * factor)
        };
        Column {
            name: format!("{}{part}{suffix}", field.name),
            values: (0..NODES[0] * NODES[1]).map(value).collect(),
        }
    };
    (0..field.components).map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(seen: impl Fn(usize) -> bool) -> PlateTable {
        let node = |k: usize| {
            let (u, v) = ((k % 101) as f64 * 0.03, (k / 101) as f64 * 0.025);
            Node { uv: [u, v], face: [u, v, 0.1 * u], seen: seen(k) }
        };
        let field = Field {
            name: "deviation".into(),
            unit: "m".into(),
            nodes: [101, 101],
            components: 1,
            values: (0..101 * 101).map(|k| k as f64 * 1e-6).collect(),
            state: (0..101 * 101)
                .map(|k| if seen(k) { NodeState::Seen } else { NodeState::Unseen })
                .collect(),
        };
        PlateTable { nodes: (0..101 * 101).map(node).collect(), columns: columns(&field) }
    }

    #[test]
    fn a_node_without_data_is_an_empty_cell() {
        let csv = String::from_utf8(table(|k| k != 1).csv().unwrap()).unwrap();
        let mut lines = csv.lines();
        assert_eq!(lines.next(), Some("u_mm,v_mm,x_m,y_m,z_m,seen,deviation_mm"));
        assert_eq!(lines.next(), Some("0.000,0.000,0.000000,0.000000,0.000000,1,0.000000"));
        assert_eq!(lines.next(), Some("30.000,0.000,0.030000,0.000000,0.003000,0,"));
        assert_eq!(lines.next(), Some("60.000,0.000,0.060000,0.000000,0.006000,1,0.002000"));
        assert_eq!(csv.lines().count(), 1 + 101 * 101);
    }

    #[test]
    fn the_mesh_has_the_plates_area_and_a_hole_where_nothing_was_seen() {
        let area = |table: &PlateTable| -> f64 {
            let corner = |k: usize| table.nodes[k].uv;
            let twice = |[a, b, c]: [usize; 3]| {
                let ([x0, y0], [x1, y1], [x2, y2]) = (corner(a), corner(b), corner(c));
                (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
            };
            table.triangles().into_iter().map(|triangle| 0.5 * twice(triangle)).sum()
        };
        assert!(
            (area(&table(|_| true)) - 3.0 * 2.5).abs() < 1e-9,
            "counter-clockwise triangles have positive area"
        );
        // One unseen node inside removes the four squares round it.
        assert!((area(&table(|k| k != 50 * 101 + 50)) - (7.5 - 4.0 * 0.03 * 0.025)).abs() < 1e-9);
    }

    #[test]
    fn the_file_is_read_back_as_written() {
        let table = table(|k| k != 1);
        let bytes = table.ply().unwrap();
        let parser = ply_rs_bw::parser::Parser::<DefaultElement>::new();
        let read = parser.read_ply(&mut bytes.as_slice()).unwrap();
        assert_eq!(read.header.encoding, Encoding::BinaryLittleEndian);
        assert_eq!(read.payload["vertex"].len(), 101 * 101);
        assert_eq!(read.payload["face"].len(), table.triangles().len());
        let vertex = &read.payload["vertex"][2];
        assert_eq!(vertex["z"], Property::Double(0.1 * 0.06));
        assert_eq!(vertex["scalar_deviation_mm"], Property::Float(0.002));
        assert!(matches!(read.payload["vertex"][1]["scalar_deviation_mm"], Property::Float(x) if x.is_nan()));
    }

    #[test]
    fn the_vtk_file_holds_every_array_in_its_place() {
        let table = table(|k| k != 1);
        let bytes = table.vtk();
        let after = |head: &str| {
            let at = bytes.windows(head.len()).position(|window| window == head.as_bytes());
            &bytes[at.unwrap_or_else(|| panic!("no {head}")) + head.len()..]
        };
        let (n, m) = (101 * 101, table.triangles().len());
        let point = &after(&format!("POINTS {n} double\n"))[24 * 2..];
        assert_eq!(point[..8], 0.06_f64.to_be_bytes());
        assert!(after(&format!("POINTS {n} double\n"))[24 * n..].starts_with(b"\nCELLS"));
        assert!(after(&format!("CELLS {m} {}\n", 4 * m))[16 * m..].starts_with(b"\nCELL_TYPES"));
        assert!(after(&format!("CELL_TYPES {m}\n"))[4 * m..].starts_with(b"\nPOINT_DATA"));
        let field = after("SCALARS deviation_mm float 1\nLOOKUP_TABLE default\n");
        assert_eq!(field.len(), 4 * n + 1);
        assert_eq!(field[8..12], 0.002_f32.to_be_bytes());
        assert!(f32::from_be_bytes(field[4..8].try_into().unwrap()).is_nan());
    }

    #[test]
    fn names_are_quoted_where_rfc_4180_requires_it() {
        let names = ["plain", "a b", " a", "a, \"b\"", "a\"b", "two\nlines", "a\rb", "\u{b5}m;'"];
        let quoted = |name: &str| match name.contains([',', '"', '\n', '\r']) {
            true => format!("\"{}\"", name.replace('"', "\"\"")),
            false => name.to_owned(),
        };
        let columns = names.map(|name| Column { name: name.into(), values: Vec::new() }).to_vec();
        let table = PlateTable { nodes: Vec::new(), columns };
        let expected = format!("u_mm,v_mm,x_m,y_m,z_m,seen,{}\n", names.map(quoted).join(","));
        assert_eq!(String::from_utf8(table.csv().unwrap()).unwrap(), expected);
    }

    #[test]
    fn vectors_get_a_column_each() {
        let field = Field {
            name: "displacement".into(),
            unit: "m".into(),
            nodes: [2, 2],
            components: 3,
            values: (0..12).map(f64::from).collect(),
            state: vec![NodeState::Seen; 4],
        };
        let names: Vec<String> = columns(&field).into_iter().map(|column| column.name).collect();
        assert_eq!(names, ["displacement_x_mm", "displacement_y_mm", "displacement_z_mm"]);
        assert_eq!(field.sample(0.5, 0.5, 1), (NodeState::Seen, 5.5), "the mean of 1, 4, 7 and 10");
    }
}
