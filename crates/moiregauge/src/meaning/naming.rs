//! Which pair of waves of the lattice belongs to the atoms: all names, and what speaks for one of them.
//!
//! From a strain of about 0.46 θ (rad) on another primitive pair than the least strained one can be the true one.
//! - The image: the three waves of the first shell of the true name are equally strong where the contrast follows the
//!   stacking of the layers. Another name has a wave in its first shell that is a higher harmonic in truth. A name is
//!   excluded if one of its waves has less than half the amplitude of all three waves of another name, noise allowed for,
//!   and if no blur would do that: contrast that is round in the laboratory (the tip, domains of constant size) favours
//!   long wavelengths.
//! - An orientation of a layer: the wrong names need isotropic strain.
//!
//! Nodes and topology of domains are not used.

use heterostrain::lattice::Lattice;
use heterostrain::strain::{LatticeName, Orientation, Solutions, solutions, strain_tensors};
use nalgebra::{Matrix2, Vector2};

use crate::caveat::readings::ChosenBy;
use crate::meaning::strengths::WaveStrengths;
use crate::meaning::tensor::{CLEARLY, known_orientation};
use crate::settings::knobs::Settings;

/// A solution with no more strain than this, or than twice that of the one reported, is plausible. On the scenes of docs/constants.md half and double
/// change results by at most 0.01 σ.
const PLAUSIBLE_STRAIN: f64 = 0.007;
/// Amplitude over that of the others below which a wave is not of the first order. Chosen by eye; see
/// docs/constants.md.
const WEAK: f64 = 0.5;
/// The strongest wave of a first shell over the weakest, at most. Half and twice as much change no result of
/// docs/constants.md.
const EVEN: f64 = 3.0;
/// Standard deviation of a round Gaussian that may blur the contrast, nm: spots 7 nm wide, as of a blunt tip. See
/// docs/constants.md.
const BLUR: f64 = 3.0;

/// What is thought of a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Standing {
    /// It is the one of the reported numbers.
    Reported,
    /// It may be the right one as well.
    Open,
    /// The image speaks against it.
    AgainstImage,
    /// The orientation of a layer speaks against it.
    AgainstOrientation,
    /// It needs much strain.
    Unlikely,
}

/// One name of the lattice.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct NameReading {
    /// Which waves.
    pub name: LatticeName,
    /// The uniaxial strain (magnitude) of its default solution.
    pub strain: f64,
    /// The twist that goes with it, rad.
    pub twist: f64,
    /// What is thought of it.
    pub standing: Standing,
}

/// All names and the choice among them.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Naming {
    /// The reported one first, then the least strained ones.
    pub names: Vec<NameReading>,
    /// What chose the first.
    pub chosen_by: ChosenBy,
}

impl Naming {
    /// The names that may be right beside the reported one.
    pub fn open(&self) -> impl Iterator<Item = &NameReading> {
        self.names.iter().filter(|n| n.standing == Standing::Open)
    }

    /// What is thought of the names of `found`, whose first is reported. `None` for layers of dissimilar lattices, whose
    /// solutions under all names are of equal rank anyway.
    pub(crate) fn new(
        lattice: &Lattice,
        found: &Solutions,
        strengths: &WaveStrengths,
        settings: &Settings,
    ) -> Option<Self> {
        let mut names = by_name(found);
        let reported = *names.first()?;
        let limit = plausible(&reported);
        judge(&mut names, limit, lattice, strengths, settings);
        let stands = |n: &NameReading, standing| n.standing == standing && n.strain <= limit;
        let speaks = |standing| names[1..].iter().any(|n| stands(n, standing));
        let less = names
            .iter()
            .any(|n| n.strain < reported.strain * (1.0 - 1e-9));
        let chosen_by = if names[0].standing != Standing::Open {
            ChosenBy::User
        } else if speaks(Standing::AgainstImage) {
            ChosenBy::Image
        } else if speaks(Standing::AgainstOrientation) {
            ChosenBy::Orientation
        } else if settings.moire_waves.is_some() && less {
            ChosenBy::User
        } else {
            ChosenBy::LeastStrain
        };
        names[0].standing = Standing::Reported;
        Some(Self { names, chosen_by })
    }
}

/// The waves (rad/nm) of the name that the evidence speaks for, where that is not the least strained one; `None` where it
/// is, or the user named the waves.
pub(crate) fn named_waves(
    lattice: &Lattice,
    strengths: &WaveStrengths,
    settings: &Settings,
) -> Option<[[f64; 2]; 2]> {
    if settings.moire_waves.is_some() {
        return None;
    }
    let bilayer = settings.bilayer();
    let similar =
        bilayer.reference.is_hexagonal() && bilayer.stretched.is_hexagonal() || bilayer.is_equal();
    if !similar {
        return None;
    }
    let found = solutions(lattice, bilayer, settings.strain_convention).ok()?;
    let mut names = by_name(&found);
    let first = *names.first()?;
    judge(&mut names, plausible(&first), lattice, strengths, settings);
    let left = |n: &&NameReading| n.standing == Standing::Open;
    let likely = |n: &&NameReading| matches!(n.standing, Standing::Open | Standing::Unlikely);
    let least = |a: &&NameReading, b: &&NameReading| a.strain.total_cmp(&b.strain);
    let best = names.iter().filter(left).min_by(least);
    let best = best.or_else(|| names.iter().filter(likely).min_by(least))?;
    if best.name == first.name {
        return None;
    }
    let waves = best.name.waves(&lattice.basis)?;
    Some([0, 1].map(|i| [waves[(0, i)], waves[(1, i)]]))
}

