//! What is kept of an image to know it again.

use std::sync::Arc;

use crate::frame::background::{Background, remove_background};
use crate::frame::image::Image;
use crate::numbers::median::median;

/// What is left of the pixels of an image to know it again.
#[derive(Clone, Debug)]
pub(crate) struct Fingerprint {
    size: [usize; 2],
    /// Values at pixels spread over the frame, without plane, in standard deviations.
    samples: Arc<[f32]>,
    /// Noise of a pixel as its neighbours in the line see it, in standard deviations of the image.
    noise: f64,
}

impl Fingerprint {
    /// Of the whole image.
    pub(crate) fn of(image: &Image) -> Self {
        let flat = remove_background(image, Background::Plane);
        let (mut squares, mut count) = (0.0, 0_usize);
        for value in flat.values.iter().filter(|v| v.is_finite()) {
            squares += value * value;
            count += 1;
        }
        let deviation = (squares / count.max(1) as f64).sqrt();
        let n = flat.values.len();
        // Steps of the golden ratio spread evenly and follow no row or column.
        let at = |i: usize| (i as f64 * 0.618_033_988_749_895).fract() * n as f64;
        let samples = (0..SAMPLES.min(n)).map(|i| (flat.values[at(i) as usize] / deviation) as f32);
        Self {
            size: [image.columns, image.rows],
            samples: samples.collect(),
            noise: noise(&flat) / deviation,
        }
    }

    /// Noise of a pixel beside its neighbours, in standard deviations of the image: no structure of the sample is in it.
    pub(crate) fn noise(&self) -> f64 {
        self.noise
    }

    /// Root mean square of the difference, in standard deviations of the images; `None` where they cannot be of the
    /// same pixels.
    pub(crate) fn difference(&self, other: &Self) -> Option<f64> {
        if self.size != other.size || self.samples.is_empty() {
            return None;
        }
        let (mut squares, mut count, mut missing) = (0.0, 0_usize, 0_usize);
        for (a, b) in self.samples.iter().zip(other.samples.iter()) {
            match (a.is_finite(), b.is_finite()) {
                (true, true) => {
                    squares += f64::from(a - b).powi(2);
                    count += 1;
                }
                (false, false) => {}
                _ => missing += 1,
            }
        }
        let all = self.samples.len() as f64;
        let comparable = 2 * count > self.samples.len() && missing as f64 <= MISSING * all;
        comparable.then(|| (squares / count as f64).sqrt())
    }
}

/// Standard deviation of white noise by fourth differences along the lines, which take off all that is smooth; 0 where
/// there are none.
fn noise(image: &Image) -> f64 {
    let fourth = |v: &[f64]| (v[0] - 4.0 * v[1] + 6.0 * v[2] - 4.0 * v[3] + v[4]).abs();
    let stride = (image.rows * image.columns / NOISE_SAMPLES).max(1);
    let all = (0..image.rows).flat_map(|row| image.row(row).windows(5).map(fourth));
    let mut all: Vec<f64> = all.step_by(stride).filter(|d| d.is_finite()).collect();
    if all.is_empty() {
        return 0.0;
    }
    // 1² + 4² + 6² + 4² + 1² = 70; the median of |x| is 0.6745 σ.
    median(&mut all) / (0.6745 * 70f64.sqrt())
}

/// Differences by which the noise is read, about: the median is known to a per cent or two.
const NOISE_SAMPLES: usize = 4096;

/// Pixels that are compared: the mean square of their difference is known to 4 %.
pub(crate) const SAMPLES: usize = 1024;

/// Share of the compared pixels that may be missing in one image only. Chosen by eye.
pub(crate) const MISSING: f64 = 0.02;
