//! The model of an image, what it leaves of the image, and how the harmonics correlate with that.

use nalgebra::{DVector, Matrix2};

use super::frame::{Basis, Frame, turns, wave};

/// Residuals beyond this many standard deviations pull no harder (Huber). At 3 the loss of
/// efficiency with Gaussian noise is below 0.1 %.
const CLIP: f64 = 3.0;
/// About as many residuals are looked at for their median.
const SAMPLE: usize = 8192;

/// Background and harmonics: `Σ b_t XᵃYᵇ + Σ α cos θ + β sin θ`, θ = p·(X, Y).
#[derive(Clone, Debug)]
pub(super) struct Model {
    pub(super) basis: Basis,
    /// One coefficient for each background term.
    pub(super) background: Vec<f64>,
    /// (α, β) of each harmonic.
    pub(super) waves: Vec<[f64; 2]>,
    /// p₁, p₂ as columns: phase at the edges, rad.
    pub(super) pair: Matrix2<f64>,
}

/// One offset per line: random, with a variance that the image tells.
#[derive(Clone, Debug)]
pub(super) struct LineOffsets {
    /// What is taken off a line is λ times its mean, `λ = n σ_l²/(σ² + n σ_l²)`.
    pub(super) lambda: Vec<f64>,
    /// The offsets.
    pub(super) offset: Vec<f64>,
}

/// `cos θ_x` and `sin θ_x` along a line, for each harmonic.
pub(super) struct Tables {
    along: Vec<[Vec<f64>; 2]>,
    /// Phase at the edge along Y.
    up: Vec<f64>,
}

impl Tables {
    pub(super) fn new(frame: &Frame, pair: &Matrix2<f64>, indices: &[[i32; 2]]) -> Self {
        let waves: Vec<_> = indices.iter().map(|&i| wave(pair, i)).collect();
        let along = waves.iter().map(|p| {
            let (cos, sin) = turns(p.x, &frame.x).iter().map(|t| (t.re, t.im)).unzip();
            [cos, sin]
        });
        Self {
            along: along.collect(),
            up: waves.iter().map(|p| p.y).collect(),
        }
    }
}

/// Calls `each` with every line that counts and its residual; missing pixels are NaN.
pub(super) fn residuals(
    frame: &Frame,
    model: &Model,
    tables: &Tables,
    mut each: impl FnMut(usize, &mut [f64]),
) {
    let mut line = vec![0.0; frame.image.columns];
    for (row, &y) in frame.y.iter().enumerate() {
        if frame.present[row] == 0 {
            continue;
        }
        let mut powers = [0.0; 4];
        for (&[a, b], value) in model.basis.terms.iter().zip(&model.background) {
            powers[a] += value * y.powi(b as i32);
        }
        let [b0, b1, b2, b3] = powers;
        for ((out, value), x) in line.iter_mut().zip(frame.image.row(row)).zip(&frame.x) {
            *out = value - (b0 + x * (b1 + x * (b2 + x * b3)));
        }
        for (i, [alpha, beta]) in model.waves.iter().enumerate() {
            let (s, c) = (tables.up[i] * y).sin_cos();
            let (p, q) = (alpha * c + beta * s, beta * c - alpha * s);
            let [cos, sin] = &tables.along[i];
            for ((out, cos), sin) in line.iter_mut().zip(cos).zip(sin) {
                *out -= p * cos + q * sin;
            }
        }
        each(row, &mut line);
    }
}

/// Where residuals are cut off.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clip(f64);

impl Clip {
    /// For residuals of this standard deviation.
    pub(super) fn at(sigma: f64) -> Self {
        Self(CLIP * sigma)
    }

    /// The residual as it counts; missing pixels not at all.
    pub(super) fn apply(self, value: f64) -> f64 {
        // Comparisons one by one, which the compiler can do for several pixels at once.
        let below = if value > self.0 { self.0 } else { value };
        let within = if below < -self.0 { -self.0 } else { below };
        if within.is_nan() { 0.0 } else { within }
    }

