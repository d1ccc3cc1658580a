//! What one moiré lattice can mean: all readings, what isotropic strain does to them, and the strain
//! tensor where the orientation of a layer is known.
//!
//! In: a lattice (nm) with its covariance, the settings. Out: rad, no dimension.

use std::f64::consts::FRAC_PI_6;

use nalgebra::{Matrix5, Vector5};

use crate::budget::Budget;
use crate::caveat::Caveat;
use crate::estimate::Estimate;
use crate::lattice::LatticeVectors;
use crate::material::{Bilayer, Material};
use crate::settings::Settings;
use crate::strain::{
    Branch, Degeneracy, Orientation, StrainTensor, TwistStrain, branches, degeneracy,
    strain_tensors,
};

/// A mean strain this large contradicts the orientation.
const CONTRADICTION: f64 = 0.01;
/// Standard deviations that deserve a word.
const CLEARLY: f64 = 3.0;

/// All that a lattice can mean.
#[derive(Clone, Debug)]
pub struct Readings {
    /// Whether the layers differ, so that twist and strain trade at first order.
    pub layers_differ: bool,
    /// Every exact solution with uniaxial strain alone, the default first; empty where only aligned layers,
    /// strained in all directions, explain the lattice.
    pub solutions: Vec<Branch>,
    /// What isotropic strain does to the twist; `None` where there is no solution.
    pub degeneracy: Option<Degeneracy>,
    /// The strain tensor; `None` without an orientation.
    pub tensor: Option<TensorReading>,
}

/// The strain tensor for the orientation that is known.
#[derive(Clone, Debug)]
pub struct TensorReading {
    /// The best reading; its covariance holds noise, drift, sensors and the orientation.
    pub best: StrainTensor,
    /// Covariance of `(θ, α, mean, shear)` with calibration and lattice constants as well.
    pub known: Matrix5<f64>,
    /// Other readings of the same orientation with a mean strain below 1 %.
    pub alternatives: Vec<StrainTensor>,
    /// ν of the strained layer.
    pub poisson_ratio: f64,
    /// The mean strain, if the orientation were that of the other kind of vector, 30° off; `None` for
    /// layers that are not hexagonal.
    pub other_vector: Option<f64>,
}

impl TensorReading {
    /// The best reading with everything in the budget for its covariance.
    pub fn in_all(&self) -> StrainTensor {
        StrainTensor {
            covariance: self.known,
            ..self.best
        }
    }
}

impl Readings {
    /// Everything that the lattice of `found` can mean.
    pub fn new(
        lattice: &LatticeVectors,
        found: &TwistStrain,
        budget: &Budget,
        settings: &Settings,
    ) -> Self {
        let bilayer = settings.bilayer();
        let convention = settings.strain_convention;
        let prior = settings.isotropic_strain_percent / 100.0;
        Self {
            layers_differ: !bilayer.is_equal(),
            solutions: branches(lattice, bilayer.reference, bilayer.stretched, convention)
                .unwrap_or_default(),
            degeneracy: degeneracy(lattice, bilayer, convention, found.twist(), prior),
            tensor: settings.lattice_angle.and_then(|known| {
                let orientation = Orientation::of(&known, bilayer);
                tensor(lattice, budget, &orientation, settings)
            }),
        }
    }

    /// The solutions with θ > 0 that need no strain as large as the twist: those that a user has to choose
    /// from.
    pub fn choices(&self) -> impl Iterator<Item = &Branch> {
        self.solutions
            .iter()
            .filter(|b| b.twist > 0.0 && !b.strain_dominated)
    }
}

