//! Writing of scan files: a file appears complete under its name, or not at all.

use std::os::unix::fs::PermissionsExt as _;

use platen_scan::{Column, ScanEnd, ScanHeader, State};

use crate::{ScanFile, WriteError};

fn header() -> ScanHeader {
    ScanHeader { n_rows: 2, n_columns: 2, intensity_range: (0, 9), ..ScanHeader::default() }
}

fn column(range_m: f64) -> Column {
    Column {
        range_m: vec![range_m; 2],
        azimuth: vec![0.1; 2],
        elevation: vec![0.2, 0.1],
        intensity: vec![9; 2],
        state: vec![State::Valid; 2],
        ..Column::default()
    }
}

#[test]
fn a_file_is_whole_or_not_there_and_replaces_none() {
    for name in ["a.e57", "a.ptx", "a.xyz", "a.xyb"] {
        let folder = tempfile::tempdir().unwrap();
        let (path, files) = (folder.path().join(name), || std::fs::read_dir(folder.path()).unwrap().count());
        let mut given_up = ScanFile::create(&path).unwrap();
        given_up.writer(&header()).unwrap().push(&column(1.0)).unwrap();
        assert!(!path.exists() && files() == 1);
        drop(given_up);
        assert_eq!(files(), 0, "{name}");

        let [mut first, mut second] = [(); 2].map(|()| ScanFile::create(&path).unwrap());
        let written = [&mut first, &mut second].map(|file| {
            let mut writer = file.writer(&header()).unwrap();
            [1.0, 2.0].iter().for_each(|range| writer.push(&column(*range)).unwrap());
            writer.finish(&ScanEnd::default()).unwrap()
        });
        assert_eq!((written[0].columns, written[0].points), (1, 2), "a column that comes again is ignored");
        let bytes = first.persist(written[0]).unwrap().bytes;
        assert!(matches!(second.persist(written[1]), Err(WriteError::Exists(_))));
        assert!(matches!(ScanFile::create(&path), Err(WriteError::Exists(_))));
        let data = std::fs::metadata(&path).unwrap();
        std::fs::write(folder.path().join("plain"), "").unwrap();
        let plain = std::fs::metadata(folder.path().join("plain")).unwrap();
        assert_eq!((data.len(), files()), (bytes, 2), "{name}");
        assert_eq!(data.permissions().mode(), plain.permissions().mode(), "{name}");
    }
}

#[test]
fn a_coordinate_beyond_a_text_format_is_refused_with_its_place() {
    let folder = tempfile::tempdir().unwrap();
    let mut file = ScanFile::create(&folder.path().join("far.ptx")).unwrap();
    let refused = file.writer(&header()).unwrap().push(&column(1e6)).unwrap_err().to_string();
    assert!(
        refused.ends_with("far.ptx: column 0 row 0 is 1000000 m away, beyond the format; write an E57"),
        "{refused}"
    );
}
