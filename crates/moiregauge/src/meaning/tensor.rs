//! The strain tensor where the orientation of a layer is known.
//!
//! In: a lattice (nm) with its budget, orientations and the sense of the twist as far as they are known. Out: rad, no
//! dimension. For two equal layers one orientation goes with (θ, η) and about (−θ, −η): both are kept until the sense of
//! the twist or the orientation of the other layer is known.

use std::f64::consts::FRAC_PI_6;

use heterostrain::lattice::Lattice;
use heterostrain::material::{Bilayer, Material};
use heterostrain::strain::{KnownOrientation, Orientation, StrainTensor, strain_tensors};
use nalgebra::{Matrix5, Vector5};

use crate::meaning::budget::Budget;
use crate::settings::knobs::Settings;

/// Least standard deviation of an orientation, rad: numbers that are typed in have rounding errors.
const ROUNDING: f64 = 1e-6;

/// The strain tensor for the orientation that is known.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct TensorReading {
    /// The best solution; its covariance holds noise, drift, sensors and the orientation.
    pub best: StrainTensor,
    /// Covariance of `(θ, α, mean, shear)` with calibration and lattice constants as well.
    pub known: Matrix5<f64>,
    /// Two equal layers: the solution for the other sense of the twist, as good as `best`, which has θ > 0; `None`
    /// where the sense is known.
    pub opposite: Option<SenseReading>,
    /// Other solutions of the same orientation with a mean strain below 1 %.
    pub alternatives: Vec<SenseReading>,
    /// ν of the strained layer.
    pub poisson_ratio: f64,
    /// The mean strain, if the orientation were that of the other kind of vector, 30° off; `None` for
    /// layers that are not hexagonal.
    pub other_vector: Option<f64>,
    /// By how many σ the orientation of the other layer is off at least, where that is a contradiction.
    pub disagreement: Option<f64>,
    /// Whether the sense of the twist that was given goes with no solution.
    pub sense_contradicted: bool,
}

/// Another solution: that for the other sense of the twist, or for another direction that is equal by symmetry.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct SenseReading {
    /// Its covariance holds noise, drift, sensors and the orientation.
    pub found: StrainTensor,
    /// As `known` of [`TensorReading`].
    pub known: Matrix5<f64>,
}

impl SenseReading {
    /// The solution with everything in the budget for its covariance.
    pub fn in_all(&self) -> StrainTensor {
        StrainTensor {
            covariance: self.known,
            ..self.found
        }
    }
}

/// The orientation that a tensor is made from.
pub(crate) fn known_orientation(settings: &Settings) -> Option<KnownOrientation> {
    settings.lattice_angle.or(settings.lattice_angle_2)
}

impl TensorReading {
    /// `None` without an orientation, and where it goes with no solution.
    pub(crate) fn new(lattice: &Lattice, budget: &Budget, settings: &Settings) -> Option<Self> {
        let bilayer = settings.bilayer();
        let orientation = Orientation::of(&known_orientation(settings)?, bilayer);
        let all = strain_tensors(lattice, bilayer, &orientation).ok()?;
        let (all, disagreement) = with_other_layer(all, &orientation, settings);
        let sense = settings.twist_sense;
        let of_sense = |t: &&StrainTensor| sense.is_none_or(|sense| sense.has(t.twist));
        let mut left: Vec<StrainTensor> = all.iter().filter(of_sense).copied().collect();
        let sense_contradicted = left.is_empty();
        if sense_contradicted {
            left = all;
        }
        let opposite = left
            .iter()
            .position(|t| bilayer.is_equal() && left[0].twist > 0.0 && t.twist < 0.0)
            .map(|at| left.remove(at));
        let mut left = left.into_iter();
        let best = left.next()?;
        let known = |of: &StrainTensor| known(of, lattice, &orientation, budget, settings);
        let other = |found: StrainTensor| {
            let known = known(&found)?;
            Some(SenseReading { found, known })
        };
        Some(Self {
            best,
            known: known(&best)?,
            opposite: match opposite {
                Some(found) => Some(other(found)?),
                None => None,
            },
            alternatives: left.filter_map(other).collect(),
            other_vector: other_vector(lattice, bilayer, &orientation),
            poisson_ratio: bilayer.stretched.poisson_ratio,
            disagreement,
            sense_contradicted,
        })
    }

