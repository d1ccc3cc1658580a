//! The document as a whole and its sets.

use heterostrain::Estimate;
use heterostrain::material::Bilayer;
use heterostrain::strain::TwistStrain;
use moiregauge::campaign::{
    Analysis, Combined, Consistency, Drift, DriftFit, Ruled, SetAnalysis, SetMean,
};
use moiregauge::drift::DriftMonteCarlo;
use moiregauge::frame::Axis;
use moiregauge::settings::Settings;
use nalgebra::{Matrix2, Vector2};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::budget::BudgetResult;
use super::caveat::ResultCaveat;
use super::checks::ChecksResult;
use super::conventions::Conventions;
use super::convert::{PER_MINUTE, PERCENT, correlation, degree, estimate, estimate_in_all, number};
use super::estimate::ResultEstimate;
use super::lattice::{LatticeVector, TwistStrainResult};
use super::provenance::Provenance;
use super::readings::{AtomicResult, ReadingsResult};
use super::scan::ScanResult;
use super::set_lattice::{AssumedDriftResult, SetLatticeResult};
use crate::input::{FailedInput, InputFile};
use crate::stats::mean_and_deviation;

/// Name and version of the document.
pub const SCHEMA: &str = "moiregauge/results/1";

/// Everything that was found, in degrees, per cent, nm and nm/min.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Results {
    /// `moiregauge/results/1`.
    #[schemars(extend("const" = "moiregauge/results/1"))]
    pub schema: String,
    /// The sets, in order of time.
    pub sets: Vec<SetResult>,
    /// All sets together; `null` where the drift of several sets is known of none.
    pub combined: Option<CombinedResult>,
    /// The orientation of a layer by atomically resolved images; `null` without any.
    pub atomic: Option<AtomicResult>,
    /// Doubts.
    pub caveats: Vec<ResultCaveat>,
    /// Inputs that could not be used.
    pub failed: Vec<FailedInput>,
    /// What the numbers mean.
    pub conventions: Conventions,
    /// The settings as they were used.
    pub settings: Settings,
    /// Program, seed and inputs.
    pub provenance: InputProvenance,
}

/// Program, seed and inputs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct InputProvenance {
    /// `moiregauge`.
    pub program: String,
    /// Its version.
    pub version: String,
    /// Seed of all random numbers.
    pub seed: u64,
    /// The files that were analysed.
    pub inputs: Vec<InputFile>,
    /// What was asked, for a repetition.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub run: Option<super::run::Run>,
}

/// Scans of one slow axis, line rate, size and channel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SetResult {
    /// Name for people, unique in the document.
    pub name: String,
    /// `x` or `y`: the axis along which lines follow each other.
    pub slow_axis: String,
    /// Lines per second (trace and retrace together).
    pub line_rate_hz: Option<f64>,
    /// The analysed channel.
    pub channel: String,
    /// The drift; `null` where the scans cannot determine it: then one is assumed, see `drift_assumed` of `mean`.
    pub drift: Option<DriftResult>,
    /// All scans together, corrected for drift, or with an assumed drift in the errors.
    pub mean: Option<MeanResult>,
    /// The plain mean over the scans, not corrected for drift.
    pub uncorrected: Option<MeanResult>,
    /// The lattice of all scans together, where no twist and strain explain it; `null` where they do, and where it may be another one.
    pub lattice: Option<SetLatticeResult>,
    /// By the atoms of a layer that the scans show beside the moiré; left out where they do not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ruler: Option<RulerResult>,
    /// `mean` by the scanner alone, where that is by the atoms of a layer and the scanner alone gives one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub by_scanner: Option<MeanResult>,
    /// From the mean reciprocal lattice of up and down scans: free of constant drift without
    /// knowing it. A check of `mean`.
    pub forward_backward: Option<TwistStrainResult>,
    /// Errors from the scatter of the scans; `null` without a joint fit.
    pub checks: Option<ChecksResult>,
    /// The scans in order of time.
    pub scans: Vec<ScanResult>,
}

