//! Drift that changes within the frames, seen as the difference of upward and downward maps.
//!
//! A drift that changes by A (nm/s²) while a frame is recorded bends the phases along the slow axis: the local
//! wave vectors change by `−u (A·G)(u·r)`, u the time gradient (s/nm). What is the same in maps of upward
//! and downward frames may be strain of the sample (or a change of drift common to both); what differs is drift:
//! the slope of the difference along the slow axis gives `A_up − A_down`.

use heterostrain::Estimate;
use nalgebra::{Matrix2, Vector2};

use crate::map::sample::LatticeMap;
use crate::map::view::View;
use crate::window::mask::Mask;

/// χ² of two numbers that is more than chance: p < 0.01, a convention.
const MORE_THAN_CHANCE: f64 = 9.21;

/// How the change of drift differs between upward and downward frames.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct DriftChange {
    /// `A_up − A_down` along x and y, nm/s².
    pub acceleration: [Estimate; 2],
    /// χ² that it is zero, two degrees of freedom.
    pub chi2: f64,
}

impl DriftChange {
    /// Whether it is more than chance (p < 0.01).
    pub fn is_significant(&self) -> bool {
        self.chi2 > MORE_THAN_CHANCE
    }
}

/// A place that both maps cover.
struct Seen {
    /// Time from upward frames' start, s.
    time: f64,
    /// Difference of both waves along u, rad/nm, and its variance.
    change: [f64; 2],
    variance: [f64; 2],
}

/// Compares the average of upward with that of downward maps. `time_gradient` is that of upward frames, s/nm.
///
/// `None` where they have too few good nodes in common.
pub fn drift_change(
    up: &LatticeMap,
    down: &LatticeMap,
    time_gradient: Vector2<f64>,
) -> Option<DriftChange> {
    let other = View::new(down)?;
    let pair = up.mean()?;
    let norm = time_gradient.norm();
    let seen = seen(up, &other, time_gradient);
    if seen.len() < 10 {
        return None;
    }
    // Nodes under one window share their noise.
    let window = 4.0 * std::f64::consts::PI * up.window_nm.powi(2);
    let shared = (window / up.grid.step.determinant().abs()).max(1.0);
    let slope = |wave: usize| {
        let weight = |s: &Seen| 1.0 / s.variance[wave];
        let total: f64 = seen.iter().map(weight).sum();
        let time = seen.iter().map(|s| weight(s) * s.time).sum::<f64>() / total;
        let change = seen.iter().map(|s| weight(s) * s.change[wave]).sum::<f64>() / total;
        let spread: f64 = seen
            .iter()
            .map(|s| weight(s) * (s.time - time).powi(2))
            .sum();
        let product = |s: &Seen| weight(s) * (s.time - time) * (s.change[wave] - change);
        let slope = seen.iter().map(product).sum::<f64>() / spread;
        // δq·û = −|u| (A·G)(u·r).
        Estimate::new(-slope / norm, (shared / spread).sqrt() / norm)
    };
    let both = [slope(0), slope(1)];
    let to_drift: Matrix2<f64> = pair.transpose().try_inverse()?;
    let projected = Vector2::new(both[0].value, both[1].value);
    let variance = Matrix2::new(both[0].sigma.powi(2), 0.0, 0.0, both[1].sigma.powi(2));
    let found = to_drift * projected;
    let covariance = to_drift * variance * to_drift.transpose();
    let chi2 = (found.transpose() * covariance.try_inverse()? * found)[0];
    Some(DriftChange {
        acceleration: [0, 1].map(|i| Estimate::from_variance(found[i], covariance[(i, i)])),
        chi2,
    })
}

/// The differences at good nodes of both maps.
fn seen(up: &LatticeMap, down: &View, time_gradient: Vector2<f64>) -> Vec<Seen> {
    let along = time_gradient / time_gradient.norm();
    let good = up.nodes.iter().enumerate();
    good.filter(|(_, n)| n.mask == Mask::Good)
        .filter_map(|(node, here)| {
            let place = up.grid.place(node);
            let there = down.at(place).filter(|n| n.mask == Mask::Good)?;
            let change = (here.waves.basis - there.waves.basis).tr_mul(&along);
            let covariance = here.waves.covariance + there.waves.covariance;
            let variance = [0, 1].map(|wave| {
                let block = covariance.fixed_view::<2, 2>(2 * wave, 2 * wave);
                (along.transpose() * block * along)[0]
            });
            Some(Seen {
                time: time_gradient.dot(&place),
                change: change.into(),
                variance,
            })
        })
        .collect()
}
