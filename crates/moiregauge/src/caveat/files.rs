//! Doubts about files and images: what was read, and what was left out.

use crate::caveat::explained::explain;

/// What was read, and what was left out.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FileDoubt {
    /// The file holds other images that may be meant.
    #[error(transparent)]
    SeveralImages(ImageChoice),
    /// Another channel than the usual one was taken.
    #[error("{channel} {why}")]
    ChannelChosen {
        /// The channel.
        channel: String,
        /// Why.
        why: ChannelReason,
    },
    /// What the reader of the format doubts.
    #[error("{0}")]
    ReaderDoubt(String),
    /// What the user said in place of the file.
    #[error("{0}")]
    GivenByUser(String),
    /// The data of another file, or the same file once more.
    #[error(
        "{}; a scan counts once, since the same noise twice would make errors too small",
        repeated(.of.as_ref())
    )]
    SameScanTwice {
        /// The other file; `None` where it is the same.
        of: Option<String>,
    },
    /// What the user does not want is not there.
    #[error("no scan has the name {pattern:?}, which was to be left out")]
    NothingExcluded {
        /// As the user said it.
        pattern: String,
    },
    /// The user wants none of the scans.
    #[error("the user excluded {}: nothing is left to analyse", all(*.scans))]
    EverythingExcluded {
        /// How many there are.
        scans: usize,
    },
    /// Trace or retrace could not be measured.
    #[error("one line direction could not be used: {reason}")]
    LineLeftOut {
        /// Why.
        reason: String,
    },
}

/// Which of several images was taken, where nobody said which.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ImageChoice {
    /// The first of several of one channel.
    #[error(
        "the file holds {count} images of {channel:?}: the first of them is analysed, and the others are not"
    )]
    First {
        /// The channel.
        channel: String,
        /// How many there are.
        count: usize,
    },
    /// The first of several channels, none of which has a usual name.
    #[error(
        "the file holds {count} images ({names}), none of which has the name of a channel that usually shows a moiré: \
         the first, {first:?}, is analysed, and the others are not"
    )]
    UnusualNames {
        /// How many there are.
        count: usize,
        /// The first few names.
        names: String,
        /// The one that was taken.
        first: String,
    },
}

/// Why a channel was taken.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ChannelReason {
    /// These channels, which come before it, show no lattice.
    #[error("is analysed, since no scan shows a lattice in {0}")]
    NoLatticeIn(String),
    /// No channel shows a lattice, and stripes stand out best in this one.
    #[error("is mapped, which shows the stripes best")]
    BestStripes,
}

fn repeated(of: Option<&String>) -> String {
    of.map_or_else(
        || "the file was given more than once".to_owned(),
        |of| format!("the file holds the same scan as {of}"),
    )
}

fn all(scans: usize) -> String {
    match scans {
        1 => "the only scan".to_owned(),
        n => format!("all {n} scans"),
    }
}

explain! { FileDoubt:
    SeveralImages "several-images" Warning
        "The file holds several images, and the first of them was taken. The numbers are those of that image alone."
        "Look at the images of the file, and say which of them shows the moiré."
    ChannelChosen "channel-chosen" Warning
        "The channel that usually shows the moiré shows none, so that another one was taken. What it shows need not be \
         the moiré."
        "Look at the image that was taken, and say which channel shows the moiré."
    ReaderDoubt "reader-doubt" Warning
        "The file is damaged, contradicts itself, or leaves something open that its reader had to assume. What is said \
         of it tells which numbers depend on that."
        "Compare size, line rate and frame direction with the log of the measurement, and give those that are wrong. \
         Export the scan again if the file is damaged."
    GivenByUser "given-by-user" Note
        "A size, a time or another entry of the file was replaced by what the user said. The numbers are as right as \
         that."
        "Make sure that it holds for every file that it was given for."
    SameScanTwice "same-scan-twice" Note
        "The same data were given twice, and count once: the same noise twice would make the errors too small."
        "Nothing, if the files are copies on purpose. Otherwise look for the scan that is missing."
    NothingExcluded "nothing-excluded" Warning
        "The name of a scan to leave out fits none of the scans, so that one that was not wanted may be among those used."
        "Compare the name with the list of scans and correct it."
    EverythingExcluded "everything-excluded" Serious
        "Every scan was left out by name. There is no result."
        "Leave out fewer scans."
    LineLeftOut "line-left-out" Note
        "Trace or retrace could not be measured, and the numbers of this scan rest on the other one. The two cannot be \
         compared, which would show creep and a lag of the sensors."
        "Look at the image that was left out. If it shows no lattice, nothing is lost but the comparison."
}
