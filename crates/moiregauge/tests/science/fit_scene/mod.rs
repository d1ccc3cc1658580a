//! Images of a known lattice with everything that makes them hard, and the bound on what they tell.

use std::f64::consts::TAU;

use moiregauge::frame::Geometry;
use moiregauge::frame::Image;
use moiregauge::lattice::MeasuredLattice;
use moiregauge::numbers::stream;
use nalgebra::{DMatrix, Matrix2, Matrix4, Vector2, Vector4};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// A wave `amplitude · cos(q·n + phase)`, q in rad per pixel.
#[derive(Clone, Copy)]
pub(crate) struct Wave {
    pub(crate) q: Vector2<f64>,
    pub(crate) amplitude: f64,
    pub(crate) phase: f64,
}

/// What a test image holds.
#[derive(Clone)]
pub(crate) struct Scene {
    /// (columns, rows).
    pub(crate) size: [usize; 2],
    /// Real-space pair, px.
    pub(crate) basis: Matrix2<f64>,
    pub(crate) waves: Vec<Wave>,
    /// Standard deviation of white noise, of an offset per line, of 1/f noise in time, and of line
    /// offsets that are 1/f from line to line.
    pub(crate) white: f64,
    pub(crate) line: f64,
    pub(crate) flicker: f64,
    pub(crate) line_flicker: f64,
    /// By how much the wavelength along x changes from the left edge to the right one, as a share.
    pub(crate) change: f64,
    /// By how much the wave vector along x is smaller in the middle column than its mean, as a share; at the edges it is larger by twice
    /// that.
    pub(crate) bow: f64,
    pub(crate) seed: u64,
}

/// The shape of a period.
#[derive(Clone, Copy)]
pub(crate) enum Contrast {
    /// Three cosines of amplitude 1.
    Cosines,
    /// Gaussian spots: amplitudes `0.6^(N−1)` for |q|² = N |q₁|².
    Spots,
    /// Three families of walls, a fifth of a period wide.
    Walls,
}

impl Scene {
    /// A lattice of `periods` periods across the shorter side, turned by `angle`, a little distorted,
    /// with phases and position that depend on `seed`.
    pub(crate) fn new(
        size: [usize; 2],
        periods: f64,
        angle: f64,
        contrast: Contrast,
        seed: u64,
    ) -> Self {
        let length = size[0].min(size[1]) as f64 / periods;
        let (s, c) = angle.sin_cos();
        let hexagon = Matrix2::new(1.0, 0.5, 0.0, 0.75f64.sqrt()) * length;
        let basis = Matrix2::new(1.02, 0.01, 0.01, 0.98) * Matrix2::new(c, -s, s, c) * hexagon;
        let mut rng = stream(seed, "fit scene", 0);
        let origin = Vector2::new(normal(&mut rng), normal(&mut rng)) * length;
        let mut scene = Self {
            size,
            basis,
            waves: Vec::new(),
            white: 0.0,
            line: 0.0,
            flicker: 0.0,
            line_flicker: 0.0,
            change: 0.0,
            bow: 0.0,
            seed,
        };
        let pair = scene.pair();
        for (h, k) in (-4..=4).flat_map(|h| (-4..=4).map(move |k| (h, k))) {
            // The dual pair of vectors at 60° stands at 120°: |hq₁ + kq₂|² = h² − hk + k².
            let order = h * h - h * k + k * k;
            let on_axis = h == 0 || k == 0 || h == k;
            let amplitude = match contrast {
                Contrast::Cosines if order == 1 => 1.0,
                Contrast::Spots if order <= 9 => 0.6f64.powi(order - 1),
                Contrast::Walls if on_axis => {
                    1.2 * (-0.5 * f64::from(order) * (0.1 * TAU).powi(2)).exp()
                }
                _ => 0.0,
            };
            if amplitude > 0.0 && (k > 0 || (k == 0 && h > 0)) {
                let q = pair * Vector2::new(f64::from(h), f64::from(k));
                scene.waves.push(Wave {
                    q,
                    amplitude,
                    phase: -q.dot(&origin),
                });
            }
        }
        // What is beyond half a cycle per pixel is no part of a band-limited image.
        scene.waves.retain(|w| w.q.amax().max(-w.q.amin()) < 3.0);
        scene
    }

    /// The dual pair, `a_i·q_j = 2π δ_ij`.
    pub(crate) fn pair(&self) -> Matrix2<f64> {
        dual(&self.basis)
    }

