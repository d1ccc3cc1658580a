//! A first look at a pattern: its noise, the harmonics that tell something, the carrier, how wide the window may be.

use nalgebra::{Matrix2, Rotation2, Vector2};

use crate::numbers::median::median;
use crate::stripes::wave::{Local, Wave};
use crate::window::blocks::mix;
use crate::window::carrier::{Carrier, MOST_CELLS, Slope};
use crate::window::lines::Levelled;
use crate::window::lines::TELLING;
use crate::window::mixed::{FOLLOWED, LOOKED_AT, Mixed, ROUNDS, WORTH};
use crate::window::noise::{power, whole};
use crate::window::smooth::{Nodes, Smoothed, smooth};
use crate::window::widths::OF_DIFFERENCE;

/// The pilot's window in wavelengths, which are 0.87 of the period of a lattice: about as wide as the pilot of that.
const PILOT: f64 = 0.75;
/// Fewest periods of a frame with a carrier, and the length of its cells, periods. On the scenes of docs/constants.md half and double change results
/// by at most 0.01 σ.
const CARRIED: f64 = 12.0;
/// Window of the probes for noise in wavelengths; nodes are half of it apart.
const PROBE: f64 = 1.3;

impl Wave {
    /// Envelopes under the pilot's window at a limited number of nodes along each axis, and the nodes where the
    /// pattern is.
    fn pilot(&self, most: usize) -> (Smoothed, Vec<usize>) {
        let width = PILOT * self.wavelength();
        let smoothed = self.mixed.cleaned(width, self.mixed.sparse(width, most));
        let present = present(&smoothed);
        (smoothed, present)
    }

    /// Mean wave vector where the pattern is, rad per pixel.
    pub(crate) fn mean(&self) -> Vector2<f64> {
        let (smoothed, present) = self.pilot(LOOKED_AT);
        let locals = self.locals(&smoothed, PILOT * self.wavelength(), &[]);
        let there = present.iter().filter_map(|&n| locals[n].as_ref());
        let (sum, weight) = there.fold((Vector2::zeros(), 0.0), |(s, w), l| {
            (s + l.wave * l.power, w + l.power)
        });
        if weight > 0.0 {
            sum / weight
        } else {
            self.first()
        }
    }

    /// Reads the noise beside the harmonics, above and below along ky (noise in time is a function of kx).
    pub(crate) fn see_noise(&mut self, image: &Levelled, others: &[Vector2<f64>]) {
        let mixed = &self.mixed;
        let width = mixed.reference.in_pixels(PROBE * self.wavelength());
        let nodes = mixed.sparse(0.5 * PROBE * self.wavelength(), FOLLOWED);
        let mut levels = Vec::with_capacity(mixed.indices.len());
        for &index in &mixed.indices {
            let beside = self.beside(index, others);
            let blocks = mix(image, mixed.place, &beside, mixed.blocks.block);
            let smoothed = smooth(&blocks, width, nodes);
            let whole = whole(&smoothed, &blocks, mixed.frame, width);
            if whole.iter().flatten().count() < TELLING {
                return;
            }
            let probes = smoothed.envelopes.iter();
            let powers = probes.flat_map(|e| (0..nodes.len()).filter_map(|n| power(e, &whole, n)));
            // The median minds no other patterns, wherever they end.
            levels.push(median(&mut powers.collect::<Vec<f64>>()) / std::f64::consts::LN_2);
        }
        self.levels = levels;
        self.noise_measured = true;
    }

