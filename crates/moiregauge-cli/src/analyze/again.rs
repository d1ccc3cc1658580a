//! A run again: the document of the earlier one, and whether the same came out.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, ensure};
use moiregauge_pipeline::{Document, Places};
use moiregauge_report::results::Run;

use super::arguments::arguments;
use crate::config;
use crate::typed::typed;

/// The document of the run to be repeated.
pub(super) struct Again {
    path: PathBuf,
    document: Document,
}

impl Again {
    /// Reads the document of a run of `command`, and finds its files in `folders`; checks both.
    pub(super) fn read(
        path: &Path,
        folders: &[PathBuf],
        command: &str,
    ) -> anyhow::Result<(Self, Places)> {
        let others = arguments(typed(), &["--replay", "--data"]);
        ensure!(
            others.len() == 1,
            "--replay takes files, settings and options from the document; leave out {}",
            others[1..].join(" ")
        );
        let document = Document::read(path).context("--replay")?;
        ensure!(
            document.run.command == command,
            "--replay: {} records a run of {1}; repeat it with `moiregauge {1} --replay`",
            path.display(),
            document.run.command
        );
        let places = document.find(folders).context("--replay")?;
        config::check(&document.run.settings).context("--replay")?;
        if document.is_of_another_version() {
            eprintln!(
                "note: version {} wrote {}, and this is version {}. Numbers may differ; CHANGELOG.md says which",
                document.version,
                path.display(),
                env!("CARGO_PKG_VERSION")
            );
        }
        let path = path.to_owned();
        Ok((Self { path, document }, places))
    }

    /// What was asked.
    pub(super) fn run(&self) -> &Run {
        &self.document.run
    }

    /// Whether the same document came out, one of these; says so if not.
    pub(super) fn is_same(&self, documents: &[Vec<u8>]) -> bool {
        if documents.contains(&self.document.bytes) {
            return true;
        }
        eprintln!(
            "note: the results differ from {} in some bytes. Another version or another kind of processor may change \
             the last digits",
            self.path.display()
        );
        self.document.is_of_another_version()
    }
}

/// The folder for the results of a repetition where none is given: beside that of the document.
pub(super) fn out_beside(document: &Path) -> PathBuf {
    let whole = std::path::absolute(document).unwrap_or_else(|_| document.to_owned());
    let folder = whole.parent().unwrap_or(Path::new(""));
    let mut name = folder.file_name().unwrap_or_default().to_owned();
    name.push("-replayed");
    folder.with_file_name(name)
}
