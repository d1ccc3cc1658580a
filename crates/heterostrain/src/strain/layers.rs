//! What the strain equation needs to know about two layers, and the stretch as a function of its
//! deviator.
//!
//! Layer 2 (`stretched`) is counted from a lattice of its own, with the reciprocal matrix
//! `G₂ = K G₁`; for similar lattices K is the number κ = a₁/a₂. Of the primitive cells that describe
//! layer 2, the one most like that of layer 1 is used.

use nalgebra::Matrix2;

use crate::complex_pair::ComplexPair;
use crate::lattice::same_handed;
use crate::material::{Bilayer, Material};
use crate::strain::convention::StrainConvention;
use crate::strain::error::StrainError;

/// What the strain equation needs to know about the layers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layers {
    /// The atomic vectors of layer 1 at orientation zero, nm.
    pub(crate) atoms: Matrix2<f64>,
    /// K⁻¹; (1/κ, 0) for similar lattices.
    pub(crate) inverse: ComplexPair,
    /// ν of layer 2.
    pub(crate) poisson_ratio: f64,
    /// ν of layer 1.
    pub(crate) poisson_ratio_reference: f64,
    /// Form of the equation.
    pub(crate) convention: StrainConvention,
    /// By how much layer 1 can be turned without being another lattice, rad.
    pub(crate) period: f64,
    /// The wave vectors that the user or the image named, rad/nm.
    pub(crate) waves: Option<Matrix2<f64>>,
}

impl Layers {
    /// K⁻¹ and ν, checked.
    pub(crate) fn new(
        bilayer: Bilayer<'_>,
        convention: StrainConvention,
    ) -> Result<Self, StrainError> {
        let Bilayer {
            reference,
            stretched,
            waves,
        } = bilayer;
        for material in [reference, stretched] {
            check(material)?;
        }
        let atoms = reference.atomic_pair();
        let inverse = if bilayer.is_equal() {
            ComplexPair::from(Matrix2::identity())
        } else {
            most_alike(&atoms, &stretched.atomic_pair()).ok_or(StrainError::NoArea {
                area: atoms.determinant(),
            })?
        };
        Ok(Self {
            atoms,
            inverse,
            poisson_ratio: stretched.poisson_ratio,
            poisson_ratio_reference: reference.poisson_ratio,
            convention,
            period: reference.rotation_period(),
            waves,
        })
    }

    /// κ, where the lattices are similar and not turned against each other.
    pub(crate) fn ratio(&self) -> Option<f64> {
        let ComplexPair { p, q } = self.inverse;
        (q.norm() < 1e-12 * p.norm() && p.im.abs() < 1e-12 * p.norm()).then(|| p.re.recip())
    }

    /// `N = (R(α) + P) K⁻¹`, which is `R(β) S^∓¹` if P is explained by a layer 1 of orientation α.
    pub(crate) fn stretched(&self, moire: &ComplexPair, lattice_angle: f64) -> ComplexPair {
        let turned = ComplexPair {
            p: moire.p + nalgebra::Complex::cis(lattice_angle),
            q: moire.q,
        };
        turned.times(&self.inverse)
    }

    /// The same layers with names exchanged, and the moiré matrix that goes with them:
    /// `M' = b₁ − b₂`, `P' = −P K⁻¹`.
    pub(crate) fn exchanged(&self, moire: &ComplexPair) -> Option<(Self, ComplexPair)> {
        let layers = Self {
            inverse: self.inverse.inverse()?,
            poisson_ratio: self.poisson_ratio_reference,
            poisson_ratio_reference: self.poisson_ratio,
            ..*self
        };
        Some((layers, moire.times(&self.inverse).scaled(-1.0)))
    }
}

fn check(material: &Material) -> Result<(), StrainError> {
    if material.problem().is_none() {
        return Ok(());
    }
    Err(StrainError::Material {
        lattice_constant_nm: material.lattice_constant_nm,
        poisson_ratio: material.poisson_ratio,
    })
}

/// `K⁻¹ = (A₂ U A₁⁻¹)ᵀ` for the primitive cell `A₂ U` of layer 2 that differs least from that of layer 1
/// in shape; the cell as it is given where another is no better.
fn most_alike(first: &Matrix2<f64>, second: &Matrix2<f64>) -> Option<ComplexPair> {
    let inverse = first.try_inverse()?;
    let pair = |change: &Matrix2<f64>| ComplexPair::from((second * change * inverse).transpose());
    let mut best = pair(&Matrix2::identity());
    for change in same_handed(1) {
        let other = pair(&change);
        if other.distortion() < best.distortion() - 1e-9 {
            best = other;
        }
    }
    Some(best)
}

/// Strain and isotropic size as functions of the deviator k = ±|q|.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stretch {
    /// ε/k, finite at k = 0.
    pub(crate) strain_per_deviator: f64,
    /// dε/dk.
    pub(crate) strain_slope: f64,
    /// 1 + η, half the sum of the principal stretches.
    pub(crate) size: f64,
    /// dη/dε.
    pub(crate) size_slope: f64,
}

impl Stretch {
    /// The uniaxial stretch of reciprocal vectors with the deviator k.
    pub(crate) fn new(k: f64, layers: &Layers) -> Self {
        let nu = layers.poisson_ratio;
        match layers.convention {
            StrainConvention::KSpace => {
                let strain = 2.0 * k / (1.0 + nu);
                Self {
                    strain_per_deviator: 2.0 / (1.0 + nu),
                    strain_slope: 2.0 / (1.0 + nu),
                    size: 1.0 + strain * (1.0 - nu) / 2.0,
                    size_slope: (1.0 - nu) / 2.0,
                }
            }
            // S⁻¹ has the principal values 1/(1+ε) and 1/(1−νε), hence
            // (1+ν) ε = 2k (1+ε)(1−νε); the root that vanishes with k.
            StrainConvention::RealSpace => {
                let b = (1.0 + nu) - 2.0 * k * (1.0 - nu);
                let strain_per_deviator = 4.0 / (b + (b * b + 16.0 * k * k * nu).sqrt());
                let strain = strain_per_deviator * k;
                let (along, across) = (1.0 + strain, 1.0 - nu * strain);
                Self {
                    strain_per_deviator,
                    strain_slope: 2.0 * along * across
                        / ((1.0 + nu) - 2.0 * k * (1.0 - nu - 2.0 * nu * strain)),
                    size: f64::midpoint(1.0 / along, 1.0 / across),
                    size_slope: (nu / (across * across) - 1.0 / (along * along)) / 2.0,
                }
            }
        }
    }
}

/// Stretching atoms shrinks reciprocal vectors: the deviator of S⁻¹ points across the tensile axis.
pub(crate) fn strain_side(convention: StrainConvention) -> f64 {
    match convention {
        StrainConvention::RealSpace => -1.0,
        StrainConvention::KSpace => 1.0,
    }
}
