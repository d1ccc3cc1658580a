//! How much of a spread the window hides.
//!
//! A window of width w leaves of a change with the wave vector k the share `e^{−k²w²/2}`, so that a map varies less than
//! the lattice. How fast it varies tells its curvature: where all changes have one k, `∇²θ = −k²(θ − θ₀)` everywhere, and
//! over an area with the variance v (noise taken off) `κ² = −w²⟨(θ − ⟨θ⟩)∇²θ⟩/v` is k²w², otherwise its mean. Without the
//! window the standard deviation is `√v e^{κ²/2}`, more if there are several k; a trend, which the window leaves as it is,
//! has κ = 0. Of what noise covers no curvature is known; it is taken to have κ = 1, a wavelength of 2π windows. Changes
//! much shorter than that leave nothing in a map, and no number of it can tell them.

use crate::map::quantities::TwistStrainMap;
use crate::region::correlation::rho;
use crate::window::mask::Mask;

/// Distance of the neighbours whose differences give curvatures, windows, or the next node. Chosen by eye.
const OVER: f64 = 0.5;
/// κ² that is believed at most: what a window leaves a twentieth of is measured on noise.
const MOST: f64 = 3.0;

/// How curvature is read off a map.
pub(crate) struct Bends {
    /// Nodes to either side, along columns and rows.
    apart: [usize; 2],
    /// What makes `w²∂²θ` of differences to both sides.
    scale: [f64; 2],
    /// What noise of unit variance adds to `−w² θ ∇²θ`.
    noise: f64,
    /// The longer way to either side, windows.
    reach: f64,
}

/// Sums over an area that tell κ²: of weights, of `w²∇²θ`, of that times θ, and of what noise makes of the latter. Nodes
/// without neighbours are left out.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Bent {
    pub(crate) weight: f64,
    pub(crate) bends: f64,
    pub(crate) products: f64,
    pub(crate) noise: f64,
}

impl Bent {
    /// With one more node: its weight, value and curvature with its noise.
    pub(crate) fn and(self, weight: f64, value: f64, [bend, noise]: [f64; 2]) -> Self {
        Self {
            weight: self.weight + weight,
            bends: self.bends + weight * bend,
            products: self.products + weight * bend * value,
            noise: self.noise + weight * noise,
        }
    }
}

impl Bends {
    pub(crate) fn new(map: &TwistStrainMap) -> Self {
        let lengths = [0, 1].map(|i| map.grid.step.column(i).norm());
        let apart = lengths.map(|l| (OVER * map.window_nm / l).round().max(1.0));
        // In windows.
        let over = [0, 1].map(|i| apart[i] * lengths[i] / map.window_nm);
        let scale = over.map(|d| 1.0 / (d * d));
        let of_noise = |i: usize| scale[i] * 2.0 * (1.0 - rho(over[i] * over[i]));
        Self {
            apart: apart.map(|a| a as usize),
            scale,
            noise: of_noise(0) + of_noise(1),
            reach: 0.5 * over[0].max(over[1]),
        }
    }

    /// `w²∇²θ` at a node and what noise adds to `−w² θ ∇²θ`; `None` beside edges and masked nodes. Values are given
    /// with their errors.
    pub(crate) fn at(
        &self,
        map: &TwistStrainMap,
        node: usize,
        value: &dyn Fn(usize) -> [f64; 2],
    ) -> Option<[f64; 2]> {
        let [columns, rows] = map.grid.size;
        let (place, steps) = ([node % columns, node / columns], [1, columns]);
        let [here, sigma] = value(node);
        let mut sum = 0.0;
        for axis in 0..2 {
            let apart = self.apart[axis];
            if place[axis] < apart || place[axis] + apart >= [columns, rows][axis] {
                return None;
            }
            for beside in [node - apart * steps[axis], node + apart * steps[axis]] {
                if map.mask[beside] != Mask::Good {
                    return None;
                }
                sum += self.scale[axis] * (value(beside)[0] - here);
            }
        }
        let noise = self.noise * sigma * sigma;
        (sum.is_finite() && noise.is_finite()).then_some([sum, noise])
    }

    /// By how much the spread may be larger without the window: the factor `e^{κ²/2}`. Given are the variance without
    /// noise and its standard error, the mean and the sums of the area.
    pub(crate) fn widening(&self, [own, doubt]: [f64; 2], mean: f64, bent: &Bent) -> f64 {
        let moving = if bent.weight > 0.0 {
            let covariance = mean * bent.bends - bent.products;
            ((covariance - bent.noise) / bent.weight).max(0.0)
        } else {
            // No curvature is known.
            own
        };
        let square = (moving + doubt) / (own + doubt);
        if !square.is_finite() {
            return 1.0;
        }
        // Differences over a way 2h make sin(κh)/h of κ.
        let kappa = (self.reach * square.sqrt()).min(1.0).asin() / self.reach;
        (0.5 * (kappa * kappa).min(MOST)).exp()
    }
}
