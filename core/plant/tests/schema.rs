//! The schemas and the readers are two lists of the same keys: what a reader says it allows must stand in the schema.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that fails may panic")]

use std::collections::BTreeSet;

use platen_plant::{
    Fault, OptionDecl, OptionType, PLANT_SCHEMA, PLATE_SCHEMA, PlantFile, PlateFile, options_schema,
    plant_schema,
};
use serde_json::{Value, json};

/// A key that no table has and that is like none.
const STRANGER: &str = "qqqqqqqq";

fn plate_faults(text: &str) -> Vec<Fault> {
    PlateFile::parse("f", text).map(|_| Vec::new()).unwrap_or_else(|faults| faults.into_iter().collect())
}

fn plant_faults(text: &str) -> Vec<Fault> {
    PlantFile::parse("f", text).map(|_| Vec::new()).unwrap_or_else(|faults| faults.into_iter().collect())
}

/// The words after "allowed ..." in the message about `key`.
fn allowed(faults: &[Fault], key: &str) -> BTreeSet<String> {
    let fault = faults.iter().find(|fault| fault.key == key).unwrap_or_else(|| panic!("{key}: {faults:?}"));
    let (_, words) = fault.message.split_once("allowed ").unwrap_or_else(|| panic!("{fault}"));
    words.trim_start_matches("here: ").split(", ").map(str::to_owned).collect()
}

fn missing(faults: &[Fault]) -> BTreeSet<String> {
    let missing = faults.iter().filter(|fault| fault.message == "missing");
    missing.map(|fault| fault.key.rsplit('.').next().unwrap().to_owned()).collect()
}

fn keys(schema: &Value) -> BTreeSet<String> {
    schema["properties"].as_object().unwrap().keys().cloned().collect()
}

fn strings(list: &Value) -> BTreeSet<String> {
    list.as_array()
        .map(|list| list.iter().map(|s| s.as_str().unwrap().to_owned()).collect())
        .unwrap_or_default()
}

#[test]
fn the_plate_schema_has_the_keys_that_the_reader_allows() {
    let schema: Value = serde_json::from_str(PLATE_SCHEMA).unwrap();
    let stranger = format!("{STRANGER} = 1\n");
    assert_eq!(allowed(&plate_faults(&stranger), STRANGER), keys(&schema));
    assert_eq!(missing(&plate_faults("")), strings(&schema["required"]));
    let plate = &schema["properties"]["plate"];
    let faults = plate_faults(&format!("[plate]\n{stranger}"));
    assert_eq!(allowed(&faults, &format!("plate.{STRANGER}")), keys(plate));
    assert_eq!(missing(&faults), strings(&plate["required"]));
    for array in ["marker", "reference_line", "support", "template", "station"] {
        let items = &schema["properties"][array]["items"];
        let faults = plate_faults(&format!("[[{array}]]\n{stranger}"));
        assert_eq!(allowed(&faults, &format!("{array}[1].{STRANGER}")), keys(items), "{array}");
        let mut required = strings(&items["required"]);
        if array == "template" {
            required.extend(strings(&items["anyOf"][1]["required"]));
        }
        required.insert("plate".to_owned());
        assert_eq!(missing(&faults), required, "{array}");
    }
}

#[test]
fn the_plate_schema_has_the_keys_of_each_target() {
    let schema: Value = serde_json::from_str(PLATE_SCHEMA).unwrap();
    let shapes = schema["properties"]["target"]["oneOf"].as_array().unwrap();
    let words: BTreeSet<String> = shapes
        .iter()
        .map(|shape| shape["properties"]["shape"]["const"].as_str().unwrap().to_owned())
        .collect();
    assert_eq!(allowed(&plate_faults("[target]\nshape = 'q'"), "target.shape"), words);
    for shape in shapes {
        let word = shape["properties"]["shape"]["const"].as_str().unwrap();
        let faults = plate_faults(&format!("[target]\nshape = '{word}'\n{STRANGER} = 1"));
        assert_eq!(allowed(&faults, &format!("target.{STRANGER}")), keys(shape), "{word}");
        let mut required = strings(&shape["required"]);
        required.insert("plate".to_owned());
        assert_eq!(missing(&faults), required, "{word}");
    }
    let faults = plate_faults("[target]\nshape = 'sphere'\nradius_of = 'q'\nscanned_face = 'q'");
    for key in ["radius_of", "scanned_face"] {
        assert_eq!(
            allowed(&faults, &format!("target.{key}")),
            strings(&schema["$defs"][key]["enum"]),
            "{key}"
        );
    }
}

