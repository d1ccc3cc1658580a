//! Which moiré vector belongs to which atomic vector: lattice vectors → strain-free-most labelling.
//!
//! The measured primitive pair `L = [a₁ a₂]` is matched with the atomic pair `A⁰` of layer 1, for a
//! hexagonal layer `a [∠30°, ∠90°]`, whose reciprocal pair lies at 0° and 120°; α is then the
//! orientation of the reciprocal vectors of layer 1. With `M = 2π L⁻ᵀ` the first moiré harmonics,
//! `P = M (G⁰)⁻¹ = (A⁰ L⁻¹)ᵀ` has no dimension and needs no 2π.
//!
//! Every other primitive pair of the same lattice, `L U` with U in SL(2, Z), is as good a name for
//! it. For similar layers the one with the smallest anisotropic part |q| of P is used where nothing tells more; as the
//! determinant is fixed by the area of the cell, it is, for hexagonal layers, the pair with the shortest
//! reciprocal vectors. For layers of different lattices it is the one that needs the least strain. From ε ≈ 0.46 θ on
//! the true pair can be another one: all of them are in `names`, and what chooses among them in `readings`.

use nalgebra::{Matrix2, Matrix4, Vector4};

use crate::complex_pair::ComplexPair;
use crate::lattice::reduce::{same_handed, shortest_pair};
use crate::lattice::renamings;
use crate::lattice::vectors::Lattice;
use crate::strain::inversion::{ALL_SIGNS, solve};
use crate::strain::layers::Layers;

/// Largest number in the name of a moiré vector that is tried for layers of different lattices. Chosen by eye.
const LARGEST_ENTRY: i32 = 5;
/// How many of these names are solved: more than are listed. Chosen by eye.
const SOLVED: usize = 32;
/// Orientations at which names are compared. Chosen by eye.
const ORIENTATIONS: i32 = 180;

/// `P = (A⁰ L⁻¹)ᵀ`; `None` for a lattice without area.
pub(crate) fn moire_matrix(basis: &Matrix2<f64>, atoms: &Matrix2<f64>) -> Option<Matrix2<f64>> {
    let inverse = basis.try_inverse()?;
    let p = (atoms * inverse).transpose();
    p.iter().all(|x| x.is_finite()).then_some(p)
}

/// Derivative of `(Re p, Im p, Re q, Im q)` by `(a1x, a1y, a2x, a2y)`: dP = −L⁻ᵀ dLᵀ P.
pub(crate) fn moire_matrix_jacobian(
    basis: &Matrix2<f64>,
    moire: &Matrix2<f64>,
) -> Option<Matrix4<f64>> {
    let inverse_transposed = basis.try_inverse()?.transpose();
    let mut jacobian = Matrix4::zeros();
    for component in 0..4 {
        let mut unit = Matrix2::zeros();
        unit[component] = 1.0;
        let change = ComplexPair::from(-inverse_transposed * unit.transpose() * moire);
        jacobian.set_column(
            component,
            &Vector4::new(change.p.re, change.p.im, change.q.re, change.q.im),
        );
    }
    Some(jacobian)
}

/// The same lattice named by its least strained right-handed pair; `None` without area.
pub(crate) fn least_strained(lattice: &Lattice, layers: &Layers) -> Option<Lattice> {
    if layers.ratio().is_none() {
        return least_strained_by_trial(lattice, layers);
    }
    // Only the shape of the atomic cell matters.
    let atoms = layers.atoms / layers.atoms.norm();
    let anisotropy =
        |basis: &Matrix2<f64>| Some(ComplexPair::from(moire_matrix(basis, &atoms)?).q.norm());
    let mut best = *lattice;
    if best.basis.determinant() < 0.0 {
        best = best.relabelled(&Matrix2::new(0.0, 1.0, 1.0, 0.0));
    }
    let mut smallest = anisotropy(&best.basis)?;
    // Each step shortens the reciprocal vectors, so this ends; a pair from an image needs one.
    loop {
        let mut step = None;
        for change in same_handed(1) {
            let q = anisotropy(&(best.basis * change))?;
            // Turning all names by 60° changes nothing: do not follow rounding errors.
            if q < smallest * (1.0 - 1e-9) {
                smallest = q;
                step = Some(change);
            }
        }
        match step {
            Some(change) => best = best.relabelled(&change),
            None => return Some(best),
        }
    }
}

/// For layers of different lattices: the names that come nearest to an explanation without strain are
/// solved, and the one that needs the least is taken.
fn least_strained_by_trial(lattice: &Lattice, layers: &Layers) -> Option<Lattice> {
    let likely = likely_names(lattice, layers)?;
    let mut best = (f64::INFINITY, *likely.first()?);
    for named in &likely {
        let moire = ComplexPair::from(moire_matrix(&named.basis, &layers.atoms)?);
        let strain = ALL_SIGNS
            .into_iter()
            .filter_map(|signs| solve(&moire, layers, signs))
            .map(|solution| solution.strain.abs())
            .fold(f64::INFINITY, f64::min);
        if strain < best.0 * (1.0 - 1e-9) {
            best = (strain, *named);
        }
    }
    Some(best.1)
}

/// The names that come nearest to an explanation without strain, the nearest first.
pub(crate) fn likely_names(lattice: &Lattice, layers: &Layers) -> Option<Vec<Lattice>> {
    let mut scored: Vec<(f64, Lattice)> = names(lattice)?
        .into_iter()
        .filter_map(|named| {
            let moire = ComplexPair::from(moire_matrix(&named.basis, &layers.atoms)?);
            Some((least_mismatch(&moire, layers), named))
        })
        .collect();
    scored.sort_by(|a, b| a.0.total_cmp(&b.0));
    Some(scored.into_iter().take(SOLVED).map(|(_, l)| l).collect())
}

/// The least difference of N from a turn, over all orientations of layer 1.
fn least_mismatch(moire: &ComplexPair, layers: &Layers) -> f64 {
    (0..ORIENTATIONS)
        .map(|k| {
            let angle = std::f64::consts::TAU * f64::from(k) / f64::from(ORIENTATIONS);
            let n = layers.stretched(moire, angle);
            (n.p.norm() - 1.0).hypot(n.q.norm())
        })
        .fold(f64::INFINITY, f64::min)
}

/// The names of a lattice near its shortest pair, of either handedness: a moiré of different lattices can
/// be far longer one way than the other, and its cell far from the shortest one.
pub(crate) fn names(lattice: &Lattice) -> Option<Vec<Lattice>> {
    let shortest = lattice.relabelled(&shortest_pair(&lattice.basis)?);
    // Turning a name by 180° turns the orientation by as much.
    let one_of_two = |change: &Matrix2<f64>| {
        let rows = change.transpose();
        rows.iter().find(|x| **x != 0.0) > Some(&0.0)
    };
    let changes = renamings(LARGEST_ENTRY).filter(one_of_two);
    Some(changes.map(|c| shortest.relabelled(&c)).collect())
}
