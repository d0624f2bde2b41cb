//! Tests of the table reader alone: syntax, duplicate keys, types, unknown keys, options, each with its place.

#![allow(clippy::unwrap_used, reason = "a test that fails may panic")]
use platen_plant::{
    Document, OptionDecl, OptionType, OptionValue, RawOptions, Reported, Value, check_options,
};

/// Returns the faults of `text` read as a table of known keys, without the file's name.
fn faults(text: &str) -> Vec<String> {
    let document = Document::parse("f.toml", text);
    let mut root = document.root();
    let mut plate = root.section("plate").unwrap();
    let _ = plate.name("id").required();
    let _ = plate.number("width_mm").above(0.0).required();
    let _ = plate.vector::<2>("at_mm").optional();
    let _ = plate.choice("shape", &[("flat", 0), ("sphere", 1), ("cylinder", 2)]).or(0);
    let _ = plate.bool("bevelled").or(false);
    let _ = plate.strings("words").optional();
    plate.finish();
    for mut marker in root.tables("marker").unwrap() {
        let _ = marker.integer("number").in_range(1..=9).required();
        marker.finish();
    }
    root.finish();
    match document.finish(Ok(())) {
        Ok(()) => Vec::new(),
        Err(faults) => faults.into_iter().map(|f| f.to_string().replacen("f.toml:", "", 1)).collect(),
    }
}

#[track_caller]
fn check(text: &str, expected: &[&str]) {
    assert_eq!(faults(text), expected, "{text}");
}

const GOOD: &str = "[plate]\nid = 'A'\nwidth_mm = 4000\n";

#[test]
fn a_good_file_has_no_fault() {
    check(GOOD, &[]);
    check(&format!("\u{feff}{}", GOOD.replace('\n', "\r\n")), &[]);
    check(
        &format!("{GOOD}at_mm = [1, 2.5]\nshape = 'sphere'\nwords = ['a', 'b']\n[[marker]]\nnumber = 9"),
        &[],
    );
}

#[test]
fn values_of_the_wrong_kind_say_what_was_found_and_what_is_allowed() {
    check(
        "[plate]\nid = 7\nwidth_mm = 'wide'\nat_mm = [1]\nshape = 'spere'\nbevelled = 1\nwords = ['a', 2]\n",
        &[
            "2:6: plate.id: found 7, expected a text",
            "3:12: plate.width_mm: found the text \"wide\", expected a number",
            "4:9: plate.at_mm: found a list of 1, expected a list of 2 numbers",
            "5:9: plate.shape: found \"spere\", allowed flat, sphere, cylinder; did you mean \"sphere\"?",
            "6:12: plate.bevelled: found 1, expected true or false",
            "7:9: plate.words: found a list of 2, expected a list of texts",
        ],
    );
    check(
        "[plate]\nid = ' '\nwidth_mm = -3\nat_mm = {x = 1}\n",
        &[
            "2:6: plate.id: is empty, must have at least one character",
            "3:12: plate.width_mm: found -3, must be above 0",
            "4:9: plate.at_mm: found a table, expected a list of 2 numbers",
        ],
    );
    check("[plate]\nid = 'A'\nwidth_mm = nan\n", &["3:12: plate.width_mm: found NaN, expected a number"]);
    check(
        "[plate]\nid = 'A'\nwidth_mm = 99999999999999999999\n",
        &["3:12: plate.width_mm: found a number beyond 64 bits, expected a number"],
    );
}

#[test]
fn missing_and_unknown_keys_name_their_table() {
    check("[plate]\n", &["1:1: plate.id: missing", "1:1: plate.width_mm: missing"]);
    check(
        &format!(
            "{GOOD}wdith_mm = 3\ncolour = 'red'\n[plait]\nid = 1\n[[marker]]\n[[marker]]\nnumber = 12\nnmber = 1\n"
        ),
        &[
            "4:1: plate.wdith_mm: unknown key; did you mean \"width_mm\"?",
            "5:1: plate.colour: unknown key; allowed here: id, width_mm, at_mm, shape, bevelled, words",
            "6:2: plait: unknown key; did you mean \"plate\"?",
            "8:1: marker[1].number: missing",
            "10:10: marker[2].number: found 12, allowed 1 to 9",
            "11:1: marker[2].nmber: unknown key; did you mean \"number\"?",
        ],
    );
}

