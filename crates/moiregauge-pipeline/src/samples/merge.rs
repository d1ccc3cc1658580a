//! Parts of several folders → one folder, as if one run had made all of it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::done::SamplesDone;
use super::error::{SamplesError, at};
use super::list::{List, Listed, PARTS, Shard, lists_in};
use super::part::{Part, part_name, picture_name};
use super::tables;
use crate::job::Job;
use crate::sink::FileSink;

/// What may be merged that does not fit together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Merge {
    /// Parts of other versions of the program, and of other settings: the table is then a mixture.
    pub mixed: bool,
    /// Shards may be missing: the table then lacks their samples.
    pub incomplete: bool,
}

/// A list with the folder whose parts it names.
struct From {
    path: PathBuf,
    folder: PathBuf,
    list: List,
}

/// Joins the parts of folders into `out`, which may be one of them, and writes the tables: the bytes that one run over
/// all samples would have written.
///
/// # Errors
/// [`SamplesError`]: parts of another version or other settings and missing shards, unless they are allowed; parts that
/// are damaged.
pub fn merge(
    folders: &[PathBuf],
    out: &Path,
    allowed: Merge,
    job: &Job,
) -> Result<SamplesDone, SamplesError> {
    let tables = tables::sink(out)?;
    let lists = read_lists(folders)?;
    let Some(first) = lists.first() else {
        return Err(SamplesError::NoParts(out.to_owned()));
    };
    check(&lists, first, allowed)?;
    let samples = by_name(&lists)?;
    let asked = first.list.asked.clone();
    let parts = FileSink::open(&out.join(PARTS), true, &[])?;
    let stage = job.stage("merging", "samples", samples.len());
    for (sample, (key, folder)) in &samples {
        job.check()?;
        copy(&folder.join(PARTS), &out.join(PARTS), sample, key, &parts)?;
        stage.step();
    }
    drop(stage);
    let listed = samples.into_iter().map(|(sample, (key, _))| Listed {
        sample: sample.to_owned(),
        key: key.to_owned(),
    });
    let list = List::new(asked, Shard::WHOLE, listed.collect());
    let name = PathBuf::from(Shard::WHOLE.list_name());
    parts.write(&[(name.clone(), list.bytes())])?;
    drop(parts);
    let done = tables::write(out, &list, tables)?;
    // Lists of shards in the same folder are all in the one that was just written.
    for old in lists_in(out)?.iter().filter(|path| !path.ends_with(&name)) {
        std::fs::remove_file(old).map_err(at(old))?;
    }
    Ok(done)
}

fn read_lists(folders: &[PathBuf]) -> Result<Vec<From>, SamplesError> {
    let mut lists = Vec::new();
    for folder in folders {
        for path in lists_in(folder)? {
            lists.push(From {
                list: List::read(&path)?,
                folder: folder.clone(),
                path,
            });
        }
    }
    Ok(lists)
}

/// Refuses what does not fit together.
fn check(lists: &[From], first: &From, allowed: Merge) -> Result<(), SamplesError> {
    let version = env!("CARGO_PKG_VERSION");
    for from in lists {
        let asked = &from.list.asked;
        if asked.version != version && !allowed.mixed {
            return Err(SamplesError::OtherVersion {
                path: from.path.clone(),
                found: asked.version.clone(),
                expected: version.to_owned(),
            });
        }
        if *asked != first.list.asked && !allowed.mixed {
            return Err(SamplesError::OtherSettings {
                first: first.path.clone(),
                other: from.path.clone(),
            });
        }
        let (of, expected) = (from.list.shard.of, first.list.shard.of);
        // A whole run, or several of different samples, are complete by themselves.
        if of != expected && of != 1 && expected != 1 {
            return Err(SamplesError::OtherDivision {
                first: first.path.clone(),
                other: from.path.clone(),
            });
        }
    }
    let of = lists.iter().map(|from| from.list.shard.of).max();
    let of = of.unwrap_or(1);
    let is_there = |number: &usize| {
        let mut shards = lists.iter().map(|from| from.list.shard);
        shards.any(|shard| shard.of == of && shard.number == *number)
    };
    let missing: Vec<usize> = (1..=of).filter(|number| !is_there(number)).collect();
    if !missing.is_empty() && !allowed.incomplete {
        return Err(SamplesError::MissingShards { missing, of });
    }
    Ok(())
}

/// The samples sorted by name, with the key of each and the folder whose parts have it.
fn by_name(lists: &[From]) -> Result<BTreeMap<&str, (&str, &Path)>, SamplesError> {
    let mut samples: BTreeMap<&str, (&str, &Path)> = BTreeMap::new();
    for from in lists {
        for listed in &from.list.samples {
            let new = (listed.key.as_str(), from.folder.as_path());
            let old = samples.entry(&listed.sample).or_insert(new);
            if old.0 != new.0 {
                return Err(SamplesError::TwoSamples(listed.sample.clone()));
            }
        }
    }
    Ok(samples)
}

/// Copies a part and its picture, unless they are there.
fn copy(
    from: &Path,
    to: &Path,
    sample: &str,
    key: &str,
    parts: &FileSink,
) -> Result<(), SamplesError> {
    let path = from.join(part_name(key));
    let damaged = |reason: &str| SamplesError::Damaged {
        path: path.clone(),
        reason: reason.to_owned(),
    };
    let part =
        Part::read(from, key)?.ok_or_else(|| damaged("a list names it, but it does not exist"))?;
    if part.sample != sample {
        return Err(damaged("it is the part of another sample"));
    }
    if matches!(Part::read(to, key), Ok(Some(_))) {
        return Ok(());
    }
    let mut names = vec![part_name(key)];
    if part.picture {
        names.insert(0, picture_name(key));
    }
    for name in names {
        let source = from.join(&name);
        let bytes = std::fs::read(&source).map_err(at(&source))?;
        parts.write(&[(PathBuf::from(name), bytes)])?;
    }
    Ok(())
}
