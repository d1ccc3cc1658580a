//! Amplitudes of the lattice harmonics, and the noise around each of them.
//!
//! Model: `I(n) = c₀ + Σ_h [c_h e^{iq_h·n} + c.c.]`, fitted by least squares with the window as
//! weight. What it leaves behind gives the local noise power `S(q_h)` (white noise of variance σ²
//! has `S = σ²`), so that coloured and line noise count where they are.

use nalgebra::{DMatrix, DVector, Matrix2, Vector2};
use rustfft::num_complex::Complex64;

use crate::frame::background::{Background, take_background_off};
use crate::frame::image::Image;
use crate::numbers::dot::dot;
use crate::numbers::interrupt;
use crate::spectrum::hann::{hann, hann_transform};
use crate::spectrum::model::{Sum, centre, summed};

/// One harmonic of the lattice.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Harmonic {
    /// Wave vector, rad per pixel.
    pub(crate) q: Vector2<f64>,
    /// Complex amplitude, phase at pixel (0, 0); a cosine of amplitude A has |c| = A/2.
    pub(crate) amplitude: Complex64,
    /// Local noise power `S(q)` as it acts along x and along y, units of the image squared.
    pub(crate) noise: [f64; 2],
}

/// The harmonics of a lattice in one image.
#[derive(Clone, Debug)]
pub(crate) struct Harmonics {
    /// First shell first (three), then the others.
    pub(crate) list: Vec<Harmonic>,
    /// Sum of the squared window weights and of the weights.
    pub(crate) window_sums: [f64; 2],
    /// What the image has beside them everywhere.
    pub(crate) constant: f64,
    /// Their reciprocal pair, rad per pixel.
    pub(crate) pair: Matrix2<f64>,
}

impl Harmonics {
    /// The image that these harmonics make, with the shape and the missing pixels of the measured one, whose
    /// `background` is taken off as well, so that it goes through the same mill. Its lattice is known exactly: what an
    /// estimator makes of it is the estimator's bias on this frame.
    pub(crate) fn model(&self, image: &Image, background: Background) -> Image {
        let centre = centre(image.columns, image.rows);
        let waves = self
            .list
            .iter()
            .map(|h| (h.q, h.amplitude * Complex64::cis(h.q.dot(&centre))));
        let mut model = summed(image, self.constant, waves);
        take_background_off(&mut model, background);
        model
    }
}

impl Harmonic {
    /// Power of the harmonic over the noise power in one resolution cell; exponentially
    /// distributed with mean 1 where there is no signal.
    pub(crate) fn significance(&self, window_sums: [f64; 2]) -> f64 {
        self.amplitude.norm_sqr() * window_sums[1].powi(2)
            / (window_sums[0] * self.noise[0].max(self.noise[1]))
    }
}

/// The image times its window, ready for transforms at arbitrary frequencies.
pub(crate) struct Windowed {
    values: Vec<f64>,
    weights: Vec<f64>,
    /// Row by row.
    holes: Vec<Hole>,
    rows: usize,
    columns: usize,
}

/// A missing pixel and the weight that the window would give it.
struct Hole {
    row: usize,
    column: usize,
    weight: f64,
}

impl Windowed {
    /// Missing pixels get no weight.
    pub(crate) fn new(image: &Image) -> Self {
        let (wx, wy) = (hann(image.columns), hann(image.rows));
        let mut values = Vec::with_capacity(image.values.len());
        let mut weights = Vec::with_capacity(image.values.len());
        let mut holes = Vec::new();
        for (row, wy) in wy.iter().enumerate() {
            for (column, (v, wx)) in image.row(row).iter().zip(&wx).enumerate() {
                let weight = wx * wy;
                if v.is_finite() {
                    weights.push(weight);
                    values.push(v * weight);
                } else {
                    weights.push(0.0);
                    values.push(0.0);
                    holes.push(Hole {
                        row,
                        column,
                        weight,
                    });
                }
            }
        }
        Self {
            values,
            weights,
            holes,
            rows: image.rows,
            columns: image.columns,
        }
    }

