//! The lattice that was told by hand: near given vectors or a given wavelength, or in a given part of the frame.
//!
//! Nothing is asked of what lies beside it: whoever told it has seen the rest of the image.

use std::sync::Arc;

use heterostrain::lattice::reciprocal;
use nalgebra::Matrix2;

use crate::frame::background::Background;
use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::lattice::ground::below;
use crate::lattice::measured::MeasuredLattice;
use crate::lattice::start::Start;
use crate::spectrum::error::LatticeError;
use crate::spectrum::method::Method;
use crate::spectrum::prepare::levelled;

/// A lattice is the one that was told if its waves differ by less than this share: twice what an eye sees.
const NEAR: f64 = 0.15;

/// ..., and if its mean wavelength does by less than this: half of what a second shell differs by.
const NEAR_WAVELENGTH: f64 = 0.25;

/// Which lattice is meant.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Meant {
    /// One with about these vectors, nm, a column each.
    Vectors(Matrix2<f64>),
    /// One with about this mean wavelength, nm.
    Wavelength(f64),
    /// The strongest.
    Any,
}

impl Meant {
    /// The waves that were told, rad per pixel.
    fn first(self, geometry: &Geometry) -> Option<Matrix2<f64>> {
        match self {
            Self::Vectors(basis) => {
                reciprocal(&basis).map(|q| geometry.pixel_to_nm.transpose() * q)
            }
            _ => None,
        }
    }

    /// Whether a pair of waves (rad per pixel) may be the lattice.
    fn is_near(self, pair: &Matrix2<f64>, geometry: &Geometry) -> bool {
        match self {
            Self::Any => true,
            Self::Wavelength(near) => {
                let cell =
                    reciprocal(pair).map(|basis| (geometry.pixel_to_nm * basis).determinant());
                let wavelength = cell.map_or(0.0, |area| (area.abs() / 0.75f64.sqrt()).sqrt());
                (wavelength / near - 1.0).abs() < NEAR_WAVELENGTH
            }
            Self::Vectors(_) => {
                let first = self.first(geometry);
                first.and_then(Matrix2::try_inverse).is_some_and(|inverse| {
                    let names = inverse * pair;
                    let whole = names.map(f64::round);
                    whole.determinant().abs() == 1.0 && (names - whole).amax() < NEAR
                })
            }
        }
    }
}

/// Finds and measures the lattice that was told. `image`: with the pixels missing that are not to be used.
///
/// # Errors
/// As [`measure`](crate::lattice::find::measure); [`LatticeError::NotThere`] where lattices are found, but none like it.
pub(crate) fn measure_by_hand(
    image: &Image,
    geometry: &Geometry,
    background: Background,
    method: Method,
    meant: Meant,
) -> Result<MeasuredLattice, LatticeError> {
    if image.values.iter().all(|v| !v.is_finite()) {
        return Err(LatticeError::Constant);
    }
    let first = meant.first(geometry);
    let is_meant = |pair: &Matrix2<f64>| meant.is_near(pair, geometry);
    if let Some(start) = Start::find_meant(image, geometry, background, first, &is_meant) {
        return start.measure(method);
    }
    let near = first.and_then(|pair| Start::near(image, geometry, background, &pair));
    if let Some(start) = near.filter(Start::is_significant) {
        return start.measure(method);
    }
    // Ground that is stronger than its waves hides it.
    let find = |even: &Arc<Image>, _| {
        let is_meant = |pair: &Matrix2<f64>| meant.is_near(pair, geometry);
        let first = meant.first(geometry);
        let start = Start::find_meant(even, geometry, background, first, &is_meant)?;
        start.measure(Method::Lattice).ok()
    };
    let flat = levelled(image.clone(), background)?;
    let found = (method == Method::Lattice)
        .then(|| below(&flat, geometry, background, &find))
        .flatten();
    found.ok_or(LatticeError::NotThere)
}
