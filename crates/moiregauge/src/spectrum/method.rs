//! How lattice vectors are read off an image.

use serde::{Deserialize, Serialize};

/// How the lattice vectors are measured in an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Autocorrelation divided by the overlap, sub-pixel peaks, several shells.
    Autocorrelation,
    /// Hann-windowed Fourier transform, sub-pixel peaks, full inverse.
    Fourier,
    /// Harmonics of a lattice fitted to the pixels: errors near the Cramér–Rao bound.
    Lattice,
    /// As published: resampled, summed autocorrelation, whole-pixel peaks; drift from successive scans; 48 equations
    /// for twist and strain. Known to be biased. `Settings::as_published` sets what goes with it.
    Paper,
}

impl Method {
    /// Whether all scans are fitted together, phases included, instead of each set by its vectors.
    pub fn is_joint(self) -> bool {
        self == Self::Lattice
    }
}
