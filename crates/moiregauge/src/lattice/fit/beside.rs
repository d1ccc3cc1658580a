//! Perfect waves beside the lattice: stripes, interference, the waves of a second lattice.
//!
//! In: a finished fit. Out: its image without them. A strong wave Δ cycles of the frame away reaches the harmonics through the ends of the
//! frame (side lobes fall as 1/Δ), moves the fit alike in all frames, and makes the noise that is read around them. One that is the same
//! everywhere is told by four numbers, `a cos θ + b sin θ` with `θ = p·(X, Y)`, found by least squares from the highest bin of the residual
//! (Gauss–Newton), and is gone without a trace. Waves that are not perfect, and those that a changing lattice makes near its harmonics,
//! are left.

use std::f64::consts::{FRAC_PI_8, PI};

use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

use crate::frame::image::Image;
use crate::lattice::fit::frame::{Frame, turns};
use crate::lattice::fit::noise::{ForeignWave, ResidualNoise};

/// Waves that are taken off at most: a strong one and its overtones, or two shells of a lattice.
const MOST: usize = 6;
/// So many times what chance makes a wave is strong enough to matter: weaker ones move the fit by less than its noise.
const STRONG: f64 = 4.0;
/// A wave is perfect if this share of its power or less is left. Chosen by eye.
const LEFT: f64 = 0.02;
/// Nearer to a point of the lattice than this share of its shortest wave it may be made by a change of the lattice.
const NEAR: f64 = 0.25;
/// There it is by itself if the wave opposite to it has less than this share of its power.
const OPPOSITE: f64 = 0.1;
/// Points of the lattice that count, by their order.
const ORDER: f64 = 4.0;
/// A wave has more than so many cycles in the frame: slower ones are background.
pub(super) const SLOWEST: f64 = 2.0;
/// Steps until a wave has to stand still.
const STEPS: usize = 30;

/// Whether a wave is strong enough to matter.
pub(crate) fn is_strong(wave: &ForeignWave) -> bool {
    wave.significance > STRONG * wave.threshold
}

/// The image of a fit without perfect waves that are none of its lattice's; `None` where there is none. `left` is what the fit leaves of the
/// pixels, 0 where they do not count; `strongest` finds the strongest wave of a residual.
pub(crate) fn without_waves(
    frame: &Frame,
    pair: &Matrix2<f64>,
    mut left: Vec<f64>,
    strongest: impl Fn(&ResidualNoise) -> Option<ForeignWave>,
) -> Option<Image> {
    let mut image = frame.image.clone();
    let mut seen = spectrum(frame, &left);
    for taken in 0..=MOST {
        let wave = strongest(&seen).filter(is_strong);
        let cycles = wave.map(|w| w.wave_vector.component_mul(&frame.edge()) / PI);
        let cycles = cycles.filter(|k| taken < MOST && is_by_itself(k, pair, &seen));
        let found = cycles.and_then(|k| Some((k, Wave::fitted(frame, &left, &(k * PI))?)));
        let Some((k, wave)) = found else {
            return (taken > 0).then_some(image);
        };
        wave.take_off(frame, &mut left);
        clear(frame, &mut left);
        let rest = spectrum(frame, &left);
        if rest.power_near(k) > LEFT * seen.power_near(k) {
            return (taken > 0).then_some(image);
        }
        wave.take_off(frame, &mut image.values);
        seen = rest;
    }
    None
}

/// The transform of what is left of the pixels, 0 where they do not count.
pub(super) fn spectrum(frame: &Frame, left: &[f64]) -> ResidualNoise {
    let columns = frame.image.columns;
    let line = |(): &mut (), row: usize, out: &mut [f64]| {
        out.copy_from_slice(&left[row * columns..][..columns]);
    };
    ResidualNoise::new(frame, false, || (), line).0
}

/// Puts 0 where pixels do not count.
pub(super) fn clear(frame: &Frame, values: &mut [f64]) {
    let columns = frame.image.columns;
    let lines = values.chunks_exact_mut(columns).zip(&frame.present);
    for (line, _) in lines.filter(|(_, present)| **present == 0) {
        line.fill(0.0);
    }
    for &[row, column] in &frame.missing {
        values[row * columns + column] = 0.0;
    }
}

/// Whether a wave (cycles per frame) is none that a change of the lattice of `pair` (phase at the edges) makes: such waves are near a point of
/// the lattice, and have another one opposite to it.
fn is_by_itself(k: &Vector2<f64>, pair: &Matrix2<f64>, seen: &ResidualNoise) -> bool {
    let cycles = pair / PI;
    let third = cycles.column(1) - cycles.column(0);
    let shortest = cycles
        .column(0)
        .norm()
        .min(cycles.column(1).norm())
        .min(third.norm());
    let Some(inverse) = cycles.try_inverse() else {
        return false;
    };
    let index = (inverse * k).map(|i| i.round().clamp(-ORDER, ORDER));
    let point = cycles * index;
    let is_near = (k - point).norm() < NEAR * shortest;
    let opposite = || seen.power_near(point * 2.0 - k) / seen.power_near(*k);
    k.norm() > SLOWEST && !(is_near && opposite() > OPPOSITE)
}

/// `a cos θ + b sin θ`, θ = p·(X, Y).
struct Wave {
    p: Vector2<f64>,
    amplitudes: [f64; 2],
}

