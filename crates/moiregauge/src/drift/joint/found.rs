//! What a fit over all scans found.

use std::sync::Arc;

use heterostrain::Estimate;
use heterostrain::lattice::Waves;
use nalgebra::{DMatrix, DVector, Matrix2, Vector2};

use crate::drift::joint::arrow::Arrow;
use crate::drift::joint::evaluate::Layout;
use crate::drift::joint::path::DriftPath;
use crate::drift::joint::sighting::{Detection, Terms};

/// Errors of the lattice that grow by more than this say that a term is not determined. Half and twice as much change
/// no result of docs/constants.md.
const LOOSE: f64 = 3.0;

/// The result of the fit over all scans.
#[derive(Clone, Debug)]
pub struct JointFit {
    /// Reciprocal pair free of drift, rad/nm.
    pub waves: Waves,
    /// Drift velocity in the middle of the campaign, nm/s, and its covariance.
    pub velocity: Vector2<f64>,
    /// Covariance of `velocity`, (nm/s)².
    pub velocity_covariance: Matrix2<f64>,
    /// Acceleration, nm/s², where it earned its place.
    pub acceleration: Option<Vector2<f64>>,
    /// Relative gain error of the fast axis with its uncertainty, where it earned its place.
    pub fast_gain: Option<Estimate>,
    /// The terms that the fit has.
    pub terms: Terms,
    /// Standard deviation of positions about the fit beyond the phase noise, nm.
    pub instability_nm: f64,
    /// Weighted sum of squared residuals and its degrees of freedom.
    pub chi2: f64,
    /// Degrees of freedom of `chi2`.
    pub degrees_of_freedom: usize,
    /// What the instability adds to the logarithm of the determinant of the covariance of what was measured.
    pub(crate) widening: f64,
    /// The terms that were tried beside a constant drift, and what the criterion said.
    pub tested: Vec<TestedTerm>,
    /// What was fitted, with the blocks of linked scans.
    pub(crate) sightings: Arc<[Detection]>,
    pub(crate) layout: Layout,
    pub(crate) solution: DVector<f64>,
    /// Covariance of `solution`, as the errors of the sightings make it.
    pub(crate) unscaled: Arrow,
    /// That of the parameters that all scans share, enlarged where the scans scatter more.
    pub(crate) covariance: DMatrix<f64>,
}

/// A term that was tried.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct TestedTerm {
    /// What it is called.
    pub name: &'static str,
    /// By how much it lowers the Bayesian information criterion; it is used if this is positive (and,
    /// of two that describe a changing drift, the larger).
    pub gain: f64,
    /// Whether the fit has it.
    pub used: bool,
}

impl JointFit {
    /// What was fitted, with the blocks of linked scans.
    pub(crate) fn sightings(&self) -> &[Detection] {
        &self.sightings
    }

    /// Whether it knows the lattice much worse than a simpler one, without or with the scatter about it. Without: its terms
    /// cannot be told from the lattice (two scans do not tell a drift that changes), so that no χ² speaks for them. With:
    /// they contradict what the simpler one describes (jumps between frames that pass for an acceleration).
    pub(crate) fn loosens(&self, simpler: &Self) -> bool {
        let worse = |this: &DMatrix<f64>, other: &DMatrix<f64>| {
            (0..4).any(|i| this[(i, i)] > LOOSE * LOOSE * other[(i, i)])
        };
        worse(&self.unscaled.shared, &simpler.unscaled.shared)
            || worse(&self.covariance, &simpler.covariance)
    }

    /// Bayesian information criterion, up to a constant that fits of the same data with phases have in common: −2 ln L
    /// and ln n for each parameter. A settling time is a parameter as well, and so is the scatter of positions, which
    /// lowers χ² at the cost of wider distributions: a drift that changes must not pass for scatter.
    pub(crate) fn criterion(&self) -> f64 {
        let n = (self.degrees_of_freedom + self.layout.size()) as f64;
        let settling = usize::from(self.terms.settling.is_some());
        let scatter = usize::from(self.instability_nm > 0.0);
        let parameters = self.layout.count() + settling + scatter;
        self.chi2 + self.widening + parameters as f64 * n.ln()
    }

    /// Drift velocity at a time (same origin as the sightings), nm/s, with its covariance.
    pub fn velocity_at(&self, time: f64) -> (Vector2<f64>, Matrix2<f64>) {
        motion(&self.layout, &self.solution, &self.covariance, time)
    }

    /// The way of the sample (times of the same origin as the sightings).
    pub fn path(&self) -> DriftPath {
        self.layout.path(&self.solution)
    }
}

/// Drift velocity at a time and its covariance.
pub(crate) fn motion(
    layout: &Layout,
    x: &DVector<f64>,
    covariance: &DMatrix<f64>,
    time: f64,
) -> (Vector2<f64>, Matrix2<f64>) {
    let (_, velocity) = layout.motion(x, time);
    let mut of_velocity = Matrix2::zeros();
    for (i, _, a) in layout.drift_weights(time) {
        for (j, _, b) in layout.drift_weights(time) {
            of_velocity += a * b * covariance.fixed_view::<2, 2>(i, j);
        }
    }
    (velocity, of_velocity)
}
