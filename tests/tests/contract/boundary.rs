//! Tests of the plugin boundary: the header against the Rust types, a scanner in C, and every way in which a library
//! can be invalid.

use std::path::Path;
use std::process::Command;
use std::time::Duration;

use platen_engine::plugin::{Catalogue, JobSpec, Kind, PluginError, Scanner};
use platen_plant::{OptionValue, Value};
use platen_scan::Lattice;
use platen_tests::{c_source, compile_c};

const LIMIT: Duration = Duration::from_secs(20);

/// Builds a library from C text in a folder of its own, found as `name`.
fn c_plugin(folder: &Path, name: &str, text: &str) -> Catalogue {
    let file = folder.join("plugin.c");
    std::fs::write(&file, text).unwrap();
    compile_c(&file, &folder.join(format!("lib{name}.so")), &["-shared", "-fPIC"]);
    Catalogue::new(Some(folder))
}

#[test]
fn the_header_and_the_rust_types_agree() {
    use platen_abi::payload as p;
    use std::mem::offset_of;
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("sizes");
    compile_c(&c_source("sizes.c"), &program, &[]);
    let printed = String::from_utf8(Command::new(program).output().unwrap().stdout).unwrap();
    let mut expected = String::new();
    macro_rules! layout {
        ($($c:ident = $ty:ty { $($field:ident),* })*) => { $(
            expected += &format!("{} {}\n", stringify!($c), size_of::<$ty>());
            $( expected += &format!("{}.{} {}\n", stringify!($c), stringify!($field), offset_of!($ty, $field)); )*
        )* };
    }
    layout! {
        platen_error = platen_abi::Error { message, hint }
        platen_job = platen_abi::Job { deadline_mono_ns }
        platen_buffer = platen_abi::Buffer { token }
        platen_frame = platen_abi::Frame { format, buffer, role }
        platen_option = platen_abi::OptionDecl { name, min, choices }
        platen_value = platen_abi::Value { i, list, n }
        platen_desc = platen_abi::Desc { license, options, n_options }
        platen_host = platen_abi::Host { log, emit, now_mono_ns }
        platen_instance = platen_abi::Instance { open, get_extension }
        platen_entry = platen_abi::Entry { init, create }
        platen_scan = p::Scan { seam_column, notes }
        platen_column = p::Column { range_m, state }
        platen_scan_end = p::ScanEnd { points, outcome }
        platen_window = p::Window { elevation_max }
        platen_mesh = p::Mesh { corners, edge_length, arc, places }
        platen_chart = p::Chart { sigma }
        platen_surface = p::Surface { thickness, seen }
        platen_grid = p::Grid { components, state }
        platen_estimate = platen_abi::Estimate { scan_seconds }
        platen_health = platen_abi::Health { tilt }
        platen_health_source = platen_abi::HealthSource { health }
        platen_device = platen_abi::Device { option, value, about }
        platen_discovery = platen_abi::Discovery { discover }
    }
    assert_eq!(printed, expected);
}

#[test]
fn a_scanner_in_c_scans() {
    let folder = tempfile::tempdir().unwrap();
    let catalogue = c_plugin(
        folder.path(),
        "my_plugin",
        &std::fs::read_to_string(platen_tests::repository().join("drivers/examples/scanner.c")).unwrap(),
    );
    let library = catalogue.load("my-plugin").unwrap();
    assert_eq!(library.descriptor().options[0].default.as_deref(), Some("2.0"));
    let height = |f| [OptionValue { name: "height".into(), value: Value::Float(f), given: true }];
    let refused = Scanner::create(&library, &height(1000.0)).unwrap_err();
    assert_eq!(
        refused.to_string(),
        "plugin my-plugin: refused its options: height is above any hall; give metres"
    );

    let scanner = Scanner::create(&library, &height(2.5)).unwrap();
    scanner.instance().open(LIMIT).unwrap();
    let mut scan = scanner.start(JobSpec::untriggered(LIMIT), None).unwrap();
    let mut lattice = Lattice::new(scan.header().clone());
    scan.by_ref().for_each(|column| lattice.push(&column.unwrap()).unwrap());
    assert_eq!(scan.finish().unwrap().points, 4800);
    assert_eq!(lattice.n_valid(), 4800);
    for cell in 0..4800 {
        assert!((lattice.point(cell).unwrap()[2] + 2.5).abs() < 1e-6);
    }

    let spec = JobSpec::untriggered(LIMIT);
    let cancel = spec.cancel.clone();
    let mut scan = scanner.start(spec, None).unwrap();
    cancel.cancel();
    let stopped = scan.finish().unwrap_err();
    assert!(matches!(stopped, PluginError::Stopped { why: "it was cancelled", .. }), "{stopped}");
    // After an abandoned scan the scanner is ready for the next.
    drop(scanner.start(JobSpec::untriggered(LIMIT), None).unwrap());
    assert_eq!(scanner.start(JobSpec::untriggered(LIMIT), None).unwrap().finish().unwrap().points, 4800);
    let late = scanner.start(JobSpec::untriggered(Duration::ZERO), None);
    assert!(matches!(late, Err(PluginError::Stopped { why: "its deadline passed", .. })), "{late:?}");
}

