//! A first look at a large image, in coarse bins.
//!
//! A lattice of many pixels a period needs no transform of all of them to be found. In: a large image without its
//! background. Out: its harmonics, if the bins show a lattice with enough of them a period, and the pixels say that
//! its waves are theirs. What is too fine for the bins is left to a look at all pixels.

use std::borrow::Cow;

use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;
use rustfft::num_complex::Complex64;

use crate::frame::background::Background;
use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::frame::smaller::{mean_over, response, smaller};
use crate::numbers::dot::dot;
use crate::numbers::interrupt;
use crate::spectrum::hann::hann;
use crate::spectrum::harmonics::Harmonics;
use crate::spectrum::transform::Spectrum;
use crate::spectrum::verdict::{is_lattice, refine, signal_to_noise};
use crate::spectrum::{high_orders, select};

/// Images of fewer pixels than twice this many are searched as they are; others in about this many bins, whose transform
/// takes a tenth of a second.
const BINS: usize = 1 << 20;
/// Bins along the shorter side, at least: enough for a dozen periods. On the scenes of docs/constants.md half and double change no result.
const SHORT_SIDE: usize = 256;
/// Bins per shortest period of the first harmonics, at least: the second shell is then within the Nyquist frequency, and
/// the response of the bins above 0.7.
const BINS_PER_PERIOD: f64 = 4.0;
/// Bins per shortest period where a pair of waves is known already: cells of its envelopes are then two bins wide.
const ENOUGH: f64 = 6.0;
/// A wave of the bins is one of the pixels if its amplitude there agrees to this share: short waves that the bins see as
/// long ones are a thousand times as strong there or nothing.
const AGREES: f64 = 0.2;

/// A large image in bins.
#[derive(Clone)]
pub(crate) struct Look {
    pub(crate) image: Image,
    /// Pixels of a bin along each axis.
    pub(crate) bins: usize,
}

/// What a look found, in bins.
pub(crate) struct Found {
    pub(crate) harmonics: Harmonics,
    /// The first three wave vectors, each by itself.
    pub(crate) peaks: [Vector2<f64>; 3],
}

impl Look {
    /// `None` for images that are not large.
    pub(crate) fn at(image: &Image) -> Option<Self> {
        let size = size_of_bins([image.columns, image.rows]);
        (size > 1).then(|| Self {
            image: smaller(image, size),
            bins: size,
        })
    }

    /// The image itself in bins of another size.
    pub(crate) fn in_bins(&self, pixels: &Image, bins: usize) -> Cow<'_, Image> {
        if bins == self.bins {
            Cow::Borrowed(&self.image)
        } else {
            Cow::Owned(smaller(pixels, bins))
        }
    }

    /// Whether bins as coarse as a pair allows show its lattice, and the signal-to-noise ratios of its waves there; `None` where they are the pixels.
    pub(crate) fn shows(
        &self,
        pixels: &Image,
        pair: &Matrix2<f64>,
        background: Background,
    ) -> Option<(bool, [f64; 3])> {
        let bins = bins_for(pair);
        if bins == 1 {
            return None;
        }
        let (image, pair) = (self.in_bins(pixels, bins), pair * bins as f64);
        let (harmonics, _) = refine(&image, &pair, background)?;
        let high_orders = || high_orders::refine(&image, &pair, background).is_some();
        let shows = is_lattice(&harmonics) || high_orders();
        Some((shows, signal_to_noise(&harmonics)))
    }

    /// The lattice that the bins show; `pixels` is the image itself.
    pub(crate) fn lattice(
        &self,
        pixels: &Image,
        geometry: &Geometry,
        background: Background,
    ) -> Option<Found> {
        let bin_to_nm = geometry.pixel_to_nm * self.bins as f64;
        let candidates = select::candidates(&Spectrum::new(&self.image), &bin_to_nm);
        // What is not plain at once is left to a look at all pixels.
        let pair = candidates.first()?.pair;
        let (harmonics, peaks) = refine(&self.image, &pair, background)?;
        let found = Found { harmonics, peaks };
        let sure =
            is_lattice(&found.harmonics) && found.is_fine() && found.is_in(pixels, self.bins);
        sure.then_some(found)
    }
}

/// Pixels of the bins that a pair of waves (rad per pixel) needs to be seen in a large image.
pub(crate) fn bins_for(pair: &Matrix2<f64>) -> usize {
    let third = pair.column(1) - pair.column(0);
    let fastest = pair.amax().max(third.amax());
    ((std::f64::consts::TAU / (fastest * ENOUGH)) as usize).max(1)
}

/// Pixels of a bin along each axis: 1 for images that are not large.
fn size_of_bins([columns, rows]: [usize; 2]) -> usize {
    let by_area = ((columns * rows) as f64 / BINS as f64).sqrt().round() as usize;
    by_area.min(columns.min(rows) / SHORT_SIDE).max(1)
}

impl Found {
    /// Whether there are enough bins in a period.
    fn is_fine(&self) -> bool {
        let first = self.harmonics.list.iter().take(3);
        let fastest = first.map(|h| h.q.amax().max(-h.q.amin()));
        let shortest = std::f64::consts::TAU / fastest.fold(0.0, f64::max);
        shortest >= BINS_PER_PERIOD
    }

