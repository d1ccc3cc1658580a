//! The lattice of a set as a lattice, where no twist and strain explain it: that of atoms, of a surface, of other layers.

use heterostrain::TotalEstimate;
use heterostrain::lattice::Lattice;
use nalgebra::Matrix4;

use crate::campaign::analysis::ScanAnalysis;
use crate::campaign::set::assumed::AssumedDrift;
use crate::campaign::set::mean::counted;
use crate::campaign::set::solved::Solved;
use crate::drift::shares::Statistical;
use crate::frame::grid_errors::GridErrors;
use crate::meaning::budget::wavelength_variances;
use crate::numbers::spread::mean_and_spread;
use crate::settings::knobs::Settings;

/// The lattice of all scans of a set that no twist and strain explain: of atoms, of a surface, of other layers.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct SetLattice {
    /// Lattice vectors, nm, corrected for drift where the set has one.
    pub lattice: Lattice,
    /// The drift that was assumed where the scans do not tell it; `None` where it was measured or given.
    pub assumed: Option<AssumedDrift>,
    /// Lengths of L₁, L₂ and L₃ with their statistical and total uncertainties, nm.
    pub wavelengths: [TotalEstimate; 3],
    /// The total of the first length without the drift, nm.
    pub without_drift: f64,
    /// Standard deviations of the three lengths over the scans, nm; NaN for one scan.
    pub scatter: [f64; 3],
    /// χ² per degree of freedom of the scans against this lattice; `None` for one image.
    pub chi2_per_dof: Option<f64>,
}

/// All scans together, their drift taken off where it is known, or with that of an assumed one in the errors; `shared` is the covariance that they have in common.
pub(crate) fn bare(
    solved: &Solved,
    scans: &[ScanAnalysis],
    shared: &Matrix4<f64>,
    grid: &GridErrors,
    settings: &Settings,
) -> SetLattice {
    let mut statistical = solved.statistical;
    statistical.image += shared;
    let lattice = Lattice::new(solved.lattice.basis, solved.lattice.covariance + shared);
    let totals = |statistical: &Statistical| {
        let variances = wavelength_variances(&lattice, statistical, grid, settings);
        [0, 1, 2].map(|i| TotalEstimate::new(lattice.wavelength(i), variances[i]))
    };
    let at_known_drift = Statistical {
        drift: Matrix4::zeros(),
        ..statistical
    };
    let scatter = |i: usize| {
        let of = |s: &ScanAnalysis| {
            let corrected = s.drift_corrected.filter(|_| solved.assumed.is_none());
            corrected.unwrap_or(s.sensor).wavelength(i).value
        };
        mean_and_spread(&counted(scans).map(of).collect::<Vec<_>>()).sigma
    };
    SetLattice {
        wavelengths: totals(&statistical),
        without_drift: totals(&at_known_drift)[0].total,
        lattice,
        scatter: [0, 1, 2].map(scatter),
        chi2_per_dof: (solved.freedom > 0).then(|| solved.chi2 / solved.freedom as f64),
        assumed: solved.assumed,
    }
}