    fn cuts(self, value: f64) -> bool {
        value.abs() > self.0
    }
}

/// What one look at all residuals gives.
pub(super) struct Look {
    /// `Φᵀ u` for the basis that was asked for, u the residual less line offset, cut off.
    pub(super) gradient: DVector<f64>,
    /// Standard deviation of the residuals by their median.
    pub(super) sigma: f64,
    /// How many residuals were cut off.
    pub(super) clipped: usize,
}

/// Correlates the residuals of `model` with the functions of `basis`, of which `probes` are the
/// tables. Line offsets are brought up to date on the way.
pub(super) fn look(
    frame: &Frame,
    model: &Model,
    tables: &Tables,
    (basis, probes): (&Basis, &Tables),
    lines: &mut LineOffsets,
    clip: Clip,
) -> Look {
    let mut gradient = DVector::zeros(basis.len());
    let stride = (frame.pixels() / SAMPLE).max(1);
    let mut sample = Vec::with_capacity(2 * SAMPLE);
    let mut clipped = 0;
    let mut tilted = vec![0.0; frame.image.columns];
    residuals(frame, model, tables, |row, line| {
        settle(line, row, frame, lines, clip);
        // Every line starts elsewhere, lest the sample sees one column only.
        let picked = line.iter().skip((row * 7) % stride).step_by(stride);
        sample.extend(picked.filter(|v| v.is_finite()).map(|v| v.abs()));
        clipped += line
            .iter()
            .map(|v| usize::from(clip.cuts(*v)))
            .sum::<usize>();
        for value in line.iter_mut() {
            *value = clip.apply(*value);
        }
        add(
            &mut gradient,
            frame,
            (basis, probes),
            row,
            line,
            &mut tilted,
        );
    });
    Look {
        gradient,
        sigma: middle(&mut sample) / 0.674_489_750_196_081_7,
        clipped,
    }
}

/// Takes the best offset off a line: `o = λ (o + mean ψ(r − o))`.
fn settle(line: &mut [f64], row: usize, frame: &Frame, lines: &mut LineOffsets, clip: Clip) {
    let lambda = lines.lambda[row];
    if lambda == 0.0 {
        return;
    }
    let mut offset = lines.offset[row];
    let count = frame.present[row] as f64;
    for _ in 0..4 {
        let before = offset;
        offset = lambda * (offset + clipped_sum(line, offset, clip) / count);
        // Without a limit, or nowhere near it, one look is exact.
        if clip.0.is_infinite() || (offset - before).abs() < 1e-4 * clip.0 {
            break;
        }
    }
    lines.offset[row] = offset;
    for value in line {
        *value -= offset;
    }
}

/// Sum of what counts of the residuals less `offset`, in eight partial sums.
fn clipped_sum(line: &[f64], offset: f64, clip: Clip) -> f64 {
    let blocks = line.chunks_exact(8);
    let rest: f64 = blocks
        .remainder()
        .iter()
        .map(|v| clip.apply(v - offset))
        .sum();
    let mut sums = [0.0; 8];
    for block in blocks {
        for (sum, value) in sums.iter_mut().zip(block) {
            *sum += clip.apply(value - offset);
        }
    }
    sums.iter().sum::<f64>() + rest
}

