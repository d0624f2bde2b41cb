//! Tests of the watched folder, one for each way in which network shares and exporters can mislead.

use std::io;
use std::path::Path;
use std::time::{Duration, SystemTime};

use platen_formats::orient::Expected;
use platen_formats::{ScanFile, ScanReader};
use platen_scan::{Column, ScanEnd, ScanHeader, State};

use crate::device::{Folder, Reading};
use crate::error::Error;
use crate::watch::{Entry, Listing, Watch, list};

const ROWS: u32 = 24;
const COLUMNS: u32 = 32;
const STEP: f64 = 0.012;

/// Returns a small lattice with gaps and ranges multiplied by `scale`, as a file of the format with this extension.
fn file(extension: &str, scale: f64) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(format!("scan.{extension}"));
    let header = ScanHeader {
        n_rows: ROWS,
        n_columns: COLUMNS,
        azimuth_start: 3.0,
        azimuth_step: STEP,
        elevation_start: 0.1,
        elevation_step: STEP,
        intensity_range: (0, 2047),
        ..ScanHeader::default()
    };
    let mut file = ScanFile::create(&path).unwrap();
    let mut writer = file.writer(&header).unwrap();
    for index in 0..COLUMNS {
        let rows = || (0..ROWS).map(f64::from);
        let state = |row: u32| match (3 * row + index).is_multiple_of(11) {
            true => State::NoReturn,
            false => State::Valid,
        };
        let column = Column {
            index,
            range_m: rows().map(|row| scale * (5.0 + 0.03 * row + 0.02 * f64::from(index))).collect(),
            azimuth: vec![3.0 + STEP * f64::from(index); ROWS as usize],
            elevation: rows().map(|row| 0.1 - STEP * row).collect(),
            intensity: (0..ROWS as u16).collect(),
            state: (0..ROWS).map(state).collect(),
            ..Column::default()
        };
        writer.push(&column).unwrap();
    }
    let written = writer.finish(&ScanEnd::default()).unwrap();
    file.persist(written).unwrap();
    std::fs::read(&path).unwrap()
}

const STABLE: u32 = 3;

fn watch(pattern: &str, before: Listing) -> Watch {
    Watch::new(glob::Pattern::new(pattern).unwrap(), STABLE, Some(before))
}

fn entry(size: u64) -> Entry {
    Entry { size, modified: Some(SystemTime::UNIX_EPOCH), folder: false }
}

fn listing(entries: &[(&str, u64)]) -> Listing {
    entries.iter().map(|(name, size)| ((*name).to_owned(), entry(*size))).collect()
}

/// Polls a listing until something is due; panics after a hundred polls.
#[track_caller]
fn until_due(watch: &mut Watch, entries: &[(&str, u64)]) -> (u32, Vec<String>) {
    for polls in 1..=100 {
        let due = watch.poll(Ok(listing(entries)));
        if !due.is_empty() {
            return (polls, due);
        }
    }
    panic!("nothing was due: {}", watch.why());
}

#[track_caller]
fn never_due(watch: &mut Watch, entries: &[(&str, u64)]) {
    for _ in 0..100 {
        assert_eq!(watch.poll(Ok(listing(entries))), Vec::<String>::new());
    }
}

#[test]
fn partial_file_waits_until_it_stays_the_same() {
    let mut watch = watch("*.e57", Listing::new());
    for size in 1..50 {
        assert!(watch.poll(Ok(listing(&[("a.e57", size)]))).is_empty(), "at {size}");
        assert_eq!(watch.why(), "a.e57 is still changing");
    }
    assert_eq!(until_due(&mut watch, &[("a.e57", 50)]), (STABLE, vec!["a.e57".to_owned()]));
}

#[test]
fn a_changed_time_is_a_change_though_the_size_stays() {
    let mut watch = watch("*", Listing::new());
    for second in 0..20 {
        let modified = Some(SystemTime::UNIX_EPOCH + Duration::from_secs(second));
        let listing = [("a.e57".to_owned(), Entry { modified, ..entry(9) })].into();
        assert!(watch.poll(Ok(listing)).is_empty());
    }
}