    /// The best solution with everything in the budget for its covariance.
    pub fn in_all(&self) -> StrainTensor {
        StrainTensor {
            covariance: self.known,
            ..self.best
        }
    }

    /// Where the sense of the twist is open: the magnitudes of θ that the two solutions span, with 1.96 σ of all in the
    /// budget on either side, rad.
    pub fn magnitudes(&self) -> Option<[f64; 2]> {
        let both = [self.in_all(), self.opposite.as_ref()?.in_all()];
        let ends = both.map(|t| {
            let reach = 1.96 * t.twist().sigma;
            [(t.twist.abs() - reach).max(0.0), t.twist.abs() + reach]
        });
        Some([ends[0][0].min(ends[1][0]), ends[0][1].max(ends[1][1])])
    }
}

/// The solutions that go with the orientation of the other layer, if that is known too: those whose χ² is within 9 of the
/// least one. Beside them how many σ the best is off, where that is a contradiction.
fn with_other_layer(
    all: Vec<StrainTensor>,
    first: &Orientation,
    settings: &Settings,
) -> (Vec<StrainTensor>, Option<f64>) {
    let Some(other) = settings
        .lattice_angle
        .and(settings.lattice_angle_2)
        .map(|known| Orientation::of(&known, settings.bilayer()))
        .filter(|other| other.of_reference != first.of_reference)
    else {
        return (all, None);
    };
    let bilayer = settings.bilayer();
    let period = if other.of_reference {
        bilayer.reference.rotation_period()
    } else {
        bilayer.stretched.rotation_period()
    };
    let sigmas = |t: &StrainTensor| {
        let c = &t.covariance;
        let (angle, variance) = if other.of_reference {
            (t.lattice_angle, c[(1, 1)])
        } else {
            let both = c[(0, 0)] + c[(1, 1)] + 2.0 * c[(0, 1)];
            (t.lattice_angle + t.twist, both)
        };
        let apart = angle - other.angle;
        let apart = apart - period * (apart / period).round();
        apart.abs() / (variance + other.sigma.powi(2) + ROUNDING.powi(2)).sqrt()
    };
    let least = all.iter().map(sigmas).fold(f64::INFINITY, f64::min);
    let left = |t: &StrainTensor| sigmas(t).powi(2) - least.powi(2) <= CLEARLY.powi(2);
    let disagreement = (least > CLEARLY).then_some(least);
    (all.into_iter().filter(left).collect(), disagreement)
}

/// The covariance of a solution with calibration and lattice constants as well.
fn known(
    best: &StrainTensor,
    lattice: &Lattice,
    orientation: &Orientation,
    budget: &Budget,
    settings: &Settings,
) -> Option<Matrix5<f64>> {
    let bilayer = settings.bilayer();
    // The same solution for other errors: its orientation is known exactly there.
    let exact = Orientation {
        sigma: 0.0,
        ..*orientation
    };
    let near = |lattice: &Lattice, bilayer: Bilayer<'_>| {
        let all = strain_tensors(lattice, bilayer, &exact).ok()?;
        let distance = |t: &StrainTensor| (t.twist - best.twist).abs();
        all.into_iter()
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))
    };
    let mut known = best.covariance;
    for error in budget.calibration_errors(lattice, settings) {
        let with = Lattice::new(lattice.basis, error);
        known += near(&with, bilayer)?.covariance;
    }
    for changed in constants(bilayer) {
        let bilayer = Bilayer {
            reference: &changed[0],
            stretched: &changed[1],
            waves: bilayer.waves,
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
    Some(known)
}

/// The mean strain for an orientation 30° off.
fn other_vector(lattice: &Lattice, bilayer: Bilayer<'_>, orientation: &Orientation) -> Option<f64> {
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
pub(crate) fn constants(bilayer: Bilayer<'_>) -> Vec<[Material; 2]> {
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

/// Standard deviations that deserve a word: one of 400 by chance.
pub(crate) const CLEARLY: f64 = 3.0;
