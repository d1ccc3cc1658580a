//! Why a file is not read: what was expected, what was found.

use std::ops::Range;

use crate::scan::Scan;

/// What a user may hand in, for messages about everything else.
const EXPECTED: &str = "a scan (NanoScope, Nanonis, Gwyddion, Igor, JPK, Nanosurf, Park, WSxM, RHK, \
                        Createc, GXSM, Agilent, ISO 28632, Omicron Matrix), an array or a picture";

/// Why a file is refused as a whole.
///
/// A file is refused when its bytes do not keep what its header promises (a channel cut off, a
/// section missing), because then nothing in it can be trusted blindly; the rest
/// travels with [`ReadError::Incomplete`]. A file in which merely one channel is scaled in an
/// unknown way is read, with that channel in [`Scan::unreadable`].
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// No bytes.
    #[error("the file is empty")]
    Empty,
    /// A known kind of file, but not one that is read.
    #[error("this is {found}; expected {EXPECTED}")]
    OtherFormat {
        /// The kind of file, in words.
        found: &'static str,
    },
    /// Text that is no scan.
    #[error("this is a text file beginning with {start:?}; expected {EXPECTED}")]
    Text {
        /// Its first words.
        start: String,
    },
    /// Nothing known.
    #[error("unknown kind of file, beginning with the bytes {start}; expected {EXPECTED}")]
    Unknown {
        /// Its first bytes in hexadecimal.
        start: String,
    },
    /// A file of a known format that is not what its own header says.
    #[error("this {format} file is damaged: {reason}")]
    Damaged {
        /// The format, as in `Nanonis`.
        format: &'static str,
        /// What was expected, what was found, and where.
        reason: String,
    },
    /// A whole file of a known format that holds no image that can be read.
    #[error("this {format} file is not read: {reason}")]
    Unsupported {
        /// The format, as in `Igor binary wave`.
        format: &'static str,
        /// What it holds, or what is not known how to read.
        reason: String,
    },
    /// Images without a sample.
    #[error(
        "all samples of the {channels} channels are missing (NaN): the scan was stopped before its first line"
    )]
    AllMissing {
        /// Number of channels read.
        channels: usize,
    },
    /// Force curves.
    #[error("the file holds force curves and no image; save the scan itself")]
    ForceCurve,
    /// A force volume.
    #[error("the file is a force volume; its height map is not a scan whose values can be trusted")]
    ForceVolume,
    /// The header has no end.
    #[error(
        "the header has no `\\*File list end`: the file was cut off inside the header after {found} bytes, or is damaged"
    )]
    HeaderCutOff {
        /// Length of the file.
        found: usize,
    },
    /// Too many sections to be true.
    #[error("the header announces {found} images; at most {limit} are expected in one file")]
    TooManyChannels {
        /// Images announced.
        found: usize,
        /// The limit.
        limit: usize,
    },
    /// A header without any image.
    #[error("the header announces no image (no section `\\*Ciao image list`)")]
    NoImage,
    /// A header and nothing after it.
    #[error(
        "the file is a header without data: it announces {announced} channels up to byte {expected}, but ends at byte {found}"
    )]
    HeaderOnly {
        /// Number of channels announced.
        announced: usize,
        /// Where the last one would end.
        expected: u64,
        /// Length of the file.
        found: usize,
    },
    /// A transfer in text mode removed bytes all over the file.
    #[error(
        "the file was damaged by a transfer in text mode: its line ends are LF instead of CRLF and bytes are missing (expected {expected}, found {found}); copy it again in binary mode"
    )]
    LineEndsChanged {
        /// Where the last channel would end.
        expected: u64,
        /// Length of the file.
        found: usize,
    },
    /// Damaged, with channels in it that lie within the file.
    #[error("the file is damaged: {reason}; {} of {} channels lie within the file", .readable.channels.len(), .readable.channels.len() + .readable.unreadable.len())]
    Incomplete {
        /// What is missing.
        reason: String,
        /// The channels that lie within the file, to look at; `reason` says whether the data have
        /// moved, in which case their values are wrong.
        readable: Box<Scan>,
    },
    /// Damaged, found out before anything was decoded: see [`crate::OpenOptions::damaged`].
    #[error("the file is damaged: {reason}; {within} of {announced} channels lie within the file")]
    CutOff {
        /// What is missing.
        reason: String,
        /// Number of channels that lie within the file.
        within: usize,
        /// Number of channels announced.
        announced: usize,
    },
    /// One channel cannot be read.
    #[error("channel {name:?} cannot be read: {reason}")]
    Channel {
        /// Its name.
        name: String,
        /// What was expected, what was found.
        reason: String,
    },
    /// Fewer channels than that.
    #[error("expected a channel below {found}, found {channel}: the first one is number 0")]
    NoSuchChannel {
        /// The number asked for.
        channel: usize,
        /// Number of channels.
        found: usize,
    },
    /// Fewer rows than that.
    #[error("expected rows within 0..{found}, found {rows:?}")]
    NoSuchRows {
        /// The rows asked for.
        rows: Range<usize>,
        /// Number of rows.
        found: usize,
    },
    /// The bytes cannot be had.
    #[error("expected {length} bytes at byte {at}: {reason}")]
    Source {
        /// First byte.
        at: u64,
        /// Number of bytes.
        length: usize,
        /// What the system says.
        reason: String,
    },
    /// A format whose bytes are needed all at once.
    #[error("a {format} file is read as a whole: give all of its bytes")]
    WholeOnly {
        /// The format.
        format: &'static str,
    },
    /// A format that this build leaves out.
    #[error(
        "{format} files need the feature `{feature}` of the crate spmfile, which this build does not have"
    )]
    NotBuilt {
        /// The format.
        format: &'static str,
        /// The feature.
        feature: &'static str,
    },
    /// Nothing in it can be read.
    #[error("none of the {announced} channels can be read; {name}: {reason}")]
    NoReadableChannel {
        /// Number of channels announced.
        announced: usize,
        /// Name of the first one.
        name: String,
        /// Why it cannot be read.
        reason: String,
    },
}

impl ReadError {
    /// The refusal of a file of this format whose bytes contradict it.
    pub(crate) fn damaged(format: &'static str, reason: impl Into<String>) -> Self {
        Self::Damaged {
            format,
            reason: reason.into(),
        }
    }

    /// The refusal of a file of this format that holds what is not read.
    pub(crate) fn unsupported(format: &'static str, reason: impl Into<String>) -> Self {
        Self::Unsupported {
            format,
            reason: reason.into(),
        }
    }
}
