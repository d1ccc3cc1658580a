//! What else a lattice can mean, as the document holds it.

use heterostrain::strain::{Branch, Degeneracy, Split, StrainTensor};
use moiregauge::campaign::AtomicOrientation;
use moiregauge::caveat::ChosenBy;
use moiregauge::meaning::{NameReading, Naming, Readings, Standing, TensorReading};
use nalgebra::Matrix5;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::convert::{PER_MINUTE, PERCENT, degree, estimate, number, pair};
use super::estimate::ResultEstimate;
use heterostrain::Estimate;

/// Everything that a lattice can mean besides `twist_deg` and `heterostrain_percent`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ReadingsResult {
    /// Whether the layers differ. Then several pairs of twist and strain explain the moiré: every entry of `solutions`
    /// with `twist_deg` > 0 and the waves of the first fits equally well.
    pub layers_differ: bool,
    /// Every exact solution with uniaxial strain alone, under every name of the lattice: those of the reported name
    /// first, then the least strained names.
    pub solutions: Vec<SolutionResult>,
    /// `solutions` holds all solutions with at most this strain.
    #[serde(default)]
    pub solutions_complete_to_percent: f64,
    /// The names of the lattice, that is which of its waves belong to the atoms, and the choice among them; `null` for
    /// layers of dissimilar lattices.
    #[serde(default)]
    pub names: Option<NamesResult>,
    /// What an isotropic heterostrain does to the twist; `null` where no solution is exact.
    pub isotropic_strain: Option<IsotropicStrainResult>,
    /// Twist and the whole relative strain; `null` unless the orientation of a layer is known.
    pub strain_tensor: Option<StrainTensorResult>,
}

/// One exact solution: σ from image noise, drift and sensor noise.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SolutionResult {
    /// Twist of layer 2 against layer 1.
    pub twist_deg: ResultEstimate,
    /// Uniaxial strain with its sign.
    pub strain_percent: ResultEstimate,
    /// Axis of the strain in the laboratory, in [0, 180).
    pub strain_axis_lab_deg: Option<f64>,
    /// Orientation of layer 1.
    pub lattice_angle_deg: Option<f64>,
    /// Whether the moiré is read as made by strain and distorted by twist.
    pub strain_dominated: bool,
    /// Which waves of the lattice belong to the reciprocal vectors of the atoms at 0° and 120°: `[[h₁, k₁], [h₂, k₂]]` means
    /// `h₁ K₁ + k₁ K₂` and `h₂ K₁ + k₂ K₂`, with `K_i · L_j = 2π δ_ij` for the L₁ and L₂ that are reported.
    #[serde(default)]
    pub waves: [[i32; 2]; 2],
}

/// The names of a lattice and the choice among them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NamesResult {
    /// What chose the reported name: `image` (every other plausible name has a wave that is too weak), `orientation`
    /// (the others need isotropic strain), `user`, or `least-strain` (none of these).
    pub chosen_by: String,
    /// The reported name first.
    pub names: Vec<NameResult>,
}

/// One name of a lattice.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NameResult {
    /// As of the solutions.
    pub waves: [[i32; 2]; 2],
    /// The strain of its first solution with θ > 0.
    pub strain_percent: f64,
    /// The twist of this solution.
    pub twist_deg: f64,
    /// `reported`, `open` (as plausible as the reported one), `against-image`, `against-orientation` or `unlikely` (much
    /// strain).
    pub standing: String,
}

/// The twist–biaxial degeneracy in numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct IsotropicStrainResult {
    /// By how much isotropic strains of layer 2 (tension positive) change `twist_deg`.
    pub shifts: Vec<ShiftResult>,
    /// The standard deviation of the isotropic strain, from the settings.
    pub prior_percent: f64,
    /// Range of the twist that is possible with isotropic strains within 1.96 times the prior, either sign of the
    /// uniaxial strain, and 1.96 σ.
    pub twist_interval_deg: [Option<f64>; 2],
}

/// One isotropic strain.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ShiftResult {
    /// The strain of layer 2, the same in all directions.
    pub isotropic_strain_percent: f64,
    /// The change of the twist; `null` where no twist explains the moiré.
    pub twist_change_deg: Option<f64>,
}

/// Twist and the whole strain of layer 2 against layer 1, of atoms, tension positive.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StrainTensorResult {
    /// σ from image noise, drift, sensor noise and the orientation.
    #[serde(flatten)]
    pub found: TensorNumbers,
    /// σ of the same with calibration and lattice constants as well.
    pub total: TensorSigmas,
    /// The strain as uniaxial and isotropic part: tension along the axis, and compression across it.
    pub splits: [SplitResult; 2],
    /// Covariance of (twist, lattice angle, mean strain, shear₁, shear₂) in degrees and per cent.
    pub covariance: [[Option<f64>; 5]; 5],
    /// For two equal layers whose sense of twist is open: the solution for the other sense, which fits equally well;
    /// `null` otherwise.
    #[serde(default)]
    pub other_sense: Option<OtherSenseResult>,
    /// Other solutions of the same orientation with less than 1 % of mean strain.
    pub alternatives: Vec<TensorNumbers>,
}

