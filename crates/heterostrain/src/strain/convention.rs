//! The two forms of the strain equation.

use serde::{Deserialize, Serialize};

/// Which form of the strain equation is meant (physics of the two: they differ at second order).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum StrainConvention {
    /// The stretch acts on atomic positions: ε > 0 is tension.
    RealSpace,
    /// The stretch acts on reciprocal vectors, as in arXiv 2406.08681: ε > 0 is compression.
    KSpace,
}
