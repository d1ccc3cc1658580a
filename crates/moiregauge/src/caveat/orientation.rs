//! Doubts about the orientation of a layer and the sense of the twist.

use heterostrain::Estimate;
use heterostrain::strain::StrainTensor;

use crate::caveat::explained::explain;
use crate::caveat::readings::degrees;

/// The orientation of a layer and the sense of the twist.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OrientationDoubt {
    /// The orientation goes with no solution.
    #[error(
        "the orientation of the layer was not used, since it fits no solution for this moiré. Check that it belongs to \
         a layer of this moiré and is given in laboratory axes"
    )]
    Unused,
    /// A sense without an orientation.
    #[error(
        "the twist is a magnitude: its sense was given without the orientation of a layer and was not used"
    )]
    SenseUnused,
    /// The orientation needs too much isotropic strain.
    #[error(
        "the strain tensor is probably wrong: the orientation that was given needs an isotropic heterostrain of {:+.2} \
         %{}. It probably belongs to another vector (30° off for a hexagonal layer), another layer or another sample",
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
        "other solutions are possible: the symmetry of the layer leaves several open. The one with the least mean \
         strain is reported: {} of mean strain {:+.2} %. Others are {}",
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
        "the two orientations contradict the moiré by at least {sigmas:.1} σ. Check direction, layer and sample of \
          both: one of them belongs to another vector, another layer or another sample, or its error is too small"
    )]
    Disagree {
        /// The difference in standard deviations.
        sigmas: f64,
    },
    /// The orientation goes with the other sense.
    #[error(
        "the twist has the sense opposite to that given, since no twist of the given sense fits the orientation of the \
         layer. Check both"
    )]
    SenseContradicts,
    /// Atoms beside several moirés.
    #[error(
        "the atoms beside the moirés were not used, since the image does not tell which of its moirés have the layer that shows. Say \
         for each moiré which of its layers that is, if it is one of them"
    )]
    RulerMoire,
    /// Readings of the moiré by the atoms beside it that the symmetry does not tell apart.
    #[error(
        "the atoms beside the moiré leave more than one twist open: {}. They are not used until the sense of the twist, or the \
         reading, is known",
        any_of(.readings)
    )]
    RulerReadings {
        /// All of them.
        readings: Vec<SenseNumbers>,
    },
    /// Two equal layers: both senses explain the moiré.
    #[error(
        "the twist may have either sense: {} and {}{}. The two layers are equal, and the orientation of one of them \
         fits both equally well. Give the sense of the twist or the orientation of the other layer",
        .senses[0], .senses[1],
        .magnitudes.map_or_else(String::new, |[low, high]| format!(
            "; magnitudes from {} to {} are open", degrees(low), degrees(high)
        ))
    )]
    SenseOpen {
        /// Both solutions.
        senses: [SenseNumbers; 2],
        /// From which twist to which, rad.
        magnitudes: Option<[f64; 2]>,
    },
    /// Atomic images scatter.
    #[error(
        "the error of the orientation was enlarged, since the atomic images scatter {times:.1} times more than their \
         errors allow. A drift that changes, as after a move of the window, does this"
    )]
    AtomicScatter {
        /// The ratio.
        times: f64,
    },
    /// Atomic images of one frame direction.
    #[error(
        "the orientation comes from the rows of atoms along the fast axis and from the lattice constant alone: all \
         atomic images have the same frame direction, so their drift cannot be determined. Take frames up and down"
    )]
    AtomicDriftAssumed,
    /// The lattice of the atomic images has another size.
    #[error(
        "the gain of the scanner may be wrong, or the images may show another layer: the lattice of the atomic images \
         is {:+.1} % larger than that of {material}",
        100.0 * .larger
    )]
    AtomicSize {
        /// By this share.
        larger: f64,
        /// The layer that was expected.
        material: String,
    },
    /// Atoms beside the moiré that may be of either layer.
    #[error(
        "the atoms beside the moiré were not used, since within the calibration of the scanner they may be those of either \
         layer. Say which layer's atoms the image shows"
    )]
    RulerLayer,
    /// The size of the atoms contradicts the calibration of the scanner.
    #[error(
        "the atoms beside the moiré {} used: for them to be those of the layer, the scanner has to be off by {:+.1} % along the fast axis, which its \
         calibration excludes. They may be another lattice",
        if *.used { "were" } else { "were not" }, 100.0 * .gain
    )]
    RulerSize {
        /// By which share the scanner shows lengths along the fast axis too large.
        gain: f64,
        /// Whether the user said that they are.
        used: bool,
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

impl From<StrainTensor> for SenseNumbers {
    fn from(found: StrainTensor) -> Self {
        Self {
            twist: found.twist(),
            strain: found.mean,
        }
    }
}

fn any_of(all: &[SenseNumbers]) -> String {
    let all: Vec<String> = all.iter().map(SenseNumbers::to_string).collect();
    all.join(", or ")
}

fn other_readings(all: &[[f64; 2]]) -> String {
    let words =
        |[twist, strain]: &[f64; 2]| format!("{} with {:+.2} %", degrees(*twist), 100.0 * strain);
    let all: Vec<String> = all.iter().map(words).collect();
    all.join(", ")
}

explain! { OrientationDoubt:
    Unused "orientation-unused" Warning
        "The orientation that was given fits no solution for the moiré. It was not used."
        "Check that the orientation belongs to a layer of this moiré, and that it is given in laboratory axes."
    SenseUnused "twist-sense-unused" Note
        "The sense of the twist was given without the orientation of a layer. It was not used: the twist is a \
         magnitude."
        "If you need the strain tensor, give the orientation of a layer too."
    Contradicts "orientation-contradicts" Serious
        "With this orientation the layers need a large isotropic strain. Most likely the orientation belongs to \
         another direction or layer. Then the strain tensor is wrong."
        "Check whether the angle is that of a lattice row or of a reciprocal vector (30° apart in hexagonal layers), and \
         to which layer it belongs."
    Ambiguous "orientation-ambiguous" Warning
        "The symmetry of the layer leaves several orientations, and each gives another solution. The one with the least \
         strain is reported."
        "Use the edges of the flake or the record of the stacking to choose among the equivalent directions."
    Disagree "orientations-disagree" Serious
        "The orientations of the two layers contradict the moiré. One of them is wrong, or its error is too small."
        "Check both angles: direction, layer and sample."
    SenseContradicts "twist-sense-contradicts" Serious
        "No twist of the sense that was given fits the orientation of the layer. The other sense is shown."
        "Check the sense of the twist, and whether the orientation belongs to this layer."
    RulerLayer "ruler-layer-open" Warning
        "The atoms beside the moiré may be those of either layer: the scanner may be off by as much as their constants differ. The \
         twist that is reported is by the scanner, without the atoms."
        "Say which layer's atoms the image shows, or calibrate the scanner."
    RulerSize "ruler-contradicts" Serious
        "The lattice beside the moiré has about the size of a layer's atoms, and the calibration of the scanner excludes that it is theirs. It \
         may be a reconstruction or a harmonic. It is used only if the user said that it is the layer."
        "Calibrate the scanner, or give a larger error of its gain (`calibration.gain_percent`) if it may be off by as much."
    RulerMoire "ruler-moire-open" Note
        "The image shows several moirés and the atoms of one layer. The atoms measure those moirés that this layer makes, and the image does \
         not tell which these are."
        "Say for each moiré which of its two layers shows its atoms, if one of them does."
    RulerReadings "ruler-readings-open" Warning
        "The layers differ, and the atoms of one of them fix the other only up to a symmetry: each reading that is listed has little \
         strain, and one of them is right. The twist that is reported is by the scanner, without the atoms."
        "Give the sense of the twist, from the record of the stacking."
    SenseOpen "twist-sense-open" Warning
        "The two layers are equal, and the orientation of one of them does not determine the sense of the twist. Both \
         solutions fit equally well and have different strain tensors."
        "Give the sense of the twist (from the record of the stacking) or the orientation of the other layer."
    AtomicScatter "atomic-scatter" Warning
        "The atomic images scatter by more than their errors. The error of the orientation was enlarged to match."
        "Wait after a move of the window until the drift is constant, and take more frames."
    AtomicDriftAssumed "atomic-drift-assumed" Warning
        "All atomic images have the same frame direction, so their drift cannot be determined. The orientation comes \
         from the rows of atoms along the fast axis alone."
        "Take atomic frames up and down."
    AtomicSize "atomic-size" Warning
        "The atomic lattice is clearly larger or smaller than that of the layer. Either the gain of the scanner is \
         wrong by this much, or the images show another layer."
        "Check which layer the images show, and calibrate the scanner."
}
