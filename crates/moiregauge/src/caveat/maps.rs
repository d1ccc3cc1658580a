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
        "errors of the scanner scale and shear the whole map: the image was mapped in bands, with nominal positions, \
         {drift}, and without displacements"
    )]
    Survey {
        /// What was done about drift.
        drift: SurveyDrift,
    },
    /// No twist and strain at any node.
    #[error("the map has wavelengths and directions only: {reason}")]
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
    /// Several grains are in one map.
    #[error(
        "there are no displacements, registry and averaged cell, since the map shows {grains} grains side by side and \
         these count from the mean lattice of one. Each node is measured in its own grain; nodes whose windows reach \
         far beyond it are masked as missing pixels"
    )]
    OfGrains {
        /// How many.
        grains: usize,
    },
    /// The noise could not be measured.
    #[error(
        "the errors of the map may be wrong: the frame holds too few periods to measure the noise between the \
         harmonics, and they come from what {}",
        noise_of(*.of)
    )]
    NoiseGuessed {
        /// What is mapped.
        of: Mapped,
    },
    /// The margin is narrower than two windows.
    #[error(
        "nodes near the edge average over the inner side more than over the outer side, since the frame is small for \
         its window: the margin is {margin:.2} windows wide instead of two. Their errors include the noise and the \
         leakage that follow from this"
    )]
    NarrowMargin {
        /// Its width, windows.
        margin: f64,
    },
    /// The spread may be that of the grid.
    #[error(
        "do not read the variation of the twist as strain: it is {}° beyond the noise, and bends of {} may make {}° of \
         that",
        two_digits(.spread.to_degrees()),
        if *.from_sensors { "the position sensors" } else { "a scanner that no position sensor recorded" },
        two_digits(.bends.to_degrees())
    )]
    SpreadOfGrid {
        /// Standard deviation of the twist without its noise, rad.
        spread: f64,
        /// What bends make of it at the default of the settings or as they say, rad.
        bends: f64,
        /// Whether sensors recorded the places.
        from_sensors: bool,
    },
    /// An image has the contrast of an error signal.
    #[error(
        "a shift of half a period was taken for reversed contrast: the contrast of the {} is opposite to that of the \
         images before, as in error signals",
        line_name(*.line)
    )]
    ContrastReversed {
        /// Trace or retrace.
        line: LineDirection,
    },
    /// The pattern stands far from where it should.
    #[error(
        "the average may mix different places: the image may have been aligned with the wrong period. Its pattern lies \
         ({}, {}) nm, or {} of a period, from the place predicted by time and drift",
        plus_minus(.shift[0]), plus_minus(.shift[1]), two_digits(*.of_period)
    )]
    Registration {
        /// How far, nm.
        shift: [Estimate; 2],
        /// As a share of a period.
        of_period: f64,
    },
    /// A region without good nodes.
    #[error("the region has no values, since it has no good node")]
    RegionEmpty,
    /// A region that the map covers in part.
    #[error(
        "the numbers of the region come from a part of it: the map covers {:.0} % of the region, and {:.0} % of the \
         nodes there are bad",
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
        "the twist may vary more within the device than the map shows, since the device is narrower than the \
         resolution of the map"
    )]
    DeviceBelowResolution,
    /// No place for a device.
    #[error("no area is listed: none of this size within the map has 95 % good nodes")]
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
    /// The user chose it, but the file does not tell its times.
    #[error(
        "not corrected for the drift that was given (the file states no line rate and frame direction)"
    )]
    NoTiming,
    /// It is not known.
    #[error("without correction for drift")]
    Unknown,
}

fn not_corrected(of: Mapped) -> &'static str {
    match of {
        Mapped::Lattice => {
            "the maps of some images are stretched and sheared by the same amount everywhere, since their drift is not \
         known"
        }
        Mapped::Stripes => {
            "the map is stretched and sheared by the same amount everywhere, since the drift is not known"
        }
    }
}

fn noise_of(of: Mapped) -> &'static str {
    match of {
        Mapped::Lattice => {
            "the fit of the lattice leaves of the variance of the image, enlarged where the harmonics disagree by more"
        }
        Mapped::Stripes => "the fit of a single wave in each pattern leaves",
    }
}

explain! { MapDoubt:
    Survey "survey" Note
        "A large image was mapped band by band. Positions are the nominal ones. Drift is removed only if it was given. \
         There are no displacements."
        "The errors of the scanner and the drift scale and shear the whole map. Compare it with small scans that have \
         position sensors and frames up and down."
    NoTwistStrain "no-twist-strain" Serious
        "No twist and strain of the layers explain the lattice of the map. It has wavelengths and directions only."
        "Name the layers that the sample has."
    NotDriftCorrected "map-not-drift-corrected" Warning
        "The drift is not known. It stretches and shears the whole map by the same amount. Mean values are wrong by \
         this; differences within the map hardly change."
        "Take frames up and down, or give the drift."
    OfGrains "map-of-grains" Note
        "Several grains lie side by side in the map. Each node is measured in its own grain, and the results are those of \
         each grain. There is no mean of all, no displacement, registry or averaged cell."
        "To have these of one grain, map it alone."
    NoiseGuessed "map-noise-guessed" Warning
        "The frame is too small to measure the noise between the harmonics. The errors of the map were estimated from \
         the residual of the lattice fit, and may be wrong."
        "Scan a larger frame."
    NarrowMargin "map-narrow-margin" Note
        "The frame is small for the window, and nodes closer to the edge than usual were kept. They average over the \
         inner side more than over the outer side."
        "Use a wider margin (fewer nodes), use a narrower window, or scan a larger frame."
    SpreadOfGrid "map-spread-of-grid" Warning
        "The twist varies over the map by no more than bends of the grid can make: of the position sensors, or of the scanner where \
         there are none. The settings say how much these may bend."
        "Do not read the variation as strain. Record the position sensors, turn the scan by 90°, or measure how much the sensors bend and \
         change the setting."
    ContrastReversed "contrast-reversed" Note
        "One image has the opposite contrast of those before it, as in the error signals of trace and retrace. A shift \
         of half a period was taken for reversed contrast."
        "To be sure, map a channel with the same contrast in both directions, such as topography."
    Registration "map-registration" Warning
        "The pattern of one image lies far from the place predicted by time and drift. It may have been aligned with \
         the wrong period. Then the average mixes different places."
        "Look for a move or a jump between the scans, and leave the scan out."
    RegionEmpty "region-empty" Serious
        "The region has no good node, so it has no values."
        "Move the region into the map, or away from edges and defects."
    RegionInPart "region-in-part" Warning
        "A part of the region is outside of the map, or its nodes are bad. The numbers of the region come from the \
         rest."
        "Move the region, or quote the share that was used together with the numbers."
    DeviceBelowResolution "device-below-resolution" Warning
        "The device is narrower than what the map resolves. The twist may vary more within it than the map shows."
        "Use a narrower window, which needs a better image, or a larger device."
    DeviceFitsNowhere "device-fits-nowhere" Serious
        "The device fits nowhere in the good part of the map. No area is listed."
        "Ask for a smaller device, or map a larger image."
}
