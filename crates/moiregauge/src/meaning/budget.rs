//! The uncertainty budget: what every source of error contributes to twist, strain and wavelengths.
//!
//! In: the lattice of a set (nm), its twist and strain, the covariance of the lattice split into image
//! noise, drift and sensor noise ([`Statistical`]), the priors of the settings. Out: variances (rad², no
//! dimension, nm²) source by source; they are independent, so they add.
//!
//! Image noise, drift and sensors are what σ of a result is made of. The others are not seen by the
//! scans and are the same in all of them, so more scans do not make them smaller:
//!
//! - Calibration. Sensors that show `(1 + δ) r` in place of r turn the moiré matrix `M` into
//!   `(1 + δ)^{−T} M`. A common gain s changes the twist by −sθ; gains of x and y that differ by g, or
//!   axes that miss a right angle by γ, change the strain vector by θg/(1+ν) or θγ/(1+ν). A measured
//!   calibration ([`crate::calibration`]) takes the place of the priors; where its three errors are correlated,
//!   what one shares with those before it is counted with them, so that the rows add up. A rotation of
//!   the sensors' frame has no row: angles are counted from the axis of the x sensor by definition.
//! - Pitch. Without sensors the pixels are as far apart as the nominal size says; of N pixels it spans N or N − 1, and
//!   where the format does not say which, both are as likely: lengths along either side are uncertain by 1/(√2 N), the
//!   root mean square of none and 1/N.
//! - Shape of the grid. Sensors that bend by a share s of the range R that they go through in the frame, a quadratic with no mean
//!   slope, change positions at a distance d from the middle by 8sd/R of themselves: nothing in the mean of a whole frame.
//! - Lattice constant: θ is proportional to it.
//! - Model: see [`heterostrain::strain`]. An isotropic strain h changes θ at first and second order; its
//!   variance is the mean square over a Gaussian prior, `d² + 3c²` for a change `d h/σ + c h²/σ²`.

use heterostrain::lattice::Lattice;
use heterostrain::material::Material;
use heterostrain::strain::{Reference, TwistStrain, twist_strain};
use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};

use crate::drift::shares::Statistical;
use crate::frame::grid_errors::GridErrors;
use crate::settings::knobs::Settings;

/// Where an error comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// Noise of the images: what is left if drift and sensors are known exactly.
    Image,
    /// The drift, as far as it is not known.
    Drift,
    /// Noise of the position sensors.
    Sensor,
    /// One gain error of both sensors.
    Gain,
    /// Different gains of the x and the y sensor.
    Mismatch,
    /// Sensor axes that do not stand at a right angle.
    Orthogonality,
    /// What the nominal size spans, where the format does not say: N pixels or N − 1.
    Pitch,
    /// What the grid may be bent by, about the place of the area.
    Shape,
    /// The lattice constant.
    LatticeConstant,
    /// Which layer is strained.
    StrainedLayer,
    /// Isotropic heterostrain, which the moiré does not show.
    IsotropicStrain,
    /// The Poisson ratio.
    PoissonRatio,
    /// Strain of the layer whose atoms are the ruler; 0 without a ruler.
    RulerStrain,
}

impl Source {
    /// All of them, in the order of tables and figures: what averages out first.
    pub const ALL: [Self; 13] = [
        Self::Image,
        Self::Drift,
        Self::Sensor,
        Self::Gain,
        Self::Mismatch,
        Self::Orthogonality,
        Self::Pitch,
        Self::Shape,
        Self::LatticeConstant,
        Self::StrainedLayer,
        Self::IsotropicStrain,
        Self::PoissonRatio,
        Self::RulerStrain,
    ];

    /// Whether it is part of the σ of a result.
    pub fn is_statistical(self) -> bool {
        matches!(self, Self::Image | Self::Drift | Self::Sensor)
    }
}

/// Variances that one source, or several together, bring about; NaN where they are not known.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Contribution {
    /// Covariance of `(θ, α, E₁, E₂)`.
    pub covariance: Matrix4<f64>,
    /// Variance of the magnitude of the strain.
    pub magnitude: f64,
    /// Variance of the axis of the strain in the laboratory, rad².
    pub axis_lab: f64,
    /// Variances of the three wavelengths, nm².
    pub wavelengths: [f64; 3],
}

