//! Helpers of the tests: builds the workspace once, finds programs, libraries and files; unpacks samples.

pub mod samples;

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// The repository.
pub fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").canonicalize().unwrap_or_else(|_| "..".into())
}

/// Folder of the programs and plugin libraries of this build, all of them fresh.
///
/// `cargo test` builds no cdylib and no program of other members, so the first caller builds the workspace in
/// the profile of the running test.
pub fn built() -> &'static Path {
    static BUILT: OnceLock<PathBuf> = OnceLock::new();
    BUILT.get_or_init(|| {
        let test = std::env::current_exe().unwrap_or_default();
        let folder = test.ancestors().nth(2).unwrap_or(Path::new("")).to_path_buf();
        let profile = if folder.ends_with("debug") { "dev" } else { "release" };
        let status = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
            .args(["build", "--quiet", "--workspace", "--profile", profile])
            .current_dir(repository())
            .status();
        assert!(status.is_ok_and(|s| s.success()), "the workspace does not build");
        folder
    })
}

/// A program of this build, with a clean log setting.
pub fn program(name: &str) -> Command {
    let mut command = Command::new(built().join(name));
    command.env_remove("PLATEN_LOG").current_dir(repository());
    command
}

/// A plugin library of this build.
pub fn library(name: &str) -> PathBuf {
    let file =
        format!("{}{}{}", std::env::consts::DLL_PREFIX, name.replace('-', "_"), std::env::consts::DLL_SUFFIX);
    built().join(file)
}
