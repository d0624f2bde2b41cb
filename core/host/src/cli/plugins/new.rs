//! Command `platen plugins new`: creates a folder with a working plugin as a starting point.
//!
//! Nothing is downloaded: the examples of `plugins/examples` and `drivers/examples` are part of the program.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, ValueEnum};

use super::super::{CliError, Common, output};

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  platen plugins new mean-curvature --kind comparison\n  \
                        platen plugins new my-scanner --kind scanner --lang c\n  \
                        platen plugins new my-map --kind flattening --lang cpp ~/plugins/my-map")]
pub(super) struct Command {
    /// Name of the plugin in plant files: lower case letters, digits, hyphens
    name: String,
    /// Its kind
    #[arg(long)]
    kind: Kind,
    /// Its language
    #[arg(long, default_value = "rust")]
    lang: Language,
    /// Folder to make; the plugin's name in this one without
    folder: Option<PathBuf>,
    /// Sources of platen, on which a plugin in Rust depends; those around this program without
    #[arg(long, value_name = "DIR")]
    platen: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Kind {
    Scanner,
    Flattening,
    Comparison,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Language {
    Rust,
    C,
    Cpp,
}

/// A file of the new folder.
struct File {
    name: &'static str,
    text: String,
}

const HEADER: &str = include_str!("../../../../abi/include/platen.h");
const HEADER_CPP: &str = include_str!("../../../../abi/include/platen.hpp");
const SURFACE: &str = include_str!("../../../../abi/include/platen_surface.h");
const HARMONIC_MAP: &str = include_str!("../../../../../plugins/examples/harmonic_map.h");

/// Commands that try a flattening or comparison on a simulated plate.
const MEASURE: &str = "platen-sim scanner simulated.toml --out scan.e57\n\
                       platen --plugins FOLDER measure scan.e57 --plate plate.toml --plant plant.toml";

/// Returns the source: its name and text.
fn source(kind: Kind, language: Language) -> (&'static str, &'static str) {
    match (kind, language) {
        (Kind::Scanner, Language::Rust) => {
            ("src/lib.rs", include_str!("../../../../../drivers/examples/scanner.rs"))
        }
        (Kind::Scanner, Language::C) => {
            ("scanner.c", include_str!("../../../../../drivers/examples/scanner.c"))
        }
        (Kind::Scanner, Language::Cpp) => {
            ("scanner.cpp", include_str!("../../../../../drivers/examples/scanner.cpp"))
        }
        (Kind::Flattening, Language::Rust) => {
            ("src/lib.rs", include_str!("../../../../../plugins/examples/flattening.rs"))
        }
        (Kind::Flattening, Language::C) => {
            ("flattening.c", include_str!("../../../../../plugins/examples/flattening.c"))
        }
        (Kind::Flattening, Language::Cpp) => {
            ("flattening.cpp", include_str!("../../../../../plugins/examples/flattening.cpp"))
        }
        (Kind::Comparison, Language::Rust) => {
            ("src/lib.rs", include_str!("../../../../../plugins/examples/comparison.rs"))
        }
        (Kind::Comparison, Language::C) => {
            ("comparison.c", include_str!("../../../../../plugins/examples/comparison.c"))
        }
        (Kind::Comparison, Language::Cpp) => {
            ("comparison.cpp", include_str!("../../../../../plugins/examples/comparison.cpp"))
        }
    }
}

pub(super) fn run(common: &Common, command: &Command) -> Result<ExitCode, CliError> {
    check_name(&command.name)?;
    let catalogue = common.catalogue();
    if let Ok(taken) = catalogue.load(&command.name) {
        return Err(CliError::Usage(format!(
            "{}: the name of a plugin that is here already, {}; choose another",
            command.name,
            taken.path().display()
        )));
    }
    let folder = command.folder.clone().unwrap_or_else(|| PathBuf::from(&command.name));
    if folder.exists() {
        return Err(CliError::Usage(format!("{}: exists already; give another folder", folder.display())));
    }
    let platen = sources(command)?;
    let files = files(command, &platen);
    for File { name, text } in &files {
        let file = folder.join(name);
        let failed = |why| CliError::Failed(format!("{}: {why}; choose another folder", file.display()));
        file.parent().map_or(Ok(()), std::fs::create_dir_all).map_err(failed)?;
        std::fs::write(&file, text).map_err(failed)?;
    }
    if common.json {
        let names: Vec<&str> = files.iter().map(|file| file.name).collect();
        output::json(&serde_json::json!({ "folder": folder, "files": names }))?;
    } else {
        output::line(&format!("made {}; go on there:", folder.display()))?;
        let (build, library, _) = commands(command);
        output::line(&format!("  cd {}\n  {build}\n  platen plugins check {library}", folder.display()))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn check_name(name: &str) -> Result<(), CliError> {
    let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
    if name.starts_with(|c: char| c.is_ascii_lowercase()) && name.chars().all(plain) && !name.ends_with('-') {
        return Ok(());
    }
    Err(CliError::Usage(format!(
        "{name:?}: a plugin's name is of lower case letters, digits and hyphens, such as my-plugin"
    )))
}

/// Returns the folder of platen's sources, for a plugin in Rust.
fn sources(command: &Command) -> Result<PathBuf, CliError> {
    if command.lang != Language::Rust {
        return Ok(PathBuf::new());
    }
    let holds = |folder: &Path| folder.join("core/sdk/Cargo.toml").is_file();
    let program = std::env::current_exe().and_then(|file| file.canonicalize()).unwrap_or_default();
    // Built from its sources, or installed: /usr/bin/platen and /usr/share/platen/sources.
    let installed = program.ancestors().nth(2).map(|top| top.join("share/platen/sources"));
    let around = program.ancestors().map(Path::to_path_buf).chain(installed);
    let found = match &command.platen {
        Some(given) if holds(given) => given.canonicalize().ok(),
        Some(given) => return Err(CliError::Usage(format!("{}: no sources of platen", given.display()))),
        None => around.into_iter().find(|folder| holds(folder)),
    };
    found.ok_or_else(|| {
        CliError::Usage(
            "no sources of platen near this program; name them by --platen DIR, or take --lang c".to_owned(),
        )
    })
}

/// Returns the command that builds the plugin, its library, and the folder of the library.
fn commands(command: &Command) -> (&'static str, String, &'static str) {
    let file = format!("lib{}.so", command.name.replace('-', "_"));
    match command.lang {
        Language::Rust => ("cargo build --release", format!("target/release/{file}"), "target/release"),
        Language::C | Language::Cpp => ("make", format!("./{file}"), "."),
    }
}

fn files(command: &Command, platen: &Path) -> Vec<File> {
    let (name, text) = source(command.kind, command.lang);
    let (build, library, folder) = commands(command);
    let file = library.rsplit('/').next().unwrap_or_default().to_owned();
    let (kind, table, using) = match command.kind {
        Kind::Scanner => ("scanner", "[scanner]", "platen --plugins FOLDER scan plant.toml first.e57"),
        Kind::Flattening => ("flattening", "[flattening]", MEASURE),
        Kind::Comparison => ("comparison", "[[comparison]]", MEASURE),
    };
    let (language, compile, libraries) = match command.lang {
        Language::Rust => ("Rust", "", ""),
        Language::C => ("C", "cc -std=c11 -O2 -Wall -Wextra -shared -fPIC -fvisibility=hidden -I.", " -lm"),
        Language::Cpp => {
            ("C++", "c++ -std=c++17 -O2 -Wall -Wextra -shared -fPIC -fvisibility=hidden -I.", "")
        }
    };
    let features = match command.kind {
        Kind::Scanner => String::new(),
        Kind::Flattening | Kind::Comparison => format!(", features = [\"{kind}\"]"),
    };
    let filled = |text: &str| {
        // A JSON string literal is a valid TOML basic string.
        let platen = serde_json::Value::from(platen.join("core/sdk").to_string_lossy()).to_string();
        let using = using.replace("FOLDER", folder);
        [
            ("libmy_plugin", file.trim_end_matches(".so")),
            ("@USE@", &using),
            ("my-plugin", &command.name),
            ("@KIND@", kind),
            ("@TABLE@", table),
            ("@LANGUAGE@", language),
            ("@BUILD@", build),
            ("@LIBRARY@", library.trim_start_matches("./")),
            ("@FILE@", &file),
            ("@FOLDER@", folder),
            ("@SOURCE@", name),
            ("@COMPILE@", compile),
            ("@LIBRARIES@", libraries),
            ("@SDK@", &platen),
            ("@FEATURES@", &features),
        ]
        .iter()
        .fold(text.to_owned(), |text, (mark, value)| text.replace(mark, value))
    };
    let file = |name, text: &str| File { name, text: filled(text) };
    let mut files = vec![
        file(name, text),
        file("README.md", include_str!("new/README.md")),
        file("plant.toml", include_str!("new/plant.toml")),
    ];
    if command.kind != Kind::Scanner {
        files.push(file("plate.toml", include_str!("new/plate.toml")));
        files.push(file("simulated.toml", include_str!("new/simulated.toml")));
    }
    if command.lang == Language::Rust {
        files.push(file("Cargo.toml", include_str!("new/Cargo.toml.in")));
        files.push(file("tests/check.rs", include_str!("new/check.rs.in")));
        // The versions that platen was tested with.
        if let Ok(text) = std::fs::read_to_string(platen.join("Cargo.lock")) {
            files.push(File { name: "Cargo.lock", text });
        }
        return files;
    }
    files.push(file("Makefile", include_str!("new/Makefile")));
    let verbatim = |name, text: &str| File { name, text: text.to_owned() };
    files.push(verbatim("platen.h", HEADER));
    if command.lang == Language::Cpp {
        files.push(verbatim("platen.hpp", HEADER_CPP));
    }
    match command.kind {
        Kind::Scanner => {}
        Kind::Flattening => files.push(verbatim("harmonic_map.h", HARMONIC_MAP)),
        Kind::Comparison => files.push(verbatim("platen_surface.h", SURFACE)),
    }
    files
}
