//! Commands `platen history backup`, `verify` and `restore`: the record with its documents, copied while the host runs.

use std::ffi::OsStr;
use std::fs::File;
use std::path::{Path, PathBuf};

use clap::Args;
use platen_history::{Archive, Filter};
use platen_plant::PlantFile;
use platen_report::output_folder;
use serde::{Deserialize, Serialize};

use super::{CliError, Common, open, output};
use crate::{progress, sha256};

/// Version of the manifest.
const SCHEMA: &str = "platen.backup/1";
const MANIFEST: &str = "manifest.json";
const DATABASE: &str = "history.sqlite";

#[derive(Debug, Args)]
pub(super) struct Backup {
    /// Plant file
    plant: PathBuf,
    /// Folder for the backup, which must not exist yet
    folder: PathBuf,
    /// With the raw scans that are still kept
    #[arg(long)]
    scans: bool,
}

#[derive(Debug, Args)]
pub(super) struct Verify {
    /// Folder of the backup
    folder: PathBuf,
}

#[derive(Debug, Args)]
pub(super) struct Restore {
    /// Folder of the backup
    folder: PathBuf,
    /// Plant file of the host that goes on with the record; it must have none yet
    plant: PathBuf,
}

/// Content of a backup.
#[derive(Debug, Serialize, Deserialize)]
struct Manifest {
    schema: String,
    software: String,
    /// Name of the plant.
    plant: String,
    /// Time of the copy, UTC.
    made: jiff::Timestamp,
    strokes: usize,
    /// Newest stroke; null for an empty record.
    last_run: Option<u32>,
    files: Vec<Copied>,
}

/// File of a backup, its path relative to the folder.
#[derive(Debug, Serialize, Deserialize)]
struct Copied {
    path: PathBuf,
    bytes: u64,
    sha256: String,
}

fn failed(path: &Path) -> impl Fn(std::io::Error) -> CliError + '_ {
    move |error| CliError::Failed(format!("{}: {error}", path.display()))
}

pub(super) fn backup(common: &Common, command: &Backup) -> Result<(), CliError> {
    let (plant, archive) = open(&command.plant)?;
    let folder = &command.folder;
    if folder.exists() {
        return Err(CliError::Usage(format!(
            "{}: exists already; a backup gets a folder of its own",
            folder.display()
        )));
    }
    // An incomplete backup has another name.
    let part = PathBuf::from(format!("{}.part", folder.display()));
    if part.exists() {
        std::fs::remove_dir_all(&part).map_err(failed(&part))?;
    }
    std::fs::create_dir_all(&part).map_err(failed(&part))?;
    archive.copy_to(&part.join(DATABASE))?;
    // Strokes of the copy; the host may have recorded others since.
    let strokes = Archive::open(&part.join(DATABASE))?.strokes(&Filter::default())?;
    let mut files = vec![described(&part, Path::new(DATABASE))?];
    let documents: Vec<_> =
        strokes.iter().filter_map(|it| Some((it.run_id, it.document.as_deref()?.parent()?))).collect();
    for (k, (run_id, from)) in documents.iter().enumerate() {
        progress::share("backup", k as f64 / documents.len() as f64);
        let name = run_folder(*run_id);
        std::fs::create_dir_all(part.join(&name)).map_err(failed(&part))?;
        for entry in std::fs::read_dir(from).map_err(failed(from))? {
            let path = entry.map_err(failed(from))?.path();
            let Some(file) = path.file_name().filter(|file| is_wanted(file, command.scans) && path.is_file())
            else {
                continue;
            };
            let relative = Path::new(&name).join(file);
            link_or_copy(&path, &part.join(&relative))?;
            files.push(described(&part, &relative)?);
        }
    }
    progress::done();
    let manifest = Manifest {
        schema: SCHEMA.into(),
        software: concat!("platen ", env!("CARGO_PKG_VERSION")).into(),
        plant: plant.name.clone(),
        made: jiff::Timestamp::now(),
        strokes: strokes.len(),
        last_run: strokes.last().map(|it| it.run_id),
        files,
    };
    let text = serde_json::to_vec_pretty(&manifest).map_err(|e| CliError::Failed(e.to_string()))?;
    std::fs::write(part.join(MANIFEST), text).map_err(failed(&part))?;
    std::fs::rename(&part, folder).map_err(failed(folder))?;
    let text = format!(
        "{} strokes, {} files in {}; `platen history verify` checks them",
        manifest.strokes,
        manifest.files.len(),
        folder.display()
    );
    output::either(common, &manifest, &text)
}

pub(super) fn verify(common: &Common, command: &Verify) -> Result<(), CliError> {
    let manifest = verified(&command.folder)?;
    let text = format!(
        "sound: {} strokes of {:?} as of {}, {} files",
        manifest.strokes,
        manifest.plant,
        manifest.made.strftime("%F %T UTC"),
        manifest.files.len()
    );
    output::either(common, &manifest, &text)
}

