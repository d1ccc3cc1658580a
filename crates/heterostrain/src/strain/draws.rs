//! Monte Carlo of twist and strain: correlated draws of the lattice through the closed form.
//!
//! The check on the analytic covariance, and what the paper quotes (1,000 draws per scan).

use nalgebra::{Matrix2, Matrix4, SymmetricEigen, Vector2, Vector4};

use crate::complex_pair::ComplexPair;
use crate::lattice::vectors::Lattice;
use crate::material::Bilayer;
use crate::strain::closed_form::{default_signs, labelled};
use crate::strain::convention::StrainConvention;
use crate::strain::inversion::{Signs, reduce, solve, wrap};
use crate::strain::labelling::moire_matrix;
use crate::strain::layers::Layers;

/// `count` draws of twist, orientation and strain for a lattice with its covariance.
///
/// Names of vectors and signs stay those of the estimate, so α never jumps by 60°. Draws without a
/// solution are left out (fewer come back than were asked for); none come back for a lattice that
/// [`crate::strain::twist_strain`] refuses. `normal` gives independent
/// numbers of the standard normal distribution; it fixes every digit.
pub fn draws<'a>(
    lattice: &Lattice,
    bilayer: impl Into<Bilayer<'a>>,
    convention: StrainConvention,
    count: usize,
    mut normal: impl FnMut() -> f64,
) -> Vec<StrainDraw> {
    let Some(around) = Around::new(lattice, bilayer.into(), convention) else {
        return Vec::new();
    };
    let lattice = around.lattice;
    let root = root(&lattice.covariance);
    (0..count)
        .filter_map(|_| {
            let white = Vector4::from_fn(|_, _| normal());
            let moved = lattice.flat() + root * white;
            let basis = Matrix2::from_column_slice(moved.as_slice());
            around.draw(&moire_matrix(&basis, &around.layers.atoms)?)
        })
        .collect()
}

/// The solution about which is drawn: names of vectors and signs of the draws are its own.
pub(crate) struct Around {
    pub(crate) layers: Layers,
    /// The lattice under the names of the solution.
    pub(crate) lattice: Lattice,
    signs: Signs,
    /// α of the solution, and as it is reported.
    lattice_angle: [f64; 2],
}

impl Around {
    /// `None` for a lattice without a solution.
    pub(crate) fn new(
        lattice: &Lattice,
        bilayer: Bilayer<'_>,
        convention: StrainConvention,
    ) -> Option<Self> {
        let layers = Layers::new(bilayer, convention).ok()?;
        let named = labelled(lattice, &layers).ok()?;
        let moire = ComplexPair::from(named.moire);
        let (signs, centre) = default_signs(&layers)
            .iter()
            .find_map(|signs| Some((*signs, solve(&moire, &layers, *signs)?)))?;
        Some(Self {
            lattice: named.lattice,
            signs,
            lattice_angle: [
                centre.lattice_angle,
                reduce(centre.lattice_angle, layers.period),
            ],
            layers,
        })
    }

    /// Twist and strain of a drawn `P`; `None` where it has no solution.
    pub(crate) fn draw(&self, moire: &Matrix2<f64>) -> Option<StrainDraw> {
        let solution = solve(&ComplexPair::from(*moire), &self.layers, self.signs)?;
        let [centre, reported] = self.lattice_angle;
        Some(StrainDraw {
            twist: solution.twist,
            lattice_angle: reported + wrap(solution.lattice_angle - centre),
            strain_vector: Vector2::new(solution.strain_vector.re, solution.strain_vector.im),
        })
    }
}

/// A matrix whose square is the covariance; rounding may have left eigenvalues slightly negative.
fn root(covariance: &Matrix4<f64>) -> Matrix4<f64> {
    let eigen = SymmetricEigen::new((covariance + covariance.transpose()) / 2.0);
    let roots = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
    eigen.eigenvectors * Matrix4::from_diagonal(&roots) * eigen.eigenvectors.transpose()
}

/// One Monte Carlo draw of twist and strain.
#[derive(Clone, Copy, Debug)]
pub struct StrainDraw {
    /// θ, rad.
    pub twist: f64,
    /// α, rad, near the estimate (not wrapped away from it).
    pub lattice_angle: f64,
    /// `E = ε e^{2iφ_lab}`.
    pub strain_vector: Vector2<f64>,
}
