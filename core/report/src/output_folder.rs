//! Result folder of one measurement: its documents, written completely or not at all, then tables, meshes and pictures.
//!
//! A folder and every single file appear under their name by one rename, so that a reader never finds a partial file.

use std::io::Write as _;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};

use platen_model::Report;
use platen_sdk::exchange::{AlignedBuffer, Payload};
use platen_shape::Surface;

use crate::field_export::PlateTable;
use crate::picture::{self, Caption, PictureError, StripPoint, View};
use crate::result::{CURVATURE_DEFICIT, LineRecord, Next, PlateRecord, ResultRecord};

/// Name of the surface's file: the `platen.surface/1` buffer of `platen.h` that comparisons receive.
pub const SURFACE: &str = "surface.platen";

/// Name of the raw scan, where it is kept.
pub const SCAN: &str = "scan.e57";

/// Fields whose colours are written as a picture of the plate alone, for the 3D view.
pub const TEXTURES: [&str; 2] = [CURVATURE_DEFICIT, "deviation"];

/// Failure to write the files of a measurement.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the message of a variant names its fields")]
pub enum FilesError {
    /// Unwritable file or folder.
    #[error("{}: cannot be written: {source}; check the folder and the space on its disk", .path.display())]
    Write { path: PathBuf, source: std::io::Error },
    /// Folder that exists already.
    #[error("{}: exists already; give another --out or remove it", .0.display())]
    Exists(PathBuf),
    /// Picture that cannot be drawn.
    #[error("picture of {name}: {why}; report this with the result")]
    Picture { name: String, why: String },
    /// Table or mesh that cannot be encoded.
    #[error("{0}; report this with the result")]
    Export(String),
}

/// Writes `result.json`, `reference_lines.csv` and the surface, the reference of the next stroke, into a new folder.
///
/// The folder is filled under a temporary name and renamed once, so that a reader finds it complete or not at all.
///
/// # Errors
/// [`FilesError`]; then no file is left behind.
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
        // A partial folder that cannot be removed is recognised by its name.
        let _ = std::fs::remove_dir_all(&part);
    }
    written
}

/// Reads the surface beside a result document.
///
/// # Errors
/// The file and the reason why it cannot be read.
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

/// Adds the file name to the error of an encoder.
fn export<E: std::fmt::Display>(name: &'static str) -> impl Fn(E) -> FilesError {
    move |why| FilesError::Export(format!("{name}: {why}"))
}

fn fill(part: &Path, record: &ResultRecord, surface: &Surface) -> Result<Vec<&'static str>, FilesError> {
    std::fs::create_dir_all(part).map_err(failed(part))?;
    let json = serde_json::to_vec_pretty(record).map_err(|e| failed(part)(e.into()))?;
    let files = [
        ("result.json", json),
        ("reference_lines.csv", lines_csv(&record.reference_lines).map_err(export("reference_lines.csv"))?),
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

/// Draws the pictures of a stroke into its folder, and writes the fields as a table (`grid.csv`) and as meshes
/// (`plate.ply`, `plate.vtk`). `strokes` are those of the plate so far, this one last; empty for a measurement without
/// history. Existing files are replaced.
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
    let mut files = fields(folder, surface, reports, &record.plate_file, &caption, record.next.as_ref())?;
    for line in &record.reference_lines {
        for template in &line.templates {
            let section = picture::section(line, template, &caption, scale, View::FILE);
            files.push(put_picture(folder, &format!("section-{}", template.name), section)?);
        }
    }
    if !strokes.is_empty() {
        files.push(put_picture(folder, "strokes", picture::strip(strokes, &caption, scale, View::FILE))?);
    }
    Ok(files)
}

