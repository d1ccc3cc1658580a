//! What other harmonics leak through a window that is cut by an edge or by missing pixels.
//!
//! A whole Gaussian window keeps neighbouring harmonics out (`e^{−(wΔg)²/2}`); one that ends abruptly lets
//! through of the order of the weight at its end over wΔg. As all harmonics are measured at the same
//! node, what harmonic j leaves in layer i is known: with `Δ` the difference of their local wave vectors,
//!
//! `Σ_d w(d) (1, d) c_j e^{iΔ·d}`,
//!
//! and is taken off. All harmonics leak into all, hence a few rounds.

use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;
use rustfft::num_complex::{Complex32, Complex64};

use crate::numbers::interrupt;
use crate::window::blocks::Blocks;
use crate::window::smooth::{Kernel, Smoothed, Support};

/// Windows of which less than this is missing are whole: any number above rounding in single precision.
const CUT: f64 = 1e-6;
/// Times the system of leaks is gone through. On the scenes of docs/constants.md half and double change results by at most 0.01 σ.
const ROUNDS: usize = 3;
/// A whole window that lets through less than this along one axis lets nothing through.
const NOTHING: f64 = 1e-7;
/// Share of what was taken off that may be wrong: amplitudes and wave vectors change under the window. On the scenes of docs/constants.md half and
/// double change results by at most 0.01 σ.
const UNSURE: f64 = 0.05;

/// Relative error of slopes from single precision, times the inverse of the window.
pub(crate) const ROUNDING: f64 = 3e-6;

/// What has been taken off at a place: phases of both waves (rad), and their slopes as columns (rad per pixel).
pub(crate) type Taken = (Vector2<f64>, Matrix2<f64>);

/// A harmonic, or its mirror image, as it appears in the layer of another.
struct Passage {
    from: usize,
    into: usize,
    mirrored: bool,
    /// What one unit of it adds to c₀ and c₁ there.
    adds: [Complex64; 3],
}

/// How far each of the other harmonics that reach through a whole window (`width`, pixels) can pull the slope of the i-th,
/// rad per pixel. `apart` is the way from the j-th (sign 1) or its mirror image (−1) to the i-th.
pub(crate) fn pulls(
    i: usize,
    amplitudes: &[f64],
    width: [f64; 2],
    apart: impl Fn(usize, i32) -> Vector2<f64>,
) -> impl Iterator<Item = f64> {
    let own = amplitudes[i].max(f64::MIN_POSITIVE);
    let all = (0..amplitudes.len()).flat_map(|j| [(j, 1), (j, -1)]);
    all.filter(move |&other| other != (i, 1))
        .map(move |(j, sign)| {
            let apart = apart(j, sign);
            let in_widths = apart.component_mul(&Vector2::from(width));
            let share = (-0.5 * in_widths.norm_squared()).exp();
            share * apart.norm() * amplitudes[j] / own
        })
}

/// Takes off what leaks at nodes whose windows are cut. `taken` says what the layers of the harmonics `indices` had
/// taken off at a place.
pub(crate) fn clean(
    smoothed: &mut Smoothed,
    blocks: &Blocks,
    width: [f64; 2],
    indices: &[[i32; 2]],
    taken: impl Fn(Vector2<f64>) -> Taken + Sync,
) {
    let kernels = [0, 1].map(|axis| Kernel::new(width[axis], blocks.block[axis]));
    let nodes = smoothed.nodes;
    let cut: Vec<usize> = (0..nodes.len())
        .filter(|&n| smoothed.support[n].is_some_and(|s| s.share < 1.0 - CUT))
        .collect();
    let cleaned: Vec<Vec<[Complex64; 3]>> = cut
        .par_iter()
        .map(|&node| {
            interrupt::check();
            let taken = taken(nodes.place(blocks, node));
            of_node(smoothed, blocks, &kernels, indices, node, &taken)
        })
        .collect();
    for (&node, values) in cut.iter().zip(&cleaned) {
        for (envelope, [amplitude, x, y]) in smoothed.envelopes.iter_mut().zip(values) {
            let before = envelope.slope[node];
            let slope = [x / amplitude, y / amplitude].map(|c| c.im as f32);
            if slope.iter().any(|s| !s.is_finite()) {
                continue;
            }
            envelope.amplitude[node] = Complex32::new(amplitude.re as f32, amplitude.im as f32);
            envelope.slope[node] = slope;
            let change = [0, 1].map(|i| f64::from(slope[i] - before[i]));
            let unsure = UNSURE * change[0].hypot(change[1]);
            envelope.unsure.resize(nodes.len(), 0.0);
            envelope.unsure[node] = unsure as f32;
        }
    }
}

/// c₀ and c₁ of all harmonics at a node without what the others leak.
fn of_node(
    smoothed: &Smoothed,
    blocks: &Blocks,
    kernels: &[Kernel; 2],
    indices: &[[i32; 2]],
    node: usize,
    taken: &Taken,
) -> Vec<[Complex64; 3]> {
    let envelopes = smoothed.envelopes.iter();
    let measured: Vec<[Complex64; 3]> = envelopes.map(|e| e.fitted(node)).collect();
    let Some(support) = &smoothed.support[node] else {
        return measured;
    };
    let at = smoothed.nodes.block(node);
    let sums = |delta| transform(blocks, kernels, at, delta);
    let passages = passages(&measured, indices, support, taken, sums);
    let mut values = measured.clone();
    for _ in 0..ROUNDS {
        let before = values.clone();
        values.clone_from(&measured);
        for passage in &passages {
            let amplitude = before[passage.from][0];
            let amplitude = if passage.mirrored {
                amplitude.conj()
            } else {
                amplitude
            };
            for (value, adds) in values[passage.into].iter_mut().zip(passage.adds) {
                *value -= amplitude * adds;
            }
        }
    }
    values
}

