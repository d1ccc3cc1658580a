//! Caveats of the solutions of a mean lattice.

use heterostrain::Estimate;
use heterostrain::lattice::Lattice;
use heterostrain::material::Bilayer;
use heterostrain::strain::{StrainTensor, TwistStrain};

use crate::caveat::orientation::{OrientationDoubt, SenseNumbers};
use crate::caveat::readings::{ChosenBy, NumbersOfName, ReadingDoubt, TwistShift};
use crate::caveat::{Caveat, Doubt};
use crate::meaning::naming::{NameReading, Naming};
use crate::meaning::readings::{AllNames, Readings};
use crate::meaning::strengths::WaveStrengths;
use crate::meaning::tensor::{CLEARLY, SenseReading, TensorReading, known_orientation};
use crate::settings::knobs::Settings;

/// A mean strain this large contradicts the orientation: layers on each other stay far below one per cent.
const CONTRADICTION: f64 = 0.01;

/// Caveats of the solutions of a mean lattice.
pub fn caveats(
    place: &str,
    lattice: &Lattice,
    found: &TwistStrain,
    readings: &Readings,
    settings: &Settings,
) -> Vec<Caveat> {
    let mut caveats = Vec::new();
    let mut add = |doubt: Doubt| caveats.push(Caveat::new(doubt, place));
    let bilayer = settings.bilayer();
    let tensor = readings.tensor.as_ref();
    if readings.layers_differ && tensor.is_none() {
        about_different_layers(found, readings, bilayer, &mut add);
        about_alignment(lattice, found, readings, bilayer, &mut add);
    }
    about_names(
        lattice,
        readings.naming.as_ref(),
        readings.complete_to,
        &mut add,
    );
    if known_orientation(settings).is_some() && tensor.is_none() {
        add(OrientationDoubt::Unused.into());
    }
    if settings.twist_sense.is_some() && tensor.is_none() {
        add(OrientationDoubt::SenseUnused.into());
    }
    if let Some(tensor) = tensor {
        if known_orientation(settings).is_some() {
            about_tensor(found, tensor, settings, &mut add);
        }
        about_sense(tensor, &mut add);
    }
    caveats
}

fn about_different_layers(
    found: &TwistStrain,
    readings: &Readings,
    bilayer: Bilayer<'_>,
    add: &mut impl FnMut(Doubt),
) {
    let choices: Vec<[f64; 2]> = readings.choices().map(|b| [b.twist, b.strain]).collect();
    let degeneracy = readings.degeneracy.as_ref();
    let shift = degeneracy.and_then(|d| {
        let (_, change) = d.shifts.iter().find(|(h, _)| *h == 0.001)?;
        Some(change.map_or(TwistShift::NoTwist, TwistShift::By))
    });
    if choices.is_empty() && found.twist > 0.0 {
        return;
    }
    add(ReadingDoubt::TwistTradesWithStrain {
        layers: bilayer.name(),
        choices,
        shift,
        interval: degeneracy.map(|d| d.interval),
    }
    .into());
}

/// Near alignment the moiré knows θ² and not θ.
fn about_alignment(
    lattice: &Lattice,
    found: &TwistStrain,
    readings: &Readings,
    bilayer: Bilayer<'_>,
    add: &mut impl FnMut(Doubt),
) {
    let twist = found.twist();
    // σ of θ², which stays finite; in `aligned` solutions σ_θ is its root.
    let square_sigma = if twist.value > 0.0 {
        2.0 * twist.value * twist.sigma
    } else {
        twist.sigma * twist.sigma
    };
    let limit = (twist.value * twist.value + 1.96 * square_sigma).sqrt();
    if readings.solutions.is_empty() {
        let longest = (0..3)
            .map(|i| lattice.wavelength(i).value)
            .fold(0.0, f64::max);
        add(ReadingDoubt::LargerThanAligned {
            layers: bilayer.name(),
            longest,
        }
        .into());
    } else if twist.value * twist.value < 1.96 * square_sigma {
        add(ReadingDoubt::AlignmentWithinErrors { limit }.into());
    }
}

