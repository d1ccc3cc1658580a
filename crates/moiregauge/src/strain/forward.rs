//! Twist and strain → the moiré lattice they make; and the twist that one wavelength suggests.
//!
//! `P = R(α) [R(θ) S^∓¹ − I]`, `L = P⁻ᵀ A⁰` (nm, rad): the upper sign in the real-space form, where
//! S stretches atoms, the lower one in the k-space form.

use nalgebra::{Matrix2, Matrix4, Rotation2};

use super::closed_form::layers;
use super::labelling::{atomic_pair, least_strained};
use super::{StrainError, TwistStrain};
use crate::estimate::Estimate;
use crate::lattice::LatticeVectors;
use crate::material::Material;
use crate::settings::StrainConvention;

/// The primitive pair (columns, nm, about 60° apart) of the moiré of two equal layers.
///
/// `twist` θ and `lattice_angle` α in rad; `strain` ε along the axis `axis_lattice` φ, counted from
/// layer 1. The pair is the least strained one, as [`super::twist_strain`] labels it.
///
/// # Errors
/// [`StrainError::NoMoire`] if the layers coincide, [`StrainError::Material`].
pub fn moire_lattice(
    twist: f64,
    strain: f64,
    axis_lattice: f64,
    lattice_angle: f64,
    material: &Material,
    convention: StrainConvention,
) -> Result<Matrix2<f64>, StrainError> {
    layers(material, material, convention)?;
    let turn = |angle: f64| Rotation2::new(angle).into_inner();
    let (along, across) = (1.0 + strain, 1.0 - material.poisson_ratio * strain);
    let principal = match convention {
        StrainConvention::RealSpace => Matrix2::new(1.0 / along, 0.0, 0.0, 1.0 / across),
        StrainConvention::KSpace => Matrix2::new(along, 0.0, 0.0, across),
    };
    let stretch = turn(axis_lattice) * principal * turn(-axis_lattice);
    let moire = turn(lattice_angle) * (turn(twist) * stretch - Matrix2::identity());
    let basis = moire
        .transpose()
        .try_inverse()
        .ok_or(StrainError::NoMoire)?
        * atomic_pair(material.lattice_constant_nm);
    let lattice = LatticeVectors {
        basis,
        covariance: Matrix4::zeros(),
    };
    if !basis.iter().all(|x| x.is_finite()) {
        return Err(StrainError::NoMoire);
    }
    Ok(least_strained(&lattice).ok_or(StrainError::NoMoire)?.basis)
}

impl TwistStrain {
    /// The moiré lattice (columns, nm) that these numbers describe: [`moire_lattice`] backwards.
    ///
    /// # Errors
    /// As [`moire_lattice`].
    pub fn moire_lattice(
        &self,
        material: &Material,
        convention: StrainConvention,
    ) -> Result<Matrix2<f64>, StrainError> {
        let axis_lab = self.strain_vector.y.atan2(self.strain_vector.x) / 2.0;
        moire_lattice(
            self.twist,
            self.strain_vector.norm(),
            axis_lab - self.lattice_angle - self.twist,
            self.lattice_angle,
            material,
            convention,
        )
    }
}

/// θ = 2 arcsin(a / 2λ): the twist that one wavelength (nm) suggests if nothing is strained.
///
/// NaN for a wavelength below 1.93 a, which no twist up to 30° makes; layers turned further look like layers
/// turned the other way.
pub fn naive_twist(wavelength: Estimate, material: &Material) -> Estimate {
    let sine = material.lattice_constant_nm / (2.0 * wavelength.value);
    if !(sine <= (std::f64::consts::FRAC_PI_6 / 2.0).sin()) {
        return Estimate::new(f64::NAN, f64::NAN);
    }
    let slope = 2.0 * sine / (wavelength.value * (1.0 - sine * sine).sqrt());
    Estimate::new(2.0 * sine.asin(), slope * wavelength.sigma)
}
