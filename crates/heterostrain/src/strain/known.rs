//! What is known of the layers beside the moiré: orientations and the sense of the twist.

use serde::{Deserialize, Serialize};

/// The orientation of one of the layers, known from elsewhere: an atomic image or the edge of a crystal,
/// in the frame of the position sensors and free of drift.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct KnownOrientation {
    /// Degrees counter-clockwise from x, of any of the equivalent directions.
    pub angle_deg: f64,
    /// Standard uncertainty, degrees.
    pub sigma_deg: f64,
    /// Layer 1, the reference, or layer 2. For a strained layer the mean over its three directions is
    /// meant: a single one differs from it by up to (1+ν)ε/2.
    pub layer: u8,
    /// Of which vector.
    #[serde(default)]
    pub of: LatticeDirection,
}

/// Which vector of an atomic lattice an orientation is that of.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum LatticeDirection {
    /// The atomic vector a: for hexagonal layers a row of atoms, a zigzag edge.
    #[default]
    Atomic,
    /// The reciprocal vector of a: for hexagonal layers an armchair edge, 30° from a row of atoms, and a
    /// spot of the Fourier transform of an atomic image.
    Reciprocal,
}

/// Which way layer 2 is turned against layer 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TwistSense {
    /// Counter-clockwise: θ > 0.
    Positive,
    /// Clockwise: θ < 0.
    Negative,
}

impl TwistSense {
    /// Whether a twist is of this sense; 0 is of both.
    pub fn has(self, twist: f64) -> bool {
        match self {
            Self::Positive => twist >= 0.0,
            Self::Negative => twist <= 0.0,
        }
    }
}
