//! Why an image gives no lattice.

use crate::spectrum::method::Method;

/// Why an image gives no lattice.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LatticeError {
    /// The frame is too small.
    #[error("the frame has {columns} × {rows} pixels; at least 16 × 16 are needed")]
    TooSmall {
        /// Samples in a line.
        columns: usize,
        /// Lines.
        rows: usize,
    },
    /// There is nothing in it.
    #[error("the channel is constant or has no valid pixel")]
    Constant,
    /// Too many pixels are missing.
    #[error("{missing} of {total} pixels are missing; at most half may be")]
    Missing {
        /// Missing pixels.
        missing: usize,
        /// All pixels.
        total: usize,
    },
    /// There is no lattice in it.
    #[error("the image shows no lattice: {}", too_weak(best))]
    NoLattice {
        /// Signal-to-noise ratios (amplitude) of the best three wave vectors, largest first; 0 where none were found.
        best: [f64; 3],
    },
    /// The waves of the best lattice are not in one place.
    #[error(
        "the spectrum has peaks that could be a lattice, but no part of the frame shows the three waves of any lattice \
         together. The peaks come from an edge, from stripes, or from different lattices"
    )]
    NowhereTogether,
    /// Other waves are as strong.
    #[error(
        "the lattice that was found is one of many: {rivals} other waves of about its period are as strong as its weakest \
         one, and three of them can make a lattice by chance. Rough ground, steps and noise have such waves"
    )]
    OneOfMany {
        /// How many they are.
        rivals: usize,
    },
    /// It does not predict what was left out.
    #[error(
        "the lattice that was found does not predict parts of the image that were left out of its fit ({standard_errors:.1} \
         standard errors without the weakest of its three waves). The peaks come from an edge, from stripes or from rough ground"
    )]
    NotPredicted {
        /// By how many standard errors the weakest of its waves improves the prediction.
        standard_errors: f64,
    },
    /// What repeats shows more than once.
    #[error(
        "only {periods:.1} periods of the lattice that was found fit across the frame: what does not repeat is no lattice. Scan a larger frame"
    )]
    TooFewPeriods {
        /// How many they are.
        periods: f64,
    },
    /// No known crystal has such a cell.
    #[error(
        "the strongest waves of the image make a cell far from any hexagon. They come from stripes, from a double tip or from \
         different lattices"
    )]
    Distorted,
    /// The lattice that was told by hand is not there.
    #[error(
        "in the part of the image that is used, no lattice like the given one stands out. Noise hides it, or what lies \
         beside it"
    )]
    NotThere,
    /// The lattice shows in the spectrum, but this method gets no hold of it.
    #[error(
        "the spectrum shows a lattice, but the {method:?} method finds too few of its peaks. Noise hides them, or the \
         frame is too small. Try the method \"fourier\""
    )]
    NoPeaks {
        /// The method.
        method: Method,
    },
    /// Several lattices were asked for.
    #[error(
        "{wanted} lattices were asked for, but only {found} can be found. All other peaks are noise or lie on the \
         waves of these: they are their harmonics, or those of a nearly commensurate lattice"
    )]
    FewerLattices {
        /// How many there are.
        found: usize,
        /// How many were wanted.
        wanted: usize,
    },
    /// Several lattices lie too close to each other.
    #[error(
        "the wave vectors of two lattices are too close to be resolved in this frame. Scan a larger frame"
    )]
    Entangled,
}

/// Which of three wave vectors (signal-to-noise ratios, largest first) are too weak for a lattice, and what they need.
pub(crate) fn too_weak(best: &[f64; 3]) -> String {
    if best[0] == 0.0 {
        return "no three wave vectors that add up to zero were found in its spectrum".to_owned();
    }
    // Rounded away from each other, so that what falls short never looks equal.
    let needed = [("second", best[1], SECOND), ("third", best[2], THIRD)]
        .map(|(name, found, needed)| (name, found, needed.sqrt()));
    let short: Vec<String> = needed
        .iter()
        .filter(|(_, found, needed)| found <= needed)
        .map(|(name, found, needed)| {
            let (found, needed) = ((100.0 * found).floor(), (100.0 * needed).ceil());
            format!(
                "the {name} has {:.2} but needs {:.2}",
                found / 100.0,
                needed / 100.0
            )
        })
        .collect();
    format!(
        "no three wave vectors that add up to zero exceed the noise. The best have signal-to-noise ratios of {:.1}, \
         {:.1} and {:.1}: {}",
        best[0],
        best[1],
        best[2],
        short.join(", ")
    )
}

/// Significance that the second of a shell needs, which was searched like the first: e⁻²⁰ each, 2·10⁻⁴ for all of 10⁵
/// frequencies, ...
pub(crate) const SECOND: f64 = 20.0;

/// ... and the third, which was not searched: e⁻¹² at its place.
pub(crate) const THIRD: f64 = 12.0;