/// A set measured by the atoms of one of its layers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RulerResult {
    /// Layer 1, the reference, or layer 2.
    pub layer: u8,
    /// Traces and retraces that show its atoms.
    pub lines: usize,
    /// Whether `mean` of the set is by the atoms.
    pub used: bool,
    /// Twist and strain of layer 2 against layer 1, free of drift and of the calibration of the scanner.
    pub mean: MeanResult,
    /// What the scanner shows over what it is, along the fast axis.
    pub fast_gain: ResultEstimate,
    /// Drift to the right and up that goes with it, if both axes have this gain and stand at a right angle, nm/min; `null` without timing.
    pub drift_nm_per_min: Option<[ResultEstimate; 2]>,
    /// The scanner at the drift of the set, which is given, measured or assumed; `null` without timing.
    pub calibration: Option<RulerCalibration>,
}

/// The scanner by the atoms of a layer: lengths in the image are `F` times the true ones.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RulerCalibration {
    /// By how much lengths are too long, mean of x and y, per cent.
    pub gain_percent: ResultEstimate,
    /// By how much lengths along x are too long compared with y, per cent.
    pub mismatch_percent: ResultEstimate,
    /// A right angle minus the angle between the axes in the image, mrad.
    pub orthogonality_mrad: ResultEstimate,
}

/// Velocity of the sample in the frame of the sensors.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DriftResult {
    /// To the right.
    pub x_nm_per_min: ResultEstimate,
    /// Up.
    pub y_nm_per_min: ResultEstimate,
    /// Correlation coefficient of the two.
    pub correlation: Option<f64>,
    /// Whether the user gave it.
    pub given: bool,
    /// Quality of the fit; `null` for a given drift.
    pub fit: Option<DriftFitResult>,
    /// The Monte Carlo distribution.
    pub monte_carlo: Option<DriftMonteCarloResult>,
    /// What a joint fit found; `null` for the other methods.
    pub joint: Option<super::joint::JointResult>,
}

/// How well the scans determine the drift.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DriftFitResult {
    /// Rank of the six-parameter problem; 6 is full.
    pub rank: usize,
    /// Condition number.
    pub condition: Option<f64>,
    /// Weighted sum of squared residuals.
    pub chi2: Option<f64>,
    /// Degrees of freedom.
    pub degrees_of_freedom: usize,
    /// The published estimate (approximate matrices, successive scans compared), x and y, for comparison.
    pub paper_nm_per_min: Option<[Option<f64>; 2]>,
}

/// Distribution of the drift over Monte Carlo draws.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DriftMonteCarloResult {
    /// Number of draws.
    pub draws: usize,
    /// Mean and standard deviation.
    pub x_nm_per_min: ResultEstimate,
    /// Mean and standard deviation.
    pub y_nm_per_min: ResultEstimate,
    /// Correlation coefficient of the two.
    pub correlation: Option<f64>,
    /// Mean and standard deviation of the root-mean-square residual, nm.
    pub residual_nm: ResultEstimate,
}

/// One lattice for several scans.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MeanResult {
    /// Its twist and strain.
    #[serde(flatten)]
    pub twist_strain: TwistStrainResult,
    /// What contributes to their uncertainty, calibration and model included.
    pub budget: BudgetResult,
    /// What was assumed of a drift that the scans do not tell; `null` where it was measured or given.
    pub drift_assumed: Option<AssumedDriftResult>,
    /// What else the lattice can mean.
    pub readings: ReadingsResult,
    /// L1, L2 and L3.
    pub vectors: [LatticeVector; 3],
    /// Standard deviation of the twist over the scans, degrees.
    pub twist_scatter_deg: Option<f64>,
    /// Root-mean-square deviation per component of the strain vector over the scans, per cent.
    pub strain_scatter_percent: Option<f64>,
    /// χ² per degree of freedom of the scans against this lattice. Where it is significantly above 1
    /// (p < 0.05), every σ of this object is enlarged by its square root.
    pub chi2_per_dof: Option<f64>,
    /// σ of the twist before it was enlarged by √(χ²/dof), degrees.
    pub twist_sigma_unscaled_deg: Option<f64>,
    /// σ of the heterostrain before it was enlarged by √(χ²/dof), per cent.
    pub heterostrain_sigma_unscaled_percent: Option<f64>,
    /// Whether the wavelengths of every scan lie within ±1 % of these.
    pub within_one_percent: bool,
}