/// The solution for θ < 0 where the sense of the twist is open.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct OtherSenseResult {
    /// As of the solution with θ > 0.
    #[serde(flatten)]
    pub found: TensorNumbers,
    /// σ of the same with calibration and lattice constants as well.
    pub total: TensorSigmas,
    /// Its uniaxial and isotropic part.
    pub splits: [SplitResult; 2],
    /// Covariance of (twist, lattice angle, mean strain, shear₁, shear₂) in degrees and per cent.
    pub covariance: [[Option<f64>; 5]; 5],
    /// Range of the magnitude of the twist from both solutions, with 1.96 σ of `total` on either side.
    pub twist_interval_deg: [Option<f64>; 2],
}

/// Twist and strain tensor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TensorNumbers {
    /// Twist of layer 2 against layer 1.
    pub twist_deg: ResultEstimate,
    /// Orientation of layer 1.
    pub lattice_angle_deg: ResultEstimate,
    /// ½(ε₁ + ε₂).
    pub mean_strain_percent: ResultEstimate,
    /// γ = ½(ε₁ − ε₂), the noise bias removed.
    pub shear_percent: ResultEstimate,
    /// γ (cos 2φ, sin 2φ), φ the axis of ε₁ in the laboratory.
    pub shear_vector_percent: [Option<f64>; 2],
    /// φ, in [0, 180); `null` unless γ is significant.
    pub axis_lab_deg: Option<ResultEstimate>,
}

/// Standard deviations.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TensorSigmas {
    /// Of the twist.
    pub twist_deg: Option<f64>,
    /// Of the mean strain.
    pub mean_strain_percent: Option<f64>,
    /// Of γ.
    pub shear_percent: Option<f64>,
    /// Of the axis; `null` where γ is not significant with these errors.
    pub axis_lab_deg: Option<f64>,
}

/// Uniaxial and isotropic part; σ as of `total`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SplitResult {
    /// Along the axis; −ν times this across.
    pub uniaxial_percent: ResultEstimate,
    /// The isotropic strain added to it.
    pub biaxial_percent: ResultEstimate,
    /// Axis of the uniaxial part in the laboratory.
    pub axis_lab_deg: Option<ResultEstimate>,
}

/// The orientation of a layer by atomically resolved images.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AtomicResult {
    /// The images.
    pub files: Vec<String>,
    /// 1, the reference, or 2.
    pub layer: u8,
    /// Of the layer's reciprocal vectors, modulo its symmetry.
    pub lattice_angle_deg: ResultEstimate,
    /// Lattice constant found over that of the material.
    pub size: Option<f64>,
    /// How far the lattice is from the shape of the material's, relative.
    pub distortion: Option<f64>,
    /// Drift in these images, x and y; `null` where it cannot be determined.
    pub drift_nm_per_min: Option<[Option<f64>; 2]>,
}

impl From<&Readings> for ReadingsResult {
    fn from(readings: &Readings) -> Self {
        Self {
            layers_differ: readings.layers_differ,
            solutions: readings.solutions.iter().map(Into::into).collect(),
            solutions_complete_to_percent: readings.complete_to * PERCENT,
            names: readings.naming.as_ref().map(Into::into),
            isotropic_strain: readings.degeneracy.as_ref().map(Into::into),
            strain_tensor: readings.tensor.as_ref().map(Into::into),
        }
    }
}

impl From<&Branch> for SolutionResult {
    fn from(branch: &Branch) -> Self {
        Self {
            twist_deg: estimate(Estimate::new(branch.twist, branch.twist_sigma), degree()),
            strain_percent: estimate(Estimate::new(branch.strain, branch.strain_sigma), PERCENT),
            strain_axis_lab_deg: number(branch.axis_lab * degree()),
            lattice_angle_deg: number(branch.lattice_angle * degree()),
            strain_dominated: branch.strain_dominated,
            waves: branch.name.0,
        }
    }
}

impl From<&Naming> for NamesResult {
    fn from(naming: &Naming) -> Self {
        let chosen_by = match naming.chosen_by {
            ChosenBy::LeastStrain => "least-strain",
            ChosenBy::Image => "image",
            ChosenBy::Orientation => "orientation",
            ChosenBy::User => "user",
        };
        let name = |n: &NameReading| NameResult {
            waves: n.name.0,
            strain_percent: n.strain * PERCENT,
            twist_deg: n.twist * degree(),
            standing: match n.standing {
                Standing::Reported => "reported",
                Standing::Open => "open",
                Standing::AgainstImage => "against-image",
                Standing::AgainstOrientation => "against-orientation",
                Standing::Unlikely => "unlikely",
            }
            .to_owned(),
        };
        Self {
            chosen_by: chosen_by.to_owned(),
            names: naming.names.iter().map(name).collect(),
        }
    }
}