    /// `Σ w I e^{−iq·n}`, with the phase at the centre.
    pub(crate) fn transform(&self, q: Vector2<f64>) -> Complex64 {
        let centre = centre(self.columns, self.rows);
        let turns = (0..self.columns).map(|c| q.x * (c as f64 - centre.x));
        let (re, im): (Vec<f64>, Vec<f64>) = turns.map(|x| (x.cos(), x.sin())).unzip();
        let mut sum = Complex64::default();
        for (row, line) in self.values.chunks_exact(self.columns).enumerate() {
            interrupt::check();
            let turn = Complex64::from_polar(1.0, -q.y * (row as f64 - centre.y));
            sum += turn * Complex64::new(dot(line, &re), -dot(line, &im));
        }
        sum
    }

    /// `Σ w I e^{−iq·n}` and its moments with `n − centre` along columns and rows.
    fn moments(&self, q: Vector2<f64>) -> [Complex64; 3] {
        let cx = (self.columns as f64 - 1.0) / 2.0;
        let cy = (self.rows as f64 - 1.0) / 2.0;
        let x: Vec<f64> = (0..self.columns).map(|c| c as f64 - cx).collect();
        let (re, im): (Vec<f64>, Vec<f64>) =
            x.iter().map(|x| ((q.x * x).cos(), (q.x * x).sin())).unzip();
        let (xre, xim): (Vec<f64>, Vec<f64>) = x
            .iter()
            .zip(re.iter().zip(&im))
            .map(|(x, (re, im))| (x * re, x * im))
            .unzip();
        let mut sums = [Complex64::default(); 3];
        for row in 0..self.rows {
            interrupt::check();
            let line = &self.values[row * self.columns..(row + 1) * self.columns];
            let y = row as f64 - cy;
            let turn = Complex64::from_polar(1.0, -q.y * y);
            let plain = turn * Complex64::new(dot(line, &re), -dot(line, &im));
            sums[0] += plain;
            sums[1] += turn * Complex64::new(dot(line, &xre), -dot(line, &xim));
            sums[2] += plain * y;
        }
        sums
    }

    /// The wave vector near `q` at which the transform is largest, in cycles-per-frame accuracy far
    /// below the grid: at an offset δ, `∂F/∂q = F · δ · W₂/W₀` for a single harmonic.
    pub(crate) fn refined_peak(&self, mut q: Vector2<f64>) -> Vector2<f64> {
        let second = |n: usize| {
            let w = hann(n);
            let c = (n as f64 - 1.0) / 2.0;
            let moment: f64 = w
                .iter()
                .enumerate()
                .map(|(i, w)| w * (i as f64 - c).powi(2))
                .sum();
            moment / w.iter().sum::<f64>()
        };
        let width = Vector2::new(second(self.columns), second(self.rows));
        for _ in 0..4 {
            let [f, fx, fy] = self.moments(q);
            // ∂F/∂q_x = −i Σ x w I e^{−iq·n}.
            let slope = |m: Complex64| (Complex64::new(0.0, -1.0) * m / f).re;
            let step = Vector2::new(slope(fx) / width.x, slope(fy) / width.y);
            if !step.iter().all(|s| s.is_finite()) {
                break;
            }
            // Never farther than half a cycle per frame: beyond it is another peak.
            let most = std::f64::consts::PI
                * Vector2::new(1.0 / self.columns as f64, 1.0 / self.rows as f64);
            q += Vector2::new(step.x.clamp(-most.x, most.x), step.y.clamp(-most.y, most.y));
        }
        q
    }

    /// The same of three waves.
    pub(crate) fn refined_peaks(&self, q: [Vector2<f64>; 3]) -> [Vector2<f64>; 3] {
        let ((a, b), c) = rayon::join(
            || rayon::join(|| self.refined_peak(q[0]), || self.refined_peak(q[1])),
            || self.refined_peak(q[2]),
        );
        [a, b, c]
    }

