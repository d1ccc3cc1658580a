//! One frame of a file: its header and channels are known, its samples are decoded when they are wanted.

use std::fmt;
use std::ops::Range;
use std::sync::OnceLock;

use crate::error::ReadError;
use crate::header::{ChannelHeader, Scaling};
use crate::judge::Verdict;
use crate::outline::{Entry, Mixed, Outline};
use crate::scan::{Channel, ChannelInfo, Samples, Scan, UnreadableChannel};
use crate::source::Data;
use crate::stored::{Failure, Flat, Stored};
use crate::whole::{all_missing, tidy};

/// One frame of a file, of which no sample has been decoded.
pub struct Frame<'a> {
    data: Data<'a>,
    outline: Outline<'a>,
    /// Places in the outline of the channels that can be read.
    readable: Vec<usize>,
    /// Of each of them, what its samples told when its rows were first read.
    verdicts: Vec<OnceLock<Verdict>>,
}

impl<'a> Frame<'a> {
    /// A frame whose samples are found in `data`.
    pub(crate) fn new(mut outline: Outline<'a>, data: Data<'a>) -> Self {
        tidy(&mut outline);
        let entries = outline.channels.iter().enumerate();
        let readable: Vec<usize> = entries
            .filter(|(_, entry)| !matches!(entry.samples, Stored::Refused(_)))
            .map(|(place, _)| place)
            .collect();
        Self {
            data,
            verdicts: readable.iter().map(|_| OnceLock::new()).collect(),
            readable,
            outline,
        }
    }

    /// Everything but the channels: [`Scan::channels`] is empty.
    pub fn header(&self) -> &Scan {
        &self.outline.scan
    }

    /// The channels that can be read, in the order of the file; their places are the numbers that
    /// [`Frame::read`] and [`Frame::rows`] take.
    pub fn channels(&self) -> impl ExactSizeIterator<Item = &ChannelHeader> {
        let channels = &self.outline.channels;
        self.readable.iter().map(|&place| &channels[place].header)
    }

