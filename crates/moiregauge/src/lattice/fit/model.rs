//! The model of an image, what it leaves of the image, and how the harmonics correlate with that.

use nalgebra::{DVector, Matrix2};
use rayon::prelude::*;

use crate::lattice::fit::folded::Folded;
use crate::lattice::fit::frame::{Basis, Frame};
use crate::lattice::fit::tables::{Block, LANES, Tables};
use crate::numbers::MOST_ROUNDS;
use crate::numbers::interrupt;
use crate::numbers::median::median;
use crate::numbers::widest::widest;

/// Residuals beyond this many standard deviations pull no harder (Huber). At 3 the loss of
/// efficiency with Gaussian noise is below 0.1 %.
const CLIP: f64 = 3.0;
/// About as many residuals are looked at for their median: it is good to 1.4 % then.
const SAMPLE: usize = 8192;

/// Background and harmonics: `Σ b_t XᵃYᵇ + Σ α cos θ + β sin θ`, θ = p·(X, Y).
#[derive(Clone, Debug)]
pub(crate) struct Model {
    pub(crate) basis: Basis,
    /// One coefficient for each background term.
    pub(crate) background: Vec<f64>,
    /// (α, β) of each harmonic.
    pub(crate) waves: Vec<[f64; 2]>,
    /// p₁, p₂ as columns: phase at the edges, rad.
    pub(crate) pair: Matrix2<f64>,
}

impl Model {
    /// Adds a share of a step: background, (α, β) of each harmonic, then the pair.
    pub(crate) fn add(&mut self, step: &[f64], share: f64) {
        let waves = self.waves.as_flattened_mut().iter_mut();
        let all = self.background.iter_mut().chain(waves);
        for (value, change) in all.chain(self.pair.iter_mut()).zip(step) {
            *value += share * change;
        }
    }
}

/// One offset per line: random, with a variance that the image tells.
#[derive(Clone, Debug)]
pub(crate) struct LineOffsets {
    /// What is taken off a line is λ times its mean, `λ = n σ_l²/(σ² + n σ_l²)`.
    pub(crate) lambda: Vec<f64>,
    /// The offsets.
    pub(crate) offset: Vec<f64>,
}

/// The residual of one line.
pub(crate) fn residual(
    frame: &Frame,
    model: &Model,
    tables: &Tables,
    row: usize,
    line: &mut [f64],
) {
    let y = frame.y[row];
    let mut powers = [0.0; 4];
    for (&[a, b], value) in model.basis.terms.iter().zip(&model.background) {
        powers[a] += value * y.powi(b as i32);
    }
    let [b0, b1, b2, b3] = powers;
    let pixels = frame.image.row(row);
    widest(
        #[inline(always)]
        || {
            for ((out, value), x) in line.iter_mut().zip(pixels).zip(&frame.x) {
                *out = value - (b0 + x * (b1 + x * (b2 + x * b3)));
            }
        },
    );
    let turned: Vec<[f64; 2]> = model
        .waves
        .iter()
        .zip(&tables.up)
        .map(|([alpha, beta], up)| {
            let (c, s) = (up[row].re, up[row].im);
            [alpha * c + beta * s, beta * c - alpha * s]
        })
        .collect();
    if let Some(bent) = &tables.bent {
        bent.take_off(row, &turned, line);
        return;
    }
    // Cosines are the same on either side of the middle, sines change their sign.
    let half = line.len().div_ceil(2);
    let middle = line.len() % 2;
    let (left, right) = line.split_at_mut(half);
    let mut even = vec![[0.0; LANES]; half.div_ceil(LANES)];
    let mut odd = even.clone();
    add_up(&turned, &tables.along, &mut even, &mut odd);
    let (even, odd) = (even.as_flattened(), odd.as_flattened());
    widest(
        #[inline(always)]
        || {
            for (value, (even, odd)) in left.iter_mut().rev().zip(even.iter().zip(odd)) {
                *value -= even - odd;
            }
            // A middle column is among the left.
            let sums = even[middle..].iter().zip(&odd[middle..]);
            for (value, (even, odd)) in right.iter_mut().zip(sums) {
                *value -= even + odd;
            }
        },
    );
}

/// The cosines and the sines of a line, each with its factor, added up block by block. A function of
/// its own: what is done with the sums must not change the order in which the compiler packs them.
#[inline(never)]
fn add_up(factors: &[[f64; 2]], along: &[[Block; 2]], even: &mut [Block], odd: &mut [Block]) {
    widest(
        #[inline(always)]
        || {
            let all = along.chunks_exact(factors.len().max(1));
            for ((even, odd), blocks) in even.iter_mut().zip(odd).zip(all) {
                let (mut cosines, mut sines) = ([0.0; LANES], [0.0; LANES]);
                for ([p, q], [cos, sin]) in factors.iter().zip(blocks) {
                    for (sum, cos) in cosines.iter_mut().zip(cos) {
                        *sum += p * cos;
                    }
                    for (sum, sin) in sines.iter_mut().zip(sin) {
                        *sum += q * sin;
                    }
                }
                (*even, *odd) = (cosines, sines);
            }
        },
    );
}

