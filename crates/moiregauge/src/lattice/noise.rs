//! Local power of what a model leaves behind.

use nalgebra::Vector2;

use super::transform::Spectrum;
use crate::image::Image;

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

    /// Mean power per pixel between the two distances (cycles per frame) from `q`; white noise of
    /// variance σ² gives σ².
    pub(crate) fn around(&self, q: Vector2<f64>, distances: [f64; 2]) -> f64 {
        let step = self.spectrum.step();
        let rows = self.spectrum.rows as i64;
        let columns = self.spectrum.columns as i64;
        let centre = q.component_div(&step);
        // A bin is a cycle per frame where the transform is not padded.
        let reach = distances[1].ceil() as i64;
        let (mut sum, mut count) = (0.0, 0usize);
        for dy in -reach..=reach {
            for dx in -reach..=reach {
                let (x, y) = (centre.x.round() as i64 + dx, centre.y.round() as i64 + dy);
                let away = Vector2::new(x as f64, y as f64) - centre;
                if !(distances[0]..=distances[1]).contains(&away.norm()) {
                    continue;
                }
                let (x, y) = if x < 0 || x > columns / 2 {
                    (-x, -y)
                } else {
                    (x, y)
                };
                let x = x.rem_euclid(columns);
                if x > columns / 2 {
                    continue;
                }
                sum += self.spectrum.power(x as usize, y.rem_euclid(rows) as usize);
                count += 1;
            }
        }
        sum / (count.max(1) as f64 * self.window_power)
    }
}
