//! Scans from any readable into any writable format.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use moiregauge::numbers::interrupt;
use moiregauge::survey::{nominal_geometry, on_grid};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use spmfile::{ChannelInfo, ExportError, Scan, WritableFormat, sensor_axis};

use crate::job::{Cancelled, Job};
use crate::known::{Known, KnownError, is_named};
use crate::reading::FileError;
use crate::sink::{FileSink, SinkError};

/// How scans are converted.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConvertRequest {
    /// The format, by its extension.
    #[serde(with = "by_extension")]
    pub format: WritableFormat,
    /// Only these channels, by name; all where none is named.
    #[serde(default)]
    pub channels: Vec<String>,
    /// Turn images into laboratory axes by the rotation of the frame: resampled by cubic convolution, missing outside
    /// the frame; position sensors are left out.
    #[serde(default)]
    pub rotate_to_lab: bool,
}

/// Formats by their extensions.
mod by_extension {
    use serde::de::Error as _;
    use serde::{Deserialize as _, Deserializer, Serializer};
    use spmfile::WritableFormat;

    // Serde hands every field over by reference.
    #[allow(clippy::trivially_copy_pass_by_ref)]
    pub(super) fn serialize<S: Serializer>(
        format: &WritableFormat,
        to: S,
    ) -> Result<S::Ok, S::Error> {
        to.serialize_str(format.extension())
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(
        from: D,
    ) -> Result<WritableFormat, D::Error> {
        let extension = String::deserialize(from)?;
        WritableFormat::from_extension(&extension).ok_or_else(|| {
            let known = WritableFormat::ALL.map(WritableFormat::extension);
            let known = known.join(", ");
            D::Error::custom(format!("expected one of {known}, found {extension:?}"))
        })
    }
}

/// Where converted files go.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ConvertTo {
    /// One scan into a file of this name, or, in formats of one file a channel, into several named after it.
    File(PathBuf),
    /// Any number of scans into a folder, made if it does not exist.
    Folder(PathBuf),
}