    /// The channels that the file announces but that cannot be read.
    pub fn unreadable(&self) -> impl Iterator<Item = UnreadableChannel> {
        let refused = |entry: &Entry<'_>| match &entry.samples {
            Stored::Refused(error) => Some(UnreadableChannel {
                name: entry.header.info.name.clone(),
                error: error.clone(),
            }),
            _ => None,
        };
        let refused = self.outline.channels.iter().filter_map(refused);
        self.outline.scan.unreadable.iter().cloned().chain(refused)
    }

    /// What is missing of a damaged file; only [`crate::OpenOptions::damaged`] lets such files be opened.
    pub fn damage(&self) -> Option<&str> {
        self.outline.damage.as_deref()
    }

    /// How many channels the file announces: those that can be read and the others.
    pub(crate) fn announced(&self) -> usize {
        self.outline.channels.len() + self.outline.scan.unreadable.len()
    }

    /// Why nothing of it can be read, where the format refuses such files.
    pub(crate) fn nothing_readable(&self) -> Option<ReadError> {
        let announced = self.outline.announced?;
        let first = self.unreadable().next()?;
        self.readable.is_empty().then(|| none_of(announced, &first))
    }

    /// Decodes a channel.
    ///
    /// # Errors
    /// - There is no such channel.
    /// - Its samples cannot be decoded; the file is damaged or cannot be read any more.
    pub fn read(&self, channel: usize) -> Result<Channel, ReadError> {
        let place = self.place(channel)?;
        let entry = &self.outline.channels[place];
        if let (Stored::Mixed, Some(together)) = (&entry.samples, &self.outline.together) {
            let chosen: Vec<bool> = (0..self.outline.channels.len())
                .map(|n| n == place)
                .collect();
            return self.mixed_one(entry, together(&chosen)?);
        }
        match decoded(entry, &self.data) {
            Ok((channel, _)) => Ok(channel),
            Err(failure) => Err(failure.of(&entry.header)),
        }
    }

    /// The values of the lines `rows` of a channel, counted from the bottom, in [`ChannelHeader::unit`].
    ///
    /// Where samples lie line by line no others are decoded, but that a first call looks at all of them
    /// where only these tell the scale or which lines were never filled. Channels that are packed
    /// (pictures, archives, texts) are decoded as a whole.
    ///
    /// # Errors
    /// - There is no such channel, or it has fewer rows.
    /// - As [`Frame::read`].
    pub fn rows(&self, channel: usize, rows: Range<usize>) -> Result<Vec<f64>, ReadError> {
        let entry = &self.outline.channels[self.place(channel)?];
        let header = &entry.header;
        if rows.start > rows.end || rows.end > header.rows {
            return Err(ReadError::NoSuchRows {
                rows,
                found: header.rows,
            });
        }
        let Stored::Flat(flat) = &entry.samples else {
            return Ok(self.read(channel)?.lines(rows));
        };
        let verdict = self.verdict(channel, flat, header)?;
        let scaling = scaling(header, verdict).map_err(|failure| failure.of(header))?;
        flat.rows(&self.data, header, rows, verdict, &scaling)
    }

    /// The frame with this channel and none of its samples: for what depends on sizes and times alone.
    ///
    /// # Errors
    /// There is no such channel.
    pub fn without_samples(&self, channel: usize) -> Result<Scan, ReadError> {
        let header = &self.outline.channels[self.place(channel)?].header;
        let scaling = header.scaling.clone().unwrap_or_else(Scaling::as_stored);
        let mut scan = self.outline.scan.clone();
        let none = Samples::F64(Vec::new());
        scan.channels.push(header.with(none, &scaling));
        Ok(scan)
    }

    /// Decodes the channels for which `wanted` returns true.
    ///
    /// # Errors
    /// - The file is damaged; what lies within it comes with [`ReadError::Incomplete`].
    /// - All samples are missing, or none of the channels can be read.
    pub fn scan(&self, wanted: &dyn Fn(&ChannelInfo) -> bool) -> Result<Scan, ReadError> {
        self.fill(self.outline.scan.clone(), wanted)
    }

    /// The same, when the frame is of no further use.
    pub(crate) fn into_scan(
        mut self,
        wanted: &dyn Fn(&ChannelInfo) -> bool,
    ) -> Result<Scan, ReadError> {
        let scan = std::mem::take(&mut self.outline.scan);
        self.fill(scan, wanted)
    }

    fn fill(
        &self,
        mut scan: Scan,
        wanted: &dyn Fn(&ChannelInfo) -> bool,
    ) -> Result<Scan, ReadError> {
        let entries = &self.outline.channels;
        let chosen: Vec<bool> = entries.iter().map(|e| wanted(&e.header.info)).collect();
        let mut damage = self.outline.damage.clone();
        let mut mixed = Vec::new().into_iter();
        if let Some(together) = &self.outline.together {
            let found = together(&chosen)?;
            mixed = found.values.into_iter();
            damage = damage.or(found.damage);
        }
        let mut without_scale = Vec::new();
        for (entry, _) in entries.iter().zip(&chosen).filter(|(_, chosen)| **chosen) {
            let done = match &entry.samples {
                Stored::Mixed => {
                    let samples = Samples::F64(mixed.next().unwrap_or_default());
                    Ok((entry.header.with(samples, &Scaling::as_stored()), None))
                }
                _ => decoded(entry, &self.data),
            };
            match done {
                Ok((channel, note)) => {
                    scan.metadata.extend(note);
                    scan.channels.push(channel);
                }
                Err(Failure::File(error)) => return Err(error),
                Err(Failure::Scale(error)) => without_scale.push(unreadable(entry, None, error)),
                Err(Failure::Channel { name, error }) => {
                    scan.unreadable.push(unreadable(entry, name, error));
                }
                Err(Failure::Lost(error)) => {
                    let lost = format!("channel {:?}: {error}", entry.header.info.name);
                    damage =
                        Some(damage.map_or(lost.clone(), |before| format!("{before}; {lost}")));
                    scan.unreadable.push(unreadable(entry, None, error));
                }
            }
        }
        if let Some(reason) = damage {
            scan.unreadable.extend(without_scale);
            return Err(ReadError::Incomplete {
                reason,
                readable: Box::new(scan),
            });
        }
        let skipped = chosen.contains(&false);
        if let Some(announced) = self.outline.announced
            && let (true, Some(first)) = (scan.channels.is_empty(), scan.unreadable.first())
            && !skipped
        {
            return Err(none_of(announced, first));
        }
        scan.unreadable.extend(without_scale);
        if all_missing(&scan) {
            return Err(ReadError::AllMissing {
                channels: scan.channels.len(),
            });
        }
        Ok(scan)
    }

    fn place(&self, channel: usize) -> Result<usize, ReadError> {
        let found = self.readable.get(channel).copied();
        found.ok_or(ReadError::NoSuchChannel {
            channel,
            found: self.readable.len(),
        })
    }

    /// What all samples of a channel tell, looked at once.
    fn verdict(
        &self,
        channel: usize,
        flat: &Flat<'a>,
        header: &ChannelHeader,
    ) -> Result<&Verdict, ReadError> {
        let kept = &self.verdicts[channel];
        if let Some(verdict) = kept.get() {
            return Ok(verdict);
        }
        let judged = flat.judged(&self.data, header);
        let verdict = judged.map_err(|failure| failure.of(header))?;
        Ok(kept.get_or_init(|| verdict))
    }

    /// The one channel that was decoded of several that lie between each other.
    fn mixed_one(&self, entry: &Entry<'_>, found: Mixed) -> Result<Channel, ReadError> {
        let samples = Samples::F64(found.values.into_iter().next().unwrap_or_default());
        let channel = entry.header.with(samples, &Scaling::as_stored());
        let Some(reason) = found.damage else {
            return Ok(channel);
        };
        let mut readable = Box::new(self.outline.scan.clone());
        readable.channels.push(channel);
        Err(ReadError::Incomplete { reason, readable })
    }
}

