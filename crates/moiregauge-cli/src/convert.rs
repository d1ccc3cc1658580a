//! `moiregauge convert`: scans from any readable into any writable format.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context as _, bail, ensure};
use clap::ValueEnum;
use moiregauge_pipeline::Job;
use moiregauge_pipeline::convert::{
    ConvertError, ConvertRequest, ConvertSink, ConvertTo, convert_files,
};
use spmfile::WritableFormat;

use crate::input::{KnownArgs, with_option};
use crate::outputs::hinted;
use crate::paths::expand;
use crate::say::say;

/// Convert scans into formats of other programs: Gwyddion, NumPy, Zarr, TIFF, text
///
/// All that the file holds is kept as far as the format allows: channels, units, sizes, directions, times, the header.
/// A bad file does not stop the others; the exit code is then not 0. Existing files are replaced only with --force.
#[derive(clap::Args, Clone, Debug)]
#[command(
    override_usage = "moiregauge convert [OPTIONS] <IN>... <OUT>",
    after_long_help = "\
Formats (--to, or the extension of OUT):
  gwy    Gwyddion container, all channels
  gsf    Gwyddion simple field, a file per channel
  gxyzf  Gwyddion XYZ field, points where the position sensors were, a file per line direction
  npz    archive of NumPy arrays, all channels, top line first, with x_nm and y_nm
  zarr   Zarr 3 group with named dimensions and coordinates, y upwards; opens in xarray
  tiff   32-bit pictures, all channels, resolution as ImageJ reads it
  csv    matrix as text, a file per channel

Examples:
  moiregauge convert scan.spm scan.gwy
  moiregauge convert scans/ '*.sxm' converted --to npz
  moiregauge convert scan.000 phase.tiff --channel 'TR Phase'
  moiregauge convert picture.png picture.gwy --size 70nm×70nm"
)]
pub(crate) struct ConvertArgs {
    /// Files, folders or names with * and ?. The last one is the output: a file whose extension gives the format, or
    /// with --to a folder
    #[arg(required = true, num_args = 2.., value_name = "PATH")]
    paths: Vec<PathBuf>,
    /// Format; OUT is then a folder for any number of files, created if it does not exist
    #[arg(long, value_enum, value_name = "FORMAT")]
    to: Option<FormatArg>,
    /// Only this channel, by name; may be repeated
    #[arg(long, value_name = "NAME")]
    channel: Vec<String>,
    /// Turn images into laboratory axes by the rotation of the frame. They are resampled by cubic convolution; pixels
    /// outside the frame are missing; position sensors are left out
    #[arg(long)]
    rotate_to_lab: bool,
    /// Replace files that exist
    #[arg(long)]
    force: bool,
    /// Print nothing but errors
    #[arg(long, short)]
    pub(crate) quiet: bool,
    #[command(flatten)]
    known: KnownArgs,
}

/// The writable formats as the command line names them.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum FormatArg {
    Gwy,
    Gsf,
    Gxyzf,
    Npz,
    Zarr,
    Tiff,
    Csv,
}

impl From<FormatArg> for WritableFormat {
    fn from(format: FormatArg) -> Self {
        match format {
            FormatArg::Gwy => Self::Gwy,
            FormatArg::Gsf => Self::Gsf,
            FormatArg::Gxyzf => Self::Gxyzf,
            FormatArg::Npz => Self::Npz,
            FormatArg::Zarr => Self::Zarr,
            FormatArg::Tiff => Self::Tiff,
            FormatArg::Csv => Self::Csv,
        }
    }
}

/// The format that the extension of a name tells.
pub(crate) fn format_of(path: &Path) -> anyhow::Result<WritableFormat> {
    let extension = path.extension().map(|e| e.to_string_lossy().into_owned());
    let format = extension
        .as_deref()
        .and_then(WritableFormat::from_extension);
    let known: Vec<&str> = WritableFormat::ALL.iter().map(|f| f.extension()).collect();
    format.with_context(|| {
        format!(
            "{}: expected one of the extensions {}, or --to FORMAT with a folder",
            path.display(),
            known.join(", ")
        )
    })
}

/// Converts the files.
pub(crate) fn run(args: &ConvertArgs, job: &Job) -> anyhow::Result<ExitCode> {
    let Some((out, paths)) = args
        .paths
        .split_last()
        .filter(|(_, paths)| !paths.is_empty())
    else {
        bail!("expected the files to convert and the file to write");
    };
    let (mut inputs, mut failed) = (Vec::new(), Vec::new());
    for path in expand(paths, !args.quiet) {
        match path {
            Ok(path) => inputs.push(path),
            Err(one) => failed.push(format!("{}: {}", one.file, one.error)),
        }
    }
    let format = format(args, out, inputs.len() + failed.len())?;
    let to = if args.to.is_some() {
        ConvertTo::Folder(out.clone())
    } else {
        ConvertTo::File(out.clone())
    };
    let protected: Vec<PathBuf> = inputs
        .iter()
        .chain(args.known.second_file())
        .cloned()
        .collect();
    let sink = ConvertSink::open(&to, format, args.force, &protected).map_err(hinted)?;
    let request = ConvertRequest {
        format,
        channels: args.channel.clone(),
        rotate_to_lab: args.rotate_to_lab,
    };
    let written = convert_files(&inputs, &args.known.of(&inputs), &request, &sink, job)?;
    let (mut files, mut scans) = (Vec::new(), 0);
    for (path, result) in inputs.iter().zip(written) {
        match result {
            Ok(names) => {
                scans += 1;
                files.extend(names);
            }
            Err(error) => failed.push(format!("{}: {:#}", path.display(), with_hint(error))),
        }
    }
    if !args.quiet && scans > 0 {
        say(&in_words(out, scans, &files))?;
    }
    for error in &failed {
        eprintln!("error: {error}");
    }
    Ok(if failed.is_empty() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

/// The format that is asked for, and an error if the output does not fit it or that many files.
fn format(args: &ConvertArgs, out: &Path, files: usize) -> anyhow::Result<WritableFormat> {
    if let Some(format) = args.to {
        ensure!(
            !out.is_file(),
            "{} is a file; with --to a folder is expected",
            out.display()
        );
        return Ok(format.into());
    }
    let format = format_of(out)?;
    ensure!(
        files == 1,
        "{} is one file but there are {files}; give a folder and --to {}",
        out.display(),
        format.extension()
    );
    Ok(format)
}

/// What was written.
fn in_words(out: &Path, scans: usize, files: &[PathBuf]) -> String {
    let first = files.first().map_or(out, PathBuf::as_path);
    let more = match files.len() {
        0 | 1 => String::new(),
        count => format!(" and {} more", count - 1),
    };
    let scans = if scans == 1 {
        "1 scan".to_owned()
    } else {
        format!("{scans} scans")
    };
    format!("{scans} written to {}{more}\n", first.display())
}

/// The error, with the option that helps against it.
fn with_hint(error: ConvertError) -> anyhow::Error {
    match error {
        ConvertError::Known(error) => with_option(error),
        ConvertError::Sink(error) => hinted(error),
        ConvertError::NoSize => {
            anyhow::anyhow!("--rotate-to-lab needs the size of the image; give it with --size")
        }
        other => other.into(),
    }
}