pub(super) fn restore(common: &Common, command: &Restore) -> Result<(), CliError> {
    let plant = PlantFile::load(&command.plant)?;
    let history = &plant.output.history;
    let refuse = |path: &Path| {
        CliError::Usage(format!(
            "{}: is there; stop its host and move it away, nothing was changed",
            path.display()
        ))
    };
    if history.exists() {
        return Err(refuse(history));
    }
    let manifest = verified(&command.folder)?;
    let runs: Vec<_> = manifest.files.iter().filter(|it| it.path != Path::new(DATABASE)).collect();
    if let Some(there) = runs.iter().map(|it| plant.output.folder.join(&it.path)).find(|path| path.exists()) {
        return Err(refuse(&there));
    }
    for (k, file) in runs.iter().enumerate() {
        progress::share("restore", k as f64 / runs.len() as f64);
        let to = plant.output.folder.join(&file.path);
        if let Some(folder) = to.parent() {
            std::fs::create_dir_all(folder).map_err(failed(folder))?;
        }
        // Copied, never linked: the backup must not change.
        std::fs::copy(command.folder.join(&file.path), &to).map_err(failed(&to))?;
    }
    progress::done();
    let part = PathBuf::from(format!("{}.part", history.display()));
    if let Some(folder) = history.parent() {
        std::fs::create_dir_all(folder).map_err(failed(folder))?;
    }
    std::fs::copy(command.folder.join(DATABASE), &part).map_err(failed(&part))?;
    let document = |run_id| {
        plant.output.folder.join(run_folder(run_id)).join("result.json").to_string_lossy().into_owned()
    };
    let owners = platen_history::adopt(&part, document)?;
    File::open(&part).and_then(|file| file.sync_all()).map_err(failed(&part))?;
    std::fs::rename(&part, history).map_err(failed(history))?;
    let changed: Vec<String> = owners.iter().map(|[old, new]| format!("{old} to {new}")).collect();
    let text = format!(
        "{} strokes restored to {}; the owner number of the host changes from {}, so that its new strokes are not taken for those after the backup",
        manifest.strokes,
        history.display(),
        changed.join(", ")
    );
    output::either(
        common,
        &serde_json::json!({ "strokes": manifest.strokes, "history": history, "owners": owners }),
        &text,
    )
}

/// Checks a backup: every file against the manifest, the database with SQLite, a document for each measured stroke.
fn verified(folder: &Path) -> Result<Manifest, CliError> {
    let path = folder.join(MANIFEST);
    let text = std::fs::read(&path)
        .map_err(|e| CliError::Usage(format!("{}: {e}; no backup of platen", path.display())))?;
    let manifest: Manifest =
        serde_json::from_slice(&text).map_err(|e| CliError::Failed(format!("{}: {e}", path.display())))?;
    let damaged =
        |path: &Path, why: &str| CliError::Failed(format!("{}: {why}; take another backup", path.display()));
    for (k, file) in manifest.files.iter().enumerate() {
        progress::share("verify", k as f64 / manifest.files.len() as f64);
        let path = folder.join(&file.path);
        let found = described(folder, &file.path).map_err(|_| damaged(&path, "is missing"))?;
        if (found.bytes, &found.sha256) != (file.bytes, &file.sha256) {
            return Err(damaged(&path, "is not what was backed up"));
        }
    }
    progress::done();
    let archive = Archive::open(&folder.join(DATABASE))?;
    if let Some(found) = archive.damage()? {
        return Err(damaged(archive.path(), &found));
    }
    for stroke in archive.strokes(&Filter::default())? {
        let document = Path::new(&run_folder(stroke.run_id)).join("result.json");
        if stroke.document.is_some() && !manifest.files.iter().any(|file| file.path == document) {
            return Err(damaged(&folder.join(document), "is missing"));
        }
    }
    Ok(manifest)
}

fn run_folder(run_id: u32) -> String {
    format!("run-{run_id:06}")
}

fn described(folder: &Path, relative: &Path) -> Result<Copied, CliError> {
    let path = folder.join(relative);
    let bytes = std::fs::metadata(&path).map_err(failed(&path))?.len();
    let sha256 = sha256::of_file(&path).map_err(failed(&path))?;
    Ok(Copied { path: relative.to_owned(), bytes, sha256 })
}

/// Returns whether a file of a stroke belongs to a backup. Files that are still being written have temporary names and
/// are left out.
fn is_wanted(file: &OsStr, scans: bool) -> bool {
    Path::new(file).extension().is_none_or(|extension| extension != "part")
        && (scans || file != output_folder::SCAN)
}

/// Links a document, or copies it across file systems. Documents are replaced by a rename and never changed in place,
/// so a link keeps the content.
fn link_or_copy(from: &Path, to: &Path) -> Result<(), CliError> {
    match std::fs::hard_link(from, to) {
        Ok(()) => Ok(()),
        Err(_) => std::fs::copy(from, to).map(drop).map_err(failed(to)),
    }
}
