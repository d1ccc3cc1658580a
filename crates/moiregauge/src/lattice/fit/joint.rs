//! Perfect waves and a plane, fitted together to an image (Gauss–Newton).

use std::f64::consts::{FRAC_PI_8, PI};

use nalgebra::{DMatrix, DVector, Vector2};
use rustfft::num_complex::Complex64;

use crate::lattice::fit::few::SKIRT;
use crate::lattice::fit::frame::{Frame, turns};
use crate::numbers::dot::dot;
use crate::numbers::interrupt;
use crate::numbers::widest::widest;

/// Waves stand still when no phase at an edge moves by more than this, rad.
const STILL: f64 = 1e-4;
/// Cycles of the frame by which a wave may move from its bin: two waves under one peak are farther from it than one.
const FARTHEST: f64 = 1.6;
/// Waves closer than this, cycles of the frame, are one that is not perfect.
const APART: f64 = 0.7;
/// Waves that may have another within [`SKIRT`]: a stripe and an overtone of it may each be close to a wave of a lattice.
const CLOSE: usize = 4;

/// A plane and perfect waves, fitted together.
#[derive(Default)]
pub(super) struct Joint {
    plane: [f64; 3],
    /// Phases at the edges.
    pub(super) waves: Vec<Vector2<f64>>,
    /// (a, b) of `a cos θ + b sin θ`.
    pub(super) amplitudes: Vec<[f64; 2]>,
    /// Where the waves started.
    starts: Vec<Vector2<f64>>,
}

impl Joint {
    /// Waves that are known, without amplitudes.
    pub(super) fn of(waves: Vec<Vector2<f64>>) -> Self {
        Self {
            amplitudes: vec![[0.0; 2]; waves.len()],
            starts: waves.clone(),
            waves,
            ..Self::default()
        }
    }

    pub(super) fn add(&mut self, p: Vector2<f64>) {
        self.waves.push(p);
        self.amplitudes.push([0.0; 2]);
        self.starts.push(p);
    }

    /// Gauss–Newton on all of it; `None` where a wave runs away, or two are one.
    pub(super) fn converge(&mut self, frame: &Frame, steps: usize) -> Option<()> {
        self.fit_amplitudes(frame)?;
        for _ in 0..steps {
            let step = self.step(frame, true)?;
            let turns = step.rows(3 + 2 * self.waves.len(), 2 * self.waves.len());
            let turn = turns.amax();
            self.apply(&step, (FRAC_PI_8 / turn).min(1.0));
            let ran = self.waves.iter().zip(&self.starts);
            if ran
                .map(|(p, start)| (p - start).norm())
                .any(|d| !(d < FARTHEST * PI))
            {
                return None;
            }
            if turn < STILL {
                break;
            }
        }
        let apart = |(i, p): (usize, &Vector2<f64>)| {
            let others = self.waves[i + 1..].iter();
            others.map(|q| (p - q).norm()).all(|d| d > APART * PI)
        };
        self.waves.iter().enumerate().all(apart).then_some(())
    }

    /// Whether many waves have another close to them: those of a lattice that changes, or that covers a part of the frame.
    pub(super) fn has_skirts(&self) -> bool {
        let close = |p: &&Vector2<f64>| {
            let others = self.waves.iter().map(|q| (*p - q).norm() / PI);
            others.filter(|d| *d > 0.0).any(|d| d < SKIRT)
        };
        self.waves.iter().filter(close).count() > CLOSE
    }

    pub(super) fn fit_amplitudes(&mut self, frame: &Frame) -> Option<()> {
        let step = self.step(frame, false)?;
        self.apply(&step, 1.0);
        Some(())
    }

