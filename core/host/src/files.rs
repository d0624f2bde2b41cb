//! The files of one measurement: all documents or none, then the pictures beside them.

use std::path::{Path, PathBuf};

use platen_shape::Surface;

use crate::picture::{self, Caption, PictureError, StripPoint};
use crate::plugin::{Report, surface_bytes};
use crate::record::{LineRecord, ResultRecord};
use crate::table::PlateTable;

/// Name of the surface's file: what comparisons are given, a `platen.surface/1` buffer of `platen.h`.
pub const SURFACE: &str = "surface.platen";

/// Why files were not written.
#[derive(Debug, thiserror::Error)]
pub enum FilesError {
    /// The folder cannot be written.
    #[error("{}: cannot be written: {source}; check the folder and the space on its disk", .path.display())]
    Write {
        /// File or folder.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// There is something in the way.
    #[error("{}: exists already; give another --out or remove it", .0.display())]
    Exists(PathBuf),
    /// The picture cannot be drawn.
    #[error("picture of {name}: {why}; report this with the result")]
    Picture {
        /// What it shows.
        name: String,
        /// Reason.
        why: String,
    },
    /// The mesh cannot be written.
    #[error("mesh: {0}; report this with the result")]
    Mesh(String),
}

/// Writes `result.json`, `reference_lines.csv` and the surface, which the next stroke is compared with, into a new folder.
///
/// Everything is written beside the folder first and put in place by one rename, so that a reader never finds half.
///
/// # Errors
/// [`FilesError`]; then nothing is left behind.
pub fn write(folder: &Path, record: &ResultRecord, surface: &Surface) -> Result<Vec<PathBuf>, FilesError> {
    if folder.exists() {
        return Err(FilesError::Exists(folder.to_path_buf()));
    }
    let mut name = folder.file_name().unwrap_or_default().to_os_string();
    name.push(format!(".{}.part", std::process::id()));
    let part = folder.with_file_name(name);
    let written = fill(&part, record, surface).and_then(|files| {
        std::fs::rename(&part, folder).map_err(failed(folder))?;
        Ok(files.iter().map(|file| folder.join(file)).collect())
    });
    if written.is_err() {
        // Whatever was written so far is of no use; what cannot be removed is named `.part`.
        let _ = std::fs::remove_dir_all(&part);
    }
    written
}

fn failed(path: &Path) -> impl Fn(std::io::Error) -> FilesError + use<> {
    let path = path.to_path_buf();
    move |source| FilesError::Write { path: path.clone(), source }
}

fn fill(part: &Path, record: &ResultRecord, surface: &Surface) -> Result<Vec<&'static str>, FilesError> {
    std::fs::create_dir_all(part).map_err(failed(part))?;
    let json = serde_json::to_vec_pretty(record).map_err(|e| failed(part)(e.into()))?;
    let files = [
        ("result.json", json),
        ("reference_lines.csv", lines_csv(&record.reference_lines).into_bytes()),
        (SURFACE, surface_bytes(surface)),
    ];
    for (name, content) in &files {
        let path = part.join(name);
        std::fs::write(&path, content)
            .and_then(|()| std::fs::File::open(&path)?.sync_all())
            .map_err(failed(&path))?;
    }
    Ok(files.map(|(name, _)| name).to_vec())
}

/// Draws the pictures of a stroke into its folder, and writes the plate as a table (`grid.csv`) and as a mesh
/// (`plate.ply`, `plate.vtk`). `strokes` are those of the plate so far, this one last; none for a measurement that has no history.
///
/// All of it can be made again from the documents; what was made already is replaced.
///
/// # Errors
/// [`FilesError`].
pub fn illustrate(
    folder: &Path,
    record: &ResultRecord,
    surface: &Surface,
    reports: &[&Report],
    strokes: &[StripPoint],
) -> Result<Vec<PathBuf>, FilesError> {
    let mut files = Vec::new();
    let mut keep = |name: &str, content: &[u8]| {
        files.push(put(folder, name, content)?);
        Ok::<(), FilesError>(())
    };
    let table = PlateTable::new(surface, reports);
    keep("grid.csv", table.csv().as_bytes())?;
    keep("plate.ply", &table.ply().map_err(FilesError::Mesh)?)?;
    keep("plate.vtk", &table.vtk())?;
    for (name, svg) in pictures(record, reports, strokes)? {
        keep(&format!("{name}.svg"), svg.as_bytes())?;
    }
    Ok(files)
}

/// Replaces a file in one step.
pub(crate) fn put(folder: &Path, name: &str, content: &[u8]) -> Result<PathBuf, FilesError> {
    let (part, path) = (folder.join(format!("{name}.part")), folder.join(name));
    std::fs::write(&part, content).and_then(|()| std::fs::rename(&part, &path)).map_err(failed(&path))?;
    Ok(path)
}

/// Every picture of a stroke with its name.
fn pictures(
    record: &ResultRecord,
    reports: &[&Report],
    strokes: &[StripPoint],
) -> Result<Vec<(String, String)>, FilesError> {
    let caption = Caption { plate: &record.plate, stroke: record.stroke, verdict: record.verdict };
    let (plate, scale) = (&record.plate_file, &record.plate_file.scale);
    let mut all = Vec::new();
    let mut draw = |name: String, svg: Result<String, PictureError>| match svg {
        Ok(svg) => {
            all.push((file_name(&name), svg));
            Ok(())
        }
        Err(e) => Err(FilesError::Picture { name, why: e.to_string() }),
    };
    for field in reports.iter().flat_map(|report| &report.fields).filter(|field| field.components == 1) {
        draw(field.name.clone(), picture::map(field, plate, &caption, scale))?;
    }
    for line in &record.reference_lines {
        for template in &line.templates {
            draw(format!("section-{}", template.name), picture::section(line, template, &caption, scale))?;
        }
    }
    if !strokes.is_empty() {
        draw("strokes".into(), picture::strip(strokes, &caption, scale))?;
    }
    Ok(all)
}

/// A name as a file's: what a file system or a shell may mind becomes `_`.
pub(crate) fn file_name(name: &str) -> String {
    let kind = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' };
    name.chars().map(kind).collect()
}

fn lines_csv(lines: &[LineRecord]) -> String {
    let mut text = String::from("line,u_mm,v_mm,x_m,y_m,z_m,seen\n");
    for line in lines {
        let name = csv_cell(&line.name);
        for point in &line.points {
            let [x, y, z] = point.position_m;
            let seen = u8::from(point.seen);
            text += &format!("{name},{:.3},{:.3},{x:.6},{y:.6},{z:.6},{seen}\n", point.u_mm, point.v_mm);
        }
    }
    text
}

/// A cell of CSV (RFC 4180): a name may hold a comma or a quote.
pub(crate) fn csv_cell(text: &str) -> String {
    match text.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stay_in_their_folder_and_cells_in_their_column() {
        assert_eq!(file_name("../a b/\u{c4}1"), ".._a_b_\u{c4}1");
        assert_eq!(csv_cell("plain"), "plain");
        assert_eq!(csv_cell("a, \"b\""), "\"a, \"\"b\"\"\"");
    }
}
