//! Tests of sections 4 to 7 of the protocol: scans, their columns, Resume, Abort.

use std::collections::BTreeMap;
use std::time::Duration;

use serde_json::{Value as Json, json};

use super::client::{
    ABORT, ANSWER, COLUMN, Client, ERROR, Frame, RESUME, SCAN_BEGIN, SCAN_END, START, fault, name,
};
use super::{BridgeSubject, Test};
use crate::Verdict;

pub(super) const TESTS: &[Test] = &[
    Test::new(
        "scan.complete",
        "Start is answered with ScanBegin, every column and ScanEnd `complete`",
        complete,
    ),
    Test::new("scan.lattice", "the lattice is one: members, signs, limits", lattice),
    Test::new("scan.columns", "columns by the document: bitmaps, records, ranges", columns),
    Test::new("scan.digest", "columns, points and digest of ScanEnd are those of the scan", digest),
    Test::new("scan.status", "Status at least once a second during it", status),
    Test::new("scan.again", "Start of the same job sends the same scan, without another", again),
    Test::new("resume.some", "Resume sends the columns that are missing, as they were", resume_some),
    Test::new("resume.none", "Resume of no column: ScanBegin and ScanEnd", resume_none),
    Test::new("resume.gone", "Resume of a number that is not the job's: Error `gone`", resume_gone),
    Test::new("resume.broken", "a connection that broke in the middle is taken up", resume_broken),
    Test::new("scan.other", "another job has another number, and is refused as `busy` meanwhile", other),
    Test::new("abort.running", "Abort ends a scan as `aborted`, or with Error `scanner`", abort),
    Test::new("abort.unknown", "Abort of a job that is not running is ignored", abort_unknown),
];

/// Scan as received.
#[derive(Debug, Clone)]
pub(super) struct Recorded {
    job: String,
    number: u32,
    begin: Json,
    columns: BTreeMap<u32, Column>,
    end: Json,
    longest_silence: Duration,
}

#[derive(Debug, Clone, PartialEq)]
struct Column {
    payload: Vec<u8>,
    crc: u32,
}

fn start(subject: &BridgeSubject, job: &str) -> Json {
    let mut start = subject.settings.clone();
    start["job"] = json!(job);
    start
}

/// Receives a scan from its ScanBegin to its ScanEnd; `until` ends it earlier, depending on the number of received
/// columns.
fn receive(
    client: &mut Client,
    subject: &BridgeSubject,
    job: &str,
    until: Option<usize>,
) -> Result<Recorded, Verdict> {
    let first = client.expect(SCAN_BEGIN, subject.limit)?;
    let begin = first.json()?;
    if begin["job"] != job || first.scan == 0 {
        return fault(format!("ScanBegin names job {} and scan number {}", begin["job"], first.scan));
    }
    let mut scan = Recorded {
        job: job.to_owned(),
        number: first.scan,
        begin,
        columns: BTreeMap::new(),
        end: Json::Null,
        longest_silence: Duration::ZERO,
    };
    while until.is_none_or(|columns| scan.columns.len() < columns) {
        let Some(frame) = client.next(subject.limit)? else {
            return fault(format!("nothing more within {} s of ScanBegin", subject.limit.as_secs()));
        };
        if frame.scan != scan.number && frame.kind != ERROR {
            return fault(format!(
                "{} has number {}, the scan {}",
                name(frame.kind),
                frame.scan,
                scan.number
            ));
        }
        match frame.kind {
            COLUMN => scan.keep(&frame)?,
            SCAN_END => {
                scan.end = frame.json()?;
                break;
            }
            _ => return fault(format!("{} came in the middle of a scan", name(frame.kind))),
        }
    }
    scan.longest_silence = client.longest_silence;
    Ok(scan)
}

impl Recorded {
    fn keep(&mut self, frame: &Frame) -> Result<(), Verdict> {
        let Some(number) = frame.payload.first_chunk::<4>().map(|bytes| u32::from_le_bytes(*bytes)) else {
            return fault("a Column without its number");
        };
        let column = Column { payload: frame.payload.clone(), crc: frame.crc };
        match self.columns.insert(number, column.clone()) {
            Some(earlier) if earlier != column => fault(format!("column {number} came twice, and differs")),
            _ => Ok(()),
        }
    }
}

