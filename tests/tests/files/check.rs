//! Tests of `platen check` with the real program: every fault of a plant at once, each at its place, whatever else is
//! wrong.

use std::path::Path;

use serde_json::Value;

/// Faults are marked by `#` and the part of the message that is expected.
const PLANT: &str = r#"[plant]
name = "Press 3"
seed = -1
[press]
name = "Press 3"
press_id = 3
mode = "listening"
[press.link]
type = "tpc"
port = "502"
unit = 300
[press.map]
word_order = "ABDC"
[press.map.in]
trigger = { at = "2.16" }
[press.write]
allow = ["all"]
[scanner]
plugin = "faro-fiel"
window = "all"
[frame]
u_axis = [0.84, 0.54, "down"]
[flattening]
plugin = "elastic"
[flattening.options]
poisons_ratio = 0.3
[[comparison]]
plugin = "harmonic"
[[comparison]]
plugin = "curvature"
options = "none"
[plates]
folder = "plates"
folders = 2
[output]
keep_scans = = 3
"#;

const FAULTY_PLATE: &str = "[plate]\nid = \"A\"\nwidth_mm = 4.0\nheight_mm = 2500.0\nthickness_mm = 40.0\n[target]\nshape = \"shpere\"\n";
const BROKEN_PLATE: &str =
    "[plate]\nid = \"B\nwidth_mm = 4000.0\nheight_mm = 2500.0\nthickness_mm = \"thick\"\n";
const SOUND_PLATE: &str = "[plate]\nid = \"C\"\nwidth_mm = 4000.0\nheight_mm = 2500.0\nthickness_mm = 40.0\n[target]\nshape = \"flat\"\n";

fn write(folder: &Path, plant: &str) -> std::path::PathBuf {
    let plates = folder.join("plates");
    std::fs::create_dir_all(&plates).unwrap();
    for (name, text) in [("001", FAULTY_PLATE), ("002", BROKEN_PLATE), ("003", SOUND_PLATE)] {
        std::fs::write(plates.join(format!("plate-{name}.toml")), text).unwrap();
    }
    let path = folder.join("plant.toml");
    std::fs::write(&path, plant).unwrap();
    path
}

/// Returns exit code and standard output.
fn check(arguments: &[&str], file: &Path) -> (Option<i32>, String) {
    let output = platen_tests::program("platen").arg("check").args(arguments).arg(file).output().unwrap();
    (output.status.code(), String::from_utf8(output.stdout).unwrap())
}

#[test]
fn all_faults_of_a_plant_are_reported_together() {
    let folder = tempfile::tempdir().unwrap();
    let plant = write(folder.path(), PLANT);
    let (code, out) = check(&["--json"], &plant);
    assert_eq!(code, Some(2), "{out}");
    let document: Value = serde_json::from_str(&out).unwrap();
    let faults = document["faults"].as_array().unwrap();
    let found: Vec<(String, u64, u64, &str)> = faults
        .iter()
        .map(|fault| {
            let file = Path::new(fault["file"].as_str().unwrap()).file_name().unwrap().to_string_lossy();
            let number = |key: &str| fault[key].as_u64().unwrap();
            assert!(!fault["message"].as_str().unwrap().is_empty(), "{fault}");
            (file.into_owned(), number("line"), number("column"), fault["key"].as_str().unwrap())
        })
        .collect();
    let expected = [
        ("plant.toml", 3, 8, "plant.seed"),
        ("plant.toml", 7, 8, "press.mode"),
        ("plant.toml", 9, 8, "press.link.type"),
        ("plant.toml", 10, 8, "press.link.port"),
        ("plant.toml", 11, 8, "press.link.unit"),
        ("plant.toml", 13, 14, "press.map.word_order"),
        ("plant.toml", 15, 18, "press.map.in.trigger.at"),
        ("plant.toml", 17, 10, "press.write.allow"),
        ("plant.toml", 19, 10, "scanner.plugin"),
        ("plant.toml", 20, 10, "scanner.window"),
        ("plant.toml", 22, 10, "frame.u_axis"),
        ("plant.toml", 26, 1, "flattening.options.poisons_ratio"),
        ("plant.toml", 28, 10, "comparison[1].plugin"),
        ("plant.toml", 31, 11, "comparison[2].options"),
        ("plant.toml", 34, 1, "plates.folders"),
        ("plant.toml", 36, 14, ""),
        ("plate-001.toml", 3, 12, "plate.width_mm"),
        ("plate-001.toml", 7, 9, "target.shape"),
        ("plate-002.toml", 2, 8, ""),
        ("plate-002.toml", 5, 16, "plate.thickness_mm"),
    ]
    .map(|(file, line, column, key)| (file.to_owned(), line, column, key));
    assert_eq!(found, expected, "{out}");

    let message = |key: &str| faults.iter().find(|fault| fault["key"] == key).unwrap()["message"].to_string();
    assert!(message("press.link.type").contains("tcp"), "{out}");
    assert!(message("scanner.plugin").contains("faro-file"), "{out}");
    assert!(message("comparison[1].plugin").contains("a comparison is needed"), "{out}");
    assert!(message("press.link.port").contains("502"), "{out}");

    let (code, text) = check(&[], &plant);
    assert_eq!(code, Some(2));
    assert_eq!(text.lines().count(), expected.len(), "{text}");
    assert!(text.contains("plant.toml:10:8: press.link.port: found the text \"502\""), "{text}");
}

