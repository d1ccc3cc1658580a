//! Local lattices of an image.

use crate::frame::image::Image;
use crate::map::demodulate;
use crate::window::blocks::Place;
use crate::window::types::{Reference, Resolution, WaveMap};

/// The local lattices of an image whose background is gone.
///
/// `None` where the frame is too small or shows no lattice.
pub fn local_lattices(
    image: &Image,
    reference: &Reference,
    resolution: &Resolution,
) -> Option<WaveMap> {
    demodulate::demodulate(image, Place::whole(image), reference, resolution)
}
