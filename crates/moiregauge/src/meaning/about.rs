//! What has to be said of the readings of a mean lattice.

use heterostrain::Estimate;
use heterostrain::lattice::LatticeVectors;
use heterostrain::material::Bilayer;
use heterostrain::strain::{StrainTensor, TwistStrain};

use crate::caveat::Caveat;
use crate::meaning::naming::{ChosenBy, NameReading, Naming};
use crate::meaning::readings::{AllNames, Readings};
use crate::meaning::strengths::WaveStrengths;
use crate::meaning::tensor::{CLEARLY, SenseReading, TensorReading, known_orientation};
use crate::settings::knobs::Settings;

/// A mean strain this large contradicts the orientation.
const CONTRADICTION: f64 = 0.01;

/// What has to be said of the readings of a mean lattice.
pub fn caveats(
    place: &str,
    lattice: &LatticeVectors,
    found: &TwistStrain,
    readings: &Readings,
    settings: &Settings,
) -> Vec<Caveat> {
    let mut caveats = Vec::new();
    let mut add = |code: &str, message: String| caveats.push(Caveat::new(code, place, message));
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
        add(
            "orientation-unused",
            "the orientation of the layer goes with no reading of this moiré".to_owned(),
        );
    }
    if settings.twist_sense.is_some() && tensor.is_none() {
        add(
            "twist-sense-unused",
            "the sense of the twist was given, which tells nothing without the orientation of a layer: the twist is \
             a magnitude"
                .to_owned(),
        );
    }
    if let Some(tensor) = tensor {
        about_tensor(found, tensor, settings, &mut add);
        about_sense(tensor, &mut add);
    }
    caveats
}

fn degrees(angle: f64) -> String {
    format!("{:.3}°", angle.to_degrees())
}

fn about_different_layers(
    found: &TwistStrain,
    readings: &Readings,
    bilayer: Bilayer<'_>,
    add: &mut impl FnMut(&str, String),
) {
    let choices: Vec<String> = readings
        .choices()
        .map(|b| {
            format!(
                "{} with a strain of {:+.3} %",
                degrees(b.twist),
                100.0 * b.strain
            )
        })
        .collect();
    let shift = readings.degeneracy.as_ref().and_then(|d| {
        let (_, change) = d.shifts.iter().find(|(h, _)| *h == 0.001)?;
        Some(change.map_or_else(
            || "no twist at all goes with 0.1 % of isotropic strain".to_owned(),
            |c| format!("0.1 % of isotropic strain moves it by {}", degrees(c)),
        ))
    });
    let interval = readings.degeneracy.as_ref().map(|d| {
        format!(
            "; {} to {} in all",
            degrees(d.interval[0]),
            degrees(d.interval[1])
        )
    });
    if choices.is_empty() && found.twist > 0.0 {
        return;
    }
    add(
        "twist-trades-with-strain",
        format!(
            "the layers of {} differ in size, so that twist and strain trade at first order: the moiré is as \
             well one of {}; {}{}. The orientation of a layer (--lattice-angle, --atomic) would tell",
            bilayer.name(),
            choices.join(" as of "),
            shift.unwrap_or_default(),
            interval.unwrap_or_default()
        ),
    );
}

/// Near alignment the moiré knows θ² and not θ.
fn about_alignment(
    lattice: &LatticeVectors,
    found: &TwistStrain,
    readings: &Readings,
    bilayer: Bilayer<'_>,
    add: &mut impl FnMut(&str, String),
) {
    let twist = found.twist();
    // σ of θ², which stays finite; in `aligned` readings σ_θ is its root.
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
        add(
            "larger-than-aligned",
            format!(
                "no twist and uniaxial strain of {} make a moiré as large as this one (up to {longest:.3} nm): \
                 it is read as aligned layers, θ = 0; isotropic strain, the lattice constants or the gain \
                 of the scanner account for the rest",
                bilayer.name()
            ),
        );
    } else if twist.value * twist.value < 1.96 * square_sigma {
        add(
            "alignment-within-errors",
            format!(
                "the twist cannot be told from zero: near alignment the moiré depends on θ², and σ of a \
                 small θ means little; θ < {} (95 %, statistical errors alone)",
                degrees(limit)
            ),
        );
    }
}

fn about_tensor(
    found: &TwistStrain,
    tensor: &TensorReading,
    settings: &Settings,
    add: &mut impl FnMut(&str, String),
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
        add(
            "orientation-contradicts",
            format!(
                "the orientation that was given would need an isotropic heterostrain of {:+.2} %{}: it is that of \
                 another vector (30° off for a hexagonal layer; see --lattice-angle-of), another layer or \
                 another sample",
                100.0 * mean.value,
                tensor
                    .other_vector
                    .map_or_else(String::new, |other| format!(
                        ", one 30° further {:+.2} %",
                        100.0 * other
                    ))
            ),
        );
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
        let shown: Vec<String> = senses
            .iter()
            .map(|[a, b]| format!("{:+.3} or {:+.3} %", 100.0 * a.value, 100.0 * b.value))
            .collect();
        add(
            "isotropic-strain-found",
            format!(
                "with the orientation of layer {} the layers differ in size by {}, more than uniaxial strain brings \
                 with it: `twist_deg` assumes that there is none, and differs by {} from the magnitude of the twist of \
                 `strain_tensor`, which does not",
                known_orientation(settings).map_or(1, |known| known.layer),
                shown.join(", or for the other sense of the twist by "),
                degrees((best.twist.abs() - found.twist.abs()).abs()),
            ),
        );
    }
    if !tensor.alternatives.is_empty() && settings.substrate.is_some() {
        let others: Vec<String> = tensor
            .alternatives
            .iter()
            .map(|t| format!("{} with {:+.2} %", degrees(t.twist), 100.0 * t.mean))
            .collect();
        add(
            "orientation-ambiguous",
            format!(
                "an orientation is known modulo the symmetry of its layer only: {} of mean strain {:+.2} % is \
                 the reading with the least; others are {}",
                degrees(tensor.best.twist),
                100.0 * tensor.best.mean,
                others.join(", ")
            ),
        );
    }
}

