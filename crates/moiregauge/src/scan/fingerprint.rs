//! What is kept of an image to know it again.

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::frame::background::Surface;
use crate::frame::image::Image;
use crate::numbers::bits;
use crate::numbers::dot::dot;
use crate::numbers::median::median;

/// What is left of the pixels of an image to know it again.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(try_from = "Written", into = "Written")]
pub(crate) struct Fingerprint {
    size: [usize; 2],
    /// Values at pixels spread over the frame, without plane, in [`STEPS`] of a standard deviation; [`NONE`] where they are missing.
    samples: Arc<[i16]>,
    /// Noise of a pixel as its neighbours in the line see it, in standard deviations of the image.
    noise: f64,
}

impl Fingerprint {
    /// Of the whole image.
    pub(crate) fn of(image: &Image) -> Self {
        let surface = Surface::fitted(image, 1);
        let flat = |row: usize, columns: Range<usize>, left: &mut Vec<f64>| {
            let values = &image.row(row)[columns.clone()];
            left.clear();
            left.extend_from_slice(values);
            if let Some(surface) = &surface {
                surface.take_off(row, columns, left);
            }
        };
        let of_line = |line: &mut Vec<f64>, row: usize| {
            flat(row, 0..image.columns, line);
            let missing = line.iter_mut().filter(|v| !v.is_finite());
            let missing = missing.map(|value| *value = 0.0).count();
            (dot(line, line), line.len() - missing)
        };
        let lines = (0..image.rows).into_par_iter().with_min_len(LINES);
        let lines: Vec<(f64, usize)> = lines.map_init(Vec::new, of_line).collect();
        let squares: f64 = lines.iter().map(|(squares, _)| squares).sum();
        let count: usize = lines.iter().map(|(_, count)| count).sum();
        let deviation = (squares / count.max(1) as f64).sqrt();
        let mut line = Vec::new();
        let n = image.values.len();
        // Steps of the golden ratio spread evenly and follow no row or column.
        let at = |i: usize| (i as f64 * 0.618_033_988_749_895).fract() * n as f64;
        let mut one = |i: usize| {
            let (row, column) = (i / image.columns, i % image.columns);
            flat(row, column..column + 1, &mut line);
            line[0]
        };
        let samples = (0..SAMPLES.min(n)).map(|i| one(at(i) as usize) / deviation);
        let samples = samples.map(stepped).collect();
        Self {
            size: [image.columns, image.rows],
            samples,
            noise: if deviation > 0.0 {
                noise(image, &flat) / deviation
            } else {
                0.0
            },
        }
    }

    /// Noise of a pixel beside its neighbours, in standard deviations of the image: no structure of the sample is in it.
    pub(crate) fn noise(&self) -> f64 {
        self.noise
    }

    /// Root mean square of the difference, in standard deviations of the images; `None` where it is not below a limit,
    /// or they cannot be of the same pixels.
    pub(crate) fn difference(&self, other: &Self, limit: f64) -> Option<f64> {
        if self.size != other.size || self.samples.is_empty() {
            return None;
        }
        let all = self.samples.len() as f64;
        let (mut squares, mut count, mut missing) = (0.0, 0_usize, 0_usize);
        let ours = self.samples.chunks(AT_ONCE);
        for (ours, others) in ours.zip(other.samples.chunks(AT_ONCE)) {
            for (a, b) in ours.iter().zip(others) {
                match (*a != NONE, *b != NONE) {
                    (true, true) => {
                        squares += (f64::from(i32::from(*a) - i32::from(*b)) / STEPS).powi(2);
                        count += 1;
                    }
                    (false, false) => {}
                    _ => missing += 1,
                }
            }
            // Two scans differ at the first few pixels: every scan is compared with every other one.
            if squares > limit * limit * all {
                return None;
            }
        }
        let comparable = 2 * count > self.samples.len() && missing as f64 <= MISSING * all;
        let difference = (squares / count as f64).sqrt();
        (comparable && difference < limit).then_some(difference)
    }
}

