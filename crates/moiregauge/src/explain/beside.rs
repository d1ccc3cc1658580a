//! Waves beside a lattice: stripes, hum, a second moiré.
//!
//! They are part of every description of an image: what they make of a block is known from the other blocks, and stripes that no description holds
//! drown a weak shell.

use std::f64::consts::TAU;

use nalgebra::{Matrix2, Vector2};
use rustfft::num_complex::Complex64;
use serde::{Deserialize, Serialize};

use crate::explain::evidence::{BETTER, Blocks};
use crate::explain::normal::{gains, total};
use crate::explain::phases::Phases;
use crate::explain::scene::Scene;
use crate::frame::image::Image;
use crate::numbers::exact;
use crate::numbers::median::median;
use crate::spectrum::error::SECOND;
use crate::spectrum::shells::{FASTEST, FIRST_SHELL, shells};
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
/// Fewest cycles in the frame: slower waves are background.
const SLOWEST: f64 = 2.0;
/// Fewest cycles along a line: what whole lines do has fewer.
const LINES: i64 = 2;
/// Reach of the search for a wave vector, cycles per frame, in steps of a fifth of that.
const REACH: f64 = 1.0;

/// A wave that a lattice does not explain.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct WaveBeside {
    /// Its wave vector, rad per pixel.
    #[serde(with = "exact")]
    pub wave_vector: Vector2<f64>,
    /// Its amplitude over that of the weakest first-order wave of the lattice.
    #[serde(with = "exact")]
    pub strength: f64,
    /// By how many standard errors it improves the prediction of blocks of the frame that were held out.
    #[serde(with = "exact")]
    pub predicts: f64,
}

/// The wave beside a lattice (reciprocal pair, rad per pixel) that predicts best, if it is not chance. `bends`: phases may be cubic polynomials.
pub(crate) fn wave_beside(image: &Image, pair: &Matrix2<f64>, bends: bool) -> Option<WaveBeside> {
    let scene = Scene::new(image, pair, pair)?;
    let indices = shells(3);
    let lattice = Phases::shown(&scene, pair * scene.binning as f64, bends);
    let rest = lattice.residual(&scene, indices)?;
    let powers = scene.powers(&lattice.straightened(&scene, &rest));
    let own = (lattice.pair, lattice.pair.try_inverse());
    let mut peaks: Vec<_> = powers
        .iter()
        .filter(|(q, _)| scene.to_nearest(q, &own) > SKIRT)
        .collect();
    peaks.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut waves: Vec<Vector2<f64>> = Vec::new();
    for (q, _) in peaks {
        if waves.iter().all(|other| scene.cycles(q - other) > SKIRT) {
            waves.push(*q);
        }
        if waves.len() == MOST {
            break;
        }
    }
    let near = waves.into_iter();
    let near = near.map(|q| strongest_near(&scene, &lattice, &rest, q));
    let mut with = lattice.clone();
    with.others = near.collect();
    let normals = with.normals(&scene, indices);
    let all = total(&normals);
    let own: Vec<usize> = (0..2 * indices.len()).collect();
    let without = gains(&normals, &own)?;
    let beside = with.others.iter().enumerate().filter_map(|(j, q)| {
        let first = 2 * (indices.len() + j);
        let kept = [&own[..], &[first, first + 1]].concat();
        let amplitudes = Phases::amplitudes(&all.part(&kept))?;
        let lattice = FIRST_SHELL.iter().filter_map(|index| {
            let at = indices.iter().position(|other| other == index)?;
            Some(amplitudes[at])
        });
        Some(WaveBeside {
            wave_vector: q / scene.binning as f64,
            strength: amplitudes[indices.len()] / lattice.fold(f64::INFINITY, f64::min),
            predicts: Blocks::difference(&scene, &gains(&normals, &kept)?, &without)
                .standard_errors(),
        })
    });
    let best = beside.max_by(|a, b| a.predicts.total_cmp(&b.predicts))?;
    (best.predicts > BETTER).then_some(best)
}

impl Scene {
    /// The same without the waves beside a lattice (reciprocal pair, rad per bin; its harmonics are `indices`) that are as strong as the weakest of its
    /// first order. `strong`: the lattice of those of its harmonics that have skirts.
    pub(crate) fn without_waves_beside(
        mut self,
        pair: &Matrix2<f64>,
        strong: &Matrix2<f64>,
        indices: &[[i32; 2]],
    ) -> Self {
        let taken = || {
            let (waves, rest) = self.waves_beside(pair, Some(strong), indices)?;
            let left = waves.fitted(&rest, &[], 0)?.residual(&rest, &[])?;
            let both = rest.values.iter().zip(left);
            Some(both.map(|(all, left)| all - left).collect())
        };
        let taken: Option<Vec<f64>> = taken();
        let values = self.values.iter_mut().zip(taken.into_iter().flatten());
        values.for_each(|(value, taken)| *value -= taken);
        self
    }