/// Adds the correlation of one line with the basis.
fn add(
    gradient: &mut DVector<f64>,
    frame: &Frame,
    (basis, tables): (&Basis, &Tables),
    row: usize,
    line: &[f64],
    tilted: &mut [f64],
) {
    let y = frame.y[row];
    for ((t, v), x) in tilted.iter_mut().zip(line).zip(&frame.x) {
        *t = v * x;
    }
    let mut moments = [sum(line), sum(tilted), 0.0, 0.0];
    if basis.degree() > 1 {
        for (t, x) in tilted.iter().zip(&frame.x) {
            moments[2] += t * x;
            moments[3] += t * x * x;
        }
    }
    for (t, &[a, b]) in basis.terms.iter().enumerate() {
        gradient[t] += moments[a] * y.powi(b as i32);
    }
    for i in 0..basis.indices.len() {
        let [cos, sin] = &tables.along[i];
        let [c, s, xc, xs] = products(line, tilted, cos, sin);
        let (turn_s, turn_c) = (tables.up[i] * y).sin_cos();
        let first = basis.cosine(i);
        let (plain_c, plain_s) = (c * turn_c - s * turn_s, s * turn_c + c * turn_s);
        gradient[first] += plain_c;
        gradient[first + 1] += plain_s;
        gradient[first + 2] += xc * turn_c - xs * turn_s;
        gradient[first + 3] += xs * turn_c + xc * turn_s;
        gradient[first + 4] += y * plain_c;
        gradient[first + 5] += y * plain_s;
    }
}

/// The four sums of products of `u` and `v` with `cos` and `sin`, in partial sums that the compiler
/// can keep in registers.
fn products(u: &[f64], v: &[f64], cos: &[f64], sin: &[f64]) -> [f64; 4] {
    const LANES: usize = 4;
    let mut sums = [[0.0; LANES]; 4];
    let whole = u.len() / LANES * LANES;
    let blocks = u[..whole]
        .chunks_exact(LANES)
        .zip(v[..whole].chunks_exact(LANES))
        .zip(cos[..whole].chunks_exact(LANES))
        .zip(sin[..whole].chunks_exact(LANES));
    for (((u, v), cos), sin) in blocks {
        for i in 0..LANES {
            sums[0][i] += u[i] * cos[i];
            sums[1][i] += u[i] * sin[i];
            sums[2][i] += v[i] * cos[i];
            sums[3][i] += v[i] * sin[i];
        }
    }
    let mut total = sums.map(|s| s.iter().sum::<f64>());
    for i in whole..u.len() {
        total[0] += u[i] * cos[i];
        total[1] += u[i] * sin[i];
        total[2] += v[i] * cos[i];
        total[3] += v[i] * sin[i];
    }
    total
}

/// Sum in eight independent partial sums.
pub(super) fn sum(values: &[f64]) -> f64 {
    let blocks = values.chunks_exact(8);
    let rest: f64 = blocks.remainder().iter().sum();
    let mut sums = [0.0; 8];
    for block in blocks {
        for (sum, value) in sums.iter_mut().zip(block) {
            *sum += value;
        }
    }
    sums.iter().sum::<f64>() + rest
}

/// The median; 0 of nothing.
pub(in crate::lattice) fn middle(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let half = values.len() / 2;
    *values.select_nth_unstable_by(half, f64::total_cmp).1
}

/// The residuals as they count, with the line means brought down to the level of the other noise
/// (`r − (1 − √(1−λ)) r̄`); 0 where pixels do not count.
pub(super) fn whitened(
    frame: &Frame,
    model: &Model,
    lines: &mut LineOffsets,
    clip: Clip,
) -> Vec<f64> {
    let tables = Tables::new(frame, &model.pair, &model.basis.indices);
    let columns = frame.image.columns;
    let mut out = vec![0.0; frame.image.values.len()];
    residuals(frame, model, &tables, |row, line| {
        settle(line, row, frame, lines, clip);
        let lambda = lines.lambda[row];
        let kept = if lambda > 0.0 {
            // The mean is o/λ, of which o is off already.
            let mean = lines.offset[row] / lambda;
            lines.offset[row] - (1.0 - (1.0 - lambda).sqrt()) * mean
        } else {
            0.0
        };
        let into = &mut out[row * columns..(row + 1) * columns];
        for (out, value) in into.iter_mut().zip(line.iter()) {
            if value.is_finite() {
                *out = clip.apply(*value) + kept;
            }
        }
    });
    out
}
