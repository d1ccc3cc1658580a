//! How the noise of neighbouring nodes goes together.
//!
//! Twist and strain are slopes of phases under a Gaussian window of width w. White noise under the window
//! gives phases with the correlation `e^{−d²/4w²}`; for three equal harmonics at 60° their slopes, combined
//! to twist or to a component of strain, have `ρ(d) = (1 − d²/4w²) e^{−d²/4w²}` (minus the Laplacian of it).
//! It integrates to zero: the mean slope over an area is the difference of phases across it.

use nalgebra::Vector2;
use rayon::prelude::*;

use crate::map::nodes::Grid;
use crate::numbers::interrupt;

/// Beyond this many windows nodes count as independent: e⁻¹² is left.
const REACH: f64 = 7.0;

/// Sums over all pairs of nodes of an area, with weights that add up to one: `Σ w_i w_j ρ_ij` is what noise of unit
/// variance leaves in the mean, `Σ w_i w_j ρ²_ij` how much its variance over the area scatters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pairs {
    pub(crate) mean: f64,
    pub(crate) square: f64,
}

/// Correlation of the noise of nodes `d` windows apart, d² given.
pub(crate) fn rho(square: f64) -> f64 {
    (1.0 - square / 4.0) * (-square / 4.0).exp()
}

/// The sums for these nodes of a grid and their weights, under windows of this width (nm).
pub(crate) fn pairs(grid: &Grid, nodes: &[(usize, f64)], window: f64) -> Pairs {
    if !(window > 0.0) {
        let alone = nodes.iter().map(|(_, w)| w * w).sum();
        return Pairs {
            mean: alone,
            square: alone,
        };
    }
    let [columns, rows] = grid.size.map(|n| n as i64);
    let mut weights = vec![0.0; grid.len()];
    for &(node, weight) in nodes {
        weights[node] = weight;
    }
    let offsets = offsets(grid, window);
    let sums: Vec<[f64; 2]> = nodes
        .par_iter()
        .map(|&(node, weight)| {
            interrupt::check();
            let (column, row) = (node as i64 % columns, node as i64 / columns);
            let mut sum = [0.0; 2];
            for &([c, r], rho) in &offsets {
                let (c, r) = (column + c, row + r);
                if (0..columns).contains(&c) && (0..rows).contains(&r) {
                    let both = weight * weights[(r * columns + c) as usize] * rho;
                    sum[0] += both;
                    sum[1] += both * rho;
                }
            }
            sum
        })
        .collect();
    let total = sums
        .iter()
        .fold([0.0; 2], |t, s| [t[0] + s[0], t[1] + s[1]]);
    Pairs {
        // What is cut off beyond the reach may leave a little less than nothing.
        mean: total[0].max(0.0),
        square: total[1],
    }
}

/// Steps on the grid within reach, and the correlation over each.
fn offsets(grid: &Grid, window: f64) -> Vec<([i64; 2], f64)> {
    let Some(inverse) = grid.step.try_inverse() else {
        return vec![([0, 0], 1.0)];
    };
    let most = |axis: usize| (REACH * window * inverse.row(axis).norm()).ceil() as i64;
    let (columns, rows) = (
        most(0).min(grid.size[0] as i64),
        most(1).min(grid.size[1] as i64),
    );
    let mut out = Vec::new();
    for row in -rows..=rows {
        for column in -columns..=columns {
            let away = grid.step * Vector2::new(column as f64, row as f64) / window;
            let square = away.norm_squared();
            if square < REACH * REACH {
                out.push(([column, row], rho(square)));
            }
        }
    }
    out
}
