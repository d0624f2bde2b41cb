//! The files of one measurement: all of them or none.

use std::path::{Path, PathBuf};

use crate::picture;
use crate::plugin::Report;
use crate::record::{LineRecord, ResultRecord};

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
        /// Field.
        name: String,
        /// Reason.
        why: String,
    },
}

/// Writes `result.json`, `reference_lines.csv` and a picture for each field into a new folder.
///
/// Everything is written beside the folder first and put in place by one rename, so that a reader never finds half.
///
/// # Errors
/// [`FilesError`]; then nothing is left behind.
pub fn write(folder: &Path, record: &ResultRecord, reports: &[&Report]) -> Result<Vec<PathBuf>, FilesError> {
    if folder.exists() {
        return Err(FilesError::Exists(folder.to_path_buf()));
    }
    let mut name = folder.file_name().unwrap_or_default().to_os_string();
    name.push(format!(".{}.part", std::process::id()));
    let part = folder.with_file_name(name);
    let written = fill(&part, record, reports).and_then(|files| {
        let failed = |source| FilesError::Write { path: folder.to_path_buf(), source };
        std::fs::rename(&part, folder).map_err(failed)?;
        Ok(files.iter().map(|file| folder.join(file)).collect())
    });
    if written.is_err() {
        // Whatever was written so far is of no use; what cannot be removed is named `.part`.
        let _ = std::fs::remove_dir_all(&part);
    }
    written
}

fn fill(part: &Path, record: &ResultRecord, reports: &[&Report]) -> Result<Vec<String>, FilesError> {
    let failed = |path: &Path| {
        let path = path.to_path_buf();
        move |source| FilesError::Write { path, source }
    };
    std::fs::create_dir_all(part).map_err(failed(part))?;
    let mut files = Vec::new();
    let mut put = |name: String, content: &[u8]| {
        let path = part.join(&name);
        std::fs::write(&path, content)
            .and_then(|()| std::fs::File::open(&path)?.sync_all())
            .map_err(failed(&path))?;
        files.push(name);
        Ok::<(), FilesError>(())
    };
    let json = serde_json::to_vec_pretty(record).map_err(|e| failed(part)(e.into()))?;
    put("result.json".into(), &json)?;
    put("reference_lines.csv".into(), csv(&record.reference_lines).as_bytes())?;
    for field in reports.iter().flat_map(|report| &report.fields).filter(|field| field.components == 1) {
        let why =
            |e: picture::PictureError| FilesError::Picture { name: field.name.clone(), why: e.to_string() };
        let svg = picture::map(field, record).map_err(why)?;
        put(format!("{}.svg", field.name), svg.as_bytes())?;
    }
    Ok(files)
}

fn csv(lines: &[LineRecord]) -> String {
    let mut text = String::from("line,u_mm,v_mm,x_m,y_m,z_m,seen\n");
    for line in lines {
        // A name may hold a comma or a quote.
        let name = format!("\"{}\"", line.name.replace('"', "\"\""));
        for point in &line.points {
            let [x, y, z] = point.position_m;
            let seen = u8::from(point.seen);
            text += &format!("{name},{:.3},{:.3},{x:.6},{y:.6},{z:.6},{seen}\n", point.u_mm, point.v_mm);
        }
    }
    text
}