#[test]
fn every_wrong_library_gets_its_own_sentence() {
    platen_tests::built();
    let folder = tempfile::tempdir().unwrap();
    let refuse = |name: &str, text: &str| {
        let place = folder.path().join(name);
        std::fs::create_dir(&place).unwrap();
        c_plugin(&place, name, text).load(name).unwrap_err()
    };

    let missing = Catalogue::new(Some(folder.path())).load("harmonik").unwrap_err();
    assert!(
        matches!(&missing, PluginError::NotFound { nearest: Some(n), .. } if n == "harmonic"),
        "{missing}"
    );
    let other = refuse("other", "int x;");
    assert!(matches!(other, PluginError::NotAPlugin { .. }), "{other}");
    let newer = refuse("newer", "const int platen_entry_3 = 0;");
    assert!(matches!(&newer, PluginError::WrongAbi { found, .. } if found == "3"), "{newer}");
    let short = refuse("short", "const int platen_entry_2[12] = {8, 0};");
    assert!(
        matches!(&short, PluginError::NotAPlugin { why, .. } if why.contains("has 8 bytes, 48 are needed")),
        "{short}"
    );
    let unresolved = refuse(
        "unresolved",
        "extern int acme_open2(void); const int platen_entry_2 = 0; int f(void) { return acme_open2(); }",
    );
    assert!(
        matches!(&unresolved, PluginError::FailedToLoad { why, .. } if why.contains("acme_open2")),
        "{unresolved}"
    );

    let whole = std::fs::read(platen_tests::library("harmonic")).unwrap();
    for part in [100, whole.len() / 2, whole.len() - 64] {
        let cut = folder.path().join(format!("libcut{part}.so"));
        std::fs::write(&cut, &whole[..part]).unwrap();
        let cut = Catalogue::new(Some(folder.path())).load(&format!("cut{part}")).unwrap_err();
        assert!(matches!(cut, PluginError::NotAPlugin { .. }), "{cut}");
    }

    let library = Catalogue::new(Some(platen_tests::built())).load("harmonic").unwrap();
    assert_eq!(library.descriptor().kind, Kind::Flattening);
    let wrong_kind = Scanner::create(&library, &[]).unwrap_err();
    assert!(matches!(&wrong_kind, PluginError::WrongKind { needed: "scanner", .. }), "{wrong_kind}");
}

/// Libraries built from each released header, and never built again.
#[test]
#[cfg(target_arch = "x86_64")]
fn a_library_of_each_released_boundary_loads_for_ever() {
    let folder = platen_tests::repository().join("tests/data/boundary");
    for library in std::fs::read_dir(folder).unwrap() {
        let path = library.unwrap().path();
        let library = Catalogue::new(None).open(&path).unwrap().remove(0);
        let height = OptionValue { name: "height".into(), value: Value::Float(2.0), given: true };
        let scanner = Scanner::create(&library, &[height]).unwrap();
        scanner.instance().open(LIMIT).unwrap();
        let mut scan = scanner.start(JobSpec::untriggered(LIMIT), None).unwrap();
        assert_eq!(scan.finish().unwrap().columns, 80, "{}", path.display());
    }
}