/// All contributions to the uncertainty of one lattice.
#[derive(Clone, Debug)]
pub struct Budget {
    /// In the order of [`Source::ALL`].
    contributions: [Contribution; 13],
    /// What errors of the grid do to positions.
    pub grid: GridErrors,
    /// Whether the drift is a prior: nothing tells it.
    pub drift_assumed: bool,
    /// The statistical ones as covariances of the lattice.
    pub statistical: Statistical,
    /// The layer (1 or 2) whose atoms are the ruler; `None` where the scanner is.
    pub ruler: Option<u8>,
}

impl Budget {
    /// The budget of a lattice (nm) with its twist and strain.
    ///
    /// What cannot be computed (an isotropic strain that no twist goes with, a drift that is not known)
    /// is NaN, and so is the total.
    pub fn new(
        lattice: &Lattice,
        found: &TwistStrain,
        statistical: &Statistical,
        settings: &Settings,
    ) -> Self {
        Self::with_grid(
            lattice,
            found,
            statistical,
            &GridErrors::default(),
            settings,
        )
    }

    /// The same with errors of the grid of the pixels.
    pub fn with_grid(
        lattice: &Lattice,
        found: &TwistStrain,
        statistical: &Statistical,
        grid: &GridErrors,
        settings: &Settings,
    ) -> Self {
        let reference = Reference::new(lattice, settings.bilayer(), settings.strain_convention);
        let contribution = |source: Source| {
            let (covariance, wavelengths) =
                match lattice_error(source, lattice, statistical, grid, settings) {
                    Some(error) => (
                        through(lattice, &error, settings),
                        squared_wavelength_sigmas(lattice, &error),
                    ),
                    None => (
                        model_error(source, lattice, reference.as_ref(), settings),
                        [0.0; 3],
                    ),
                };
            let strain = covariance.fixed_view::<2, 2>(2, 2).into_owned();
            Contribution {
                covariance,
                magnitude: found.strain().magnitude_variance(&strain),
                axis_lab: found.strain().axis_variance(&strain),
                wavelengths,
            }
        };
        Self {
            contributions: Source::ALL.map(contribution),
            statistical: *statistical,
            grid: *grid,
            drift_assumed: false,
            ruler: None,
        }
    }

    /// Where the atoms of a layer are the ruler: from what every source contributes.
    pub(crate) fn of_ruler(
        layer: u8,
        contribution: impl Fn(Source) -> Contribution,
        statistical: &Statistical,
    ) -> Self {
        Self {
            contributions: Source::ALL.map(contribution),
            grid: GridErrors::default(),
            statistical: *statistical,
            drift_assumed: false,
            ruler: Some(layer),
        }
    }

    /// Whether a source is worth a row: the pitch where it is in doubt, the strain of a ruler where there is one.
    pub fn has(&self, source: Source) -> bool {
        match source {
            Source::Pitch => self.grid.pitch.norm() > 0.0,
            Source::Shape => self.grid.shape.norm() > 0.0,
            Source::RulerStrain => self.ruler.is_some(),
            _ => true,
        }
    }

    /// What the calibration of the scanner may do to a lattice: covariances of its vectors, nm², one for
    /// each source.
    pub(crate) fn calibration_errors(
        &self,
        lattice: &Lattice,
        settings: &Settings,
    ) -> [Matrix4<f64>; 5] {
        let sources = [
            Source::Gain,
            Source::Mismatch,
            Source::Orthogonality,
            Source::Pitch,
            Source::Shape,
        ];
        sources.map(|source| {
            lattice_error(source, lattice, &self.statistical, &self.grid, settings)
                .unwrap_or_else(Matrix4::zeros)
        })
    }

    /// What one source contributes.
    pub fn of(&self, source: Source) -> Contribution {
        self.sum(|s| s == source)
    }

    /// What the chosen sources contribute together.
    pub fn sum(&self, chosen: impl Fn(Source) -> bool) -> Contribution {
        let none = Contribution {
            covariance: Matrix4::zeros(),
            magnitude: 0.0,
            axis_lab: 0.0,
            wavelengths: [0.0; 3],
        };
        Source::ALL
            .iter()
            .zip(&self.contributions)
            .filter(|(source, _)| chosen(**source))
            .fold(none, |sum, (_, c)| Contribution {
                covariance: sum.covariance + c.covariance,
                magnitude: sum.magnitude + c.magnitude,
                axis_lab: sum.axis_lab + c.axis_lab,
                wavelengths: [0, 1, 2].map(|i| sum.wavelengths[i] + c.wavelengths[i]),
            })
    }

