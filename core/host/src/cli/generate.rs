//! Command `platen generate`: man pages and shell completions from the definitions of the command line.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Command as Clap, Subcommand};
use clap_complete::Shell;

use super::{CliError, Common, output};

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  platen generate man /usr/local/share/man/man1\n  \
                        platen generate completions bash > /usr/share/bash-completion/completions/platen\n  \
                        platen generate completions zsh > /usr/share/zsh/site-functions/_platen\n  \
                        platen generate completions fish > /usr/share/fish/vendor_completions.d/platen.fish")]
pub(super) struct Command {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Write a man page for every verb and sub-verb
    Man {
        /// Folder for the pages, made if missing
        folder: PathBuf,
    },
    /// Print the completions of a shell
    Completions {
        /// Name of the shell
        shell: Shell,
    },
}

pub(super) fn run(common: &Common, command: &Command, mut clap: Clap) -> Result<ExitCode, CliError> {
    match &command.verb {
        Verb::Man { folder } => {
            let failed = |e| CliError::Failed(format!("{}: {e}; choose another folder", folder.display()));
            std::fs::create_dir_all(folder)
                .and_then(|()| clap_mangen::generate_to(clap, folder))
                .map_err(failed)?;
            let text = format!("wrote {}; man -l {0}/platen.1 shows the first page", folder.display());
            output::either(common, &serde_json::json!({ "folder": folder }), &text)?;
        }
        Verb::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(*shell, &mut clap, "platen", &mut script);
            output::line(String::from_utf8_lossy(&script).trim_end())?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;
    use clap_complete::Shell;

    use crate::cli::Cli;

    fn verbs(command: &clap::Command, found: &mut Vec<clap::Command>) {
        found.push(command.clone());
        command.get_subcommands().filter(|verb| !verb.is_hide_set()).for_each(|verb| verbs(verb, found));
    }

    #[test]
    fn every_verb_has_a_page_with_its_examples() {
        let folder = tempfile::tempdir().unwrap();
        let mut cli = Cli::command().disable_help_subcommand(true);
        clap_mangen::generate_to(cli.clone(), folder.path()).unwrap();
        cli.build();
        let mut all = Vec::new();
        verbs(&cli, &mut all);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), all.len());
        for verb in all {
            let name = verb.get_display_name().unwrap_or(verb.get_name());
            let page = std::fs::read_to_string(folder.path().join(format!("{name}.1"))).unwrap();
            let page = page.replace("\\-", "-").replace("\\&", "").replace("\\*(Aq", "'");
            let help = verb.get_after_help().map(ToString::to_string).unwrap_or_default();
            for example in help.lines().filter(|line| line.starts_with("  ")) {
                assert!(page.contains(example), "{name}: {example}\n{page}");
            }
            assert!(page.contains(&verb.get_about().unwrap().to_string()), "{name}");
        }
        assert!(folder.path().join("platen-bench.1").is_file());
        assert!(folder.path().join("platen-press-soak.1").is_file());
    }

    #[test]
    fn every_shell_completes_every_verb() {
        for shell in [Shell::Bash, Shell::Zsh, Shell::Fish] {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), "platen", &mut script);
            let script = String::from_utf8(script).unwrap();
            for verb in Cli::command().get_subcommands() {
                assert!(script.contains(verb.get_name()), "{shell}: {}", verb.get_name());
            }
        }
    }
}