    /// `Σ w e^{−iq·n}` with the phase at the centre: that of the whole window, which is separable, less what
    /// the missing pixels would add.
    fn window_transform(&self, q: Vector2<f64>) -> Complex64 {
        let separable = hann_transform(q.x, self.columns) * hann_transform(q.y, self.rows);
        let mut sum = Complex64::new(separable, 0.0);
        if self.holes.is_empty() {
            return sum;
        }
        let cx = (self.columns as f64 - 1.0) / 2.0;
        let cy = (self.rows as f64 - 1.0) / 2.0;
        let along: Vec<Complex64> = (0..self.columns)
            .map(|c| Complex64::from_polar(1.0, -q.x * (c as f64 - cx)))
            .collect();
        for line in self.holes.chunk_by(|a, b| a.row == b.row) {
            let turn = Complex64::from_polar(1.0, -q.y * (line[0].row as f64 - cy));
            let missing: Complex64 = line.iter().map(|h| along[h.column] * h.weight).sum();
            sum -= turn * missing;
        }
        sum
    }

    /// What the window makes of pairs of waves, `Σ w e^{−i(q_a − q_b)·n}`; each difference is summed once.
    fn gram(&self, pair: &Matrix2<f64>, indices: &[(f64, f64)]) -> DMatrix<Complex64> {
        let mut known: Vec<((f64, f64), Complex64)> = Vec::new();
        let mut of = |(h, k): (f64, f64)| {
            if let Some((_, sum)) = known.iter().find(|(seen, _)| *seen == (h, k)) {
                return *sum;
            }
            let sum = self.window_transform(pair * Vector2::new(h, k));
            known.push(((h, k), sum));
            // The weights are real.
            known.push(((-h, -k), sum.conj()));
            sum
        };
        DMatrix::from_fn(indices.len(), indices.len(), |a, b| {
            let ((ha, ka), (hb, kb)) = (indices[a], indices[b]);
            of((ha - hb, ka - kb))
        })
    }

    /// Fits the harmonics `pair · (h, k)` of `shells`, which begin with the first one.
    ///
    /// `background` is what was taken off the image. `None` where the harmonics cannot be told apart on this frame.
    pub(crate) fn fit(
        &self,
        image: &Image,
        pair: &Matrix2<f64>,
        background: Background,
        shells: &[[i32; 2]],
    ) -> Option<Harmonics> {
        let sum = self.amplitudes(pair, shells)?;
        let model = sum.model(image, background);
        let noise = crate::spectrum::noise::LocalNoise::new(&residual(image, &model));
        let centre = centre(self.columns, self.rows);
        let list = sum.waves.iter().map(|&(q, amplitude)| Harmonic {
            q,
            amplitude: amplitude * Complex64::from_polar(1.0, -q.dot(&centre)),
            noise: noise.around(q),
        });
        let window_sums = [
            self.weights.iter().map(|w| w * w).sum(),
            self.weights.iter().sum(),
        ];
        Some(Harmonics {
            list: list.collect(),
            window_sums,
            constant: sum.constant,
            pair: *pair,
        })
    }

