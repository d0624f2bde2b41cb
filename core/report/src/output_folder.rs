//! The files of one measurement: all documents or none, then the pictures beside them.

use std::path::{Path, PathBuf};

use platen_shape::Surface;

use crate::field_export::{PlateTable, csv_cell};
use crate::result::{LineRecord, PlateRecord, ResultRecord};
use crate::{
    picture,
    picture::{Caption, PictureError, StripPoint},
};
use platen_model::Report;
use platen_sdk::exchange::{AlignedBuffer, Decode, Encode};

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

/// The surface beside a result document.
///
/// # Errors
/// Which file, and why it cannot be read any more.
pub fn surface_beside(document: &Path) -> Result<Surface, String> {
    let path = document.with_file_name(SURFACE);
    let read = std::fs::read(&path).map_err(|e| e.to_string()).and_then(|bytes| {
        Surface::decode(AlignedBuffer::copy_of(&bytes).as_ref()).map_err(|e| e.to_string())
    });
    read.map_err(|why| format!("{}: {why}", path.display()))
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
        (SURFACE, surface.to_buffer().as_ref().to_vec()),
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
    let caption = Caption { plate: &record.plate, stroke: record.stroke, verdict: record.verdict };
    let scale = &record.plate_file.scale;
    let mut files = fields(folder, surface, reports, &record.plate_file, &caption)?;
    for line in &record.reference_lines {
        for template in &line.templates {
            let section = picture::section(line, template, &caption, scale);
            files.push(put_picture(folder, &format!("section-{}", template.name), section)?);
        }
    }
    if !strokes.is_empty() {
        files.push(put_picture(folder, "strokes", picture::strip(strokes, &caption, scale))?);
    }
    Ok(files)
}

/// What comparisons found at every place: as a table (`grid.csv`), on the plate's mesh (`plate.ply`, `plate.vtk`), and a
/// map of each field.
///
/// # Errors
/// [`FilesError`].
pub fn fields(
    folder: &Path,
    surface: &Surface,
    reports: &[&Report],
    plate: &PlateRecord,
    caption: &Caption<'_>,
) -> Result<Vec<PathBuf>, FilesError> {
    let table = PlateTable::new(surface, reports);
    let mut files = vec![
        put(folder, "grid.csv", table.csv().as_bytes())?,
        put(folder, "plate.ply", &table.ply().map_err(FilesError::Mesh)?)?,
        put(folder, "plate.vtk", &table.vtk())?,
    ];
    for field in reports.iter().flat_map(|report| &report.fields).filter(|field| field.components == 1) {
        let map = picture::map(field, plate, caption, &plate.scale);
        files.push(put_picture(folder, &field.name, map)?);
    }
    Ok(files)
}

fn put_picture(folder: &Path, name: &str, svg: Result<String, PictureError>) -> Result<PathBuf, FilesError> {
    let svg = svg.map_err(|e| FilesError::Picture { name: name.to_owned(), why: e.to_string() })?;
    put(folder, &format!("{}.svg", file_name(name)), svg.as_bytes())
}

/// Replaces a file in a folder.
pub fn put(folder: &Path, name: &str, content: &[u8]) -> Result<PathBuf, FilesError> {
    let path = folder.join(name);
    replace(&path, content)?;
    Ok(path)
}

/// Replaces a file in one step: a reader finds the old one or the new one, never half.
pub fn replace(path: &Path, content: &[u8]) -> Result<(), FilesError> {
    let mut part = path.as_os_str().to_owned();
    part.push(".part");
    std::fs::write(&part, content).and_then(|()| std::fs::rename(&part, path)).map_err(failed(path))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stay_in_their_folder() {
        assert_eq!(file_name("../a b/\u{c4}1"), ".._a_b_\u{c4}1");
    }
}
