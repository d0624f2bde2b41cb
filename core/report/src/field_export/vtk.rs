//! Legacy VTK file of the plate's mesh with its fields, for ParaView and other viewers.
//!
//! Source: The VTK User's Guide, "VTK File Formats", "Simple Legacy Formats": a text head before each array, arrays
//! big-endian. The binary form is used because VTK's text reader stops at NaN, the value of nodes without data.

use platen_model::units::mm;

use super::PlateTable;

const TRIANGLE: u32 = 5;

impl PlateTable {
    /// Writes a triangle mesh as binary legacy VTK: positions in metres, fields with the unit in their name, NaN
    /// without data. Triangles as in [`ply`](Self::ply).
    pub fn vtk(&self) -> Vec<u8> {
        let triangles = self.triangles();
        let mut file = File::default();
        file.head(concat!(
            "# vtk DataFile Version 3.0\nplaten ",
            env!("CARGO_PKG_VERSION"),
            ", scanned face, metres\n"
        ));
        file.head("BINARY\nDATASET UNSTRUCTURED_GRID\n");
        file.head(&format!("POINTS {} double\n", self.nodes.len()));
        file.array(self.nodes.iter().flat_map(|node| node.face).map(f64::to_be_bytes));
        file.head(&format!("CELLS {} {}\n", triangles.len(), 4 * triangles.len()));
        file.array(triangles.iter().flat_map(|[a, b, c]| [3, *a, *b, *c]).map(|k| (k as u32).to_be_bytes()));
        file.head(&format!("CELL_TYPES {}\n", triangles.len()));
        file.array(triangles.iter().map(|_| TRIANGLE.to_be_bytes()));
        file.head(&format!("POINT_DATA {}\n", self.nodes.len()));
        for (k, name) in ["u_mm", "v_mm"].into_iter().enumerate() {
            file.scalars(name, self.nodes.iter().map(|node| Some(mm(node.uv[k]))));
        }
        for column in &self.columns {
            file.scalars(&column.name, column.values.iter().copied());
        }
        file.0
    }
}

#[derive(Default)]
struct File(Vec<u8>);

impl File {
    fn head(&mut self, text: &str) {
        self.0.extend_from_slice(text.as_bytes());
    }

    fn array<const N: usize>(&mut self, numbers: impl Iterator<Item = [u8; N]>) {
        self.0.extend(numbers.flatten());
        self.0.push(b'\n');
    }

    fn scalars(&mut self, name: &str, values: impl Iterator<Item = Option<f64>>) {
        // A name ends at the first white space.
        let name = name.replace(char::is_whitespace, "_");
        self.head(&format!("SCALARS {name} float 1\nLOOKUP_TABLE default\n"));
        self.array(values.map(|value| value.map_or(f32::NAN, |value| value as f32).to_be_bytes()));
    }
}
