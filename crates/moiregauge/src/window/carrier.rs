//! The carrier: a smooth phase field that follows the lattice, so that windows see it nearly straight.
//!
//! `ψ₁(r), ψ₂(r)` are cubic B-splines fitted by least squares to their measured slopes; no phase is ever
//! unwrapped. What the carrier takes off the blocks is added to the wave vectors afterwards, so that it
//! need not be right, only near. Penalised second differences (P-splines) hold it where nothing was
//! measured.
//!
//! # References
//! Eilers and Marx, Statistical Science 11, 89 (1996).

use nalgebra::{DMatrix, DVector, Matrix2, Vector2};
use rayon::prelude::*;
use rustfft::num_complex::Complex32;

use crate::numbers::interrupt;
use crate::numbers::splines::{Sixteen, Splines, cubic};
use crate::window::blocks::Blocks;

/// Weight of the penalty as a share of the mean diagonal element: any small number, which holds what was not measured
/// and bends nothing else.
const STIFFNESS: f64 = 1e-4;
/// Largest number of cells along each axis: the carrier need only be near.
pub(crate) const MOST_CELLS: usize = 16;

/// Two phases as cubic B-splines on a grid of cells.
#[derive(Clone, Debug)]
pub(crate) struct Carrier {
    splines: Splines,
    /// (cells + 3)² coefficients of ψ₁ and ψ₂, row by row.
    coefficients: [Vec<f64>; 2],
}

/// One measured slope.
pub(crate) struct Slope {
    /// Where, pixels.
    pub(crate) at: Vector2<f64>,
    /// ∇ψ₁ and ∇ψ₂ as columns, rad per pixel.
    pub(crate) slopes: Matrix2<f64>,
}

impl Carrier {
    /// Fits slopes measured in a `frame` (its lowest and highest corner, pixels) with a number of cells along each axis.
    pub(crate) fn fit(
        slopes: &[Slope],
        frame: [Vector2<f64>; 2],
        cells: [usize; 2],
    ) -> Option<Self> {
        let mut carrier = Self {
            splines: Splines::new(frame, cells),
            coefficients: [Vec::new(), Vec::new()],
        };
        let [width, height] = carrier.splines.size();
        let size = width * height;
        let mut normal = DMatrix::<f64>::zeros(size, size);
        let mut right = [DVector::<f64>::zeros(size), DVector::<f64>::zeros(size)];
        for slope in slopes {
            let Sixteen {
                places,
                along,
                across,
                ..
            } = carrier.splines.at(slope.at);
            for i in 0..16 {
                for (rhs, measured) in right.iter_mut().zip(slope.slopes.column_iter()) {
                    rhs[places[i]] += along[i] * measured[0] + across[i] * measured[1];
                }
                for j in 0..=i {
                    let product = along[i] * along[j] + across[i] * across[j];
                    normal[(places[i].max(places[j]), places[i].min(places[j]))] += product;
                }
            }
        }
        normal.fill_upper_triangle_with_lower_triangle();
        let stiffness = STIFFNESS * normal.trace() / size as f64;
        carrier.splines.in_lines(|places| {
            for (a, x) in places.iter().zip([1.0, -2.0, 1.0]) {
                for (b, y) in places.iter().zip([1.0, -2.0, 1.0]) {
                    normal[(*a, *b)] += stiffness * x * y;
                }
            }
        });
        // A constant phase is free.
        for i in 0..size {
            normal[(i, i)] += 1e-6 * stiffness.max(f64::MIN_POSITIVE);
        }
        let factor = normal.cholesky()?;
        carrier.coefficients = right.map(|rhs| factor.solve(&rhs).as_slice().to_vec());
        let finite = carrier.coefficients.iter().flatten().all(|c| c.is_finite());
        finite.then_some(carrier)
    }

    /// ψ₁, ψ₂ at a place, and their slopes as columns.
    pub(crate) fn at(&self, at: Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>) {
        let Sixteen {
            places,
            values,
            along,
            across,
        } = self.splines.at(at);
        let mut phases = Vector2::zeros();
        let mut slopes = Matrix2::zeros();
        for (k, coefficients) in self.coefficients.iter().enumerate() {
            for (i, &place) in places.iter().enumerate() {
                phases[k] += coefficients[place] * values[i];
                slopes[(0, k)] += coefficients[place] * along[i];
                slopes[(1, k)] += coefficients[place] * across[i];
            }
        }
        (phases, slopes)
    }

    /// The mean of the slopes under a Gaussian of the given widths, pixels: what the window makes of what
    /// the carrier took off. Gauss–Hermite with three points along each axis, exact for slopes of fifth order.
    pub(crate) fn mean_slopes(&self, at: Vector2<f64>, width: [f64; 2]) -> Matrix2<f64> {
        let points = [
            (-3.0f64.sqrt(), 1.0 / 6.0),
            (0.0, 2.0 / 3.0),
            (3.0f64.sqrt(), 1.0 / 6.0),
        ];
        let mut mean = Matrix2::zeros();
        for (x, u) in points {
            for (y, v) in points {
                let aside = Vector2::new(x * width[0], y * width[1]);
                mean += self.at(at + aside).1 * (u * v);
            }
        }
        mean
    }

