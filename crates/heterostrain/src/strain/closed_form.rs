//! One moiré lattice → twist angle, heterostrain, orientation; the default solution and all others.
//!
//! In: lattice vectors (nm) with covariance, the layers, the form of the strain equation. Out:
//! rad, no dimension. The moiré alone leaves open: the sign of θ, the sign of ε (tension along one
//! axis or compression across it, θ differing by |ε|(1−ν)/2 of itself, or at first order where the
//! layers differ), α modulo the symmetry of layer 1, and any isotropic strain, which is taken as the
//! one that uniaxial strain brings with it.

use std::f64::consts::PI;

use nalgebra::{Matrix2, Matrix4, Vector2};

use crate::complex_pair::ComplexPair;
use crate::lattice::vectors::Lattice;
use crate::material::{Bilayer, Material};
use crate::strain::aligned;
use crate::strain::convention::StrainConvention;
use crate::strain::error::StrainError;
use crate::strain::inversion::{ALL_SIGNS, Signs, Solution, reduce, solve, solve_all};
use crate::strain::labelling::{least_strained, likely_names, moire_matrix, moire_matrix_jacobian};
use crate::strain::layers::Layers;
use crate::strain::names::{Labelled, LatticeName, all_names, change_to};
use crate::strain::twist_strain::TwistStrain;

/// Above this |q|/|p| the mirrored labelling (strain makes the moiré, twist distorts it) is listed. Half and twice as
/// much change no result of docs/constants.md.
const MIRRORED_FROM: f64 = 0.3;
/// Solutions of layers of different, dissimilar lattices that need more strain are not listed: three times the per
/// cent that layers rarely reach.
const LIKELY_STRAIN: f64 = 0.03;
/// Solutions of such layers that are listed for either sense of the twist, the least strained ones: what a table can
/// show.
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
    /// Which waves of the lattice are those of the atoms.
    pub name: LatticeName,
}

/// All exact solutions up to a strain.
#[derive(Clone, Debug, PartialEq)]
pub struct Solutions {
    /// The default one and those of its name first.
    pub branches: Vec<Branch>,
    /// The strain up to which there are no others.
    pub complete_to: f64,
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
    lattice: &Lattice,
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
pub(crate) fn default_solution(moire: &ComplexPair, layers: &Layers) -> Option<Solution> {
    default_signs(layers)
        .iter()
        .find_map(|signs| solve(moire, layers, *signs))
}

/// The signs of the default solution, in order of preference: for similar layers of one size there is but
/// one choice.
pub(crate) fn default_signs(layers: &Layers) -> &'static [Signs] {
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
    lattice: &Lattice,
    reference: &Material,
    stretched: &Material,
    convention: StrainConvention,
) -> Result<Vec<Branch>, StrainError> {
    let bilayer = Bilayer {
        reference,
        stretched,
        waves: None,
    };
    Ok(solutions(lattice, bilayer, convention)?.branches)
}

/// All exact solutions for two layers, under every name of the lattice.
///
/// Those of the default name come first, whatever their strain; where |q| > 0.3 |p| with them those of the mirrored
/// name. The other names follow, the least strained first, with strains up to `complete_to`. For layers of dissimilar
/// lattices the search ends at vectors whose names have numbers up to 5.
///
/// # Errors
/// As [`branches`].
pub fn solutions<'a>(
    lattice: &Lattice,
    bilayer: impl Into<Bilayer<'a>>,
    convention: StrainConvention,
) -> Result<Solutions, StrainError> {
    let layers = Layers::new(bilayer.into(), convention)?;
    let first = labelled(lattice, &layers)?;
    let moire = ComplexPair::from(first.moire);
    if layers.ratio().is_none() {
        return branches_by_trial(lattice, &layers);
    }
    let mut found = solutions_of(&first, &layers, first.name);
    let mut known = vec![first.name];
    if moire.q.norm() > MIRRORED_FROM * moire.p.norm() {
        let swap = Matrix2::new(0.0, 1.0, 1.0, 0.0);
        let mirrored = first.lattice.relabelled(&swap);
        let mirrored = under_name(lattice, mirrored, &layers).ok_or(no_area(lattice))?;
        known.push(mirrored.name);
        found.extend(solutions_of(&mirrored, &layers, mirrored.name));
    }
    let mut complete_to = 0.0;
    if let Some((names, bound)) = all_names(lattice, &layers) {
        complete_to = bound;
        for name in names.into_iter().filter(|name| !known.contains(name)) {
            let named = name.change().map(|change| lattice.relabelled(&change));
            let named = named.and_then(|named| under_name(lattice, named, &layers));
            let named = named.ok_or(no_area(lattice))?;
            let all = solutions_of(&named, &layers, name);
            found.extend(all.into_iter().filter(|b| b.strain.abs() <= bound));
        }
    }
    if found.is_empty() {
        return Err(no_solution(&moire, &layers));
    }
    Ok(Solutions {
        branches: found,
        complete_to,
    })
}