impl Wave {
    /// That of the least squares near `p` (phase at the edges); `None` where it runs away by more than a cycle of the frame.
    fn fitted(frame: &Frame, left: &[f64], p: &Vector2<f64>) -> Option<Self> {
        let mut wave = Self {
            p: *p,
            amplitudes: [0.0; 2],
        };
        for step in 0..STEPS {
            let (normal, right) = wave.equations(frame, left);
            // Without an amplitude there is no slope.
            let change = if step == 0 {
                let two = normal.fixed_view::<2, 2>(0, 0).try_inverse()?;
                let two = two * right.fixed_rows::<2>(0);
                SVector::<f64, 4>::new(two.x, two.y, 0.0, 0.0)
            } else {
                normal.cholesky()?.solve(&right)
            };
            // Never by more than a quarter of the radius of convergence at once.
            let turn = change.fixed_rows::<2>(2).amax();
            let change = change * (FRAC_PI_8 / turn).min(1.0);
            wave.amplitudes[0] += change[0];
            wave.amplitudes[1] += change[1];
            wave.p += Vector2::new(change[2], change[3]);
            if (wave.p - p).amax() > PI {
                return None;
            }
            if step > 0 && turn < 1e-9 {
                return Some(wave);
            }
        }
        None
    }

    /// Normal equations of a, b and p for what is left of the pixels.
    fn equations(&self, frame: &Frame, left: &[f64]) -> (SMatrix<f64, 4, 4>, SVector<f64, 4>) {
        let [a, b] = self.amplitudes;
        let (mut normal, mut right) = (SMatrix::zeros(), SVector::zeros());
        self.each(frame, left, |[x, y], cos, sin, value| {
            let slope = b * cos - a * sin;
            let parts = SVector::<f64, 4>::new(cos, sin, slope * x, slope * y);
            normal += parts * parts.transpose();
            right += parts * (*value - a * cos - b * sin);
        });
        (normal, right)
    }

    fn take_off(&self, frame: &Frame, values: &mut [f64]) {
        let [a, b] = self.amplitudes;
        let columns = frame.image.columns;
        let along = turns(self.p.x, &frame.x);
        let up = turns(self.p.y, &frame.y);
        for (line, up) in values.chunks_exact_mut(columns).zip(&up) {
            for (value, along) in line.iter_mut().zip(&along) {
                let turn = along * up;
                *value -= a * turn.re + b * turn.im;
            }
        }
    }

    /// Calls `f` with place, cosine, sine and value of every pixel that counts.
    fn each(&self, frame: &Frame, left: &[f64], mut f: impl FnMut([f64; 2], f64, f64, &f64)) {
        let columns = frame.image.columns;
        let along = turns(self.p.x, &frame.x);
        let up = turns(self.p.y, &frame.y);
        for (row, line) in left.chunks_exact(columns).enumerate() {
            if frame.present[row] == 0 {
                continue;
            }
            let pixels = frame.image.row(row);
            for (column, (value, pixel)) in line.iter().zip(pixels).enumerate() {
                if pixel.is_finite() {
                    let turn = along[column] * up[row];
                    f([frame.x[column], frame.y[row]], turn.re, turn.im, value);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wave between the bins is found to rounding from the next bin, with pixels missing, and nothing is left of it.
    #[test]
    fn a_perfect_wave_leaves_nothing() {
        let (columns, rows) = (96, 80);
        let mut image = Image {
            columns,
            rows,
            values: vec![0.0; columns * rows],
        };
        let wave = Wave {
            p: Vector2::new(7.43 * PI, -11.62 * PI),
            amplitudes: [0.8, -0.3],
        };
        {
            let empty = image.clone();
            wave.take_off(&Frame::new(&empty), &mut image.values);
        }
        for value in image.values.iter_mut().skip(17).step_by(91) {
            *value = f64::NAN;
        }
        let frame = Frame::new(&image);
        let mut left: Vec<f64> = image.values.clone();
        clear(&frame, &mut left);
        let start = Vector2::new(7.0 * PI, -12.0 * PI);
        let found = Wave::fitted(&frame, &left, &start).unwrap();
        assert!((found.p - wave.p).norm() < 1e-9, "{}", found.p);
        assert!((found.amplitudes[0] + 0.8).abs() < 1e-9);
        assert!((found.amplitudes[1] - 0.3).abs() < 1e-9);
        found.take_off(&frame, &mut left);
        clear(&frame, &mut left);
        assert!(left.iter().all(|value| value.abs() < 1e-8));
    }

    /// Slow waves are ground; near a point of the lattice one by itself is a wave, two that face each other are a lattice that changes.
    #[test]
    fn changes_of_the_lattice_are_left() {
        let pair = Matrix2::new(20.0, 10.0, 0.0, 17.0) * PI;
        let by_itself = |waves: &[[f64; 2]]| {
            let mut image = Image {
                columns: 128,
                rows: 128,
                values: vec![0.0; 128 * 128],
            };
            let empty = image.clone();
            let frame = Frame::new(&empty);
            for [x, y] in waves {
                let wave = Wave {
                    p: Vector2::new(*x, *y) * PI,
                    amplitudes: [1.0, 0.5],
                };
                wave.take_off(&frame, &mut image.values);
            }
            let line =
                |(): &mut (), row: usize, out: &mut [f64]| out.copy_from_slice(image.row(row));
            let seen = ResidualNoise::new(&frame, false, || (), line).0;
            is_by_itself(&Vector2::from(waves[0]), &pair, &seen)
        };
        assert!(by_itself(&[[10.0, 5.5]]));
        assert!(by_itself(&[[20.0, 4.0]]));
        assert!(!by_itself(&[[20.0, 4.0], [20.0, -4.0]]));
        assert!(!by_itself(&[[3.0, 2.0]]));
    }
}
