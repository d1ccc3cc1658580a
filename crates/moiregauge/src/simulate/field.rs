//! Images of a lattice that is not the same everywhere, whose phases are known at every point.
//!
//! In: mean wave vectors, smooth ripples of their phases, defects. Out: an image in pixels and, at any
//! place, the exact local wave vectors. `I(n) = Σ A_hk cos(h ψ₁(n) + k ψ₂(n)) + noise`, local wave vectors
//! `q_i = ∇ψ_i`; rad, pixels (column, row).

use nalgebra::{Matrix2, Vector2};
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use rustfft::num_complex::Complex64;

use crate::frame::image::Image;
use crate::numbers::interrupt;
use crate::numbers::rng;

/// A lattice whose wave vectors change from place to place.
#[derive(Clone, Debug)]
pub struct FieldScene {
    /// Columns and rows.
    pub size: [usize; 2],
    /// Wave vectors q₁, q₂ without ripples as columns, 60° apart, rad per pixel.
    pub pair: Matrix2<f64>,
    /// Smooth changes of the phases.
    pub ripples: Vec<Ripple>,
    /// What is no smooth change.
    pub features: Vec<Feature>,
    /// Indices (h, k) and amplitudes.
    pub harmonics: Vec<([i32; 2], f64)>,
    /// Standard deviation of white noise.
    pub white: f64,
    /// Standard deviation of an offset per line.
    pub line: f64,
    /// Seed of the noise.
    pub seed: u64,
}

/// `ψ_i += amplitude_i · sin(wave·n + phase)`.
#[derive(Clone, Copy, Debug)]
pub struct Ripple {
    /// Wave vector of the change, rad per pixel.
    pub wave: Vector2<f64>,
    /// Its phase, rad.
    pub phase: f64,
    /// How much ψ₁ and ψ₂ change, rad.
    pub amplitude: [f64; 2],
}

/// What is no smooth change. Directions are angles from x, rad.
#[derive(Clone, Copy, Debug)]
pub enum Feature {
    /// Windings of ψ₁ and ψ₂ around a point.
    Dislocation {
        /// Where, pixels.
        at: Vector2<f64>,
        /// Turns of ψ₁ and ψ₂.
        turns: [i32; 2],
    },
    /// A stripe without signal.
    Wrinkle {
        /// A point of its middle line, pixels.
        at: Vector2<f64>,
        /// Direction across it.
        normal: f64,
        /// Full width, pixels.
        width: f64,
    },
    /// Beyond a line the lattice is turned.
    Boundary {
        /// A point of the line, pixels, where the phases fit.
        at: Vector2<f64>,
        /// Direction across it, towards the turned part.
        normal: f64,
        /// By which angle.
        turn: f64,
    },
    /// Beyond a line the wave vectors are longer along the normal: a step without a jump of phases.
    Step {
        /// A point of the line, pixels.
        at: Vector2<f64>,
        /// Direction across it, towards the changed part.
        normal: f64,
        /// Change of q₁ and q₂ along the normal, rad per pixel.
        change: [f64; 2],
    },
}

fn unit(angle: f64) -> Vector2<f64> {
    Vector2::new(angle.cos(), angle.sin())
}

impl FieldScene {
    /// Three cosines of amplitude 1 with `period` pixels from spot to spot, turned by `angle`.
    pub fn hexagonal(size: [usize; 2], period: f64, angle: f64) -> Self {
        let length = 2.0 * std::f64::consts::TAU / (3.0f64.sqrt() * period);
        let second = angle + std::f64::consts::FRAC_PI_3;
        Self {
            size,
            pair: Matrix2::from_columns(&[unit(angle) * length, unit(second) * length]),
            ripples: Vec::new(),
            features: Vec::new(),
            harmonics: vec![([1, 0], 1.0), ([0, 1], 1.0), ([-1, 1], 1.0)],
            white: 0.0,
            line: 0.0,
            seed: 1,
        }
    }

    /// The same with `periods` periods across a square of `size` pixels, whose wave vectors change smoothly by
    /// ± `share` across the frame.
    pub fn rippled(size: usize, periods: f64, share: f64) -> Self {
        let mut scene = Self::hexagonal([size, size], size as f64 / periods, 0.3);
        let length = scene.pair.column(0).norm();
        let across = std::f64::consts::TAU / size as f64;
        for (direction, phase, factors) in [
            ([0.6, 0.8], 0.3, [0.5, -0.4]),
            ([-0.7, 0.5], 1.9, [0.3, 0.6]),
        ] {
            let wave = Vector2::from(direction) * across;
            scene.ripples.push(Ripple {
                wave,
                phase,
                amplitude: factors.map(|f: f64| f * share * length / wave.norm()),
            });
        }
        scene
    }

    fn centre(&self) -> Vector2<f64> {
        Vector2::new(self.size[0] as f64 - 1.0, self.size[1] as f64 - 1.0) / 2.0
    }

