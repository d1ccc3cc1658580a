//! Noise at every harmonic and at every place, read beside the harmonics.
//!
//! The image is demodulated at wave vectors above and below each harmonic where no harmonic is: there is
//! only noise. Above and below, along ky, because the noise of a scan is noise in time and as good as a
//! function of kx alone. Its mean power is the level of the harmonic; how it varies over the frame, all
//! harmonics together, is the local ratio.
//!
//! Few nodes say how much noise there is at one harmonic; levels of all are drawn together as far as they agree.
//!
//! Levels are those of white noise: variance σ² per pixel has the level σ².

use std::f64::consts::TAU;

use nalgebra::{Matrix2, Vector2};

use crate::numbers::median::median;
use crate::window::blocks::{Blocks, Place, block_of, mix, stride_of};
use crate::window::lines::{Levelled, TELLING};
use crate::window::smooth::{Envelope, Nodes, Smoothed, Support, smooth};
use crate::window::types::Reference;

/// Places tried beside a harmonic, as shares of the length of q₁: about half the way to the next one.
const TRIED: [f64; 9] = [0.35, 0.4, 0.45, 0.5, 0.55, 0.6, 0.65, 0.7, 0.75];
/// Window of the probes in periods, lest harmonics reach them.
const PROBE_WINDOW: f64 = 1.5;
/// Width of the average of the local ratio, windows: nine of them in area.
const AVERAGED: f64 = 3.0;
/// Windows of which more is missing are not looked at: harmonics that are cut off reach the probes, ...
const WHOLE: f64 = 0.85;
/// ... nor those nearer to the edges than this, widths, for the same reason.
const AWAY: f64 = 2.5;
/// Multiple of the level at which powers are clipped: e⁻⁴ of chance is cut, and allowed for; defects are cut, too.
const CUT: f64 = 4.0;
/// Harmonics looked beside at a time, for the memory's sake.
const AT_ONCE: usize = 2;

/// Two wave vectors beside harmonic (h, k) that are as far from the lattice as can be, rad per pixel.
pub(crate) fn probes(pair: &Matrix2<f64>, [h, k]: [i32; 2], pitch: [f64; 2]) -> [Vector2<f64>; 2] {
    let metric = Vector2::new(1.0 / pitch[0], 1.0 / pitch[1]);
    let harmonic = pair * Vector2::new(f64::from(h), f64::from(k));
    let length = pair.column(0).component_mul(&metric).norm();
    let inverse = pair.try_inverse().unwrap_or_else(Matrix2::identity);
    let distance = |g: &Vector2<f64>| {
        let near = (inverse * g).map(f64::round);
        let corners =
            (-1..=1).flat_map(|i| (-1..=1).map(move |j| Vector2::new(f64::from(i), f64::from(j))));
        let apart = corners.map(|c| (g - pair * (near + c)).component_mul(&metric).norm());
        apart.fold(f64::INFINITY, f64::min)
    };
    [1.0, -1.0].map(|side| {
        let candidates = TRIED.map(|share| {
            let up = Vector2::new(0.0, side * share * length * pitch[1]);
            harmonic + up
        });
        let best = candidates
            .iter()
            .max_by(|a, b| distance(a).total_cmp(&distance(b)));
        // A lattice line along ky passes other harmonics: aside then.
        match best {
            Some(g) if distance(g) > 0.4 * length => *g,
            _ => {
                let third = pair.column(0) + pair.column(1);
                harmonic + third * (side / 3.0)
            }
        }
    })
}

/// The noise of every harmonic.
pub(crate) struct Noise {
    /// Level of each harmonic.
    pub(crate) levels: Vec<f64>,
    /// Where the ratio is known, and the ratio.
    grid: Option<Ratio>,
    /// Factor on variances for harmonics that contradict each other everywhere, where the levels are but guessed.
    pub(crate) disagreement: f64,
}

struct Ratio {
    first: Vector2<f64>,
    step: Vector2<f64>,
    size: [usize; 2],
    values: Vec<f64>,
}

/// Envelopes at the places beside harmonics, two for each.
pub(crate) struct Beside {
    /// Where the blocks lie; they are gone.
    blocks: Blocks,
    smoothed: Smoothed,
    /// Widths of the windows, pixels.
    width: [f64; 2],
}

