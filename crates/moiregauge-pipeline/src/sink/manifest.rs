//! What a run has written: names, sizes and hashes.

use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, Read as _};
use std::path::{Component, Path};

use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use super::SinkError;

/// Name of the list of files in a folder of results.
pub const MANIFEST: &str = "moiregauge-files.json";
const SCHEMA: &str = "moiregauge/files/1";

/// The files that a run has written into a folder.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Name and version of this layout.
    pub schema: String,
    /// What has written them, with its version.
    pub program: String,
    /// What kind of results they are: the command of the program.
    pub kind: String,
    /// All of them but the list itself, by name.
    pub files: Vec<Entry>,
}

/// A file that was written.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// Its name within the folder, parts divided by `/`.
    pub path: String,
    /// Its length.
    pub bytes: u64,
    /// Its SHA-256, hexadecimal.
    pub sha256: String,
}

/// What has become of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum State {
    Gone,
    Same,
    Changed,
}

impl Manifest {
    pub(super) fn new(kind: &str, files: Vec<Entry>) -> Self {
        Self {
            schema: SCHEMA.to_owned(),
            program: concat!("moiregauge ", env!("CARGO_PKG_VERSION")).to_owned(),
            kind: kind.to_owned(),
            files,
        }
    }

    /// The list in a folder, where there is one.
    ///
    /// # Errors
    /// [`SinkError::Manifest`] if it cannot be understood.
    pub fn read(folder: &Path) -> Result<Option<Self>, SinkError> {
        let path = folder.join(MANIFEST);
        let damaged = |reason: String| SinkError::Manifest {
            path: path.clone(),
            reason,
        };
        let text = match std::fs::read(&path) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(damaged(error.to_string())),
        };
        let manifest: Self = serde_json::from_slice(&text).map_err(|e| damaged(e.to_string()))?;
        manifest.check().map_err(damaged)?;
        Ok(Some(manifest))
    }

    /// Says what is wrong with it.
    pub(super) fn check(&self) -> Result<(), String> {
        if self.schema != SCHEMA {
            return Err(format!("expected {SCHEMA:?}, found {:?}", self.schema));
        }
        match self.files.iter().find(|f| !is_inside(&f.path)) {
            Some(outside) => Err(format!("{:?} leads out of the folder", outside.path)),
            None => Ok(()),
        }
    }

    pub(super) fn entry(&self, path: &str) -> Option<&Entry> {
        self.files.iter().find(|f| f.path == path)
    }

    /// Whether it lists this file, or files in the folder of this name.
    pub(super) fn knows(&self, name: &str) -> bool {
        let inside = |path: &str| {
            let rest = path.strip_prefix(name);
            rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
        };
        self.files.iter().any(|f| inside(&f.path))
    }
}

impl Entry {
    pub(super) fn of_bytes(path: &str, bytes: &[u8]) -> Self {
        Self {
            path: path.to_owned(),
            bytes: bytes.len() as u64,
            sha256: hexadecimal(&Sha256::digest(bytes)),
        }
    }

    /// The file as it is now; `None` if it is gone or no plain file.
    pub(super) fn of_file(folder: &Path, path: &str) -> io::Result<Option<Self>> {
        let file = folder.join(path);
        match std::fs::symlink_metadata(&file) {
            Ok(found) if found.is_file() => {}
            Ok(_) => return Ok(None),
            Err(error) if is_absent(&error) => return Ok(None),
            Err(error) => return Err(error),
        }
        let (bytes, sha256) = hash_file(&file)?;
        Ok(Some(Self {
            path: path.to_owned(),
            bytes,
            sha256,
        }))
    }

    /// What has become of it in a folder.
    pub(super) fn state(&self, folder: &Path) -> io::Result<State> {
        if !exists(&folder.join(&self.path)) {
            return Ok(State::Gone);
        }
        let now = Self::of_file(folder, &self.path)?;
        Ok(if now.as_ref() == Some(self) {
            State::Same
        } else {
            State::Changed
        })
    }
}

/// Whether anything has this name, be it a link that leads nowhere.
pub(super) fn exists(path: &Path) -> bool {
    std::fs::symlink_metadata(path).is_ok()
}

/// Whether nothing has that name, since there is no such folder either.
pub(super) fn is_absent(error: &io::Error) -> bool {
    use io::ErrorKind::{NotADirectory, NotFound};
    matches!(error.kind(), NotFound | NotADirectory)
}

/// Length and SHA-256 of a file, read piece by piece.
pub(super) fn hash_file(path: &Path) -> io::Result<(u64, String)> {
    let mut file = File::open(path)?;
    let mut hash = Sha256::new();
    let mut buffer = vec![0; 1 << 18];
    let mut bytes = 0;
    loop {
        let count = file.read(&mut buffer)?;
        if count == 0 {
            return Ok((bytes, hexadecimal(&hash.finalize())));
        }
        hash.update(&buffer[..count]);
        bytes += count as u64;
    }
}

fn hexadecimal(bytes: &[u8]) -> String {
    let mut text = String::with_capacity(2 * bytes.len());
    for byte in bytes {
        // Writing into a string cannot fail.
        let _ = write!(text, "{byte:02x}");
    }
    text
}

/// Whether a name stays inside its folder.
fn is_inside(name: &str) -> bool {
    let parts = Path::new(name).components();
    !name.is_empty() && parts.into_iter().all(|p| matches!(p, Component::Normal(_)))
}

/// An error if a name does not stay inside its folder, or is that of a device where there are such names.
pub(super) fn check_name(name: &str) -> Result<(), SinkError> {
    let reason = if !is_inside(name) {
        "it leads out of its folder"
    } else if name.contains('\0') {
        "it holds a zero byte"
    } else if cfg!(windows) && name.split('/').any(is_device) {
        "it is the name of a device, or has characters that are not allowed in names here"
    } else {
        return Ok(());
    };
    Err(SinkError::Name {
        name: name.to_owned(),
        reason,
    })
}

/// Whether Windows does not take a part of a path for the name of a file.
fn is_device(part: &str) -> bool {
    let stem = part.split('.').next().unwrap_or(part).trim_end();
    let numbered = |name: &str| {
        let digit = stem.get(3..).filter(|d| d.len() == 1);
        let is_number = digit.is_some_and(|d| d.starts_with(|c| ('1'..='9').contains(&c)));
        is_number && stem[..3].eq_ignore_ascii_case(name)
    };
    let whole = ["CON", "PRN", "AUX", "NUL"];
    whole.iter().any(|name| stem.eq_ignore_ascii_case(name))
        || numbered("COM")
        || numbered("LPT")
        || part.ends_with(['.', ' '])
        || part.contains(['<', '>', ':', '"', '|', '?', '*', '\\'])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stay_inside_and_are_no_devices() {
        assert!(check_name("figures/a.svg").is_ok());
        for outside in ["", "../a", "/a", "a/../../b", "."] {
            assert!(check_name(outside).is_err(), "{outside}");
        }
        for device in ["NUL", "con.gwy", "Com1.x", "lpt9", "a:b", "a.", "a?"] {
            assert!(is_device(device), "{device}");
        }
        for plain in ["null", "com10", "console.gwy", "scan.000", "ü.spm", "com"] {
            assert!(!is_device(plain), "{plain}");
        }
    }
}
