//! The files of the page: those compiled in, or those of a folder that a laboratory has changed.

use std::borrow::Cow;
use std::path::PathBuf;

use include_dir::{Dir, include_dir};

use crate::paths::below;

static WITHIN: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/page");

/// Where the files of the page are.
#[derive(Clone, Debug)]
pub(crate) enum Page {
    Within,
    Folder(PathBuf),
}

/// What a browser has to know of a file, by its extension; others are not given.
const KINDS: [(&str, &str); 10] = [
    ("html", "text/html; charset=utf-8"),
    ("js", "text/javascript; charset=utf-8"),
    ("mjs", "text/javascript; charset=utf-8"),
    ("css", "text/css; charset=utf-8"),
    ("svg", "image/svg+xml"),
    ("png", "image/png"),
    ("ico", "image/x-icon"),
    ("json", "application/json"),
    ("txt", "text/plain; charset=utf-8"),
    ("woff2", "font/woff2"),
];

impl Page {
    /// A file and its kind.
    pub(crate) fn file(&self, name: &str) -> Option<(Cow<'static, [u8]>, &'static str)> {
        let path = below(name).ok()?;
        let extension = path.extension()?.to_str()?;
        let (_, kind) = KINDS.iter().find(|(known, _)| *known == extension)?;
        let bytes = match self {
            Self::Within => Cow::Borrowed(WITHIN.get_file(name)?.contents()),
            Self::Folder(folder) => {
                let real = folder.join(&path).canonicalize().ok()?;
                if !real.starts_with(folder) {
                    return None;
                }
                Cow::Owned(std::fs::read(real).ok()?)
            }
        };
        Some((bytes, kind))
    }
}
