//! Tests of the driver without a host: sources of plates, windows, columns.

use crate::capture::PreparedScan;
use crate::{Options, capture, plate};
use platen_scan::{Column, Direction, Lattice, ScanEnd, ScanHeader, Window};
use platen_sdk::{ErrorKind, Result, ScanReceiver};
use platen_sim_plate::{Plate, PlateState, Reply, Shape, Vec3};
use std::io::{BufRead, BufReader, Write};
use std::net::TcpListener;
use std::time::Duration;

fn options() -> Options {
    Options {
        cell: None,
        plate_file: None,
        shape: "cylinder".into(),
        radius_mm: 8000.0,
        axis_deg: 90.0,
        width_mm: 3000.0,
        height_mm: 2500.0,
        thickness_mm: 36.0,
        scanner_m: None,
        scanner_yaw_deg: 0.0,
        step_deg: 0.25,
        margin_deg: 4.0,
        noise_mm: 0.5,
        tail_dof: None,
        wide_share: 0.0,
        wide_factor: 4.0,
        footprint_mrad: 0.3,
        beam: "truncated".into(),
        dropout: 0.006,
        cyclic_mm: 0.0,
        angular_noise_urad: 0.0,
        plate_reflectivity: 0.35,
        back_face_from_deg: None,
        collimation_urad: 0.0,
        warm_up_columns: 0,
        hidden_by: "nothing".into(),
        strip_deg: 0.0,
        seed: 1,
        time_scale: 0.0,
        rate_kpts: "122".into(),
        threads: 2,
        truth_file: None,
    }
}

/// Receiver that stores the scan and may stop it.
#[derive(Default)]
struct Keep {
    lattice: Option<Lattice>,
    end: Option<ScanEnd>,
    columns: usize,
    stop_after: Option<usize>,
}

impl ScanReceiver for Keep {
    fn check(&self) -> Result<()> {
        match self.stop_after {
            Some(n) if self.columns >= n => Err(platen_sdk::Error::new(ErrorKind::Cancelled, "enough")),
            _ => Ok(()),
        }
    }

    fn remaining(&self) -> Duration {
        Duration::MAX
    }

    fn progress(&self, _: f64, _: &str) {}

    fn begin(&mut self, header: &ScanHeader) -> Result<()> {
        self.lattice = Some(Lattice::new(header.clone()));
        Ok(())
    }

    fn column(&mut self, column: &Column) -> Result<()> {
        self.columns += 1;
        self.lattice.as_mut().unwrap().push(column).unwrap();
        Ok(())
    }

    fn end(&mut self, end: &ScanEnd) -> Result<()> {
        self.end = Some(*end);
        Ok(())
    }
}

fn taken(options: &Options, window: Option<&Window>, number: u64) -> (Lattice, ScanEnd) {
    let mut keep = Keep::default();
    let state = plate::fetch(options).unwrap();
    PreparedScan::new(options, state, window, number).unwrap().take(&mut keep).unwrap();
    (keep.lattice.unwrap(), keep.end.unwrap())
}

fn ranges(lattice: &Lattice) -> Vec<Option<f64>> {
    (0..lattice.n_columns() * lattice.n_rows()).map(|cell| lattice.range(cell)).collect()
}

/// Answers one request with one line.
fn press(answer: impl Into<String>) -> (String, std::thread::JoinHandle<String>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let answer = answer.into();
    let served = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let mut line = String::new();
        BufReader::new(stream.try_clone().unwrap()).read_line(&mut line).unwrap();
        stream.write_all(answer.as_bytes()).unwrap();
        line
    });
    (address, served)
}

fn refusal(options: &Options) -> platen_sdk::Error {
    plate::check(options).and_then(|()| plate::fetch(options)).map(drop).unwrap_err().into()
}