impl Beside {
    /// Of harmonics of a lattice; a few at a time, which bounds the memory.
    pub(crate) fn new(
        image: &Levelled,
        place: Place,
        reference: &Reference,
        indices: &[[i32; 2]],
    ) -> Self {
        let block = block_of(reference);
        let window = PROBE_WINDOW * reference.period();
        let width = reference.in_pixels(window);
        let stride = stride_of(reference, block, window);
        let mut out: Option<Self> = None;
        for some in indices.chunks(AT_ONCE) {
            let of_one = |index: &[i32; 2]| probes(&reference.pair, *index, reference.pitch);
            let waves: Vec<Vector2<f64>> = some.iter().flat_map(of_one).collect();
            let mut blocks = mix(image, place, &waves, block);
            let nodes = Nodes::filling(blocks.size, stride);
            let smoothed = smooth(&blocks, width, nodes);
            blocks.layers.clear();
            match &mut out {
                Some(all) => all.smoothed.envelopes.extend(smoothed.envelopes),
                None => {
                    out = Some(Self {
                        blocks,
                        smoothed,
                        width,
                    });
                }
            }
        }
        out.expect("a lattice has harmonics")
    }

    /// Adds other harmonics of the same lattice.
    pub(crate) fn extend(&mut self, other: Self) {
        self.smoothed.envelopes.extend(other.smoothed.envelopes);
    }
}

impl Noise {
    /// `fallback` is the level where the frame is too small to tell.
    pub(crate) fn new(beside: &Beside, fallback: f64) -> Self {
        let Beside {
            blocks,
            smoothed,
            width,
        } = beside;
        let nodes = smoothed.nodes;
        let harmonics = smoothed.envelopes.len() / 2;
        let low = blocks.middle(0.0, 0.0);
        let high = blocks.middle(blocks.size[0] as f64 - 1.0, blocks.size[1] as f64 - 1.0);
        let whole = whole(smoothed, blocks, [low, high], *width);
        if whole.iter().flatten().count() < TELLING {
            return Self {
                levels: vec![fallback; harmonics],
                grid: None,
                disagreement: 1.0,
            };
        }
        let power = |probe: usize, node: usize| power(&smoothed.envelopes[probe], &whole, node);
        let levels: Vec<f64> = (0..harmonics)
            .map(|i| {
                let both = (0..nodes.len()).flat_map(|n| [power(2 * i, n), power(2 * i + 1, n)]);
                level_of(&mut both.flatten().collect::<Vec<f64>>())
            })
            .collect();
        let step = nodes.step(blocks);
        let cell = (0..2).map(|i| step[i] / width[i]);
        let count = 2.0 * whole.iter().flatten().count() as f64;
        // Powers under a Gaussian window have the correlation e^{−d²/2w²}.
        let independent = (count * cell.product::<f64>() / TAU).clamp(2.0, count);
        let levels = pooled(&levels, 1.0 / independent);
        let grid = Ratio::new(blocks, smoothed, &levels, power);
        Self {
            levels,
            grid: Some(grid),
            disagreement: 1.0,
        }
    }

    /// Whether it was seen, and not only guessed.
    pub(crate) fn is_measured(&self) -> bool {
        self.grid.is_some()
    }

    /// The local ratio at a place, pixels.
    pub(crate) fn ratio(&self, at: Vector2<f64>) -> f64 {
        self.grid.as_ref().map_or(1.0, |grid| grid.at(at))
    }
}

/// Noise of the amplitude at nodes (white noise of unit variance) where probes see nothing but noise: windows that are
/// whole, and far from the edges of a frame between two pixels.
pub(crate) fn whole(
    smoothed: &Smoothed,
    blocks: &Blocks,
    [low, high]: [Vector2<f64>; 2],
    width: [f64; 2],
) -> Vec<Option<f64>> {
    let of_node = |(node, support): (usize, &Option<Support>)| {
        let at = smoothed.nodes.place(blocks, node);
        let inside = (0..2).all(|i| (at - low)[i].min((high - at)[i]) > AWAY * width[i]);
        let support = support.filter(|s| inside && s.share > WHOLE)?;
        Some(support.amplitude_noise)
    };
    smoothed.support.iter().enumerate().map(of_node).collect()
}

