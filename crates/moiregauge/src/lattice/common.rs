//! Errors that all images of one sample have alike.

use heterostrain::lattice::{Lattice, Px, Waves, labelled_like};
use nalgebra::{Matrix2, Matrix4};
use serde::{Deserialize, Serialize};

use crate::coverage::bend::Mean;
use crate::lattice::fit::fitted::LatticeFit;
use crate::numbers::exact;

/// What a mean over an area owes to how the change is described and to where the area ends: every image of the sample owes it, and
/// the mean of many images is no better for it.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Common {
    /// Vectors in pixels by the finest description, named like those of the lattice.
    #[serde(with = "exact")]
    pub other: Matrix2<f64>,
    /// Covariance of the vectors from where the area ends and from how the fit describes it, pixels².
    #[serde(with = "exact")]
    pub edges: Matrix4<f64>,
}

impl Common {
    /// That of a fit to the pixels of a lattice that changes: how far its mean may be from what cubic polynomials say.
    pub(crate) fn of_fit(fit: &LatticeFit, pixels: &Lattice<Px>) -> Option<Self> {
        let change = fit.change().map(|change| change.beside(fit.clipped));
        let basis = fit.wave_vectors.basis + change?;
        let other = Waves::<Px>::exact(basis).lattice()?;
        Some(Self {
            other: labelled_like(&other, &pixels.basis).basis,
            edges: Matrix4::zeros(),
        })
    }

    /// That of a mean of which `pixels` is the lattice.
    pub(crate) fn of(mean: &Mean, pixels: &Lattice<Px>) -> Option<Self> {
        let edges = Waves::<Px>::new(mean.waves.basis, mean.edges).lattice()?;
        let other = Waves::<Px>::new(mean.other, Matrix4::zeros()).lattice()?;
        Some(Self {
            other: labelled_like(&other, &pixels.basis).basis,
            edges: labelled_like(&edges, &pixels.basis).covariance,
        })
    }
}
