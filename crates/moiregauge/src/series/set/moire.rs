//! Is the lattice a moiré of the layers at all?
//!
//! Two hexagonal layers look the same turned by 60°, so no twist is beyond 30° and no moiré of equal layers
//! is shorter than 1.9 of their lattice constants. A shorter lattice is that of the atoms or of something
//! else, and however well it is measured, it has no twist.

use std::f64::consts::FRAC_PI_6;

use nalgebra::Matrix4;

use crate::analysis::{ScanAnalysis, SetMean};
use crate::budget::Statistical;
use crate::caveat::Caveat;
use crate::lattice::LatticeVectors;
use crate::settings::Settings;
use crate::strain::{TwistStrain, twist_strain};

/// Heterostrains of layers on each other stay below a few tenths of a per cent, rarely a per cent; more
/// than this deserves a word.
const LARGE_STRAIN: f64 = 0.02;

/// Twist and strain of a lattice that can be a moiré; `None` where it cannot.
pub(in crate::series) fn moire(
    lattice: &LatticeVectors,
    settings: &Settings,
) -> Option<TwistStrain> {
    twist_strain(lattice, settings.bilayer(), settings.strain_convention)
        .ok()
        .filter(|found| is_below_30_degrees(found, settings))
}

/// Layers that are not hexagonal can be turned by more.
fn is_below_30_degrees(found: &TwistStrain, settings: &Settings) -> bool {
    let layers = settings.bilayer();
    let hexagonal = layers.reference.is_hexagonal() && layers.stretched.is_hexagonal();
    found.twist.abs() <= FRAC_PI_6 || !hexagonal
}

/// A common lattice with its χ² and degrees of freedom, and where its covariance comes from.
type Common = (LatticeVectors, f64, usize);

/// The same with variances enlarged by `scale`.
pub(super) fn enlarged(
    (mut lattice, chi2, freedom): Common,
    statistical: &Statistical,
    scale: f64,
) -> (Common, Statistical) {
    let by = |m: Matrix4<f64>| m * scale;
    lattice.covariance *= scale;
    let statistical = Statistical {
        image: by(statistical.image),
        drift: by(statistical.drift),
        sensor: by(statistical.sensor),
    };
    ((lattice, chi2, freedom), statistical)
}

/// Says where a lattice is no moiré, or hardly one.
pub(super) fn doubts(
    name: &str,
    mean: Option<&SetMean>,
    scans: &[ScanAnalysis],
    settings: &Settings,
    caveats: &mut Vec<Caveat>,
) {
    let layers = &settings.material;
    let about_layers = format!("{} ({} nm)", layers.name, layers.lattice_constant_nm);
    if let Some(mean) = mean {
        let [least, _] = mean.twist_strain.strain_interval_95();
        if least > LARGE_STRAIN {
            caveats.push(Caveat::new(
                "large-strain",
                name,
                format!(
                    "a heterostrain of {:.1} % is more than layers on each other are known to have: an image \
                     that drift or the scanner distorts, other layers than {about_layers}, or a lattice that \
                     is no moiré would give the same numbers",
                    100.0 * mean.twist_strain.heterostrain().value
                ),
            ));
        }
        return;
    }
    let Some(lattice) = scans.first().map(|scan| scan.sensor) else {
        return;
    };
    let Ok(found) = twist_strain(&lattice, settings.bilayer(), settings.strain_convention) else {
        return;
    };
    if !is_below_30_degrees(&found, settings) {
        let [a, b, c] = [0, 1, 2].map(|i| lattice.wavelength(i).value);
        caveats.push(Caveat::new(
            "no-moire",
            name,
            format!(
                "periods of {a:.4}, {b:.4} and {c:.4} nm are no moiré of {about_layers}: its twist would be {:.0}°, \
                 and layers of this symmetry have none beyond 30°. This is the lattice of the atoms, or \
                 another one; its vectors are given, twist and strain are not",
                found.twist.abs().to_degrees()
            ),
        ));
    }
}