#[test]
fn the_plate_schema_has_the_words_and_limits_of_the_reader() {
    let schema: Value = serde_json::from_str(PLATE_SCHEMA).unwrap();
    let faults = plate_faults(
        "[plate]\nwidth_mm = -1\nheight_mm = -1\nthickness_mm = -1\n[target]\nshape = 'sphere'\naxis_deg = 999\n\
         [[template]]\npreset = 'q'\nseat = 'q'\n[[station]]\nquantity = 'q'",
    );
    let words = [
        ("template[1].preset", &schema["properties"]["template"]["items"]["properties"]["preset"]["enum"]),
        ("template[1].seat", &schema["properties"]["template"]["items"]["properties"]["seat"]["enum"]),
        ("station[1].quantity", &schema["properties"]["station"]["items"]["properties"]["quantity"]["enum"]),
    ];
    for (key, words) in words {
        assert_eq!(allowed(&faults, key), strings(words), "{key}");
    }
    let range = |schema: &Value| BTreeSet::from([format!("{} to {}", schema["minimum"], schema["maximum"])]);
    for key in ["width_mm", "height_mm", "thickness_mm"] {
        let schema = &schema["properties"]["plate"]["properties"][key];
        assert_eq!(allowed(&faults, &format!("plate.{key}")), range(schema), "{key}");
    }
    let faults = plate_faults("[target]\nshape = 'cylinder'\naxis_deg = 999");
    assert_eq!(allowed(&faults, "target.axis_deg"), range(&schema["$defs"]["axis"]));
}

#[test]
fn the_plant_schema_has_the_keys_that_the_reader_allows() {
    let schema: Value = serde_json::from_str(PLANT_SCHEMA).unwrap();
    let stranger = format!("{STRANGER} = 1\n");
    assert_eq!(allowed(&plant_faults(&stranger), STRANGER), keys(&schema));
    let properties = &schema["properties"];
    let frame = &properties["frame"];
    let plugin = &schema["$defs"]["plugin"];
    let tables = [
        ("plant", "plant", &properties["plant"]),
        ("scanner", "scanner", &properties["scanner"]),
        ("frame", "frame", frame),
        ("frame.press_from_scanner", "frame.press_from_scanner", &frame["properties"]["press_from_scanner"]),
        ("frame.region_of_interest", "frame.region_of_interest", &frame["properties"]["region_of_interest"]),
        ("calibration", "calibration", &properties["calibration"]),
        ("plates", "plates", &properties["plates"]),
        ("flattening", "flattening", plugin),
        ("[comparison]", "comparison[1]", plugin),
        ("output", "output", &properties["output"]),
    ];
    for (header, key, schema) in tables {
        let faults = plant_faults(&format!("[{header}]\n{stranger}"));
        assert_eq!(allowed(&faults, &format!("{key}.{STRANGER}")), keys(schema), "{key}");
        assert_eq!(missing(&faults), strings(&schema["required"]), "{key}");
    }
}

#[test]
fn defaults_in_the_plant_schema_are_the_readers() {
    let schema: Value = serde_json::from_str(PLANT_SCHEMA).unwrap();
    let default = |table: &str, key: &str| schema["properties"][table]["properties"][key]["default"].clone();
    let text = format!(
        "[plant]\nseed = {}\n[plates]\nfolder = {}\n[output]\nfolder = {}\nkeep_scans = {}",
        default("plant", "seed"),
        default("plates", "folder"),
        default("output", "folder"),
        default("output", "keep_scans"),
    );
    assert_eq!(PlantFile::parse("f", &text).unwrap(), PlantFile::parse("f", "").unwrap());
}

fn option(name: &str, kind: OptionType) -> OptionDecl {
    OptionDecl {
        name: name.to_owned(),
        kind,
        unit: None,
        min: None,
        max: None,
        choices: Vec::new(),
        default: None,
        required: false,
        doc: " The address. ".to_owned(),
        secret: false,
        advanced: false,
        deprecated: None,
    }
}

#[test]
fn the_options_of_installed_plugins_are_part_of_the_plant_schema() {
    let declared = [
        OptionDecl { required: true, ..option("address", OptionType::String) },
        OptionDecl { unit: Some("m".to_owned()), min: Some(0.6), ..option("range_max", OptionType::Float) },
        OptionDecl { choices: vec!["full".to_owned()], ..option("resolution", OptionType::Choice) },
    ];
    let options = json!({
        "type": "object",
        "additionalProperties": false,
        "required": ["address"],
        "properties": {
            "address": { "type": "string", "description": "The address. (text, required)" },
            "range_max": {
                "anyOf": [
                    { "type": "number", "minimum": 0.6 },
                    { "type": "string", "description": "A number with its unit." }
                ],
                "description": "The address. (number in m, at least 0.6 m)"
            },
            "resolution": { "enum": ["full"], "description": "The address. (choice: full)" }
        }
    });
    assert_eq!(options_schema(&declared), options);
    let schema = plant_schema([("faro-stream", declared.as_slice()), ("harmonic", &[])]).unwrap();
    let rules = &schema["$defs"]["options_of_plugin"]["allOf"];
    assert_eq!(
        rules[0],
        json!({
            "if": { "properties": { "plugin": { "const": "faro-stream" } } },
            "then": { "properties": { "options": options }, "required": ["options"] }
        })
    );
    assert_eq!(rules[1]["then"]["properties"]["options"]["properties"], json!({}));
    assert_eq!(plant_schema([]).unwrap(), serde_json::from_str::<Value>(PLANT_SCHEMA).unwrap());
}
