//! The sample: a periodic pattern given by the harmonics of the moiré.
//!
//! `I(R) = Σ A_hk cos((h G₁ + k G₂)·(R − R₀) + φ_hk)`, G the reciprocal vectors dual to the moiré
//! vectors (rad/nm). Amplitudes `s^(N−1)`, N = |hG₁ + kG₂|²/|G|², are those of Gaussian spots.

use heterostrain::strain::{moire_of, moire_pair_of};
use nalgebra::{Matrix2, Vector2};
use rand_distr::{Distribution, StandardNormal};

use crate::numbers::rng;
use crate::simulate::error::SimulateError;
use crate::simulate::settings::{Pattern, Sample};

/// One harmonic of the pattern.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Harmonic {
    /// (h, k); zero for waves that belong to no lattice.
    pub(crate) index: [i32; 2],
    /// rad/nm.
    pub(crate) wave: Vector2<f64>,
    /// Degrees of phase.
    pub(crate) amplitude: f64,
    /// At R = 0, rad.
    pub(crate) phase: f64,
}

/// The pattern.
#[derive(Clone, Debug)]
pub(crate) struct Scene {
    /// Moiré vectors as columns, nm.
    pub(crate) basis: Matrix2<f64>,
    /// Reciprocal vectors as columns, rad/nm.
    pub(crate) reciprocal: Matrix2<f64>,
    pub(crate) harmonics: Vec<Harmonic>,
}

/// Half of the harmonics (h, k) of the first five shells; G₁ and G₂ are 120° apart, so that
/// N = h² − hk + k².
const SHELLS: [(i32, i32); 18] = [
    (1, 0),
    (0, 1),
    (1, 1),
    (1, -1),
    (2, 1),
    (1, 2),
    (2, 0),
    (0, 2),
    (2, 2),
    (3, 1),
    (3, 2),
    (2, 3),
    (1, 3),
    (1, -2),
    (2, -1),
    (3, 0),
    (0, 3),
    (3, 3),
];

/// Harmonics fainter than this share of the first ones are left out: any small number, below all noise.
const FAINTEST: f64 = 1e-6;

impl Scene {
    pub(crate) fn new(sample: &Sample) -> Result<Self, SimulateError> {
        let (stacking, bilayer) = (sample.stacking(), sample.bilayer());
        let basis = match sample.pattern {
            // The contrast follows the stacking: the waves b₂ − b₁ are the strong ones, whatever the strain.
            Pattern::Moire
                if bilayer.reference.is_hexagonal() && bilayer.stretched.is_hexagonal() =>
            {
                moire_pair_of(&stacking, bilayer, sample.strain_convention)?
            }
            Pattern::Moire => moire_of(&stacking, bilayer, sample.strain_convention)?,
            Pattern::Layer1 => stacking.atoms(bilayer, sample.strain_convention)?[0],
            Pattern::Layer2 => stacking.atoms(bilayer, sample.strain_convention)?[1],
        };
        let inverse = basis
            .try_inverse()
            .ok_or(heterostrain::strain::StrainError::NoMoire)?;
        let reciprocal = std::f64::consts::TAU * inverse.transpose();
        let mut rng = rng::stream(sample.seed, "simulate sample", 0);
        let mut spread = || -> f64 {
            let normal: f64 = StandardNormal.sample(&mut rng);
            sample.irregularity * normal
        };
        let origin = Vector2::from(sample.origin_nm);
        let mut harmonics = Vec::new();
        for (h, k) in SHELLS {
            let order = h * h - h * k + k * k;
            let relative = sample.sharpness.powi(order - 1);
            if relative < FAINTEST {
                continue;
            }
            let wave = reciprocal * Vector2::new(f64::from(h), f64::from(k));
            let (change, shift) = if order == 1 {
                (spread(), spread())
            } else {
                (0.0, 0.0)
            };
            harmonics.push(Harmonic {
                index: [h, k],
                wave,
                amplitude: sample.contrast_deg * relative * (1.0 + change),
                phase: shift - wave.dot(&origin),
            });
        }
        Ok(Self {
            basis,
            reciprocal,
            harmonics,
        })
    }
}