/// What leaks from where to where at a node; `sums` is [`transform`] there.
fn passages(
    measured: &[[Complex64; 3]],
    indices: &[[i32; 2]],
    support: &Support,
    (phases, slopes): &Taken,
    sums: impl Fn(Vector2<f64>) -> Option<[Complex64; 3]>,
) -> Vec<Passage> {
    let index = |i: usize| Vector2::from(indices[i].map(f64::from));
    let mut passages = Vec::new();
    for (from, [amplitude, x, y]) in measured.iter().enumerate() {
        let slope = Vector2::new((x / amplitude).im, (y / amplitude).im);
        if !(slope.x.is_finite() && slope.y.is_finite()) {
            continue;
        }
        for (into, mirrored) in (0..indices.len()).flat_map(|i| [(i, false), (i, true)]) {
            if into == from && !mirrored {
                continue;
            }
            let sign = if mirrored { -1.0 } else { 1.0 };
            let between = index(from) * sign - index(into);
            let Some(sums) = sums(slopes * between + slope * sign) else {
                continue;
            };
            let turn = Complex64::cis(phases.dot(&between));
            let adds = [0, 1, 2].map(|i| {
                let row = support.inverse.row(i);
                (sums[0] * row[0] + sums[1] * row[1] + sums[2] * row[2]) * turn
            });
            passages.push(Passage {
                from,
                into,
                mirrored,
                adds,
            });
        }
    }
    passages
}

/// `Σ w e^{iΔ·d}` and the same tilted along x and y, over the blocks around block `at` that are there; `None`
/// where that is next to nothing.
fn transform(
    blocks: &Blocks,
    kernels: &[Kernel; 2],
    at: [usize; 2],
    delta: Vector2<f64>,
) -> Option<[Complex64; 3]> {
    // Mean of the wave over a block.
    let mean = |axis: usize| {
        let (half, block) = (0.5 * delta[axis], blocks.block[axis] as f64);
        if half.sin().abs() < 1e-9 {
            1.0
        } else {
            (half * block).sin() / (block * half.sin())
        }
    };
    let scale = mean(0) * mean(1);
    let Some(share) = &blocks.share else {
        let [x, y] = [0, 1].map(|i| kernels[i].cut(at[i], blocks.size[i], delta[i]));
        let (x, y) = (x?, y?);
        return Some([x[0] * y[0], x[1] * y[0], x[0] * y[1]].map(|s| s * scale));
    };
    let [along, across] = [0, 1].map(|i| kernels[i].turned(at[i], blocks.size[i], delta[i]));
    let mut sums = [Complex64::default(); 3];
    for (i, [w, wd]) in across.1.iter().enumerate() {
        let line = &share[(across.0 + i) * blocks.size[0] + along.0..];
        let mut of_line = [Complex64::default(); 2];
        for (terms, share) in along.1.iter().zip(line) {
            for (sum, term) in of_line.iter_mut().zip(terms) {
                *sum += term * f64::from(*share);
            }
        }
        let [plain, tilted] = of_line;
        sums[0] += plain * w;
        sums[1] += tilted * w;
        sums[2] += plain * wd;
    }
    Some(sums.map(|s| s * scale))
}

impl Kernel {
    /// The weights around block `at` that fall on the blocks 0 to `count`, plain and tilted, turned by
    /// `e^{iΔd}`; and the first of these blocks.
    fn turned(&self, at: usize, count: usize, delta: f64) -> (usize, Vec<[Complex64; 2]>) {
        let first = at.saturating_sub(self.radius);
        let last = (at + self.radius + 1).min(count);
        let first_tap = first + self.radius - at;
        let taps = first_tap..first_tap + last - first;
        (first, self.taps(taps, delta).collect())
    }

    fn taps(
        &self,
        taps: std::ops::Range<usize>,
        delta: f64,
    ) -> impl Iterator<Item = [Complex64; 2]> + '_ {
        let step = Complex64::cis(delta * self.step);
        let from = taps.start as f64 - self.radius as f64;
        let mut turn = Complex64::cis(delta * self.step * from);
        taps.map(move |i| {
            let out = [self.plain[i], self.tilted[i]].map(|w| turn * f64::from(w));
            turn *= step;
            out
        })
    }

    /// Their sums: that of the whole Gaussian less what lies beyond the blocks. `None` if that is next to nothing.
    fn cut(&self, at: usize, count: usize, delta: f64) -> Option<[Complex64; 2]> {
        let whole = (-0.5 * self.own * delta * delta).exp();
        let before = self.radius.saturating_sub(at);
        let after = (self.radius + count - at).min(2 * self.radius + 1);
        if before == 0 && after == 2 * self.radius + 1 && whole < NOTHING {
            return None;
        }
        let mut sums = [
            Complex64::from(whole),
            Complex64::new(0.0, self.own * delta * whole),
        ];
        let missing = self.taps(0..before, delta);
        for tap in missing.chain(self.taps(after..2 * self.radius + 1, delta)) {
            sums.iter_mut().zip(tap).for_each(|(s, t)| *s -= t);
        }
        Some(sums)
    }
}