/// All sets together.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CombinedResult {
    /// Twist and strain of the weighted mean lattice.
    #[serde(flatten)]
    pub twist_strain: TwistStrainResult,
    /// What contributes to their uncertainty, calibration and model included.
    pub budget: BudgetResult,
    /// What else the lattice can mean.
    pub readings: ReadingsResult,
    /// L1, L2 and L3.
    pub vectors: [LatticeVector; 3],
    /// The joint fit over all scans that made them; `null` for the other methods.
    pub joint: Option<super::joint::JointResult>,
    /// The drift in the middle of the campaign, where one joint fit over all scans describes it.
    pub drift: Option<DriftResult>,
    /// Errors from the scatter of the scans; `null` without a joint fit.
    pub checks: Option<ChecksResult>,
    /// How far every two sets are apart.
    pub consistency: Vec<ConsistencyResult>,
}

/// How many standard deviations lie between two sets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ConsistencyResult {
    /// Names of the two sets.
    pub sets: [String; 2],
    /// Between the drift velocities: square root of χ² for two components.
    pub drift_sigmas: Option<f64>,
    /// Between the twists.
    pub twist_sigmas: Option<f64>,
    /// Between the strain vectors: square root of χ² for two components.
    pub strain_sigmas: Option<f64>,
}

impl Results {
    /// The document for an analysis.
    pub fn new(analysis: &Analysis, provenance: &Provenance) -> Self {
        let settings = &analysis.settings;
        Self {
            schema: SCHEMA.to_owned(),
            sets: analysis
                .sets
                .iter()
                .map(|set| set_result(set, settings))
                .collect(),
            combined: analysis.combined.as_ref().map(|c| combined(c, settings)),
            atomic: analysis.atomic.as_ref().map(Into::into),
            caveats: analysis.caveats.iter().map(Into::into).collect(),
            failed: provenance.failed.clone(),
            conventions: Conventions::of(&analysis.settings),
            settings: analysis.settings.clone(),
            provenance: InputProvenance {
                program: "moiregauge".to_owned(),
                version: provenance.version.clone(),
                seed: provenance.seed,
                inputs: provenance.inputs.clone(),
                run: provenance.run.clone(),
            },
        }
    }

    /// The document as text, indented, with a newline at the end.
    ///
    /// # Errors
    /// None in practice: every part can be written as JSON.
    pub fn to_json(&self) -> Result<Vec<u8>, serde_json::Error> {
        let mut bytes = serde_json::to_vec_pretty(self)?;
        bytes.push(b'\n');
        Ok(bytes)
    }
}

fn set_result(set: &SetAnalysis, settings: &Settings) -> SetResult {
    let bilayer = settings.bilayer();
    let axis = match set.slow_axis {
        Axis::X => "x",
        Axis::Y => "y",
    };
    SetResult {
        name: set.name.clone(),
        slow_axis: axis.to_owned(),
        line_rate_hz: number(set.line_rate_hz),
        channel: set.channel.clone(),
        drift: set.drift.as_ref().map(|d| drift(d, settings)),
        mean: set.mean.as_ref().map(|m| mean(m, bilayer)),
        uncorrected: set.uncorrected.as_ref().map(|m| mean(m, bilayer)),
        lattice: set
            .lattice
            .as_ref()
            .map(|l| SetLatticeResult::of(l, bilayer)),
        ruler: set.ruler.as_ref().map(|r| ruler(r, bilayer)),
        by_scanner: set.by_scanner.as_ref().map(|m| mean(m, bilayer)),
        forward_backward: set.forward_backward.as_ref().map(Into::into),
        checks: set.checks.as_ref().map(Into::into),
        scans: set
            .scans
            .iter()
            .map(|s| ScanResult::of(s, set.slow_axis, bilayer))
            .collect(),
    }
}

fn ruler(ruled: &Ruled, bilayer: Bilayer<'_>) -> RulerResult {
    RulerResult {
        layer: ruled.layer,
        lines: ruled.rulers.len(),
        used: ruled.used,
        mean: mean(&ruled.mean, bilayer),
        fast_gain: estimate(ruled.fast_gain, 1.0),
        drift_nm_per_min: ruled
            .drift
            .map(|v| v.map(|part| estimate(part, PER_MINUTE))),
        calibration: ruled.calibration.map(|found| {
            let [gain_percent, mismatch_percent, orthogonality_mrad] =
                found.map(|part| estimate(part, 1.0));
            RulerCalibration {
                gain_percent,
                mismatch_percent,
                orthogonality_mrad,
            }
        }),
    }
}

