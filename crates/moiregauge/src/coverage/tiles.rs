//! What tiles of a frame show on average.
//!
//! A transform of the whole frame splits the waves of a lattice that bends, and mixes those of grains. The mean of
//! the powers of many tiles does not: each tile sees a straight lattice, and noise is averaged.

use crate::frame::image::Image;
use crate::spectrum::transform::Spectrum;

/// Sides of tiles, as shares of the frame: one over these.
const SHARES: [usize; 3] = [8, 4, 2];
/// The smallest side of a tile, pixels: two periods that are sampled well.
const SMALLEST: usize = 32;

/// The mean power spectra of tiles that overlap by half, the smallest tiles first. `flat`: without background.
pub(crate) fn spectra(flat: &Image) -> impl Iterator<Item = Spectrum> {
    let shares = SHARES
        .into_iter()
        .filter(|share| flat.columns / share >= SMALLEST && flat.rows / share >= SMALLEST);
    shares.filter_map(|share| {
        let size = [flat.columns / share, flat.rows / share];
        let places =
            (0..(2 * share - 1).pow(2)).map(|i| [i % (2 * share - 1), i / (2 * share - 1)]);
        let tiles = places.map(|[x, y]| flat.cropped([x * size[0] / 2, y * size[1] / 2], size));
        Spectrum::mean_of(tiles.filter(|tile| {
            2 * tile.values.iter().filter(|v| v.is_finite()).count() >= tile.values.len()
        }))
    })
}
