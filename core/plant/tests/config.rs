//! Test that every file in `config/` loads, and that its values are in the units of the model.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that fails may panic")]

use std::path::{Path, PathBuf};

use platen_model::{Centre, Facing, Quantity, RadiusOf, Seat, TargetShape};
use platen_plant::plant::{KeepScans, RegionOfInterest, StoredScans, plate_files};
use platen_plant::{PlantFile, PlateFile, ScanWindow};

fn config() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config")
}

fn toml_files(folder: &Path) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension == "toml"));
    files.sort();
    files
}

#[test]
fn every_plate_file_loads() {
    let files = toml_files(&config().join("plates"));
    assert!(files.len() >= 5, "{files:?}");
    for path in files {
        PlateFile::load(&path).unwrap_or_else(|error| panic!("{error}"));
    }
}

#[test]
fn the_spherical_petal_arrives_in_metres_and_radians() {
    let file = PlateFile::load(&config().join("plates/plate-017.toml")).unwrap();
    let plate = &file.plate;
    assert_eq!((plate.id.as_str(), plate.supports.as_deref()), ("A17", Some("bed")));
    assert_eq!((plate.width, plate.height, plate.thickness, plate.face_inset), (4.0, 4.0, 0.035, 0.0));
    let target = file.target.unwrap();
    assert_eq!(target.shape, TargetShape::Sphere { radius: 12.0 });
    assert_eq!((target.radius_of, target.scanned_face), (RadiusOf::Inside, Facing::Inside));
    assert_eq!((file.markers[1].name.as_str(), file.markers[1].at), ("M2", [3.0, 3.0]));
    let line = &file.reference_lines[0];
    assert_eq!((line.name.as_str(), line.from, line.to, line.length()), ("R1", [0.0, 1.0], [4.0, 1.0], 4.0));
    let [first, second, _] = file.templates.as_slice() else { panic!("{:?}", file.templates) };
    assert_eq!((first.name.as_str(), first.line.as_str()), ("T1", "R1"));
    assert_eq!((first.chord, first.centre, first.limit), (2.0, Centre::At(2.0), 0.003));
    assert_eq!((first.seat, first.source.as_deref()), (Seat::Gravity, None));
    assert_eq!((second.name.as_str(), second.chord, second.limit), ("T2", 2.0, 0.003));
    assert_eq!((second.seat, second.centre), (Seat::Gravity, Centre::Worst));
    assert!(second.source.as_deref().is_some_and(|source| source.contains("one secondary source")));
    assert_eq!((file.stations[0].at, file.stations[0].quantity), ([0.5, 0.5], Quantity::Deviation));
}

#[test]
fn directions_become_radians_and_a_template_lies_in_the_middle_unless_said() {
    let file = PlateFile::load(&config().join("plates/plate-021.toml")).unwrap();
    let axis = std::f64::consts::FRAC_PI_2;
    let expected = TargetShape::Cone { axis, radius_start: 6.0, radius_end: 6.6 };
    assert_eq!(file.target.unwrap().shape, expected);
    assert_eq!(file.templates[0].centre, Centre::At(1.5));
    assert_eq!((file.plate.face_inset, file.plate.root_face), (0.0104, 0.0));
}

#[test]
fn a_bevel_is_an_inset_and_a_root_face() {
    let plate = |edges: &str| {
        let text =
            format!("[plate]\nid = 'A'\nwidth_mm = 4000\nheight_mm = 4000\nthickness_mm = 36\n{edges}");
        PlateFile::parse("plate.toml", &text).unwrap().plate
    };
    let edges = |plate: platen_model::Plate| (plate.face_inset, plate.root_face);
    assert_eq!(edges(plate("face_inset_mm = 9.0\nroot_face_mm = 4.0\n")), (0.009, 0.004));
    assert_eq!(edges(plate("root_face_mm = 0.0\n")), (0.0, 0.0));
    assert_eq!(edges(plate("face_inset_mm = 36.0\n")), (0.036, 0.0));
}

