//! The `moiregauge` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    moiregauge_cli::program(std::env::args_os().collect())
}