#[test]
fn a_scan_is_complete_and_shows_the_plate() {
    let options = options();
    let (lattice, end) = taken(&options, None, 1);
    let plate = Plate::new(&plate::fetch(&options).unwrap().unwrap()).unwrap();
    assert!(lattice.header().simulated);
    assert_eq!((end.columns as usize, end.points as usize), (lattice.n_columns(), lattice.n_valid()));
    assert!(lattice.n_valid() as f64 > 0.98 * (lattice.n_columns() * lattice.n_rows()) as f64);
    // The point measured next to the direction of the plate's middle lies on the plate.
    let middle: [f64; 3] = plate.top(1.5, 1.25).into();
    let wanted = Direction::of(middle);
    let nearest = (0..lattice.n_columns() * lattice.n_rows())
        .filter_map(|cell| Some((lattice.point(cell)?, lattice.direction(cell)?)))
        .min_by(|(_, a), (_, b)| {
            let off = |d: &Direction| (d.azimuth - wanted.azimuth).hypot(d.elevation - wanted.elevation);
            off(a).total_cmp(&off(b))
        });
    let off = Vec3::from(nearest.unwrap().0) - Vec3::from(middle);
    assert!(off.dot(&plate.normal(1.5, 1.25)).abs() < 3e-3, "{off}");
}

#[test]
fn scans_of_a_run_differ_and_runs_repeat() {
    let options = options();
    let (first, second, again) =
        (taken(&options, None, 1), taken(&options, None, 2), taken(&options, None, 1));
    assert_eq!(ranges(&first.0), ranges(&again.0));
    assert_ne!(ranges(&first.0), ranges(&second.0));
    let one_thread = Options { threads: 1, ..options };
    assert_eq!(ranges(&first.0), ranges(&taken(&one_thread, None, 1).0));
}

#[test]
fn a_window_is_what_is_scanned() {
    let window = Window { azimuth_start: -0.1, azimuth_width: 0.2, elevation_min: -0.6, elevation_max: -0.5 };
    let (lattice, _) = taken(&options(), Some(&window), 1);
    let step = 0.25_f64.to_radians();
    assert!((lattice.n_columns() as f64 - 0.2 / step).abs() <= 1.0);
    assert!((lattice.n_rows() as f64 - 0.1 / step).abs() <= 1.0);
    let wider = Window {
        azimuth_start: window.azimuth_start - step,
        azimuth_width: window.azimuth_width + 2.0 * step,
        elevation_min: window.elevation_min - step,
        elevation_max: window.elevation_max + step,
    };
    for cell in 0..lattice.n_columns() * lattice.n_rows() {
        assert!(wider.contains(lattice.direction(cell).unwrap()));
    }
}

#[test]
fn a_scanner_elsewhere_sees_the_same_plate() {
    let here = options();
    let there = Options { scanner_m: Some(vec![1.0, -0.5, 0.3]), scanner_yaw_deg: 20.0, ..options() };
    let [a, b] = [&here, &there].map(|o| Plate::new(&plate::fetch(o).unwrap().unwrap()).unwrap().corners());
    let turn = nalgebra::Rotation3::from_euler_angles(0.0, 0.0, 20_f64.to_radians());
    for (a, b) in a.iter().zip(b) {
        assert!((turn * b + Vec3::new(1.0, -0.5, 0.3) - a).norm() < 1e-12);
    }
    assert!(
        refusal(&Options { scanner_m: Some(vec![1.0]), ..options() }).to_string().contains("three numbers")
    );
}

#[test]
fn a_stopped_scan_has_no_end() {
    let options = options();
    let shot = PreparedScan::new(&options, plate::fetch(&options).unwrap(), None, 1).unwrap();
    let mut keep = Keep { stop_after: Some(3), ..Keep::default() };
    assert_eq!(shot.take(&mut keep).unwrap_err().kind(), ErrorKind::Cancelled);
    assert!(keep.columns == 3 && keep.end.is_none());
}

#[test]
fn the_press_says_what_lies_in_it() {
    let state =
        PlateState { shape: Shape::Sphere { radius_mm: 12_345.6 }, ..PlateState::flat(2000.0, 1500.0, 30.0) };
    let (address, served) =
        press(serde_json::to_string(&Reply::Plate(Some(state.clone().into()))).unwrap() + "\n");
    let fetched = plate::fetch(&Options { cell: Some(address), ..options() }).unwrap().unwrap();
    assert_eq!(served.join().unwrap(), "{\"get\":\"plate\"}\n");
    assert_eq!(fetched.shape, state.shape);
    assert_eq!(fetched.blank, state.blank);

    let (address, _served) = press("{\"plate\":null}\n");
    let options = Options { cell: Some(address), ..options() };
    let empty = plate::fetch(&options).unwrap();
    assert!(empty.is_none() && PreparedScan::new(&options, empty, None, 1).is_ok());
}

