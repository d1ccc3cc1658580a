//! Why something is not written.

use std::path::{Path, PathBuf};

/// Why something is not written. Nothing has changed then, except after [`SinkError::Unfinished`].
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SinkError {
    /// The system refuses.
    #[error("cannot write {}", path.display())]
    Write {
        /// What is to be written.
        path: PathBuf,
        /// Why it is not.
        source: std::io::Error,
    },
    /// The list of files of an earlier run cannot be understood.
    #[error("{}: this is not a valid list of the files of an earlier run: {reason}", path.display())]
    Manifest {
        /// The list.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// A file where a folder is expected.
    #[error("{} is a file; a folder is expected", .0.display())]
    NoFolder(PathBuf),
    /// A folder, a link or a device where a file is expected.
    #[error("{} exists and is not a plain file", .0.display())]
    NoFile(PathBuf),
    /// The file is there; `force` writes over it.
    #[error("{} exists already", .0.display())]
    Exists(PathBuf),
    /// The folder holds results of this kind; `force` replaces them.
    #[error("{} already holds results of `{kind}`", folder.display())]
    Holds {
        /// The folder.
        folder: PathBuf,
        /// What made them.
        kind: String,
    },
    /// The folder holds results of another kind.
    #[error(
        "{} holds results of `{found}`. Those of `{wanted}` cannot go into the same folder, because some of their \
         files have the same names",
        folder.display()
    )]
    OtherKind {
        /// The folder.
        folder: PathBuf,
        /// What made the results in it.
        found: String,
        /// What is to be written.
        wanted: String,
    },
    /// Another run is writing there.
    #[error("another run is writing into {} now", .0.display())]
    Running(PathBuf),
    /// A file of somebody else has the name of one of ours.
    #[error("{} was not written by an earlier run, so it is not replaced", .0.display())]
    Foreign(PathBuf),
    /// A file of an earlier run was changed since.
    #[error("{} was changed since it was written, so it is not replaced. Move it to another place", .0.display())]
    Changed(PathBuf),
    /// An input of this run would be replaced.
    #[error("{} is an input of this run, so it is not replaced", .0.display())]
    Input(PathBuf),
    /// The name cannot be that of a file.
    #[error("{name:?} cannot be the name of a file: {reason}")]
    Name {
        /// The name.
        name: String,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// What is to be written cannot be made into files.
    #[error("cannot make the files of the {what}")]
    Made {
        /// What it is.
        what: &'static str,
        /// Why it cannot.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// Everything is written, but not everything could be moved to its place.
    #[error(
        "cannot replace {}. The new files are kept in {}, and the next run into this folder puts them in place",
        path.display(),
        work.display()
    )]
    Unfinished {
        /// The file that could not be replaced.
        path: PathBuf,
        /// Where the new files are.
        work: PathBuf,
        /// Why it could not.
        source: std::io::Error,
    },
}

impl SinkError {
    /// That files of something cannot be made.
    pub(crate) fn made(
        what: &'static str,
        source: impl Into<Box<dyn std::error::Error + Send + Sync>>,
    ) -> Self {
        let source = source.into();
        Self::Made { what, source }
    }

    /// Whether the same would be written if it were forced.
    pub fn can_be_forced(&self) -> bool {
        matches!(self, Self::Exists(_) | Self::Holds { .. })
    }
}

/// Adds the path to an error of the system.
pub(super) fn at(path: &Path) -> impl FnOnce(std::io::Error) -> SinkError {
    let path = path.to_owned();
    |source| SinkError::Write { path, source }
}
