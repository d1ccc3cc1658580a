//! `moiregauge convert`: scans from any readable into any writable format.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context as _, anyhow, bail, ensure};
use clap::ValueEnum;
use moiregauge::numbers::interrupt;
use moiregauge::survey::{nominal_geometry, on_grid};
use moiregauge_pipeline::sink::{FileSink, SinkError};
use moiregauge_pipeline::{Content, Job};
use rayon::prelude::*;
use spmfile::{ChannelInfo, Scan, WritableFormat, sensor_axis};

use crate::input::{Known, KnownArgs, is_named, with_option};
use crate::outputs;
use crate::paths::expand;
use crate::say::say;

/// Convert scans into formats of other programs: Gwyddion, NumPy, Zarr, TIFF, text
///
/// Everything the file tells is kept as far as the format can: channels, units, sizes, directions,
/// times, the header. One bad file never stops the others; the exit code tells. Nothing is written
/// over without --force.
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
    /// Files, folders or names with * and ?; the last one is what is written: a file whose extension
    /// tells the format, or with --to a folder
    #[arg(required = true, num_args = 2.., value_name = "PATH")]
    paths: Vec<PathBuf>,
    /// Format; OUT is then a folder, made if it does not exist, for any number of files
    #[arg(long, value_enum, value_name = "FORMAT")]
    to: Option<FormatArg>,
    /// Only this channel, by name; may be repeated
    #[arg(long, value_name = "NAME")]
    channel: Vec<String>,
    /// Turn images into laboratory axes by the rotation of the frame: resampled by cubic convolution,
    /// missing outside the frame; position sensors are left out
    #[arg(long)]
    rotate_to_lab: bool,
    /// Write over files that exist
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
        bail!("expected files to convert and what to write");
    };
    let (mut inputs, mut failed) = (Vec::new(), Vec::new());
    for path in expand(paths, !args.quiet) {
        match path {
            Ok(path) => inputs.push(path),
            Err(one) => failed.push(format!("{}: {}", one.file, one.error)),
        }
    }
    let format = format(args, out, inputs.len() + failed.len())?;
    let folder = if args.to.is_some() {
        out
    } else {
        out.parent().unwrap_or(Path::new(""))
    };
    let protected: Vec<PathBuf> = inputs
        .iter()
        .chain(args.known.second_file())
        .cloned()
        .collect();
    let target = Target {
        args,
        out,
        format,
        known: args.known.of(&inputs),
        sink: outputs::files(folder, args.force, &protected)?,
    };
    target.can_be_written()?;
    let written = target.convert_all(&inputs, folder, job);
    let (mut files, mut scans) = (Vec::new(), 0);
    for (path, result) in inputs.iter().zip(written) {
        match result {
            Ok(names) => {
                scans += 1;
                files.extend(names);
            }
            Err(error) => failed.push(format!("{}: {error:#}", path.display())),
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

/// Where and how files are written.
struct Target<'a> {
    args: &'a ConvertArgs,
    out: &'a Path,
    format: WritableFormat,
    known: Known,
    sink: FileSink,
}

impl Target<'_> {
    /// Converts all files; returns what each became.
    fn convert_all(
        &self,
        inputs: &[PathBuf],
        folder: &Path,
        job: &Job,
    ) -> Vec<anyhow::Result<Vec<PathBuf>>> {
        // Before anything runs in parallel: which of two files of one name is first must not depend on it.
        let mut taken = HashSet::new();
        let jobs: Vec<(&PathBuf, String, bool)> = inputs
            .iter()
            .map(|path| {
                let stem = self.stem(path);
                let new = taken.insert(stem.to_lowercase());
                (path, stem, new)
            })
            .collect();
        let stage = job.stage("converting", "files", inputs.len());
        let written: Vec<anyhow::Result<Vec<PathBuf>>> = jobs
            .par_iter()
            .map(|(path, stem, new)| {
                interrupt::check();
                let result = if *new {
                    self.convert(path, stem)
                } else {
                    let name = folder.join(stem);
                    Err(anyhow!(
                        "another file of this run already becomes {}",
                        name.display()
                    ))
                };
                stage.step();
                result
            })
            .collect();
        drop(stage);
        written
    }

    /// Converts one file; returns what was written.
    fn convert(&self, path: &Path, stem: &str) -> anyhow::Result<Vec<PathBuf>> {
        let content = Content::read(path)?;
        let is_wanted = |info: &ChannelInfo| {
            let points = self.format == WritableFormat::Gxyzf;
            let names = &self.args.channel;
            names.is_empty()
                || names.iter().any(|name| is_named(&info.name, name))
                || (points && sensor_axis(&info.name, &info.internal_name).is_some())
        };
        let read = self.known.read(path, &content, &is_wanted);
        let (mut scan, replaced) = read.map_err(with_option)?;
        self.channels_are_there(&scan)?;
        let mut log = vec![format!(
            "converted by moiregauge {} from {}",
            env!("CARGO_PKG_VERSION"),
            path.file_name().unwrap_or_default().to_string_lossy()
        )];
        log.extend(replaced);
        log.extend(scan.notes.iter().cloned());
        if self.args.rotate_to_lab {
            scan = turned(&scan)?;
            log.push("turned into laboratory axes by cubic convolution".to_owned());
        }
        let files = spmfile::write(&scan, self.format, stem, &log)?;
        self.write(stem, files).map_err(outputs::hinted)
    }

    /// Stem of what a file becomes.
    fn stem(&self, path: &Path) -> String {
        if self.args.to.is_some() {
            return stem_of(path);
        }
        let stem = self.out.file_stem().unwrap_or_default();
        stem.to_string_lossy().into_owned()
    }

    /// Finds out before the work whether the one file that was asked for may be written.
    fn can_be_written(&self) -> anyhow::Result<()> {
        let Some(name) = self.out.file_name().filter(|_| self.args.to.is_none()) else {
            return Ok(());
        };
        let checked = match self.format {
            WritableFormat::Zarr => self.sink.check_group(Path::new(name)),
            // Named by their channels or lines.
            WritableFormat::Gsf | WritableFormat::Csv | WritableFormat::Gxyzf => Ok(()),
            _ => self.sink.check(Path::new(name)),
        };
        checked.map_err(outputs::hinted)
    }

    fn channels_are_there(&self, scan: &Scan) -> anyhow::Result<()> {
        for name in &self.args.channel {
            let there = scan.channels.iter().any(|c| is_named(&c.name, name));
            ensure!(there, "no channel {name:?}");
        }
        Ok(())
    }

    fn write(&self, stem: &str, files: Vec<(String, Vec<u8>)>) -> Result<Vec<PathBuf>, SinkError> {
        let plain = format!("{stem}.{}", self.format.extension());
        // `OUT.tif` is written as it was asked for.
        let asked = self.out.file_name().filter(|_| self.args.to.is_none());
        let named = |name: String| match asked {
            Some(asked) if name == plain => PathBuf::from(asked),
            _ => PathBuf::from(name),
        };
        if self.format != WritableFormat::Zarr {
            let files = files.into_iter().map(|(name, bytes)| (named(name), bytes));
            return self.sink.write(&files.collect::<Vec<_>>());
        }
        let inside = |name: String| name[plain.len() + 1..].to_owned();
        let files = files.into_iter().map(|(name, bytes)| (inside(name), bytes));
        let group = named(plain.clone());
        let written = self.sink.write_group(&group, &files.collect::<Vec<_>>())?;
        Ok(vec![written])
    }
}

