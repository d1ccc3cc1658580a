//! Sums of products of the basis functions over the pixels that count.
//!
//! Products of two waves are waves at the sum and the difference of their wave vectors, so all that
//! is needed is `K_ab(h, k) = Σ XᵃYᵇ e^{iθ_hk}` at the points of the lattice. On a full frame it is a
//! product of two one-dimensional sums; missing pixels are taken off one by one.
//!
//! Line offsets are random with a known variance: `W = 1 − (λ/n) 11ᵀ` on each line of n pixels, λ from
//! 0 (no offsets) to 1 (offsets free), takes their share off every sum.

use std::collections::HashMap;

use nalgebra::{DMatrix, Matrix2};
use rustfft::num_complex::Complex64;

use super::frame::{Basis, Frame, turns, wave};

/// `Φᵀ W Φ` of the whole basis. `lambda` holds λ of each line.
pub(super) fn gram(
    frame: &Frame,
    basis: &Basis,
    pair: &Matrix2<f64>,
    lambda: &[f64],
) -> DMatrix<f64> {
    let mut kernels = Kernels::new(frame, pair, basis.degree());
    let n = basis.len();
    let functions: Vec<Function> = functions(basis);
    let mut gram = DMatrix::zeros(n, n);
    for i in 0..n {
        for j in 0..=i {
            let value = kernels.product(&functions[i], &functions[j]);
            gram[(i, j)] = value;
            gram[(j, i)] = value;
        }
    }
    if lambda.iter().any(|l| *l > 0.0) {
        // Each column: the sums over one line, times the root of λ/n.
        let sums = line_sums(frame, basis, pair, lambda);
        gram -= &sums * sums.transpose();
    }
    gram
}

/// One basis function: `XᵃYᵇ` times 1, `cos θ` or `sin θ`.
struct Function {
    powers: [usize; 2],
    index: [i32; 2],
    /// `cos` where false; the background is a cosine of phase 0.
    sine: bool,
}

fn functions(basis: &Basis) -> Vec<Function> {
    let mut all: Vec<Function> = basis
        .terms
        .iter()
        .map(|&powers| Function {
            powers,
            index: [0, 0],
            sine: false,
        })
        .collect();
    for &index in &basis.indices {
        for powers in [[0, 0], [1, 0], [0, 1]] {
            all.extend([false, true].map(|sine| Function {
                powers,
                index,
                sine,
            }));
        }
    }
    all
}

/// The sums `K_ab(h, k)`, made when they are asked for.
struct Kernels<'a> {
    frame: &'a Frame<'a>,
    pair: &'a Matrix2<f64>,
    /// Powers up to this one.
    highest: usize,
    known: HashMap<[i32; 2], Vec<Complex64>>,
}

impl<'a> Kernels<'a> {
    fn new(frame: &'a Frame<'a>, pair: &'a Matrix2<f64>, degree: usize) -> Self {
        Self {
            frame,
            pair,
            highest: (2 * degree).max(2),
            known: HashMap::new(),
        }
    }

    fn product(&mut self, f: &Function, g: &Function) -> f64 {
        let [a, b] = [f.powers[0] + g.powers[0], f.powers[1] + g.powers[1]];
        let sum = self.at([f.index[0] + g.index[0], f.index[1] + g.index[1]], a, b);
        let difference = self.at([f.index[0] - g.index[0], f.index[1] - g.index[1]], a, b);
        let twice = match (f.sine, g.sine) {
            (false, false) => sum.re + difference.re,
            (true, true) => difference.re - sum.re,
            (false, true) => sum.im - difference.im,
            (true, false) => sum.im + difference.im,
        };
        0.5 * twice
    }

    fn at(&mut self, index: [i32; 2], a: usize, b: usize) -> Complex64 {
        let conjugate = index[1] < 0 || (index[1] == 0 && index[0] < 0);
        let [h, k] = if conjugate {
            [-index[0], -index[1]]
        } else {
            index
        };
        let width = self.highest + 1;
        let (frame, pair) = (self.frame, self.pair);
        let table = self
            .known
            .entry([h, k])
            .or_insert_with(|| table(frame, pair, [h, k], width));
        let value = table[b * width + a];
        if conjugate { value.conj() } else { value }
    }
}