#[test]
fn every_fault_of_the_press_is_one_sentence() {
    let answered = |line: &str| {
        let (address, _served) = press(line);
        refusal(&Options { cell: Some(address), ..options() })
    };
    let moving = answered("{\"error\":\"the ram is down\"}\n");
    assert_eq!(moving.kind(), ErrorKind::Busy);
    assert!(moving.to_string().contains("the ram is down"));
    assert_eq!(answered("HTTP/1.1 400 Bad Request\n").kind(), ErrorKind::BadData);
    assert_eq!(answered("").kind(), ErrorKind::Disconnected);
    // A port without a listener: bound, then closed. The address is used by no other test.
    let closed = TcpListener::bind("127.0.0.77:0").unwrap().local_addr().unwrap().to_string();
    assert_eq!(refusal(&Options { cell: Some(closed), ..options() }).kind(), ErrorKind::Disconnected);
}

#[test]
fn a_plate_file_is_read_or_refused_with_its_place() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("plate.toml");
    let text =
        "[blank]\nwidth_mm = 2000.0\nheight_mm = 1000.0\nthickness_mm = 30.0\n[shape]\nshape = \"flat\"\n";
    std::fs::write(&path, text).unwrap();
    let options = Options { plate_file: Some(path.clone()), ..options() };
    assert_eq!(plate::fetch(&options).unwrap().unwrap().blank.width_mm, 2000.0);
    std::fs::write(&path, text.replace("height_mm", "hight_mm")).unwrap();
    let refused = refusal(&options);
    assert!(refused.kind() == ErrorKind::Config && refused.to_string().contains("hight_mm"));
    assert!(!refused.to_string().contains('\n'));
    let both = Options { cell: Some("127.0.0.1:1".into()), ..options };
    assert!(refusal(&both).to_string().contains("both"));
}

#[test]
fn a_paced_scan_takes_its_share_of_the_real_time() {
    // The coarsest resolution: 7 s for the circle, 21 s for spin-up and settling.
    let options = Options { time_scale: 0.01, step_deg: 0.28, margin_deg: 0.5, ..options() };
    let due = capture::estimate_s(&Options { time_scale: 1.0, ..options.clone() }, None).unwrap();
    assert!((21.0..24.0).contains(&due), "{due}");
    let started = std::time::Instant::now();
    let (lattice, end) = taken(&options, None, 1);
    assert!(started.elapsed().as_secs_f64() > 0.21);
    assert_eq!(end.columns as usize, lattice.n_columns());
    // Cancelled while the mirror spins up, the scan ends at once.
    let slow = Options { time_scale: 10.0, ..options };
    let shot = PreparedScan::new(&slow, plate::fetch(&slow).unwrap(), None, 1).unwrap();
    let mut keep = Keep { stop_after: Some(0), ..Keep::default() };
    assert!(shot.take(&mut keep).is_err() && keep.columns == 0);
    let impossible = Options { rate_kpts: "976".into(), ..slow };
    assert!(crate::pace::device(&impossible).unwrap_err().to_string().contains("97 Hz"));
}

#[test]
fn the_seam_of_two_faces_is_reported_where_it_lies() {
    let options = Options { back_face_from_deg: Some(0.0), collimation_urad: 50.0, ..options() };
    let (lattice, _) = taken(&options, None, 1);
    let seam = lattice.header().seam_column.unwrap() as usize;
    let azimuth = lattice.header().azimuth_start + lattice.header().azimuth_step * seam as f64;
    assert!((-1e-12..lattice.header().azimuth_step).contains(&azimuth), "{azimuth}");
    let face = |column| lattice.face(column).unwrap();
    assert!(face(seam - 1) == platen_scan::Face::Front && face(seam) == platen_scan::Face::Back);
    let elsewhere = Options { back_face_from_deg: Some(170.0), ..options };
    assert_eq!(taken(&elsewhere, None, 1).0.header().seam_column, None);
}
