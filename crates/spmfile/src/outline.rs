//! What a reader makes of a file before it decodes a pixel: its frame, its channels, and where their
//! samples lie.

use crate::header::ChannelHeader;
use crate::options::ArrayOptions;
use crate::scan::Scan;
use crate::stored::{Flat, Stored};

/// What a reader is given.
pub(crate) struct Input<'a> {
    /// The bytes: all of them, or the first ones where the format has its header at the start.
    pub(crate) bytes: &'a [u8],
    /// Number of bytes of the whole file.
    pub(crate) length: u64,
    /// What the user tells of an array.
    pub(crate) options: ArrayOptions,
}

/// A file as its headers tell it.
#[derive(Default)]
pub(crate) struct Outline<'a> {
    /// Everything but the channels that can be read.
    pub(crate) scan: Scan,
    /// The channels that lie within the file, in its order.
    pub(crate) channels: Vec<Entry<'a>>,
    /// What is missing of a damaged file.
    pub(crate) damage: Option<String>,
    /// How many channels are announced, where a file is refused if none of them can be read.
    pub(crate) announced: Option<usize>,
    /// Decodes channels whose samples lie between each other.
    pub(crate) together: Option<Together<'a>>,
}

/// A channel and its samples.
pub(crate) struct Entry<'a> {
    pub(crate) header: ChannelHeader,
    pub(crate) samples: Stored<'a>,
}

/// Decodes the channels that are marked, each row by row from the bottom line.
pub(crate) type Together<'a> =
    Box<dyn Fn(&[bool]) -> Result<Mixed, crate::error::ReadError> + Send + Sync + 'a>;

/// Channels that were decoded together.
pub(crate) struct Mixed {
    /// The samples of those that were marked.
    pub(crate) values: Vec<Vec<f64>>,
    /// What is missing of them.
    pub(crate) damage: Option<String>,
}

impl<'a> Outline<'a> {
    /// A frame without channels.
    pub(crate) fn of(scan: Scan) -> Self {
        Self {
            scan,
            ..Self::default()
        }
    }

    /// Adds a channel.
    pub(crate) fn add(&mut self, header: ChannelHeader, samples: Stored<'a>) {
        self.channels.push(Entry { header, samples });
    }

    /// Adds a channel whose samples lie line by line.
    pub(crate) fn add_flat(&mut self, header: ChannelHeader, samples: Flat<'a>) {
        self.add(header, Stored::Flat(samples));
    }

    /// The same without anything borrowed; `None` where samples are kept otherwise than line by line.
    pub(crate) fn detached(self) -> Option<Outline<'static>> {
        self.map(Stored::detached)
    }

    fn map(
        self,
        samples: impl Fn(Stored<'a>) -> Option<Stored<'static>>,
    ) -> Option<Outline<'static>> {
        if self.together.is_some() {
            return None;
        }
        let entry = |entry: Entry<'a>| {
            Some(Entry {
                header: entry.header,
                samples: samples(entry.samples)?,
            })
        };
        Some(Outline {
            scan: self.scan,
            channels: self
                .channels
                .into_iter()
                .map(entry)
                .collect::<Option<_>>()?,
            damage: self.damage,
            announced: self.announced,
            together: None,
        })
    }

    /// The same with blocks copied, for bytes that are of no further use. Only for lines in blocks.
    pub(crate) fn owned(self) -> Option<Outline<'static>> {
        self.map(Stored::owned)
    }
}