    /// The same waves, roughly, and the image without the lattice; `strong`: `None` for harmonics without skirts.
    pub(crate) fn waves_beside(
        &self,
        pair: &Matrix2<f64>,
        strong: Option<&Matrix2<f64>>,
        indices: &[[i32; 2]],
    ) -> Option<(Phases, Self)> {
        let wave = |[h, k]: &[i32; 2]| pair * Vector2::new(f64::from(*h), f64::from(*k));
        let all = self.powers(&self.values);
        let power_at = |q: Vector2<f64>| {
            let own = all.iter().filter(|(k, _)| self.cycles(k - q) < LOBE);
            own.map(|(_, power)| *power).fold(0.0, f64::max)
        };
        let weakest = |shell: &[[i32; 2]]| {
            let powers = shell.iter().map(|index| power_at(wave(index)));
            powers.fold(f64::INFINITY, f64::min)
        };
        let least = weakest(&FIRST_SHELL);
        let inverted = |pair: &Matrix2<f64>| (*pair, pair.try_inverse());
        let (own, skirts) = (inverted(pair), strong.map(inverted));
        let strongest = |powers: &[(Vector2<f64>, f64)]| {
            let is_other = |q: &Vector2<f64>| {
                let is_free = |skirts| self.to_nearest(q, skirts) > SKIRT;
                self.to_nearest(q, &own) > LOBE && skirts.as_ref().is_none_or(is_free)
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
        strongest(&all)?;
        let lattice = Phases::straight(*pair);
        let values = lattice.residual(self, indices)?;
        let rest = Self {
            values,
            ..self.clone()
        };
        // Each alone in what those before leave.
        let (mut waves, mut left) = (lattice, rest.clone());
        while waves.others.len() < MOST
            && let Some(wave) = strongest(&self.powers(&left.values))
        {
            let mut alone = Phases::straight(*pair);
            alone.others.push(wave);
            let Some(fitted) = alone.fitted(&left, &[], 0) else {
                break;
            };
            waves.others.extend(fitted.others);
            left.values = waves.residual(&rest, &[])?;
        }
        Some((waves, rest))
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
        self.in_cycles(&q).norm()
    }

    /// The same along both axes.
    fn in_cycles(&self, q: &Vector2<f64>) -> Vector2<f64> {
        let rows = self.values.len() / self.columns;
        q.component_mul(&Vector2::new(self.columns as f64, rows as f64)) / TAU
    }

    /// Whether some waves (rad per bin) have one direction, as stripes and their overtones.
    pub(crate) fn are_stripes(&self, waves: &[Vector2<f64>]) -> bool {
        let waves: Vec<Vector2<f64>> = waves.iter().map(|q| self.in_cycles(q)).collect();
        let along = |a: &Vector2<f64>| waves.iter().all(|b| a.perp(b).abs() < LOBE * a.norm());
        waves.iter().any(along)
    }

    /// Whether three of some waves (rad per bin), in different directions, add up to zero: they are a lattice.
    pub(crate) fn add_up(&self, waves: &[Vector2<f64>]) -> bool {
        let waves: Vec<Vector2<f64>> = waves.iter().map(|q| self.in_cycles(q)).collect();
        let add_up = |a: &Vector2<f64>, b: &Vector2<f64>, c: &Vector2<f64>| {
            let sums = [a + b + c, a + b - c, a - b + c, b + c - a];
            a.perp(b).abs() > LOBE * a.norm() && sums.iter().any(|sum| sum.norm() < LOBE)
        };
        let pairs = (0..waves.len()).flat_map(|i| (0..i).map(move |j| [i, j]));
        pairs.into_iter().any(|[i, j]| {
            let third = waves[..j].iter();
            third.into_iter().any(|c| add_up(&waves[i], &waves[j], c))
        })
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

/// The wave vector (rad per bin) with the most power near a given one, of waves that bend as a lattice does.
pub(crate) fn strongest_near(
    scene: &Scene,
    lattice: &Phases,
    values: &[f64],
    q: Vector2<f64>,
) -> Vector2<f64> {
    let step = scene.half.map(|half| TAU / (2.0 * half)) * (REACH / 5.0);
    let values = lattice.unbent(scene, values, q);
    // Sums along lines for each wave across them, and of these for each wave along them.
    let steps = || (-5..=5).map(f64::from);
    let near = steps().flat_map(|i| {
        let across = q.x + i * step.x;
        let waves = (0..scene.columns).map(|x| -across * (x as f64 - scene.middle.x));
        let waves: Vec<Complex64> = waves.map(Complex64::cis).collect();
        let lines = values.chunks_exact(scene.columns);
        let line = |line: &[Complex64]| line.iter().zip(&waves).map(|(a, b)| a * b).sum();
        let sums: Vec<Complex64> = lines.map(line).collect();
        steps().map(move |j| {
            let up = q.y + j * step.y;
            let turn = |y| Complex64::cis(-up * (y as f64 - scene.middle.y));
            let sum: Complex64 = sums.iter().enumerate().map(|(y, s)| s * turn(y)).sum();
            (sum.norm_sqr(), Vector2::new(across, up))
        })
    });
    let best = near.max_by(|a, b| a.0.total_cmp(&b.0));
    best.map_or(q, |(_, q)| q)
}