#[test]
fn a_doubled_key_names_both_places_and_hides_nothing() {
    check(&format!("{GOOD}  id = 'B'\n"), &["4:3: plate.id: defined twice, first at f.toml:2:1; remove one"]);
    check(
        &format!("{GOOD}[[marker]]\nnumber = 1\n[[marker]]\nnumber = 2\nnumber = 3\n"),
        &["8:1: marker[2].number: defined twice, first at f.toml:7:1; remove one"],
    );
    check(
        &format!("{GOOD}[plate] # again\nid = 'B'\n"),
        &[
            "4:2: plate: defined twice, first at f.toml:1:2; remove one",
            "5:1: plate.id: defined twice, first at f.toml:2:1; remove one",
        ],
    );
    check(
        &format!("{GOOD}at_mm = {{id = 1, id = 2}}\n"),
        &[
            "4:9: plate.at_mm: found a table, expected a list of 2 numbers",
            "4:18: plate.at_mm.id: defined twice, first at f.toml:4:10; remove one",
        ],
    );
    check(
        "[plate]\nid = 'A'\n'id' = 'B'\ncolour = 1\n",
        &[
            "1:1: plate.width_mm: missing",
            "3:1: plate.id: defined twice, first at f.toml:2:1; remove one",
            "4:1: plate.colour: unknown key; allowed here: id, width_mm, at_mm, shape, bevelled, words",
        ],
    );
}

#[test]
fn broken_syntax_hides_neither_itself_nor_the_rest() {
    check(
        "[plate]\nid = \nwidth_mm = 12..3\nbevelled = yes\nshape = 'spere'\n",
        &[
            "2:6: string values must be quoted, expected literal string",
            "3:15: invalid fraction, expected digits",
            "4:12: string values must be quoted, expected literal string",
            "5:9: plate.shape: found \"spere\", allowed flat, sphere, cylinder; did you mean \"sphere\"?",
        ],
    );
    check(
        "[plate]\nid = \"A\nwidth_mm = 0\n",
        &["2:8: invalid basic string, expected `\"`", "3:12: plate.width_mm: found 0, must be above 0"],
    );
    check(
        "[plate\nid = 'A'\nwidth = 2\n[plait]\n",
        &["1:7: unclosed table, expected `]`", "4:2: plait: unknown key; did you mean \"plate\"?"],
    );
    check(
        "[plate]\nid 'A'\nwidth_mm = 0\n",
        &["2:4: key with no value, expected `=`", "3:12: plate.width_mm: found 0, must be above 0"],
    );
    check(
        "plate\n[plate]\nid = 7\n",
        &["1:6: key with no value, expected `=`", "3:6: plate.id: found 7, expected a text"],
    );
    check(
        "[plate]\nid = 'A' width_mm = 0\nshape = 'spere'\n",
        &[
            "2:10: unexpected key or value, expected newline, `#`",
            "3:9: plate.shape: found \"spere\", allowed flat, sphere, cylinder; did you mean \"sphere\"?",
        ],
    );
    check(
        "[plate]\nid = 'A'\nat_mm = [1, 2\nwidth_mm = 4\n[[marker]]\nnumber = 0\n[[marker]]\nnumber = \"\"\"1\n",
        &[
            "4:1: missing comma between array elements, expected `,`",
            "6:10: marker[1].number: found 0, allowed 1 to 9",
            "9:1: invalid multi-line basic string, expected `\"`",
        ],
    );
    check(
        "bevelled = 1\n[plate]\nid = 7\nat_mm = { x = 1, y = \nwidth_mm = 0\n",
        &[
            "1:1: bevelled: unknown key; allowed here: plate, marker",
            "3:6: plate.id: found 7, expected a text",
            "5:1: string values must be quoted, expected literal string",
        ],
    );
}

#[test]
fn a_file_that_is_no_utf_8_says_where() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("latin.toml");
    std::fs::write(&path, b"[plate]\nid = 'M\xfcller'\n").unwrap();
    let error = Document::load(&path).unwrap_err().to_string();
    assert_eq!(error, format!("{}:2:8: this byte is not UTF-8; save the file as UTF-8", path.display()));
    let absent = Document::load(&folder.path().join("absent.toml")).unwrap_err().to_string();
    assert!(absent.ends_with("absent.toml: No such file or directory (os error 2)"), "{absent}");
}

#[test]
fn faults_serialise_as_a_list() {
    let faults = Document::parse("f.toml", "a = 1\n").finish(Err::<(), _>(refused()));
    let json = serde_json::to_value(faults.unwrap_err()).unwrap();
    let expected = serde_json::json!([
        {"file": "f.toml", "line": 1, "column": 1, "key": "", "message": "cannot be read"}
    ]);
    assert_eq!(json, expected);
}

/// Returns a proof that another document was refused.
fn refused() -> Reported {
    let document = Document::parse("other.toml", "");
    document.fault(document.root().place(), "wrong")
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
        doc: format!("What {name} does."),
        secret: false,
    }
}

