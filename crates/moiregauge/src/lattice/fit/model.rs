//! The model of an image, what it leaves of the image, and how the harmonics correlate with that.

use nalgebra::{DVector, Matrix2};
use rustfft::num_complex::Complex64;

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

/// Values handled together: as many as the compiler keeps in registers.
const LANES: usize = 8;
type Block = [f64; LANES];

/// `cos θ_x` and `sin θ_x` on the right half of a line, in blocks filled up with zeros; the left half is
/// their mirror image, which saves half of all products.
pub(super) struct Tables {
    /// The first block of every harmonic, then the second, and so on.
    along: Vec<[Block; 2]>,
    /// `e^{iθ_y}` of each line.
    up: Vec<Vec<Complex64>>,
}

impl Tables {
    pub(super) fn new(frame: &Frame, pair: &Matrix2<f64>, indices: &[[i32; 2]]) -> Self {
        let waves: Vec<_> = indices.iter().map(|&i| wave(pair, i)).collect();
        let mut along = vec![[[0.0; LANES]; 2]; waves.len() * frame.right().len().div_ceil(LANES)];
        for (i, p) in waves.iter().enumerate() {
            let turns = turns(p.x, frame.right());
            let blocks = along.iter_mut().skip(i).step_by(waves.len());
            for ([cos, sin], turns) in blocks.zip(turns.chunks(LANES)) {
                for ((cos, sin), turn) in cos.iter_mut().zip(sin).zip(turns) {
                    (*cos, *sin) = (turn.re, turn.im);
                }
            }
        }
        Self {
            along,
            up: waves.iter().map(|p| turns(p.y, &frame.y)).collect(),
        }
    }

    /// The blocks of one harmonic.
    fn of(&self, harmonic: usize) -> impl Iterator<Item = &[Block; 2]> {
        self.along.iter().skip(harmonic).step_by(self.up.len())
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
    for row in 0..frame.image.rows {
        if frame.present[row] > 0 {
            residual(frame, model, tables, row, &mut line);
            each(row, &mut line);
        }
    }
}

/// The residual of one line.
pub(super) fn residual(
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
    for ((out, value), x) in line.iter_mut().zip(frame.image.row(row)).zip(&frame.x) {
        *out = value - (b0 + x * (b1 + x * (b2 + x * b3)));
    }
    let turned: Vec<[f64; 2]> = model
        .waves
        .iter()
        .zip(&tables.up)
        .map(|([alpha, beta], up)| {
            let (c, s) = (up[row].re, up[row].im);
            [alpha * c + beta * s, beta * c - alpha * s]
        })
        .collect();
    // Cosines are the same on either side of the middle, sines change their sign.
    let half = line.len().div_ceil(2);
    let middle = line.len() % 2;
    let (left, right) = line.split_at_mut(half);
    let mut even = vec![[0.0; LANES]; half.div_ceil(LANES)];
    let mut odd = even.clone();
    add_up(&turned, &tables.along, &mut even, &mut odd);
    let (even, odd) = (even.as_flattened(), odd.as_flattened());
    for (value, (even, odd)) in left.iter_mut().rev().zip(even.iter().zip(odd)) {
        *value -= even - odd;
    }
    // A middle column is among the left.
    let sums = even.iter().zip(odd).skip(middle);
    for (value, (even, odd)) in right.iter_mut().zip(sums) {
        *value -= even + odd;
    }
}

/// The cosines and the sines of a line, each with its factor, added up block by block. A function of
/// its own: what is done with the sums must not change the order in which the compiler packs them.
#[inline(never)]
fn add_up(factors: &[[f64; 2]], along: &[[Block; 2]], even: &mut [Block], odd: &mut [Block]) {
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
    let mut folded = Folded::new(frame);
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
        folded.take(line);
        add(&mut gradient, frame, (basis, probes), row, &folded);
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

/// A line folded about its middle: sums and differences of what lies at X and −X, and both times X.
pub(super) struct Folded {
    x: Vec<Block>,
    even: Vec<Block>,
    odd: Vec<Block>,
    tilted_even: Vec<Block>,
    tilted_odd: Vec<Block>,
    /// Times X², on request.
    squared_even: Vec<Block>,
    squared_odd: Vec<Block>,
}

impl Folded {
    pub(super) fn new(frame: &Frame) -> Self {
        let mut x = vec![[0.0; LANES]; frame.right().len().div_ceil(LANES)];
        for (value, x) in x.as_flattened_mut().iter_mut().zip(frame.right()) {
            *value = *x;
        }
        let zeros = vec![[0.0; LANES]; x.len()];
        Self {
            x,
            even: zeros.clone(),
            odd: zeros.clone(),
            tilted_even: zeros.clone(),
            tilted_odd: zeros.clone(),
            squared_even: zeros.clone(),
            squared_odd: zeros,
        }
    }

    pub(super) fn take(&mut self, line: &[f64]) {
        let half = line.len().div_ceil(2);
        let (even, odd) = (self.even.as_flattened_mut(), self.odd.as_flattened_mut());
        let pairs = line[line.len() / 2..].iter().zip(line[..half].iter().rev());
        for ((right, left), (even, odd)) in pairs.zip(even.iter_mut().zip(odd)) {
            *even = right + left;
            *odd = right - left;
        }
        if line.len() % 2 == 1 {
            // The middle is there once.
            even[0] *= 0.5;
        }
        let tilted = self.tilted_even.iter_mut().zip(&mut self.tilted_odd);
        let plain = self.x.iter().zip(self.even.iter().zip(&self.odd));
        for ((te, to), (x, (e, o))) in tilted.zip(plain) {
            for i in 0..LANES {
                te[i] = x[i] * e[i];
                to[i] = x[i] * o[i];
            }
        }
    }

    fn square(&mut self) {
        let squared = self.squared_even.iter_mut().zip(&mut self.squared_odd);
        let tilted = self.tilted_even.iter().zip(&self.tilted_odd);
        for ((se, so), (x, (te, to))) in squared.zip(self.x.iter().zip(tilted)) {
            for i in 0..LANES {
                se[i] = x[i] * te[i];
                so[i] = x[i] * to[i];
            }
        }
    }

    /// Sums of the line times `X² cos` and `X² sin`.
    fn squared_products<'a>(&self, waves: impl Iterator<Item = &'a [Block; 2]>) -> [f64; 2] {
        let mut sums = [[0.0; LANES]; 2];
        let squared = self.squared_even.iter().zip(&self.squared_odd);
        for ((se, so), [cos, sin]) in squared.zip(waves) {
            for (sum, (a, b)) in sums[0].iter_mut().zip(se.iter().zip(cos)) {
                *sum += a * b;
            }
            for (sum, (a, b)) in sums[1].iter_mut().zip(so.iter().zip(sin)) {
                *sum += a * b;
            }
        }
        sums.map(|s| s.iter().sum())
    }

    /// Sums of the line times 1, X, X², X³.
    fn moments(&self, degree: usize) -> [f64; 4] {
        let mut moments = [sum(self.even.as_flattened()), 0.0, 0.0, 0.0];
        moments[1] = sum(self.tilted_odd.as_flattened());
        if degree > 1 {
            let tilted = self.tilted_even.iter().zip(&self.tilted_odd);
            for ((te, to), x) in tilted.zip(&self.x) {
                for i in 0..LANES {
                    moments[2] += te[i] * x[i];
                    moments[3] += to[i] * x[i] * x[i];
                }
            }
        }
        moments
    }

    /// Sums of the line times `cos`, `sin`, `X cos`, `X sin`, in partial sums that the compiler can
    /// keep in registers.
    fn products<'a>(&self, waves: impl Iterator<Item = &'a [Block; 2]>) -> [f64; 4] {
        const HALF: usize = LANES / 2;
        let mut sums = [[0.0; HALF]; 4];
        let add = |sum: &mut [f64; HALF], a: &Block, b: &Block| {
            for first in [0, HALF] {
                let pairs = a[first..first + HALF].iter().zip(&b[first..first + HALF]);
                for (sum, (a, b)) in sum.iter_mut().zip(pairs) {
                    *sum += a * b;
                }
            }
        };
        let plain = self.even.iter().zip(&self.odd);
        let tilted = self.tilted_even.iter().zip(&self.tilted_odd);
        for (((e, o), (te, to)), [cos, sin]) in plain.zip(tilted).zip(waves) {
            add(&mut sums[0], e, cos);
            add(&mut sums[1], o, sin);
            add(&mut sums[2], to, cos);
            add(&mut sums[3], te, sin);
        }
        sums.map(|s| s.iter().sum())
    }
}

