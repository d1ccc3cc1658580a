//! Why a node of a map does not count.

/// Why a node has no value, or none to be believed; 0 is a good one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(u8)]
pub enum Mask {
    /// To be believed.
    Good = 0,
    /// So near the edge that the window reaches beyond the frame.
    Margin = 1,
    /// Too many pixels are missing under the window.
    Missing = 2,
    /// The lattice does not stand out of the noise.
    Weak = 3,
    /// The harmonics contradict each other (closure χ²), or a phase winds around a point nearby: a
    /// dislocation, a domain boundary, an end of the lattice.
    Defect = 4,
    /// The lattice turns or stretches so fast that the window blurs it: a boundary of domains.
    Bent = 5,
    /// No twist and strain of the layers explain the local lattice.
    NoSolution = 6,
    /// Scans that both cover the place contradict each other.
    Contradiction = 7,
}

impl Mask {
    /// All of them, in the order of their numbers, which files hold.
    pub const ALL: [Self; 8] = [
        Self::Good,
        Self::Margin,
        Self::Missing,
        Self::Weak,
        Self::Defect,
        Self::Bent,
        Self::NoSolution,
        Self::Contradiction,
    ];

    /// A word for people and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Margin => "margin",
            Self::Missing => "missing pixels",
            Self::Weak => "weak signal",
            Self::Defect => "defect",
            Self::Bent => "bent",
            Self::NoSolution => "no solution",
            Self::Contradiction => "contradiction",
        }
    }
}
