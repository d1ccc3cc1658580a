//! The fit from its start to what it says: all harmonics that earn their place.

use heterostrain::lattice::{Lattice, Px};

use crate::frame::background::Background;
use crate::frame::departure::Departure;
use crate::frame::image::Image;
use crate::lattice::fit::fit_pixels::Fit;
use crate::lattice::fit::fitted::LatticeFit;
use crate::lattice::fit::straight::without_bend;
use crate::spectrum::harmonics::Harmonics;

/// A lattice fitted to an image.
pub(crate) struct Found {
    pub(crate) lattice: Lattice<Px>,
    pub(crate) fit: LatticeFit,
}

/// Fits the lattice, starting from what the spectrum of `image` says.
///
/// `None` where the fit does not settle within half a cycle over the frame of its start, or the
/// harmonics cannot be told apart on this frame. Everything counts in pixels of `image`.
/// `displacement`: how far from its own place each pixel is on a straight grid.
pub(crate) fn measure(
    image: &Image,
    start: &Harmonics,
    background: Background,
    displacement: Option<&Departure>,
) -> Option<Found> {
    let mut fit = Fit::new(image, start, background)?;
    fit.frame.displacement = displacement.cloned();
    let noise = fit.choose()?;
    let followed = without_bend(&mut fit, noise);
    let (lattice, fit) = fit.result(&followed)?;
    Some(Found { lattice, fit })
}
