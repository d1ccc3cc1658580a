//! The lattice of a set alone, and a drift that was assumed.

use heterostrain::material::Bilayer;
use moiregauge::campaign::{AssumedDrift, SetLattice};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::convert::{PER_MINUTE, number};
use super::lattice::LatticeVector;

/// A drift of 0 that was assumed: its error is in every σ.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AssumedDriftResult {
    /// Standard deviation of each component, nm/min: that of the settings, or a quarter of the speed of the slow scan.
    pub sigma_nm_per_min: Option<f64>,
    /// Whether the line rate was not known either, and one between 0.5 and 10 Hz was assumed.
    pub line_rate_assumed: bool,
}

impl From<AssumedDrift> for AssumedDriftResult {
    fn from(assumed: AssumedDrift) -> Self {
        Self {
            sigma_nm_per_min: number(assumed.sigma * PER_MINUTE),
            line_rate_assumed: assumed.no_rate,
        }
    }
}

/// The lattice of a set that no twist and strain explain: of atoms, of a surface, of other layers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SetLatticeResult {
    /// L1, L2 and L3, corrected for drift where the set has one.
    pub vectors: [LatticeVector; 3],
    /// What was assumed of a drift that the scans do not tell; `null` where it was measured or given.
    pub drift_assumed: Option<AssumedDriftResult>,
    /// Standard deviations of the three lengths over the scans, nm.
    pub wavelength_scatter_nm: [Option<f64>; 3],
    /// χ² per degree of freedom of the scans against this lattice. Where it is significantly above 1
    /// (p < 0.05), every σ of this object is enlarged by its square root.
    pub chi2_per_dof: Option<f64>,
}

impl SetLatticeResult {
    pub(super) fn of(found: &SetLattice, bilayer: Bilayer<'_>) -> Self {
        Self {
            vectors: LatticeVector::with_lengths(&found.lattice, &found.wavelengths, bilayer),
            drift_assumed: found.assumed.map(Into::into),
            wavelength_scatter_nm: found.scatter.map(number),
            chi2_per_dof: found.chi2_per_dof.and_then(number),
        }
    }
}
