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
        "each scan counts once: {}. Counted twice, its noise would make the errors too small",
        repeated(.of.as_ref())
    )]
    SameScanTwice {
        /// The other file; `None` where it is the same.
        of: Option<String>,
    },
    /// What the user does not want is not there.
    #[error("a scan that should be left out may have been used: no scan has the name {pattern:?}")]
    NothingExcluded {
        /// As the user said it.
        pattern: String,
    },
    /// The user wants none of the scans.
    #[error("no scan is left to analyse: the user excluded {}", all(*.scans))]
    EverythingExcluded {
        /// How many there are.
        scans: usize,
    },
    /// Trace or retrace could not be measured.
    #[error(
        "the numbers of the scan come from one line direction alone, since the other could not be used: {reason}"
    )]
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
        "only the first of {count} images of {channel:?} is analysed. Select the one that shows the moiré"
    )]
    First {
        /// The channel.
        channel: String,
        /// How many there are.
        count: usize,
    },
    /// The first of several channels, none of which has a usual name.
    #[error(
        "only the first image, {first:?}, is analysed: the file holds {count} images ({names}), and none has the name \
          of a channel that usually shows a moiré"
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
    #[error("is analysed, because no scan shows a lattice in {0}")]
    NoLatticeIn(String),
    /// No channel shows a lattice, and stripes stand out best in this one.
    #[error("is mapped, because it shows the stripes best")]
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
        "The file holds several images. Only the first one was analysed."
        "Look at the images in the file and select the one that shows the moiré."
    ChannelChosen "channel-chosen" Warning
        "No scan shows a lattice in the channel that usually shows the moiré. Another channel was taken. The lattice \
         in it may not be the moiré."
        "Look at the image that was taken, and select the channel that shows the moiré."
    ReaderDoubt "reader-doubt" Warning
        "The file is damaged, contradicts itself, or lacks an entry that had to be assumed. The message says which \
         numbers depend on it."
        "Compare size, line rate and frame direction with the log of the measurement, and give the correct values for \
         those that are wrong. If the file is damaged, export the scan again."
    GivenByUser "given-by-user" Note
        "A size, a time or another entry of the file was replaced by a value that the user gave. If the value is \
         wrong, the results are wrong."
        "Check that the value holds for every file it was given for."
    SameScanTwice "same-scan-twice" Note
        "The same data were given twice. They count once; counted twice, their noise would make the errors too small."
        "Nothing, if the files are copies on purpose. Otherwise look for the scan that is missing."
    NothingExcluded "nothing-excluded" Warning
        "A name of a scan to leave out matches none of the scans. A scan that you wanted to leave out may have been \
         used."
        "Compare the name with the list of scans and correct it."
    EverythingExcluded "everything-excluded" Serious
        "Every scan was left out by name. There is no result."
        "Leave out fewer scans."
    LineLeftOut "line-left-out" Note
        "Trace or retrace could not be measured. The numbers of this scan come from the other line direction alone. \
         Creep and a lag of the sensors, which show as a difference of the two, cannot be checked."
        "Look at the image that was left out. If it shows no lattice, nothing is lost but the comparison."
}
