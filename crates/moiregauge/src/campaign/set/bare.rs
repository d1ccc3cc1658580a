//! The lattice of a set as a lattice, where no twist and strain explain it: that of atoms, of a surface, of other layers.

use heterostrain::TotalEstimate;
use heterostrain::lattice::Lattice;
use nalgebra::Matrix4;

use crate::campaign::analysis::ScanAnalysis;
use crate::campaign::means::SetLattice;
use crate::campaign::set::mean::counted;
use crate::campaign::set::solved::Solved;
use crate::drift::shares::Statistical;
use crate::frame::grid_errors::GridErrors;
use crate::meaning::budget::wavelength_variances;
use crate::numbers::spread::mean_and_spread;
use crate::settings::knobs::Settings;

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
