//! Named doubts: what a reader of the numbers has to know before trusting them.
//!
//! Each subject has a file: its doubts with their words, and below them the table of what these mean and what to do.
//! Numbers are in nm, s and rad; the words have degrees and per cent.

pub(crate) mod calibrating;
pub(crate) mod drifting;
mod explained;
pub(crate) mod files;
pub(crate) mod kinds;
pub(crate) mod lattices;
mod maps;
pub(crate) mod moires;
pub(crate) mod orientation;
pub(crate) mod patterns;
pub(crate) mod positions;
pub(crate) mod readings;
mod recorded;
pub(crate) mod sets;

pub use calibrating::CalibrationDoubt;
pub use drifting::{DriftDoubt, FrameDates};
pub use explained::{Explained, Severity};
pub use files::{ChannelReason, FileDoubt, ImageChoice};
pub use kinds::Having;
pub use lattices::{LatticeDoubt, LineDifference, OtherGrain};
pub use maps::{MapDoubt, Mapped, SurveyDrift};
pub use moires::{Impossible, MoireDoubt, PeriodDoubt};
pub use orientation::{OrientationDoubt, SenseNumbers};
pub use patterns::PatternDoubt;
pub use positions::PositionDoubt;
pub use readings::{ChosenBy, NumbersOfName, ReadingDoubt, TwistShift};
pub use recorded::RecordedDoubt;
pub use sets::{DifferentSamples, Scattered, SetDoubt};

/// A reason to trust a number less.
#[derive(Clone, Debug, PartialEq)]
pub struct Caveat {
    /// What is doubtful, with its numbers.
    pub doubt: Doubt,
    /// What it concerns: a file, a set, or `analysis`.
    pub place: String,
    /// Where it stands for those of several scans of a set: how many have it.
    pub having: Option<Having>,
}

impl Caveat {
    /// A doubt about `place`.
    pub fn new(doubt: impl Into<Doubt>, place: impl Into<String>) -> Self {
        Self {
            doubt: doubt.into(),
            place: place.into(),
            having: None,
        }
    }

    /// Stable kebab-case code, as in `no-position-sensors`.
    pub fn code(&self) -> &'static str {
        self.doubt.explained().code
    }

    /// What is wrong and what it means for the result, in words.
    pub fn message(&self) -> String {
        let having = self.having.as_ref();
        format!(
            "{}{}",
            self.doubt,
            having.map_or_else(String::new, Having::to_string)
        )
    }

    /// What was tried before it was raised, one line for each attempt. Empty for most caveats.
    pub fn attempts(&self) -> &[String] {
        match &self.doubt {
            Doubt::Drift(doubt) => doubt.attempts(),
            _ => &[],
        }
    }

    /// How much it weighs.
    pub fn severity(&self) -> Severity {
        self.doubt.explained().severity
    }

    /// Whether both say the same of whatever they concern: numbers that round alike are alike.
    pub fn says_the_same(&self, other: &Self) -> bool {
        self.code() == other.code() && self.message() == other.message()
    }
}

/// What can be doubtful, by subject.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Doubt {
    /// What was read, and what was left out.
    #[error(transparent)]
    Files(#[from] FileDoubt),
    /// Where the pixels are.
    #[error(transparent)]
    Positions(#[from] PositionDoubt),
    /// The calibration of the scanner.
    #[error(transparent)]
    Calibration(#[from] CalibrationDoubt),
    /// The lattice of one image.
    #[error(transparent)]
    Lattice(#[from] LatticeDoubt),
    /// Drift and the clock.
    #[error(transparent)]
    Drift(#[from] DriftDoubt),
    /// How scans and sets agree.
    #[error(transparent)]
    Sets(#[from] SetDoubt),
    /// Whether the lattice is a moiré of the layers, and what its strain is worth.
    #[error(transparent)]
    Moire(#[from] MoireDoubt),
    /// What else the lattice can mean.
    #[error(transparent)]
    Readings(#[from] ReadingDoubt),
    /// The orientation of a layer and the sense of the twist.
    #[error(transparent)]
    Orientation(#[from] OrientationDoubt),
    /// Maps, and what is asked of them.
    #[error(transparent)]
    Maps(#[from] MapDoubt),
    /// Stripes and domains.
    #[error(transparent)]
    Patterns(#[from] PatternDoubt),
    /// Any of these, read from a file.
    #[error(transparent)]
    Recorded(#[from] RecordedDoubt),
}

impl Doubt {
    /// What it means and what to do.
    pub fn explained(&self) -> &'static Explained {
        match self {
            Self::Files(doubt) => doubt.explained(),
            Self::Positions(doubt) => doubt.explained(),
            Self::Calibration(doubt) => doubt.explained(),
            Self::Lattice(doubt) => doubt.explained(),
            Self::Drift(doubt) => doubt.explained(),
            Self::Sets(doubt) => doubt.explained(),
            Self::Moire(doubt) => doubt.explained(),
            Self::Readings(doubt) => doubt.explained(),
            Self::Orientation(doubt) => doubt.explained(),
            Self::Maps(doubt) => doubt.explained(),
            Self::Patterns(doubt) => doubt.explained(),
            Self::Recorded(doubt) => doubt.explained(),
        }
    }
}

/// The subjects, each with the table of its doubts.
pub const SUBJECTS: [(&str, &[Explained]); 11] = [
    ("Files and images", FileDoubt::TABLE),
    ("Positions of pixels", PositionDoubt::TABLE),
    ("Calibration of the scanner", CalibrationDoubt::TABLE),
    ("Lattice of an image", LatticeDoubt::TABLE),
    ("Drift and time", DriftDoubt::TABLE),
    ("Scans and sets", SetDoubt::TABLE),
    ("Moiré and strain", MoireDoubt::TABLE),
    ("Solutions for a lattice", ReadingDoubt::TABLE),
    (
        "Orientation of a layer and sense of the twist",
        OrientationDoubt::TABLE,
    ),
    ("Maps", MapDoubt::TABLE),
    ("Stripes and domains", PatternDoubt::TABLE),
];

/// All doubts: what they mean and what to do, subject by subject.
pub fn explained() -> impl Iterator<Item = &'static Explained> {
    SUBJECTS.iter().flat_map(|(_, table)| *table)
}
