//! Autocorrelation and spectrum as images, for figures.

use heterostrain::lattice::{Lattice, Px, reciprocal};

use crate::frame::image::Image;
use crate::spectrum::transform::Spectrum;

/// Lags up to this many times the longest vector are shown: the second ring of peaks, for the eye.
const LAGS: f64 = 2.3;
/// Frequencies up to this many times the largest wave vector are shown: the third shell, for the eye.
const FREQUENCIES: f64 = 3.2;

/// The autocorrelation and the logarithm of the power spectrum around their centres, and the step of
/// the latter along columns and rows in cycles per pixel.
///
/// `image` has its background removed. Both pictures have odd sides and their zero in the middle, at
/// (rows/2, columns/2).
pub(crate) fn pictures(image: &Image, lattice: &Lattice<Px>) -> (Image, Image, [f64; 2]) {
    let spectrum = Spectrum::new(image);
    let autocorrelation = spectrum.autocorrelation();
    let longest = (0..3).map(|i| lattice.vector(i).norm()).fold(0.0, f64::max);
    let reach = |most: usize| ((LAGS * longest).ceil() as usize).min(most * 4 / 5) as i64;
    let [mx, my] = autocorrelation.max_lag.map(reach);
    let lags = centred([mx, my], |x, y| {
        autocorrelation.at(x, y).unwrap_or(f64::NAN)
    });
    let step = spectrum.step();
    let largest =
        reciprocal(&lattice.basis).map_or(1.0, |k| k.column(0).norm().max(k.column(1).norm()));
    let bins = |step: f64, most: usize| {
        ((FREQUENCIES * largest / step).ceil() as usize).min(most / 2 - 1) as i64
    };
    let reach = [bins(step.x, spectrum.columns), bins(step.y, spectrum.rows)];
    let rows = spectrum.rows as i64;
    let power = centred(reach, |x, y| {
        let (x, y) = if x < 0 { (-x, -y) } else { (x, y) };
        spectrum
            .power(x as usize, y.rem_euclid(rows) as usize)
            .max(f64::MIN_POSITIVE)
            .ln()
    });
    let cycles = step / std::f64::consts::TAU;
    (lags, power, [cycles.x, cycles.y])
}

/// The logarithm (base 10) of the power of an image under the window of the analysis, zero in the middle, at (rows/2,
/// columns/2); and the step along columns and rows, cycles per pixel.
///
/// `image` has its background removed.
pub fn log_power(image: &Image) -> (Image, [f64; 2]) {
    let spectrum = Spectrum::new(image);
    let rows = spectrum.rows as i64;
    let reach = [spectrum.columns, spectrum.rows].map(|n| n as i64 / 2 - 1);
    let power = centred(reach, |x, y| {
        let (x, y) = if x < 0 { (-x, -y) } else { (x, y) };
        spectrum
            .power(x as usize, y.rem_euclid(rows) as usize)
            .max(f64::MIN_POSITIVE)
            .log10()
    });
    let cycles = spectrum.step() / std::f64::consts::TAU;
    (power, [cycles.x, cycles.y])
}

/// The image of `value(x, y)` for |x| and |y| up to `reach`.
fn centred(reach: [i64; 2], value: impl Fn(i64, i64) -> f64) -> Image {
    let [mx, my] = reach;
    let values = (-my..=my)
        .flat_map(|y| (-mx..=mx).map(move |x| (x, y)))
        .map(|(x, y)| value(x, y))
        .collect();
    Image::new(2 * my as usize + 1, 2 * mx as usize + 1, values)
}