#[test]
fn zero_byte_first_is_reported_and_content_later_is_taken() {
    let mut watch = watch("*", Listing::new());
    watch.poll(Ok(listing(&[("a.e57", 0)])));
    assert_eq!(watch.why(), "a.e57 is empty so far");
    until_due(&mut watch, &[("a.e57", 0)]);
    watch.refuse("a.e57", "0 bytes".to_owned());
    assert_eq!(until_due(&mut watch, &[("a.e57", 900)]).0, STABLE);
}

#[test]
fn missed_second_chance_comes_again_without_any_change() {
    let mut watch = watch("*", Listing::new());
    let mut waits = Vec::new();
    for _ in 0..8 {
        waits.push(until_due(&mut watch, &[("a.e57", 900)]).0);
        watch.refuse("a.e57", "checksum of page 3".to_owned());
        assert_eq!(watch.why(), "a.e57: checksum of page 3");
    }
    assert_eq!(waits, [3, 3, 6, 12, 24, 48, 48, 48]);
}

#[test]
fn stale_file_of_yesterday_is_no_candidate_until_it_changes() {
    let mut watch = watch("*", listing(&[("old.e57", 900)]));
    never_due(&mut watch, &[("old.e57", 900)]);
    assert_eq!(watch.why(), "no new file matches *");
    // Written again under the same name, the file is a new scan.
    assert_eq!(until_due(&mut watch, &[("old.e57", 901)]).0, STABLE);
}

#[test]
fn wrong_job_does_not_match() {
    let mut watch = watch("plate-17-*.e57", Listing::new());
    never_due(&mut watch, &[("plate-16-a.e57", 5), ("notes.txt", 5)]);
    assert_eq!(until_due(&mut watch, &[("plate-16-a.e57", 5), ("Plate-17-B.E57", 5)]).1, ["Plate-17-B.E57"]);
}

#[test]
fn unfinished_names_wait_for_their_rename() {
    let mut watch = watch("*", Listing::new());
    never_due(&mut watch, &[("a.e57.part", 5), (".a.e57.swp", 5), ("~a.e57", 5), ("a.TMP", 5)]);
    assert_eq!(until_due(&mut watch, &[("a.e57", 5)]).1, ["a.e57"]);
}

#[test]
fn watch_lost_share_vanishes_and_comes_back() {
    let mut watch = watch("*", listing(&[("old.e57", 1)]));
    for _ in 0..10 {
        assert!(watch.poll(Err(io::Error::from(io::ErrorKind::NotFound))).is_empty());
    }
    assert!(watch.why().starts_with("the folder cannot be read: "), "{}", watch.why());
    // A file that was old before the share vanished is still old.
    assert_eq!(until_due(&mut watch, &[("old.e57", 1), ("new.e57", 7)]).1, ["new.e57"]);
}

#[test]
fn a_share_that_was_away_at_the_trigger_shows_what_is_old_when_it_comes_back() {
    let mut watch = Watch::new(glob::Pattern::new("*").unwrap(), STABLE, None);
    watch.poll(Err(io::Error::from(io::ErrorKind::NotConnected)));
    never_due(&mut watch, &[("unknown.e57", 5)]);
    assert_eq!(until_due(&mut watch, &[("unknown.e57", 5), ("new.e57", 5)]).1, ["new.e57"]);
}

#[test]
fn a_scan_that_comes_too_late_is_not_the_next_one() {
    let temporary = tempfile::tempdir().unwrap();
    let mut watched = folder(temporary.path());
    let late = &mut |pause: u32, folder: &Path| {
        if pause == 199 {
            std::fs::write(folder.join("late.e57"), file("e57", 1.0)).unwrap();
        }
    };
    let missed = follow(&mut watched, "*", late).unwrap_err().to_string();
    assert!(missed.contains("no scan in time: no new file matches *"), "{missed}");
    follow(&mut watched, "*", &mut |_, _| {}).unwrap_err();
}

