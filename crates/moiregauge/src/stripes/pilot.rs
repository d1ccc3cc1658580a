//! A first look at a pattern: its noise, the harmonics that tell something, the carrier, how wide the window may be.

use nalgebra::{Matrix2, Rotation2, Vector2};

use crate::frame::image::Image;
use crate::numbers::median::median;
use crate::stripes::wave::Wave;
use crate::window::blocks::{Place, mix};
use crate::window::carrier::{Carrier, MOST_CELLS, Slope};
use crate::window::lines::Levelled;
use crate::window::smooth::{Smoothed, smooth};
use crate::window::widths as window;

/// The pilot's window in wavelengths: a little more than for lattices. Chosen by eye.
const PILOT: f64 = 0.75;
/// A harmonic that adds less than this share to what is known is left out: one per cent of the errors.
const WORTH: f64 = 0.02;
/// The carrier is for frames of so many periods, its cells as long. Chosen by eye.
const CARRIED: f64 = 12.0;
/// Times the carrier is brought up to date: as for lattices.
const ROUNDS: usize = 3;
/// Nodes along each axis to which the carrier is fitted: as for lattices, ...
const FOLLOWED: usize = 100;
/// ... and by which windows are chosen.
const LOOKED_AT: usize = 40;
/// Window of the probes for noise in wavelengths, lest waves reach them.
const PROBE: f64 = 1.3;
/// Nodes nearer to edges than so many probes are not looked at, since waves that are cut off reach them, ...
const AWAY: f64 = 2.5;
/// ... and so many have to be left: fewer tell no level. Chosen by eye.
const FEWEST: usize = 12;

impl Wave {
    /// Mean wave vector where the pattern is, rad per pixel.
    pub(crate) fn mean(&self) -> Vector2<f64> {
        let width = PILOT * self.wavelength();
        let smoothed = self.smoothed(width, self.sparse(width, LOOKED_AT));
        let locals = self.locals(&smoothed, width, &[]);
        let present = present(&smoothed).into_iter();
        let (sum, weight) = present
            .filter_map(|n| locals[n].as_ref())
            .fold((Vector2::zeros(), 0.0), |(s, w), l| {
                (s + l.wave * l.power, w + l.power)
            });
        if weight > 0.0 {
            sum / weight
        } else {
            self.reference.wave([1, 0])
        }
    }

    /// Reads the noise beside the harmonics, above and below along ky (noise in time is a function of kx).
    pub(crate) fn see_noise(&mut self, (image, place): (&Image, Place), others: &[Vector2<f64>]) {
        let waves: Vec<Vector2<f64>> = self
            .indices
            .iter()
            .flat_map(|&index| self.beside(index, others))
            .collect();
        let width = self.reference.in_pixels(PROBE * self.wavelength());
        let nodes = self.sparse(0.5 * PROBE * self.wavelength(), FOLLOWED);
        let (low, high) = (Vector2::zeros(), self.frame);
        let mut levels = Vec::with_capacity(self.indices.len());
        for pair in waves.chunks(2) {
            let blocks = mix(&Levelled::as_is(image), place, pair, self.blocks.block);
            let smoothed = smooth(&blocks, width, nodes);
            let whole = |n: &usize| {
                let at = nodes.place(&blocks, *n);
                let inside = (0..2).all(|i| (at - low)[i].min((high - at)[i]) > AWAY * width[i]);
                inside && smoothed.support[*n].is_some_and(|s| s.share > 0.85)
            };
            let whole: Vec<usize> = (0..nodes.len()).filter(whole).collect();
            if whole.len() < FEWEST {
                return;
            }
            let mut powers: Vec<f64> = smoothed
                .envelopes
                .iter()
                .flat_map(|e| whole.iter().map(|&n| (e.amplitude[n], n)))
                .filter_map(|(a, n)| {
                    let unit = smoothed.support[n]?.amplitude_noise;
                    Some(f64::from(a.norm_sqr()) / unit)
                })
                .collect();
            levels.push(median(&mut powers) / std::f64::consts::LN_2);
        }
        self.levels = levels;
        self.noise_measured = true;
    }

    /// Two wave vectors beside a harmonic, as far from all harmonics of all patterns as can be.
    fn beside(&self, index: [i32; 2], others: &[Vector2<f64>]) -> [Vector2<f64>; 2] {
        let harmonic = self.reference.wave(index);
        let q = self.reference.wave([1, 0]);
        let metric = |v: Vector2<f64>| v.component_div(&Vector2::from(self.reference.pitch)).norm();
        let distance = |g: Vector2<f64>| {
            let all = others.iter().chain([&q]);
            let all = all.flat_map(|q| (-5..=5).map(move |m| g - q * f64::from(m)));
            all.map(metric).fold(f64::INFINITY, f64::min)
        };
        let up = Vector2::new(0.0, metric(q) * self.reference.pitch[1]);
        let aside = Rotation2::new(std::f64::consts::FRAC_PI_2)
            * q.component_div(&Vector2::from(self.reference.pitch));
        let aside = aside.component_mul(&Vector2::from(self.reference.pitch));
        [1.0, -1.0].map(|side| {
            let tried = [0.5, 0.6, 0.7, 0.8, 0.9].map(|share| side * share);
            let along = tried.map(|share| harmonic + up * share);
            let best = |all: &[Vector2<f64>]| {
                all.iter()
                    .copied()
                    .max_by(|a, b| distance(*a).total_cmp(&distance(*b)))
            };
            match best(&along) {
                Some(g) if distance(g) > 0.45 * metric(q) => g,
                _ => best(&tried.map(|share| harmonic + aside * share)).unwrap_or(harmonic + up),
            }
        })
    }