/// The name of a file without its extension, unless that is a number, `scan.012` being one of many, or that of
/// a channel, as in `scan.Z_mtrx`.
pub(crate) fn stem_of(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    if let Some(channel) = name.strip_suffix("_mtrx") {
        return channel.to_owned();
    }
    match name.rsplit_once('.') {
        Some((stem, extension))
            if !stem.is_empty() && !extension.bytes().all(|b| b.is_ascii_digit()) =>
        {
            stem.to_owned()
        }
        _ => name.into_owned(),
    }
}

/// Every image in laboratory axes.
fn turned(scan: &Scan) -> anyhow::Result<Scan> {
    let mut out: Option<Scan> = None;
    for channel in &scan.channels {
        if sensor_axis(&channel.name, &channel.internal_name).is_some() {
            continue;
        }
        let geometry = nominal_geometry(scan, channel)
            .context("--rotate-to-lab needs the size of the image; give it with --size")?;
        let turned = on_grid(scan, channel, &geometry)
            .with_context(|| format!("channel {:?} cannot be turned", channel.name))?;
        match &mut out {
            Some(out) => out.channels.extend(turned.channels),
            None => {
                out = Some(Scan {
                    notes: scan.notes.clone(),
                    metadata: scan.metadata.clone(),
                    ..turned
                });
            }
        }
    }
    out.context("there is no channel but the position sensors")
}
