//! Twist and strain → the moiré lattice they make; and the twist that one wavelength suggests.
//!
//! `P = R(α) [R(θ) S^∓¹ K − I]`, `L = P⁻ᵀ A⁰` (nm, rad): the upper sign in the real-space form, where
//! S stretches atoms, the lower one in the k-space form; K = 1 for equal layers.

use nalgebra::{Matrix2, Matrix4, Rotation2};

use crate::estimate::Estimate;
use crate::lattice::vectors::Lattice;
use crate::material::{Bilayer, Material};
use crate::strain::convention::StrainConvention;
use crate::strain::error::StrainError;
use crate::strain::labelling::least_strained;
use crate::strain::layers::Layers;
use crate::strain::twist_strain::TwistStrain;

/// How layer 2 lies on layer 1: `a₂ = R(α) R(θ) (1 + ε_b) S(ε, φ) a₁⁰`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stacking {
    /// θ, rad.
    pub twist: f64,
    /// α, orientation of the reciprocal vectors of layer 1, rad.
    pub lattice_angle: f64,
    /// ε, uniaxial strain of layer 2: + ε along the axis, −νε across.
    pub strain: f64,
    /// φ, axis of ε counted from layer 1, rad.
    pub axis_lattice: f64,
    /// `ε_b`, the same in all directions, on top of it. In the real-space form > 0 makes layer 2 larger, in
    /// the k-space form its reciprocal lattice.
    pub biaxial: f64,
}

impl Stacking {
    /// What the strain makes of reciprocal vectors of layer 2, before it is turned.
    fn reciprocal_stretch(&self, layers: &Layers) -> Matrix2<f64> {
        let scale = 1.0 + self.biaxial;
        let (along, across) = (
            scale * (1.0 + self.strain),
            scale * (1.0 - layers.poisson_ratio * self.strain),
        );
        let principal = match layers.convention {
            StrainConvention::RealSpace => Matrix2::new(1.0 / along, 0.0, 0.0, 1.0 / across),
            StrainConvention::KSpace => Matrix2::new(along, 0.0, 0.0, across),
        };
        let turn = |angle: f64| Rotation2::new(angle).into_inner();
        turn(self.axis_lattice) * principal * turn(-self.axis_lattice)
    }

    /// The atomic vectors (columns, nm) of layers 1 and 2 in the laboratory.
    ///
    /// # Errors
    /// [`StrainError::Material`]; [`StrainError::NoArea`] for a strain that leaves nothing of layer 2.
    pub fn atoms<'a>(
        &self,
        bilayer: impl Into<Bilayer<'a>>,
        convention: StrainConvention,
    ) -> Result<[Matrix2<f64>; 2], StrainError> {
        let bilayer = bilayer.into();
        let layers = Layers::new(bilayer, convention)?;
        let turn = |angle: f64| Rotation2::new(angle).into_inner();
        let stretch = self
            .reciprocal_stretch(&layers)
            .transpose()
            .try_inverse()
            .ok_or(StrainError::NoArea { area: 0.0 })?;
        Ok([
            turn(self.lattice_angle) * bilayer.reference.atomic_pair(),
            turn(self.lattice_angle + self.twist) * stretch * bilayer.stretched.atomic_pair(),
        ])
    }
}

/// The primitive pair (columns, nm, about 60° apart) of the moiré of two equal layers.
///
/// `twist` θ and `lattice_angle` α in rad; `strain` ε along the axis `axis_lattice` φ, counted from
/// layer 1. The pair is the least strained one, as [`crate::strain::twist_strain`] labels it.
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
    let stacking = Stacking {
        twist,
        lattice_angle,
        strain,
        axis_lattice,
        biaxial: 0.0,
    };
    moire_of(&stacking, material, convention)
}

