//! The run: files → what they hold, printed.

use std::io::{ErrorKind, Write as _};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use moiregauge_pipeline::inspect::{FileInfo, Pixel};
use moiregauge_pipeline::{Known, inspect};

use super::table::table;

use crate::errors::advice;
use crate::input::KnownArgs;
use crate::paths::expand;

/// Show what scan files hold: channels, units, sizes, directions, scaling
///
/// Reads each file and prints its channels with their statistics, how counts become values, and
/// what is missing for the moiré analysis. Of a damaged file the readable part is shown; the exit code is then not 0.
#[derive(clap::Args, Clone, Debug)]
#[command(after_long_help = "\
Examples:
  moiregauge info scan.spm
  moiregauge info folder/                    all scans of a folder
  moiregauge info 'scan.0_*.spm' --json      one JSON object per file, in a list
  moiregauge info scan.spm --at 0,0 --at 255,128")]
pub(crate) struct InfoArgs {
    /// Scan files, folders (the scans in them, without subfolders) or names with * and ?
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Print a JSON list with one object per file, also for a single file
    #[arg(long)]
    json: bool,
    /// Print the value at a pixel too; row 0 is the top line; may be repeated
    #[arg(long, value_name = "ROW,COL", value_parser = parse_pixel)]
    at: Vec<Pixel>,
    #[command(flatten)]
    known: KnownArgs,
}

/// Prints the files; the exit code tells whether all of them could be read.
///
/// # Errors
/// If the output cannot be written.
pub(crate) fn run(args: &InfoArgs) -> anyhow::Result<ExitCode> {
    let mut infos = Vec::new();
    let files = expand(&args.files, !args.json);
    let paths: Vec<PathBuf> = files.iter().flatten().cloned().collect();
    let known = args.known.of(&paths);
    for file in files {
        let info = match file {
            Ok(path) => file_info(&path, &args.at, &known),
            Err(failed) => FileInfo {
                file: failed.file,
                error: Some(failed.error),
                scan: None,
            },
        };
        infos.push(info);
    }
    let text = if args.json {
        serde_json::to_string_pretty(&infos)? + "\n"
    } else {
        infos.iter().map(table).collect::<Vec<_>>().join("\n")
    };
    match std::io::stdout().lock().write_all(text.as_bytes()) {
        // The reader of a pipe may stop early, as `head` does.
        Err(error) if error.kind() != ErrorKind::BrokenPipe => return Err(error.into()),
        _ => {}
    }
    let mut failed = false;
    for info in &infos {
        if let Some(error) = &info.error {
            failed = true;
            eprintln!("error: {}: {error}", info.file);
        }
    }
    Ok(if failed {
        ExitCode::FAILURE
    } else {
        ExitCode::SUCCESS
    })
}

/// What a file holds, with the options that help.
fn file_info(path: &Path, at: &[Pixel], known: &Known) -> FileInfo {
    let mut info = inspect(path, known, at, advice);
    if let Some(scan) = &mut info.scan {
        let outside = scan.outside(at).map(|outside| format!("--at {outside}"));
        info.error = info.error.or(outside);
        for note in scan.notes.iter_mut().rev().take(scan.notes_on_choice) {
            *note += " (--channel NAME and --image N of analyze say which one is)";
        }
    }
    info
}

fn parse_pixel(text: &str) -> Result<Pixel, String> {
    let parsed = || {
        let (row, column) = text.split_once(',')?;
        Some(Pixel {
            row: row.trim().parse().ok()?,
            column: column.trim().parse().ok()?,
        })
    };
    parsed().ok_or_else(|| "expected ROW,COL as two whole numbers, as in 0,511".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_are_two_whole_numbers() {
        assert_eq!(
            parse_pixel("3, 511"),
            Ok(Pixel {
                row: 3,
                column: 511
            })
        );
        for wrong in ["", "3", "3;4", "-1,2", "1,2,3", "a,b"] {
            assert!(parse_pixel(wrong).is_err(), "{wrong}");
        }
    }
}
