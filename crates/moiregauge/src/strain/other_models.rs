//! What other assumptions make of the same moiré: twist, orientation and strain vector.
//!
//! One moiré holds four numbers. That only layer 2 is strained, that there is no isotropic strain but
//! the one that uniaxial strain brings with it, and the Poisson ratio are assumptions. These functions
//! return by how much `(θ, α, E₁, E₂)` (rad, no dimension) change where another one is made.

use nalgebra::{Complex, Vector4};

use super::closed_form::{DEFAULT_SIGNS, labelled, layers};
use super::complex_pair::ComplexPair;
use super::inversion::{Layers, Solution, solve, wrap};
use crate::lattice::LatticeVectors;
use crate::material::Material;
use crate::settings::StrainConvention;

/// The moiré of a lattice and what it means by default.
pub(crate) struct Reference {
    moire: ComplexPair,
    layers: Layers,
    solution: Solution,
}

impl Reference {
    /// `None` where [`super::twist_strain`] finds nothing.
    pub(crate) fn new(
        lattice: &LatticeVectors,
        material: &Material,
        convention: StrainConvention,
    ) -> Option<Self> {
        let layers = layers(material, material, convention).ok()?;
        let moire = ComplexPair::from(labelled(lattice, material).ok()?.moire);
        let solution = solve(&moire, &layers, DEFAULT_SIGNS)?;
        Some(Self {
            moire,
            layers,
            solution,
        })
    }

    /// The Poisson ratio is larger by `change`.
    pub(crate) fn with_poisson_ratio(&self, change: f64) -> Option<Vector4<f64>> {
        let poisson_ratio = self.layers.poisson_ratio + change;
        self.with(&Layers {
            poisson_ratio,
            ..self.layers
        })
    }

    /// Layer 2 is stretched by `strain` in all directions beside its uniaxial strain.
    ///
    /// The same as a larger lattice constant of layer 2. With η the isotropic stretch in all, θ² + η²
    /// stays what it is (exactly: `|(1+η) e^{iθ} − 1|`), and α turns by η/θ.
    pub(crate) fn with_isotropic_strain(&self, strain: f64) -> Option<Vector4<f64>> {
        let ratio = self.layers.ratio / (1.0 + strain);
        self.with(&Layers {
            ratio,
            ..self.layers
        })
    }

    /// Both layers share the strain in equal parts with opposite signs.
    ///
    /// Then `M = R(α')[2 sin(θ/2) 𝒥 + cos(θ/2) E] G` with 𝒥 = R(90°) and α' the mean orientation: the
    /// size of the strain stays, θ changes by θ ε (1−ν)/4 and the axis in the laboratory by θ/4. With
    /// all strain in layer 1, or with compression across in place of tension along, θ changes by twice
    /// as much.
    pub(crate) fn with_shared_strain(&self) -> Option<Vector4<f64>> {
        let nu = self.layers.poisson_ratio;
        let (p, q) = (self.moire.p, self.moire.q);
        let isotropic = (1.0 - nu) / (1.0 + nu) * q.norm();
        let sine = (p.norm_sqr() - isotropic * isotropic).sqrt() / 2.0;
        // NaN for a moiré that only strain can make.
        if !(sine <= 1.0) {
            return None;
        }
        let twist = 2.0 * sine.asin();
        // E of reciprocal vectors is compression where that of atoms is tension.
        let side = match self.layers.convention {
            StrainConvention::RealSpace => -1.0,
            StrainConvention::KSpace => 1.0,
        };
        let middle = p.arg() - Complex::new(side * isotropic, 2.0 * sine).arg();
        let default = self.solution.lattice_angle + self.solution.twist;
        let strain = self.solution.strain_vector * Complex::cis(middle - default);
        Some(self.change(twist, middle - twist / 2.0, strain))
    }

    fn with(&self, layers: &Layers) -> Option<Vector4<f64>> {
        let other = solve(&self.moire, layers, DEFAULT_SIGNS)?;
        Some(self.change(other.twist, other.lattice_angle, other.strain_vector))
    }

    fn change(&self, twist: f64, lattice_angle: f64, strain: Complex<f64>) -> Vector4<f64> {
        let turned = wrap(lattice_angle - self.solution.lattice_angle);
        let difference = strain - self.solution.strain_vector;
        Vector4::new(
            twist - self.solution.twist,
            turned,
            difference.re,
            difference.im,
        )
    }
}
