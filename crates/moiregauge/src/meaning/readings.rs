//! What one moiré lattice can mean: all solutions, what isotropic strain does to them, and the strain
//! tensor where the orientation of a layer is known.
//!
//! In: a lattice (nm) with its covariance, the settings. Out: rad, no dimension.

use heterostrain::lattice::Lattice;
use heterostrain::strain::{Branch, Degeneracy, TwistStrain, degeneracy, solutions};

use crate::meaning::budget::Budget;
use crate::meaning::naming::Naming;
use crate::meaning::strengths::WaveStrengths;
use crate::meaning::tensor::TensorReading;
use crate::settings::knobs::Settings;

/// All that a lattice can mean.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Readings {
    /// Whether the layers differ, so that twist and strain trade at first order.
    pub layers_differ: bool,
    /// Every exact solution with uniaxial strain alone, the default first; empty where only aligned layers,
    /// strained in all directions, explain the lattice.
    pub solutions: Vec<Branch>,
    /// No other solution under any name of the lattice has a strain (magnitude) up to this.
    pub complete_to: f64,
    /// The names of the lattice and the choice among them; `None` for layers of dissimilar lattices.
    pub naming: Option<Naming>,
    /// What isotropic strain does to the twist; `None` where there is no solution.
    pub degeneracy: Option<Degeneracy>,
    /// The strain tensor; `None` without an orientation.
    pub tensor: Option<TensorReading>,
}

impl Readings {
    /// Everything that the lattice of `found` can mean; `strengths` are those of its waves in the images.
    pub fn new(
        lattice: &Lattice,
        found: &TwistStrain,
        budget: &Budget,
        strengths: &WaveStrengths,
        settings: &Settings,
    ) -> Self {
        let bilayer = settings.bilayer();
        let convention = settings.strain_convention;
        let prior = settings.isotropic_strain_percent / 100.0;
        let all = AllNames::new(lattice, strengths, settings);
        Self {
            layers_differ: !bilayer.is_equal(),
            complete_to: all.complete_to,
            solutions: all.branches,
            naming: all.naming,
            degeneracy: degeneracy(lattice, bilayer, convention, found.twist(), prior),
            tensor: TensorReading::new(lattice, budget, settings),
        }
    }

    /// The solutions with θ > 0 that need no strain as large as the twist and have the reported name of the lattice:
    /// those that a user of different layers has to choose from.
    pub fn choices(&self) -> impl Iterator<Item = &Branch> {
        let name = self
            .naming
            .as_ref()
            .and_then(|naming| Some(naming.names.first()?.name));
        self.solutions.iter().filter(move |b| {
            b.twist > 0.0 && !b.strain_dominated && name.is_none_or(|name| name == b.name)
        })
    }
}

/// All solutions of a lattice with uniaxial strain alone.
pub(crate) struct AllNames {
    pub(crate) naming: Option<Naming>,
    pub(crate) complete_to: f64,
    branches: Vec<Branch>,
}

impl AllNames {
    pub(crate) fn new(lattice: &Lattice, strengths: &WaveStrengths, settings: &Settings) -> Self {
        let bilayer = settings.bilayer();
        let Ok(all) = solutions(lattice, bilayer, settings.strain_convention) else {
            return Self {
                naming: None,
                complete_to: 0.0,
                branches: Vec::new(),
            };
        };
        let hexagonal = bilayer.reference.is_hexagonal() && bilayer.stretched.is_hexagonal();
        Self {
            naming: (hexagonal || bilayer.is_equal())
                .then(|| Naming::new(lattice, &all, strengths, settings))
                .flatten(),
            complete_to: all.complete_to,
            branches: all.branches,
        }
    }
}