/// Equal layers: an orientation does not tell which of the two is turned forward.
fn about_sense(tensor: &TensorReading, add: &mut impl FnMut(&str, String)) {
    if let Some(sigmas) = tensor.disagreement {
        add(
            "orientations-disagree",
            format!(
                "the orientations of the two layers differ from what the moiré makes of one of them by {sigmas:.1} σ at \
                 least: one of them is that of another vector, another layer or another sample, or an error is \
                 too small"
            ),
        );
    }
    if tensor.sense_contradicted {
        add(
            "twist-sense-contradicts",
            "the orientation of the layer goes with no twist of the sense that was given; the other sense is shown"
                .to_owned(),
        );
    }
    let Some(opposite) = &tensor.opposite else {
        return;
    };
    let words = |tensor: StrainTensor| {
        format!(
            "{} ± {} with a mean strain of {:+.4} %",
            degrees(tensor.twist),
            degrees(tensor.twist().sigma),
            100.0 * tensor.mean
        )
    };
    let interval = tensor.magnitudes().map_or_else(String::new, |[low, high]| {
        format!(
            "; magnitudes from {} to {} are open",
            degrees(low),
            degrees(high)
        )
    });
    add(
        "twist-sense-open",
        format!(
            "two equal layers: the orientation of one of them goes with twists of either sense, {} and {}, and \
             none is better than the other{interval}. The sense of the twist, or the orientation of the other layer, \
             would tell",
            words(tensor.in_all()),
            words(opposite.in_all()),
        ),
    );
}

/// What has to be said of the names of a lattice alone.
pub(crate) fn name_caveats(
    place: &str,
    lattice: &LatticeVectors,
    strengths: &WaveStrengths,
    settings: &Settings,
) -> Vec<Caveat> {
    let mut caveats = Vec::new();
    let mut add = |code: &str, message: String| caveats.push(Caveat::new(code, place, message));
    let all = AllNames::new(lattice, strengths, settings);
    about_names(lattice, all.naming.as_ref(), all.complete_to, &mut add);
    caveats
}

/// Other names of the lattice: which are open, or what chose one that is not the least strained.
fn about_names(
    lattice: &LatticeVectors,
    naming: Option<&Naming>,
    complete_to: f64,
    add: &mut impl FnMut(&str, String),
) {
    let Some(naming) = naming else {
        return;
    };
    let Some(reported) = naming.names.first() else {
        return;
    };
    let words = |n: &NameReading| {
        format!(
            "{} with {:.3} % of strain",
            degrees(n.twist),
            100.0 * n.strain
        )
    };
    let open: Vec<String> = naming.open().map(words).collect();
    if !open.is_empty() {
        add(
            "names-compete",
            format!(
                "the same lattice has other pairs of vectors, and the strain that these need is plausible, too: {} is the \
                 reading that is reported, but it can as well be {}. {} The orientation of a layer may tell; all \
                 readings with up to {:.2} % are under `readings.solutions`",
                words(reported),
                open.join(", or "),
                if naming.chosen_by == ChosenBy::Image {
                    "The image speaks against others, not against these."
                } else {
                    "The image does not tell them apart: no three waves in it are equally strong while one of each \
                     other reading is weak, or they were not measured."
                },
                100.0 * complete_to,
            ),
        );
    }
    let less: Vec<String> = naming.names[1..]
        .iter()
        .filter(|n| n.strain < reported.strain * (1.0 - 1e-9))
        .map(words)
        .collect();
    if less.is_empty() {
        return;
    }
    let [a, b] = reported
        .name
        .waves(&lattice.basis)
        .map_or([[f64::NAN; 2]; 2], |w| [[w.m11, w.m21], [w.m12, w.m22]]);
    add(
        "not-the-least-strain",
        format!(
            "the reported pair of waves, ({:.4}, {:.4}) and ({:.4}, {:.4}) rad/nm, is not the one that needs the least \
             strain: {} in place of {}. {}",
            a[0],
            a[1],
            b[0],
            b[1],
            words(reported),
            less.join(" or "),
            match naming.chosen_by {
                ChosenBy::Image => {
                    "The image decided: these waves and their sum are strong, and each of the others has a weak one in \
                     its first shell"
                }
                ChosenBy::Orientation => {
                    "The orientation of a layer decided: the others need isotropic strain on top"
                }
                ChosenBy::User | ChosenBy::LeastStrain => "It was given",
            }
        ),
    );
}