    /// By how much all numbers change: plane, amplitudes and, where they are free, phases at the edges.
    fn step(&self, frame: &Frame, free: bool) -> Option<DVector<f64>> {
        let count = self.waves.len();
        let numbers = 3 + if free { 4 } else { 2 } * count;
        // The plane is a wave, too, of which the phase is 0 everywhere.
        let waves: Vec<Vector2<f64>> = (self.waves.iter().copied())
            .chain([Vector2::zeros()])
            .collect();
        let mut parts: Vec<Part> = [[0, 0], [1, 0], [0, 1]]
            .map(|powers| Part::new(powers, count, Complex64::ONE))
            .into();
        for i in 0..count {
            let [cos, sin] = [Complex64::ONE, -Complex64::I];
            parts.extend([cos, sin].map(|c| Part::new([0, 0], i, c)));
        }
        for (i, [a, b]) in self.amplitudes.iter().enumerate().filter(|_| free) {
            let slope = Complex64::new(*b, *a);
            parts.extend([[1, 0], [0, 1]].map(|powers| Part::new(powers, i, slope)));
        }
        let mut normal = DMatrix::zeros(numbers, numbers);
        for (i, p) in waves.iter().enumerate() {
            for (j, q) in waves.iter().enumerate() {
                // The product of two waves is one at their sum and one at their difference.
                let (sum, difference) = (sums(frame, p + q), sums(frame, p - q));
                for (m, f) in parts.iter().enumerate().filter(|(_, f)| f.wave == i) {
                    for (n, g) in parts.iter().enumerate().filter(|(_, g)| g.wave == j) {
                        let [a, b] = [0, 1].map(|axis| f.powers[axis] + g.powers[axis]);
                        let both = f.factor * g.factor * sum[b][a]
                            + f.factor * g.factor.conj() * difference[b][a];
                        normal[(m, n)] = both.re / 2.0;
                    }
                }
            }
        }
        let left = self.left(frame);
        let with_left = waves.iter().map(|p| products(frame, &left, p));
        let with_left: Vec<[Complex64; 3]> = with_left.collect();
        let right = parts.iter().map(|part| {
            let of_wave = &with_left[part.wave];
            (part.factor * of_wave[part.powers[0] + 2 * part.powers[1]]).re
        });
        let right = DVector::from_iterator(numbers, right);
        Some(normal.cholesky()?.solve(&right))
    }

    fn apply(&mut self, step: &DVector<f64>, share: f64) {
        let count = self.waves.len();
        for (value, change) in self.plane.iter_mut().zip(step.iter()) {
            *value += share * change;
        }
        for i in 0..count {
            for axis in 0..2 {
                self.amplitudes[i][axis] += share * step[3 + 2 * i + axis];
                if step.len() > 3 + 2 * count {
                    self.waves[i][axis] += share * step[3 + 2 * (count + i) + axis];
                }
            }
        }
    }

    /// What is left of the pixels, 0 where they do not count.
    pub(super) fn left(&self, frame: &Frame) -> Vec<f64> {
        let along = self.waves.iter().map(|p| parts(&turns(p.x, &frame.x)));
        let along: Vec<[Vec<f64>; 2]> = along.collect();
        let up: Vec<_> = self.waves.iter().map(|p| turns(p.y, &frame.y)).collect();
        let columns = frame.image.columns;
        let mut left = vec![0.0; frame.image.values.len()];
        for (row, line) in left.chunks_exact_mut(columns).enumerate() {
            if frame.present[row] == 0 {
                continue;
            }
            interrupt::check();
            let level = self.plane[0] + self.plane[2] * frame.y[row];
            let pixels = frame.image.row(row).iter().zip(&frame.x);
            for (left, (pixel, x)) in line.iter_mut().zip(pixels) {
                *left = pixel - level - self.plane[1] * x;
            }
            for (([cos, sin], up), [a, b]) in along.iter().zip(&up).zip(&self.amplitudes) {
                let turned = Complex64::new(*a, -b) * up[row];
                take_off(line, cos, sin, turned);
            }
            let missing = line.iter_mut().filter(|left| !left.is_finite());
            missing.for_each(|left| *left = 0.0);
        }
        left
    }

    /// Takes one wave off an image.
    pub(super) fn take_off(&self, frame: &Frame, wave: usize, values: &mut [f64]) {
        let (p, [a, b]) = (self.waves[wave], self.amplitudes[wave]);
        let along = turns(p.x, &frame.x);
        let up = turns(p.y, &frame.y);
        for (line, up) in values.chunks_exact_mut(frame.image.columns).zip(&up) {
            for (value, along) in line.iter_mut().zip(&along) {
                let turn = along * up;
                *value -= a * turn.re + b * turn.im;
            }
        }
    }
}

/// What an image changes with one number: `Re (factor XᵃYᵇ e^{iθ})` of a wave.
struct Part {
    powers: [usize; 2],
    wave: usize,
    factor: Complex64,
}

impl Part {
    fn new(powers: [usize; 2], wave: usize, factor: Complex64) -> Self {
        Self {
            powers,
            wave,
            factor,
        }
    }
}

/// `Σ XᵃYᵇ e^{iθ}` over the pixels that count, a and b up to 2, those of one b together.
fn sums(frame: &Frame, p: Vector2<f64>) -> [[Complex64; 3]; 3] {
    let counts = |row: usize| frame.present[row] > 0;
    let along = turns(p.x, &frame.x);
    let up = turns(p.y, &frame.y);
    let mut sums = [[Complex64::ZERO; 3]; 3];
    let [mut across, mut rows] = [[Complex64::ZERO; 3]; 2];
    add_powers(&mut across, along.iter().zip(&frame.x));
    let used = up.iter().zip(&frame.y).enumerate();
    add_powers(
        &mut rows,
        used.filter(|(row, _)| counts(*row)).map(|(_, at)| at),
    );
    for (sums, up) in sums.iter_mut().zip(rows) {
        for (sum, across) in sums.iter_mut().zip(across) {
            *sum = across * up;
        }
    }
    for &[row, column] in &frame.missing {
        let mut line = along[column] * up[row];
        for sums in &mut sums {
            let mut value = line;
            for sum in sums {
                *sum -= value;
                value *= frame.x[column];
            }
            line *= frame.y[row];
        }
    }
    sums
}

