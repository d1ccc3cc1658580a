//! The uncertainty budget as the document holds it: standard deviations, source by source.

use heterostrain::Estimate;
use heterostrain::strain::TwistStrain;
use moiregauge::meaning::{Budget, Contribution, Source};
use nalgebra::Matrix2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::convert::{PERCENT, degree, number, square};

/// Standard deviations of one quantity, source by source; `null` where a contribution is not known.
///
/// `image`, `drift` and `sensor` are the parts of the quantity's `sigma`, the statistical one; `total` is its
/// `sigma_total`. The sources are independent, so the squares add up.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct BudgetColumn {
    /// Noise of the images, drift and sensors known exactly.
    pub image: Option<f64>,
    /// Uncertainty of the drift, that of a prior where `drift_assumed` says so; `null` where the drift was not removed.
    pub drift: Option<f64>,
    /// Noise of the position sensors.
    pub sensor: Option<f64>,
    /// Gain error common to x and y.
    pub calibration_gain: Option<f64>,
    /// Difference of the gains of x and y.
    pub calibration_mismatch: Option<f64>,
    /// Axes that do not stand at a right angle.
    pub calibration_orthogonality: Option<f64>,
    /// Whether the nominal size spans N pixels or N − 1; left out where sensors or the format tell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pitch_convention: Option<f64>,
    /// Bends of the grid that no sensor told, where the area does not lie in the middle of the frame; left out where it does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grid_shape: Option<f64>,
    /// Lattice constant of the layers.
    pub lattice_constant: Option<f64>,
    /// Which layer is strained.
    pub strained_layer: Option<f64>,
    /// Isotropic heterostrain, which the moiré does not show.
    pub isotropic_strain: Option<f64>,
    /// Poisson ratio of the layers.
    pub poisson_ratio: Option<f64>,
    /// Strain of the layer whose atoms are the ruler; left out where the scanner is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ruler_strain: Option<f64>,
    /// All together; `null` where one is not known.
    pub total: Option<f64>,
}

/// Contributions to the uncertainty of a lattice and of all that follows from it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct BudgetResult {
    /// Of `twist_deg`.
    pub twist_deg: BudgetColumn,
    /// Of `heterostrain_percent`.
    pub heterostrain_percent: BudgetColumn,
    /// Of the first component of `strain_vector_percent`.
    pub strain_e1_percent: BudgetColumn,
    /// Of the second component.
    pub strain_e2_percent: BudgetColumn,
    /// Of `strain_axis_lab_deg`; `null` where that is.
    pub strain_axis_lab_deg: Option<BudgetColumn>,
    /// Of `lattice_angle_deg`.
    pub lattice_angle_deg: BudgetColumn,
    /// Whether nothing tells the drift, so that its row is that of a prior.
    pub drift_assumed: bool,
    /// Of the lengths of the three vectors.
    pub wavelengths_nm: [BudgetColumn; 3],
    /// Covariance of the strain vector from all sources that are known, per cent².
    pub strain_vector_covariance: [[Option<f64>; 2]; 2],
    /// Probability that these errors alone give such a strain vector.
    pub strain_p_value: Option<f64>,
    /// Upper limit of the magnitude of the strain from these errors, 95 % confidence, per cent.
    pub strain_upper_limit_95_percent: Option<f64>,
    /// The interval that holds the magnitude, with 95 % confidence, by these errors, per cent.
    pub strain_interval_95_percent: [Option<f64>; 2],
}

/// The name of a source in the document and the tables.
pub(crate) fn source_name(source: Source) -> &'static str {
    match source {
        Source::Image => "image",
        Source::Drift => "drift",
        Source::Sensor => "sensor",
        Source::Gain => "calibration_gain",
        Source::Mismatch => "calibration_mismatch",
        Source::Orthogonality => "calibration_orthogonality",
        Source::Pitch => "pitch_convention",
        Source::Shape => "grid_shape",
        Source::LatticeConstant => "lattice_constant",
        Source::StrainedLayer => "strained_layer",
        Source::IsotropicStrain => "isotropic_strain",
        Source::PoissonRatio => "poisson_ratio",
        Source::RulerStrain => "ruler_strain",
    }
}

impl BudgetColumn {
    /// Square roots of a variance of every source, times `factor`.
    fn of(budget: &Budget, factor: f64, variance: impl Fn(&Contribution) -> f64) -> Self {
        let sigma =
            |c: &Contribution| number(factor * Estimate::from_variance(0.0, variance(c)).sigma);
        let of = |source| sigma(&budget.of(source));
        Self {
            image: of(Source::Image),
            drift: of(Source::Drift),
            sensor: of(Source::Sensor),
            calibration_gain: of(Source::Gain),
            calibration_mismatch: of(Source::Mismatch),
            calibration_orthogonality: of(Source::Orthogonality),
            pitch_convention: of(Source::Pitch).filter(|_| budget.has(Source::Pitch)),
            grid_shape: of(Source::Shape).filter(|_| budget.has(Source::Shape)),
            lattice_constant: of(Source::LatticeConstant),
            strained_layer: of(Source::StrainedLayer),
            isotropic_strain: of(Source::IsotropicStrain),
            poisson_ratio: of(Source::PoissonRatio),
            ruler_strain: of(Source::RulerStrain).filter(|_| budget.has(Source::RulerStrain)),
            total: sigma(&budget.total()),
        }
    }

    /// The contribution of one source.
    pub(crate) fn get(&self, source: Source) -> Option<f64> {
        match source {
            Source::Image => self.image,
            Source::Drift => self.drift,
            Source::Sensor => self.sensor,
            Source::Gain => self.calibration_gain,
            Source::Mismatch => self.calibration_mismatch,
            Source::Orthogonality => self.calibration_orthogonality,
            Source::Pitch => self.pitch_convention,
            Source::Shape => self.grid_shape,
            Source::LatticeConstant => self.lattice_constant,
            Source::StrainedLayer => self.strained_layer,
            Source::IsotropicStrain => self.isotropic_strain,
            Source::PoissonRatio => self.poisson_ratio,
            Source::RulerStrain => self.ruler_strain,
        }
    }
}

impl BudgetResult {
    pub(crate) fn of(budget: &Budget, found: &TwistStrain) -> Self {
        let entry =
            |i: usize, factor: f64| BudgetColumn::of(budget, factor, move |c| c.covariance[(i, i)]);
        let all = budget.applied_to(found);
        let covariance: Matrix2<f64> = all.strain().covariance;
        Self {
            twist_deg: entry(0, degree()),
            heterostrain_percent: BudgetColumn::of(budget, PERCENT, |c| c.magnitude),
            strain_e1_percent: entry(2, PERCENT),
            strain_e2_percent: entry(3, PERCENT),
            strain_axis_lab_deg: found
                .axis_lab()
                .map(|_| BudgetColumn::of(budget, degree(), |c| c.axis_lab)),
            lattice_angle_deg: entry(1, degree()),
            drift_assumed: budget.drift_assumed,
            wavelengths_nm: [0, 1, 2].map(|i| BudgetColumn::of(budget, 1.0, |c| c.wavelengths[i])),
            strain_vector_covariance: square(&covariance, PERCENT * PERCENT),
            strain_p_value: number(all.strain().p_value()),
            strain_upper_limit_95_percent: number(all.strain().upper_limit_95() * PERCENT),
            strain_interval_95_percent: all.strain().interval_95().map(|end| number(end * PERCENT)),
        }
    }
}
