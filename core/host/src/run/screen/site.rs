//! Answers of the host to the pages: recorded strokes and plates, documents and files of strokes, maps of the newest
//! stroke.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use platen_engine::pipeline;
use platen_engine::plugin::{Catalogue, Surfaces};
use platen_history::{Archive, Filter, PlateRecord, Stroke};
use platen_model::{Field, Task, Verdict};
use platen_plant::press::{Mode, Press};
use platen_plant::{PlantFile, PluginUse, Show};
use platen_report::advice::AdviceRecord;
use platen_report::result::ResultRecord;
use platen_report::sequence::Sequence;
use platen_report::{history_view, output_folder, plate_report};
use platen_screen::{Engineer, FILES, PlateRow, PluginRow, Snapshot, Source, SourceError, StrokeRow};
use platen_shape::Surface;
use tokio::sync::watch;

use super::engineer::{self, Installation};
use super::{Beside, Board, MeasuredStroke, lock};

/// Nodes along each side of the mesh.
const NODES: usize = 101;
/// Number of newest plates in the list.
const PLATES: usize = 100;
/// Age up to which the engineer's figures are reused, for any number of readers.
const FRESH: Duration = Duration::from_millis(500);

/// Source of the pages.
#[derive(Debug)]
pub(super) struct Site {
    board: Arc<Board>,
    installation: Installation,
    catalogue: Catalogue,
    /// Sequences by plate, with the number of strokes at which they were computed.
    sequences: Mutex<HashMap<u32, (usize, Option<Sequence>)>>,
    engineer: Mutex<Option<(Instant, Engineer)>>,
}

fn unreadable(error: impl std::fmt::Display) -> SourceError {
    SourceError::Unreadable(error.to_string())
}

impl Site {
    pub(super) fn new(
        board: Arc<Board>,
        plant: &PlantFile,
        press: &Press,
        catalogue: &Catalogue,
        beside: &Beside,
    ) -> Self {
        Self {
            board,
            installation: Installation {
                plant: plant.clone(),
                press: press.clone(),
                beside: beside.clone(),
                plugins: plugins(plant, catalogue),
            },
            catalogue: catalogue.clone(),
            sequences: Mutex::default(),
            engineer: Mutex::default(),
        }
    }

    /// Opens the record with a separate reader, so that the journal never waits for a page.
    fn archive(&self) -> Result<Archive, SourceError> {
        Archive::open(&self.installation.plant.output.history).map_err(unreadable)
    }

    fn stroke(&self, run: u32) -> Result<Stroke, SourceError> {
        self.archive()?.stroke(run).map_err(|error| SourceError::NotFound(error.to_string()))
    }

    fn document(&self, run: u32) -> Result<PathBuf, SourceError> {
        let missing = || SourceError::NotFound(format!("run {run} was not measured: it has no result"));
        self.stroke(run)?.document.ok_or_else(missing)
    }

    /// Returns a stroke measured before this start, without its maps.
    pub(super) fn recorded(&self, run: u32) -> Option<MeasuredStroke> {
        let record = self.result(run).ok()?;
        let strokes = history_view::strokes_until(&self.archive().ok()?, run, &record).ok()?;
        Some(MeasuredStroke { run_id: run, record, fields: Vec::new(), strokes })
    }

    /// Returns the advice after a stroke measured before this start, if it was shown.
    pub(super) fn advised(&self, run: u32) -> Option<AdviceRecord> {
        let record = AdviceRecord::beside(&self.document(run).ok()?).ok()??;
        (record.show == Show::Screen.name()).then_some(record)
    }

    fn newest(&self, run: u32) -> Option<MeasuredStroke> {
        lock(&self.board.facts).measured().filter(|measured| measured.run_id == run).cloned()
    }

    /// Returns whether a stroke of the plate up to this one bent it at a place (u, v); false if that cannot be
    /// determined.
    pub(super) fn was_bent(&self, run: u32, place_mm: [f64; 2]) -> bool {
        let sequence = self.stroke(run).and_then(|stroke| self.sequence(stroke.plate)).ok().flatten();
        let strokes = sequence.map(|sequence| sequence.strokes).unwrap_or_default();
        let bends = strokes
            .iter()
            .filter(|stroke| stroke.run_id <= run)
            .flat_map(|stroke| stroke.bends.iter().flatten());
        bends.into_iter().any(|bend| bend.holds(place_mm))
    }

    fn evaluated(&self, plate: u32) -> Option<Sequence> {
        let curvature = pipeline::comparison(&self.catalogue, &PluginUse::by_default("curvature")).ok()?;
        let compare = |task: &Task, before: &Surface, now: &Surface| {
            let surfaces = Surfaces { now, before: Some(before), baseline: None };
            curvature.compare(task, surfaces).map_err(|error| error.to_string())
        };
        let sequence =
            Sequence::of(&self.archive().ok()?, &self.installation.plant, plate, &compare, &|_| ());
        sequence.inspect_err(|why| tracing::warn!(plate, "pages: bends are missing: {why}")).ok()
    }
}

impl Source for Site {
    fn snapshots(&self) -> watch::Receiver<Arc<Snapshot>> {
        self.board.snapshots.subscribe()
    }

    fn cycle_age(&self) -> Duration {
        // In mode `off` there is no cycle.
        if self.installation.press.mode == Mode::Off {
            Duration::ZERO
        } else {
            lock(&self.board.status).1.elapsed()
        }
    }