    /// Everything together.
    pub fn total(&self) -> Contribution {
        self.sum(|_| true)
    }

    /// Everything that is known: all but the drift where nothing tells it.
    pub fn known(&self) -> Contribution {
        let drift = self.drift_known();
        self.sum(|source| drift || source != Source::Drift)
    }

    /// Whether the contribution of the drift is known.
    pub fn drift_known(&self) -> bool {
        !self.statistical.drift.m11.is_nan()
    }

    /// `found` with everything that is known for its uncertainty: for limits and significance.
    pub fn applied_to(&self, found: &TwistStrain) -> TwistStrain {
        TwistStrain {
            covariance: self.known().covariance,
            ..*found
        }
    }
}

/// What a source does to the lattice vectors, nm²; `None` for those that change only its meaning.
fn lattice_error(
    source: Source,
    lattice: &Lattice,
    statistical: &Statistical,
    grid: &GridErrors,
    settings: &Settings,
) -> Option<Matrix4<f64>> {
    let of = |change: Matrix2<f64>| {
        square(&Vector4::from_column_slice(
            (change * lattice.basis).as_slice(),
        ))
    };
    match source {
        Source::Image => Some(statistical.image),
        Source::Drift => Some(statistical.drift),
        Source::Sensor => Some(statistical.sensor),
        Source::Pitch => Some(of(grid.pitch)),
        Source::Shape => Some(grid.shape_changes().map(of).iter().sum()),
        _ => Some(of(distortion(source, settings)?)),
    }
}

/// What the calibration of the scanner does to a velocity (or any other vector that the sensors measure):
/// covariance in its unit squared.
pub(crate) fn scanner_covariance(vector: &Vector2<f64>, settings: &Settings) -> Matrix2<f64> {
    [Source::Gain, Source::Mismatch, Source::Orthogonality]
        .into_iter()
        .filter_map(|source| {
            let change = distortion(source, settings)? * vector;
            Some(change * change.transpose())
        })
        .sum()
}

/// Variances of the lengths of L₁, L₂ and L₃ of a lattice, nm², with everything that is known: what the scans leave open, and the scanner.
pub(crate) fn wavelength_variances(
    lattice: &Lattice,
    statistical: &Statistical,
    grid: &GridErrors,
    settings: &Settings,
) -> [f64; 3] {
    let sources = Source::ALL.into_iter();
    let errors =
        sources.filter_map(|source| lattice_error(source, lattice, statistical, grid, settings));
    squared_wavelength_sigmas(lattice, &errors.sum())
}

/// The relative change of positions by one standard deviation of an error of the scanner; `None` for other sources.
fn distortion(source: Source, settings: &Settings) -> Option<Matrix2<f64>> {
    if let Source::Gain | Source::Mismatch | Source::Orthogonality = source
        && let Some(scanner) = &settings.scanner
    {
        let error = scanner.independent_errors()[source as usize - Source::Gain as usize];
        return Some(scanner.map()? * error);
    }
    let calibration = &settings.calibration;
    // The whole of a difference between x and y shows as half of it in either.
    let (distortion, sigma) = match source {
        Source::Gain => (Matrix2::identity(), calibration.gain_percent / 100.0),
        Source::Mismatch => (
            Matrix2::new(0.5, 0.0, 0.0, -0.5),
            calibration.mismatch_percent / 100.0,
        ),
        Source::Orthogonality => (
            Matrix2::new(0.0, 0.5, 0.5, 0.0),
            calibration.orthogonality_mrad / 1000.0,
        ),
        _ => return None,
    };
    Some(distortion * sigma)
}