/// Returns the scan that several tests use; they are left out without it.
fn recorded(subject: &BridgeSubject) -> Result<&Recorded, Verdict> {
    made(subject).map_err(|why| Verdict::LeftOut(format!("there is no scan: {why}")))
}

/// Makes the scan at the first call.
fn made(subject: &BridgeSubject) -> Result<&Recorded, &String> {
    let made = || -> Result<Recorded, Verdict> {
        let mut client = Client::controller(subject)?;
        let job = format!("{}-a", subject.run);
        client.send(START, 0, &start(subject, &job))?;
        receive(&mut client, subject, &job, None)
    };
    let scan = subject.scan.get_or_init(|| {
        made().map_err(|verdict| match verdict {
            Verdict::Failed(why) => why,
            other => format!("{other:?}"),
        })
    });
    scan.as_ref()
}

fn complete(subject: &BridgeSubject) -> Result<(), Verdict> {
    let scan = made(subject).or_else(fault)?;
    let due = scan.begin["columns"].as_u64().unwrap_or_default();
    if scan.end["outcome"] != "complete" {
        fault(format!("ScanEnd is {}", scan.end))
    } else if scan.columns.len() as u64 != due {
        fault(format!("{} columns came of {due}, and ScanEnd says complete", scan.columns.len()))
    } else {
        Ok(())
    }
}

fn lattice(subject: &BridgeSubject) -> Result<(), Verdict> {
    let begin = &recorded(subject)?.begin;
    let size = |member: &str| begin[member].as_u64().is_some_and(|n| (1..=1 << 17).contains(&n));
    let angle = |member: &str| begin[member].as_f64().is_some_and(|a| a.abs() <= 7.0);
    let step = |member: &str| angle(member) && begin[member] != 0.0;
    let intensity = begin["intensity"].as_array().is_some_and(|range| {
        range.len() == 2 && range[0].as_u64().zip(range[1].as_u64()).is_some_and(|(a, b)| a <= b)
    });
    let seam = begin["seam_column"].is_null() || begin["seam_column"].as_u64() < begin["columns"].as_u64();
    let checks = [
        ("rows", size("rows")),
        ("columns", size("columns")),
        ("azimuth_start", angle("azimuth_start")),
        ("azimuth_step", step("azimuth_step")),
        ("elevation_start", angle("elevation_start")),
        ("elevation_step", step("elevation_step")),
        ("values", begin["values"] == "range" || begin["values"] == "polar"),
        ("range_unit_m", begin["range_unit_m"].as_f64().is_some_and(|unit| unit > 0.0 && unit <= 1.0)),
        ("intensity", intensity),
        ("seam_column", seam),
    ];
    match checks.into_iter().find(|(_, sound)| !sound) {
        Some((member, _)) => fault(format!("{member} of ScanBegin is {}", begin[member])),
        None => Ok(()),
    }
}

/// Returns the number of records of a column, checked.
fn points(begin: &Json, number: u32, payload: &[u8]) -> Result<u64, String> {
    let head = payload.first_chunk::<24>().ok_or("it is shorter than its head")?;
    let word = |at: usize| u32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]);
    let (first, rows, face) = (word(4), word(8) as usize, word(12));
    let all = begin["rows"].as_u64().unwrap_or_default();
    let count = begin["columns"].as_u64().unwrap_or_default();
    if u64::from(number) >= count || u64::from(first) + rows as u64 > all || face > 1 {
        return Err(format!("rows {first} to {} of {all}, face {face}", first as usize + rows));
    }
    let bitmap = payload.get(24..24 + rows.div_ceil(8)).ok_or("its bitmap is cut off")?;
    let valid = |row: usize| bitmap[row / 8] >> (7 - row % 8) & 1 == 1;
    if (rows..8 * bitmap.len()).any(valid) {
        return Err("unused bits of its bitmap are set".to_owned());
    }
    let width = if begin["values"] == "polar" { 14 } else { 6 };
    let records = &payload[24 + bitmap.len()..];
    let n = (0..rows).filter(|row| valid(*row)).count();
    if records.len() != n * width {
        return Err(format!("{} bytes of records, {n} valid cells of {width} bytes each", records.len()));
    }
    if records.chunks_exact(width).any(|record| record[..4] == [0; 4]) {
        return Err("a range is 0".to_owned());
    }
    Ok(n as u64)
}