/// Power of a probe at a node that is whole, as a level.
pub(crate) fn power(probe: &Envelope, whole: &[Option<f64>], node: usize) -> Option<f64> {
    Some(f64::from(probe.amplitude[node].norm_sqr()) / whole[node]?)
}

/// The level of powers with an exponential distribution. What a defect throws there is cut off.
fn level_of(powers: &mut [f64]) -> f64 {
    let most = CUT * median(powers) / std::f64::consts::LN_2;
    let sum: f64 = powers.iter().map(|p| p.min(most)).sum();
    sum / powers.len().max(1) as f64 / (1.0 - (-CUT).exp())
}

/// Levels of several harmonics, each known to the relative variance `own`, drawn towards their mean as far as they do not
/// differ by more than chance: ln S of each is normal about a common mean, with a variance that is estimated.
fn pooled(levels: &[f64], own: f64) -> Vec<f64> {
    let logs: Vec<f64> = levels.iter().map(|l| l.ln()).collect();
    if logs.len() < 2 || logs.iter().any(|l| !l.is_finite()) {
        return levels.to_vec();
    }
    let mean = logs.iter().sum::<f64>() / logs.len() as f64;
    let squares: f64 = logs.iter().map(|l| (l - mean).powi(2)).sum();
    let between = (squares / (logs.len() as f64 - 1.0) - own).max(0.0);
    let share = between / (between + own);
    let drawn = logs.iter().map(|l| (mean + share * (l - mean)).exp());
    drawn.collect()
}

impl Ratio {
    fn new(
        blocks: &Blocks,
        smoothed: &Smoothed,
        levels: &[f64],
        power: impl Fn(usize, usize) -> Option<f64>,
    ) -> Self {
        let nodes = smoothed.nodes;
        let of_node = |node: usize| {
            let (mut sum, mut count) = (0.0, 0.0);
            for (i, level) in levels.iter().enumerate().filter(|(_, l)| **l > 0.0) {
                for probe in [2 * i, 2 * i + 1] {
                    if let Some(power) = power(probe, node) {
                        sum += power / level;
                        count += 1.0;
                    }
                }
            }
            [sum, count]
        };
        let raw: Vec<[f64; 2]> = (0..nodes.len()).map(of_node).collect();
        // A Gaussian along the lines, then across, of sums and counts alike.
        let [columns, rows] = nodes.size;
        let reach = (3.0 * AVERAGED) as isize;
        let pass = |values: &[[f64; 2]], across: bool| -> Vec<[f64; 2]> {
            (0..nodes.len())
                .map(|node| {
                    let (column, row) = ((node % columns) as isize, (node / columns) as isize);
                    let mut out = [0.0; 2];
                    for d in -reach..=reach {
                        let (c, r) = if across {
                            (column, row + d)
                        } else {
                            (column + d, row)
                        };
                        if c < 0 || r < 0 || c >= columns as isize || r >= rows as isize {
                            continue;
                        }
                        let weight = (-0.5 * (d as f64 / AVERAGED).powi(2)).exp();
                        let value = values[r as usize * columns + c as usize];
                        out[0] += weight * value[0];
                        out[1] += weight * value[1];
                    }
                    out
                })
                .collect()
        };
        let smooth = pass(&pass(&raw, false), true);
        let mean = |[sum, count]: &[f64; 2]| if *count > 0.0 { sum / count } else { 1.0 };
        Self {
            first: nodes.place(blocks, 0),
            step: Vector2::from(nodes.step(blocks)),
            size: nodes.size,
            values: smooth.iter().map(mean).collect(),
        }
    }

    fn at(&self, at: Vector2<f64>) -> f64 {
        let along = |axis: usize| {
            let last = self.size[axis] as f64 - 1.0;
            let t = ((at - self.first)[axis] / self.step[axis]).clamp(0.0, last);
            let cell = t.floor().min((last - 1.0).max(0.0));
            let next = (cell as usize + 1).min(self.size[axis] - 1);
            (cell as usize, next, t - cell)
        };
        let ((c, c1, u), (r, r1, v)) = (along(0), along(1));
        let value = |c: usize, r: usize| self.values[r * self.size[0] + c];
        (1.0 - v) * ((1.0 - u) * value(c, r) + u * value(c1, r))
            + v * ((1.0 - u) * value(c, r1) + u * value(c1, r1))
    }
}
