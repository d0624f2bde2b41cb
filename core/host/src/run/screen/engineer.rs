//! Figures of the engineer's page: registers, link, scanner, disk, plugins, alarms, files in force.

use std::path::Path;

use platen_history::{Archive, Filter};
use platen_model::{Language, Verdict};
use platen_plant::PlantFile;
use platen_plant::press::Press;
use platen_press::{ROUND_TRIP_LIMITS_MS, describe_inputs, describe_outputs};
use platen_report::history_view;
use platen_screen::{Engineer, PluginRow, RegisterRow, TimelineRow};

use super::{Board, lock};
use crate::run::status::{Beside, StatusRecord};

/// Strokes of the timeline.
const TIMELINE: u32 = 20;

/// Sources of the figures.
#[derive(Debug)]
pub(super) struct Installation {
    pub(super) plant: PlantFile,
    pub(super) press: Press,
    pub(super) beside: Beside,
    pub(super) plugins: Vec<PluginRow>,
}

impl Installation {
    /// Returns the present status record, as `platen status` prints it.
    pub(super) fn status(&self, board: &Board) -> StatusRecord {
        StatusRecord::of(&self.press, &self.plant.output.folder, &lock(&board.status).0, &self.beside, None)
    }
}

/// Collects the present figures.
pub(super) fn figures(site: &Installation, board: &Board, archive: Option<&Archive>) -> Engineer {
    Engineer {
        registers: registers(site, board),
        timeline: archive.map(timeline).unwrap_or_default(),
        plugins: plugins(site),
        alarms: alarms(board),
        figures: status(site, board),
        files: files(site),
    }
}

/// Returns the plugins with the state of their processes, in the order of the plant file.
fn plugins(site: &Installation) -> Vec<PluginRow> {
    let states = lock(&site.beside.plugins).clone();
    let state = |row: &PluginRow| {
        states
            .iter()
            .find(|state| state.kind == row.role && state.plugin == row.name)
            .map(|state| state.line())
    };
    let rows = site.plugins.iter().cloned();
    rows.map(|row| PluginRow { state: state(&row).unwrap_or_else(|| "not started".into()), ..row }).collect()
}

fn registers(site: &Installation, board: &Board) -> [Vec<RegisterRow>; 2] {
    let status = lock(&board.status).0.clone();
    let map = &site.press.map;
    let written = status.host.encode(map, 0);
    let inputs = describe_inputs(map, &status.words).into_iter().filter_map(|(input, value)| {
        let field = map.input(input)?;
        Some(row(map.read.start, field, input.to_string(), value))
    });
    let outputs = describe_outputs(map, &written).into_iter().filter_map(|(output, value)| {
        let field = map.output(output)?;
        Some(row(map.write.start, field, output.to_string(), value))
    });
    [inputs.collect(), outputs.collect()]
}

fn row(start: u16, field: &platen_plant::press::RegisterField, name: String, value: String) -> RegisterRow {
    RegisterRow { address: start + field.place.offset().unwrap_or(0), words: field.registers(), name, value }
}

fn timeline(archive: &Archive) -> Vec<TimelineRow> {
    let filter = Filter { newest: Some(TIMELINE), ..Filter::default() };
    let strokes = archive.strokes(&filter).unwrap_or_default();
    let row = |stroke: &platen_history::Stroke| {
        let since = |at: Option<jiff::Timestamp>| {
            let ms = at?.duration_since(stroke.accepted).as_secs_f64() * 1000.0;
            // The clock was set back between the two.
            (ms >= 0.0).then_some(ms)
        };
        TimelineRow {
            stroke: history_view::label(stroke),
            verdict: stroke.verdict.unwrap_or(Verdict::NotMeasured),
            steps_ms: [since(stroke.scanned), since(stroke.finished), since(stroke.acked)],
        }
    };
    strokes.iter().rev().map(row).collect()
}

fn alarms(board: &Board) -> Vec<(u16, String, u64)> {
    let facts = lock(&board.facts);
    let row = |(code, n): (&platen_model::Code, &u64)| {
        (code.number(), code.alarm().text(Language::En).to_owned(), *n)
    };
    facts.raised().iter().map(row).collect()
}

