//! Perfect waves and a plane, fitted together to an image (Gauss–Newton).

use std::f64::consts::{FRAC_PI_8, PI};

use nalgebra::{DMatrix, DVector, Vector2};

use crate::lattice::fit::few::SKIRT;
use crate::lattice::fit::frame::{Frame, turns};
use crate::numbers::interrupt;

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
        let (mut normal, mut right) = (DMatrix::zeros(numbers, numbers), DVector::zeros(numbers));
        let mut parts = DVector::zeros(numbers);
        self.each(frame, |[x, y], turns, value, _| {
            parts[0] = 1.0;
            parts[1] = x;
            parts[2] = y;
            for (i, ([cos, sin], [a, b])) in turns.iter().zip(&self.amplitudes).enumerate() {
                parts[3 + 2 * i] = *cos;
                parts[4 + 2 * i] = *sin;
                if free {
                    let slope = b * cos - a * sin;
                    parts[3 + 2 * (count + i)] = slope * x;
                    parts[4 + 2 * (count + i)] = slope * y;
                }
            }
            normal.syger(1.0, &parts, &parts, 1.0);
            right.axpy(value, &parts, 1.0);
        });
        normal.fill_upper_triangle_with_lower_triangle();
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
        let mut left = vec![0.0; frame.image.values.len()];
        self.each(frame, |_, _, value, i| left[i] = value);
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

    /// Calls `f` with place, cosine and sine of each wave, what is left and the index of every pixel that counts.
    fn each(&self, frame: &Frame, mut f: impl FnMut([f64; 2], &[[f64; 2]], f64, usize)) {
        let columns = frame.image.columns;
        let along: Vec<_> = self.waves.iter().map(|p| turns(p.x, &frame.x)).collect();
        let up: Vec<_> = self.waves.iter().map(|p| turns(p.y, &frame.y)).collect();
        let mut here = vec![[0.0; 2]; self.waves.len()];
        for row in (0..frame.image.rows).filter(|row| frame.present[*row] > 0) {
            interrupt::check();
            let y = frame.y[row];
            for (column, pixel) in frame.image.row(row).iter().enumerate() {
                if !pixel.is_finite() {
                    continue;
                }
                let x = frame.x[column];
                let mut value = pixel - self.plane[0] - self.plane[1] * x - self.plane[2] * y;
                for (i, [a, b]) in self.amplitudes.iter().enumerate() {
                    let turn = along[i][column] * up[i][row];
                    here[i] = [turn.re, turn.im];
                    value -= a * turn.re + b * turn.im;
                }
                f([x, y], &here, value, row * columns + column);
            }
        }
    }
}