/// Returns the faults of `text`, each without the folder.
fn faults(text: &str) -> Vec<String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("plant.toml");
    std::fs::write(&path, text).unwrap();
    let (_, out) = check(&[], &path);
    let start = format!("{}/", folder.path().display());
    out.lines().map(|line| line.replace(&start, "")).collect()
}

#[test]
fn an_option_is_checked_beside_a_fault_of_syntax() {
    let text = "[scanner]\nplugin = \"simulated\"\n[scanner.options]\nqqqq = 1\n[plant\n";
    let found = faults(text);
    assert_eq!(found.len(), 2, "{found:?}");
    assert!(
        found[0].starts_with("plant.toml:4:1: scanner.options.qqqq: simulated has no such option"),
        "{found:?}"
    );
    assert!(found[1].starts_with("plant.toml:5:7: unclosed table"), "{found:?}");
}

#[test]
fn an_unknown_scanner_is_reported_beside_any_fault_of_syntax() {
    let slips = [
        "seed 7",
        "seed = ",
        "seed = [1, 2",
        "name = \"North",
        "name = \"\"\"North",
        "seed = {a = 1",
        "[press",
        "seed",
    ];
    for slip in slips {
        let found = faults(&format!("[plant]\n{slip}\n[scanner]\nplugin = \"simulatd\"\n"));
        let scanner = found.iter().any(|fault| fault.starts_with("plant.toml:4:10: scanner.plugin: "));
        assert!(scanner && found.len() == 2, "{slip}: {found:?}");
    }
}

#[test]
fn a_press_needs_its_folder_of_plates() {
    let press = "[press]\nname = \"P\"\npress_id = 1\n[press.link]\nhost = \"192.0.2.10\"\nunit = 1\n";
    let found = faults(&format!("{press}[plates]\nfolder = \"recipes\"\n"));
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(found[0].starts_with("plant.toml:8:10: plates.folder: "), "{found:?}");
    assert_eq!(faults("[plates]\nfolder = \"recipes\"\n"), ["no faults"]);
}

#[test]
fn a_sound_plant_has_no_faults_and_an_absent_one_has_one() {
    let folder = tempfile::tempdir().unwrap();
    let plant = folder.path().join("plant.toml");
    std::fs::write(&plant, "[plant]\nname = \"P\"\n").unwrap();
    assert_eq!(check(&[], &plant), (Some(0), "no faults\n".to_owned()));
    let json = |file: &Path| {
        let (code, out) = check(&["--json"], file);
        (code, serde_json::from_str::<Value>(&out).unwrap())
    };
    assert_eq!(json(&plant), (Some(0), serde_json::json!({ "faults": [] })));
    let (code, absent) = json(&folder.path().join("absent.toml"));
    assert_eq!((code, &absent["faults"][0]["line"]), (Some(2), &0.into()), "{absent}");
}