fn columns(subject: &BridgeSubject) -> Result<(), Verdict> {
    let scan = recorded(subject)?;
    for (number, column) in &scan.columns {
        if let Err(why) = points(&scan.begin, *number, &column.payload) {
            return fault(format!("column {number}: {why}"));
        }
    }
    Ok(())
}

fn digest(subject: &BridgeSubject) -> Result<(), Verdict> {
    let scan = recorded(subject)?;
    let counted = scan.columns.iter().filter_map(|(n, column)| points(&scan.begin, *n, &column.payload).ok());
    let counted: u64 = counted.sum();
    let crcs: Vec<u8> = scan.columns.values().flat_map(|column| column.crc.to_le_bytes()).collect();
    let found = [
        ("columns", scan.columns.len() as u64),
        ("points", counted),
        ("digest", u64::from(crc32c::crc32c(&crcs))),
    ];
    match found.into_iter().find(|(member, value)| scan.end[member].as_u64() != Some(*value)) {
        Some((member, value)) => {
            fault(format!("{member} of ScanEnd is {}, of the columns {value}", scan.end[member]))
        }
        None => Ok(()),
    }
}

fn status(subject: &BridgeSubject) -> Result<(), Verdict> {
    match recorded(subject)?.longest_silence {
        longest if longest > Duration::from_millis(1500) => {
            fault(format!("{} ms without a Status", longest.as_millis()))
        }
        _ => Ok(()),
    }
}

/// Checks that a repeated scan equals the first.
fn same(first: &Recorded, second: &Recorded) -> Result<(), Verdict> {
    if second.number != first.number {
        return fault(format!("scan {} came for scan {}", second.number, first.number));
    }
    if second.begin != first.begin {
        return fault(format!("another ScanBegin: {} for {}", second.begin, first.begin));
    }
    match second.columns.iter().find(|(number, column)| first.columns.get(number) != Some(column)) {
        Some((number, _)) => fault(format!("column {number} is not what it was")),
        None if second.end != first.end => {
            fault(format!("another ScanEnd: {} for {}", second.end, first.end))
        }
        None => Ok(()),
    }
}

fn again(subject: &BridgeSubject) -> Result<(), Verdict> {
    let first = recorded(subject)?;
    let mut client = Client::controller(subject)?;
    client.send(START, 0, &start(subject, &first.job))?;
    let second = receive(&mut client, subject, &first.job, None)?;
    if second.columns.len() != first.columns.len() {
        return fault(format!("{} columns, {} the first time", second.columns.len(), first.columns.len()));
    }
    same(first, &second)
}

/// Requests runs of columns of the recorded scan on a new connection.
fn resumed(subject: &BridgeSubject, first: &Recorded, missing: &Json) -> Result<Recorded, Verdict> {
    let mut client = Client::controller(subject)?;
    client.send(RESUME, first.number, &json!({"job": first.job, "missing": missing}))?;
    receive(&mut client, subject, &first.job, None)
}

fn resume_some(subject: &BridgeSubject) -> Result<(), Verdict> {
    let first = recorded(subject)?;
    let last = first.columns.keys().copied().max().unwrap_or_default();
    let second = resumed(subject, first, &json!([[0, 1.min(last)], [last, last]]))?;
    let wanted: Vec<u32> = if last > 1 { vec![0, 1, last] } else { (0..=last).collect() };
    if !second.columns.keys().eq(wanted.iter()) {
        let came: Vec<&u32> = second.columns.keys().take(20).collect();
        return fault(format!("columns {came:?} came for {wanted:?}"));
    }
    same(first, &second)
}

fn resume_none(subject: &BridgeSubject) -> Result<(), Verdict> {
    let first = recorded(subject)?;
    let second = resumed(subject, first, &json!([]))?;
    if !second.columns.is_empty() {
        return fault(format!("{} columns came for none", second.columns.len()));
    }
    same(first, &second)
}

fn resume_gone(subject: &BridgeSubject) -> Result<(), Verdict> {
    let first = recorded(subject)?;
    let mut client = Client::controller(subject)?;
    let job = format!("{}-never", subject.run);
    client.send(RESUME, first.number, &json!({"job": job, "missing": [[0, 0]]}))?;
    client.expect_error("gone").map(drop)
}