/// The strain up to which names are plausible beside this one.
pub(crate) fn plausible(name: &NameReading) -> f64 {
    PLAUSIBLE_STRAIN.max(2.0 * name.strain.min(PLAUSIBLE_STRAIN))
}

/// The names of the solutions in their order, each with its default solution: θ > 0 and ε ≥ 0 where there is one.
fn by_name(found: &Solutions) -> Vec<NameReading> {
    let mut names: Vec<NameReading> = Vec::new();
    for branch in found.branches.iter().filter(|b| b.twist >= 0.0) {
        if names.iter().all(|n| n.name != branch.name) {
            names.push(NameReading {
                name: branch.name,
                strain: branch.strain.abs(),
                twist: branch.twist,
                standing: Standing::Open,
            });
        }
    }
    names
}

/// Sets the standings; the first name is taken for plausible.
fn judge(
    names: &mut [NameReading],
    limit: f64,
    lattice: &Lattice,
    strengths: &WaveStrengths,
    settings: &Settings,
) {
    let shells: Vec<Option<[Wave; 3]>> = names
        .iter()
        .map(|n| first_shell(n.name, lattice, strengths, settings))
        .collect();
    for (i, name) in names.iter_mut().enumerate() {
        let beaten = shells
            .iter()
            .flatten()
            .any(|other| shells[i].is_some_and(|own| beats(other, &own)));
        name.standing = if beaten {
            Standing::AgainstImage
        } else if i > 0 && name.strain > limit {
            Standing::Unlikely
        } else {
            Standing::Open
        };
    }
    let open: Vec<usize> = (0..names.len())
        .filter(|&i| names[i].standing == Standing::Open)
        .collect();
    let sigmas: Vec<(usize, f64)> = open
        .into_iter()
        .filter_map(|i| Some((i, off_orientation(names[i].name, lattice, settings)?)))
        .collect();
    let least = sigmas.iter().map(|(_, s)| *s).fold(f64::INFINITY, f64::min);
    for (i, sigmas) in sigmas {
        if sigmas.powi(2) - least.powi(2) > CLEARLY.powi(2) {
            names[i].standing = Standing::AgainstOrientation;
        }
    }
}

/// A wave of a first shell: its wave vector's length (rad/nm) and the bounds of its amplitude.
#[derive(Clone, Copy, Debug)]
struct Wave {
    length: f64,
    low: f64,
    high: f64,
}

/// The first shell of a name in the images; `None` without any, and for layers that are not hexagonal.
fn first_shell(
    name: LatticeName,
    lattice: &Lattice,
    strengths: &WaveStrengths,
    settings: &Settings,
) -> Option<[Wave; 3]> {
    if !settings.bilayer().reference.is_hexagonal() {
        return None;
    }
    let dual: Matrix2<f64> = LatticeName([[1, 0], [0, 1]]).waves(&lattice.basis)?;
    let wave = |[h, k]: [i32; 2]| {
        let wave = dual * Vector2::new(f64::from(h), f64::from(k));
        let [low, high] = strengths.bounds(wave)?;
        Some(Wave {
            length: wave.norm(),
            low,
            high,
        })
    };
    let [a, b, c] = name.first_shell().map(wave);
    Some([a?, b?, c?])
}

/// Whether the image shows a first shell in `strong` and has one of the waves of `other` too weak for the first order.
fn beats(strong: &[Wave; 3], other: &[Wave; 3]) -> bool {
    let weakest = strong.iter().map(|w| w.low).fold(f64::INFINITY, f64::min);
    let strongest = strong.iter().map(|w| w.high).fold(0.0, f64::max);
    if strongest > EVEN * weakest {
        return false;
    }
    other.iter().any(|weak| {
        strong.iter().all(|wave| {
            let longer = weak.length.powi(2) - wave.length.powi(2);
            let blur = (BLUR.powi(2) * longer.max(0.0) / 2.0).exp();
            weak.high * blur < WEAK * wave.low
        })
    })
}

/// How many σ of noise, orientation and likely isotropic strain the mean strain of a name is off what uniaxial strain makes;
/// `None` without an orientation.
fn off_orientation(name: LatticeName, lattice: &Lattice, settings: &Settings) -> Option<f64> {
    let mut bilayer = settings.bilayer();
    bilayer.waves = name.waves(&lattice.basis);
    let orientation = Orientation::of(&known_orientation(settings)?, bilayer);
    let found = strain_tensors(lattice, bilayer, &orientation).ok()?;
    let likely = settings.isotropic_strain_percent / 100.0;
    let off = |t: &heterostrain::strain::StrainTensor| {
        let [a, b] = t.splits(bilayer.stretched.poisson_ratio).map(|s| s.biaxial);
        let sigma = a.sigma.hypot(likely);
        a.value.abs().min(b.value.abs()) / sigma.max(1e-9)
    };
    found.iter().map(off).min_by(f64::total_cmp)
}
