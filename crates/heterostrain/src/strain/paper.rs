//! The published strain problem: twelve pairs of the six moiré vectors, 48 equations, four unknowns.
//!
//! For each vector with the next and with the next but one, `2π B⁻ᵀ = W · 2π A⁻ᵀ` with B the pair of moiré vectors,
//! A the pair of atomic vectors of the same names and `W = R(α)[R(θ)S − I]`. The 48 equations are linear in the
//! four elements of W, and every W near that of a moiré is one set of α, θ, ε and φ. So the least squares over
//! α, θ, ε and φ have their minimum where those over W have it: W comes from a linear problem, and the rest
//! from the closed form. Nothing is iterated and there is no start value.
//!
//! What the paper leaves open, and what is done here: each draw has peaks, tip velocities and a drift of its own
//! (normal distributions); where trace and retrace are used, their corrected peaks are averaged.
//!
//! # References
//! Tran et al., arXiv:2406.08681, supplementary material.

use nalgebra::{Matrix2, Vector2};

use crate::lattice::vectors::Lattice;
use crate::material::Bilayer;
use crate::strain::convention::StrainConvention;
use crate::strain::draws::{Around, StrainDraw};

/// Turns draws of six corrected moiré vectors (nm, 60° apart in order of their angle) into draws of twist and strain
/// by the 48 equations.
///
/// `lattice` is the lattice about which they were drawn: names of vectors and signs are those of its solution. Draws
/// without a solution are left out; none come back for a lattice that [`crate::strain::twist_strain`] refuses.
pub fn published_draws<'a>(
    lattice: &Lattice,
    bilayer: impl Into<Bilayer<'a>>,
    convention: StrainConvention,
    drawn: impl IntoIterator<Item = [Vector2<f64>; 6]>,
) -> Vec<StrainDraw> {
    let Some(around) = Around::new(lattice, bilayer.into(), convention) else {
        return Vec::new();
    };
    let (names, atoms) = (six(&around.lattice.basis), six(&around.layers.atoms));
    drawn
        .into_iter()
        .filter_map(|peaks| around.draw(&twelve_pairs(&in_order_of(&peaks, &names), &atoms)?))
        .collect()
}

/// A pair of vectors, their difference, and the opposites of all three.
fn six(basis: &Matrix2<f64>) -> [Vector2<f64>; 6] {
    let (first, second): (Vector2<f64>, Vector2<f64>) =
        (basis.column(0).into(), basis.column(1).into());
    let third = second - first;
    [first, second, third, -first, -second, -third]
}

/// For each name the peak nearest to it.
fn in_order_of(peaks: &[Vector2<f64>; 6], names: &[Vector2<f64>; 6]) -> [Vector2<f64>; 6] {
    names.map(|name| {
        let nearest = peaks
            .iter()
            .min_by(|a, b| (*a - name).norm().total_cmp(&(*b - name).norm()));
        *nearest.unwrap_or(&name)
    })
}

/// The least-squares W of the 48 equations; `None` where a pair has no area.
fn twelve_pairs(moire: &[Vector2<f64>; 6], atoms: &[Vector2<f64>; 6]) -> Option<Matrix2<f64>> {
    let dual = |of: &[Vector2<f64>; 6], (i, j): (usize, usize)| {
        Some(
            Matrix2::from_columns(&[of[i], of[j]])
                .try_inverse()?
                .transpose(),
        )
    };
    let (mut right, mut normal) = (Matrix2::zeros(), Matrix2::zeros());
    for pair in (0..6).flat_map(|k| [(k, (k + 1) % 6), (k, (k + 2) % 6)]) {
        let (m, g) = (dual(moire, pair)?, dual(atoms, pair)?);
        right += m * g.transpose();
        normal += g * g.transpose();
    }
    let w = right * normal.try_inverse()?;
    w.iter().all(|x| x.is_finite()).then_some(w)
}
