//! How strong the waves of a lattice are in the images: what tells one name of the lattice from another.
//!
//! In: amplitudes of fitted harmonics. Out: bounds of relative amplitudes by wave vector (rad/nm).

use std::collections::BTreeMap;

use heterostrain::lattice::reciprocal;
use nalgebra::{Matrix2, Vector2};

use crate::lattice::fit::fitted::LatticeFit;

/// Standard deviations between an amplitude and its bounds: 3, as for what deserves a word.
const SIGMAS: f64 = 3.0;
/// A wave that the fit left out is weaker than this many times the noise of an amplitude: it has to earn its place by
/// Δχ² > 2 ln N, N up to 10⁷, and the noise around it may be half as much again.
const LEFT_OUT: f64 = 6.0;
/// Distance from a lattice point (in units of the pair) beyond which a wave is not a harmonic: below half. On the scenes of docs/constants.md half
/// and double change no result.
const WHOLE: f64 = 0.3;

/// The amplitudes of the waves of a lattice in all images, relative to the power of each.
#[derive(Clone, Debug, Default)]
pub struct WaveStrengths {
    /// Reciprocal pair that the waves are counted in, rad/nm.
    pair: Option<Matrix2<f64>>,
    images: Vec<InImage>,
}

/// Relative amplitudes in one image.
#[derive(Clone, Debug)]
struct InImage {
    /// Lower and upper bound of every wave that was fitted.
    fitted: BTreeMap<[i32; 2], [f64; 2]>,
    /// Upper bound of the others.
    left_out: f64,
}

impl WaveStrengths {
    /// None yet; `basis` is a real-space pair (nm) of the lattice, to within some per cent.
    pub fn new(basis: &Matrix2<f64>) -> Self {
        Self {
            pair: reciprocal(basis),
            images: Vec::new(),
        }
    }

    /// Adds an image; `pixel_to_nm` is its J.
    pub fn add(&mut self, fit: &LatticeFit, pixel_to_nm: &Matrix2<f64>) {
        let dual = pixel_to_nm.try_inverse().map(|inverse| inverse.transpose());
        let Some((inverse, dual)) = self.pair.and_then(Matrix2::try_inverse).zip(dual) else {
            return;
        };
        let power: f64 = fit.harmonics.iter().map(|h| h.amplitude.powi(2)).sum();
        let noise = |amplitude: f64, ratio: f64| amplitude / (2.0_f64.sqrt() * ratio);
        let first = fit.harmonics.iter().take(3);
        let usual = first
            .map(|h| noise(h.amplitude, h.signal_to_noise))
            .fold(0.0, f64::max);
        let scale = power.sqrt();
        let mut waves = BTreeMap::new();
        for harmonic in &fit.harmonics {
            let [h, k] = harmonic.index.map(f64::from);
            let wave = dual * fit.wave_vectors.basis * Vector2::new(h, k);
            let Some(index) = whole(inverse * wave) else {
                return;
            };
            let reach = SIGMAS * noise(harmonic.amplitude, harmonic.signal_to_noise);
            let bounds = [harmonic.amplitude - reach, harmonic.amplitude + reach];
            waves.insert(index, bounds.map(|a| a.max(0.0) / scale));
        }
        let left_out = LEFT_OUT * usual / scale;
        if scale > 0.0 && left_out.is_finite() {
            self.images.push(InImage {
                fitted: waves,
                left_out,
            });
        }
    }

    /// Lower and upper bound of the amplitude of a wave (rad/nm), the mean over the images; `None` without any.
    pub(crate) fn bounds(&self, wave: Vector2<f64>) -> Option<[f64; 2]> {
        let index = whole(self.pair?.try_inverse()? * wave)?;
        if self.images.is_empty() {
            return None;
        }
        // A wave and its opposite are one.
        let of = |image: &InImage| {
            let opposite = index.map(|n| -n);
            let found = image.fitted.get(&index).or(image.fitted.get(&opposite));
            found.copied().unwrap_or([0.0, image.left_out])
        };
        let count = self.images.len() as f64;
        let sums = self.images.iter().map(of);
        let [low, high] = sums.fold([0.0; 2], |sum, one| [sum[0] + one[0], sum[1] + one[1]]);
        Some([low / count, high / count])
    }
}

fn whole(numbers: Vector2<f64>) -> Option<[i32; 2]> {
    let rounded = numbers.map(f64::round);
    ((numbers - rounded).amax() < WHOLE).then(|| [rounded.x as i32, rounded.y as i32])
}
