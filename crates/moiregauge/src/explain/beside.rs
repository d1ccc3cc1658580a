//! Waves beside a lattice: stripes, hum, a second moiré.
//!
//! They are part of every description of an image: what they make of a block is known from the other blocks, and stripes that no description holds
//! drown a weak shell.

use std::f64::consts::{PI, TAU};

use nalgebra::{Matrix2, Vector2};

use crate::explain::normal::Phases;
use crate::explain::scene::Scene;
use crate::frame::image::Image;
use crate::numbers::median::median;
use crate::spectrum::error::SECOND;
use crate::spectrum::shells::FIRST_SHELL;
use crate::spectrum::transform::Spectrum;

/// Waves that are taken off, at most: stripes with an overtone, and hum beside them.
const MOST: usize = 4;
/// Waves are compared with what is around them to this distance, cycles per frame: some seventy, whose median is known to an eighth.
const AROUND: f64 = 5.0;
/// The strongest waves that are compared so: peaks of slow ground may be stronger than stripes.
const LOOKED_AT: usize = 12;
/// Half of the main lobe of the window, cycles per frame: nearer to a point of the lattice a wave is its own.
const LOBE: f64 = 1.6;
/// Distance from the points of strong harmonics that holds their skirts, cycles per frame: those of a lattice that bends, or ends.
const SKIRT: f64 = 3.0;
/// Fastest wave that counts, rad per bin: at the limit of sampling a wave is its own mirror image.
const FASTEST: f64 = 0.9 * PI;
/// Fewest cycles in the frame: slower waves are background.
const SLOWEST: f64 = 2.0;
/// Fewest cycles along a line: what whole lines do has fewer.
const LINES: i64 = 2;

impl Scene {
    /// The same without the waves beside a lattice (reciprocal pair, rad per bin; its harmonics are `indices`) that are as strong as the weakest of its
    /// first order. `strong`: the lattice of those of its harmonics that have skirts.
    pub(crate) fn without_waves_beside(
        mut self,
        pair: &Matrix2<f64>,
        strong: &Matrix2<f64>,
        indices: &[[i32; 2]],
    ) -> Self {
        let wave = |[h, k]: &[i32; 2]| pair * Vector2::new(f64::from(*h), f64::from(*k));
        let all = self.powers(&self.values);
        let of_first = FIRST_SHELL.iter().map(wave).map(|first| {
            let own = all.iter().filter(|(q, _)| self.cycles(q - first) < LOBE);
            own.map(|(_, power)| *power).fold(0.0, f64::max)
        });
        let least = of_first.fold(f64::INFINITY, f64::min);
        let lattices = [pair, strong].map(|pair| (*pair, pair.try_inverse()));
        let strongest = |powers: &[(Vector2<f64>, f64)]| {
            let is_other = |q: &Vector2<f64>| {
                self.to_nearest(q, &lattices[0]) > LOBE && self.to_nearest(q, &lattices[1]) > SKIRT
            };
            let stands_out = |(q, power): &&(Vector2<f64>, f64)| {
                let around = powers
                    .iter()
                    .filter(|(other, _)| self.cycles(other - q) < AROUND);
                let mut around: Vec<f64> = around.map(|(_, power)| *power).collect();
                *power > SECOND * median(&mut around) / std::f64::consts::LN_2
            };
            let enough = powers.iter().filter(|(_, power)| *power > least);
            let mut others: Vec<_> = enough.filter(|(q, _)| is_other(q)).collect();
            let mut sizes: Vec<f64> = others.iter().map(|(_, power)| *power).collect();
            if let Some(beyond) = sizes.len().checked_sub(LOOKED_AT) {
                let least = *sizes.select_nth_unstable_by(beyond, f64::total_cmp).1;
                others.retain(|(_, power)| *power >= least);
            }
            others.sort_by(|a, b| b.1.total_cmp(&a.1));
            let mut others = others.into_iter().take(LOOKED_AT);
            others.find(stands_out).map(|(q, _)| *q)
        };
        if strongest(&all).is_none() {
            return self;
        }
        let lattice = Phases::straight(*pair);
        let Some(values) = lattice.residual(&self, indices) else {
            return self;
        };
        let rest = Self {
            values,
            ..self.clone()
        };
        let (mut waves, mut left) = (lattice, rest.values.clone());
        while waves.others.len() < MOST
            && let Some(wave) = strongest(&self.powers(&left))
        {
            waves.others.push(wave);
            let fitted = waves.clone().fitted(&rest, &[], 0);
            let Some(without) = fitted.as_ref().and_then(|f| f.residual(&rest, &[])) else {
                break;
            };
            left = without;
            waves = fitted.unwrap_or(waves);
        }
        let taken = rest.values.iter().zip(&left).map(|(all, left)| all - left);
        let values = self.values.iter_mut().zip(taken);
        values.for_each(|(value, taken)| *value -= taken);
        self
    }

    /// Distance of a wave vector from the nearest point of a lattice (reciprocal pair, rad per bin, and its inverse), cycles per frame.
    fn to_nearest(
        &self,
        q: &Vector2<f64>,
        (pair, inverse): &(Matrix2<f64>, Option<Matrix2<f64>>),
    ) -> f64 {
        let nearest = inverse.map(|inverse| pair * (inverse * q).map(f64::round));
        nearest.map_or(0.0, |nearest| self.cycles(q - nearest))
    }

    /// Cycles of the frame of a wave vector, rad per bin.
    fn cycles(&self, q: Vector2<f64>) -> f64 {
        let rows = self.values.len() / self.columns;
        q.component_mul(&Vector2::new(self.columns as f64, rows as f64))
            .norm()
            / TAU
    }

    /// Wave vectors (rad per bin) and powers of all waves under a window but for background and what whole lines do.
    fn powers(&self, values: &[f64]) -> Vec<(Vector2<f64>, f64)> {
        let rows = values.len() / self.columns;
        let spectrum = Spectrum::unpadded(&Image::new(rows, self.columns, values.to_vec()));
        let (half, lines) = (spectrum.half() as i64, rows as i64);
        let bins =
            (-lines / 2..(lines + 1) / 2).flat_map(|y| (LINES..half - 1).map(move |x| (x, y)));
        let wave = |(x, y)| {
            let q = spectrum
                .step()
                .component_mul(&Vector2::new(x as f64, y as f64));
            (q, spectrum.at(x, y).norm_sqr())
        };
        let counts =
            |(q, _): &(Vector2<f64>, f64)| self.cycles(*q) > SLOWEST && q.abs().max() < FASTEST;
        bins.map(wave).filter(counts).collect()
    }
}