    /// Pixels of one unit of length.
    pub(crate) fn geometry(&self) -> Geometry {
        let [columns, rows] = self.size;
        let extent = [columns, rows].map(|n| n as f64 - 1.0);
        Geometry::nominal(self.size, extent[0], extent[1], 0.0, Vector2::zeros()).unwrap()
    }

    pub(crate) fn image(&self) -> Image {
        let [columns, rows] = self.size;
        let mut values = vec![0.0; columns * rows];
        // Where a position of the lattice without change ends up: x − change · (x − middle)²/2 columns, and a cubic that is 0 at the edges.
        let position = |c: usize| {
            let x = c as f64;
            let middle = 0.5 * (columns as f64 - 1.0);
            let half = 0.5 * columns as f64;
            let edge = (x - middle) / half;
            x - 0.5 * self.change * (x - middle).powi(2) / columns as f64
                + self.bow * half * (edge.powi(3) - edge)
        };
        for wave in &self.waves {
            let along: Vec<(f64, f64)> = (0..columns)
                .map(|c| (wave.q.x * position(c)).sin_cos())
                .collect();
            for (row, line) in values.chunks_exact_mut(columns).enumerate() {
                let (s, c) = (wave.q.y * row as f64 + wave.phase).sin_cos();
                let (c, s) = (wave.amplitude * c, wave.amplitude * s);
                for (value, (sin, cos)) in line.iter_mut().zip(&along) {
                    *value += c * cos - s * sin;
                }
            }
        }
        let mut rng = stream(self.seed, "fit noise", 0);
        let mut flicker = Flicker::new(2 * columns * rows, self.seed);
        // A stream of its own, and slow relaxations beyond the frame.
        let mut line_flicker = Flicker::new(4 * rows, self.seed + (1 << 32));
        for (row, line) in values.chunks_exact_mut(columns).enumerate() {
            let mut offset = self.line * normal(&mut rng);
            if self.line_flicker > 0.0 {
                offset += self.line_flicker * line_flicker.next();
            }
            for (column, value) in line.iter_mut().enumerate() {
                let plane = 0.5 * (column as f64 - row as f64) / columns as f64;
                *value += offset + plane + self.white * normal(&mut rng);
                if self.flicker > 0.0 {
                    *value += self.flicker * flicker.next();
                }
            }
            if self.flicker > 0.0 {
                // The way back takes as long.
                flicker.skip(columns);
            }
        }
        Image::new(rows, columns, values)
    }

    /// Smallest covariance of (a1x, a1y, a2x, a2y) that an unbiased estimate can have with the white
    /// noise alone: inverse Fisher matrix of wave vectors, amplitudes, phases, mean and plane.
    pub(crate) fn bound(&self) -> Matrix4<f64> {
        let pair = self.pair();
        let inverse = pair.try_inverse().unwrap();
        let n = 7 + 2 * self.waves.len();
        let mut fisher = DMatrix::<f64>::zeros(n, n);
        for row in 0..self.size[1] {
            for column in 0..self.size[0] {
                let at = Vector2::new(column as f64, row as f64);
                let mut d = vec![0.0; n];
                (d[4], d[5], d[6]) = (1.0, at.x / self.size[0] as f64, at.y / self.size[1] as f64);
                for (i, wave) in self.waves.iter().enumerate() {
                    let (s, c) = (wave.q.dot(&at) + wave.phase).sin_cos();
                    let index = inverse * wave.q;
                    for j in 0..4 {
                        d[j] -= wave.amplitude * s * index[j / 2].round() * at[j % 2];
                    }
                    (d[7 + 2 * i], d[8 + 2 * i]) = (c, s);
                }
                for i in 0..n {
                    for j in 0..=i {
                        fisher[(i, j)] += d[i] * d[j];
                    }
                }
            }
        }
        fisher.fill_upper_triangle_with_lower_triangle();
        let of_pair = fisher.cholesky().unwrap().inverse() * self.white.powi(2);
        let of_pair: Matrix4<f64> = of_pair.fixed_view::<4, 4>(0, 0).into_owned();
        // How the vectors follow the pair, by central differences.
        let mut jacobian = Matrix4::zeros();
        for i in 0..4 {
            let step = 1e-6 * pair.amax();
            let moved = |sign: f64| {
                let mut moved = pair;
                moved[i] += sign * step;
                dual(&moved)
            };
            let slope = (moved(1.0) - moved(-1.0)) / (2.0 * step);
            jacobian.column_mut(i).copy_from_slice(slope.as_slice());
        }
        jacobian * of_pair * jacobian.transpose()
    }