/// Where residuals are cut off.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Clip(f64);

impl Clip {
    /// For residuals of this standard deviation.
    pub(crate) fn at(sigma: f64) -> Self {
        Self(CLIP * sigma)
    }

    /// Whether such a value is one that was cut off.
    pub(crate) fn is_at(self, value: f64) -> bool {
        value.abs() >= self.0
    }

    /// The residual as it counts; missing pixels not at all.
    #[inline]
    pub(crate) fn apply(self, value: f64) -> f64 {
        // Comparisons one by one, which the compiler can do for several pixels at once.
        let below = if value > self.0 { self.0 } else { value };
        let within = if below < -self.0 { -self.0 } else { below };
        if within.is_nan() { 0.0 } else { within }
    }

    /// A line as it counts; how many of its residuals are cut off.
    fn all(self, line: &mut [f64]) -> usize {
        widest(
            #[inline(always)]
            || {
                let cut = line.iter().map(|v| u64::from(v.abs() > self.0));
                let cut = cut.sum::<u64>();
                for value in line.iter_mut() {
                    *value = self.apply(*value);
                }
                cut as usize
            },
        )
    }
}

/// What one look at all residuals gives.
pub(crate) struct Look {
    /// `Φᵀ u` for the basis that was asked for, u the residual less line offset, cut off.
    pub(crate) gradient: DVector<f64>,
    /// Standard deviation of the residuals by their median.
    pub(crate) sigma: f64,
    /// How many residuals were cut off.
    pub(crate) clipped: usize,
}

/// Correlates the residuals of `model` with the functions of `basis`, of which `probes` are the
/// tables, as `tables` are those of the model. Line offsets are brought up to date on the way.
pub(crate) fn look(
    frame: &Frame,
    model: &Model,
    tables: &Tables,
    basis: &Basis,
    probes: &Tables,
    lines: &mut LineOffsets,
    clip: Clip,
) -> Look {
    let stride = (frame.pixels() / SAMPLE).max(1);
    let rows = (0..frame.image.rows).filter(|&row| frame.present[row] > 0);
    let rows: Vec<usize> = rows.collect();
    let before = &*lines;
    let seen = rows.par_iter().with_min_len(AT_ONCE).map_init(
        || (vec![0.0; frame.image.columns], Folded::new(frame)),
        |(line, folded), &row| {
            interrupt::check();
            residual(frame, model, tables, row, line);
            let offset = settle(line, row, frame, before, clip);
            // Every line starts elsewhere, lest the sample sees one column only.
            let picked = line.iter().skip((row * 7) % stride).step_by(stride);
            let sample: Vec<f64> = picked.filter(|v| v.is_finite()).map(|v| v.abs()).collect();
            let clipped = clip.all(line);
            folded.take(line);
            let mut gradient = DVector::zeros(basis.len());
            add(&mut gradient, frame, basis, probes, row, folded);
            (gradient, offset, sample, clipped)
        },
    );
    let seen: Vec<_> = seen.collect();
    let mut gradient = DVector::zeros(basis.len());
    let mut sample = Vec::with_capacity(2 * SAMPLE);
    let mut clipped = 0;
    for (row, (of_line, offset, picked, cut)) in rows.into_iter().zip(seen) {
        gradient += of_line;
        lines.offset[row] = offset;
        sample.extend(picked);
        clipped += cut;
    }
    Look {
        gradient,
        sigma: median(&mut sample) / 0.674_489_750_196_081_7,
        clipped,
    }
}

/// Lines that a thread looks at together, at least.
pub(crate) const AT_ONCE: usize = 32;

/// Takes the best offset off a line, `o = λ (o + mean ψ(r − o))`, and returns it. The background is corrected by what this leaves over `1 − λ`, which
/// may be small: the offset has to be exact.
fn settle(line: &mut [f64], row: usize, frame: &Frame, lines: &LineOffsets, clip: Clip) -> f64 {
    let lambda = lines.lambda[row];
    let mut offset = lines.offset[row];
    if lambda == 0.0 {
        return offset;
    }
    let count = frame.present[row] as f64;
    for _ in 0..MOST_ROUNDS {
        let before = offset;
        let (sum, cut) = clipped_sum(line, offset, clip);
        // Newton's step, exact where no pixel changes sides; never farther than what pixels cut off can move it.
        let held = lambda * cut as f64 / count;
        let found = (lambda * (offset + sum / count) - held * offset) / (1.0 - held);
        offset = found.max(before - clip.0).min(before + clip.0);
        if cut == 0 || (offset - before).abs() < 1e-4 * clip.0 {
            break;
        }
    }
    for value in line {
        *value -= offset;
    }
    offset
}

