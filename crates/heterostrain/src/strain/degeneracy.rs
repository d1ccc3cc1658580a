//! How far an isotropic strain, which the moiré does not show, moves the twist.
//!
//! For every isotropic strain h of layer 2 there is a solution of the strain equation:
//! `|κ(1+η) e^{iθ} − 1| = |p|` is a circle. For equal layers `θ² + η² ≈ |p|²`, so that h shifts θ by
//! about `θη/2 + η²/2θ`; for different ones the shift is of first order, about `−(κ−1)h/θ`.

use crate::estimate::Estimate;
use crate::lattice::vectors::Lattice;
use crate::material::Bilayer;
use crate::strain::convention::StrainConvention;
use crate::strain::other_models::Reference;

/// Isotropic strains for which the shift of the twist is told: 0.1 and 0.2 %, as strains between layers are.
const SHOWN: [f64; 4] = [-0.002, -0.001, 0.001, 0.002];
/// Steps from the middle to either end of the interval of isotropic strains: the curve is smooth, and 40 are a good
/// line.
const STEPS: i32 = 40;
/// Standard deviations of the isotropic strain, and of the noise, that the interval spans: 95 %.
const SPAN: f64 = 1.96;

/// What an isotropic strain does to the twist.
#[derive(Clone, Debug, PartialEq)]
pub struct Degeneracy {
    /// Isotropic strains of layer 2 (of its atoms, tension positive) and by how much they change the twist
    /// of the default solution, rad; `None` where no twist goes with it.
    pub shifts: Vec<(f64, Option<f64>)>,
    /// The standard deviation of the isotropic strain behind `interval`.
    pub prior: f64,
    /// The interval of twists (magnitudes, rad) that isotropic strains up to 1.96 times the prior, either
    /// sign of the uniaxial strain and 1.96 σ of the noise leave open.
    pub interval: [f64; 2],
}

/// The twist–biaxial degeneracy of a lattice; `twist` holds the noise. `None` where nothing explains the
/// lattice.
pub fn degeneracy(
    lattice: &Lattice,
    bilayer: Bilayer<'_>,
    convention: StrainConvention,
    twist: Estimate,
    prior: f64,
) -> Option<Degeneracy> {
    let readings = Reference::both(lattice, bilayer, convention);
    let default = readings.first()?;
    let shifts = SHOWN
        .map(|h| (h, default.with_isotropic_strain(h).map(|change| change[0])))
        .to_vec();
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for reading in &readings {
        for step in -STEPS..=STEPS {
            let h = SPAN * prior * f64::from(step) / f64::from(STEPS);
            match reading.with_isotropic_strain(h) {
                Some(change) => {
                    let found = (reading.twist() + change[0]).abs();
                    low = low.min(found);
                    high = high.max(found);
                }
                // Beyond the strain at which θ = 0 there is none.
                None => low = 0.0,
            }
        }
    }
    let noise = SPAN * twist.sigma;
    Some(Degeneracy {
        shifts,
        prior,
        interval: [(low - noise).max(0.0), high + noise],
    })
}
