//! The files that may be opened: below the folders named at the start, and what was dropped on the page.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use moiregauge_pipeline::{Places, hexadecimal};
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use crate::error::ServeError;
use crate::host::real;
use crate::lock::lock;
use crate::paths::below;
use crate::problem::{Answer, Problem};

/// The folder of what was dropped.
pub(crate) const DROPPED: &str = "dropped";

/// A folder whose files may be opened.
#[derive(Clone, Debug)]
struct Root {
    id: String,
    /// As it was named.
    name: PathBuf,
    /// Where it is, without links.
    real: PathBuf,
}

/// A file that was shown, and what it is called.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct File {
    pub(crate) id: String,
    /// As the program would be told; of what was dropped the name within the drop.
    pub(crate) name: PathBuf,
    /// Where it is.
    pub(crate) place: PathBuf,
    /// The id of its root.
    pub(crate) root: String,
}

/// Where files are that are not where their names say.
pub(crate) fn places(files: &[File]) -> Places {
    let mut places = Places::new();
    for file in files {
        if file.name != file.place {
            places.insert(file.name.clone(), file.place.clone());
        }
    }
    places
}

/// A folder as it is shown.
#[derive(Clone, Debug)]
pub(crate) struct Folder {
    pub(crate) root: String,
    /// As a program would be told.
    pub(crate) name: PathBuf,
    /// Where it is, without links.
    pub(crate) real: PathBuf,
}

/// All files that may be opened.
#[derive(Debug)]
pub(crate) struct Roots {
    named: Vec<Root>,
    dropped: Root,
    /// Those that were shown, by their ids.
    files: Mutex<HashMap<String, File>>,
}

impl Roots {
    /// The folders named at the start, and that of what will be dropped.
    pub(crate) fn new(folders: &[PathBuf], dropped: &Path) -> Result<Self, ServeError> {
        let named = folders.iter().enumerate().map(|(number, folder)| {
            let refused = |reason: String| ServeError::Folder {
                folder: folder.clone(),
                reason,
            };
            let real = real(folder).map_err(|e| refused(format!("found none: {e}")))?;
            if !real.is_dir() {
                return Err(refused("found a file".to_owned()));
            }
            Ok(Root {
                id: number.to_string(),
                name: folder.clone(),
                real,
            })
        });
        Ok(Self {
            named: named.collect::<Result<_, _>>()?,
            dropped: Root {
                id: DROPPED.to_owned(),
                name: PathBuf::new(),
                real: real(dropped).map_err(ServeError::System)?,
            },
            files: Mutex::default(),
        })
    }

    /// The roots: ids and names.
    pub(crate) fn shown(&self) -> Vec<(String, String)> {
        let named = self.named.iter().map(|root| {
            let name = moiregauge_pipeline::names::in_words(&root.name);
            (root.id.clone(), name)
        });
        let dropped = (DROPPED.to_owned(), DROPPED.to_owned());
        named.chain([dropped]).collect()
    }

    fn root(&self, id: &str) -> Answer<&Root> {
        let mut all = self.named.iter().chain([&self.dropped]);
        all.find(|root| root.id == id)
            .ok_or_else(|| Problem::missing("no such folder").at("root"))
    }

    /// A folder below a root.
    pub(crate) fn folder(&self, root: &str, under: &str) -> Answer<Folder> {
        let root = self.root(root)?;
        let relative = below(under).map_err(|why| refused_path().what(why).at("under"))?;
        let found = real(&root.real.join(&relative));
        let real = found.map_err(|_| Problem::missing("no such folder").at("under"))?;
        if !real.starts_with(&root.real) {
            return Err(refused_path()
                .what("a link leads out of the folder")
                .at("under"));
        }
        if !real.is_dir() {
            return Err(Problem::missing("no such folder")
                .what("found a file")
                .at("under"));
        }
        Ok(Folder {
            root: root.id.clone(),
            name: if relative.as_os_str().is_empty() {
                root.name.clone()
            } else {
                root.name.join(relative)
            },
            real,
        })
    }

    /// Where something that is dropped has to go.
    pub(crate) fn drop_place(&self, drop: &str, name: &str) -> Answer<PathBuf> {
        let plain = |c: char| c.is_ascii_alphanumeric() || c == '-';
        if drop.is_empty() || drop.len() > 64 || !drop.chars().all(plain) {
            return Err(Problem::wrong("not the id of a drop")
                .what("letters, digits and - are expected")
                .at("drop"));
        }
        let name = below(name).map_err(|why| refused_path().what(why).at("name"))?;
        if name.as_os_str().is_empty() {
            return Err(refused_path().what("the name is empty").at("name"));
        }
        Ok(self.dropped.real.join(drop).join(name))
    }

    /// Where what is dropped is written first.
    pub(crate) fn drop_folder(&self) -> &Path {
        &self.dropped.real
    }

    /// Takes note of a file that is shown; none if a link leads out of its root.
    pub(crate) fn show(&self, root: &str, place: &Path) -> Option<File> {
        let root = self.root(root).ok()?;
        let real = real(place).ok()?;
        if !real.starts_with(&root.real) || !real.is_file() {
            return None;
        }
        let relative = place.strip_prefix(&root.real).ok()?;
        let mut name = root.name.join(relative);
        if root.id == DROPPED {
            // The first part tells the drop.
            name = relative.components().skip(1).collect();
        }
        let mut hash = Sha256::new();
        hash.update(root.real.as_os_str().as_encoded_bytes());
        hash.update([0]);
        hash.update(relative.as_os_str().as_encoded_bytes());
        let file = File {
            id: hexadecimal(&hash.finalize())[..32].to_owned(),
            name,
            place: place.to_owned(),
            root: root.id.clone(),
        };
        lock(&self.files).insert(file.id.clone(), file.clone());
        Some(file)
    }

    /// Takes note of a file that an earlier server had shown, if it lies below a root that is named now.
    pub(crate) fn show_again(&self, file: &File) {
        let all = self.named.iter().chain([&self.dropped]);
        for root in all.filter(|root| file.place.starts_with(&root.real)) {
            self.show(&root.id, &file.place);
        }
    }

    /// A file that was shown, if it still lies below its root.
    pub(crate) fn file(&self, id: &str) -> Answer<File> {
        let gone = || Problem::missing("no such file").at(id);
        let file = lock(&self.files).get(id).cloned().ok_or_else(gone)?;
        let root = self.root(&file.root)?;
        let real = real(&file.place).map_err(|_| gone())?;
        if !real.starts_with(&root.real) {
            return Err(refused_path().what("a link leads out of the folder").at(id));
        }
        Ok(file)
    }
}

fn refused_path() -> Problem {
    Problem::new(
        axum::http::StatusCode::FORBIDDEN,
        "not a place below the folders named at the start",
    )
}
