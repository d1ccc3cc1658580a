//! Monte Carlo of twist and strain: correlated draws of the lattice through the closed form.
//!
//! The check on the analytic covariance, and what the paper quotes (1,000 draws per scan).

use nalgebra::{Matrix4, SymmetricEigen, Vector2, Vector4};
use rand_distr::{Distribution, StandardNormal};

use super::closed_form::{default_signs, labelled};
use super::complex_pair::ComplexPair;
use super::inversion::{reduce, solve, wrap};
use super::labelling::moire_matrix;
use super::layers::Layers;
use crate::analysis::StrainDraw;
use crate::lattice::LatticeVectors;
use crate::material::Bilayer;
use crate::rng;
use crate::settings::StrainConvention;

/// `count` draws of twist, orientation and strain for a lattice with its covariance.
///
/// Names of vectors and signs stay those of the estimate, so α never jumps by 60°. Draws without a
/// solution are left out (fewer come back than were asked for); none come back for a lattice that
/// [`super::twist_strain`] refuses. `seed` and `index` (of the scan) fix every digit.
pub fn draws<'a>(
    lattice: &LatticeVectors,
    bilayer: impl Into<Bilayer<'a>>,
    convention: StrainConvention,
    count: usize,
    seed: u64,
    index: u64,
) -> Vec<StrainDraw> {
    let Ok(layers) = Layers::new(bilayer.into(), convention) else {
        return Vec::new();
    };
    let Ok(labelled) = labelled(lattice, &layers) else {
        return Vec::new();
    };
    let lattice = labelled.lattice;
    let moire = ComplexPair::from(labelled.moire);
    let found = default_signs(&layers)
        .iter()
        .find_map(|signs| Some((*signs, solve(&moire, &layers, *signs)?)));
    let Some((signs, centre)) = found else {
        return Vec::new();
    };
    let reported_angle = reduce(centre.lattice_angle, layers.period);
    let root = root(&lattice.covariance);
    let mut rng = rng::stream(seed, "strain", index);
    let mut normal = move || -> f64 { StandardNormal.sample(&mut rng) };
    (0..count)
        .filter_map(|_| {
            let white = Vector4::from_fn(|_, _| normal());
            let moved = lattice.flat() + root * white;
            let basis = nalgebra::Matrix2::from_column_slice(moved.as_slice());
            let moire = moire_matrix(&basis, &layers.atoms)?;
            let solution = solve(&ComplexPair::from(moire), &layers, signs)?;
            Some(StrainDraw {
                twist: solution.twist,
                lattice_angle: reported_angle + wrap(solution.lattice_angle - centre.lattice_angle),
                strain_vector: Vector2::new(solution.strain_vector.re, solution.strain_vector.im),
            })
        })
        .collect()
}

/// A matrix whose square is the covariance; rounding may have left eigenvalues slightly negative.
fn root(covariance: &Matrix4<f64>) -> Matrix4<f64> {
    let eigen = SymmetricEigen::new((covariance + covariance.transpose()) / 2.0);
    let roots = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
    eigen.eigenvectors * Matrix4::from_diagonal(&roots) * eigen.eigenvectors.transpose()
}
