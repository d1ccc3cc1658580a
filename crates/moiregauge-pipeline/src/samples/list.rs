//! Shards and the lists of their samples.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use moiregauge::settings::Settings;
use moiregauge_report::results::UserSpecified;
use serde::{Deserialize, Serialize};

use super::error::{SamplesError, at};
use crate::reading;

/// Folder of parts and lists in a folder of results.
pub(super) const PARTS: &str = "parts";
const SCHEMA: &str = "moiregauge/samples/1";
/// More shards than this are a typing error.
const MOST: usize = 100_000;

/// One of several equal shares of the samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Shard {
    /// Its number, from 1.
    pub number: usize,
    /// How many there are.
    pub of: usize,
}

impl Shard {
    /// All samples in one.
    pub const WHOLE: Self = Self { number: 1, of: 1 };

    /// Whether the sample at this place of the sorted list belongs to it: every `of`-th does, so that neighbours, which
    /// are often alike, are spread evenly.
    pub fn has(&self, place: usize) -> bool {
        place % self.of == self.number - 1
    }

    /// The name of its list.
    pub(super) fn list_name(self) -> String {
        format!("list-{}-of-{}.json", self.number, self.of)
    }
}

/// `3/16`.
impl FromStr for Shard {
    type Err = SamplesError;

    fn from_str(text: &str) -> Result<Self, SamplesError> {
        let parsed = || {
            let (number, of) = text.split_once('/')?;
            let (number, of) = (number.trim().parse().ok()?, of.trim().parse().ok()?);
            let shard = Self { number, of };
            (1 <= number && number <= of && of <= MOST).then_some(shard)
        };
        parsed().ok_or_else(|| SamplesError::Shard(text.to_owned()))
    }
}

/// What all parts of a run have in common.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Asked {
    /// Version of the program.
    pub(super) version: String,
    pub(super) settings: Settings,
    pub(super) known: UserSpecified,
}

/// The samples of a shard, when all of them are done.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct List {
    pub(super) schema: String,
    pub(super) asked: Asked,
    pub(super) shard: Shard,
    /// Sorted by name.
    pub(super) samples: Vec<Listed>,
}

#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Listed {
    pub(super) sample: String,
    pub(super) key: String,
}

impl List {
    pub(super) fn new(asked: Asked, shard: Shard, samples: Vec<Listed>) -> Self {
        Self {
            schema: SCHEMA.to_owned(),
            asked,
            shard,
            samples,
        }
    }

    pub(super) fn read(path: &Path) -> Result<Self, SamplesError> {
        let damaged = |reason: String| SamplesError::Damaged {
            path: path.to_owned(),
            reason,
        };
        let bytes = reading::read(path).map_err(|e| damaged(e.to_string()))?;
        let list: Self = serde_json::from_slice(&bytes).map_err(|e| damaged(e.to_string()))?;
        if list.schema != SCHEMA {
            return Err(damaged(format!(
                "expected {SCHEMA:?}, found {:?}",
                list.schema
            )));
        }
        Ok(list)
    }

    pub(super) fn bytes(&self) -> Vec<u8> {
        let mut text = serde_json::to_vec_pretty(self).unwrap_or_default();
        text.push(b'\n');
        text
    }
}

/// The lists in a folder of results, by name.
pub(super) fn lists_in(folder: &Path) -> Result<Vec<PathBuf>, SamplesError> {
    let parts = folder.join(PARTS);
    let mut lists = Vec::new();
    let none = || SamplesError::NoParts(folder.to_owned());
    for entry in std::fs::read_dir(&parts).map_err(|_| none())? {
        let path = entry.map_err(at(&parts))?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if name.starts_with("list-") && name.ends_with(".json") {
            lists.push(path);
        }
    }
    if lists.is_empty() {
        return Err(none());
    }
    lists.sort();
    Ok(lists)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_share_evenly() {
        let shards: Vec<Shard> = (1..=3).map(|n| format!("{n}/3").parse().unwrap()).collect();
        for place in 0..10 {
            let having = shards.iter().filter(|shard| shard.has(place));
            assert_eq!(having.count(), 1);
        }
        for wrong in ["", "3", "0/3", "4/3", "1/0", "a/b", "1/1000000"] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
    }
}