    fn plates(&self) -> Result<Vec<PlateRow>, SourceError> {
        let archive = self.archive()?;
        let plates = archive.plates().map_err(unreadable)?;
        let row = |record: &PlateRecord| {
            let newest = Filter { plate: Some(record.plate), newest: Some(1), ..Filter::default() };
            let last = archive.strokes(&newest).map_err(unreadable)?;
            Ok(PlateRow {
                plate: record.plate,
                name: record.part_name.clone().unwrap_or_else(|| format!("plate {}", record.plate)),
                part: record.part_id,
                first: time(record.began),
                strokes: record.strokes as usize,
                verdict: record.verdict.unwrap_or(Verdict::NotMeasured),
                sense: last.first().map_or(0, |stroke| history_view::of_stroke(stroke).sense),
            })
        };
        plates.iter().rev().take(PLATES).map(row).collect()
    }

    fn strokes(&self, plate: u32) -> Result<Vec<StrokeRow>, SourceError> {
        let filter = Filter { plate: Some(plate), ..Filter::default() };
        let strokes = self.archive()?.strokes(&filter).map_err(unreadable)?;
        if strokes.is_empty() {
            return Err(SourceError::NotFound(format!("no stroke of plate {plate} is on record")));
        }
        Ok(strokes.iter().map(row).collect())
    }

    fn sequence(&self, plate: u32) -> Result<Option<Sequence>, SourceError> {
        let n = self.strokes(plate)?.len();
        let known = lock(&self.sequences).get(&plate).filter(|(of, _)| *of == n).cloned();
        let (_, sequence) = known.unwrap_or_else(|| (n, self.evaluated(plate)));
        lock(&self.sequences).insert(plate, (n, sequence.clone()));
        Ok(sequence)
    }

    fn result(&self, run: u32) -> Result<Arc<ResultRecord>, SourceError> {
        if let Some(measured) = self.newest(run) {
            return Ok(measured.record);
        }
        let path = self.document(run)?;
        let failed = |why: String| SourceError::Unreadable(format!("{}: {why}", path.display()));
        let text = std::fs::read(&path).map_err(|e| failed(e.to_string()))?;
        serde_json::from_slice(&text).map(Arc::new).map_err(|e| failed(e.to_string()))
    }

    fn field(&self, run: u32, name: &str) -> Result<Arc<Field>, SourceError> {
        let field = self
            .newest(run)
            .and_then(|measured| measured.fields.into_iter().find(|field| field.name == name));
        field.ok_or_else(|| {
            SourceError::NotFound(format!("{name} of run {run} is on record as /files/{run}/{name}.svg only"))
        })
    }

    fn mesh(&self, run: u32) -> Result<(usize, Vec<[f32; 4]>), SourceError> {
        let surface = output_folder::surface_beside(&self.document(run)?).map_err(SourceError::Unreadable)?;
        let along = |k: usize, length: f64| length * k as f64 / (NODES - 1) as f64;
        let node = |k: usize| {
            let (u, v) = (along(k % NODES, surface.width()), along(k / NODES, surface.height()));
            let [x, y, z] = <[f64; 3]>::from(surface.face(u, v)).map(|x| x as f32);
            [x, y, z, f32::from(u8::from(surface.mask().seen(u, v)))]
        };
        Ok((NODES, (0..NODES * NODES).map(node).collect()))
    }

    fn file(&self, run: u32, name: &str) -> Result<Vec<u8>, SourceError> {
        let path = self.document(run)?.with_file_name(name);
        std::fs::read(&path).map_err(|error| SourceError::NotFound(format!("{name} of run {run}: {error}")))
    }

    fn report(&self, plate: u32) -> Result<String, SourceError> {
        plate_report::report(&self.archive()?, &self.installation.plant.name, plate)
            .map_err(|e| SourceError::NotFound(e.to_string()))
    }

    fn engineer(&self) -> Engineer {
        let mut known = lock(&self.engineer);
        if let Some((made, figures)) = &*known
            && made.elapsed() < FRESH
        {
            return figures.clone();
        }
        let figures = engineer::figures(&self.installation, &self.board, self.archive().ok().as_ref());
        *known = Some((Instant::now(), figures.clone()));
        figures
    }

    fn metrics(&self) -> String {
        self.installation.status(&self.board).prometheus(true)
    }
}

/// Returns the plugins in force, by their use.
fn plugins(plant: &PlantFile, catalogue: &Catalogue) -> Vec<PluginRow> {
    let scanner = plant.scanner.iter().map(|used| ("scanner", used));
    let comparisons = plant.comparisons.iter().map(|used| ("comparison", used));
    let row = |(role, used): (&str, &PluginUse)| {
        let library = catalogue.load(&used.plugin).ok();
        let version = library.as_ref().map_or(String::new(), |library| library.descriptor().version.clone());
        let file = library.map_or(String::new(), |library| {
            format!("{} (sha256 {})", library.path().display(), library.sha256())
        });
        PluginRow { role: role.to_owned(), name: used.plugin.clone(), version, file, state: String::new() }
    };
    scanner.chain([("flattening", &plant.flattening)]).chain(comparisons).map(row).collect()
}

fn row(stroke: &Stroke) -> StrokeRow {
    let point = history_view::of_stroke(stroke);
    let exists =
        |name: &&str| stroke.document.as_deref().is_some_and(|path| path.with_file_name(name).exists());
    StrokeRow {
        run: stroke.run_id,
        label: point.label,
        accepted: time(stroke.accepted),
        verdict: point.verdict,
        reason: stroke.reason.clone(),
        gap_mm: point.gap_mm,
        uncertainty_mm: point.uncertainty_mm,
        sense: point.sense,
        files: FILES.into_iter().filter(exists).map(str::to_owned).collect(),
    }
}

/// Formats a time as in the lists of the command line.
fn time(at: jiff::Timestamp) -> String {
    at.strftime("%F %T UTC").to_string()
}
