//! What was measured, by what it depends on.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use moiregauge::scan::{MeasuredScan, Window};
use moiregauge::settings::Settings;
use moiregauge_report::InputFile;
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use super::failure::Failure;
use crate::hash::hexadecimal;
use crate::known::Known;
use crate::stamp::Stamp;

/// Name and version of what is kept; a part of every key.
pub(crate) const SCHEMA: &str = "moiregauge/measured/1";

/// Measured scans by the hash of their file and of all that measuring depends on.
///
/// As JSON it is a document of its own, `moiregauge/measured/1`: measuring and analysing can happen in different
/// processes and on different days. Entries of other versions of this crate are never used.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(try_from = "Document", into = "Document")]
pub struct Kept {
    files: BTreeMap<String, Result<Vec<MeasuredScan>, Failure>>,
    /// What identified files when they were read last, where their dates are trusted. It is not written.
    read: Option<BTreeMap<PathBuf, (Stamp, InputFile)>>,
}

impl Kept {
    /// How many files are measured.
    pub fn len(&self) -> usize {
        self.files.len()
    }

    /// Whether nothing is measured.
    pub fn is_empty(&self) -> bool {
        self.files.is_empty()
    }

    /// The keys of what is measured.
    pub(super) fn keys(&self) -> impl Iterator<Item = &String> {
        self.files.keys()
    }

    /// What has none of these keys.
    pub(super) fn beside(&self, keys: &BTreeSet<String>) -> Self {
        let others = self.files.iter().filter(|(key, _)| !keys.contains(*key));
        Self {
            files: others.map(|(key, of)| (key.clone(), of.clone())).collect(),
            read: None,
        }
    }

    pub(super) fn get(&self, key: &str) -> Option<&Result<Vec<MeasuredScan>, Failure>> {
        self.files.get(key)
    }

    /// Takes what others measured.
    pub fn extend(&mut self, other: Self) {
        self.files.extend(other.files);
        // Where dates are not trusted, files are read again.
        if let (Some(read), Some(others)) = (&mut self.read, other.read) {
            read.extend(others);
        }
    }

    /// Believes from now on that a file of the same size and date is the same.
    pub(super) fn trust_dates(&mut self) {
        self.read.get_or_insert_default();
    }

    /// The size and date of a file, where they are trusted.
    pub(super) fn stamp(&self, place: &Path) -> Option<Stamp> {
        self.read.as_ref()?;
        Stamp::of(place)
    }

    /// What identified a file that has not changed since.
    pub(super) fn identity(&self, path: &Path, now: Stamp) -> Option<&InputFile> {
        let (then, input) = self.read.as_ref()?.get(path)?;
        (*then == now).then_some(input)
    }

    /// A file of this size and date was read.
    pub(super) fn was_read(&mut self, path: PathBuf, stamp: Stamp, input: InputFile) {
        if let Some(read) = &mut self.read {
            read.insert(path, (stamp, input));
        }
    }

    /// One file.
    pub(super) fn of(key: &str, measured: Result<Vec<MeasuredScan>, Failure>) -> Self {
        let mut kept = Self::default();
        kept.put(key.to_owned(), measured);
        kept
    }

    pub(super) fn put(&mut self, key: String, measured: Result<Vec<MeasuredScan>, Failure>) {
        self.files.insert(key, measured);
    }
}

/// Somebody who is given every file as soon as it is measured, with its key: what he keeps is not lost if the process ends
/// before the work does.
pub type Heard = Arc<dyn Fn(&str, Kept) + Send + Sync>;

/// Measured scans as they are written.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    schema: String,
    files: BTreeMap<String, OfFile>,
}

/// What a file gave: its moirés, or why there are none.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum OfFile {
    Moires(Vec<MeasuredScan>),
    Failed(Failure),
}

