//! Doubts about maps and what is asked of them.

use heterostrain::Estimate;
use spmfile::LineDirection;

use crate::caveat::explained::explain;
use crate::numbers::words::{line_name, plus_minus, two_digits};

/// Maps, and what is asked of them.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MapDoubt {
    /// A large image was mapped in bands.
    #[error(
        "the image was mapped in bands, with nominal positions, {drift}, and without displacements"
    )]
    Survey {
        /// What was done about drift.
        drift: SurveyDrift,
    },
    /// No twist and strain at any node.
    #[error("{reason}: the map has wavelengths and directions only")]
    NoTwistStrain {
        /// Why.
        reason: String,
    },
    /// Drift is in the maps.
    #[error("{}", not_corrected(*.of))]
    NotDriftCorrected {
        /// What is mapped.
        of: Mapped,
    },
    /// The noise could not be measured.
    #[error(
        "the frame holds too few periods to see noise between the harmonics: the errors of the map are those of what {}",
        noise_of(*.of)
    )]
    NoiseGuessed {
        /// What is mapped.
        of: Mapped,
    },
    /// The margin is narrower than two windows.
    #[error(
        "the frame is small for its window: the margin is {margin:.2} windows wide and not two. Windows there are cut by \
         the edge; what that does to their noise, and what leaks through them, is in their errors, but they see less of \
         the outer side"
    )]
    NarrowMargin {
        /// Its width, windows.
        margin: f64,
    },
    /// An image has the contrast of an error signal.
    #[error(
        "the contrast of the {} is the other way round than in the images before, as that of error signals is: half a \
         period between them is taken for that and not for a shift",
        line_name(*.line)
    )]
    ContrastReversed {
        /// Trace or retrace.
        line: LineDirection,
    },
    /// The pattern stands far from where it should.
    #[error(
        "by its phases the pattern stands ({}, {}) nm from where time and drift put it, {} of a period: it may have been \
         put on the wrong period",
        plus_minus(.shift[0]), plus_minus(.shift[1]), two_digits(*.of_period)
    )]
    Registration {
        /// How far, nm.
        shift: [Estimate; 2],
        /// As a share of a period.
        of_period: f64,
    },
    /// A region without good nodes.
    #[error("the region has no good node: it has no values")]
    RegionEmpty,
    /// A region that the map covers in part.
    #[error(
        "the map reaches {:.0} % of the region, and {:.0} % of the nodes there are not to be believed: its numbers are \
         those of the rest",
        100.0 * .covered, 100.0 * .masked
    )]
    RegionInPart {
        /// Share of the region within the map.
        covered: f64,
        /// Share of its nodes that are not to be believed.
        masked: f64,
    },
    /// A device narrower than the resolution.
    #[error(
        "the device is narrower than the map resolves: the twist may vary more within it than the map shows"
    )]
    DeviceBelowResolution,
    /// No place for a device.
    #[error("no area of this size lies within the map with 95 % of its nodes to be believed")]
    DeviceFitsNowhere,
}

/// What a map shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Mapped {
    /// Lattices.
    Lattice,
    /// Stripes.
    Stripes,
}

/// What was done about the drift of a large image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SurveyDrift {
    /// It was taken off.
    #[error("corrected for the drift that was given")]
    Corrected,
    /// It was given, but the file does not tell its times.
    #[error(
        "not corrected for the drift that was given (the file tells no line rate and frame direction)"
    )]
    NoTiming,
    /// It is not known.
    #[error("without correction for drift")]
    Unknown,
}

fn not_corrected(of: Mapped) -> &'static str {
    match of {
        Mapped::Lattice => {
            "the drift of some images is not known: it stretches and shears their maps, the same everywhere"
        }
        Mapped::Stripes => {
            "the drift is not known: it stretches and shears the map, the same everywhere"
        }
    }
}

fn noise_of(of: Mapped) -> &'static str {
    match of {
        Mapped::Lattice => {
            "the lattice leaves of the variance of the image, enlarged where the harmonics disagree by more"
        }
        Mapped::Stripes => "a single wave in each pattern leaves",
    }
}

explain! { MapDoubt:
    Survey "survey" Note
        "A large image was mapped band by band. Positions are those that the instrument intended, drift is taken off only \
         if it was given, and there are no displacements."
        "Scale and shear of the whole map are those of the scanner and its drift. Compare with small scans that have \
         sensors and frames up and down."
    NoTwistStrain "no-twist-strain" Serious
        "No twist and strain of the layers explain the lattice of the map. It has wavelengths and directions only."
        "Name the layers that the sample has."
    NotDriftCorrected "map-not-drift-corrected" Warning
        "The drift is not known and is in the map: it stretches and shears all of it by the same amount. Differences \
         within the map are hardly changed, mean values are."
        "Take frames up and down, or give the drift."
    NoiseGuessed "map-noise-guessed" Warning
        "The frame is too small to see the noise between the harmonics. The errors of the map were estimated from what the \
         lattice leaves, and may be off."
        "Scan a larger frame."
    NarrowMargin "map-narrow-margin" Note
        "The frame is small for the window, and nodes closer to the edge than usual were kept. They see less of the outer \
         side."
        "Leave out the outer nodes for a clean map of fewer nodes, use a narrower window, or scan a larger frame."
    ContrastReversed "contrast-reversed" Note
        "One image has the opposite contrast of those before it, as the error signals of trace and retrace have. A shift of \
         half a period was taken for that."
        "Map a channel with the same contrast in both directions, as topography, to be sure."
    Registration "map-registration" Warning
        "The pattern of one image stands far from where time and drift put it. It may have been put on the next period, \
         and then the average mixes different places."
        "Look for a move or a jump between the scans, and leave the scan out."
    RegionEmpty "region-empty" Serious
        "No node in the region is to be believed. It has no values."
        "Move the region into the map, or away from edges and defects."
    RegionInPart "region-in-part" Warning
        "A part of the region is outside of the map or not to be believed. Its numbers are those of the rest."
        "Move the region, or quote the numbers with the share that they stand for."
    DeviceBelowResolution "device-below-resolution" Warning
        "The device is narrower than what the map resolves. The twist may vary more within it than the map shows."
        "Use a narrower window, which needs a better image, or a larger device."
    DeviceFitsNowhere "device-fits-nowhere" Serious
        "No place within the map has room for the device. There is no answer for it."
        "Ask for a smaller device, or map a larger image."
}