    /// Errors over stated errors of the wave vectors, one by one: (q₁x, q₁y, q₂x, q₂y). x is the fast
    /// axis.
    pub(crate) fn wave_pulls(
        &self,
        measured: &Matrix2<f64>,
        covariance: &Matrix4<f64>,
    ) -> Vector4<f64> {
        let (change, by) = self.change(measured);
        let error = dual(&(measured * change)) - self.pair();
        // dQ = −Q dAᵀ Q / 2π.
        let pair = self.pair();
        let mut jacobian = Matrix4::zeros();
        for i in 0..4 {
            let mut unit = Matrix2::zeros();
            unit[i] = 1.0;
            let slope = -pair * unit.transpose() * pair / TAU;
            jacobian.column_mut(i).copy_from_slice(slope.as_slice());
        }
        let to_waves = jacobian * by;
        let variances = (to_waves * covariance * to_waves.transpose()).diagonal();
        Vector4::from_column_slice(error.as_slice()).component_div(&variances.map(f64::sqrt))
    }

    /// Errors over stated errors of the phases of the first harmonics, each with its cycles per frame along
    /// the fast axis.
    pub(crate) fn phase_pulls(&self, measured: &MeasuredLattice) -> Vec<(f64, f64)> {
        let (q1, q2) = (measured.reciprocal.column(0), measured.reciprocal.column(1));
        let three = [q1.into_owned(), q2.into_owned(), q2 - q1];
        let mut pulls = Vec::new();
        for (h, q) in three.into_iter().enumerate() {
            for wave in &self.waves {
                for sign in [1.0, -1.0] {
                    if (wave.q * sign - q).norm() < 0.05 * q.norm() {
                        let truth = sign * (wave.q.dot(&measured.middle) + wave.phase);
                        let miss = measured.phases.values[h] - truth;
                        let miss = miss - (miss / TAU).round() * TAU;
                        let cycles = wave.q.x.abs() * self.size[0] as f64 / TAU;
                        let sigma = measured.phases.covariance[(h, h)].sqrt();
                        pulls.push((cycles, miss / sigma));
                    }
                }
            }
        }
        pulls
    }

    /// Errors of the four components in the labelling closest to the truth.
    pub(crate) fn error(&self, measured: &Matrix2<f64>) -> Vector4<f64> {
        let (change, _) = self.change(measured);
        Vector4::from_column_slice((measured * change - self.basis).as_slice())
    }

    /// The change of basis that brings `measured` closest to the truth, and as a 4 × 4 matrix.
    pub(crate) fn change(&self, measured: &Matrix2<f64>) -> (Matrix2<f64>, Matrix4<f64>) {
        let mut best = Matrix2::identity();
        for code in 0..81 {
            let digit = |n: i32| f64::from(code / 3i32.pow(n as u32) % 3 - 1);
            let change = Matrix2::new(digit(0), digit(1), digit(2), digit(3));
            let miss = |m: &Matrix2<f64>| (measured * m - self.basis).norm();
            if change.determinant().abs() == 1.0 && miss(&change) < miss(&best) {
                best = change;
            }
        }
        (best, best.transpose().kronecker(&Matrix2::identity()))
    }
}

fn dual(basis: &Matrix2<f64>) -> Matrix2<f64> {
    basis.try_inverse().unwrap().transpose() * TAU
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// Unit variance with a 1/f spectrum: relaxations whose times grow by factors of four.
struct Flicker {
    states: Vec<[f64; 2]>,
    rng: ChaCha8Rng,
}

impl Flicker {
    fn new(length: usize, seed: u64) -> Self {
        let mut rng = stream(seed, "fit flicker", 0);
        let octaves = length.ilog2().div_ceil(2) as i32;
        let states = (0..octaves).map(|o| [(-0.25f64.powi(o)).exp(), normal(&mut rng)]);
        Self {
            states: states.collect(),
            rng,
        }
    }

    fn next(&mut self) -> f64 {
        let weight = (self.states.len() as f64).sqrt();
        let mut sum = 0.0;
        for [memory, state] in &mut self.states {
            sum += *state / weight;
            *state = *memory * *state + (1.0 - *memory * *memory).sqrt() * normal(&mut self.rng);
        }
        sum
    }

    fn skip(&mut self, steps: usize) {
        for [memory, state] in &mut self.states {
            let kept = memory.powi(steps as i32);
            *state = kept * *state + (1.0 - kept * kept).sqrt() * normal(&mut self.rng);
        }
    }
}
