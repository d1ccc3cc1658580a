//! What is asked of a moiré.

use heterostrain::lattice::WavelengthMeaning;
use heterostrain::strain::Stacking;
use nalgebra::Matrix2;

/// What is asked.
#[derive(Clone, Debug)]
pub(super) enum Question {
    /// Which moiré do these layers make?
    Forward(Stacking),
    /// What do three wavelengths mean?
    Wavelengths {
        lengths: [f64; 3],
        sigmas: [f64; 3],
        meaning: WavelengthMeaning,
    },
    /// What do two vectors mean?
    Vectors { basis: Matrix2<f64>, sigma: f64 },
}