/// Why a scan is not converted.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConvertError {
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// It is no scan, or does not hold what was told of it.
    #[error(transparent)]
    Known(#[from] KnownError),
    /// A channel that is not there.
    #[error("no channel {0:?}")]
    NoChannel(String),
    /// It has no size.
    #[error("an image can be turned only if its size is known")]
    NoSize,
    /// It has no area.
    #[error("channel {0:?} cannot be turned")]
    NotTurned(String),
    /// There is nothing to be turned.
    #[error("there is no channel except the position sensors")]
    NoImage,
    /// The format cannot hold it.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// Two scans of one name.
    #[error("another file of this run already becomes {}", .0.display())]
    Taken(PathBuf),
    /// It cannot be written.
    #[error(transparent)]
    Sink(#[from] SinkError),
}

impl ConvertRequest {
    /// All channels, as they are.
    #[must_use]
    pub fn new(format: WritableFormat) -> Self {
        Self {
            format,
            channels: Vec::new(),
            rotate_to_lab: false,
        }
    }
}

/// Converts one scan into files with their names, which begin with `stem`.
///
/// # Errors
/// [`ConvertError`].
///
/// ```no_run
/// use moiregauge_pipeline::convert::{ConvertRequest, convert};
/// use moiregauge_pipeline::Known;
/// use spmfile::WritableFormat;
///
/// let request = ConvertRequest::new(WritableFormat::Npz);
/// for (name, bytes) in convert("scan.spm".as_ref(), &Known::default(), &request, "scan")? {
///     std::fs::write(name, bytes)?;
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn convert(
    path: &Path,
    known: &Known,
    request: &ConvertRequest,
    stem: &str,
) -> Result<Vec<(String, Vec<u8>)>, ConvertError> {
    let content = known.source(path).content()?;
    let is_wanted = |info: &ChannelInfo| {
        let points = request.format == WritableFormat::Gxyzf;
        let names = &request.channels;
        names.is_empty()
            || names.iter().any(|name| is_named(&info.name, name))
            || (points && sensor_axis(&info.name, &info.internal_name).is_some())
    };
    let (mut scan, replaced) = known.read(path, &content, &is_wanted)?;
    for name in &request.channels {
        if !scan.channels.iter().any(|c| is_named(&c.name, name)) {
            return Err(ConvertError::NoChannel(name.clone()));
        }
    }
    let mut log = vec![format!(
        "converted by moiregauge {} from {}",
        env!("CARGO_PKG_VERSION"),
        path.file_name().unwrap_or_default().to_string_lossy()
    )];
    log.extend(replaced);
    log.extend(scan.notes.iter().cloned());
    if request.rotate_to_lab {
        scan = turned(&scan)?;
        log.push("turned into laboratory axes by cubic convolution".to_owned());
    }
    let files = spmfile::write_between(&scan, request.format, stem, &log, &interrupt::check)?;
    Ok(files)
}

/// Converts scans, and writes what they become. One bad scan does not stop the others: the answers, in the order of the
/// scans, are what each became.
///
/// # Errors
/// [`Cancelled`].
pub fn convert_files(
    files: &[PathBuf],
    known: &Known,
    request: &ConvertRequest,
    target: &ConvertSink,
    job: &Job,
) -> Result<Vec<Result<Vec<PathBuf>, ConvertError>>, Cancelled> {
    // Before anything runs in parallel: which of two files of one name is first must not depend on it.
    let mut taken = HashSet::new();
    let jobs: Vec<(&PathBuf, String, bool)> = files
        .iter()
        .map(|path| {
            let stem = target.stem(path);
            let new = taken.insert(stem.to_lowercase());
            (path, stem, new)
        })
        .collect();
    let stage = job.stage("converting", "files", files.len());
    let one = |(path, stem, new): &(&PathBuf, String, bool)| {
        interrupt::check();
        let result = if *new {
            convert(path, known, request, stem).and_then(|files| Ok(target.write(stem, files)?))
        } else {
            Err(ConvertError::Taken(target.to.folder().join(stem)))
        };
        stage.step();
        result
    };
    job.run(|| jobs.par_iter().map(one).collect())
}

/// Where converted files are written.
#[derive(Debug)]
pub struct ConvertSink {
    to: ConvertTo,
    format: WritableFormat,
    sink: FileSink,
}

impl ConvertTo {
    fn folder(&self) -> &Path {
        match self {
            Self::File(file) => file.parent().unwrap_or(Path::new("")),
            Self::Folder(folder) => folder,
        }
    }

    /// The name of the one file that is asked for.
    fn name(&self) -> Option<&Path> {
        match self {
            Self::File(file) => file.file_name().map(Path::new),
            Self::Folder(_) => None,
        }
    }
}

impl ConvertSink {
    /// Makes the folder ready before the work, and finds out whether the one file that is asked for may be written.
    /// Nothing is written over without `force`, and `protected` files never are.
    ///
    /// # Errors
    /// [`SinkError`].
    pub fn open(
        to: &ConvertTo,
        format: WritableFormat,
        force: bool,
        protected: &[PathBuf],
    ) -> Result<Self, SinkError> {
        let sink = FileSink::open(to.folder(), force, protected)?;
        if let Some(name) = to.name() {
            match format {
                WritableFormat::Zarr => sink.check_group(name)?,
                // Named by their channels or lines.
                WritableFormat::Gsf | WritableFormat::Csv | WritableFormat::Gxyzf => {}
                _ => sink.check(name)?,
            }
        }
        Ok(Self {
            to: to.clone(),
            format,
            sink,
        })
    }

    /// Stem of what a file becomes.
    fn stem(&self, path: &Path) -> String {
        match &self.to {
            ConvertTo::Folder(_) => stem_of(path),
            ConvertTo::File(file) => {
                let stem = file.file_stem().unwrap_or_default();
                stem.to_string_lossy().into_owned()
            }
        }
    }

    fn write(&self, stem: &str, files: Vec<(String, Vec<u8>)>) -> Result<Vec<PathBuf>, SinkError> {
        let plain = format!("{stem}.{}", self.format.extension());
        // `OUT.tif` is written as it was asked for.
        let named = |name: String| match self.to.name() {
            Some(asked) if name == plain => asked.to_owned(),
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
fn stem_of(path: &Path) -> String {
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
fn turned(scan: &Scan) -> Result<Scan, ConvertError> {
    let mut out: Option<Scan> = None;
    for channel in &scan.channels {
        if sensor_axis(&channel.name, &channel.internal_name).is_some() {
            continue;
        }
        let geometry = nominal_geometry(scan, channel).ok_or(ConvertError::NoSize)?;
        let turned = on_grid(scan, channel, &geometry)
            .ok_or_else(|| ConvertError::NotTurned(channel.name.clone()))?;
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
    out.ok_or(ConvertError::NoImage)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stems_are_names_without_extension() {
        let of = |name: &str| stem_of(Path::new(name));
        assert_eq!(of("a/scan.spm"), "scan");
        assert_eq!(of("scan.012"), "scan.012");
        assert_eq!(of("x--1_1.Z_mtrx"), "x--1_1.Z");
    }

    #[test]
    fn formats_are_kept_by_their_extension() {
        let request = ConvertRequest::new(WritableFormat::Gwy);
        let text = serde_json::to_string(&request).unwrap();
        assert!(text.contains("\"format\":\"gwy\""), "{text}");
        assert_eq!(
            serde_json::from_str::<ConvertRequest>(&text).unwrap(),
            request
        );
        let error = serde_json::from_str::<ConvertRequest>(r#"{"format":"doc"}"#).unwrap_err();
        assert!(error.to_string().contains("npz"), "{error}");
    }
}