fn tensor(
    lattice: &LatticeVectors,
    budget: &Budget,
    orientation: &Orientation,
    settings: &Settings,
) -> Option<TensorReading> {
    let bilayer = settings.bilayer();
    let mut found = strain_tensors(lattice, bilayer, orientation)
        .ok()?
        .into_iter();
    let best = found.next()?;
    // The same reading for other errors: its orientation is known exactly there.
    let exact = Orientation {
        sigma: 0.0,
        ..*orientation
    };
    let near = |lattice: &LatticeVectors, bilayer: Bilayer<'_>| {
        let all = strain_tensors(lattice, bilayer, &exact).ok()?;
        let distance = |t: &StrainTensor| (t.twist - best.twist).abs();
        all.into_iter()
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))
    };
    let mut known = best.covariance;
    for error in budget.calibration_errors(lattice, settings) {
        let with = LatticeVectors {
            covariance: error,
            ..*lattice
        };
        known += near(&with, bilayer)?.covariance;
    }
    for changed in constants(bilayer) {
        let bilayer = Bilayer {
            reference: &changed[0],
            stretched: &changed[1],
        };
        let moved = near(lattice, bilayer)?;
        let change = Vector5::new(
            moved.twist - best.twist,
            0.0,
            moved.mean - best.mean,
            moved.shear.x - best.shear.x,
            moved.shear.y - best.shear.y,
        );
        known += change * change.transpose();
    }
    Some(TensorReading {
        best,
        known,
        alternatives: found.collect(),
        other_vector: other_vector(lattice, bilayer, &exact),
        poisson_ratio: bilayer.stretched.poisson_ratio,
    })
}

/// The mean strain for an orientation 30° off.
fn other_vector(
    lattice: &LatticeVectors,
    bilayer: Bilayer<'_>,
    orientation: &Orientation,
) -> Option<f64> {
    let material = if orientation.of_reference {
        bilayer.reference
    } else {
        bilayer.stretched
    };
    if !material.is_hexagonal() {
        return None;
    }
    let turned = Orientation {
        angle: orientation.angle + FRAC_PI_6,
        ..*orientation
    };
    let all = strain_tensors(lattice, bilayer, &turned).ok()?;
    all.first().map(|t| t.mean)
}

/// The layers with lattice constants off by one σ: both together where they are one material, each by
/// itself where they are not.
fn constants(bilayer: Bilayer<'_>) -> Vec<[Material; 2]> {
    let larger = |material: &Material| {
        let factor = 1.0 + material.lattice_constant_sigma_nm / material.lattice_constant_nm;
        Material {
            lattice_constant_nm: material.lattice_constant_nm * factor,
            lattice_constant_b_nm: material.lattice_constant_b_nm.map(|b| b * factor),
            ..material.clone()
        }
    };
    let (first, second) = (bilayer.reference, bilayer.stretched);
    if bilayer.is_equal() {
        vec![[larger(first), larger(second)]]
    } else {
        vec![
            [larger(first), second.clone()],
            [first.clone(), larger(second)],
        ]
    }
}

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
    if settings.lattice_angle.is_some() && tensor.is_none() {
        add(
            "orientation-unused",
            "the orientation of the layer goes with no reading of this moiré".to_owned(),
        );
    }
    if let Some(tensor) = tensor {
        about_tensor(tensor, settings, &mut add);
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

fn about_tensor(tensor: &TensorReading, settings: &Settings, add: &mut impl FnMut(&str, String)) {
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
    let [first, second] = best.splits(tensor.poisson_ratio);
    let beyond = |e: Estimate| {
        e.value.abs() > CLEARLY * e.sigma
            && e.value.abs() > CLEARLY * settings.isotropic_strain_percent / 100.0
    };
    if beyond(first.biaxial) && beyond(second.biaxial) && !contradicted {
        add(
            "isotropic-strain-found",
            format!(
                "with the orientation of layer {} the layers differ in size by {:+.3} or {:+.3} %, more than \
                 uniaxial strain brings with it: `twist_deg`, which assumes that there is none, is wrong; use \
                 `strain_tensor`",
                settings.lattice_angle.map_or(1, |known| known.layer),
                100.0 * first.biaxial.value,
                100.0 * second.biaxial.value,
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