impl From<&Degeneracy> for IsotropicStrainResult {
    fn from(found: &Degeneracy) -> Self {
        Self {
            shifts: found
                .shifts
                .iter()
                .map(|(strain, change)| ShiftResult {
                    isotropic_strain_percent: strain * PERCENT,
                    twist_change_deg: change.and_then(|c| number(c * degree())),
                })
                .collect(),
            prior_percent: found.prior * PERCENT,
            twist_interval_deg: found.interval.map(|end| number(end * degree())),
        }
    }
}

impl From<&TensorReading> for StrainTensorResult {
    fn from(reading: &TensorReading) -> Self {
        let all = reading.in_all();
        let interval = reading.magnitudes().unwrap_or([f64::NAN; 2]);
        Self {
            found: tensor_numbers(&reading.best, &all),
            total: (&all).into(),
            splits: all.splits(reading.poisson_ratio).each_ref().map(Into::into),
            covariance: in_surface_units(&reading.best.covariance),
            other_sense: reading.opposite.as_ref().map(|opposite| {
                let all = opposite.in_all();
                OtherSenseResult {
                    found: tensor_numbers(&opposite.found, &all),
                    total: (&all).into(),
                    splits: all.splits(reading.poisson_ratio).each_ref().map(Into::into),
                    covariance: in_surface_units(&opposite.found.covariance),
                    twist_interval_deg: interval.map(|end| number(end * degree())),
                }
            }),
            alternatives: (reading.alternatives.iter())
                .map(|other| tensor_numbers(&other.found, &other.in_all()))
                .collect(),
        }
    }
}

impl From<&StrainTensor> for TensorSigmas {
    fn from(all: &StrainTensor) -> Self {
        let sigma = |e: Estimate, factor: f64| number(e.scaled(factor).sigma);
        Self {
            twist_deg: sigma(all.twist(), degree()),
            mean_strain_percent: sigma(all.mean(), PERCENT),
            shear_percent: sigma(all.shear(), PERCENT),
            axis_lab_deg: all.axis_lab().and_then(|a| sigma(a, degree())),
        }
    }
}

fn in_surface_units(covariance: &Matrix5<f64>) -> [[Option<f64>; 5]; 5] {
    let unit = [degree(), degree(), PERCENT, PERCENT, PERCENT];
    [0, 1, 2, 3, 4].map(|i| [0, 1, 2, 3, 4].map(|j| number(covariance[(i, j)] * unit[i] * unit[j])))
}

impl From<&StrainTensor> for TensorNumbers {
    fn from(found: &StrainTensor) -> Self {
        Self {
            twist_deg: estimate(found.twist(), degree()),
            lattice_angle_deg: estimate(found.lattice_angle(), degree()),
            mean_strain_percent: estimate(found.mean(), PERCENT),
            shear_percent: estimate(found.shear(), PERCENT),
            shear_vector_percent: pair(found.shear, PERCENT),
            axis_lab_deg: found.axis_lab().map(|a| estimate(a, degree())),
        }
    }
}

/// A tensor with the errors of `all` as totals.
fn tensor_numbers(best: &StrainTensor, all: &StrainTensor) -> TensorNumbers {
    let found = TensorNumbers::from(best);
    let with = |part: ResultEstimate, total: Estimate, factor: f64| ResultEstimate {
        sigma_total: number(total.scaled(factor).sigma),
        ..part
    };
    TensorNumbers {
        twist_deg: with(found.twist_deg, all.twist(), degree()),
        lattice_angle_deg: with(found.lattice_angle_deg, all.lattice_angle(), degree()),
        mean_strain_percent: with(found.mean_strain_percent, all.mean(), PERCENT),
        shear_percent: with(found.shear_percent, all.shear(), PERCENT),
        axis_lab_deg: found.axis_lab_deg.map(|axis| match all.axis_lab() {
            Some(total) => with(axis, total, degree()),
            None => axis,
        }),
        ..found
    }
}

impl From<&Split> for SplitResult {
    fn from(split: &Split) -> Self {
        Self {
            uniaxial_percent: estimate(split.uniaxial, PERCENT),
            biaxial_percent: estimate(split.biaxial, PERCENT),
            axis_lab_deg: split.axis_lab.map(|a| estimate(a, degree())),
        }
    }
}

impl From<&AtomicOrientation> for AtomicResult {
    fn from(found: &AtomicOrientation) -> Self {
        Self {
            files: found.files.clone(),
            layer: found.layer,
            lattice_angle_deg: estimate(found.angle, degree()),
            size: number(found.size),
            distortion: number(found.distortion),
            drift_nm_per_min: found.drift.map(|d| pair(d, PER_MINUTE)),
        }
    }
}