/// What a source that leaves the lattice as it is does to `(θ, α, E₁, E₂)`.
fn model_error(
    source: Source,
    lattice: &Lattice,
    reference: Option<&Reference>,
    settings: &Settings,
) -> Matrix4<f64> {
    let bilayer = settings.bilayer();
    if reference.is_none() && !bilayer.is_equal() {
        return aligned_error(source, settings);
    }
    let relative = |m: &Material| m.lattice_constant_sigma_nm / m.lattice_constant_nm;
    let found = match source {
        // The moiré matrix is proportional to a and to the inverse of the moiré vectors.
        Source::LatticeConstant if bilayer.is_equal() => {
            let error = square(&(lattice.flat() * relative(bilayer.stretched)));
            Some(through(lattice, &error, settings))
        }
        // Two constants that nothing binds to each other: their ratio moves the twist at first order.
        Source::LatticeConstant => reference.and_then(|r| {
            let first = mean_square(relative(bilayer.reference), |d| {
                r.with_lattice_constants([d, 0.0])
            })?;
            let second = mean_square(relative(bilayer.stretched), |d| {
                r.with_lattice_constants([0.0, d])
            })?;
            Some(first + second)
        }),
        Source::StrainedLayer => reference
            .and_then(Reference::with_shared_strain)
            .map(|change| square(&change)),
        Source::IsotropicStrain => {
            let sigma = settings.isotropic_strain_percent / 100.0;
            reference.and_then(|r| mean_square(sigma, |h| r.with_isotropic_strain(h)))
        }
        Source::RulerStrain => Some(Matrix4::zeros()),
        _ => {
            let sigma = bilayer.stretched.poisson_ratio_sigma;
            reference.and_then(|r| mean_square(sigma, |change| r.with_poisson_ratio(change)))
        }
    };
    found.unwrap_or_else(|| Matrix4::from_element(f64::NAN))
}

/// What the model leaves open of layers of different size that are read as aligned, because their moiré is
/// larger than any twist makes it. An error δ of the mismatch κ − 1 moves θ² by `2|κ − 1|δ`, and α by
/// `κ/(κ − 1)` times as much as θ; the rest is of second order.
fn aligned_error(source: Source, settings: &Settings) -> Matrix4<f64> {
    let bilayer = settings.bilayer();
    let relative = |m: &Material| m.lattice_constant_sigma_nm / m.lattice_constant_nm;
    let error = match source {
        Source::LatticeConstant => relative(bilayer.reference).hypot(relative(bilayer.stretched)),
        Source::IsotropicStrain => settings.isotropic_strain_percent / 100.0,
        _ => return Matrix4::zeros(),
    };
    let ratio = bilayer.reference.lattice_constant_nm / bilayer.stretched.lattice_constant_nm;
    let twist = 2.0 * (ratio - 1.0).abs() * error;
    let mut covariance = Matrix4::zeros();
    covariance[(0, 0)] = twist;
    covariance[(1, 1)] = twist * (ratio / (ratio - 1.0)).powi(2);
    covariance
}

/// Mean square change for a Gaussian parameter: a parabola through ±σ, with `⟨h⁴⟩ = 3σ⁴`. Where nothing
/// explains the moiré on one side (layers of different size, nearly aligned), the other one counts.
fn mean_square(sigma: f64, change: impl Fn(f64) -> Option<Vector4<f64>>) -> Option<Matrix4<f64>> {
    let (up, down) = match (change(sigma), change(-sigma)) {
        (Some(up), Some(down)) => (up, down),
        (None, None) => return None,
        (one, other) => {
            let one = one.or(other)?;
            (one, -one)
        }
    };
    let (slope, curve) = ((up - down) / 2.0, (up + down) / 2.0);
    Some(square(&slope) + 3.0 * square(&curve))
}

fn square(v: &Vector4<f64>) -> Matrix4<f64> {
    v * v.transpose()
}

/// Covariance of `(θ, α, E₁, E₂)` for one of the lattice vectors, by the analytic Jacobian.
fn through(lattice: &Lattice, error: &Matrix4<f64>, settings: &Settings) -> Matrix4<f64> {
    let lattice = Lattice::new(lattice.basis, *error);
    twist_strain(&lattice, settings.bilayer(), settings.strain_convention).map_or_else(
        |_| Matrix4::from_element(f64::NAN),
        |found| found.covariance,
    )
}

fn squared_wavelength_sigmas(lattice: &Lattice, error: &Matrix4<f64>) -> [f64; 3] {
    let lattice: Lattice = Lattice::new(lattice.basis, *error);
    [0, 1, 2].map(|i| lattice.wavelength(i).sigma.powi(2))
}

#[cfg(test)]
mod tests;
