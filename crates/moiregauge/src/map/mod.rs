//! Maps of the local lattice: twist, strain and wavelength from place to place.
//!
//! In: an image without background, and the lattice of the whole image as a start. Out: local wave
//! vectors on a grid of nodes with their covariance and a mask (pixels), which one linear map takes to the sample.
//!
//! Each harmonic g of the lattice is demodulated with a Gaussian window of width w:
//! `C(r) = Σ_n w(n − r) I(n) e^{−ig·n}`, local wave vector `g + Im(∇C/C)`. Noise of each component:
//! `σ_g = (σ/A)/(2√(πρ) w²)` for a cosine of amplitude A in noise of σ per pixel, ρ pixels per nm².
//! Resolution (full width at half maximum): 2.35 w.
//!
//! # References
//! Phase demodulation: Hÿtch, Snoeck and Kilaas, Ultramicroscopy 74, 131 (1998); for moirés: Benschop et
//! al., Phys. Rev. Research 3, 013153 (2021).

mod blocks;
mod carrier;
mod combine;
mod defects;
mod demodulate;
mod displacement;
mod drift_change;
mod leaks;
mod lines;
mod mosaic;
mod noise;
mod pilot;
mod quantities;
mod register;
mod sample;
mod smooth;
mod stripes;
mod summary;
mod survey;
mod types;
mod waves;
mod window;

pub use combine::{Agreement, combine, combine_frames};
pub(crate) use combine::{Shared, combine_with};
pub use defects::Mask;
pub use drift_change::{DriftChange, drift_change};
pub use quantities::{Plane, TwistStrainMap};
pub use register::{Registration, register};
pub use sample::{Grid, LatticeMap, LatticeNode};
pub use stripes::{
    FittedWave, NoStripes, SampledPattern, SampledStripes, StripeMap, StripeNode, StripePattern,
    find_stripes, stripe_maps,
};
pub use summary::Spread;
pub use survey::Survey;
pub(crate) use types::FULL_WIDTH;
pub use types::{Reference, Resolution, ResolutionError, UsedHarmonic, WaveMap, WaveNode};

use nalgebra::Vector2;

use crate::image::Image;
use blocks::Place;

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

/// The middle one of some values; they are reordered. 0 of none.
fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let half = values.len() / 2;
    *values.select_nth_unstable_by(half, f64::total_cmp).1
}

#[cfg(test)]
mod tests;
