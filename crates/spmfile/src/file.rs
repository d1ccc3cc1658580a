//! A file, opened: what it holds is known, and no sample has been decoded.

use std::sync::Arc;

use crate::detect::detect;
use crate::error::ReadError;
use crate::format::Format;
use crate::frame::Frame;
use crate::options::ArrayOptions;
use crate::outline::{Input, Outline};
use crate::readers::Reader;
use crate::source::{Data, Source};
use crate::words;

/// Bytes in which a header is searched first; most have less.
const HEAD: u64 = 128 << 10;
/// And then: those of NanoScope files may have 4 MB.
const LONG_HEAD: u64 = 5 << 20;

/// A file whose headers were read.
///
/// ```
/// let file = spmfile::File::open(b"# Value units: nm\n1 2 3\n4 5 6\n")?;
/// let frame = &file.frames()[0];
/// for channel in frame.channels() {
///     println!("{}: {} x {} in {}", channel.info.name, channel.rows, channel.columns, channel.unit);
/// }
/// assert_eq!(frame.rows(0, 0..1)?, [4.0, 5.0, 6.0]);
/// # Ok::<(), spmfile::ReadError>(())
/// ```
#[derive(Debug)]
pub struct File<'a> {
    format: Format,
    frames: Vec<Frame<'a>>,
}

/// How a file is opened.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct OpenOptions {
    /// The format, where [`crate::detect()`] has told it before.
    pub format: Option<Format>,
    /// What the user tells of an array.
    pub array: ArrayOptions,
    /// Whether a damaged file is opened, for what lies within it; [`Frame::damage`] says what is
    /// missing.
    pub damaged: bool,
}

impl<'a> File<'a> {
    /// Opens a file of any format in memory.
    ///
    /// # Errors
    /// - The bytes are no scan, or one of a kind that is not read: the variant names it.
    /// - The file is damaged, as far as its headers and its length tell: [`ReadError::CutOff`] and
    ///   others.
    pub fn open(bytes: &'a [u8]) -> Result<Self, ReadError> {
        Self::open_with(bytes, &OpenOptions::default())
    }

    /// The same, told more.
    ///
    /// # Errors
    /// As [`File::open`].
    pub fn open_with(bytes: &'a [u8], options: &OpenOptions) -> Result<Self, ReadError> {
        #[cfg(test)]
        crate::seeds::keep(bytes);
        let format = options.format.unwrap_or_else(|| detect(bytes));
        let reader = Reader::of(format).ok_or_else(|| no_reader(format, bytes))?;
        let input = Input {
            bytes,
            length: bytes.len() as u64,
            options: options.array.clone(),
        };
        Self::of(format, (reader.open)(&input)?, Data::Bytes(bytes), options)
    }

    /// Opens a file whose header is at its start and whose samples lie line by line, without having its
    /// bytes in memory: NanoScope, Nanonis, Gwyddion simple field, Nanosurf, `WSxM`, Agilent, `.npy`.
    ///
    /// # Errors
    /// - [`ReadError::WholeOnly`] for other formats, and for arrays stored column by column.
    /// - The bytes cannot be read.
    /// - As [`File::open`].
    pub fn open_source(
        source: Arc<dyn Source + 'a>,
        options: &OpenOptions,
    ) -> Result<Self, ReadError> {
        let length = source.length().map_err(|error| ReadError::Source {
            at: 0,
            length: 0,
            reason: error.to_string(),
        })?;
        let data = Data::Source(source);
        let (mut format, mut outline) = Self::head(&data, length, HEAD.min(length), options);
        if outline.is_err() && length > HEAD {
            (format, outline) = Self::head(&data, length, LONG_HEAD.min(length), options);
        }
        Self::of(format, outline?, data, options)
    }

    /// The format and the outline of a file by its first bytes.
    fn head(
        data: &Data<'_>,
        length: u64,
        first: u64,
        options: &OpenOptions,
    ) -> (Format, Result<Outline<'static>, ReadError>) {
        let bytes = match data.get(0, first as usize) {
            Ok(bytes) => bytes,
            Err(error) => return (Format::Unknown, Err(error)),
        };
        let format = options.format.unwrap_or_else(|| detect(&bytes));
        let outline = || {
            let reader = Reader::of(format).ok_or_else(|| no_reader(format, &bytes))?;
            let whole = ReadError::WholeOnly {
                format: reader.name,
            };
            if !reader.flat {
                return Err(whole);
            }
            let input = Input {
                bytes: &bytes,
                length,
                options: options.array.clone(),
            };
            (reader.open)(&input)?.detached().ok_or(whole)
        };
        (format, outline())
    }

    fn of(
        format: Format,
        outline: Outline<'a>,
        data: Data<'a>,
        options: &OpenOptions,
    ) -> Result<Self, ReadError> {
        let frame = Frame::new(outline, data);
        if !options.damaged {
            if let Some(reason) = frame.damage() {
                return Err(ReadError::CutOff {
                    reason: reason.to_owned(),
                    within: frame.channels().len(),
                    announced: frame.announced(),
                });
            }
            if let Some(error) = frame.nothing_readable() {
                return Err(error);
            }
        }
        Ok(Self {
            format,
            frames: vec![frame],
        })
    }

    /// The format.
    pub fn format(&self) -> Format {
        self.format
    }

    /// The frames, at least one. Channels of one frame were recorded together. A file has one; those of
    /// Omicron Matrix, which may have two, need [`crate::matrix::open`].
    pub fn frames(&self) -> &[Frame<'a>] {
        &self.frames
    }

    /// The frames, when the file is of no further use.
    pub fn into_frames(self) -> Vec<Frame<'a>> {
        self.frames
    }
}

/// Why bytes are read by nobody.
fn no_reader(format: Format, bytes: &[u8]) -> ReadError {
    match format {
        Format::Empty => ReadError::Empty,
        Format::Other(found) => ReadError::OtherFormat { found },
        Format::Text => ReadError::Text {
            start: words::beginning(bytes),
        },
        _ => ReadError::Unknown {
            start: format!("{:02x?}", &bytes[..bytes.len().min(8)]),
        },
    }
}