/// A channel with its samples and notes.
type Decoded = (Channel, Option<(String, String)>);

fn decoded(entry: &Entry<'_>, data: &Data<'_>) -> Result<Decoded, Failure> {
    let header = &entry.header;
    let (samples, note, verdict) = match &entry.samples {
        Stored::Flat(flat) => {
            let (samples, verdict) = flat.whole(data, header)?;
            (samples, None, verdict)
        }
        Stored::Packed(unpack) => {
            let unpacked = unpack()?;
            let note = unpacked.rendering.then(|| rendering(&header.info.name));
            (unpacked.samples, note, Verdict::default())
        }
        Stored::Mixed => (Samples::F64(Vec::new()), None, Verdict::default()),
        Stored::Refused(error) => return Err(Failure::channel(error.clone())),
    };
    let scaling = scaling(header, &verdict)?;
    Ok((header.with(samples, &scaling), note))
}

/// The scale that the samples tell, or the header.
fn scaling(header: &ChannelHeader, verdict: &Verdict) -> Result<Scaling, Failure> {
    let told = verdict.scaling.as_ref().or(header.scaling.as_ref());
    let scaling = told.cloned().unwrap_or_else(Scaling::as_stored);
    if scaling.is_finite() {
        return Ok(scaling);
    }
    Err(Failure::Scale(format!(
        "expected a scale, found {} + {}",
        scaling.scale, scaling.offset
    )))
}

fn rendering(name: &str) -> (String, String) {
    let note = format!(
        "{name:?} is the luminance (0.299 red + 0.587 green + 0.114 blue) of a coloured picture: a \
         rendering, not measured values"
    );
    ("rendering".to_owned(), note)
}

fn unreadable(entry: &Entry<'_>, name: Option<String>, error: String) -> UnreadableChannel {
    UnreadableChannel {
        name: name.unwrap_or_else(|| entry.header.info.name.clone()),
        error,
    }
}

fn none_of(announced: usize, first: &UnreadableChannel) -> ReadError {
    ReadError::NoReadableChannel {
        announced,
        name: first.name.clone(),
        reason: first.error.clone(),
    }
}

impl fmt::Debug for Frame<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Frame")
            .field("header", self.header())
            .field("channels", &self.channels().collect::<Vec<_>>())
            .field("damage", &self.damage())
            .finish_non_exhaustive()
    }
}