fn status(site: &Installation, board: &Board) -> Vec<(String, String)> {
    let record = site.status(board);
    let ms = |[median, most]: [Option<f64>; 2]| match (median, most) {
        (Some(median), Some(most)) => format!("median {median:.0} ms, 99 % within {most:.0} ms"),
        _ => "none yet".to_owned(),
    };
    let snapshot = board.snapshots.borrow().clone();
    let estimate = snapshot.scanner.estimate_s.map_or(String::new(), |s| format!(", a scan takes {s:.0} s"));
    let calibration = site.plant.calibration.as_ref().map_or_else(
        || "none: the range error of the data sheet counts".to_owned(),
        |wanted| wanted.file.display().to_string(),
    );
    let clock = format!(
        "{}, {}",
        jiff::Timestamp::now().strftime("%F %T UTC"),
        record.clock.map_or("synchronisation unknown".to_owned(), |clock| clock.words())
    );
    let restart = if record.restart_pending {
        "pending: the program was replaced; platen stop --when-idle"
    } else {
        "none pending"
    };
    let rows = [
        (
            "strokes",
            format!(
                "{} accepted, {} measured, {} not measured, {} missed",
                record.strokes, record.measured, record.not_measured, record.missed
            ),
        ),
        ("trigger to busy", ms(record.trigger_to_busy_ms)),
        ("stroke to result", ms(record.stroke_to_result_ms)),
        ("result to acknowledge", ms(record.result_to_ack_ms)),
        ("journal", ms(record.journal_ms)),
        (
            "link",
            format!(
                "{} requests, {} writes, {} connections, {} dropped, {} timeouts",
                record.link.requests,
                record.link.writes,
                record.link.connections,
                record.link.poisoned,
                record.link.timeouts
            ),
        ),
        ("round trips", round_trips(&record.link.round_trips)),
        ("press cycle", format!("{} ms ago", lock(&board.status).1.elapsed().as_millis())),
        ("out of step", format!("{:.1} s", record.link_down_s)),
        ("torn reads, rewrites", format!("{}, {}", record.torn_reads, record.rewrites)),
        ("scanner", format!("{:?}{estimate}", snapshot.scanner.state)),
        ("calibration", calibration),
        (
            "disk free",
            record.disk_free.map_or("unknown".to_owned(), |bytes| format!("{:.1} GB", bytes as f64 / 1e9)),
        ),
        ("records lost", record.records_lost.to_string()),
        ("clock", clock),
        ("restart", restart.to_owned()),
    ];
    let sinks = record.forward.iter().flat_map(|forward| forward.lines());
    rows.into_iter().map(|(name, value)| (name.to_owned(), value)).chain(sinks).collect()
}

/// Formats counts of round trips by their time.
fn round_trips(counts: &[u64]) -> String {
    let limits = ROUND_TRIP_LIMITS_MS.iter().map(|ms| format!("up to {ms} ms")).chain(["longer".to_owned()]);
    let parts = limits.zip(counts).filter(|(_, n)| **n > 0).map(|(limit, n)| format!("{n} {limit}"));
    parts.collect::<Vec<_>>().join(", ")
}

/// Returns plant file, calibration and plate files with their checksums.
fn files(site: &Installation) -> Vec<(String, String)> {
    let plant = &site.plant;
    let plates = platen_plant::plant::plate_files(&plant.plates).unwrap_or_default();
    let calibration = plant.calibration.iter().map(|wanted| wanted.file.clone());
    let files = std::iter::once(plant.file.clone())
        .chain(calibration)
        .chain(plates.into_iter().map(|(_, path)| path));
    files.map(|path| (path.display().to_string(), checksum(&path))).collect()
}

/// Returns the checksum of a file, or the reason why it cannot be read.
fn checksum(path: &Path) -> String {
    match std::fs::read(path) {
        Ok(bytes) => format!("crc32c {:08x}", crc32c::crc32c(&bytes)),
        Err(error) => error.to_string(),
    }
}