    /// Two wave vectors beside a harmonic, as far from all harmonics of all patterns as can be.
    fn beside(&self, index: [i32; 2], others: &[Vector2<f64>]) -> [Vector2<f64>; 2] {
        let harmonic = self.mixed.reference.wave(index);
        let q = self.mixed.reference.wave([1, 0]);
        let metric = |v: Vector2<f64>| {
            v.component_div(&Vector2::from(self.mixed.reference.pitch))
                .norm()
        };
        let distance = |g: Vector2<f64>| {
            let all = others.iter().chain([&q]);
            let all = all.flat_map(|q| (-5..=5).map(move |m| g - q * f64::from(m)));
            all.map(metric).fold(f64::INFINITY, f64::min)
        };
        let up = Vector2::new(0.0, metric(q) * self.mixed.reference.pitch[1]);
        let aside = Rotation2::new(std::f64::consts::FRAC_PI_2)
            * q.component_div(&Vector2::from(self.mixed.reference.pitch));
        let aside = aside.component_mul(&Vector2::from(self.mixed.reference.pitch));
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
        let (smoothed, present) = self.pilot(LOOKED_AT);
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
        let indices = &self.mixed.indices;
        let powers: Vec<f64> = (0..indices.len()).map(power).collect();
        let worth = |i: usize| powers[i] * f64::from(indices[i][0].pow(2));
        let most = (0..powers.len()).map(worth).fold(0.0, f64::max);
        let keep: Vec<bool> = (0..powers.len())
            .map(|i| i == 0 || worth(i) > WORTH * most)
            .collect();
        self.mixed.powers = powers;
        retain(&mut self.mixed.powers, &keep);
        retain(&mut self.levels, &keep);
        retain(&mut self.mixed.indices, &keep);
        retain(&mut self.mixed.blocks.layers, &keep);
    }

    /// Fits the carrier to what a narrow window sees.
    pub(crate) fn follow(&mut self) {
        let wavelength = self.wavelength();
        let Mixed {
            frame, reference, ..
        } = self.mixed;
        let cells = [0, 1].map(|i| {
            let periods = (frame[1] - frame[0])[i] * reference.pitch[i] / wavelength;
            ((periods / CARRIED) as usize).min(MOST_CELLS)
        });
        if cells[0].min(cells[1]) == 0 {
            return;
        }
        for _ in 0..ROUNDS {
            let (smoothed, present) = self.pilot(FOLLOWED);
            let locals = self.locals(&smoothed, PILOT * wavelength, &[]);
            let slope = |&n: &usize| {
                let change = locals[n].as_ref()?.wave - self.first();
                Some(Slope {
                    at: smoothed.nodes.place(&self.mixed.blocks, n),
                    slopes: Matrix2::from_columns(&[change, Vector2::zeros()]),
                })
            };
            let slopes: Vec<Slope> = present.iter().filter_map(slope).collect();
            // A pattern that is present only in places is not followed beyond them.
            if slopes.len() < 16 || slopes.len() * 2 < smoothed.nodes.len() {
                return;
            }
            let Some(carrier) = Carrier::fit(&slopes, frame, cells) else {
                return;
            };
            self.mixed.carry(carrier);
        }
    }

    /// The widest window (nm) under which the stripes are straight, where the pattern is.
    pub(crate) fn choose_window(&self) -> f64 {
        let see = |width: f64, nodes: Nodes| {
            let smoothed = self.mixed.cleaned(width, nodes);
            let mut there = vec![false; nodes.len()];
            for n in present(&smoothed) {
                there[n] = true;
            }
            let locals = self.locals(&smoothed, width, &[]).into_iter().zip(there);
            locals.map(|(local, there)| Some((local?, there))).collect()
        };
        self.mixed
            .choose_window(see, |(a, there): &(Local, bool), (b, _)| {
                let change = b.wave - a.wave;
                let axes = [0, 1].into_iter().filter(|_| *there);
                axes.map(|i| {
                    let variance = a.slope[(i, i)] * a.variance * OF_DIFFERENCE;
                    change[i].powi(2) / variance
                })
                .collect()
            })
    }
}

fn retain<T>(all: &mut Vec<T>, keep: &[bool]) {
    let mut kept = keep.iter();
    all.retain(|_| kept.next().is_some_and(|k| *k));
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
