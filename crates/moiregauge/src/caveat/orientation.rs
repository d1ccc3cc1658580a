//! Doubts about the orientation of a layer and the sense of the twist.

use heterostrain::Estimate;

use crate::caveat::explained::explain;
use crate::caveat::readings::degrees;

/// The orientation of a layer and the sense of the twist.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OrientationDoubt {
    /// The orientation goes with no reading.
    #[error("the orientation of the layer goes with no reading of this moiré")]
    Unused,
    /// A sense without an orientation.
    #[error(
        "the sense of the twist was given, which tells nothing without the orientation of a layer: the twist is a \
         magnitude"
    )]
    SenseUnused,
    /// The orientation needs too much isotropic strain.
    #[error(
        "the orientation that was given would need an isotropic heterostrain of {:+.2} %{}: it is that of another vector \
         (30° off for a hexagonal layer), another layer or another sample",
        100.0 * .strain,
        .other.map_or_else(String::new, |other| format!(", one 30° further {:+.2} %", 100.0 * other))
    )]
    Contradicts {
        /// The isotropic strain that it needs.
        strain: f64,
        /// That of an orientation 30° further.
        other: Option<f64>,
    },
    /// Orientations that the symmetry does not tell apart.
    #[error(
        "an orientation is known modulo the symmetry of its layer only: {} of mean strain {:+.2} % is the reading with \
         the least; others are {}",
        degrees(*.twist), 100.0 * .strain, other_readings(.others)
    )]
    Ambiguous {
        /// The twist, rad.
        twist: f64,
        /// The mean strain.
        strain: f64,
        /// Twist (rad) and mean strain of the others.
        others: Vec<[f64; 2]>,
    },
    /// The orientations of both layers contradict each other.
    #[error(
        "the orientations of the two layers differ from what the moiré makes of one of them by {sigmas:.1} σ at least: \
         one of them is that of another vector, another layer or another sample, or an error is too small"
    )]
    Disagree {
        /// By so many standard deviations.
        sigmas: f64,
    },
    /// The orientation goes with the other sense.
    #[error(
        "the orientation of the layer goes with no twist of the sense that was given; the other sense is shown"
    )]
    SenseContradicts,
    /// Two equal layers: both senses explain the moiré.
    #[error(
        "two equal layers: the orientation of one of them goes with twists of either sense, {} and {}, and none is better \
         than the other{}. The sense of the twist, or the orientation of the other layer, would tell",
        .senses[0], .senses[1],
        .magnitudes.map_or_else(String::new, |[low, high]| format!(
            "; magnitudes from {} to {} are open", degrees(low), degrees(high)
        ))
    )]
    SenseOpen {
        /// Both readings.
        senses: [SenseNumbers; 2],
        /// From which twist to which, rad.
        magnitudes: Option<[f64; 2]>,
    },
    /// Atomic images scatter.
    #[error(
        "the atomic images scatter {times:.1} times more than their errors say: drift that changes, as after a move of \
         the window; the error of the orientation is enlarged to match"
    )]
    AtomicScatter {
        /// So many times more.
        times: f64,
    },
    /// Atomic images of one frame direction.
    #[error(
        "the atomic images are all of one frame direction, which does not tell their drift: the orientation rests on the \
         rows of atoms along the fast axis alone and on the lattice constant; frames up and down would do better"
    )]
    AtomicDriftAssumed,
    /// The lattice of the atomic images has another size.
    #[error(
        "the lattice of the atomic images is {:+.1} % larger than that of {material}: the gain of the scanner is off by \
         that much, or it is another layer",
        100.0 * .larger
    )]
    AtomicSize {
        /// By this share.
        larger: f64,
        /// The layer that was expected.
        material: String,
    },
}

/// Twist and mean strain for one sense of the twist.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "{} ± {} with a mean strain of {:+.4} %",
    degrees(.twist.value), degrees(.twist.sigma), 100.0 * .strain
)]
#[non_exhaustive]
pub struct SenseNumbers {
    /// The twist, rad.
    pub twist: Estimate,
    /// The mean strain.
    pub strain: f64,
}

fn other_readings(all: &[[f64; 2]]) -> String {
    let words =
        |[twist, strain]: &[f64; 2]| format!("{} with {:+.2} %", degrees(*twist), 100.0 * strain);
    let all: Vec<String> = all.iter().map(words).collect();
    all.join(", ")
}

explain! { OrientationDoubt:
    Unused "orientation-unused" Warning
        "The orientation that was given fits no reading of the moiré and was not used."
        "Make sure that the orientation is that of a layer of this moiré, in the axes of the laboratory."
    SenseUnused "twist-sense-unused" Note
        "The sense of the twist was given without the orientation of a layer, where it tells nothing. The twist is a \
         magnitude."
        "Give the orientation of a layer as well, if the strain tensor is wanted."
    Contradicts "orientation-contradicts" Serious
        "With this orientation the layers would differ in size by more than they do. The orientation is most likely that \
         of another direction or layer, and the strain tensor is wrong."
        "Check whether the angle is that of a lattice row or of a reciprocal vector (30° apart in hexagonal layers), and \
         to which layer it belongs."
    Ambiguous "orientation-ambiguous" Warning
        "The symmetry of the layer leaves several orientations, and each gives another reading. The one with the least \
         strain is reported."
        "Tell the orientation within the symmetry by the edges of the flake or by the record of the stacking."
    Disagree "orientations-disagree" Serious
        "The orientations of the two layers contradict the moiré. One of them is wrong, or an error is too small."
        "Check both angles: direction, layer and sample."
    SenseContradicts "twist-sense-contradicts" Serious
        "No twist of the sense that was given goes with the orientation of the layer. The other sense is shown."
        "Check the sense of the twist, and whether the orientation is that of this layer."
    SenseOpen "twist-sense-open" Warning
        "Two equal layers and the orientation of one of them leave the sense of the twist open. Both readings are as good, \
         and differ in the strain tensor."
        "Give the sense of the twist, as known from the stacking, or the orientation of the other layer."
    AtomicScatter "atomic-scatter" Warning
        "The atomic images scatter by more than their errors. The error of the orientation was enlarged to match."
        "Wait after a move of the window until the drift is constant, and take more frames."
    AtomicDriftAssumed "atomic-drift-assumed" Warning
        "All atomic images have one frame direction, which does not tell their drift. The orientation rests on the rows of \
         atoms along the fast axis alone."
        "Take atomic frames up and down."
    AtomicSize "atomic-size" Warning
        "The atomic lattice is clearly larger or smaller than that of the layer. The scanner is off by that much, or it is \
         another layer."
        "Make sure which layer the images show, and calibrate the scanner."
}