#[test]
fn a_file_that_is_taken_away_is_forgotten() {
    let mut watch = watch("*", Listing::new());
    watch.poll(Ok(listing(&[("a.e57", 5)])));
    watch.poll(Ok(listing(&[("a.e57", 5)])));
    never_due(&mut watch, &[]);
    assert_eq!(until_due(&mut watch, &[("a.e57", 5)]).0, STABLE);
}

/// Examines every file that is due in a real folder: returns the names that open, and the reason for the rest.
fn look(watch: &mut Watch, folder: &Path) -> Vec<String> {
    let due = watch.poll(list(folder));
    let (mut sound, mut refused) = (Vec::new(), Vec::new());
    for name in due {
        match ScanReader::open(&folder.join(&name), None, &|| true) {
            Ok(_) => sound.push(name),
            Err(error) => refused.push((name, error.to_string())),
        }
    }
    refused.into_iter().for_each(|(name, why)| watch.refuse(&name, why));
    sound
}

#[test]
fn preallocated_full_size_is_refused_until_the_bytes_are_there() {
    let folder = tempfile::tempdir().unwrap();
    let whole = file("e57", 1.0);
    let mut watch = watch("*.e57", list(folder.path()).unwrap());
    let path = folder.path().join("scan.e57");
    for arrived in [48, 3000, whole.len() - 1] {
        let mut file = whole.clone();
        file[arrived..].fill(0);
        std::fs::write(&path, file).unwrap();
        for _ in 0..20 {
            assert!(look(&mut watch, folder.path()).is_empty(), "taken with {arrived} bytes");
        }
        assert!(watch.why().contains("scan.e57: E57 file is"), "{}", watch.why());
    }
    std::fs::write(&path, &whole).unwrap();
    let taken = (0..STABLE * 40).find_map(|_| look(&mut watch, folder.path()).pop());
    assert_eq!(taken.as_deref(), Some("scan.e57"));
}

#[test]
fn fls_is_folder_gets_its_sentence_while_the_export_is_awaited() {
    let folder = tempfile::tempdir().unwrap();
    let mut watch = watch("*", list(folder.path()).unwrap());
    std::fs::create_dir(folder.path().join("Scan_001.fls")).unwrap();
    for _ in 0..10 {
        assert!(look(&mut watch, folder.path()).is_empty());
    }
    assert!(watch.why().contains("FARO scan as a folder"), "{}", watch.why());
    std::fs::write(folder.path().join("Scan_001.e57"), file("e57", 1.0)).unwrap();
    let taken = (0..10).find_map(|_| look(&mut watch, folder.path()).pop());
    assert_eq!(taken.as_deref(), Some("Scan_001.e57"));
}

/// Follows a folder in which `act` makes a change at every pause; returns the points of the scan after at most 200
/// pauses.
fn follow(
    folder: &mut Folder,
    pattern: &str,
    act: &mut dyn FnMut(u32, &Path),
) -> Result<u64, platen_sdk::Error> {
    let reading = Reading { cloud: None, known: Expected::default() };
    let (path, pattern, mut pauses) = (folder.path.clone(), glob::Pattern::new(pattern).unwrap(), 0);
    let mut pause = |why| {
        act(pauses, &path);
        pauses += 1;
        if pauses == 200 { Err(Error::TooLate(why)) } else { Ok(()) }
    };
    let found = folder.wait(&reading, pattern, &mut |_| Ok(()), &mut pause, &|| true);
    let checksum = found.as_ref().ok().map(|(_, _, oriented)| oriented.checksum());
    folder.close(checksum);
    found.map(|(_, mut reader, oriented)| reader.columns(&oriented).unwrap().finish().unwrap().points)
}

fn folder(path: &Path) -> Folder {
    let mut folder = Folder {
        path: path.to_owned(),
        pattern: "*".to_owned(),
        stable_polls: STABLE,
        before: None,
        measured: None,
    };
    folder.look().unwrap();
    folder
}

