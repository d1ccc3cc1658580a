//! The atomic layers: lattice constant, Poisson ratio, and where the numbers come from.

use serde::{Deserialize, Serialize};

/// A hexagonal layer. Both layers of a homobilayer are the same material.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Material {
    /// Name, as in `graphene`.
    pub name: String,
    /// Lattice constant, nm.
    pub lattice_constant_nm: f64,
    /// Poisson ratio ν: a stretch ε along an axis shrinks the layer by νε across it.
    pub poisson_ratio: f64,
    /// Where the two numbers come from.
    pub source: String,
}

impl Material {
    /// Graphene.
    pub fn graphene() -> Self {
        Self {
            name: "graphene".to_owned(),
            lattice_constant_nm: 0.246,
            poisson_ratio: 0.16,
            source: "a, ν: Blakslee et al. 1970, as used in arXiv 2406.08681".to_owned(),
        }
    }
}