/// Standard deviation of white noise by fourth differences along the lines of an image without its plane, which take off
/// all that is smooth; 0 where there are none.
fn noise(image: &Image, flat: &impl Fn(usize, Range<usize>, &mut Vec<f64>)) -> f64 {
    let fourth = |v: &[f64]| (v[0] - 4.0 * v[1] + 6.0 * v[2] - 4.0 * v[3] + v[4]).abs();
    let stride = (image.rows * image.columns / NOISE_SAMPLES).max(1);
    let in_line = (image.columns + 1).saturating_sub(5);
    let mut five = Vec::new();
    let difference = |i: usize| {
        let (row, column) = (i / in_line, i % in_line);
        flat(row, column..column + 5, &mut five);
        fourth(&five)
    };
    let all = (0..image.rows * in_line).step_by(stride).map(difference);
    let mut all: Vec<f64> = all.filter(|d| d.is_finite()).collect();
    if all.is_empty() {
        return 0.0;
    }
    // 1² + 4² + 6² + 4² + 1² = 70; the median of |x| is 0.6745 σ.
    median(&mut all) / (0.6745 * 70f64.sqrt())
}

/// Differences by which the noise is read, about: the median is known to a per cent or two.
const NOISE_SAMPLES: usize = 4096;

/// A fingerprint as it is written: every sample by the eight hexadecimal digits of its bits.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    size: [usize; 2],
    samples: String,
    /// Noise of a pixel, in standard deviations of the image.
    noise: f64,
}

impl From<Fingerprint> for Written {
    fn from(known: Fingerprint) -> Self {
        Self {
            size: known.size,
            samples: bits::to_text(known.samples.iter().map(|sample| match *sample {
                NONE => f32::NAN,
                steps => f32::from(steps) / STEPS as f32,
            })),
            noise: known.noise,
        }
    }
}

impl TryFrom<Written> for Fingerprint {
    type Error = &'static str;

    fn try_from(written: Written) -> Result<Self, Self::Error> {
        let samples = bits::from_text(&written.samples)
            .ok_or("expected eight hexadecimal digits for each sample")?;
        Ok(Self {
            size: written.size,
            samples: samples.into_iter().map(|s| stepped(f64::from(s))).collect(),
            noise: written.noise,
        })
    }
}

/// A value in standard deviations, as it is kept: half the memory of single precision, since a long watch keeps every frame.
fn stepped(value: f64) -> i16 {
    if value.is_finite() {
        // A cast stops at the ends of the range; the lower one is kept for what is missing.
        ((value * STEPS).round() as i16).max(NONE + 1)
    } else {
        NONE
    }
}

/// Steps of a standard deviation. Rounding makes a difference of 1e-4 between two images, a tenth of the smallest that counts; 8
/// standard deviations are the range, and what lies beyond them in one copy does so in the other.
const STEPS: f64 = 4096.0;

/// In place of a sample that is missing.
const NONE: i16 = i16::MIN;

/// Lines that a thread looks at together, at least.
const LINES: usize = 64;

/// Pixels that are compared before asking whether it is enough: any number far below [`SAMPLES`].
const AT_ONCE: usize = 16;

/// Pixels that are compared: the mean square of their difference is known to 4 %.
pub(crate) const SAMPLES: usize = 1024;

/// Share of the compared pixels that may be missing in one image only. Chosen by eye.
pub(crate) const MISSING: f64 = 0.02;

#[cfg(test)]
mod tests {
    use super::*;

    /// What is missing stays so, what is far off stops at the end, and text reads back to the same.
    #[test]
    fn samples_are_kept_in_steps_and_read_back() {
        let values = [
            0.0,
            0.5,
            -1.25,
            1e-5,
            7.5,
            100.0,
            -100.0,
            f64::NAN,
            f64::INFINITY,
        ];
        let known = Fingerprint {
            size: [3, 3],
            samples: values.into_iter().map(stepped).collect(),
            noise: 0.1,
        };
        assert_eq!(
            *known.samples,
            [0, 2048, -5120, 0, 30720, i16::MAX, NONE + 1, NONE, NONE]
        );
        let text = serde_json::to_string(&known).unwrap();
        let read: Fingerprint = serde_json::from_str(&text).unwrap();
        assert_eq!(read.samples, known.samples);
        assert_eq!(known.difference(&read, 1e-6), Some(0.0));
    }
}
