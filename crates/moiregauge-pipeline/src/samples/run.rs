//! All samples of a shard → parts; of all shards → tables.

use std::path::{Path, PathBuf};

use moiregauge::settings::{Settings, SettingsError};
use moiregauge_report::results::UserSpecified;
use moiregauge_report::{ColorMap, FailedInput, SampleRow};
use rayon::prelude::*;

use super::done::SamplesDone;
use super::error::SamplesError;
use super::find::Sample;
use super::list::{Asked, List, Listed, PARTS, Shard};
use super::one::{With, analysed};
use super::part::{Part, key, part_name, picture_name};
use super::tables;
use crate::campaign::{Advice, no_advice};
use crate::job::Job;
use crate::sink::FileSink;
use crate::told::check_user_specified;

/// What is to be done with many samples.
#[derive(Clone, Debug)]
pub struct Samples {
    root: PathBuf,
    all: Vec<Sample>,
    asked: Asked,
    shard: Shard,
    advice: Advice,
    colours: ColorMap,
}

impl Samples {
    /// These samples, whose files results know as seen from `root`.
    ///
    /// # Errors
    /// Settings that make no sense.
    pub fn new(
        root: &Path,
        mut all: Vec<Sample>,
        settings: Settings,
        known: UserSpecified,
    ) -> Result<Self, SettingsError> {
        settings.check()?;
        check_user_specified(&known)?;
        all.sort_by(|a, b| a.name.cmp(&b.name));
        Ok(Self {
            root: root.to_owned(),
            all,
            asked: Asked {
                version: env!("CARGO_PKG_VERSION").to_owned(),
                settings,
                known,
            },
            shard: Shard::WHOLE,
            advice: no_advice,
            colours: ColorMap::default(),
        })
    }

    /// One share of them only.
    #[must_use]
    pub fn shard(self, shard: Shard) -> Self {
        Self { shard, ..self }
    }

    /// With what a front end says that helps against errors.
    #[must_use]
    pub fn advice(self, advice: Advice) -> Self {
        Self { advice, ..self }
    }
}

/// Analyses the samples of the shard, those that an earlier run has done left out, and goes on where one fails. With
/// all samples in one shard it writes the tables, too.
///
/// # Errors
/// [`SamplesError`]; after [`SamplesError::Cancelled`] finished samples are kept, and the same call goes on from there.
pub fn analyse_samples(
    asked: &Samples,
    out: &Path,
    job: &Job,
) -> Result<SamplesDone, SamplesError> {
    let whole = asked.shard == Shard::WHOLE;
    // Found out before the work, and held until the end: only one run writes tables.
    let tables = if whole {
        Some(tables::sink(out)?)
    } else {
        None
    };
    let parts = FileSink::open(&out.join(PARTS), true, &[])?;
    let shared = asked.all.iter().enumerate();
    let own: Vec<&Sample> = shared
        .filter(|(place, _)| asked.shard.has(*place))
        .map(|(_, sample)| sample)
        .collect();
    let (listed, counts) = asked.each(&own, out, &parts, job)?;
    let list = List::new(asked.asked.clone(), asked.shard, listed);
    parts.write(&[(PathBuf::from(asked.shard.list_name()), list.bytes())])?;
    drop(parts);
    if let Some(tables) = tables {
        tables::write(out, &list, tables)?;
    }
    Ok(counts)
}

/// Analyses the samples at these places of the sorted list, and writes their parts and no list: the work of a scheduler
/// that has shares of its own. [`analyse_samples`] afterwards finds them done.
///
/// # Errors
/// As [`analyse_samples`].
pub fn analyse_some(
    asked: &Samples,
    places: &[usize],
    out: &Path,
    job: &Job,
) -> Result<SamplesDone, SamplesError> {
    let parts = FileSink::open(&out.join(PARTS), true, &[])?;
    let own: Vec<&Sample> = places.iter().filter_map(|&n| asked.all.get(n)).collect();
    Ok(asked.each(&own, out, &parts, job)?.1)
}

