//! Ground without a lattice, as sums of plane waves in the frame of the sample: terrain, ripples, stripes.

use nalgebra::Vector2;
use rand::RngExt as _;
use rand_distr::{Distribution, StandardNormal};

use crate::numbers::rng;
use crate::simulate::feature::SampleFeature;
use crate::simulate::reference::Reference;
use crate::simulate::scene::Harmonic;

/// Waves of a terrain: enough that no single one stands out ...
const TERRAIN_WAVES: usize = 160;
/// ... from three times the frame down to a fiftieth of it.
const TERRAIN_LENGTHS: [f64; 2] = [3.0, 0.02];
/// Waves of ripples; they beat over some wavelengths over the spread.
const RIPPLE_WAVES: usize = 24;
/// Harmonics of stripes.
const STRIPE_HARMONICS: i32 = 4;

/// The waves of a class, none if it has none.
pub(crate) fn waves(
    feature: &SampleFeature,
    reference: &Reference,
    seed: u64,
    index: u64,
) -> Vec<Harmonic> {
    let mut rng = rng::stream(seed, "simulate ground", index);
    let angle = feature.value("angle").to_radians();
    match feature.class.as_str() {
        "terrain" => terrain(feature, reference, &mut rng),
        "ripples" => {
            let (length, spread) = (feature.value("wavelength"), feature.value("spread"));
            let amplitude = feature.value("amplitude") / (RIPPLE_WAVES as f64).sqrt();
            let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
            (0..RIPPLE_WAVES)
                .map(|_| {
                    let k = (1.0 + spread * normal()).max(0.1) / length;
                    let phase = normal() * 10.0;
                    wave(k, angle + spread * normal(), amplitude, phase)
                })
                .collect()
        }
        "stripes" => {
            let (length, sharpness) = (feature.value("wavelength"), feature.value("sharpness"));
            let amplitude = feature.value("amplitude");
            (1..=STRIPE_HARMONICS)
                .map(|n| {
                    let height = amplitude * sharpness.powi(n * n - 1);
                    wave(f64::from(n) / length, angle, height, 0.0)
                })
                .collect()
        }
        _ => Vec::new(),
    }
}

/// Wave numbers evenly in the logarithm, each with the power of its octave.
fn terrain(
    feature: &SampleFeature,
    reference: &Reference,
    rng: &mut impl rand::Rng,
) -> Vec<Harmonic> {
    let (rms, exponent) = (feature.value("rms"), feature.value("exponent"));
    let [long, short] = TERRAIN_LENGTHS.map(|share| share * reference.side());
    let mut all: Vec<Harmonic> = (0..TERRAIN_WAVES)
        .map(|n| {
            let share = (n as f64 + rng.random::<f64>()) / TERRAIN_WAVES as f64;
            let k = (1.0 / long) * (long / short).powf(share);
            // The density of a plane: the power of an octave goes with k² P(k).
            let amplitude = (k * long).powf(1.0 - exponent / 2.0);
            let turn = std::f64::consts::TAU * rng.random::<f64>();
            let phase = std::f64::consts::TAU * rng.random::<f64>();
            wave(k, turn, amplitude, phase)
        })
        .collect();
    let power: f64 = all.iter().map(|h| h.amplitude * h.amplitude / 2.0).sum();
    for harmonic in &mut all {
        harmonic.amplitude *= rms / power.sqrt();
    }
    all
}

/// A plane wave with k cycles per nm.
fn wave(k: f64, angle: f64, amplitude: f64, phase: f64) -> Harmonic {
    Harmonic {
        index: [0, 0],
        wave: Vector2::new(angle.cos(), angle.sin()) * k * std::f64::consts::TAU,
        amplitude,
        phase,
    }
}