/// The primitive pair (columns, nm) of the moiré of two layers that may differ.
///
/// The pair is the least strained one, as [`crate::strain::twist_strain`] labels it; it is about 60° apart for
/// hexagonal layers.
///
/// # Errors
/// [`StrainError::NoMoire`] if the layers coincide, [`StrainError::Material`].
pub fn moire_of<'a>(
    stacking: &Stacking,
    bilayer: impl Into<Bilayer<'a>>,
    convention: StrainConvention,
) -> Result<Matrix2<f64>, StrainError> {
    let bilayer = bilayer.into();
    let layers = Layers::new(bilayer, convention)?;
    let lattice = Lattice::new(
        moire_pair_of(stacking, bilayer, convention)?,
        Matrix4::zeros(),
    );
    Ok(least_strained(&lattice, &layers)
        .ok_or(StrainError::NoMoire)?
        .basis)
}

/// The pair (columns, nm) of the moiré of two layers whose waves are the differences of the first reciprocal vectors of the
/// layers: those that the contrast of an image shows strongest, and not always the least strained pair of the lattice.
///
/// # Errors
/// As [`moire_of`].
pub fn moire_pair_of<'a>(
    stacking: &Stacking,
    bilayer: impl Into<Bilayer<'a>>,
    convention: StrainConvention,
) -> Result<Matrix2<f64>, StrainError> {
    let layers = Layers::new(bilayer.into(), convention)?;
    let turn = |angle: f64| Rotation2::new(angle).into_inner();
    let stretch = stacking.reciprocal_stretch(&layers);
    let mismatch = layers
        .inverse
        .matrix()
        .try_inverse()
        .ok_or(StrainError::NoMoire)?;
    let moire = turn(stacking.lattice_angle)
        * (turn(stacking.twist) * stretch * mismatch - Matrix2::identity());
    let basis = moire
        .transpose()
        .try_inverse()
        .ok_or(StrainError::NoMoire)?
        * layers.atoms;
    if !basis.iter().all(|x| x.is_finite()) {
        return Err(StrainError::NoMoire);
    }
    Ok(basis)
}

impl TwistStrain {
    /// The moiré lattice (columns, nm) that these numbers describe: [`moire_of`] backwards.
    ///
    /// # Errors
    /// As [`moire_of`].
    pub fn moire_lattice<'a>(
        &self,
        bilayer: impl Into<Bilayer<'a>>,
        convention: StrainConvention,
    ) -> Result<Matrix2<f64>, StrainError> {
        let axis_lab = self.strain_vector.y.atan2(self.strain_vector.x) / 2.0;
        let stacking = Stacking {
            twist: self.twist,
            lattice_angle: self.lattice_angle,
            strain: self.strain_vector.norm(),
            axis_lattice: axis_lab - self.lattice_angle - self.twist,
            biaxial: 0.0,
        };
        moire_of(&stacking, bilayer, convention)
    }
}

/// The twist that one wavelength (nm) suggests if nothing is strained: θ = 2 arcsin(a / 2λ) for equal
/// hexagonal layers, `cos θ = (1 + κ² − (a₁/λ)²)/2κ` for different ones.
///
/// NaN for a wavelength that no twist up to 30° makes (layers turned further look like layers turned the other
/// way), and for layers that are not hexagonal.
pub fn naive_twist<'a>(wavelength: Estimate, bilayer: impl Into<Bilayer<'a>>) -> Estimate {
    let Bilayer {
        reference,
        stretched,
        ..
    } = bilayer.into();
    if !(reference.is_hexagonal() && stretched.is_hexagonal()) {
        return Estimate::new(f64::NAN, f64::NAN);
    }
    let a = reference.lattice_constant_nm;
    let ratio = a / stretched.lattice_constant_nm;
    let size = a / wavelength.value;
    // 2κ(1 − cos θ) = 4κ sin²(θ/2) = p² − (κ − 1)²: nothing cancels for equal layers.
    let sine = ((size * size - (ratio - 1.0).powi(2)) / (4.0 * ratio)).sqrt();
    if !(sine <= (std::f64::consts::FRAC_PI_6 / 2.0).sin()) {
        return Estimate::new(f64::NAN, f64::NAN);
    }
    let slope = size * size / (wavelength.value * ratio * 2.0 * sine * (1.0 - sine * sine).sqrt());
    Estimate::new(2.0 * sine.asin(), slope * wavelength.sigma)
}
