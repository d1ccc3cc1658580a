//! A map in a few numbers: means, and spreads with the noise taken off.

use crate::map::quantities::{Plane, TwistStrainMap};
use crate::window::mask::Mask;

/// Mean and spread of a quantity over the good nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Mean over the good nodes.
    pub mean: f64,
    /// At most its standard error by the noise: that of independent windows. Slopes of a phase average
    /// better than that.
    pub mean_sigma: f64,
    /// Standard deviation over the nodes.
    pub spread: f64,
    /// The same without what noise adds: `√max(0, s² − ⟨σ²⟩)`.
    pub corrected: f64,
    /// Root mean square of the errors of the nodes.
    pub noise: f64,
}

impl TwistStrainMap {
    /// The area of a node, nm².
    pub fn node_area(&self) -> f64 {
        self.grid.step.determinant().abs()
    }

    /// Number of good nodes.
    pub fn good(&self) -> usize {
        self.count(Mask::Good)
    }

    /// Number of nodes with this mask.
    pub fn count(&self, mask: Mask) -> usize {
        self.mask.iter().filter(|m| **m == mask).count()
    }

    /// Mean and spread of one of the planes of this map; `None` without good nodes.
    ///
    /// Nodes under one window share their noise: a window counts as `4πw²`, but at least one node.
    pub fn spread(&self, plane: &Plane) -> Option<Spread> {
        self.spread_where(plane, |_| true)
    }

    /// The same over the good nodes that pass.
    pub fn spread_where(&self, plane: &Plane, wanted: impl Fn(usize) -> bool) -> Option<Spread> {
        let good: Vec<[f64; 2]> = (0..self.mask.len())
            .filter(|&n| self.mask[n] == Mask::Good && wanted(n))
            .map(|n| [f64::from(plane.value[n]), f64::from(plane.sigma[n])])
            .filter(|v| v.iter().all(|x| x.is_finite()))
            .collect();
        let count = good.len() as f64;
        if good.is_empty() {
            return None;
        }
        let mean = good.iter().map(|v| v[0]).sum::<f64>() / count;
        let variance = good.iter().map(|v| (v[0] - mean).powi(2)).sum::<f64>() / count;
        let noise = good.iter().map(|v| v[1] * v[1]).sum::<f64>() / count;
        let window = 4.0 * std::f64::consts::PI * self.window_nm * self.window_nm;
        let independent = (count * self.node_area() / window).clamp(1.0, count);
        Some(Spread {
            mean,
            mean_sigma: (noise / independent).sqrt(),
            spread: variance.sqrt(),
            corrected: (variance - noise).max(0.0).sqrt(),
            noise: noise.sqrt(),
        })
    }
}