/// `K_ab` for all a, b < `width` at one point of the lattice.
fn table(frame: &Frame, pair: &Matrix2<f64>, index: [i32; 2], width: usize) -> Vec<Complex64> {
    let p = wave(pair, index);
    let (across, up) = (turns(p.x, &frame.x), turns(p.y, &frame.y));
    let moments = |turns: &[Complex64], x: &[f64], counts: &dyn Fn(usize) -> bool| {
        let mut sums = vec![Complex64::default(); width];
        for (i, (turn, x)) in turns.iter().zip(x).enumerate() {
            if counts(i) {
                let mut value = *turn;
                for sum in &mut sums {
                    *sum += value;
                    value *= x;
                }
            }
        }
        sums
    };
    let mx = moments(&across, &frame.x, &|_| true);
    let my = moments(&up, &frame.y, &|row| frame.present[row] > 0);
    let mut table: Vec<Complex64> = my
        .iter()
        .flat_map(|my| mx.iter().map(move |mx| mx * my))
        .collect();
    for &[row, column] in &frame.missing {
        let mut line = up[row] * across[column];
        for values in table.chunks_exact_mut(width) {
            let mut value = line;
            for sum in values {
                *sum -= value;
                value *= frame.x[column];
            }
            line *= frame.y[row];
        }
    }
    table
}

/// Sum of every basis function over each line, times `√(λ/n)` of the line.
fn line_sums(frame: &Frame, basis: &Basis, pair: &Matrix2<f64>, lambda: &[f64]) -> DMatrix<f64> {
    let rows = frame.image.rows;
    let mut sums = DMatrix::zeros(basis.len(), rows);
    let root = |row: usize| match frame.present[row] {
        0 => 0.0,
        n => (lambda[row] / n as f64).sqrt(),
    };
    let power = |x: f64, n: usize| x.powi(n as i32);
    for (t, &[a, b]) in basis.terms.iter().enumerate() {
        let full: f64 = frame.x.iter().map(|x| power(*x, a)).sum();
        let mut along = vec![full; rows];
        for &[row, column] in &frame.missing {
            along[row] -= power(frame.x[column], a);
        }
        for (row, along) in along.iter().enumerate() {
            sums[(t, row)] = root(row) * power(frame.y[row], b) * along;
        }
    }
    for (i, &index) in basis.indices.iter().enumerate() {
        let p = wave(pair, index);
        let (across, up) = (turns(p.x, &frame.x), turns(p.y, &frame.y));
        let full = across
            .iter()
            .zip(&frame.x)
            .fold([Complex64::default(); 2], |[plain, tilted], (turn, x)| {
                [plain + turn, tilted + turn * x]
            });
        let mut along = vec![full; rows];
        for &[row, column] in &frame.missing {
            along[row][0] -= across[column];
            along[row][1] -= across[column] * frame.x[column];
        }
        let first = basis.cosine(i);
        for (row, [plain, tilted]) in along.iter().enumerate() {
            let turn = up[row] * root(row);
            let values = [plain * turn, tilted * turn, plain * turn * frame.y[row]];
            for (v, value) in values.iter().enumerate() {
                sums[(first + 2 * v, row)] = value.re;
                sums[(first + 2 * v + 1, row)] = value.im;
            }
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;
    use nalgebra::DVector;

    /// The sums equal those over the pixels one by one, with missing pixels, a missing line and
    /// partial line offsets.
    #[test]
    fn sums_match_their_definition() {
        let (rows, columns) = (9, 12);
        let mut values = vec![0.0; rows * columns];
        for gone in [5, 17, 40, 41, 60] {
            values[gone] = f64::NAN;
        }
        values[7 * columns..8 * columns].fill(f64::NAN);
        let image = Image::new(rows, columns, values);
        let frame = Frame::new(&image);
        let basis = Basis::new(2, false, &[[1, 0], [0, 1], [-1, 1], [2, -1]]);
        let pair = Matrix2::new(2.1, 0.7, 0.4, 3.3);
        let lambda: Vec<f64> = (0..rows).map(|r| 0.1 * r as f64).collect();
        let n = basis.len();
        let mut expected = DMatrix::<f64>::zeros(n, n);
        for row in (0..rows).filter(|&r| r != 7) {
            let (mut line, mut count) = (DVector::<f64>::zeros(n), 0.0);
            for column in (0..columns).filter(|c| image.row(row)[*c].is_finite()) {
                let (x, y) = (frame.x[column], frame.y[row]);
                let mut v: Vec<f64> = vec![1.0, x, y, x * x, x * y, y * y];
                for &[h, k] in &basis.indices {
                    let theta =
                        f64::from(h) * (2.1 * x + 0.4 * y) + f64::from(k) * (0.7 * x + 3.3 * y);
                    let (s, c) = theta.sin_cos();
                    v.extend([c, s, x * c, x * s, y * c, y * s]);
                }
                let v = DVector::from_vec(v);
                expected += &v * v.transpose();
                line += v;
                count += 1.0;
            }
            expected -= &line * line.transpose() * (lambda[row] / count);
        }
        let got = gram(&frame, &basis, &pair, &lambda);
        assert!((got - expected).amax() < 1e-11);
    }
}
