//! Why a lattice gives no twist and strain.

/// Why a lattice gives no twist and strain.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StrainError {
    /// A vector or its covariance holds NaN or infinity.
    #[error("expected finite lattice vectors and covariances, found {basis:?}")]
    NotFinite {
        /// The vectors: a1x, a1y, a2x, a2y.
        basis: [f64; 4],
    },
    /// The two vectors are parallel, or too long or short to be told from it.
    #[error("expected two independent lattice vectors, found a cell of area {area} nm²")]
    NoArea {
        /// Signed area of the cell, nm².
        area: f64,
    },
    /// Neither sign of strain explains the lattice: it is not a moiré of these layers.
    #[error(
        "no twist and uniaxial strain of layers with {lattice_constant_nm} nm explains a moiré with isotropic part {isotropic:.3e} and anisotropic part {anisotropic:.3e} of the atomic reciprocal lattice"
    )]
    NoSolution {
        /// The lattice constant of the reference layer, nm.
        lattice_constant_nm: f64,
        /// |p|.
        isotropic: f64,
        /// |q|.
        anisotropic: f64,
    },
    /// No twist and no strain: both layers coincide and there is no moiré.
    #[error("expected a twist or a strain, found two layers that coincide")]
    NoMoire,
    /// Lattice constant or Poisson ratio make no sense.
    #[error(
        "expected a lattice constant > 0 nm and a Poisson ratio between −1 and 1, found {lattice_constant_nm} nm and {poisson_ratio}"
    )]
    Material {
        /// As given.
        lattice_constant_nm: f64,
        /// As given.
        poisson_ratio: f64,
    },
}
