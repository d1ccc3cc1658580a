//! Is the lattice a moiré of the layers at all?
//!
//! Two hexagonal layers look the same turned by 60°, so no twist is beyond 30° and no moiré of equal layers
//! is shorter than 1.9 of their lattice constants. A shorter lattice is that of the atoms or of something
//! else, and however well it is measured, it has no twist. Two hexagonal layers of different constants make no moiré
//! longer than `a₁a₂/|a₁ − a₂|`, that of aligned ones; a longer one is of other layers.

use std::f64::consts::FRAC_PI_6;

use heterostrain::lattice::Lattice;
use heterostrain::material::{Bilayer, Material};
use heterostrain::strain::{TwistStrain, draws, twist_strain};
use rayon::prelude::*;

use crate::calibration::KnownLattice;
use crate::campaign::analysis::ScanAnalysis;
use crate::campaign::means::{SetLattice, SetMean};
use crate::caveat::Caveat;
use crate::caveat::moires::{Impossible, MoireDoubt, PeriodDoubt};
use crate::numbers::interrupt;
use crate::numbers::rng::normals;
use crate::settings::knobs::Settings;

/// Heterostrains of layers on each other stay below a few tenths of a per cent, rarely a per cent; more
/// than this deserves a word.
const LARGE_STRAIN: f64 = 0.02;
/// Layers slide on each other before they hold so much, and two-dimensional crystals break at two or three times that: it is no result. On the scenes
/// of docs/constants.md half and double change no result.
const MOST_STRAIN: f64 = 0.05;
/// A period this near to that of a known surface may be that of the surface: four times the calibration that is
/// assumed.
const SURFACE: f64 = 0.04;
/// Shorter periods (nm) are of atoms or surfaces more often than of twisted layers, nm: a twist of 9° in graphene.
const SHORT: f64 = 1.5;