    /// The amplitudes of the harmonics alone.
    pub(crate) fn amplitudes(&self, pair: &Matrix2<f64>, shells: &[[i32; 2]]) -> Option<Sum> {
        let nyquist = 0.9 * std::f64::consts::PI;
        let wave = |&(h, k): &(f64, f64)| pair * Vector2::new(h, k);
        let indices = shells.iter().map(|&[h, k]| (f64::from(h), f64::from(k)));
        let resolved = indices.filter(|index| {
            let q = wave(index);
            q.amax() < nyquist && q.amin() > -nyquist
        });
        // Basis: 1, e^{iq}, e^{−iq}, …, phases at the centre.
        let mut indices = vec![(0.0, 0.0)];
        indices.extend(resolved.flat_map(|(h, k)| [(h, k), (-h, -k)]));
        let n = indices.len();
        if n < 7 {
            return None;
        }
        let waves: Vec<Vector2<f64>> = indices.iter().map(wave).collect();
        let gram = self.gram(pair, &indices);
        let mut right = DVector::from_iterator(
            n,
            waves.iter().enumerate().map(|(i, &wave)| {
                // The image is real: the transform at −q is the conjugate of that at q.
                if i > 0 && i % 2 == 0 {
                    Complex64::default()
                } else {
                    self.transform(wave)
                }
            }),
        );
        for i in (2..n).step_by(2) {
            right[i] = right[i - 1].conj();
        }
        let amplitudes = gram.lu().solve(&right)?;
        let of = |i: usize| (waves[i], amplitudes[i]);
        Some(Sum {
            constant: amplitudes[0].re,
            waves: (1..n).step_by(2).map(of).collect(),
        })
    }
}

/// Image minus model; missing pixels become 0.
fn residual(image: &Image, model: &Image) -> Image {
    let values = image
        .values
        .iter()
        .zip(&model.values)
        .map(|(v, m)| if v.is_finite() { v - m } else { 0.0 })
        .collect();
    Image::new(image.rows, image.columns, values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::shells::shells;

    /// An image with holes: one pixel, part of a line, whole lines, a corner.
    fn with_holes(rows: usize, columns: usize) -> Image {
        let mut values: Vec<f64> = (0..rows * columns)
            .map(|i| (0.7 * i as f64).sin())
            .collect();
        let mut lose = |row: usize, columns_lost: std::ops::Range<usize>| {
            for column in columns_lost {
                values[row * columns + column] = f64::NAN;
            }
        };
        lose(11, 17..18);
        lose(20, 5..31);
        lose(30, 0..columns);
        for row in 40..rows {
            lose(row, 33..columns);
        }
        Image::new(rows, columns, values)
    }

    /// The sum over all pixels that are there, as the definition has it.
    #[test]
    fn holes_are_taken_off_the_window_exactly() {
        let (rows, columns) = (52, 47);
        let image = with_holes(rows, columns);
        let windowed = Windowed::new(&image);
        let (wx, wy) = (hann(columns), hann(rows));
        for q in [[0.0, 0.0], [0.41, -0.23], [-2.3, 0.02], [5.9, 3.3]] {
            let q = Vector2::from(q);
            let mut slow = Complex64::default();
            for (row, wy) in wy.iter().enumerate() {
                for (column, wx) in wx.iter().enumerate() {
                    if image.values[row * columns + column].is_finite() {
                        let x = column as f64 - (columns as f64 - 1.0) / 2.0;
                        let y = row as f64 - (rows as f64 - 1.0) / 2.0;
                        let weight = wx * wy;
                        slow += Complex64::from_polar(weight, -(q.x * x + q.y * y));
                    }
                }
            }
            let fast = windowed.window_transform(q);
            assert!((fast - slow).norm() < 1e-9, "{q}: {fast} {slow}");
        }
    }

    /// Every entry of the normal matrix is the transform at the difference of its two waves.
    #[test]
    fn equal_differences_share_their_sum() {
        let windowed = Windowed::new(&with_holes(52, 47));
        let pair = Matrix2::new(0.5, 0.17, 0.06, 0.46);
        let indices: Vec<(f64, f64)> = std::iter::once((0.0, 0.0))
            .chain(shells(3).iter().flat_map(|&[h, k]| {
                let (h, k) = (f64::from(h), f64::from(k));
                [(h, k), (-h, -k)]
            }))
            .collect();
        let gram = windowed.gram(&pair, &indices);
        for (a, &(ha, ka)) in indices.iter().enumerate() {
            for (b, &(hb, kb)) in indices.iter().enumerate() {
                let q = pair * Vector2::new(ha - hb, ka - kb);
                let alone = windowed.window_transform(q);
                assert!((gram[(a, b)] - alone).norm() < 1e-9, "{a} {b}");
            }
        }
    }
}