/// Writes that the sample at this place failed, for these reasons, where its part is not there: a sample that ends every
/// process that looks at it.
///
/// # Errors
/// The part cannot be written.
pub fn give_up(asked: &Samples, place: usize, why: &str, out: &Path) -> Result<(), SamplesError> {
    let Some(sample) = asked.all.get(place) else {
        return Ok(());
    };
    let key = key(&asked.asked, &sample.name, &sample.files(&asked.root));
    let folder = out.join(PARTS);
    if matches!(Part::read(&folder, &key), Ok(Some(_))) {
        return Ok(());
    }
    let failed = FailedInput {
        file: sample.name.clone(),
        error: why.to_owned(),
    };
    let part = Part {
        sample: sample.name.clone(),
        key,
        picture: false,
        rows: vec![SampleRow::without_numbers(&sample.name, vec![failed])],
    };
    write(&FileSink::open(&folder, true, &[])?, &part, None)
}

impl Samples {
    /// How many samples there are, in all shards.
    pub fn len(&self) -> usize {
        self.all.len()
    }

    /// The sample at this place of the sorted list: its name, the hash of all that its results depend on, its files.
    pub fn sample(&self, place: usize) -> Option<(String, String, Vec<PathBuf>)> {
        let sample = self.all.get(place)?;
        let found = sample.files(&self.root);
        let key = key(&self.asked, &sample.name, &found);
        let files = found.files.into_iter().map(|(_, path)| path);
        Some((sample.name.clone(), key, files.collect()))
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// These samples in parallel.
    fn each(
        &self,
        own: &[&Sample],
        out: &Path,
        parts: &FileSink,
        job: &Job,
    ) -> Result<(Vec<Listed>, SamplesDone), SamplesError> {
        let stage = job.stage("analysing", "samples", own.len());
        let silent = job.silent();
        let done: Vec<(Listed, SamplesDone)> = job.run(|| {
            own.par_iter()
                .map(|sample| {
                    let done = self.one(sample, out, parts, &silent);
                    stage.step();
                    done
                })
                .collect::<Result<_, SamplesError>>()
        })??;
        drop(stage);
        let mut counts = SamplesDone::default();
        let mut listed = Vec::new();
        for (one, done) in done {
            counts.ok += done.ok;
            counts.doubtful += done.doubtful;
            counts.failed += done.failed;
            counts.done_before += done.done_before;
            listed.push(one);
        }
        Ok((listed, counts))
    }

    /// One sample, unless it is done already: under which key it is kept, and how it ended.
    fn one(
        &self,
        sample: &Sample,
        out: &Path,
        parts: &FileSink,
        job: &Job,
    ) -> Result<(Listed, SamplesDone), SamplesError> {
        job.check()?;
        let files = sample.files(&self.root);
        let key = key(&self.asked, &sample.name, &files);
        let listed = Listed {
            sample: sample.name.clone(),
            key: key.clone(),
        };
        // What is damaged is made again.
        if let Ok(Some(part)) = Part::read(&out.join(PARTS), &key) {
            let done_before = 1;
            let done = SamplesDone::of(&part.rows);
            return Ok((
                listed,
                SamplesDone {
                    done_before,
                    ..done
                },
            ));
        }
        let with = With {
            asked: &self.asked,
            advice: self.advice,
            colours: self.colours,
        };
        let found = analysed(&sample.name, &files, &with, job)?;
        let part = Part {
            sample: sample.name.clone(),
            key: key.clone(),
            picture: found.picture.is_some(),
            rows: found.rows,
        };
        write(parts, &part, found.picture)?;
        Ok((listed, SamplesDone::of(&part.rows)))
    }
}

/// The picture first: a part that is there is complete.
fn write(parts: &FileSink, part: &Part, picture: Option<Vec<u8>>) -> Result<(), SamplesError> {
    if let Some(picture) = picture {
        parts.write(&[(PathBuf::from(picture_name(&part.key)), picture)])?;
    }
    let bytes = part.bytes().unwrap_or_default();
    parts.write(&[(PathBuf::from(part_name(&part.key)), bytes)])?;
    Ok(())
}