    /// Takes these phases off the blocks, whose layers are those of the harmonics `indices`; `before` is what has
    /// been taken off already.
    pub(crate) fn take_off(
        &self,
        before: Option<&Self>,
        indices: &[[i32; 2]],
        blocks: &mut Blocks,
    ) {
        let mut layers = std::mem::take(&mut blocks.layers);
        let (places, columns) = (&*blocks, blocks.size[0]);
        // The same row of all layers together.
        let mut rows: Vec<Vec<(&mut [f32], &mut [f32])>> = Vec::new();
        rows.resize_with(places.size[1], Vec::new);
        for layer in &mut layers {
            let lines = layer.re.chunks_exact_mut(columns);
            let lines = lines.zip(layer.im.chunks_exact_mut(columns));
            rows.iter_mut()
                .zip(lines)
                .for_each(|(r, line)| r.push(line));
        }
        rows.into_par_iter().enumerate().for_each(|(row, layers)| {
            interrupt::check();
            let mut phases = self.line(places, row);
            if let Some(before) = before {
                for (new, old) in phases.iter_mut().zip(before.line(places, row)) {
                    new.iter_mut().zip(old).for_each(|(n, o)| *n -= o);
                }
            }
            let [first, second] = phases.map(|p| p.into_iter().map(|p| cis(-p)).collect());
            for ((re, im), index) in layers.into_iter().zip(indices) {
                turn([&first, &second], *index, re, im);
            }
        });
        blocks.layers = layers;
    }

    /// ψ₁ and ψ₂ of a line of blocks.
    fn line(&self, places: &Blocks, row: usize) -> [Vec<f64>; 2] {
        let (cell, v) = self.splines.cell_of(1, places.middle(0.0, row as f64).y);
        let across = cubic(v)[0];
        let width = self.splines.size()[0];
        // The coefficients of this line.
        let of_line = [0, 1].map(|k| {
            let sum = |i: usize| -> f64 {
                let rows = across.iter().enumerate();
                let terms = rows.map(|(b, y)| y * self.coefficients[k][(cell + b) * width + i]);
                terms.sum()
            };
            (0..width).map(sum).collect::<Vec<f64>>()
        });
        let mut out = [0, 1].map(|_| Vec::with_capacity(places.size[0]));
        for column in 0..places.size[0] {
            let (cell, u) = self.splines.cell_of(0, places.middle(column as f64, 0.0).x);
            let along = cubic(u)[0];
            for (out, of_line) in out.iter_mut().zip(&of_line) {
                let terms = along.iter().zip(&of_line[cell..]);
                out.push(terms.map(|(x, c)| x * c).sum());
            }
        }
        out
    }
}

fn cis(phase: f64) -> Complex32 {
    let (sine, cosine) = phase.sin_cos();
    Complex32::new(cosine as f32, sine as f32)
}

/// Turns a line of blocks of the harmonic (h, k) by `turns` of q₁ and q₂.
fn turn(turns: [&Vec<Complex32>; 2], [h, k]: [i32; 2], re: &mut [f32], im: &mut [f32]) {
    let turns = turns[0].iter().zip(turns[1]);
    for ((re, im), (a, b)) in re.iter_mut().zip(im).zip(turns) {
        let turn = power(*a, h) * power(*b, k);
        (*re, *im) = (*re * turn.re - *im * turn.im, *re * turn.im + *im * turn.re);
    }
}

fn power(turn: Complex32, n: i32) -> Complex32 {
    let base = if n < 0 { turn.conj() } else { turn };
    (0..n.abs()).fold(Complex32::new(1.0, 0.0), |product, _| product * base)
}

/// The pilot's window in periods: a little more than the narrowest.
pub(crate) const PILOT: f64 = 0.65;

#[cfg(test)]
mod tests {
    use super::*;

    /// A cubic is a spline: its slopes give it back, but for a constant and what the penalty bends.
    #[test]
    fn slopes_of_a_cubic_give_it_back() {
        let phase = |p: Vector2<f64>| 1e-5 * p.x * p.x * p.y - 2e-5 * p.y.powi(3) + 0.01 * p.x;
        let slope = |p: Vector2<f64>| {
            Vector2::new(2e-5 * p.x * p.y + 0.01, 1e-5 * p.x * p.x - 6e-5 * p.y * p.y)
        };
        let (low, high) = (Vector2::zeros(), Vector2::new(200.0, 100.0));
        let points = (0..861).map(|i| Vector2::new(f64::from(i % 41), f64::from(i / 41)) * 5.0);
        let slopes: Vec<Slope> = points
            .map(|at| Slope {
                at,
                slopes: Matrix2::from_columns(&[slope(at), -slope(at)]),
            })
            .collect();
        let carrier = Carrier::fit(&slopes, [low, high], [4, 3]).unwrap();
        let middle = Vector2::new(90.0, 55.0);
        for at in [[10.0, 20.0], [140.0, 80.0], [199.0, 99.0]].map(Vector2::from) {
            let found = carrier.at(at).0.x - carrier.at(middle).0.x;
            assert!(
                (found - (phase(at) - phase(middle))).abs() < 0.05,
                "{found}"
            );
            assert!((carrier.at(at).1.column(0) - slope(at)).norm() < 2e-3);
        }
    }
}
