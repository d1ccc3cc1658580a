//! One sample on the disk: what it depends on, and what came out.

use std::path::Path;

use moiregauge_report::SampleRow;
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use super::error::SamplesError;
use super::find::SampleFiles;
use super::list::Asked;
use crate::hash::{hexadecimal, identity};
use crate::reading;
use crate::session;

const SCHEMA: &str = "moiregauge/part/1";

/// The first line of a part.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Head {
    schema: String,
    version: String,
    sample: String,
    key: String,
    /// How many rows follow.
    rows: usize,
    /// Whether a picture lies beside it.
    picture: bool,
}

/// What came out of one sample.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Part {
    pub(super) sample: String,
    pub(super) key: String,
    /// One for each moiré; at least one.
    pub(super) rows: Vec<SampleRow>,
    pub(super) picture: bool,
}

/// Names of the files of a part.
pub(super) fn part_name(key: &str) -> String {
    format!("{key}.jsonl")
}

pub(super) fn picture_name(key: &str) -> String {
    format!("{key}.png")
}

/// What the part of a sample depends on, in one hash.
pub(super) fn key(asked: &Asked, sample: &str, files: &SampleFiles) -> String {
    let mut hash = Sha256::new();
    let mut add = |words: &dyn std::fmt::Debug| hash.update(format!("{words:?}\n"));
    add(&SCHEMA);
    add(asked);
    add(&sample);
    let identified = |path: &Path| match identity(path, session::file_of(path)) {
        Ok(file) => file.sha256,
        // Unread: what is wrong with it is what is known of it.
        Err(error) => error.to_string(),
    };
    let mut hashes: Vec<(&str, String)> = Vec::new();
    for (name, path) in &files.files {
        hashes.push((name, identified(path)));
        for log in session::log_files(path) {
            hashes.push((name, identified(&log)));
        }
    }
    hashes.sort();
    add(&hashes);
    add(&files.failed);
    if let Some(sensors) = &asked.known.sensors {
        add(&identified(Path::new(sensors)));
    }
    hexadecimal(&hash.finalize())
}

impl Part {
    /// Lines of JSON: the head, then the rows.
    pub(super) fn bytes(&self) -> Result<Vec<u8>, serde_json::Error> {
        let head = Head {
            schema: SCHEMA.to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            sample: self.sample.clone(),
            key: self.key.clone(),
            rows: self.rows.len(),
            picture: self.picture,
        };
        let mut bytes = serde_json::to_vec(&head)?;
        bytes.push(b'\n');
        for row in &self.rows {
            serde_json::to_writer(&mut bytes, row)?;
            bytes.push(b'\n');
        }
        Ok(bytes)
    }

    /// Reads the part of a key from a folder of parts; `None` where there is none.
    pub(super) fn read(folder: &Path, key: &str) -> Result<Option<Self>, SamplesError> {
        let path = folder.join(part_name(key));
        let damaged = |reason: String| SamplesError::Damaged {
            path: path.clone(),
            reason,
        };
        let bytes = match reading::read(&path) {
            Ok(bytes) => bytes,
            Err(error) if error.is_missing() => return Ok(None),
            Err(error) => return Err(damaged(error.to_string())),
        };
        let part = parse(&bytes).map_err(damaged)?;
        if part.key != key {
            return Err(damaged(format!(
                "expected the part {key}, found {}",
                part.key
            )));
        }
        Ok(Some(part))
    }
}

fn parse(bytes: &[u8]) -> Result<Part, String> {
    let mut lines = bytes.split_inclusive(|b| *b == b'\n');
    let head = lines.next().unwrap_or_default();
    let head: Head = serde_json::from_slice(head).map_err(|e| e.to_string())?;
    if head.schema != SCHEMA {
        return Err(format!("expected {SCHEMA:?}, found {:?}", head.schema));
    }
    let rows = lines.map(|line| serde_json::from_slice(line).map_err(|e| e.to_string()));
    let rows: Vec<SampleRow> = rows.collect::<Result<_, _>>()?;
    if rows.len() != head.rows {
        return Err(format!("expected {} rows, found {}", head.rows, rows.len()));
    }
    Ok(Part {
        sample: head.sample,
        key: head.key,
        rows,
        picture: head.picture,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use moiregauge_report::FailedInput;

    #[test]
    fn parts_read_back_as_they_were() {
        let failed = FailedInput {
            file: "a/1".to_owned(),
            error: "\"no\"\nlattice".to_owned(),
        };
        let row = SampleRow {
            twist_deg: Some(0.1 + 0.2),
            ..SampleRow::without_numbers("a", vec![failed])
        };
        let part = Part {
            sample: "a".to_owned(),
            key: "k".to_owned(),
            rows: vec![row],
            picture: true,
        };
        let bytes = part.bytes().unwrap();
        assert_eq!(parse(&bytes), Ok(part));
        // Cut off anywhere, it is no part.
        for end in 0..bytes.len() - 1 {
            assert!(parse(&bytes[..end]).is_err(), "{end}");
        }
    }
}
