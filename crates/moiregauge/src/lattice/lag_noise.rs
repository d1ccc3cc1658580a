//! Noise of an autocorrelation at its peaks.

use nalgebra::{Matrix2, Vector2};

use crate::spectrum::hann::hann_at;
use crate::spectrum::harmonics::Harmonics;

/// `V = H⁻¹ N H⁻¹`, and how the noise depends on the direction of the lag.
pub(crate) struct GradientNoise {
    pub(super) v: Matrix2<f64>,
    /// Noise that acts along x and along y, over their mean.
    axes: Vector2<f64>,
}

impl GradientNoise {
    pub(super) fn unit() -> Self {
        Self {
            v: Matrix2::identity(),
            axes: Vector2::new(1.0, 1.0),
        }
    }

    pub(super) fn new(harmonics: &Harmonics) -> Option<Self> {
        let (mut h, mut n) = (Matrix2::zeros(), Matrix2::zeros());
        let mut axes = Vector2::zeros();
        for harmonic in &harmonics.list {
            let term = 2.0 * harmonic.amplitude.norm_sqr() * harmonic.q * harmonic.q.transpose();
            let noise = Vector2::from(harmonic.noise);
            h += term;
            n += term * noise.mean();
            axes += term.trace() * noise;
        }
        let inverse = h.try_inverse()?;
        Some(Self {
            v: inverse * n * inverse,
            axes: axes / axes.mean(),
        })
    }

    /// The factor for a lag: it compares pixels that lie apart along it.
    pub(super) fn along(&self, lag: Vector2<f64>) -> f64 {
        lag.component_mul(&lag).dot(&self.axes) / lag.norm_squared()
    }
}

/// Variance per lag of the noise correlated with itself, before division by the overlap.
pub(crate) fn noise_with_noise(harmonics: &Harmonics) -> f64 {
    let count = 2.0 * harmonics.list.len() as f64;
    let mean = harmonics.list.iter().flat_map(|h| h.noise).sum::<f64>() / count;
    mean * mean
}

/// Points along each side of the frame at which the (smooth) window is summed. Chosen by eye.
const SAMPLES: usize = 48;

/// The windowed frame and its copies shifted by ±R, sampled along each axis.
pub(crate) struct Overlap {
    /// Per axis and sample: `w(x)²`, times the step.
    square: [[f64; SAMPLES]; 2],
    /// Per axis: `w(x + R)` and `w(x − R)`.
    shifted: [[[f64; SAMPLES]; 2]; 2],
    /// `W(R)`.
    weight: f64,
    /// `Σ w² w²(n + R) / W²`.
    pub(super) squares: f64,
}

impl Overlap {
    pub(super) fn new(frame: Vector2<f64>, lag: Vector2<f64>) -> Self {
        let mut new = Self {
            square: [[0.0; SAMPLES]; 2],
            shifted: [[[0.0; SAMPLES]; 2]; 2],
            weight: 1.0,
            squares: 1.0,
        };
        for axis in 0..2 {
            let n = frame[axis];
            let step = n / SAMPLES as f64;
            let (mut weight, mut squares) = (0.0, 0.0);
            for i in 0..SAMPLES {
                let x = (i as f64 + 0.5) * step - 0.5;
                let w = hann_at(x, n as usize);
                let [ahead, behind] =
                    [x + lag[axis], x - lag[axis]].map(|x| hann_at(x, n as usize));
                new.square[axis][i] = w * w * step;
                new.shifted[axis][0][i] = ahead;
                new.shifted[axis][1][i] = behind;
                weight += w * ahead * step;
                squares += (w * ahead).powi(2) * step;
            }
            new.weight *= weight;
            new.squares *= squares;
        }
        new.squares /= new.weight * new.weight;
        new
    }

    /// `κ(R, R')`: the four products of shifted windows, each separable.
    pub(super) fn kappa(&self, other: &Self) -> f64 {
        let mut total = 0.0;
        for (a, b) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let term: f64 = (0..2)
                .map(|axis| {
                    let (s, t) = (&self.shifted[axis][a], &other.shifted[axis][b]);
                    let squares = self.square[axis].iter();
                    squares
                        .zip(s)
                        .zip(t)
                        .map(|((w, s), t)| w * s * t)
                        .sum::<f64>()
                })
                .product();
            total += if a == b { term } else { -term };
        }
        total / (self.weight * other.weight)
    }
}
