//! What shells and manuals want to know of the options.

use std::process::ExitCode;

use anyhow::Context as _;

use crate::say::say;

/// Print the completions of a shell
///
/// With bash: `moiregauge completions bash > ~/.local/share/bash-completion/completions/moiregauge`; with other shells,
/// save them where the shell looks for completions.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct CompletionsArgs {
    /// The shell
    #[arg(value_enum)]
    shell: clap_complete::Shell,
}

/// Print the manual page of the program, or of one of its commands
///
/// `moiregauge man | man -l -` shows it; `moiregauge man analyze > moiregauge-analyze.1` keeps it.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct ManArgs {
    /// The command
    command: Option<String>,
}

/// Prints the completions.
pub(crate) fn completions(
    args: &CompletionsArgs,
    mut program: clap::Command,
) -> anyhow::Result<ExitCode> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut program, "moiregauge", &mut script);
    say(&String::from_utf8(script)?)?;
    Ok(ExitCode::SUCCESS)
}

/// Prints the page.
pub(crate) fn man(args: &ManArgs, program: clap::Command) -> anyhow::Result<ExitCode> {
    let mut program = program.name("moiregauge");
    program.build();
    let page = match &args.command {
        None => program,
        Some(name) => {
            let found = program.find_subcommand(name).cloned();
            let command =
                found.with_context(|| format!("there is no command {name:?}; see --help"))?;
            command.display_name(format!("moiregauge-{name}"))
        }
    };
    let mut text = Vec::new();
    clap_mangen::Man::new(page).render(&mut text)?;
    say(&String::from_utf8(text)?)?;
    Ok(ExitCode::SUCCESS)
}