#[test]
fn a_preset_that_was_changed_says_so() {
    let source = |changes: &str| {
        let text = format!(
            "[plate]\nid = 'A'\nwidth_mm = 4000\nheight_mm = 4000\nthickness_mm = 35\n[[reference_line]]\nname = 'R'\n\
             from_mm = [0, 0]\nto_mm = [4000, 0]\n[[template]]\nline = 'R'\npreset = 'spherical-petal'\n{changes}"
        );
        PlateFile::parse("f", &text).unwrap().templates.remove(0).source.unwrap()
    };
    let rule = source("");
    assert!(rule.starts_with("spherical tank petals, 2 m board"), "{rule}");
    assert_eq!(source("limit_mm = 3.0"), rule);
    assert_eq!(source("limit_mm = 4.5"), format!("{rule}; changed here to 2000 mm board, 4.5 mm gap"));
    assert_eq!(source("limit_mm = 4.5\nsource = 'works drawing 12'"), "works drawing 12");
}

#[test]
fn every_plant_file_loads() {
    let files = toml_files(&config());
    let plants =
        files.iter().filter(|path| path.file_name().unwrap().to_string_lossy().starts_with("plant-"));
    let mut loaded = 0;
    for path in plants {
        PlantFile::load(path).unwrap_or_else(|error| panic!("{error}"));
        loaded += 1;
    }
    assert!(loaded > 0, "no plant file in {files:?}");
}

const PLANT: &str = r#"
[plant]
name = "North hall, press 3"
seed = 7
[scanner]
plugin = "faro-stream"
options = { address = "192.0.2.20" }
[frame]
u_axis = [0.84, 0.54, -0.02]
press_from_scanner = { rotation = [[0.6, 0.8, 0], [-0.8, 0.6, 0], [0, 0, 1]], translation_mm = [1500, 0, -250] }
region_of_interest = { min_mm = [-4000, 2000, -3000], max_mm = [4000, 9000, 1000] }
[plates]
folder = "recipes"
[flattening]
plugin = "elastic"
[[comparison]]
plugin = "template"
[output]
folder = "/var/platen"
keep_scans = "12 h"
"#;

#[test]
fn a_plant_file_arrives_with_its_paths_resolved() {
    let plant = PlantFile::parse("/etc/platen/plant-north.toml", PLANT).unwrap();
    assert_eq!((plant.name.as_str(), plant.seed), ("North hall, press 3", 7));
    assert_eq!(plant.scanner.as_ref().unwrap().plugin, "faro-stream");
    assert_eq!(plant.frame.press_from_scanner.rotation[0], [0.6, 0.8, 0.0]);
    assert_eq!(plant.frame.press_from_scanner.translation, [1.5, 0.0, -0.25]);
    assert_eq!(plant.frame.u_axis, Some([0.84, 0.54, -0.02]));
    let region = RegionOfInterest { min: [-4.0, 2.0, -3.0], max: [4.0, 9.0, 1.0] };
    assert_eq!(plant.frame.region_of_interest, Some(region));
    assert_eq!(plant.plate_path(17), Path::new("/etc/platen/recipes/plate-017.toml"));
    assert_eq!(plant.flattening.plugin, "elastic");
    assert_eq!(plant.comparisons.iter().map(|c| c.plugin.as_str()).collect::<Vec<_>>(), ["template"]);
    assert_eq!(plant.output.folder, Path::new("/var/platen"));
    assert_eq!(plant.output.history, Path::new("/var/platen/history.sqlite"));
    assert_eq!(plant.output.keep_scans, KeepScans::For(std::time::Duration::from_secs(12 * 3600)));
    let fault = plant.flattening.fault("plugin \"elastic\" is not installed").to_string();
    assert_eq!(
        fault,
        "/etc/platen/plant-north.toml:15:10: flattening.plugin: plugin \"elastic\" is not installed"
    );
}

#[test]
fn the_plate_files_of_a_plant_are_those_that_a_recipe_number_finds() {
    let plant = PlantFile::load(&config().join("plant-faro-file.toml")).unwrap();
    let recipes: Vec<u16> =
        plate_files(&plant.plates).unwrap().into_iter().map(|(recipe, _)| recipe).collect();
    assert_eq!(recipes, [1, 9, 17, 21, 22]);
    let folder = tempfile::tempdir().unwrap();
    let plant = PlantFile { plates: folder.path().to_owned(), ..PlantFile::default() };
    for name in
        ["plate-1000.toml", "plate-17.toml", "plate-002.toml", "plate-3.txt", "plate-x.toml", "notes.md"]
    {
        std::fs::write(folder.path().join(name), "").unwrap();
    }
    let expected = [(2, folder.path().join("plate-002.toml")), (1000, folder.path().join("plate-1000.toml"))];
    assert_eq!(plate_files(&plant.plates).unwrap(), expected);
    let absent = PlantFile { plates: folder.path().join("absent"), ..PlantFile::default() };
    assert!(plate_files(&absent.plates).unwrap_err().to_string().contains("absent: No such file"));
}

