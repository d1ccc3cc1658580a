//! Sums of products of the basis functions over the pixels that count.
//!
//! Products of two waves are waves at the sum and the difference of their wave vectors, so all that
//! is needed is `K_ab(h, k) = Σ XᵃYᵇ e^{iθ_hk}` at the points of the lattice. On a full frame it is a
//! product of two one-dimensional sums; missing pixels are taken off one by one.
//!
//! Line offsets are random with a known variance: `W = 1 − (λ/n) 11ᵀ` on each line of n pixels, λ from
//! 0 (no offsets) to 1 (offsets free), takes their share off every sum. Where all lines are complete,
//! the sum of a function over a line is a wave along Y, and its products are known as well.

use nalgebra::{DMatrix, Matrix2};
use rustfft::num_complex::Complex64;

use crate::lattice::fit::frame::{Basis, Frame, turns, wave};
use crate::numbers::dot::dot;

/// `Φᵀ W Φ` of the whole basis. `lambda` holds λ of each line.
pub(crate) fn gram(
    frame: &Frame,
    basis: &Basis,
    pair: &Matrix2<f64>,
    lambda: &[f64],
) -> DMatrix<f64> {
    let mut kernels = Kernels::new(frame, basis, pair);
    let n = basis.len();
    let functions: Vec<Function> = functions(basis);
    let mut shares = frame.present.iter().zip(lambda).filter(|(n, _)| **n > 0);
    let first = shares.next().map_or(0.0, |(_, lambda)| *lambda);
    // One share for all lines, unless pixels are missing.
    let common = frame.missing.is_empty() && shares.all(|(_, lambda)| *lambda == first);
    let share = if common {
        first / frame.image.columns as f64
    } else {
        0.0
    };
    let mut gram = DMatrix::zeros(n, n);
    for i in 0..n {
        for j in 0..=i {
            let (f, g) = (&functions[i], &functions[j]);
            let mut value = kernels.product(f, g);
            if share > 0.0 {
                value -= share * kernels.product_of_line_sums(f, g);
            }
            gram[(i, j)] = value;
            gram[(j, i)] = value;
        }
    }
    if !common && lambda.iter().any(|l| *l > 0.0) {
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
        for &powers in basis.orders {
            all.extend([false, true].map(|sine| Function {
                powers,
                index,
                sine,
            }));
        }
    }
    all
}

/// The sums at one point (h, k) of the lattice.
struct Entry {
    /// `K_ab`.
    whole: Vec<Complex64>,
    /// `Σ Xᵃ e^{iθ_x}` over a complete line.
    across: Vec<Complex64>,
    /// `Σ Yᵇ e^{iθ_y}` over the lines that count.
    up: Vec<Complex64>,
}

/// The sums over the frame, made when they are asked for.
struct Kernels<'a> {
    frame: &'a Frame<'a>,
    pair: &'a Matrix2<f64>,
    /// Powers of X on the right half of a line (the middle, if there is one, counts half), and of Y
    /// on the lines that count.
    powers: [Vec<Vec<f64>>; 2],
    /// Largest |h| or |k|.
    reach: i32,
    known: Vec<Option<Entry>>,
}

impl<'a> Kernels<'a> {
    fn new(frame: &'a Frame<'a>, basis: &Basis, pair: &'a Matrix2<f64>) -> Self {
        let highest = 2 * basis.highest();
        let mut x = vec![vec![1.0; frame.right().len()]];
        if frame.image.columns % 2 == 1 {
            x[0][0] = 0.5;
        }
        let counts = frame.present.iter().map(|n| f64::from(*n > 0));
        let mut y = vec![counts.collect::<Vec<f64>>()];
        for a in 0..highest {
            x.push(x[a].iter().zip(frame.right()).map(|(p, x)| p * x).collect());
            y.push(y[a].iter().zip(&frame.y).map(|(p, y)| p * y).collect());
        }
        let largest = |index: &[i32; 2]| index[0].abs().max(index[1].abs());
        let reach = 2 * basis.indices.iter().map(largest).max().unwrap_or(0);
        let side = (2 * reach + 1) as usize;
        Self {
            frame,
            pair,
            powers: [x, y],
            reach,
            known: (0..side * side).map(|_| None).collect(),
        }
    }

    /// `Σ f g` over the pixels.
    fn product(&mut self, f: &Function, g: &Function) -> f64 {
        let [a, b] = [f.powers[0] + g.powers[0], f.powers[1] + g.powers[1]];
        let width = self.powers[0].len();
        let [sum, difference] = self.both(f, g, |entry| entry.whole[b * width + a]);
        product_of_parts(f, g, sum, difference)
    }

    /// `Σ (Σ f)(Σ g)`, the inner sums over each line, the outer one over the lines.
    fn product_of_line_sums(&mut self, f: &Function, g: &Function) -> f64 {
        let [mf, mg] = [f, g].map(|f| self.at(f.index, |entry| entry.across[f.powers[0]]));
        let b = f.powers[1] + g.powers[1];
        let [sum, difference] = self.both(f, g, |entry| entry.up[b]);
        product_of_parts(f, g, mf * mg * sum, mf * mg.conj() * difference)
    }