/// The solutions for layers of dissimilar lattices under every likely name, the least strained first.
fn branches_by_trial(lattice: &Lattice, layers: &Layers) -> Result<Solutions, StrainError> {
    let mut found: Vec<Branch> = Vec::new();
    for named in likely_names(lattice, layers).ok_or(no_area(lattice))? {
        let named = under_name(lattice, named, layers).ok_or(no_area(lattice))?;
        for mut branch in solutions_of(&named, layers, named.name) {
            branch.strain_dominated = false;
            let apart = |a: f64, b: f64, period: f64| {
                let between = (a - b).rem_euclid(period);
                between.min(period - between)
            };
            // Solutions of one twist and strain may differ in their orientation.
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
    let mut complete_to = LIKELY_STRAIN;
    found.retain(|branch| {
        let count = &mut listed[usize::from(branch.twist < 0.0)];
        *count += 1;
        if *count > LISTED {
            complete_to = complete_to.min(branch.strain.abs());
        }
        *count <= LISTED
    });
    let first = labelled(lattice, layers)?;
    if found.is_empty() {
        return Err(no_solution(&ComplexPair::from(first.moire), layers));
    }
    Ok(Solutions {
        branches: found,
        complete_to,
    })
}

/// The solutions of one name.
fn solutions_of(labelled: &Labelled, layers: &Layers, name: LatticeName) -> Vec<Branch> {
    let strain_dominated = labelled.moire.determinant() < 0.0;
    let moire = ComplexPair::from(labelled.moire);
    ALL_SIGNS
        .into_iter()
        .flat_map(|signs| solve_all(&moire, layers, signs))
        .map(|solution| {
            let covariance = covariance(&solution, labelled, layers);
            let found = branch(&solution, covariance.as_ref(), layers, name);
            Branch {
                strain_dominated,
                ..found
            }
        })
        .collect()
}

fn branch(
    solution: &Solution,
    covariance: Option<&Matrix4<f64>>,
    layers: &Layers,
    name: LatticeName,
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
        strain_dominated: false,
        name,
        twist_sigma: sigma(covariance.map(|c| c[(0, 0)])),
        strain_sigma: sigma(
            covariance.map(|c| (along.transpose() * c.fixed_view::<2, 2>(2, 2) * along)[0]),
        ),
    }
}

/// The name of a lattice that was given, or the least strained one, once its numbers are known to be finite.
pub(crate) fn labelled(lattice: &Lattice, layers: &Layers) -> Result<Labelled, StrainError> {
    let finite = |values: &[f64]| values.iter().all(|x| x.is_finite());
    if !finite(lattice.basis.as_slice()) || !finite(lattice.covariance.as_slice()) {
        return Err(StrainError::NotFinite {
            basis: lattice.flat().into(),
        });
    }
    let given = layers
        .waves
        .and_then(|waves| change_to(&lattice.basis, &waves));
    let named = match given {
        Some(change) => lattice.relabelled(&change),
        None => least_strained(lattice, layers).ok_or(no_area(lattice))?,
    };
    under_name(lattice, named, layers).ok_or(no_area(lattice))
}

/// A lattice under the name of `named`.
fn under_name(lattice: &Lattice, named: Lattice, layers: &Layers) -> Option<Labelled> {
    Some(Labelled {
        name: LatticeName::of(&lattice.basis, &named.basis, layers)?,
        moire: moire_matrix(&named.basis, &layers.atoms)?,
        lattice: named,
    })
}

fn no_area(lattice: &Lattice) -> StrainError {
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
