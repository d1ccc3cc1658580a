//! The atomic layers: lattice constant, Poisson ratio, and where the numbers come from.
//!
//! Hexagonal layers only; 1T′ layers such as `WTe₂` are rectangular and are not described by these
//! two numbers. The twist is proportional to the lattice constant: 0.247 in place of 0.246 nm for
//! graphene is 0.0046° at 1.126°.

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
    /// Standard uncertainty of the lattice constant, nm.
    #[serde(default = "lattice_constant_sigma")]
    pub lattice_constant_sigma_nm: f64,
    /// Standard uncertainty of the Poisson ratio.
    #[serde(default = "poisson_ratio_sigma")]
    pub poisson_ratio_sigma: f64,
    /// Where the two numbers come from.
    pub source: String,
}

/// For a layer described by the user without saying how well it is known: nm.
fn lattice_constant_sigma() -> f64 {
    0.0005
}

/// For a layer described by the user without saying how well it is known.
fn poisson_ratio_sigma() -> f64 {
    0.03
}

/// Name, a (nm), ν, uncertainties of a (nm) and ν, source. The uncertainties are those between sources:
/// graphene 0.2460 or 0.2461 nm and 0.16 or 0.19, hBN 0.2504 or 0.251 nm; where there is one source, or
/// none that is confirmed, 0.0005 nm and 0.03.
type Row = (&'static str, f64, f64, f64, f64, &'static str);

const GRAPHENE: Row = (
    "graphene",
    0.246,
    0.16,
    0.0001,
    0.03,
    "a, ν: Blakslee et al. 1970, as used in arXiv 2406.08681",
);

/// ν of a layer with the 2D moduli K and G is (K − G)/(K + G).
const OTHERS: [Row; 7] = [
    (
        "hBN",
        0.2504,
        0.21,
        0.0003,
        0.03,
        "ν: Falin et al. 2017; a: 0.251 nm is also in use",
    ),
    (
        "MoS2",
        0.3160,
        0.25,
        0.0005,
        0.03,
        "a: Wilson and Yoffe 1969; ν: Çakır et al. 2014 (DFT), to be confirmed",
    ),
    (
        "MoSe2",
        0.3288,
        0.21,
        0.0005,
        0.02,
        "ν from the moduli in Halbertal et al. 2021; Çakır et al. 2014 give up to 0.23, to be confirmed",
    ),
    (
        "MoTe2",
        0.352,
        0.24,
        0.0005,
        0.03,
        "a: Wilson and Yoffe 1969, to be confirmed; ν: Çakır et al. 2014 (DFT), to be confirmed",
    ),
    (
        "WS2",
        0.3153,
        0.22,
        0.0005,
        0.03,
        "a: Schutte et al. 1987, to be confirmed; ν: Çakır et al. 2014 (DFT), to be confirmed",
    ),
    (
        "WSe2",
        0.3282,
        0.17,
        0.0005,
        0.02,
        "ν from the moduli in Halbertal et al. 2021; Çakır et al. 2014 give up to 0.19, to be confirmed",
    ),
    (
        "NbSe2",
        0.3444,
        0.25,
        0.0005,
        0.05,
        "a: Wilson and Yoffe 1969, to be confirmed; ν: between 0.2 and 0.3, no good source, give your own",
    ),
];

impl Material {
    /// Graphene.
    pub fn graphene() -> Self {
        Self::from_row(&GRAPHENE)
    }

    /// Every layer known by name.
    pub fn all() -> Vec<Self> {
        std::iter::once(&GRAPHENE)
            .chain(&OTHERS)
            .map(Self::from_row)
            .collect()
    }

    /// The layer of that name, upper or lower case.
    pub fn named(name: &str) -> Option<Self> {
        Self::all()
            .into_iter()
            .find(|material| material.name.eq_ignore_ascii_case(name.trim()))
    }

    fn from_row((name, a, ratio, a_sigma, ratio_sigma, source): &Row) -> Self {
        Self {
            name: (*name).to_owned(),
            lattice_constant_nm: *a,
            poisson_ratio: *ratio,
            lattice_constant_sigma_nm: *a_sigma,
            poisson_ratio_sigma: *ratio_sigma,
            source: (*source).to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_found_in_any_case_and_unknown_ones_are_not_guessed() {
        assert_eq!(Material::named("GRAPHENE"), Some(Material::graphene()));
        assert_eq!(
            Material::named(" hbn ").map(|m| m.lattice_constant_nm),
            Some(0.2504)
        );
        assert_eq!(Material::named("WTe2"), None);
        let mut names: Vec<_> = Material::all().into_iter().map(|m| m.name).collect();
        names.dedup();
        assert_eq!(names.len(), 8);
        assert!(names.iter().all(|name| Material::named(name).is_some()));
    }
}