/// Both components of a velocity (nm/s) with σ, nm/min.
fn velocity(value: Vector2<f64>, covariance: &Matrix2<f64>) -> [ResultEstimate; 2] {
    [0, 1].map(|i| {
        estimate(
            Estimate::from_variance(value[i], covariance[(i, i)]),
            PER_MINUTE,
        )
    })
}

fn drift(drift: &Drift, settings: &Settings) -> DriftResult {
    let [x_nm_per_min, y_nm_per_min] = drift
        .velocities(settings)
        .map(|part| estimate_in_all(part, PER_MINUTE));
    DriftResult {
        x_nm_per_min,
        y_nm_per_min,
        correlation: correlation(&drift.covariance),
        given: drift.given,
        fit: drift.fit.as_ref().map(drift_fit),
        monte_carlo: drift.monte_carlo.as_ref().map(drift_monte_carlo),
        joint: drift.joint.as_ref().map(Into::into),
    }
}

fn drift_fit(fit: &DriftFit) -> DriftFitResult {
    DriftFitResult {
        rank: fit.rank,
        condition: number(fit.condition),
        chi2: number(fit.chi2),
        degrees_of_freedom: fit.degrees_of_freedom,
        paper_nm_per_min: fit
            .paper_velocity
            .map(|v| super::convert::pair(v, PER_MINUTE)),
    }
}

fn drift_monte_carlo(draws: &DriftMonteCarlo) -> DriftMonteCarloResult {
    let [x_nm_per_min, y_nm_per_min] = velocity(draws.mean, &draws.covariance);
    let (mean, deviation) = mean_and_deviation(&draws.losses);
    DriftMonteCarloResult {
        draws: draws.draws.len(),
        x_nm_per_min,
        y_nm_per_min,
        correlation: correlation(&draws.covariance),
        residual_nm: estimate(Estimate::new(mean, deviation), 1.0),
    }
}

fn mean(mean: &SetMean, bilayer: Bilayer<'_>) -> MeanResult {
    let result = &mean.twist_strain;
    let unscaled = TwistStrain {
        covariance: result.covariance / mean.enlargement,
        ..*result
    };
    MeanResult {
        twist_strain: TwistStrainResult::of_mean(result, &mean.budget),
        budget: BudgetResult::of(&mean.budget, result),
        drift_assumed: mean.assumed.map(Into::into),
        readings: (&mean.readings).into(),
        vectors: LatticeVector::of_mean(&mean.lattice, &mean.budget, bilayer),
        twist_scatter_deg: number(mean.twist_scatter * degree()),
        strain_scatter_percent: number(mean.strain_scatter * PERCENT),
        chi2_per_dof: mean.chi2_per_dof.and_then(number),
        twist_sigma_unscaled_deg: number(unscaled.twist().sigma * degree()),
        heterostrain_sigma_unscaled_percent: number(unscaled.heterostrain().sigma * PERCENT),
        within_one_percent: mean.within_one_percent,
    }
}

fn combined(combined: &Combined, settings: &Settings) -> CombinedResult {
    let (budget, bilayer) = (&combined.budget, settings.bilayer());
    CombinedResult {
        twist_strain: TwistStrainResult::of_mean(&combined.twist_strain, budget),
        budget: BudgetResult::of(&combined.budget, &combined.twist_strain),
        readings: (&combined.readings).into(),
        vectors: LatticeVector::of_mean(&combined.lattice, budget, bilayer),
        joint: combined.joint.as_ref().map(Into::into),
        drift: combined.drift.as_ref().map(|d| drift(d, settings)),
        checks: combined.checks.as_ref().map(Into::into),
        consistency: combined.consistency.iter().map(consistency).collect(),
    }
}

fn consistency(pair: &Consistency) -> ConsistencyResult {
    ConsistencyResult {
        sets: pair.sets.clone(),
        drift_sigmas: pair.drift_sigmas.and_then(number),
        twist_sigmas: number(pair.twist_sigmas),
        strain_sigmas: number(pair.strain_sigmas),
    }
}