    /// What `pick` says at the sum and at the difference of two indices.
    fn both(
        &mut self,
        f: &Function,
        g: &Function,
        pick: impl Fn(&Entry) -> Complex64,
    ) -> [Complex64; 2] {
        let sum = [f.index[0] + g.index[0], f.index[1] + g.index[1]];
        let difference = [f.index[0] - g.index[0], f.index[1] - g.index[1]];
        [self.at(sum, &pick), self.at(difference, &pick)]
    }

    fn at(&mut self, index: [i32; 2], pick: impl Fn(&Entry) -> Complex64) -> Complex64 {
        let conjugate = index[1] < 0 || (index[1] == 0 && index[0] < 0);
        let [h, k] = if conjugate {
            [-index[0], -index[1]]
        } else {
            index
        };
        let side = 2 * self.reach + 1;
        let place = ((k + self.reach) * side + h + self.reach) as usize;
        if self.known[place].is_none() {
            self.known[place] = Some(self.entry([h, k]));
        }
        let value = self.known[place]
            .as_ref()
            .map_or_else(Complex64::default, pick);
        if conjugate { value.conj() } else { value }
    }

    fn entry(&self, index: [i32; 2]) -> Entry {
        let frame = self.frame;
        let p = wave(self.pair, index);
        let parts = |turns: &[Complex64]| -> [Vec<f64>; 2] {
            let (re, im) = turns.iter().map(|t| (t.re, t.im)).unzip();
            [re, im]
        };
        // What lies at X and −X adds up to twice the cosine or, with odd powers, the sine.
        let [cos, sin] = parts(&turns(p.x, frame.right()));
        let across: Vec<Complex64> = (self.powers[0].iter().enumerate())
            .map(|(a, power)| match a % 2 {
                0 => Complex64::new(2.0 * dot(&cos, power), 0.0),
                _ => Complex64::new(0.0, 2.0 * dot(&sin, power)),
            })
            .collect();
        let [cos, sin] = parts(&turns(p.y, &frame.y));
        let up: Vec<Complex64> = (self.powers[1].iter())
            .map(|power| Complex64::new(dot(&cos, power), dot(&sin, power)))
            .collect();
        let mut whole: Vec<Complex64> = up
            .iter()
            .flat_map(|up| across.iter().map(move |across| across * up))
            .collect();
        if !frame.missing.is_empty() {
            let along = turns(p.x, &frame.x);
            for &[row, column] in &frame.missing {
                let mut line = Complex64::new(cos[row], sin[row]) * along[column];
                for values in whole.chunks_exact_mut(across.len()) {
                    let mut value = line;
                    for sum in values {
                        *sum -= value;
                        value *= frame.x[column];
                    }
                    line *= frame.y[row];
                }
            }
        }
        Entry { whole, across, up }
    }
}

/// The product of two cosines or sines from the waves at the sum and at the difference.
fn product_of_parts(f: &Function, g: &Function, sum: Complex64, difference: Complex64) -> f64 {
    let twice = match (f.sine, g.sine) {
        (false, false) => sum.re + difference.re,
        (true, true) => difference.re - sum.re,
        (false, true) => sum.im - difference.im,
        (true, false) => sum.im + difference.im,
    };
    0.5 * twice
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
        for (v, &[a, b]) in basis.orders.iter().enumerate() {
            let tilted = |column: usize| across[column] * power(frame.x[column], a);
            let full: Complex64 = (0..frame.image.columns).map(tilted).sum();
            let mut along = vec![full; rows];
            for &[row, column] in &frame.missing {
                along[row] -= tilted(column);
            }
            let first = basis.cosine(i) + 2 * v;
            for (row, along) in along.iter().enumerate() {
                let value = along * up[row] * (root(row) * power(frame.y[row], b));
                sums[(first, row)] = value.re;
                sums[(first + 1, row)] = value.im;
            }
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::image::Image;
    use crate::lattice::fit::frame::BENT;
    use nalgebra::DVector;

    /// The sums equal those over the pixels one by one, with a missing line and partial line offsets:
    /// with missing pixels, and on complete lines of an even and an odd number of pixels.
    #[test]
    fn sums_match_their_definition() {
        let different = |row: usize| 0.1 * row as f64;
        matches_definition([12, 9], &[5, 17, 40, 41, 60], &different);
        matches_definition([12, 9], &[], &|_| 0.7);
        matches_definition([13, 9], &[], &|_| 1.0);
    }

    fn matches_definition(
        [columns, rows]: [usize; 2],
        missing: &[usize],
        lambda: &dyn Fn(usize) -> f64,
    ) {
        let mut values = vec![0.0; rows * columns];
        for gone in missing {
            values[*gone] = f64::NAN;
        }
        values[7 * columns..8 * columns].fill(f64::NAN);
        let image = Image::new(rows, columns, values);
        let frame = Frame::new(&image);
        let mut basis = Basis::new(2, false, &[[1, 0], [0, 1], [-1, 1], [2, -1]]);
        basis.orders = BENT;
        let pair = Matrix2::new(2.1, 0.7, 0.4, 3.3);
        let lambda: Vec<f64> = (0..rows).map(lambda).collect();
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
                    let cubes = [x * x * x, x * x * y, x * y * y, y * y * y];
                    let bends = [x * x, x * y, y * y].into_iter().chain(cubes);
                    v.extend(bends.flat_map(|xy| [xy * c, xy * s]));
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