/// Adds turns times the powers of their places.
fn add_powers<'a>(
    sums: &mut [Complex64; 3],
    turns: impl Iterator<Item = (&'a Complex64, &'a f64)>,
) {
    for (turn, place) in turns {
        let mut value = *turn;
        for sum in sums.iter_mut() {
            *sum += value;
            value *= place;
        }
    }
}

/// `Σ v e^{iθ}`, `Σ v X e^{iθ}`, `Σ v Y e^{iθ}` of values at the pixels.
fn products(frame: &Frame, values: &[f64], p: &Vector2<f64>) -> [Complex64; 3] {
    let [cos, sin] = parts(&turns(p.x, &frame.x));
    let [x_cos, x_sin] = [&cos, &sin].map(|turns| {
        let at = turns.iter().zip(&frame.x);
        at.map(|(turn, x)| turn * x).collect::<Vec<f64>>()
    });
    let mut sums = [Complex64::ZERO; 3];
    let lines = values.chunks_exact(frame.image.columns);
    for ((line, up), y) in lines.zip(turns(p.y, &frame.y)).zip(&frame.y) {
        let here = Complex64::new(dot(line, &cos), dot(line, &sin)) * up;
        sums[0] += here;
        sums[1] += Complex64::new(dot(line, &x_cos), dot(line, &x_sin)) * up;
        sums[2] += here * y;
    }
    sums
}

/// Real and imaginary parts.
fn parts(turns: &[Complex64]) -> [Vec<f64>; 2] {
    let (re, im) = turns.iter().map(|turn| (turn.re, turn.im)).unzip();
    [re, im]
}

/// Takes `Re (turned e^{iθ})` off a line.
fn take_off(line: &mut [f64], cos: &[f64], sin: &[f64], turned: Complex64) {
    widest(
        #[inline(always)]
        || {
            for ((value, cos), sin) in line.iter_mut().zip(cos).zip(sin) {
                *value -= turned.re * cos - turned.im * sin;
            }
        },
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::image::Image;

    /// Plane and waves whose numbers are known are found from starts half a cycle away, with pixels missing and lines left out, to the
    /// rounding of the numbers.
    #[test]
    fn waves_that_are_all_there_is_are_found() {
        let size = [61, 48];
        let made = Joint {
            plane: [0.3, -0.8, 0.5],
            ..Joint::of(vec![
                Vector2::new(21.0, 4.0),
                Vector2::new(7.0, -30.0),
                Vector2::new(33.0, 18.0),
            ])
        };
        let amplitudes = vec![[1.0, 0.4], [-0.5, 0.9], [0.0, 0.7]];
        let mut image = Image::new(size[1], size[0], vec![0.0; size[0] * size[1]]);
        let place = |i: usize, axis: usize| {
            let at = [i % size[0], i / size[0]][axis] as f64;
            (2.0 * at + 1.0) / size[axis] as f64 - 1.0
        };
        for (i, value) in image.values.iter_mut().enumerate() {
            let at = Vector2::new(place(i, 0), place(i, 1));
            *value = made.plane[0] + made.plane[1] * at.x + made.plane[2] * at.y;
            for (p, [a, b]) in made.waves.iter().zip(&amplitudes) {
                let (sin, cos) = p.dot(&at).sin_cos();
                *value += a * cos + b * sin;
            }
            if i % 17 == 3 || i / size[0] == 20 {
                *value = f64::NAN;
            }
        }
        let frame = Frame::new(&image);
        let starts = made.waves.iter().map(|p| p + Vector2::new(0.9, -1.1));
        let mut found = Joint::of(starts.collect());
        found.converge(&frame, 40).unwrap();
        let same = |found: &[f64], made: &[f64]| {
            let both = found.iter().zip(made);
            both.for_each(|(found, made)| assert!((found - made).abs() < 1e-9, "{found} {made}"));
        };
        same(&found.plane, &made.plane);
        same(found.amplitudes.as_flattened(), amplitudes.as_flattened());
        for (found, made) in found.waves.iter().zip(&made.waves) {
            same(found.as_slice(), made.as_slice());
        }
        let left = found.left(&frame);
        assert!(left.iter().all(|left| left.abs() < 1e-9));
    }
}
