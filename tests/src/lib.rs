//! Helpers of the tests: builds the workspace once, finds programs, libraries and files; unpacks samples.

pub mod samples;

use std::net::{SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// Returns the folder of the repository.
pub fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").canonicalize().unwrap_or_else(|_| "..".into())
}

/// Returns an address at which no program listens, over TCP or UDP. It is not 127.0.0.1, where a released port may
/// belong to the server of another test a moment later.
pub fn unserved_address() -> std::io::Result<SocketAddr> {
    TcpListener::bind("127.0.0.77:0")?.local_addr()
}

/// Returns the folder of the programs and plugin libraries of this build, all of them up to date.
///
/// `cargo test` builds no cdylib and no program of other members, so the first caller builds the workspace in
/// the profile of the running test.
pub fn built() -> &'static Path {
    static BUILT: OnceLock<PathBuf> = OnceLock::new();
    BUILT.get_or_init(|| {
        let test = std::env::current_exe().unwrap_or_default();
        let folder = test.ancestors().nth(2).unwrap_or(Path::new("")).to_path_buf();
        let profile = if folder.ends_with("debug") { "dev" } else { "release" };
        let status = cargo()
            .args(["build", "--quiet", "--workspace", "--profile", profile])
            .current_dir(repository())
            .status();
        assert!(status.is_ok_and(|s| s.success()), "the workspace does not build");
        folder
    })
}

/// Returns cargo without the variables that the outer cargo sets for this package. They would make ring's build script
/// run again, and everything that depends on TLS would be compiled twice.
pub fn cargo() -> Command {
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    let of_package = |name: &str| name.starts_with("CARGO_MANIFEST_") || name.starts_with("CARGO_PKG_");
    for (name, _) in std::env::vars_os().filter(|(name, _)| name.to_str().is_some_and(of_package)) {
        cargo.env_remove(name);
    }
    cargo
}

/// Returns a program of this build, with an empty log setting.
pub fn program(name: &str) -> Command {
    let mut command = Command::new(built().join(name));
    command.env_remove("PLATEN_LOG").current_dir(repository());
    command
}

/// Returns a plugin library of this build.
pub fn library(name: &str) -> PathBuf {
    let file =
        format!("{}{}{}", std::env::consts::DLL_PREFIX, name.replace('-', "_"), std::env::consts::DLL_SUFFIX);
    built().join(file)
}

/// Compiles a C file against the plugin header: a program, or with `-shared -fPIC` a library.
pub fn compile_c(source: &Path, out: &Path, arguments: &[&str]) {
    let include = repository().join("core/abi/include");
    let status = Command::new("cc")
        .args(["-std=c11", "-Wall", "-Wextra", "-Werror", "-O1", "-I"])
        .arg(include)
        .args(arguments)
        .arg("-o")
        .arg(out)
        .arg(source)
        .arg("-lm")
        .status();
    assert!(status.is_ok_and(|s| s.success()), "cc {}", source.display());
}

/// Returns a C source of the tests.
pub fn c_source(name: &str) -> PathBuf {
    repository().join("tests/contract").join(name)
}

/// Puts a faulty plugin into `folder` in place of the project's `name`. It forwards all calls to the original, and does
/// `fault` in the call `place` of jobs at `stroke`, or of every job for 0 (`tests/contract/faulty.c`). At the place
/// `word`, `fault` damages the emitted output.
pub fn faulty(folder: &Path, name: &str, place: &str, fault: &str, stroke: u32) {
    let (fault, spoil) = if place == "word" { ("none", fault) } else { (fault, "as_it_is") };
    let (place, fault, described) =
        if place == "desc" { ("word", "none", fault) } else { (place, fault, "as_described") };
    let target = library(name);
    assert!(std::fs::create_dir_all(folder).is_ok());
    // Written beside its final place, then renamed: a host may be loading it.
    let new = folder.join("new.so");
    let defines = [
        format!("-DTARGET=\"{}\"", target.display()),
        format!("-DWHERE={place}"),
        format!("-DFAULT={fault}"),
        format!("-DSPOIL={spoil}"),
        format!("-DSPOIL_DESC={described}"),
        format!("-DSTROKE={stroke}"),
    ];
    let arguments = ["-shared", "-fPIC", "-w"].into_iter().chain(defines.iter().map(String::as_str));
    compile_c(&c_source("faulty.c"), &new, &arguments.collect::<Vec<_>>());
    let place = target.file_name().map(|name| folder.join(name));
    assert!(place.is_some_and(|place| std::fs::rename(new, place).is_ok()));
}
