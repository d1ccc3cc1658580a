//! One moiré lattice → twist angle, heterostrain, orientation; the default solution and all others.
//!
//! In: lattice vectors (nm) with covariance, the material, the form of the strain equation. Out:
//! rad, no dimension. The moiré alone leaves open: the sign of θ, the sign of ε (tension along one
//! axis or compression across it, θ differing by |ε|(1−ν)/2 of itself), α modulo 60°, and any
//! isotropic strain, which is taken as the one that uniaxial strain brings with it.

use std::f64::consts::{FRAC_PI_3, PI};

use nalgebra::{Matrix2, Matrix4, Vector2};

use super::complex_pair::ComplexPair;
use super::inversion::{Layers, Signs, Solution, reduce, solve};
use super::labelling::{least_strained, moire_matrix, moire_matrix_jacobian};
use super::{StrainError, TwistStrain};
use crate::lattice::LatticeVectors;
use crate::material::Material;
use crate::settings::StrainConvention;

/// θ > 0 and ε ≥ 0: what is reported unless asked otherwise.
pub(super) const DEFAULT_SIGNS: Signs = Signs {
    strain: 1.0,
    twist: 1.0,
};

/// Above this |q|/|p| the mirrored labelling (strain makes the moiré, twist distorts it) is listed.
const MIRRORED_FROM: f64 = 0.3;

/// One exact solution of the strain equation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Branch {
    /// θ, rad; < 0 where layer 2 is turned clockwise against layer 1.
    pub twist: f64,
    /// α, orientation of layer 1, rad in [0, π/3).
    pub lattice_angle: f64,
    /// ε with its sign: < 0 is compression (tension in the k-space form).
    pub strain: f64,
    /// φ, axis of ε counted from layer 1, rad in [0, π); belongs to the α given here.
    pub axis_lattice: f64,
    /// `φ_lab = φ + α + θ`, axis of ε in the laboratory, rad in [0, π).
    pub axis_lab: f64,
    /// Whether the moiré is read as made by strain and distorted by twist.
    pub strain_dominated: bool,
}

/// A lattice under its least strained name, and P of that name.
pub(super) struct Labelled {
    pub(super) lattice: LatticeVectors,
    pub(super) moire: Matrix2<f64>,
}

/// Twist and heterostrain of two equal layers, with θ > 0 and ε ≥ 0.
///
/// The covariance is the linear propagation of that of the lattice, correlations included. It is
/// finite at zero strain, where the strain vector (not its magnitude) is the quantity to use.
///
/// # Errors
/// Vectors that are not finite or parallel, a material that makes no sense, two layers that
/// coincide, or a distortion larger than twist and uniaxial strain can make.
/// # References
/// The equation: Kerelsky et al. 2019, arXiv 1812.08776; in k-space Tran et al. 2024, arXiv 2406.08681.
pub fn twist_strain(
    lattice: &LatticeVectors,
    material: &Material,
    convention: StrainConvention,
) -> Result<TwistStrain, StrainError> {
    let layers = layers(material, material, convention)?;
    let labelled = labelled(lattice, material)?;
    let moire = ComplexPair::from(labelled.moire);
    let solution = solve(&moire, &layers, DEFAULT_SIGNS).ok_or(no_solution(&moire, material))?;
    let by_moire = solution.jacobian(&moire, &layers, DEFAULT_SIGNS);
    let by_lattice = moire_matrix_jacobian(&labelled.lattice.basis, &labelled.moire)
        .ok_or(no_area(&labelled.lattice))?;
    let jacobian: Matrix4<f64> = by_moire * by_lattice;
    let covariance = jacobian * labelled.lattice.covariance * jacobian.transpose();
    // θ = 0 at the very edge of what strain can do: nothing limits its error there.
    if covariance.iter().any(|x| !x.is_finite()) {
        return Err(no_solution(&moire, material));
    }
    Ok(TwistStrain {
        twist: solution.twist,
        lattice_angle: reduce(solution.lattice_angle, FRAC_PI_3),
        strain_vector: Vector2::new(solution.strain_vector.re, solution.strain_vector.im),
        covariance,
    })
}