impl From<Kept> for Document {
    fn from(kept: Kept) -> Self {
        let files = kept
            .files
            .into_iter()
            .map(|(key, measured)| match measured {
                Ok(moires) => (key, OfFile::Moires(moires)),
                Err(failure) => (key, OfFile::Failed(failure)),
            });
        Self {
            schema: SCHEMA.to_owned(),
            files: files.collect(),
        }
    }
}

impl TryFrom<Document> for Kept {
    type Error = String;

    fn try_from(document: Document) -> Result<Self, Self::Error> {
        if document.schema != SCHEMA {
            return Err(format!("expected {SCHEMA:?}, found {:?}", document.schema));
        }
        let files = document
            .files
            .into_iter()
            .map(|(key, of_file)| match of_file {
                // An analysis needs at least one moiré of a file that it takes for measured.
                OfFile::Moires(moires)
                    if moires.iter().all(|m| !m.lines.is_empty()) && !moires.is_empty() =>
                {
                    Ok((key, Ok(moires)))
                }
                OfFile::Moires(_) => {
                    Err(format!("{key}: expected a lattice of a line, found none"))
                }
                OfFile::Failed(failure) => Ok((key, Err(failure))),
            });
        Ok(Self {
            files: files.collect::<Result<_, _>>()?,
            read: None,
        })
    }
}

/// The settings that measuring depends on. Every one is named here, so that a new one is not forgotten.
fn measuring(settings: &Settings) -> Settings {
    let Settings {
        channel,
        image,
        line,
        method,
        background,
        by_hand,
        moires,
        scanner,
        ruler,
        // The atoms that are looked for are those of the layers, where they can be a ruler.
        material,
        substrate,
        strain_convention,
        moire_layers,
        // What is chosen after measuring changes no measured scan.
        grain: _,
        layers_chosen: _,
        lattice_angle: _,
        lattice_angle_2: _,
        twist_sense: _,
        moire_waves: _,
        grouping: _,
        frame_time_sigma_s: _,
        exclude: _,
        exclude_outliers: _,
        overlap: _,
        drift: _,
        drift_prior_nm_per_min: _,
        calibration: _,
        isotropic_strain_percent: _,
        ruler_strain_percent: _,
        ruler_magnification_percent: _,
        drift_draws: _,
        strain_draws: _,
        seed: _,
    } = settings;
    Settings {
        channel: channel.clone(),
        image: *image,
        line: *line,
        method: *method,
        background: *background,
        by_hand: by_hand.clone(),
        moires: *moires,
        scanner: scanner.clone(),
        ruler: *ruler,
        material: material.clone(),
        substrate: substrate.clone(),
        moire_layers: moire_layers.clone(),
        strain_convention: *strain_convention,
        ..Settings::default()
    }
}

/// What measuring depends on beside the file: one hash for all files of a campaign.
pub(super) struct With(Sha256);

impl With {
    /// Of settings, what is known of all files, and the region.
    pub(super) fn new(settings: &Settings, known: &Known, window: Option<&Window>) -> Self {
        let mut hash = Sha256::new();
        let told = known.user_specified();
        let mut add = |part: &dyn std::fmt::Debug| hash.update(format!("{part:?}\n"));
        add(&SCHEMA);
        add(&crate::VERSION);
        add(&measuring(settings));
        add(told);
        add(&window);
        if let Some(sensors) = &told.sensors {
            let sensors = Path::new(sensors);
            add(&known.source(sensors).identity(sensors).ok());
        }
        Self(hash)
    }

    /// The key of a file: with its name, its hash, and that of the logs beside it.
    pub(super) fn key(&self, path: &Path, name: &str, sha256: &str, known: &Known) -> String {
        let mut hash = self.0.clone();
        let direction = known.frame_direction(path);
        hash.update(format!("{name:?} {sha256} {direction:?}\n"));
        for log in known.source(path).logs() {
            let log = log.identity(log.path()).ok();
            hash.update(format!("{:?}\n", log.map(|log| log.sha256)));
        }
        hexadecimal(&hash.finalize())
    }
}
