//! One moiré lattice → twist angle, heterostrain, orientation; the default solution and all others.
//!
//! In: lattice vectors (nm) with covariance, the layers, the form of the strain equation. Out:
//! rad, no dimension. The moiré alone leaves open: the sign of θ, the sign of ε (tension along one
//! axis or compression across it, θ differing by |ε|(1−ν)/2 of itself, or at first order where the
//! layers differ), α modulo the symmetry of layer 1, and any isotropic strain, which is taken as the
//! one that uniaxial strain brings with it.

use std::f64::consts::PI;

use nalgebra::{Matrix2, Matrix4, Vector2};

use super::aligned;
use super::complex_pair::ComplexPair;
use super::inversion::{ALL_SIGNS, Signs, Solution, reduce, solve, solve_all};
use super::labelling::{least_strained, likely_names, moire_matrix, moire_matrix_jacobian};
use super::layers::Layers;
use super::{StrainError, TwistStrain};
use crate::lattice::LatticeVectors;
use crate::material::{Bilayer, Material};
use crate::settings::StrainConvention;

/// Above this |q|/|p| the mirrored labelling (strain makes the moiré, twist distorts it) is listed.
const MIRRORED_FROM: f64 = 0.3;
/// Readings of layers of different lattices that need more strain are not listed.
const LIKELY_STRAIN: f64 = 0.03;
/// Readings of such layers that are listed for either sense of the twist, the least strained ones.
const LISTED: usize = 12;

/// One exact solution of the strain equation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Branch {
    /// θ, rad; < 0 where layer 2 is turned clockwise against layer 1.
    pub twist: f64,
    /// α, orientation of layer 1, rad in [0, π/3) for a hexagonal layer.
    pub lattice_angle: f64,
    /// ε with its sign: < 0 is compression (tension in the k-space form).
    pub strain: f64,
    /// φ, axis of ε counted from layer 1, rad in [0, π); belongs to the α given here.
    pub axis_lattice: f64,
    /// `φ_lab = φ + α + θ`, axis of ε in the laboratory, rad in [0, π).
    pub axis_lab: f64,
    /// Whether the moiré is read as made by strain and distorted by twist.
    pub strain_dominated: bool,
    /// σ of θ from the covariance of the lattice, rad; NaN where it is not determined.
    pub twist_sigma: f64,
    /// σ of ε, as of `twist_sigma`.
    pub strain_sigma: f64,
}

/// A lattice under its least strained name, and P of that name.
pub(super) struct Labelled {
    pub(super) lattice: LatticeVectors,
    pub(super) moire: Matrix2<f64>,
}

/// Twist and heterostrain of two layers, with θ > 0 and ε ≥ 0.
///
/// The covariance is the linear propagation of that of the lattice, correlations included. It is
/// finite at zero strain, where the strain vector (not its magnitude) is the quantity to use.
///
/// Where the layers differ, twist and strain trade at first order: this is one of the [`branches`]; it
/// has ε ≤ 0 if ε ≥ 0 explains nothing. A moiré a little larger than the layers can make is read as that
/// of aligned ones, θ = 0, with the σ that the size of the moiré leaves.
///
/// # Errors
/// Vectors that are not finite or parallel, a material that makes no sense, two layers that
/// coincide, or a distortion larger than twist and uniaxial strain can make.
/// # References
/// The equation: Kerelsky et al. 2019, arXiv 1812.08776; in k-space Tran et al. 2024, arXiv 2406.08681.
pub fn twist_strain<'a>(
    lattice: &LatticeVectors,
    bilayer: impl Into<Bilayer<'a>>,
    convention: StrainConvention,
) -> Result<TwistStrain, StrainError> {
    let layers = Layers::new(bilayer.into(), convention)?;
    let labelled = labelled(lattice, &layers)?;
    let moire = ComplexPair::from(labelled.moire);
    let Some(solution) = default_solution(&moire, &layers) else {
        return aligned::aligned(&labelled, &layers).ok_or(no_solution(&moire, &layers));
    };
    let covariance = covariance(&solution, &labelled, &layers).ok_or(no_area(&labelled.lattice))?;
    // θ = 0 at the very edge of what strain can do: nothing limits its error there.
    if covariance.iter().any(|x| !x.is_finite()) {
        return Err(no_solution(&moire, &layers));
    }
    Ok(TwistStrain {
        twist: solution.twist,
        lattice_angle: reduce(solution.lattice_angle, layers.period),
        strain_vector: Vector2::new(solution.strain_vector.re, solution.strain_vector.im),
        covariance,
    })
}

