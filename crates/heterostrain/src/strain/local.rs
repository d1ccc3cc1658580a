//! Twist and strain of lattices that are nearly the same: one labelling and one branch for all.
//!
//! What is chosen for a mean lattice (names of vectors, signs) is kept for every other, so that maps and
//! draws do not jump between equivalent answers.

use nalgebra::{Matrix2, Vector2};

use crate::complex_pair::ComplexPair;
use crate::lattice::vectors::Lattice;
use crate::material::Bilayer;
use crate::strain::closed_form::{default_signs, labelled};
use crate::strain::convention::StrainConvention;
use crate::strain::error::StrainError;
use crate::strain::inversion::{Signs, reduce, solve, wrap};
use crate::strain::labelling::{moire_matrix, moire_matrix_jacobian};
use crate::strain::layers::Layers;
use crate::strain::twist_strain::TwistStrain;

/// A labelling and a branch.
#[derive(Clone, Debug)]
pub struct FixedBranch {
    pub(crate) layers: Layers,
    pub(crate) signs: Signs,
    /// From the names of the reference to the least strained ones.
    pub(crate) change: Matrix2<f64>,
    /// α of the reference as the equation has it, and as it is reported.
    angle: [f64; 2],
}

impl FixedBranch {
    /// The default solution of `reference` (nm), for lattices whose vectors have the same names.
    ///
    /// # Errors
    /// As [`crate::strain::twist_strain`].
    pub fn of<'a>(
        reference: &Lattice,
        bilayer: impl Into<Bilayer<'a>>,
        convention: StrainConvention,
    ) -> Result<Self, StrainError> {
        let layers = Layers::new(bilayer.into(), convention)?;
        let named = labelled(reference, &layers)?;
        let no_area = StrainError::NoArea {
            area: reference.basis.determinant(),
        };
        let inverse = reference.basis.try_inverse().ok_or(no_area)?;
        let moire = ComplexPair::from(named.moire);
        let mut solutions = default_signs(&layers)
            .iter()
            .filter_map(|signs| Some((*signs, solve(&moire, &layers, *signs)?)));
        let (signs, solution) = solutions.next().ok_or(StrainError::NoSolution {
            lattice_constant_nm: layers.atoms.column(1).norm(),
            isotropic: moire.p.norm(),
            anisotropic: moire.q.norm(),
        })?;
        Ok(Self {
            layers,
            signs,
            change: (inverse * named.lattice.basis).map(f64::round),
            angle: [
                solution.lattice_angle,
                reduce(solution.lattice_angle, layers.period),
            ],
        })
    }

    /// Twist and strain of a lattice; `None` if there is no such solution. α is near that of the reference
    /// and may lie outside [0, 60°).
    pub fn at(&self, lattice: &Lattice) -> Option<TwistStrain> {
        let lattice = lattice.relabelled(&self.change);
        let moire = moire_matrix(&lattice.basis, &self.layers.atoms)?;
        let by_lattice = moire_matrix_jacobian(&lattice.basis, &moire)?;
        let moire = ComplexPair::from(moire);
        let solution = solve(&moire, &self.layers, self.signs)?;
        let jacobian = solution.jacobian(&moire, &self.layers) * by_lattice;
        let covariance = jacobian * lattice.covariance * jacobian.transpose();
        covariance
            .iter()
            .all(|x| x.is_finite())
            .then(|| TwistStrain {
                twist: solution.twist,
                lattice_angle: self.angle[1] + wrap(solution.lattice_angle - self.angle[0]),
                strain_vector: Vector2::new(solution.strain_vector.re, solution.strain_vector.im),
                covariance,
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::Material;
    use crate::strain::twist_strain;
    use nalgebra::Matrix4;

    /// The fixed branch agrees with the general solution of a neighbouring lattice.
    #[test]
    fn neighbours_have_the_general_solution() {
        let material = Material::graphene();
        let convention = StrainConvention::RealSpace;
        let lattice = |stretch: f64| {
            Lattice::new(
                Matrix2::new(-2.888 + stretch, -8.552, 13.756, -8.753),
                Matrix4::identity() * 1e-6,
            )
        };
        // Another name of the same lattice.
        let names = Matrix2::new(1.0, 1.0, 0.0, 1.0);
        let branch =
            FixedBranch::of(&lattice(0.0).relabelled(&names), &material, convention).unwrap();
        let found = branch.at(&lattice(0.3).relabelled(&names)).unwrap();
        let general = twist_strain(&lattice(0.3), &material, convention).unwrap();
        assert!((found.twist - general.twist).abs() < 1e-12);
        assert!((found.strain_vector - general.strain_vector).norm() < 1e-12);
        assert!((found.covariance - general.covariance).norm() < 1e-9 * general.covariance.norm());
    }
}