/// Twist and strain of a lattice that can be a moiré; `None` where it cannot.
pub(crate) fn moire(lattice: &Lattice, settings: &Settings) -> Option<TwistStrain> {
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

/// Why a mean is refused: its strain is beyond that of any layers, whatever its errors. A lattice chosen by hand is accepted.
pub(crate) fn breaks(mean: &SetMean, settings: &Settings) -> Option<MoireDoubt> {
    let [least, _] = mean.twist_strain.strain().interval_95();
    let breaks = least > MOST_STRAIN && !settings.by_hand.says_which();
    breaks.then(|| {
        MoireDoubt::LayersCannotMakeIt(Impossible::Strain {
            strain: mean.twist_strain.heterostrain().value,
            layers: settings.bilayer().name(),
        })
    })
}

/// Whether the strain is larger than any that is known, whatever its errors.
pub(crate) fn is_large_strain(mean: &SetMean) -> bool {
    let [least, _] = mean.twist_strain.strain().interval_95();
    least > LARGE_STRAIN
}

/// Draws twist and strain of every scan.
pub(crate) fn draw(scans: &mut [ScanAnalysis], settings: &Settings, first_index: u64) {
    scans.par_iter_mut().enumerate().for_each(|(i, scan)| {
        interrupt::check();
        let lattice = scan.drift_corrected.as_ref().unwrap_or(&scan.sensor);
        if moire(lattice, settings).is_none() {
            return;
        }
        scan.draws = draws(
            lattice,
            settings.bilayer(),
            settings.strain_convention,
            settings.strain_draws,
            watched(normals(settings.seed, "strain", first_index + i as u64)),
        );
    });
}

/// The same numbers, and a way out between any two of them: a million draws take a third of a second.
fn watched(mut normal: impl FnMut() -> f64) -> impl FnMut() -> f64 {
    move || {
        interrupt::check();
        normal()
    }
}

/// Says where a lattice is no moiré, or hardly one.
pub(crate) fn doubts(
    name: &str,
    mean: Option<&SetMean>,
    lattice: Option<&SetLattice>,
    settings: &Settings,
    caveats: &mut Vec<Caveat>,
) {
    let layers = &settings.material;
    let assumed = if settings.layers_are_assumed() {
        ", assumed because no layers were named"
    } else {
        ""
    };
    let about_layers = format!(
        "{} ({} nm{assumed})",
        layers.name, layers.lattice_constant_nm
    );
    if let Some(mean) = mean {
        caveats.extend(about_period(name, &mean.lattice, settings));
        if is_large_strain(mean) {
            caveats.push(Caveat::new(
                MoireDoubt::LargeStrain {
                    strain: mean.twist_strain.heterostrain().value,
                    layers: about_layers,
                },
                name,
            ));
        }
        return;
    }
    let Some(lattice) = lattice.map(|found| found.lattice) else {
        return;
    };
    let found = twist_strain(&lattice, settings.bilayer(), settings.strain_convention);
    let found = match found {
        Ok(found) => found,
        Err(why) => {
            caveats.push(no_reading(name, &lattice, settings, &why.to_string()));
            return;
        }
    };
    if !is_below_30_degrees(&found, settings) {
        caveats.push(Caveat::new(
            MoireDoubt::NoMoire {
                periods: [0, 1, 2].map(|i| lattice.wavelength(i).value),
                twist: found.twist.abs(),
                layers: about_layers,
            },
            name,
        ));
    }
}

/// Mean of the three wavelengths, nm.
fn period(lattice: &Lattice) -> f64 {
    (0..3).map(|i| lattice.wavelength(i).value).sum::<f64>() / 3.0
}

/// The period of the longest moiré that hexagonal layers make without strain, nm; `None` where there is no longest.
fn longest(layers: Bilayer<'_>) -> Option<f64> {
    let [a, b] =
        [layers.reference, layers.stretched].map(|layer: &Material| layer.lattice_constant_nm);
    let hexagonal = layers.reference.is_hexagonal() && layers.stretched.is_hexagonal();
    (hexagonal && !layers.is_equal()).then(|| a * b / (a - b).abs())
}

/// Why these layers make no such lattice.
fn no_reading(name: &str, lattice: &Lattice, settings: &Settings, why: &str) -> Caveat {
    let (measured, bilayer) = (period(lattice), settings.bilayer());
    let layers = bilayer.name();
    let impossible = match longest(bilayer).filter(|longest| measured > *longest) {
        Some(longest) => {
            // |1 − a/b| less what the moiré shows of it.
            let a = bilayer
                .reference
                .lattice_constant_nm
                .max(bilayer.stretched.lattice_constant_nm);
            Impossible::TooLong {
                period: measured,
                layers,
                longest,
                strain: a / longest - a / measured,
            }
        }
        None => Impossible::NoSolution {
            period: measured,
            layers,
            reason: why.to_owned(),
        },
    };
    Caveat::new(MoireDoubt::LayersCannotMakeIt(impossible), name)
}

/// Asks whether a lattice is a moiré at all that has the period of a surface, or a very short one.
fn about_period(name: &str, lattice: &Lattice, settings: &Settings) -> Option<Caveat> {
    let (measured, assumed) = (period(lattice), settings.layers_are_assumed());
    if !assumed && measured > SHORT {
        return None;
    }
    let surfaces = KnownLattice::all().into_iter().map(|k| (k.name, k.a_nm));
    let atoms = Material::all()
        .into_iter()
        .map(|m| (m.name, m.lattice_constant_nm));
    let off = |a: f64| (measured / a - 1.0).abs();
    let known = surfaces
        .chain(atoms)
        .filter(|(_, a)| off(*a) < SURFACE)
        .min_by(|a, b| off(a.1).total_cmp(&off(b.1)));
    let mut layers = settings.bilayer().name();
    if assumed {
        layers += ", which was assumed because no layers were named";
    }
    let doubt = match known {
        Some((surface, constant)) => PeriodDoubt::OfSurface {
            period: measured,
            surface,
            constant,
            layers,
        },
        None if measured < SHORT => PeriodDoubt::Short {
            period: measured,
            layers,
        },
        None => return None,
    };
    Some(Caveat::new(MoireDoubt::Doubtful(doubt), name))
}
