//! What the window takes off phases that curve, read off a wider one.
//!
//! Under a window of width w a phase ψ comes out as `ψ + ½ w² ∇²ψ`, under one of √2 w as `ψ + w² ∇²ψ`: their difference is what is to be
//! taken off the first. It is smooth where the lattice changes over many windows, its noise is not, so that it is averaged over
//! nodes with a Gaussian of two windows before.

use std::f64::consts::{PI, TAU};

use crate::window::mask::Mask;
use crate::window::smooth::Smoothed;

/// Width of the Gaussian that averages the difference, in windows.
const AVERAGED: f64 = 2.0;
/// What that does to the variance of white noise in a phase: `∫ k [N − G(N² − N)]² dk / ∫ k N² dk` with `N = e^{−k²w²/2}` and
/// `G = e^{−2k²w²}`.
pub(crate) const VARIANCE: f64 = 1.098;
/// Reach of the Gaussian, widths.
const ENDS: f64 = 3.0;

/// What is to be taken off the phases of the first three harmonics at each node, rad. `steps`: windows from node to node along
/// columns and rows. Only good nodes count, and others get nothing.
pub(crate) fn blurs_of_phases(
    narrow: &Smoothed,
    wide: &Smoothed,
    masks: &[Mask],
    steps: [f64; 2],
) -> Vec<[f64; 3]> {
    let mut found = vec![[0.0; 3]; masks.len()];
    for i in 0..3 {
        let change = |n: usize| {
            let [a, b] = [narrow, wide].map(|s| f64::from(s.envelopes[i].amplitude[n].arg()));
            let change = (b - a + PI).rem_euclid(TAU) - PI;
            let counts = masks[n] == Mask::Good && change.is_finite();
            if counts { [change, 1.0] } else { [0.0; 2] }
        };
        let changes = (0..masks.len()).map(change).collect();
        let averaged = averaged(changes, narrow.nodes.size, steps);
        for (found, [sum, weight]) in found.iter_mut().zip(averaged) {
            if weight > 0.0 {
                found[i] = sum / weight;
            }
        }
    }
    found
}

/// Sums of values and weights under the Gaussian, along rows and then along columns.
fn averaged(values: Vec<[f64; 2]>, size: [usize; 2], steps: [f64; 2]) -> Vec<[f64; 2]> {
    let [columns, rows] = size;
    let along = |values: &[[f64; 2]], axis: usize| {
        let reach = (ENDS * AVERAGED / steps[axis]).ceil() as usize;
        let weight = |d: usize| (-0.5 * (d as f64 * steps[axis] / AVERAGED).powi(2)).exp();
        let weights: Vec<f64> = (0..=reach).map(weight).collect();
        let (count, stride) = [(columns, 1), (rows, columns)][axis];
        let of_node = |n: usize| {
            let own = n / stride % count;
            let nodes = own.saturating_sub(reach)..(own + reach + 1).min(count);
            nodes.fold([0.0; 2], |[sum, total], other| {
                let weight = weights[own.abs_diff(other)];
                let [value, counts] = values[n - own * stride + other * stride];
                [sum + weight * value, total + weight * counts]
            })
        };
        (0..values.len()).map(of_node).collect::<Vec<_>>()
    };
    let rowwise = along(&values, 0);
    drop(values);
    along(&rowwise, 1)
}