/// θ > 0 and ε ≥ 0, or ε ≤ 0 where only that explains a moiré of different layers.
pub(super) fn default_solution(moire: &ComplexPair, layers: &Layers) -> Option<Solution> {
    default_signs(layers)
        .iter()
        .find_map(|signs| solve(moire, layers, *signs))
}

/// The signs of the default solution, in order of preference: for similar layers of one size there is but
/// one choice.
pub(super) fn default_signs(layers: &Layers) -> &'static [Signs] {
    if layers.ratio() == Some(1.0) {
        &ALL_SIGNS[..1]
    } else {
        &ALL_SIGNS[..2]
    }
}

/// Covariance of `(θ, α, E₁, E₂)` of a solution.
fn covariance(solution: &Solution, labelled: &Labelled, layers: &Layers) -> Option<Matrix4<f64>> {
    let moire = ComplexPair::from(labelled.moire);
    let by_lattice = moire_matrix_jacobian(&labelled.lattice.basis, &labelled.moire)?;
    let jacobian: Matrix4<f64> = solution.jacobian(&moire, layers) * by_lattice;
    Some(jacobian * labelled.lattice.covariance * jacobian.transpose())
}

/// All exact solutions for layer 2 (`stretched`) on layer 1 (`reference`), which may differ.
///
/// The first one has θ > 0 and ε ≥ 0, if there is such a one. For different layers those of different
/// sign of strain have twists that differ at first order: look at all of them.
///
/// # Errors
/// As [`twist_strain`]; where some of the solutions exist they are returned. Aligned layers whose moiré is
/// too large for any exact solution have none.
pub fn branches(
    lattice: &LatticeVectors,
    reference: &Material,
    stretched: &Material,
    convention: StrainConvention,
) -> Result<Vec<Branch>, StrainError> {
    let bilayer = Bilayer {
        reference,
        stretched,
    };
    let layers = Layers::new(bilayer, convention)?;
    let labelled = labelled(lattice, &layers)?;
    let moire = ComplexPair::from(labelled.moire);
    // Lattices that are not hexagonal have names of nearly equal strain, too.
    if layers.ratio().is_none() || !layers.are_hexagonal() {
        return branches_by_trial(lattice, &layers);
    }
    let mut found = solutions(&labelled, &layers, false);
    if moire.q.norm() > MIRRORED_FROM * moire.p.norm() {
        let swap = Matrix2::new(0.0, 1.0, 1.0, 0.0);
        let lattice = labelled.lattice.relabelled(&swap);
        let moire = moire_matrix(&lattice.basis, &layers.atoms).ok_or(no_area(&lattice))?;
        found.extend(solutions(&Labelled { lattice, moire }, &layers, true));
    }
    if found.is_empty() {
        return Err(no_solution(&moire, &layers));
    }
    Ok(found)
}

