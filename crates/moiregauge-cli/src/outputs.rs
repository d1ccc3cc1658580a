//! What is written: the sinks of the pipeline, and the options that help where they refuse.

use std::path::{Path, PathBuf};

use moiregauge_pipeline::sink::{FolderSink, OneFile, SinkError, Target};

/// Makes a folder of results ready, before the work.
pub(crate) fn folder(target: &Target) -> anyhow::Result<FolderSink> {
    FolderSink::open(target).map_err(hinted)
}

/// Puts everything in place.
pub(crate) fn commit(sink: FolderSink) -> anyhow::Result<()> {
    sink.commit().map_err(hinted)
}

/// Makes sure that a file can be written, before the work.
pub(crate) fn file(path: &Path, force: bool, inputs: &[PathBuf]) -> anyhow::Result<OneFile> {
    OneFile::open(path, force, inputs).map_err(hinted)
}

/// Writes named files into a folder of results, or into the folder `within` it.
pub(crate) fn write_all(
    sink: &FolderSink,
    within: &str,
    files: &[(String, Vec<u8>)],
) -> anyhow::Result<()> {
    for (name, bytes) in files {
        sink.write(&format!("{within}{name}"), bytes)?;
    }
    Ok(())
}

/// The error, with the option that helps against it.
pub(crate) fn hinted(error: SinkError) -> anyhow::Error {
    let hint = match &error {
        error if error.can_be_forced() => "give another name, or --force to write over it",
        SinkError::OtherKind { .. } | SinkError::Foreign(_) | SinkError::Input(_) => {
            "give another name"
        }
        _ => return error.into(),
    };
    anyhow::anyhow!("{error}; {hint}")
}