/// Writes the fields of the comparisons as a table (`grid.csv`), on the plate's mesh (`plate.ply`, `plate.vtk`) and as
/// one map for each field with one component; `next` is framed on the map of the missing curvature.
///
/// # Errors
/// [`FilesError`].
pub fn fields(
    folder: &Path,
    surface: &Surface,
    reports: &[&Report],
    plate: &PlateRecord,
    caption: &Caption<'_>,
    next: Option<&Next>,
) -> Result<Vec<PathBuf>, FilesError> {
    let table = PlateTable::new(surface, reports);
    let mut files = vec![
        put(folder, "grid.csv", &table.csv().map_err(export("grid.csv"))?)?,
        put(folder, "plate.ply", &table.ply().map_err(export("plate.ply"))?)?,
        put(folder, "plate.vtk", &table.vtk())?,
    ];
    for field in reports.iter().flat_map(|report| &report.fields).filter(|field| field.components == 1) {
        let map = picture::map(field, plate, caption, &plate.scale, next);
        files.push(put_picture(folder, &field.name, map)?);
    }
    for field in
        reports.iter().flat_map(|report| &report.fields).filter(|field| TEXTURES.contains(&&*field.name))
    {
        let name = format!("{}.png", field.name);
        let png = picture::texture(field, plate);
        let png = png.map_err(|e| FilesError::Picture { name: name.clone(), why: e.to_string() })?;
        files.push(put(folder, &name, &png)?);
    }
    Ok(files)
}

fn put_picture(folder: &Path, name: &str, svg: Result<String, PictureError>) -> Result<PathBuf, FilesError> {
    let svg = svg.map_err(|e| FilesError::Picture { name: name.to_owned(), why: e.to_string() })?;
    put(folder, &format!("{}.svg", file_name(name)), svg.as_bytes())
}

/// Replaces a file in a folder and returns its path.
///
/// # Errors
/// [`FilesError::Write`].
pub fn put(folder: &Path, name: &str, content: &[u8]) -> Result<PathBuf, FilesError> {
    let path = folder.join(name);
    replace(&path, content)?;
    Ok(path)
}

/// Replaces a file by one rename: a reader finds the old content or the new one, never a part.
///
/// # Errors
/// [`FilesError::Write`].
pub fn replace(path: &Path, content: &[u8]) -> Result<(), FilesError> {
    let write = || {
        // Permissions of an ordinary new file, so that the umask applies.
        let permissions = std::fs::Permissions::from_mode(0o666);
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut part =
            tempfile::Builder::new().suffix(".part").permissions(permissions).tempfile_in(folder)?;
        part.write_all(content)?;
        part.persist(path).map(drop).map_err(|e| e.error)
    };
    write().map_err(failed(path))
}

/// Returns a name as a file name: characters that a file system or a shell may interpret become `_`.
pub fn file_name(name: &str) -> String {
    let kind = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' };
    name.chars().map(kind).collect()
}

fn lines_csv(lines: &[LineRecord]) -> csv::Result<Vec<u8>> {
    let mut table = csv::Writer::from_writer(Vec::new());
    table.write_record(["line", "u_mm", "v_mm", "x_m", "y_m", "z_m", "seen"])?;
    for line in lines {
        for point in &line.points {
            let place = [point.u_mm, point.v_mm].map(|mm| format!("{mm:.3}"));
            let position = point.position_m.map(|metres| format!("{metres:.6}"));
            table.serialize((&line.name, place, position, u8::from(point.seen)))?;
        }
    }
    table.into_inner().map_err(|e| e.into_error().into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::result::PointRecord;

    #[test]
    fn a_line_with_a_comma_in_its_name_stays_in_its_column() {
        let point = PointRecord { u_mm: 1.0, v_mm: 0.25, position_m: [-0.1, 2.0, 3e-7], seen: true };
        let lines = [LineRecord { name: "a, \"b\"".into(), points: vec![point], templates: Vec::new() }];
        assert_eq!(
            String::from_utf8(lines_csv(&lines).unwrap()).unwrap(),
            "line,u_mm,v_mm,x_m,y_m,z_m,seen\n\"a, \"\"b\"\"\",1.000,0.250,-0.100000,2.000000,0.000000,1\n"
        );
    }

    #[test]
    fn a_replaced_file_has_the_permissions_of_a_new_one_and_nothing_stays_beside_it() {
        let folder = tempfile::tempdir().unwrap();
        let [ordinary, replaced] = ["ordinary", "replaced"].map(|name| folder.path().join(name));
        std::fs::write(&ordinary, "").unwrap();
        for content in ["old", "new"] {
            put(folder.path(), "replaced", content.as_bytes()).unwrap();
        }
        assert_eq!(std::fs::read_to_string(&replaced).unwrap(), "new");
        let mode = |path: &Path| std::fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&ordinary), mode(&replaced));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    }

    #[test]
    fn names_stay_in_their_folder() {
        assert_eq!(file_name("../a b/\u{c4}1"), ".._a_b_\u{c4}1");
    }
}