    /// Keeps the harmonics that tell something where the pattern is.
    pub(crate) fn choose_harmonics(&mut self) {
        let width = PILOT * self.wavelength();
        let smoothed = self.smoothed(width, self.sparse(width, LOOKED_AT));
        let present = present(&smoothed);
        let power = |i: usize| {
            let (mut sum, mut units) = (0.0, 0.0);
            for &n in &present {
                sum += f64::from(smoothed.envelopes[i].amplitude[n].norm_sqr());
                units += smoothed.support[n].map_or(0.0, |s| self.levels[i] * s.amplitude_noise);
            }
            let count = (present.len() as f64).max(1.0);
            let chance = 4.0 * units / count / count.sqrt();
            let power = (sum - units) / count;
            if power > chance { power } else { 0.0 }
        };
        let powers: Vec<f64> = (0..self.indices.len()).map(power).collect();
        let worth = |i: usize| powers[i] * f64::from(self.indices[i][0].pow(2));
        let most = (0..powers.len()).map(worth).fold(0.0, f64::max);
        let keep: Vec<bool> = (0..powers.len())
            .map(|i| i == 0 || worth(i) > WORTH * most)
            .collect();
        self.powers = powers;
        let mut kept = keep.iter();
        self.powers.retain(|_| kept.next().is_some_and(|k| *k));
        let mut kept = keep.iter();
        self.levels.retain(|_| kept.next().is_some_and(|k| *k));
        let mut kept = keep.iter();
        self.indices.retain(|_| kept.next().is_some_and(|k| *k));
        let mut kept = keep.iter();
        self.blocks
            .layers
            .retain(|_| kept.next().is_some_and(|k| *k));
    }

    /// Fits the carrier to what a narrow window sees.
    pub(crate) fn follow(&mut self) {
        let wavelength = self.wavelength();
        let cells = [0, 1].map(|i| {
            let periods = self.frame[i] * self.reference.pitch[i] / wavelength;
            ((periods / CARRIED) as usize).min(MOST_CELLS)
        });
        if cells[0].min(cells[1]) == 0 {
            return;
        }
        let width = PILOT * wavelength;
        for _ in 0..ROUNDS {
            let smoothed = self.smoothed(width, self.sparse(width, FOLLOWED));
            let locals = self.locals(&smoothed, width, &[]);
            let present = present(&smoothed);
            let slopes: Vec<Slope> = present
                .iter()
                .filter_map(|&n| {
                    let change = locals[n].as_ref()?.wave - self.reference.wave([1, 0]);
                    Some(Slope {
                        at: smoothed.nodes.place(&self.blocks, n),
                        slopes: Matrix2::from_columns(&[change, Vector2::zeros()]),
                    })
                })
                .collect();
            // A pattern that is only here and there is not followed into what is none.
            if slopes.len() < 16 || slopes.len() * 2 < smoothed.nodes.len() {
                return;
            }
            let Some(carrier) = Carrier::fit(&slopes, (Vector2::zeros(), self.frame), cells) else {
                return;
            };
            let mut layers = std::mem::take(&mut self.blocks.layers);
            let all = (layers.as_mut_slice(), self.indices.as_slice());
            carrier.take_off(self.carrier.as_ref(), all, &self.blocks);
            self.blocks.layers = layers;
            self.carrier = Some(carrier);
        }
    }

    /// The widest window (nm) under which the stripes are straight, where the pattern is.
    pub(crate) fn choose_window(&self) -> f64 {
        let period = self.reference.period();
        let sides = [0, 1].map(|i| self.frame[i] * self.reference.pitch[i] / period);
        let steps = window::ladder(sides[0].min(sides[1]));
        let mut chosen = steps[0];
        for &width in &steps {
            let width_nm = width * period;
            let wider = width_nm * std::f64::consts::SQRT_2;
            let nodes = self.sparse(1.5 * width_nm, LOOKED_AT);
            let narrow = self.smoothed(width_nm, nodes);
            let present = present(&narrow);
            let (a, b) = (
                self.locals(&narrow, width_nm, &[]),
                self.locals(&self.smoothed(wider, nodes), wider, &[]),
            );
            let away = self.reference.in_pixels(3.0 * wider);
            let mut changes = Vec::new();
            for n in present {
                let at = nodes.place(&self.blocks, n);
                let inside = (0..2).all(|i| at[i].min(self.frame[i] - at[i]) > away[i]);
                if let (true, Some(a), Some(b)) = (inside, &a[n], &b[n]) {
                    let change = b.wave - a.wave;
                    for i in 0..2 {
                        let variance = a.slope[(i, i)] * a.variance * window::OF_DIFFERENCE;
                        changes.push(change[i].powi(2) / variance);
                    }
                }
            }
            if changes.len() < 16 || !window::is_straight(&mut changes) {
                break;
            }
            chosen = width;
        }
        chosen * period
    }
}

/// Nodes where the pattern is: a quarter of its power at the best twentieth, all harmonics together.
fn present(smoothed: &Smoothed) -> Vec<usize> {
    let power = |n: usize| -> f64 {
        let all = smoothed.envelopes.iter();
        all.map(|e| f64::from(e.amplitude[n].norm_sqr())).sum()
    };
    let whole: Vec<usize> = (0..smoothed.nodes.len())
        .filter(|&n| smoothed.support[n].is_some_and(|s| s.share > 0.9))
        .collect();
    let mut powers: Vec<f64> = whole.iter().map(|&n| power(n)).collect();
    powers.sort_by(f64::total_cmp);
    let best = powers.get(powers.len() * 19 / 20).copied().unwrap_or(0.0);
    whole
        .into_iter()
        .filter(|&n| power(n) > 0.25 * best)
        .collect()
}
