//! Local power of what a model leaves behind.

use nalgebra::Vector2;

use crate::frame::image::Image;
use crate::spectrum::transform::Spectrum;

/// Noise is read between these distances from a harmonic, in cycles per frame: outside the inner part
/// of its main lobe, which the fit has emptied, and near enough to be the noise that matters.
const NEAREST: f64 = 1.0;
/// The farther of the two.
const FARTHEST: f64 = 6.0;
/// The strip along an axis holds some fifteen bins: twice the annulus by chance once in a thousand.
const RIDGE: f64 = 2.0;

/// The windowed periodogram of a residual image.
pub(crate) struct LocalNoise {
    spectrum: Spectrum,
    window_power: f64,
}

impl LocalNoise {
    /// Transforms the residual (no missing pixels).
    pub(crate) fn new(residual: &Image) -> Self {
        let spectrum = Spectrum::unpadded(residual);
        let sum = |w: &[f64]| w.iter().map(|w| w * w).sum::<f64>();
        let window_power = sum(&spectrum.window[0]) * sum(&spectrum.window[1]);
        Self {
            spectrum,
            window_power,
        }
    }

    /// Mean power per pixel around `q`, as it acts on the x and on the y component of its wave vector;
    /// white noise of variance σ² gives σ² for both.
    ///
    /// A component is moved by noise on either side of `q` along its axis. Noise that is common to
    /// whole lines is a ridge at kx = 0: it acts on the y component of harmonics on it in full, and
    /// only where such a ridge stands out is the strip along the axis used instead of the annulus,
    /// which holds more bins and is known better.
    pub(crate) fn around(&self, q: Vector2<f64>) -> [f64; 2] {
        let centre = q.component_div(&self.spectrum.step());
        let annulus = self.mean(centre, |d| (NEAREST..=FARTHEST).contains(&d.norm()));
        [0, 1].map(|axis| {
            let strip = self.mean(centre, |d| {
                d[1 - axis].abs() <= 0.75 && (NEAREST..=FARTHEST).contains(&d[axis].abs())
            });
            if strip > RIDGE * annulus {
                strip
            } else {
                annulus
            }
        })
    }

    /// Mean over the bins whose distance from `centre` (in bins, a cycle per frame each) passes.
    fn mean(&self, centre: Vector2<f64>, wanted: impl Fn(Vector2<f64>) -> bool) -> f64 {
        let reach = FARTHEST.ceil() as i64;
        let (mut sum, mut count) = (0.0, 0usize);
        for dy in -reach..=reach {
            for dx in -reach..=reach {
                let (x, y) = (centre.x.round() as i64 + dx, centre.y.round() as i64 + dy);
                if !wanted(Vector2::new(x as f64, y as f64) - centre) {
                    continue;
                }
                sum += self.spectrum.at(x, y).norm_sqr();
                count += 1;
            }
        }
        sum / (count.max(1) as f64 * self.window_power)
    }
}