#[test]
fn an_empty_plant_file_says_what_the_default_says() {
    let plant = PlantFile::parse("plant-north.toml", "").unwrap();
    let file = std::path::PathBuf::from("plant-north.toml");
    assert_eq!(plant, PlantFile { file, name: "plant-north".to_owned(), ..PlantFile::default() });
    assert!(plant.scanner.is_none() && plant.frame.u_axis.is_none());
    assert!(PlantFile::parse("p.toml", "comparison = []").unwrap().comparisons.is_empty());
    assert_eq!(plant.scan_store, None);
    let always = PlantFile::parse("p.toml", "[output]\nkeep_scans = 'always'").unwrap();
    assert_eq!(always.output.keep_scans, KeepScans::Always);
}

#[test]
fn pages_are_for_this_computer_unless_a_token_is_named() {
    let screen = |text: &str| PlantFile::parse("plant/p.toml", text).map(|plant| plant.screen);
    assert_eq!(screen("").unwrap(), None);
    let own = screen("[screen]").unwrap().unwrap();
    assert_eq!((own.listen.to_string().as_str(), &own.token_file), ("127.0.0.1:8380", &None));
    let fault = screen("[screen]\nlisten = \"0.0.0.0:8380\"").unwrap_err().to_string();
    assert!(fault.contains("platen screen token") && fault.contains(":2:"), "{fault}");
    let all =
        screen("[screen]\nlisten = \"0.0.0.0:8380\"\ntoken_file = \"t\"\nnames = [\"p\"]").unwrap().unwrap();
    assert_eq!((all.token_file.unwrap(), all.names), ("plant/t".into(), vec!["p".to_owned()]));
    assert!(
        screen("[screen]\nlisten = \"localhost\"").unwrap_err().to_string().contains("an address and a port")
    );
    assert!(screen("[screen]\nport = 80").unwrap_err().to_string().contains("listen"));
}

#[test]
fn the_scan_window_is_one_of_three_words() {
    let window = |word: &str| {
        let text =
            format!("[scanner]\nplugin = 'faro-stream'\nwindow = '{word}'\n[scanner.options]\nfree = 1");
        PlantFile::parse("p.toml", &text).map(|plant| plant.scan_window).map_err(|faults| faults.to_string())
    };
    assert_eq!(window("everything"), Ok(ScanWindow::Everything));
    assert_eq!(window("region"), Ok(ScanWindow::Region));
    assert_eq!(PlantFile::parse("p.toml", "").unwrap().scan_window, ScanWindow::Plate);
    let refused = window("all").unwrap_err();
    assert!(
        refused.starts_with("p.toml:3:10: scanner.window") && refused.contains("everything"),
        "{refused}"
    );
}

#[test]
fn a_scan_store_has_a_rule() {
    let read = |text: &str| PlantFile::parse("hall/plant.toml", text).map(|plant| plant.scan_store.unwrap());
    let store = read("[scan_store]\nfolder = 'store'").unwrap();
    assert_eq!(store.folder, Path::new("hall/store"));
    let all = [StoredScans::Baseline, StoredScans::Last, StoredScans::CannotTell, StoredScans::NotMeasured];
    assert_eq!((store.which.as_slice(), store.share), (all.as_slice(), 0.0));
    let store = read("[scan_store]\nfolder = '/mnt/scans'\nwhich = ['last']\nshare = 0.01").unwrap();
    assert_eq!((store.which.as_slice(), store.share), ([StoredScans::Last].as_slice(), 0.01));
    let faults = read("[scan_store]\nwhich = ['first']\nshare = 2").unwrap_err().to_string();
    for part in ["folder", "\"first\", expected one of baseline, last, cannot_tell, not_measured", "share"] {
        assert!(faults.contains(part), "{faults}");
    }
}