    /// Whether the pixels show the first waves, too.
    fn is_in(&self, pixels: &Image, bins: usize) -> bool {
        self.harmonics.list.iter().take(3).all(|harmonic| {
            let q = harmonic.q / bins as f64;
            let wanted = harmonic.amplitude.norm() / (response(q.x, bins) * response(q.y, bins));
            (amplitude(pixels, q) / wanted - 1.0).abs() < AGREES
        })
    }
}

/// Amplitude of a wave under a Hann window; missing pixels count as 0.
fn amplitude(image: &Image, q: Vector2<f64>) -> f64 {
    let [along, across] = [image.columns, image.rows].map(hann);
    let turns = along.iter().enumerate().map(|(c, w)| (q.x * c as f64, w));
    let (re, im): (Vec<f64>, Vec<f64>) = turns.map(|(x, w)| (w * x.cos(), w * x.sin())).unzip();
    let lines = (0..image.rows).into_par_iter().map(|row| {
        interrupt::check();
        let line = image.row(row);
        let turn = Complex64::from_polar(across[row], -q.y * row as f64);
        let [re, im] = [&re, &im].map(|turns| {
            let sum = dot(line, turns);
            if sum.is_finite() {
                return sum;
            }
            let there = line.iter().zip(turns).filter(|(v, _)| v.is_finite());
            there.map(|(v, turn)| v * turn).sum()
        });
        turn * Complex64::new(re, -im)
    });
    let lines: Vec<Complex64> = lines.collect();
    let weights = along.iter().sum::<f64>() * across.iter().sum::<f64>();
    lines.iter().sum::<Complex64>().norm() / weights
}

/// The harmonics of bins of `from` pixels as plain means over `to` pixels show them.
pub(crate) fn in_other_bins(found: &Harmonics, from: usize, to: usize) -> Harmonics {
    let ratio = to as f64 / from as f64;
    let middle = |bins: usize| Vector2::repeat((bins as f64 - 1.0) / 2.0);
    let mut other = found.clone();
    other.pair = found.pair * ratio;
    other.window_sums = found.window_sums.map(|sum| sum / (ratio * ratio));
    for harmonic in &mut other.list {
        let q = harmonic.q / from as f64;
        let left = mean_over(q.x, to) * mean_over(q.y, to);
        let left = left / (response(q.x, from) * response(q.y, from));
        // Phases are counted from the first bin.
        let turn = Complex64::cis(q.dot(&(middle(to) - middle(from))));
        harmonic.q *= ratio;
        harmonic.amplitude *= turn * left;
        // That of a pixel, and what a bin leaves of it.
        harmonic.noise = harmonic.noise.map(|noise| noise * (left / ratio).powi(2));
    }
    other
}

#[cfg(test)]
mod tests {
    use super::*;
    use heterostrain::lattice::reciprocal;

    const SIDE: usize = 1536;

    /// Three waves of a lattice with a period in pixels, in noise.
    fn image(period: f64) -> Image {
        let size = 2.0 * std::f64::consts::TAU / (3f64.sqrt() * period);
        let waves = [10.0, 70.0, 130.0_f64].map(|degrees| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            [size * cos, size * sin]
        });
        let mut noise = crate::numbers::rng::normals(3, "look", 0);
        let values = (0..SIDE * SIDE).map(|i| {
            let (x, y) = ((i % SIDE) as f64, (i / SIDE) as f64);
            let sum: f64 = waves.iter().map(|q| (q[0] * x + q[1] * y).cos()).sum();
            sum + 0.5 * noise()
        });
        Image::new(SIDE, SIDE, values.collect())
    }

    fn looked(image: &Image) -> Option<Found> {
        let extent = SIDE as f64 - 1.0;
        let geometry = Geometry::nominal([SIDE; 2], extent, extent, 0.0, Vector2::zeros());
        let look = Look::at(image).unwrap();
        look.lattice(image, &geometry.unwrap(), Background::Plane)
    }

    /// The harmonics by a look are those that the pixels show.
    #[test]
    fn a_look_sees_what_the_pixels_show() {
        let image = image(21.0);
        let look = Look::at(&image).unwrap();
        let found = looked(&image).unwrap();
        let small = image.binned(1);
        let ours = in_other_bins(&found.harmonics, look.bins, 1);
        let (theirs, _) = refine(&small, &ours.pair, Background::Plane).unwrap();
        for (a, b) in ours.list.iter().zip(&theirs.list).take(3) {
            assert!((a.q - b.q).norm() < 1e-5, "{} {}", a.q, b.q);
            let ratio = a.amplitude / b.amplitude;
            assert!((ratio - 1.0).norm() < 0.02, "{ratio}");
            let all = [ours.window_sums, theirs.window_sums];
            let power = a.significance(all[0]) / b.significance(all[1]);
            assert!((0.7..1.4).contains(&power), "{power}");
        }
        let cell = reciprocal(&ours.pair).unwrap();
        assert!((cell.column(0).norm() - 21.0).abs() < 0.01);
        assert!(cell != Matrix2::zeros());
    }

    /// Lattices too fine for the bins are no coarser ones.
    #[test]
    fn fine_lattices_are_left_alone() {
        for period in [5.2, 3.1, 2.6] {
            assert!(looked(&image(period)).is_none(), "{period}");
        }
    }
}