fn resume_broken(subject: &BridgeSubject) -> Result<(), Verdict> {
    let first = recorded(subject)?;
    let half = first.columns.len() / 2;
    let job = format!("{}-b", subject.run);
    let mut client = Client::controller(subject)?;
    client.send(START, 0, &start(subject, &job))?;
    let begun = receive(&mut client, subject, &job, Some(half))?;
    drop(client);
    let count = begun.begin["columns"].as_u64().unwrap_or_default() as u32;
    let missing: Vec<[u32; 2]> =
        (0..count).filter(|n| !begun.columns.contains_key(n)).map(|n| [n, n]).collect();
    let rest = resumed(subject, &begun, &json!(missing))?;
    let crcs: BTreeMap<u32, u32> =
        begun.columns.iter().chain(&rest.columns).map(|(n, column)| (*n, column.crc)).collect();
    let crcs: Vec<u8> = crcs.values().flat_map(|crc| crc.to_le_bytes()).collect();
    if rest.end["outcome"] != "complete" || rest.end["digest"].as_u64() != Some(crc32c::crc32c(&crcs).into())
    {
        return fault(format!("ScanEnd is {}, the digest of both parts {}", rest.end, crc32c::crc32c(&crcs)));
    }
    Ok(())
}

fn other(subject: &BridgeSubject) -> Result<(), Verdict> {
    let first = recorded(subject)?;
    let mut client = Client::controller(subject)?;
    let [job, meanwhile] = ["c", "d"].map(|it| format!("{}-{it}", subject.run));
    client.send(START, 0, &start(subject, &job))?;
    client.send(START, 0, &start(subject, &meanwhile))?;
    let (mut number, mut refused) = (None, false);
    while let Some(frame) = client.next(subject.limit)? {
        match frame.kind {
            SCAN_BEGIN if frame.json()?["job"] == *job => number = Some(frame.scan),
            // The first had ended before the second was read.
            SCAN_BEGIN => {
                return Err(Verdict::LeftOut(
                    "a scan is over too soon here to be under way at another Start".into(),
                ));
            }
            ERROR => {
                let error = frame.json()?;
                if error["code"] != "busy" {
                    return fault(format!("Error `busy` expected, {error} came"));
                }
                refused = true;
                client.send(ABORT, 0, &json!({"job": job}))?;
            }
            COLUMN => {}
            _ => break,
        }
    }
    match number {
        Some(number) if number == first.number => fault(format!("both jobs have number {number}")),
        _ if refused => Ok(()),
        _ => fault("a second job during a scan was not refused"),
    }
}

fn abort(subject: &BridgeSubject) -> Result<(), Verdict> {
    let mut client = Client::controller(subject)?;
    let job = format!("{}-e", subject.run);
    client.send(START, 0, &start(subject, &job))?;
    client.send(ABORT, 0, &json!({"job": job}))?;
    while let Some(frame) = client.next(subject.limit)? {
        match frame.kind {
            SCAN_END => {
                let end = frame.json()?;
                return match end["outcome"].as_str() {
                    Some("aborted") => Ok(()),
                    Some("complete") => Err(Verdict::LeftOut("the scan was over before the Abort".into())),
                    _ => fault(format!("ScanEnd is {end}")),
                };
            }
            ERROR => {
                let error = frame.json()?;
                return match error["code"].as_str() {
                    Some("scanner") => Ok(()),
                    Some("busy") => {
                        Err(Verdict::LeftOut("the scanner is still busy with an earlier scan".into()))
                    }
                    _ => fault(format!("Error `scanner` expected, {error} came")),
                };
            }
            _ => {}
        }
    }
    fault(format!("no end within {} s of Abort", subject.limit.as_secs()))
}

fn abort_unknown(subject: &BridgeSubject) -> Result<(), Verdict> {
    let mut client = Client::controller(subject)?;
    client.send(ABORT, 0, &json!({"job": format!("{}-never", subject.run)}))?;
    match client.next(ANSWER / 2)? {
        None => Ok(()),
        Some(frame) => fault(format!("{} came for it", name(frame.kind))),
    }
}