/// All exact solutions for layer 2 (`stretched`) on layer 1 (`reference`), which may differ.
///
/// The first one has θ > 0 and ε ≥ 0. For different layers those of different sign of strain have
/// twists that differ at first order: look at all of them.
///
/// # Errors
/// As [`twist_strain`]; where some of the solutions exist they are returned.
pub fn branches(
    lattice: &LatticeVectors,
    reference: &Material,
    stretched: &Material,
    convention: StrainConvention,
) -> Result<Vec<Branch>, StrainError> {
    let layers = layers(reference, stretched, convention)?;
    let labelled = labelled(lattice, reference)?;
    let moire = ComplexPair::from(labelled.moire);
    let mut found = solutions(&moire, &layers, false);
    if moire.q.norm() > MIRRORED_FROM * moire.p.norm() {
        let swapped = labelled.lattice.basis * Matrix2::new(0.0, 1.0, 1.0, 0.0);
        let mirrored = moire_matrix(&swapped, reference.lattice_constant_nm)
            .ok_or(no_area(&labelled.lattice))?;
        found.extend(solutions(&ComplexPair::from(mirrored), &layers, true));
    }
    if found.is_empty() {
        return Err(no_solution(&moire, reference));
    }
    Ok(found)
}

fn solutions(moire: &ComplexPair, layers: &Layers, strain_dominated: bool) -> Vec<Branch> {
    [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)]
        .into_iter()
        .filter_map(|(strain, twist)| solve(moire, layers, Signs { strain, twist }))
        .map(|solution| branch(&solution, strain_dominated))
        .collect()
}

fn branch(solution: &Solution, strain_dominated: bool) -> Branch {
    let lattice_angle = reduce(solution.lattice_angle, FRAC_PI_3);
    Branch {
        twist: solution.twist,
        lattice_angle,
        strain: solution.strain,
        axis_lattice: reduce(solution.axis_lab - lattice_angle - solution.twist, PI),
        axis_lab: reduce(solution.axis_lab, PI),
        strain_dominated,
    }
}

/// κ and ν, checked.
pub(super) fn layers(
    reference: &Material,
    stretched: &Material,
    convention: StrainConvention,
) -> Result<Layers, StrainError> {
    for material in [reference, stretched] {
        let (a, nu) = (material.lattice_constant_nm, material.poisson_ratio);
        if !(a.is_finite() && a > 0.0 && nu > -1.0 && nu < 1.0) {
            return Err(StrainError::Material {
                lattice_constant_nm: a,
                poisson_ratio: nu,
            });
        }
    }
    Ok(Layers {
        ratio: reference.lattice_constant_nm / stretched.lattice_constant_nm,
        poisson_ratio: stretched.poisson_ratio,
        convention,
    })
}

/// The least strained name of a lattice, once its numbers are known to be finite.
pub(super) fn labelled(
    lattice: &LatticeVectors,
    material: &Material,
) -> Result<Labelled, StrainError> {
    let finite = |values: &[f64]| values.iter().all(|x| x.is_finite());
    if !finite(lattice.basis.as_slice()) || !finite(lattice.covariance.as_slice()) {
        return Err(StrainError::NotFinite {
            basis: lattice.flat().into(),
        });
    }
    let lattice = least_strained(lattice).ok_or(no_area(lattice))?;
    let moire =
        moire_matrix(&lattice.basis, material.lattice_constant_nm).ok_or(no_area(&lattice))?;
    Ok(Labelled { lattice, moire })
}

fn no_area(lattice: &LatticeVectors) -> StrainError {
    StrainError::NoArea {
        area: lattice.basis.determinant(),
    }
}

fn no_solution(moire: &ComplexPair, material: &Material) -> StrainError {
    StrainError::NoSolution {
        lattice_constant_nm: material.lattice_constant_nm,
        isotropic: moire.p.norm(),
        anisotropic: moire.q.norm(),
    }
}