fn about_tensor(
    found: &TwistStrain,
    tensor: &TensorReading,
    settings: &Settings,
    add: &mut impl FnMut(Doubt),
) {
    let tensor_ratio = tensor.poisson_ratio;
    let best = tensor.in_all();
    let mean = best.mean();
    let likely = CLEARLY * settings.isotropic_strain_percent / 100.0;
    let nearer = tensor
        .other_vector
        .is_some_and(|other| other.abs() < mean.value.abs())
        && mean.value.abs() > likely.max(CLEARLY * mean.sigma);
    let contradicted = mean.value.abs() > CONTRADICTION || nearer;
    if contradicted {
        add(OrientationDoubt::Contradicts {
            strain: mean.value,
            other: tensor.other_vector,
        }
        .into());
    }
    let sizes = |tensor: StrainTensor| tensor.splits(tensor_ratio).map(|split| split.biaxial);
    let beyond = |e: Estimate| {
        e.value.abs() > CLEARLY * e.sigma
            && e.value.abs() > CLEARLY * settings.isotropic_strain_percent / 100.0
    };
    let senses: Vec<[Estimate; 2]> = std::iter::once(best)
        .chain(tensor.opposite.as_ref().map(SenseReading::in_all))
        .map(sizes)
        .collect();
    if senses.iter().flatten().all(|e| beyond(*e)) && !contradicted {
        add(ReadingDoubt::IsotropicStrainFound {
            layer: known_orientation(settings).map_or(1, |known| known.layer),
            sizes: senses.iter().map(|s| s.map(|e| e.value)).collect(),
            difference: (best.twist.abs() - found.twist.abs()).abs(),
        }
        .into());
    }
    if !tensor.alternatives.is_empty() && settings.substrate.is_some() {
        let others = tensor.alternatives.iter().map(|t| &t.found);
        add(OrientationDoubt::Ambiguous {
            twist: tensor.best.twist,
            strain: tensor.best.mean,
            others: others.map(|t| [t.twist, t.mean]).collect(),
        }
        .into());
    }
}

/// Equal layers: an orientation does not tell which of the two is turned forward.
fn about_sense(tensor: &TensorReading, add: &mut impl FnMut(Doubt)) {
    if let Some(sigmas) = tensor.disagreement {
        add(OrientationDoubt::Disagree { sigmas }.into());
    }
    if tensor.sense_contradicted {
        add(OrientationDoubt::SenseContradicts.into());
    }
    let Some(opposite) = &tensor.opposite else {
        return;
    };
    add(OrientationDoubt::SenseOpen {
        senses: [tensor.in_all(), opposite.in_all()].map(SenseNumbers::from),
        magnitudes: tensor.magnitudes(),
    }
    .into());
}

/// Caveats of the indexing of a lattice.
pub(crate) fn name_caveats(
    place: &str,
    lattice: &Lattice,
    strengths: &WaveStrengths,
    settings: &Settings,
) -> Vec<Caveat> {
    let mut caveats = Vec::new();
    let mut add = |doubt: Doubt| caveats.push(Caveat::new(doubt, place));
    let all = AllNames::new(lattice, strengths, settings);
    about_names(lattice, all.naming.as_ref(), all.complete_to, &mut add);
    caveats
}

/// Other names of the lattice: which are open, or what chose one that is not the least strained.
fn about_names(
    lattice: &Lattice,
    naming: Option<&Naming>,
    complete_to: f64,
    add: &mut impl FnMut(Doubt),
) {
    let Some(naming) = naming else {
        return;
    };
    let Some(reported) = naming.names.first() else {
        return;
    };
    let numbers = |n: &NameReading| NumbersOfName {
        twist: n.twist,
        strain: n.strain,
    };
    let open: Vec<NumbersOfName> = naming.open().map(numbers).collect();
    if !open.is_empty() {
        add(ReadingDoubt::NamesCompete {
            reported: numbers(reported),
            open,
            by_image: naming.chosen_by == ChosenBy::Image,
            complete_to,
        }
        .into());
    }
    let less: Vec<NumbersOfName> = naming.names[1..]
        .iter()
        .filter(|n| n.strain < reported.strain * (1.0 - 1e-9))
        .map(numbers)
        .collect();
    if less.is_empty() {
        return;
    }
    let waves = reported
        .name
        .waves(&lattice.basis)
        .map_or([[f64::NAN; 2]; 2], |w| [[w.m11, w.m21], [w.m12, w.m22]]);
    add(ReadingDoubt::NotTheLeastStrain {
        waves,
        reported: numbers(reported),
        less,
        chosen_by: naming.chosen_by,
    }
    .into());
}