    /// ψ₁ and ψ₂ at a place (column, row).
    pub fn phases(&self, at: Vector2<f64>) -> Vector2<f64> {
        let mut phases = self.pair.tr_mul(&(at - self.centre()));
        for ripple in &self.ripples {
            let sine = (ripple.wave.dot(&at) + ripple.phase).sin();
            phases += Vector2::from(ripple.amplitude) * sine;
        }
        for feature in &self.features {
            match *feature {
                Feature::Dislocation { at: core, turns } => {
                    let d = at - core;
                    let angle = d.y.atan2(d.x);
                    phases += Vector2::from(turns.map(f64::from)) * angle;
                }
                Feature::Boundary {
                    at: on,
                    normal,
                    turn,
                } if (at - on).dot(&unit(normal)) > 0.0 => {
                    phases += self.turned(turn).tr_mul(&(at - on));
                }
                Feature::Step {
                    at: on,
                    normal,
                    change,
                } => {
                    phases += Vector2::from(change) * (at - on).dot(&unit(normal)).max(0.0);
                }
                _ => {}
            }
        }
        phases
    }

    /// How the pair changes when it is turned.
    fn turned(&self, turn: f64) -> Matrix2<f64> {
        let (s, c) = turn.sin_cos();
        Matrix2::new(c - 1.0, -s, s, c - 1.0) * self.pair
    }

    /// The local wave vectors q₁, q₂ (columns) at a place, rad per pixel.
    pub fn waves(&self, at: Vector2<f64>) -> Matrix2<f64> {
        let mut waves = self.pair;
        for ripple in &self.ripples {
            let slope = (ripple.wave.dot(&at) + ripple.phase).cos();
            waves += ripple.wave * Vector2::from(ripple.amplitude).transpose() * slope;
        }
        for feature in &self.features {
            match *feature {
                Feature::Dislocation { at: core, turns } => {
                    let d = at - core;
                    let around = Vector2::new(-d.y, d.x) / d.norm_squared();
                    waves += around * Vector2::from(turns.map(f64::from)).transpose();
                }
                Feature::Boundary {
                    at: on,
                    normal,
                    turn,
                } if (at - on).dot(&unit(normal)) > 0.0 => waves += self.turned(turn),
                Feature::Step {
                    at: on,
                    normal,
                    change,
                } if (at - on).dot(&unit(normal)) > 0.0 => {
                    waves += unit(normal) * Vector2::from(change).transpose();
                }
                _ => {}
            }
        }
        waves
    }

    /// Whether there is a signal at a place.
    pub fn has_signal(&self, at: Vector2<f64>) -> bool {
        !self.features.iter().any(|feature| match *feature {
            Feature::Wrinkle {
                at: on,
                normal,
                width,
            } => (at - on).dot(&unit(normal)).abs() < 0.5 * width,
            _ => false,
        })
    }

    /// Root mean square of the signal of a homogeneous lattice.
    pub fn signal_rms(&self) -> f64 {
        let squares: f64 = self.harmonics.iter().map(|(_, a)| a * a).sum();
        (0.5 * squares).sqrt()
    }

    /// The image.
    pub fn image(&self) -> Image {
        let [columns, rows] = self.size;
        let lines: Vec<Vec<f64>> = (0..rows)
            .into_par_iter()
            .map(|row| {
                interrupt::check();
                self.row(row, columns)
            })
            .collect();
        Image::new(rows, columns, lines.concat())
    }

    /// One line of the image, the same whether or not others are made.
    pub fn row(&self, row: usize, columns: usize) -> Vec<f64> {
        let mut rng = rng::stream(self.seed, "field noise", row as u64);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let offset = self.line * normal();
        (0..columns)
            .map(|column| {
                let at = Vector2::new(column as f64, row as f64);
                let signal = if self.has_signal(at) {
                    self.signal(at)
                } else {
                    0.0
                };
                signal + offset + self.white * normal()
            })
            .collect()
    }

    fn signal(&self, at: Vector2<f64>) -> f64 {
        let phases = self.phases(at);
        let (first, second) = (Complex64::cis(phases.x), Complex64::cis(phases.y));
        let wave = |&([h, k], amplitude): &([i32; 2], f64)| {
            amplitude * (first.powi(h) * second.powi(k)).re
        };
        self.harmonics.iter().map(wave).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The wave vectors are the slopes of the phases, by central differences.
    #[test]
    fn waves_are_slopes_of_phases() {
        let mut scene = FieldScene::hexagonal([100, 80], 12.0, 0.3);
        scene.ripples.push(Ripple {
            wave: Vector2::new(0.03, -0.02),
            phase: 0.4,
            amplitude: [1.5, -0.7],
        });
        let at = Vector2::new(50.0, 40.0);
        scene.features = vec![
            Feature::Dislocation { at, turns: [1, -2] },
            Feature::Boundary {
                at,
                normal: 0.2,
                turn: 0.1,
            },
            Feature::Step {
                at,
                normal: 1.2,
                change: [0.02, -0.01],
            },
        ];
        for place in [[70.0, 55.0], [20.0, 10.0], [30.0, 70.0]].map(Vector2::from) {
            let waves = scene.waves(place);
            for axis in 0..2 {
                let mut step = Vector2::zeros();
                step[axis] = 1e-4;
                let slope = (scene.phases(place + step) - scene.phases(place - step)) / 2e-4;
                assert!((waves.row(axis).transpose() - slope).norm() < 1e-6);
            }
        }
    }
}