/// Sum of what counts of the residuals less `offset`, in eight partial sums, and how many are cut off.
fn clipped_sum(line: &[f64], offset: f64, clip: Clip) -> (f64, u64) {
    widest(
        #[inline(always)]
        || {
            let cut = |value: f64| u64::from((value - offset).abs() > clip.0);
            let blocks = line.chunks_exact(8);
            let rest = blocks.remainder().iter();
            let (mut sum, mut count) = (0.0, 0);
            for value in rest {
                sum += clip.apply(value - offset);
                count += cut(*value);
            }
            let (mut sums, mut counts) = ([0.0; 8], [0; 8]);
            for block in blocks {
                for ((sum, count), value) in sums.iter_mut().zip(&mut counts).zip(block) {
                    *sum += clip.apply(value - offset);
                    *count += cut(*value);
                }
            }
            (
                sums.iter().sum::<f64>() + sum,
                counts.iter().sum::<u64>() + count,
            )
        },
    )
}

/// Adds the correlation of one line with the basis.
fn add(
    gradient: &mut DVector<f64>,
    frame: &Frame,
    basis: &Basis,
    tables: &Tables,
    row: usize,
    line: &Folded,
) {
    let y = frame.y[row];
    if !basis.terms.is_empty() {
        let moments = line.moments(basis.degree());
        for (t, &[a, b]) in basis.terms.iter().enumerate() {
            gradient[t] += moments[a] * y.powi(b as i32);
        }
    }
    line.all_products(tables, row, |i, [c, s, xc, xs]| {
        let turn = tables.up[i][row];
        let first = basis.cosine(i);
        let (plain_c, plain_s) = (c * turn.re - s * turn.im, s * turn.re + c * turn.im);
        gradient[first] += plain_c;
        gradient[first + 1] += plain_s;
        gradient[first + 2] += xc * turn.re - xs * turn.im;
        gradient[first + 3] += xs * turn.re + xc * turn.im;
        gradient[first + 4] += y * plain_c;
        gradient[first + 5] += y * plain_s;
    });
}

/// What is to be known of a line whose residual is settled.
#[derive(Clone, Copy, Default)]
pub(crate) struct SettledLine {
    /// Its offset.
    pub(crate) offset: f64,
    /// What is to be added to its pixels for line means at the level of the other noise (`r − (1 − √(1−λ)) r̄`).
    pub(crate) kept: f64,
}

/// The residual of one line as it counts, 0 where pixels do not.
pub(crate) fn settled(
    frame: &Frame,
    model: &Model,
    tables: &Tables,
    lines: &LineOffsets,
    clip: Clip,
    row: usize,
    line: &mut [f64],
) -> SettledLine {
    if frame.present[row] == 0 {
        line.fill(0.0);
        let offset = lines.offset[row];
        return SettledLine { offset, kept: 0.0 };
    }
    residual(frame, model, tables, row, line);
    let offset = settle(line, row, frame, lines, clip);
    clip.all(line);
    let lambda = lines.lambda[row];
    let kept = if lambda > 0.0 {
        // The mean is o/λ, of which o is off already.
        offset - (1.0 - (1.0 - lambda).sqrt()) * (offset / lambda)
    } else {
        0.0
    };
    SettledLine { offset, kept }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::image::Image;
    use crate::numbers::rng::normals;

    /// Where a step crosses a line, many of its pixels are cut off. The offset fulfils its equation all the same, wherever it starts.
    #[test]
    fn offsets_of_lines_that_cross_a_step_are_exact() {
        for (seed, part) in [0.0, 0.1, 0.3, 0.45, 0.55, 0.8].into_iter().enumerate() {
            let mut normal = normals(seed as u64, "step", 0);
            let step = |i: usize| if (i as f64) < 150.0 * part { 9.0 } else { 0.0 };
            let line: Vec<f64> = (0..150).map(|i| 4.0 + step(i) + normal()).collect();
            let image = Image::new(1, line.len(), line.clone());
            let (frame, clip) = (Frame::new(&image), Clip::at(1.0));
            for (lambda, start) in [(0.9, 0.0), (0.99, 9.0), (0.9999, -20.0)] {
                let (lambda, offset) = (vec![lambda], vec![start]);
                let lines = LineOffsets { lambda, offset };
                let found = settle(&mut line.clone(), 0, &frame, &lines, clip);
                let kept = line.iter().map(|v| clip.apply(v - found)).sum::<f64>() / 150.0;
                let miss = lines.lambda[0] * (found + kept) - found;
                assert!(miss.abs() < 1e-9, "{part} {start}: {miss}");
            }
        }
    }
}
