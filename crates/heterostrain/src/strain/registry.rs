//! How the registry of two layers goes with the moiré they make.
//!
//! The registry d(r) is how far the atoms of layer 2 next to the place r stand from those of layer 1 (nm), up to a lattice
//! vector of layer 1. Near r layer 2 looks like layer 1 moved by d(r), so that its wave of the phase `b₂·r` is
//! `b₁·(r − d)`. The moiré has the difference, `φ_i = (b₂ − b₁)_i·r`, hence
//!
//! ```text
//! φ_i(r) = −b₁ᵢ·d(r)    d(r) = −Σ aᵢ φ_i(r)/2π = −A L⁻¹ r
//! ```
//!
//! with the atomic vectors `aᵢ` of layer 1 (columns of A), `aᵢ·b₁ⱼ = 2π δ_ij`, and the moiré vectors L of the same names. For
//! layers `a₂ = F a₁` this is `d = r − F⁻¹ r`: for a twist alone, θ ẑ × r.
//!
//! One moiré period moves the registry by one lattice vector of layer 1. What is no part of the moiré vectors stays open: where
//! d is zero, and, as the moiré knows the layers only up to their exchange, its sign, which goes with that of θ.

use nalgebra::{Matrix2, Rotation2};

use crate::complex_pair::ComplexPair;
use crate::lattice::vectors::Lattice;
use crate::strain::inversion::solve;
use crate::strain::labelling::moire_matrix;
use crate::strain::local::FixedBranch;

/// The vectors of layer 1 beside those of the moiré that belong to them.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Registry {
    /// Atomic vectors a₁, a₂ of layer 1 as columns, turned as it lies, nm.
    pub atoms: Matrix2<f64>,
    /// Moiré vectors of the same names as columns, nm: along each of them the registry changes by one vector of `atoms`.
    pub moire: Matrix2<f64>,
    /// `−A L⁻¹`: registry over way, without dimension.
    pub gradient: Matrix2<f64>,
}

impl FixedBranch {
    /// How the registry goes with a lattice (nm); `None` if there is no such solution.
    pub fn registry(&self, lattice: &Lattice) -> Option<Registry> {
        let moire = lattice.relabelled(&self.change).basis;
        let found = moire_matrix(&moire, &self.layers.atoms)?;
        let solution = solve(&ComplexPair::from(found), &self.layers, self.signs)?;
        let atoms = Rotation2::new(solution.lattice_angle).into_inner() * self.layers.atoms;
        Some(Registry {
            atoms,
            moire,
            gradient: -atoms * moire.try_inverse()?,
        })
    }
}

#[cfg(test)]
mod tests {
    use crate::lattice::vectors::Lattice;
    use crate::material::{Bilayer, Material};
    use crate::strain::convention::StrainConvention;
    use crate::strain::forward::{Stacking, moire_of, moire_pair_of};
    use crate::strain::local::FixedBranch;
    use nalgebra::{Matrix2, Vector2};

    const STACKING: Stacking = Stacking {
        twist: 0.0192,
        lattice_angle: 0.6457,
        strain: 0.003,
        axis_lattice: 0.349,
        biaxial: 0.0,
    };

    fn lattice(basis: Matrix2<f64>) -> Lattice {
        Lattice::exact(basis)
    }

    /// For layers `a₂ = F a₁` the registry is `r − F⁻¹ r`, in both forms of the equation, for equal layers and others, and
    /// whatever the moiré vectors are called.
    #[test]
    fn the_registry_is_what_one_layer_lacks_of_the_other() {
        let graphene = Material::graphene();
        let hbn = Material::named("hBN").unwrap();
        for convention in [StrainConvention::RealSpace, StrainConvention::KSpace] {
            for other in [&graphene, &hbn] {
                let layers = Bilayer {
                    reference: &graphene,
                    stretched: other,
                    waves: None,
                };
                let [first, second] = STACKING.atoms(layers, convention).unwrap();
                let f = second * first.try_inverse().unwrap();
                let truth = Matrix2::identity() - f.try_inverse().unwrap();
                let basis = moire_pair_of(&STACKING, layers, convention).unwrap();
                for names in [
                    Matrix2::identity(),
                    Matrix2::new(1.0, 1.0, 0.0, 1.0),
                    Matrix2::new(0.0, -1.0, 1.0, 1.0),
                ] {
                    let named = lattice(basis * names);
                    let branch = FixedBranch::of(&named, layers, convention).unwrap();
                    let found = branch.registry(&named).unwrap();
                    let error = (found.gradient - truth).norm();
                    assert!(error < 1e-10, "{convention:?} {}: {error}", other.name);
                    // One period is one atomic vector.
                    let steps = found.gradient * found.moire + found.atoms;
                    assert!(steps.norm() < 1e-12);
                }
            }
        }
    }

    /// The reference numbers of the closed form: layer 1 at 37°, 1.1°, 0.3 % along 20°. The waves of the moiré are those of
    /// layer 2 less those of layer 1, so that a phase of the moiré is minus a wave of layer 1 along the registry.
    #[test]
    fn phases_are_minus_the_waves_of_layer_1_along_the_registry() {
        let graphene = Material::graphene();
        let moire = Matrix2::new(-2.887_907_7, -8.552_447_4, 13.756_443_7, -8.752_641_8);
        let branch =
            FixedBranch::of(&lattice(moire), &graphene, StrainConvention::RealSpace).unwrap();
        let found = branch.registry(&lattice(moire)).unwrap();
        let tau = std::f64::consts::TAU;
        // Of layer 1: |b| = 4π/(√3 a) along 37° and 157°.
        let length = 2.0 * tau / (3.0f64.sqrt() * 0.246);
        let wave = |degrees: f64| {
            let angle = f64::to_radians(degrees);
            Vector2::new(angle.cos(), angle.sin()) * length
        };
        let (first, second) = (wave(37.0), wave(157.0));
        let place = Vector2::new(31.0, -17.0);
        let d = found.gradient * place;
        let phase = tau * found.moire.try_inverse().unwrap() * place;
        let own = tau * found.atoms.try_inverse().unwrap() * d;
        assert!((own + phase).norm() < 1e-9);
        // The atoms of the solution are layer 1 under one of its names.
        for b in [first, second] {
            let along = found.atoms.tr_mul(&b) / tau;
            assert!((along - along.map(f64::round)).norm() < 1e-5, "{along}");
        }
        // A twist alone: θ ẑ × r.
        let twisted = Stacking {
            strain: 0.0,
            ..STACKING
        };
        let layers = Bilayer::from(&graphene);
        let basis = moire_of(&twisted, layers, StrainConvention::RealSpace).unwrap();
        let branch = FixedBranch::of(&lattice(basis), layers, StrainConvention::RealSpace).unwrap();
        let gradient = branch.registry(&lattice(basis)).unwrap().gradient;
        let turned = Vector2::new(-place.y, place.x) * 2.0 * (0.5 * 0.0192f64).sin();
        let d = gradient * place;
        assert!((d.norm() - turned.norm()).abs() < 1e-12);
        assert!((d - turned).norm() < 0.02 * turned.norm());
    }
}