#[test]
fn a_scan_that_grows_in_the_folder_is_measured_once_whole() {
    let temporary = tempfile::tempdir().unwrap();
    for (name, file) in [
        ("a.e57", file("e57", 1.0)),
        ("a.ptx", file("ptx", 1.0)),
        ("a.xyz", [b"698\n".to_vec(), file("xyz", 1.0)].concat()),
    ] {
        let path = temporary.path().join(name);
        let mut watched = folder(temporary.path());
        let mut write = |pause: u32, _: &Path| {
            // Ten pieces, with a pause between them that is longer than the polls for stability.
            if pause.is_multiple_of(8) && pause <= 80 {
                std::fs::write(&path, &file[..file.len() * pause as usize / 80]).unwrap();
            }
        };
        let points = follow(&mut watched, "*", &mut write).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(points, 698, "{name}");
        std::fs::remove_file(&path).unwrap();
    }
}

#[test]
fn repeated_scan_under_a_new_name_is_no_new_scan() {
    let temporary = tempfile::tempdir().unwrap();
    let mut watched = folder(temporary.path());
    let write = |name: &'static str, file: Vec<u8>| {
        move |pause: u32, folder: &Path| {
            if pause == 0 {
                std::fs::write(folder.join(name), &file).unwrap();
            }
        }
    };
    follow(&mut watched, "*", &mut write("first.e57", file("e57", 1.0))).unwrap();
    let copied = follow(&mut watched, "*", &mut write("copy.e57", file("e57", 1.0))).unwrap_err().to_string();
    assert!(
        copied.contains("no scan in time: copy.e57: the same points as the scan measured before"),
        "{copied}"
    );
    let other = file("e57", 1.001);
    follow(&mut watched, "*", &mut write("second.e57", other)).unwrap();
}

#[test]
fn two_scans_at_once_are_not_chosen_between() {
    let temporary = tempfile::tempdir().unwrap();
    let mut watched = folder(temporary.path());
    let both = &mut |pause: u32, folder: &Path| {
        if pause == 0 {
            std::fs::write(folder.join("a.e57"), file("e57", 1.0)).unwrap();
            std::fs::write(folder.join("b.ptx"), file("ptx", 1.0)).unwrap();
        }
    };
    let refused = follow(&mut watched, "*", both).unwrap_err().to_string();
    assert!(refused.contains("2 new scans at once (a.e57, b.ptx)"), "{refused}");
}

#[test]
fn appended_scan_in_an_old_file_is_not_taken_for_one() {
    let temporary = tempfile::tempdir().unwrap();
    let path = temporary.path().join("a.ptx");
    std::fs::write(&path, file("ptx", 1.0)).unwrap();
    let mut watched = folder(temporary.path());
    let append = &mut |pause: u32, _: &Path| {
        if pause == 0 {
            std::fs::write(&path, [file("ptx", 1.0), file("ptx", 1.0)].concat()).unwrap();
        }
    };
    let refused = follow(&mut watched, "*", append).unwrap_err().to_string();
    assert!(refused.contains("a.ptx: PTX file holds 2 scans"), "{refused}");
}

#[test]
fn nothing_in_the_folder_is_written_or_removed() {
    let temporary = tempfile::tempdir().unwrap();
    let mut watched = folder(temporary.path());
    let scan = file("e57", 1.0);
    let mut write = |pause: u32, folder: &Path| {
        if pause == 0 {
            let path = folder.join("a.e57");
            std::fs::write(&path, &scan).unwrap();
            let mut read_only = std::fs::metadata(&path).unwrap().permissions();
            read_only.set_readonly(true);
            std::fs::set_permissions(&path, read_only).unwrap();
        }
    };
    follow(&mut watched, "*", &mut write).unwrap();
    assert_eq!(std::fs::read(temporary.path().join("a.e57")).unwrap(), scan);
    assert_eq!(list(temporary.path()).unwrap().len(), 1);
}

#[test]
fn the_pattern_names_the_stroke() {
    let temporary = tempfile::tempdir().unwrap();
    let named = Folder { pattern: "press3-{stroke}-{job}*.e57".to_owned(), ..folder(temporary.path()) };
    assert_eq!(named.pattern(17, 4).unwrap().as_str(), "press3-17-4*.e57");
    let broken = Folder { pattern: "[".to_owned(), ..folder(temporary.path()) };
    assert!(broken.pattern(0, 0).is_err());
}
