//! Envelopes of all harmonics → the two local wave vectors, their covariance and how they close.
//!
//! Every harmonic (h, k) says `h q₁ + k q₂`; weighted least squares over all of them. For white or locally
//! white noise the weights are `2|c₀|²/S`, and the covariance of (q₁, q₂) is `N⁻¹ ⊗ Γ` with the 2 × 2
//! normal matrix N of the indices and Γ the slope noise of the window. One cosine of amplitude A = 2|c₀|
//! under a whole window: `σ_g = (σ/A)/(2√π w²)`.
//!
//! Two gradients and more over-determine q₁ and q₂: χ² of what is left is the closure test.

use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;

use super::blocks::Blocks;
use super::noise::Noise;
use super::smooth::{Smoothed, Support};

/// Harmonics below this many noise units (amplitude) are left out of a node.
const FAINT: f64 = 3.0;
/// Without two harmonics above this many there is no lattice at a node.
const WEAKEST: f64 = 4.0;
/// Relative error of slopes from single precision, times the inverse of the window.
const ROUNDING: f64 = 3e-6;

/// The local lattice at a node, in pixels.
#[derive(Clone, Copy, Debug)]
pub(super) struct LocalLattice {
    /// q₁, q₂ as columns, rad per pixel.
    pub(super) pair: Matrix2<f64>,
    /// N⁻¹: covariance of the pair in units of `slope`.
    pub(super) indices: Matrix2<f64>,
    /// Γ: covariance of the two components of a slope at unit weight.
    pub(super) slope: Matrix2<f64>,
    /// χ² of the closure, and its degrees of freedom.
    pub(super) chi2: f64,
    pub(super) freedom: usize,
    /// Signal power over noise power of the window, all harmonics.
    pub(super) signal_to_noise: f64,
}

/// Why a node has no lattice of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Nothing {
    /// The window holds no pixels.
    NoPixels,
    /// The signal does not stand out.
    Weak,
}

/// What the regression needs beside envelopes.
pub(super) struct Harmonics<'a> {
    /// (h, k) of each envelope.
    pub(super) indices: &'a [[i32; 2]],
    pub(super) noise: &'a Noise,
    /// How far other harmonics that reach through the window can pull each slope, rad per pixel.
    pub(super) leaks: Vec<f64>,
}

impl<'a> Harmonics<'a> {
    /// `pair` and the mean amplitudes say what leaks through a window of this width (pixels).
    pub(super) fn new(
        (indices, noise): (&'a [[i32; 2]], &'a Noise),
        pair: &Matrix2<f64>,
        amplitudes: &[f64],
        width: [f64; 2],
    ) -> Self {
        let vector = |[h, k]: [i32; 2]| pair * Vector2::new(f64::from(h), f64::from(k));
        let leak = |i: usize| {
            let mut sum = ROUNDING / width[0].min(width[1]);
            for (j, amplitude) in amplitudes.iter().enumerate() {
                for sign in [1.0, -1.0] {
                    if i == j && sign > 0.0 {
                        continue;
                    }
                    let apart = vector(indices[i]) - sign * vector(indices[j]);
                    let in_widths = Vector2::new(apart.x * width[0], apart.y * width[1]);
                    let share = (-0.5 * in_widths.norm_squared()).exp();
                    sum += share * apart.norm() * amplitude / amplitudes[i].max(f64::MIN_POSITIVE);
                }
            }
            sum
        };
        Self {
            indices,
            noise,
            leaks: (0..indices.len()).map(leak).collect(),
        }
    }
}

/// The local lattice of every node. `reference` gives what was taken off at a place: the slopes of the
/// carrier and the mean pair together, rad per pixel.
pub(super) fn local_lattices(
    blocks: &Blocks,
    smoothed: &Smoothed,
    harmonics: &Harmonics,
    reference: impl Fn(Vector2<f64>) -> Matrix2<f64> + Sync,
) -> Vec<Result<LocalLattice, Nothing>> {
    (0..smoothed.nodes.len())
        .into_par_iter()
        .map(|node| {
            let support = smoothed.support[node].ok_or(Nothing::NoPixels)?;
            let at = smoothed.nodes.place(blocks, node);
            let mut lattice = regression(smoothed, node, &support, harmonics, at)?;
            lattice.pair += reference(at);
            Ok(lattice)
        })
        .collect()
}

fn regression(
    smoothed: &Smoothed,
    node: usize,
    support: &Support,
    harmonics: &Harmonics,
    at: Vector2<f64>,
) -> Result<LocalLattice, Nothing> {
    let ratio = harmonics.noise.ratio(at);
    let spread = 0.5 * support.slope_noise.trace();
    let inverse = support.slope_noise.try_inverse().ok_or(Nothing::NoPixels)?;
    let (mut normal, mut right) = (Matrix2::zeros(), Matrix2::zeros());
    let mut terms = Vec::with_capacity(harmonics.indices.len());
    let mut strong = Vec::with_capacity(harmonics.indices.len());
    let mut signal_to_noise = 0.0;
    for (i, envelope) in smoothed.envelopes.iter().enumerate() {
        let level = harmonics.noise.levels[i] * ratio;
        let power = f64::from(envelope.amplitude[node].norm_sqr());
        let unit = level * support.amplitude_noise;
        if power <= FAINT * FAINT * unit || power <= 0.0 {
            continue;
        }
        // Noise adds to the power.
        let signal = power - unit;
        if power > WEAKEST * WEAKEST * unit {
            strong.push(harmonics.indices[i]);
        }
        signal_to_noise += if unit > 0.0 {
            signal / unit
        } else {
            f64::INFINITY
        };
        let unsure = envelope.unsure.get(node).copied().map_or(0.0, f64::from);
        let leaks = harmonics.leaks[i].powi(2) + unsure * unsure;
        let variance = harmonics.noise.disagreement * level / (2.0 * signal) + leaks / spread;
        let weight = 1.0 / variance;
        let index = Vector2::from(harmonics.indices[i].map(f64::from));
        let [x, y] = envelope.slope[node].map(f64::from);
        normal += weight * index * index.transpose();
        right += weight * Vector2::new(x, y) * index.transpose();
        terms.push((weight, index, Vector2::new(x, y)));
    }
    let independent = strong
        .iter()
        .any(|a| strong.iter().any(|b| a[0] * b[1] != a[1] * b[0]));
    if !independent {
        return Err(Nothing::Weak);
    }
    let indices = normal.try_inverse().ok_or(Nothing::Weak)?;
    let pair = right * indices;
    let chi2 = terms.iter().map(|(weight, index, slope)| {
        let miss = slope - pair * index;
        weight * (miss.transpose() * inverse * miss)[0]
    });
    Ok(LocalLattice {
        pair,
        indices,
        slope: support.slope_noise,
        chi2: chi2.sum(),
        freedom: 2 * terms.len() - 4,
        signal_to_noise,
    })
}