/// Correlations of lines with `X² e^{iθ}`, `XY e^{iθ}` and `Y² e^{iθ}` of each harmonic: real parts are
/// those with cosines, imaginary parts those with sines.
pub(super) struct Bends(pub(super) Vec<[Complex64; 3]>);

impl Bends {
    pub(super) fn new(harmonics: usize) -> Self {
        Self(vec![[Complex64::default(); 3]; harmonics])
    }

    /// Adds one line.
    pub(super) fn add(&mut self, frame: &Frame, tables: &Tables, row: usize, line: &mut Folded) {
        let y = frame.y[row];
        line.square();
        for (i, sums) in self.0.iter_mut().enumerate() {
            let [c, s, xc, xs] = line.products(tables.of(i));
            let [xxc, xxs] = line.squared_products(tables.of(i));
            let turn = tables.up[i][row];
            sums[0] += Complex64::new(xxc, xxs) * turn;
            sums[1] += Complex64::new(xc, xs) * turn * y;
            sums[2] += Complex64::new(c, s) * turn * (y * y);
        }
    }
}

/// Adds the correlation of one line with the basis.
fn add(
    gradient: &mut DVector<f64>,
    frame: &Frame,
    (basis, tables): (&Basis, &Tables),
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
    for i in 0..basis.indices.len() {
        let [c, s, xc, xs] = line.products(tables.of(i));
        let turn = tables.up[i][row];
        let first = basis.cosine(i);
        let (plain_c, plain_s) = (c * turn.re - s * turn.im, s * turn.re + c * turn.im);
        gradient[first] += plain_c;
        gradient[first + 1] += plain_s;
        gradient[first + 2] += xc * turn.re - xs * turn.im;
        gradient[first + 3] += xs * turn.re + xc * turn.im;
        gradient[first + 4] += y * plain_c;
        gradient[first + 5] += y * plain_s;
    }
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

/// The residual of one line as it counts, 0 where pixels do not, and what is to be added to all that do
/// for line means at the level of the other noise (`r − (1 − √(1−λ)) r̄`).
pub(super) fn settled(
    (frame, model, tables): (&Frame, &Model, &Tables),
    lines: &mut LineOffsets,
    clip: Clip,
    row: usize,
    line: &mut [f64],
) -> f64 {
    if frame.present[row] == 0 {
        line.fill(0.0);
        return 0.0;
    }
    residual(frame, model, tables, row, line);
    settle(line, row, frame, lines, clip);
    for value in line {
        *value = clip.apply(*value);
    }
    let lambda = lines.lambda[row];
    if lambda > 0.0 {
        // The mean is o/λ, of which o is off already.
        let mean = lines.offset[row] / lambda;
        lines.offset[row] - (1.0 - (1.0 - lambda).sqrt()) * mean
    } else {
        0.0
    }
}