/// The solutions for layers of different or not hexagonal lattices under every likely name, the least strained first.
fn branches_by_trial(
    lattice: &LatticeVectors,
    layers: &Layers,
) -> Result<Vec<Branch>, StrainError> {
    let mut found: Vec<Branch> = Vec::new();
    for lattice in likely_names(lattice, layers).ok_or(no_area(lattice))? {
        let moire = moire_matrix(&lattice.basis, &layers.atoms).ok_or(no_area(&lattice))?;
        for branch in solutions(&Labelled { lattice, moire }, layers, false) {
            let apart = |a: f64, b: f64, period: f64| {
                let between = (a - b).rem_euclid(period);
                between.min(period - between)
            };
            // Readings of one twist and strain may differ in their orientation.
            let same = |b: &Branch| {
                (b.twist - branch.twist).abs() + (b.strain - branch.strain).abs() < 1e-9
                    && apart(b.lattice_angle, branch.lattice_angle, layers.period) < 1e-6
                    && apart(b.axis_lab, branch.axis_lab, PI) * branch.strain.abs() < 1e-9
            };
            if branch.strain.abs() < LIKELY_STRAIN && !found.iter().any(same) {
                found.push(branch);
            }
        }
    }
    found.sort_by(|a, b| {
        let key = |b: &Branch| (b.twist < 0.0, b.strain.abs());
        let ((back_a, strain_a), (back_b, strain_b)) = (key(a), key(b));
        back_a.cmp(&back_b).then(strain_a.total_cmp(&strain_b))
    });
    let mut listed = [0; 2];
    found.retain(|branch| {
        let count = &mut listed[usize::from(branch.twist < 0.0)];
        *count += 1;
        *count <= LISTED
    });
    let first = labelled(lattice, layers)?;
    if found.is_empty() {
        return Err(no_solution(&ComplexPair::from(first.moire), layers));
    }
    Ok(found)
}

fn solutions(labelled: &Labelled, layers: &Layers, strain_dominated: bool) -> Vec<Branch> {
    let moire = ComplexPair::from(labelled.moire);
    ALL_SIGNS
        .into_iter()
        .flat_map(|signs| solve_all(&moire, layers, signs))
        .map(|solution| {
            let covariance = covariance(&solution, labelled, layers);
            branch(&solution, covariance.as_ref(), layers, strain_dominated)
        })
        .collect()
}

fn branch(
    solution: &Solution,
    covariance: Option<&Matrix4<f64>>,
    layers: &Layers,
    strain_dominated: bool,
) -> Branch {
    let lattice_angle = reduce(solution.lattice_angle, layers.period);
    let e = Vector2::new(solution.strain_vector.re, solution.strain_vector.im);
    let along = if e.norm() > 0.0 {
        e / e.norm()
    } else {
        Vector2::x()
    };
    let sigma = |variance: Option<f64>| {
        let known = variance.filter(|v| v.is_finite());
        known.map_or(f64::NAN, |v| v.max(0.0).sqrt())
    };
    Branch {
        twist: solution.twist,
        lattice_angle,
        strain: solution.strain,
        axis_lattice: reduce(solution.axis_lab - lattice_angle - solution.twist, PI),
        axis_lab: reduce(solution.axis_lab, PI),
        strain_dominated,
        twist_sigma: sigma(covariance.map(|c| c[(0, 0)])),
        strain_sigma: sigma(
            covariance.map(|c| (along.transpose() * c.fixed_view::<2, 2>(2, 2) * along)[0]),
        ),
    }
}

/// The least strained name of a lattice, once its numbers are known to be finite.
pub(super) fn labelled(lattice: &LatticeVectors, layers: &Layers) -> Result<Labelled, StrainError> {
    let finite = |values: &[f64]| values.iter().all(|x| x.is_finite());
    if !finite(lattice.basis.as_slice()) || !finite(lattice.covariance.as_slice()) {
        return Err(StrainError::NotFinite {
            basis: lattice.flat().into(),
        });
    }
    let lattice = least_strained(lattice, layers).ok_or(no_area(lattice))?;
    let moire = moire_matrix(&lattice.basis, &layers.atoms).ok_or(no_area(&lattice))?;
    Ok(Labelled { lattice, moire })
}

fn no_area(lattice: &LatticeVectors) -> StrainError {
    StrainError::NoArea {
        area: lattice.basis.determinant(),
    }
}

fn no_solution(moire: &ComplexPair, layers: &Layers) -> StrainError {
    StrainError::NoSolution {
        lattice_constant_nm: layers.atoms.column(1).norm(),
        isotropic: moire.p.norm(),
        anisotropic: moire.q.norm(),
    }
}
