//! What other assumptions make of the same moiré: twist, orientation and strain vector.
//!
//! One moiré holds four numbers. That only layer 2 is strained, that there is no isotropic strain but
//! the one that uniaxial strain brings with it, and the Poisson ratio are assumptions. These functions
//! return by how much `(θ, α, E₁, E₂)` (rad, no dimension) change where another one is made.

use nalgebra::{Complex, Vector4};

use crate::complex_pair::ComplexPair;
use crate::lattice::vectors::Lattice;
use crate::material::Bilayer;
use crate::strain::closed_form::labelled;
use crate::strain::convention::StrainConvention;
use crate::strain::inversion::{ALL_SIGNS, Signs, Solution, solve, wrap};
use crate::strain::layers::Layers;

/// The moiré of a lattice and what it means by default.
pub struct Reference {
    moire: ComplexPair,
    layers: Layers,
    signs: Signs,
    solution: Solution,
}

impl Reference {
    /// `None` where [`crate::strain::twist_strain`] finds nothing.
    pub fn new(
        lattice: &Lattice,
        bilayer: Bilayer<'_>,
        convention: StrainConvention,
    ) -> Option<Self> {
        Self::both(lattice, bilayer, convention).into_iter().next()
    }

    /// The default solution, and that with the other sign of the strain; those that there are.
    pub fn both(
        lattice: &Lattice,
        bilayer: Bilayer<'_>,
        convention: StrainConvention,
    ) -> Vec<Self> {
        let Ok(layers) = Layers::new(bilayer, convention) else {
            return Vec::new();
        };
        let Ok(labelled) = labelled(lattice, &layers) else {
            return Vec::new();
        };
        let moire = ComplexPair::from(labelled.moire);
        let reading = |signs: &Signs| {
            Some(Self {
                moire,
                layers,
                signs: *signs,
                solution: solve(&moire, &layers, *signs)?,
            })
        };
        ALL_SIGNS[..2].iter().filter_map(reading).collect()
    }

    /// θ, rad.
    pub fn twist(&self) -> f64 {
        self.solution.twist
    }

    /// The Poisson ratio is larger by `change`.
    pub fn with_poisson_ratio(&self, change: f64) -> Option<Vector4<f64>> {
        let poisson_ratio = self.layers.poisson_ratio + change;
        self.with(
            &self.moire,
            &Layers {
                poisson_ratio,
                ..self.layers
            },
        )
    }

    /// The lattice constants of layers 1 and 2 are larger by these fractions.
    pub fn with_lattice_constants(&self, [first, second]: [f64; 2]) -> Option<Vector4<f64>> {
        let moire = self.moire.scaled(1.0 + first);
        let inverse = self.layers.inverse.scaled((1.0 + second) / (1.0 + first));
        self.with(
            &moire,
            &Layers {
                inverse,
                ..self.layers
            },
        )
    }

    /// Layer 2 is stretched by `strain` in all directions beside its uniaxial strain.
    ///
    /// The same as a larger lattice constant of layer 2. With η the isotropic stretch in all, θ² + η²
    /// stays what it is (exactly: `|(1+η) e^{iθ} − 1|`), and α turns by η/θ.
    pub fn with_isotropic_strain(&self, strain: f64) -> Option<Vector4<f64>> {
        let inverse = self.layers.inverse.scaled(1.0 + strain);
        self.with(
            &self.moire,
            &Layers {
                inverse,
                ..self.layers
            },
        )
    }

    /// Both layers share the strain in equal parts with opposite signs.
    ///
    /// Then `M = R(α')[2 sin(θ/2) 𝒥 + cos(θ/2) E] G` with 𝒥 = R(90°) and α' the mean orientation: the
    /// size of the strain stays, θ changes by θ ε (1−ν)/4 and the axis in the laboratory by θ/4. With
    /// all strain in layer 1, or with compression across in place of tension along, θ changes by twice
    /// as much.
    pub fn with_shared_strain(&self) -> Option<Vector4<f64>> {
        if self.layers.ratio() != Some(1.0) {
            return Some(self.with_strain_in_the_other_layer()? / 2.0);
        }
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

    /// All strain is in layer 1: the solution for the layers with names exchanged.
    fn with_strain_in_the_other_layer(&self) -> Option<Vector4<f64>> {
        let (layers, moire) = self.layers.exchanged(&self.moire)?;
        let signs = Signs {
            strain: -self.signs.strain,
            twist: -self.signs.twist,
        };
        let other = solve(&moire, &layers, signs)?;
        let lattice_angle = other.lattice_angle + other.twist;
        Some(self.change(-other.twist, lattice_angle, -other.strain_vector))
    }

    fn with(&self, moire: &ComplexPair, layers: &Layers) -> Option<Vector4<f64>> {
        let other = solve(moire, layers, self.signs)?;
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
