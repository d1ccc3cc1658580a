//! A file → what is needed of it: the chosen channel and the position sensors.

use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use moiregauge::campaign::amplitude_of;
use moiregauge::caveat::{Caveat, FileDoubt};
use moiregauge::scan::{MeasureError, choose_channel, unusual_channels};
use moiregauge::settings::Settings;
use moiregauge_report::InputFile;
use spmfile::{ChannelInfo, ReadError, Scan, sensor_axis};

use crate::content::Content;
use crate::in_memory::ScanInMemory;
use crate::known::{Known, KnownError};
use crate::memory::{NotEnoughMemory, enough_for};
use crate::names;
use crate::reading::FileError;

/// Why a file gives no measured scan.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum InputError {
    /// It cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// It is no scan, or a damaged one.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// It does not hold what was told of it.
    #[error(transparent)]
    Known(#[from] KnownError),
    /// Its image is too large.
    #[error(transparent)]
    Memory(#[from] NotEnoughMemory),
    /// Its image cannot be measured.
    #[error(transparent)]
    Measure(#[from] MeasureError),
    /// Results name a file that was not given.
    #[error("it is not one of the inputs")]
    NotAnInput,
}

/// A file as the analysis reads it.
#[derive(Debug)]
pub struct Reading {
    /// The chosen channel and the position sensors; of a scan in memory all channels.
    pub scan: Arc<Scan>,
    /// What identifies the file.
    pub input: InputFile,
    /// What the user's options replaced in it, and what its reader doubts.
    pub caveats: Vec<Caveat>,
}

/// A file in memory, with the names of its channels: the user's and the instrument's own, without those that the user
/// calls position sensors.
#[derive(Debug)]
pub struct Opened<'a> {
    path: &'a Path,
    known: &'a Known,
    held: Held<'a>,
    channels: Vec<(String, String)>,
}

/// What is opened.
#[derive(Debug)]
enum Held<'a> {
    File(Content),
    Scan(&'a ScanInMemory),
}

impl<'a> Opened<'a> {
    /// Opens a file once, for all that is taken of it.
    ///
    /// # Errors
    /// It cannot be read, or is no scan.
    pub fn new(path: &'a Path, known: &'a Known) -> Result<Self, InputError> {
        let (held, channels) = if let Some(scan) = known.in_memory(path) {
            (Held::Scan(scan), names_of(&scan.scan()))
        } else {
            let content = known.source(path).content()?;
            let channels = channels(path, &content, known)?;
            (Held::File(content), channels)
        };
        Ok(Self {
            path,
            known,
            held,
            channels,
        })
    }

    /// The names of its channels.
    pub fn names(&self) -> Vec<(&str, &str)> {
        let both = self.channels.iter();
        both.map(|(name, internal)| (name.as_str(), internal.as_str()))
            .collect()
    }

    /// The chosen channel and the position sensors, and what the user's options replaced in them.
    fn scan(
        &self,
        settings: &Settings,
        companion: impl Fn(&str) -> Option<String>,
    ) -> Result<(Arc<Scan>, Vec<String>), InputError> {
        let content = match &self.held {
            Held::File(content) => content,
            Held::Scan(held) => return Ok((held.scan(), Vec::new())),
        };
        let names = self.names();
        let chosen = choose_channel(&names, settings.channel.as_deref());
        let beside = chosen.and_then(companion);
        let wanted = |channel: &ChannelInfo| {
            chosen.is_none_or(|name| *name == channel.name)
                || beside.as_ref() == Some(&channel.name.to_lowercase())
                || sensor_axis(&channel.name, &channel.internal_name).is_some()
        };
        let (scan, replaced) = self.known.read(self.path, content, &wanted)?;
        Ok((Arc::new(scan), replaced))
    }

    /// The chosen channel and the position sensors alone; not more than the memory holds while it is analysed.
    ///
    /// # Errors
    /// [`InputError`].
    pub fn image(&self, settings: &Settings) -> Result<Arc<Scan>, InputError> {
        let (scan, _) = self.scan(settings, |_| None)?;
        enough_for(&scan)?;
        Ok(scan)
    }

    /// What identifies it.
    pub fn identity(&self) -> InputFile {
        match &self.held {
            Held::File(content) => content.identity(self.path),
            Held::Scan(held) => held.identity(names::in_words(self.path)),
        }
    }

    /// All that the analysis needs, of an image of any size.
    ///
    /// # Errors
    /// [`InputError`].
    pub fn reading(&self, settings: &Settings) -> Result<Reading, InputError> {
        // Hashing takes as long as decoding.
        let (scan, input) = rayon::join(|| self.scan(settings, |_| None), || self.identity());
        let (scan, replaced) = scan?;
        let several = unusual_channels(&self.names(), settings.channel.as_deref());
        let several = several.map(FileDoubt::SeveralImages);
        let replaced = replaced.into_iter().map(FileDoubt::GivenByUser);
        let doubts = scan.notes.iter().cloned().map(FileDoubt::ReaderDoubt);
        let all = several.into_iter().chain(replaced).chain(doubts);
        Ok(Reading {
            caveats: all
                .map(|doubt| Caveat::new(doubt, input.file.as_str()))
                .collect(),
            scan,
            input,
        })
    }
}

/// The names of the channels of a file, in its order.
fn channels(
    path: &Path,
    content: &Content,
    known: &Known,
) -> Result<Vec<(String, String)>, ReadError> {
    let channels = RefCell::new(Vec::new());
    known.decode(path, content, &|channel: &ChannelInfo| {
        channels
            .borrow_mut()
            .push((channel.name.clone(), channel.internal_name.clone()));
        false
    })?;
    let mut channels = channels.into_inner();
    channels.retain(|(name, internal)| !known.names_sensor(name, internal));
    Ok(channels)
}

/// The names of the channels of a scan, in its order.
fn names_of(scan: &Scan) -> Vec<(String, String)> {
    let all = scan.channels.iter();
    all.map(|c| (c.name.clone(), c.internal_name.clone()))
        .collect()
}

/// Reads what the analysis needs of a file; not more than the memory holds while it is analysed.
///
/// # Errors
/// [`InputError`].
pub fn read_scan(path: &Path, settings: &Settings, known: &Known) -> Result<Reading, InputError> {
    let reading = Opened::new(path, known)?.reading(settings)?;
    enough_for(&reading.scan)?;
    Ok(reading)
}

/// The image of an input that the results know by the words of its path.
///
/// # Errors
/// [`InputError`].
pub fn read_again(
    inputs: &[PathBuf],
    words: &str,
    settings: &Settings,
    known: &Known,
) -> Result<Arc<Scan>, InputError> {
    let path = names::with_words(inputs, words).ok_or(InputError::NotAnInput)?;
    let (scan, _) = Opened::new(path, known)?.scan(settings, |_| None)?;
    enough_for(&scan)?;
    Ok(scan)
}

/// The image of a file, with what is shown beside it: the amplitude of a phase. None where it cannot be read.
pub fn read_shown(path: &Path, settings: &Settings, known: &Known) -> Option<Arc<Scan>> {
    let opened = Opened::new(path, known).ok()?;
    Some(opened.scan(settings, amplitude_of).ok()?.0)
}
