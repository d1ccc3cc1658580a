//! Local lattices of an image.

use nalgebra::Vector2;

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
    let centre = Vector2::new(image.columns as f64 - 1.0, image.rows as f64 - 1.0) / 2.0;
    let place = Place {
        row: 0,
        rows: None,
        centre,
    };
    demodulate::demodulate(image, place, reference, resolution)
}