fn stream_options() -> Vec<OptionDecl> {
    let metres = |name| OptionDecl { unit: Some("m".to_owned()), ..option(name, OptionType::Float) };
    vec![
        OptionDecl { required: true, ..option("address", OptionType::String) },
        OptionDecl {
            min: Some(0.6),
            max: Some(130.0),
            default: Some("30".to_owned()),
            ..metres("range_max")
        },
        OptionDecl { min: Some(1.0), max: Some(64.0), ..option("threads", OptionType::Int) },
        OptionDecl {
            unit: Some("ms".to_owned()),
            default: Some("'5 s'".to_owned()),
            ..option("deadline", OptionType::Duration)
        },
        OptionDecl {
            choices: vec!["full".to_owned(), "quarter".to_owned()],
            ..option("resolution", OptionType::Choice)
        },
        option("calibration", OptionType::Path),
        OptionDecl { min: Some(-1.0), max: Some(1.0), ..option("mirror", OptionType::Floats) },
        option("colour", OptionType::Bool),
        OptionDecl { secret: true, ..option("password", OptionType::String) },
    ]
}

fn raw(text: &str) -> RawOptions {
    let document = Document::parse("config/plant.toml", format!("[scanner]\nplugin = 'faro-stream'\n{text}"));
    document.root().section("scanner").unwrap().options("options")
}

fn checked(text: &str) -> Result<Vec<OptionValue>, String> {
    check_options("faro-stream", &raw(text), &stream_options()).map_err(|faults| faults.to_string())
}

#[test]
fn options_arrive_in_the_declared_unit_with_defaults_and_paths_resolved() {
    let text = "[scanner.options]\naddress = '192.0.2.7'\nrange_max = '1e4 mm'\nthreads = 2\n\
                calibration = 'cal.json'\nmirror = [0, 0.5]\ncolour = true\n";
    let expected = [
        ("address", Value::String("192.0.2.7".to_owned())),
        ("range_max", Value::Float(10.0)),
        ("threads", Value::Int(2)),
        ("deadline", Value::Duration(5.0)),
        ("calibration", Value::Path("config/cal.json".into())),
        ("mirror", Value::Floats(vec![0.0, 0.5])),
        ("colour", Value::Bool(true)),
    ];
    let given = |name| name != "deadline";
    let expected =
        expected.map(|(name, value)| OptionValue { name: name.to_owned(), value, given: given(name) });
    let expected = expected.to_vec();
    assert_eq!(checked(text), Ok(expected));
}

#[test]
fn faulty_options_name_the_plugin_and_the_declaration() {
    let text = "[scanner.options]\nrang_max = '30 m'\nrange_max = '200 m'\nthreads = 2.5\ndeadline = '3 m'\n\
                resolution = 'ful'\nmirror = [0, 2]\nzzz = 1\ncalibration = ''\n";
    let expected = "\
config/plant.toml:3:1: scanner.options.address: missing; faro-stream needs it: What address does. (text, required)
config/plant.toml:4:1: scanner.options.rang_max: faro-stream has no such option; did you mean \"range_max\" (number in m, 0.6 to 130 m, default 30)?
config/plant.toml:5:13: scanner.options.range_max: found the text \"200 m\", allowed 0.6 to 130 m
config/plant.toml:6:11: scanner.options.threads: found 2.5, expected a whole number
config/plant.toml:7:12: scanner.options.deadline: found \"3 m\", which is length, expected time in s, ms, us, min, h, d
config/plant.toml:8:14: scanner.options.resolution: found \"ful\", allowed full, quarter; did you mean \"full\"?
config/plant.toml:9:10: scanner.options.mirror: found 2, allowed -1 to 1
config/plant.toml:10:1: scanner.options.zzz: faro-stream has no such option; allowed here: address, range_max, threads, deadline, resolution, calibration, mirror, colour, password
config/plant.toml:11:15: scanner.options.calibration: is empty, must have at least one character";
    assert_eq!(checked(text), Err(expected.to_owned()));
}

#[test]
fn a_secret_is_read_from_its_file_and_never_quoted() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("key"), "s3cret\n").unwrap();
    let check = |text: &str| {
        let file = folder.path().join("plant.toml").display().to_string();
        let document = Document::parse(file.clone(), format!("[options]\naddress = 'a'\n{text}"));
        let raw = document.root().options("options");
        check_options("faro-stream", &raw, &stream_options())
            .map(|values| {
                values.into_iter().find(|option| option.name == "password").map(|option| option.value)
            })
            .map_err(|faults| faults.to_string().replace(&file, ""))
    };
    assert_eq!(check("password = { file = 'key' }"), Ok(Some(Value::String("s3cret".to_owned()))));
    assert_eq!(
        check("password = { env = 'PLATEN_TEST_UNSET' }"),
        Err(":3:12: options.password: the environment variable PLATEN_TEST_UNSET is not set".to_owned())
    );
    assert_eq!(
        check("password = { key = 's3cret' }"),
        Err(":3:12: options.password: expected a text, { env = \"NAME\" } or { file = \"PATH\" }".to_owned())
    );
}
