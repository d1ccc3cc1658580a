//! Patterns of stripes and their maps.

use nalgebra::{Matrix2, Vector2};

use crate::stripes::fit::FittedWave;
use crate::window::mask::Mask;
use crate::window::types::UsedHarmonic;

/// Why an image gives no map of stripes.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NoStripes {
    /// There are none.
    #[error(
        "the scan shows no stripes either: in none of its images does a wave of three or more periods, with a wave \
         vector off the slow axis, exceed the noise"
    )]
    Nothing,
    /// Waves of several directions lie on each other.
    #[error(
        "waves of {0} directions cross in most of the image. This is a lattice, not stripes, but it is too weak or too \
         distorted to be measured"
    )]
    Crossing(usize),
}

/// A pattern of stripes in an image.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct StripePattern {
    /// One wave fitted to the pixels where the pattern is; `None` where that fails.
    pub fit: Option<FittedWave>,
    /// Share of the nodes where it is the strongest and stands out, 0 to 1.
    pub share: f64,
    /// log₁₀ of the chance that noise makes it.
    pub log_chance: f64,
    /// Share of the local power of the pattern that the one wave of the fit has: 1 for straight stripes.
    pub coherence: f64,
    /// The harmonics that were used, as (n, 0).
    pub harmonics: Vec<UsedHarmonic>,
    /// Whether the noise was seen beside the harmonics; else it is what the fit leaves near them.
    pub noise_measured: bool,
}

/// The stripes at a node.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct StripeNode {
    /// Whether it is to be believed.
    pub mask: Mask,
    /// To which pattern it belongs.
    pub pattern: Option<usize>,
    /// Wave vector, rad per pixel; NaN where there is none.
    pub wave: Vector2<f64>,
    /// Its covariance.
    pub covariance: Matrix2<f64>,
    /// χ² of the closure of the overtones.
    pub chi2: f64,
    /// Its degrees of freedom.
    pub freedom: usize,
    /// Signal power over noise power under the window, all harmonics.
    pub signal_to_noise: f64,
    /// Phase against the mean wave of the pattern, rad, followed from node to node; NaN where that is not possible.
    pub phase: f64,
    /// Its standard error.
    pub phase_sigma: f64,
}

/// The local stripes of an image, in pixels.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct StripeMap {
    /// Columns and rows of nodes.
    pub size: [usize; 2],
    /// Place of node (0, 0), pixels.
    pub first: Vector2<f64>,
    /// Pixels from node to node along columns and rows.
    pub step: [f64; 2],
    /// Width of the window, nm.
    pub window_nm: f64,
    /// Margin at the edges, in windows.
    pub margin: f64,
    /// The patterns, strongest first; numbers of [`StripeNode::pattern`].
    pub patterns: Vec<StripePattern>,
    /// Row by row.
    pub nodes: Vec<StripeNode>,
}
