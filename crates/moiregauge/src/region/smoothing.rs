//! How much of a spread the window hides.
//!
//! A window of width w leaves of a change with the wave vector k the share `e^{−k²w²/2}`, so that a map varies less than
//! the lattice. How fast it varies tell its slopes: over an area with the variance v (noise taken off)
//! `κ² = w²⟨|∇θ|²⟩/v` is the mean of k²w², and without the window the standard deviation is `√v e^{κ²/2}` if all of it
//! has one wavelength, more otherwise. Of what noise covers no slope is known; it is taken to have κ = 1, a wavelength
//! of 2π windows. Changes much shorter than that leave nothing in a map, and no number of it can tell them.

use super::correlation::rho;
use crate::map::{Mask, TwistStrainMap};

/// Slopes are differences over this many windows, or two nodes.
const OVER: f64 = 0.5;
/// κ² that is believed at most: what a window leaves a twentieth of is measured on noise.
const MOST: f64 = 3.0;

/// How slopes are read off a map.
pub(super) struct Slopes {
    /// Nodes to either side, along columns and rows.
    apart: [usize; 2],
    /// What makes `w²(∂θ)²` of squared differences.
    scale: [f64; 2],
    /// What noise of unit variance adds to `w²|∇θ|²`.
    noise: f64,
    /// The longer way to either side, windows.
    reach: f64,
}

impl Slopes {
    pub(super) fn new(map: &TwistStrainMap) -> Self {
        let lengths = [0, 1].map(|i| map.grid.step.column(i).norm());
        let apart = lengths.map(|l| (0.5 * OVER * map.window_nm / l).round().max(1.0));
        // Of the difference, in windows.
        let over = [0, 1].map(|i| 2.0 * apart[i] * lengths[i] / map.window_nm);
        let scale = over.map(|d| 1.0 / (d * d));
        let of_noise = |i: usize| scale[i] * 2.0 * (1.0 - rho(over[i] * over[i]));
        Self {
            apart: apart.map(|a| a as usize),
            scale,
            noise: of_noise(0) + of_noise(1),
            reach: 0.5 * over[0].max(over[1]),
        }
    }

    /// `w²|∇θ|²` at a node and what noise adds to it; `None` beside edges and masked nodes. Values are given with
    /// their errors.
    pub(super) fn at(
        &self,
        map: &TwistStrainMap,
        node: usize,
        value: &dyn Fn(usize) -> [f64; 2],
    ) -> Option<[f64; 2]> {
        let [columns, rows] = map.grid.size;
        let (place, steps) = ([node % columns, node / columns], [1, columns]);
        let mut sum = 0.0;
        for axis in 0..2 {
            let apart = self.apart[axis];
            if place[axis] < apart || place[axis] + apart >= [columns, rows][axis] {
                return None;
            }
            let [before, after] = [node - apart * steps[axis], node + apart * steps[axis]];
            if [before, after].iter().any(|n| map.mask[*n] != Mask::Good) {
                return None;
            }
            sum += self.scale[axis] * (value(after)[0] - value(before)[0]).powi(2);
        }
        let noise = self.noise * value(node)[1].powi(2);
        (sum.is_finite() && noise.is_finite()).then_some([sum, noise])
    }

    /// By how much the spread may be larger without the window: the factor `e^{κ²/2}`. Given are the variance without
    /// noise and its standard error, and sums of weights, of `w²|∇θ|²` and of what noise adds to it.
    pub(super) fn widening(&self, own: f64, doubt: f64, [weight, squares, noise]: [f64; 3]) -> f64 {
        let moving = if weight > 0.0 {
            ((squares - noise) / weight).max(0.0)
        } else {
            // No slope is known.
            own
        };
        let square = (moving + doubt) / (own + doubt);
        if !square.is_finite() {
            return 1.0;
        }
        // Differences over a way h make sin(κh)/h of κ.
        let kappa = (self.reach * square.sqrt()).min(1.0).asin() / self.reach;
        (0.5 * (kappa * kappa).min(MOST)).exp()
    }
}
