//! Twist and strain of a set: of the mean lattice, and how the scans scatter about it.

use heterostrain::lattice::{Lattice, Waves};
use heterostrain::strain::TwistStrain;
use nalgebra::{Matrix2, Matrix4, Vector2};
use spmfile::FrameDirection;

use crate::campaign::analysis::ScanAnalysis;
use crate::campaign::means::SetMean;
use crate::campaign::set::moire::moire;
use crate::campaign::set::scan::plain_mean;
use crate::campaign::set::solved::Solved;
use crate::drift::linear::{Observation, at_known_drift, common_lattice};
use crate::drift::shares::Statistical;
use crate::frame::grid_errors::GridErrors;
use crate::meaning::budget::Budget;
use crate::meaning::readings::Readings;
use crate::meaning::strengths::WaveStrengths;
use crate::numbers::chi2::enlargement;
use crate::numbers::spread::mean_and_spread;
use crate::settings::knobs::Settings;

/// Scans are compared with their set to this share. A twist of which the images leave more open has a warning. It is the gain error that an
/// uncalibrated scanner is assumed to have.
pub(crate) const ONE_PERCENT: f64 = 0.01;

/// The scans that are not left out.
pub(crate) fn counted(scans: &[ScanAnalysis]) -> impl Iterator<Item = &ScanAnalysis> {
    scans.iter().filter(|s| s.excluded.is_none())
}

/// The mean of the scans, their drift taken off; `shared` is the covariance that they have in common.
pub(crate) fn at_drift(
    solved: &Solved,
    scans: &[ScanAnalysis],
    shared: &Matrix4<f64>,
    grid: &GridErrors,
    settings: &Settings,
    strengths: &WaveStrengths,
) -> Option<SetMean> {
    let assumed = solved.assumed.is_some();
    let of = |s: &ScanAnalysis| {
        if assumed {
            return (s.twist_strain_sensor, s.sensor);
        }
        (s.twist_strain, s.drift_corrected.unwrap_or(s.sensor))
    };
    let lattice = &solved.lattice;
    let statistical = Statistical {
        image: solved.statistical.image + shared,
        ..solved.statistical
    };
    let mut mean = set_mean(
        &Lattice::new(lattice.basis, lattice.covariance + shared),
        &statistical,
        grid,
        Agreement::new(solved.chi2, solved.freedom, solved.enlargement),
        counted(scans).map(of),
        settings,
        strengths,
    )?;
    mean.assumed = solved.assumed;
    mean.budget.drift_assumed = assumed;
    Some(mean)
}

/// The mean of the scans as if nothing drifted, with the errors that drift adds left out; `alone`: there is one scan.
pub(crate) fn without_drift(
    all: &[Observation],
    scans: &[ScanAnalysis],
    alone: bool,
    shared: &Matrix4<f64>,
    grid: &GridErrors,
    settings: &Settings,
    strengths: &WaveStrengths,
) -> Option<SetMean> {
    let (lattice, chi2, freedom) =
        common_lattice(all, &Vector2::zeros(), &Matrix2::zeros()).ok()?;
    let [image, sensor] = at_known_drift(all)?;
    // The scatter of several scans is that of their drift; that of the two lines of one is not.
    let scale = if alone {
        enlargement(chi2, freedom)
    } else {
        1.0
    };
    let lattice = Lattice::new(lattice.basis, lattice.covariance * scale + shared);
    let statistical = Statistical::without_drift(&(image * scale + shared), &(sensor * scale));
    let of = |s: &ScanAnalysis| (s.twist_strain_sensor, s.sensor);
    set_mean(
        &lattice,
        &statistical,
        grid,
        Agreement::new(chi2, freedom, scale),
        counted(scans).map(of),
        settings,
        strengths,
    )
}

/// How well scans agree with their common lattice.
#[derive(Clone, Copy)]
struct Agreement {
    /// `None` where nothing is left over to disagree: what rounding leaves there is no χ².
    chi2_per_dof: Option<f64>,
    /// By how much their scatter enlarged all variances.
    enlargement: f64,
}

impl Agreement {
    fn new(chi2: f64, freedom: usize, enlargement: f64) -> Self {
        Self {
            chi2_per_dof: (freedom > 0).then(|| chi2 / freedom as f64),
            enlargement,
        }
    }
}

/// Twist and strain of the common lattice, and how the scans scatter about it.
fn set_mean(
    lattice: &Lattice,
    statistical: &Statistical,
    grid: &GridErrors,
    agreement: Agreement,
    scans: impl Iterator<Item = (Option<TwistStrain>, Lattice)>,
    settings: &Settings,
    strengths: &WaveStrengths,
) -> Option<SetMean> {
    let twist_strain = moire(lattice, settings)?;
    let (singles, lattices): (Vec<_>, Vec<_>) = scans.unzip();
    let singles: Vec<TwistStrain> = singles.into_iter().flatten().collect();
    let twists: Vec<f64> = singles.iter().map(|s| s.twist).collect();
    let component = |i: usize| {
        let values: Vec<f64> = singles.iter().map(|s| s.strain_vector[i]).collect();
        mean_and_spread(&values).sigma
    };
    let within = lattices.iter().all(|l| {
        (0..3).all(|i| {
            let ratio = l.wavelength(i).value / lattice.wavelength(i).value;
            (ratio - 1.0).abs() <= ONE_PERCENT
        })
    });
    let budget = Budget::with_grid(lattice, &twist_strain, statistical, grid, settings);
    Some(SetMean {
        readings: Readings::new(lattice, &twist_strain, &budget, strengths, settings),
        budget,
        assumed: None,
        lattice: *lattice,
        twist_strain,
        twist_scatter: mean_and_spread(&twists).sigma,
        strain_scatter: component(0).hypot(component(1)) / std::f64::consts::SQRT_2,
        chi2_per_dof: agreement.chi2_per_dof,
        enlargement: agreement.enlargement,
        within_one_percent: within,
    })
}

/// Twist and strain of the mean reciprocal lattice of up and down scans, sensor coordinates.
///
/// With opposite time gradients the mean is free of constant drift exactly: a check that needs no
/// drift estimate.
pub(crate) fn forward_backward(scans: &[ScanAnalysis], settings: &Settings) -> Option<TwistStrain> {
    let mean = |direction: FrameDirection| {
        let reciprocal: Vec<Waves> = counted(scans)
            .filter(|s| s.frame_direction == Some(direction))
            .filter_map(|s| s.sensor.waves())
            .collect();
        plain_mean(&reciprocal)
    };
    let both = [mean(FrameDirection::Up)?, mean(FrameDirection::Down)?];
    let lattice = plain_mean(&both)?.lattice()?;
    // Back and forth turns the labelling by 60°, which twist and strain do not see.
    moire(&lattice, settings)
}
