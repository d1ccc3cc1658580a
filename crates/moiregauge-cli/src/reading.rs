//! A file → what is needed of it: the chosen channel and the position sensors.

use std::cell::RefCell;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use moiregauge::campaign::amplitude_of;
use moiregauge::caveat::{Caveat, FileDoubt};
use moiregauge::scan::{choose_channel, unusual_channels};
use moiregauge::settings::Settings;
use moiregauge_pipeline::{Content, Known, enough_for, names};
use moiregauge_report::InputFile;
use spmfile::{ChannelInfo, ReadError, Scan, sensor_axis};

use crate::input::with_option;

/// A file as the analysis reads it.
pub(crate) struct Reading {
    pub(crate) scan: Scan,
    pub(crate) input: InputFile,
    /// What the user's options replaced in it, and what its reader doubts.
    pub(crate) caveats: Vec<Caveat>,
}

/// A file in memory, with the names of its channels: the user's and the instrument's own, without those that the user
/// calls position sensors.
pub(crate) struct Opened<'a> {
    path: &'a Path,
    known: &'a Known,
    content: Content,
    channels: Vec<(String, String)>,
}

impl<'a> Opened<'a> {
    /// Opens a file once, for all that is taken of it.
    pub(crate) fn new(path: &'a Path, known: &'a Known) -> anyhow::Result<Self> {
        let content = Content::read(known.place(path))?;
        let channels = channels(path, &content, known)?;
        Ok(Self {
            path,
            known,
            content,
            channels,
        })
    }

    /// The names of its channels.
    pub(crate) fn names(&self) -> Vec<(&str, &str)> {
        let both = self.channels.iter();
        both.map(|(name, internal)| (name.as_str(), internal.as_str()))
            .collect()
    }

    /// The chosen channel and the position sensors, and what the user's options replaced in them.
    fn scan(
        &self,
        settings: &Settings,
        companion: impl Fn(&str) -> Option<String>,
    ) -> anyhow::Result<(Scan, Vec<String>)> {
        let names = self.names();
        let chosen = choose_channel(&names, settings.channel.as_deref());
        let beside = chosen.and_then(companion);
        let wanted = |channel: &ChannelInfo| {
            chosen.is_none_or(|name| *name == channel.name)
                || beside.as_ref() == Some(&channel.name.to_lowercase())
                || sensor_axis(&channel.name, &channel.internal_name).is_some()
        };
        let read = self.known.read(self.path, &self.content, &wanted);
        read.map_err(with_option)
    }

    /// The chosen channel and the position sensors alone; not more than the memory holds while it is analysed.
    pub(crate) fn image(&self, settings: &Settings) -> anyhow::Result<Scan> {
        let (scan, _) = self.scan(settings, |_| None)?;
        enough_for(&scan)?;
        Ok(scan)
    }

    /// All that the analysis needs, of an image of any size.
    pub(crate) fn reading(&self, settings: &Settings) -> anyhow::Result<Reading> {
        let (scan, replaced) = self.scan(settings, |_| None)?;
        let input = self.content.identity(self.path);
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

/// Reads what the analysis needs of a file; not more than the memory holds while it is analysed.
pub(crate) fn read(path: &Path, settings: &Settings, known: &Known) -> anyhow::Result<Reading> {
    let reading = Opened::new(path, known)?.reading(settings)?;
    enough_for(&reading.scan)?;
    Ok(reading)
}

/// The image of an input that the results know by the words of its path.
pub(crate) fn read_again(
    inputs: &[PathBuf],
    words: &str,
    settings: &Settings,
    known: &Known,
) -> anyhow::Result<Scan> {
    let path = names::with_words(inputs, words).context("it is none of the inputs")?;
    let (scan, _) = Opened::new(path, known)?.scan(settings, |_| None)?;
    enough_for(&scan)?;
    Ok(scan)
}

/// The image of a file, with what is shown beside it: the amplitude of a phase. None where it cannot be read.
pub(crate) fn read_shown(path: &Path, settings: &Settings, known: &Known) -> Option<Scan> {
    let opened = Opened::new(path, known).ok()?;
    Some(opened.scan(settings, amplitude_of).ok()?.0)
}
