//! Waves beside a lattice: stripes, hum, a second moiré.
//!
//! They are part of every description of an image: what they make of a block is known from the other blocks, and stripes that no description holds
//! drown a weak shell.

use std::f64::consts::{PI, TAU};

use nalgebra::{Matrix2, Vector2};

use crate::explain::normal::Phases;
use crate::explain::scene::Scene;
use crate::frame::image::Image;
use crate::spectrum::error::SECOND;
use crate::spectrum::transform::Spectrum;

/// Waves that are taken off, at most: stripes with an overtone, and hum beside them.
const MOST: usize = 4;
/// Half of the main lobe of the window, cycles per frame: nearer to a point of the lattice a wave is its own.
const LOBE: f64 = 1.6;
/// Fewest cycles in the frame: slower waves are background.
const SLOWEST: f64 = 2.0;

impl Scene {
    /// The same without the strongest waves beside a lattice (reciprocal pair, rad per bin), whose harmonics are `indices`.
    pub(crate) fn without_waves_beside(
        mut self,
        pair: &Matrix2<f64>,
        indices: &[[i32; 2]],
    ) -> Self {
        let lattice = Phases::straight(*pair);
        let Some(values) = lattice.residual(&self, indices) else {
            return self;
        };
        let own: Vec<Vector2<f64>> = (indices.iter())
            .map(|[h, k]| pair * Vector2::new(f64::from(*h), f64::from(*k)))
            .flat_map(|q| [q, -q])
            .collect();
        let mut rest = Self {
            values,
            ..self.clone()
        };
        let mut waves = lattice.clone();
        let mut left = rest.values.clone();
        while waves.others.len() < MOST
            && let Some(wave) = self.strongest_beside(&left, &own)
        {
            waves.others.push(wave);
            let Some(fitted) = waves.clone().fitted(&rest, &[], 0) else {
                break;
            };
            waves = fitted;
            let Some(without) = waves.residual(&rest, &[]) else {
                break;
            };
            left = without;
        }
        if !waves.others.is_empty() {
            let taken = rest.values.iter().zip(&left).map(|(a, b)| a - b);
            rest.values = self.values.iter().zip(taken).map(|(a, b)| a - b).collect();
            self.values = rest.values;
        }
        self
    }

    /// The wave vector (rad per bin) of the strongest wave beside some others that stands out of the noise.
    fn strongest_beside(&self, values: &[f64], own: &[Vector2<f64>]) -> Option<Vector2<f64>> {
        let rows = values.len() / self.columns;
        let spectrum = Spectrum::new(&Image::new(rows, self.columns, values.to_vec()));
        let step = spectrum.step();
        let frame = Vector2::new(self.columns as f64, rows as f64) / TAU;
        let (half, lines) = (spectrum.half() as i64, spectrum.rows as i64);
        let mut powers = Vec::new();
        let mut best: Option<(f64, Vector2<f64>)> = None;
        for (y, x) in (-lines / 2..(lines + 1) / 2).flat_map(|y| (0..half - 1).map(move |x| (y, x)))
        {
            let q = step.component_mul(&Vector2::new(x as f64, y as f64));
            let cycles = |q: Vector2<f64>| q.component_mul(&frame).norm();
            if cycles(q) < SLOWEST || q.amax().max(-q.amin()) > 0.9 * PI {
                continue;
            }
            let power = spectrum.at(x, y).norm_sqr();
            powers.push(power);
            if best.is_none_or(|(most, _)| power > most)
                && own.iter().all(|own| cycles(q - own) > LOBE)
            {
                best = Some((power, q));
            }
        }
        let (power, wave) = best?;
        let noise = crate::numbers::median::median(&mut powers) / std::f64::consts::LN_2;
        (power > SECOND * noise).then_some(wave)
    }
}
