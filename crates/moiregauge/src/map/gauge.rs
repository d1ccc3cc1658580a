//! What the displacements of a map count from: its mean lattice, and a node of it.
//!
//! The phases of the pattern are `φ(r) = Qᵀ(r − u(r) − r₀) + φ₀` with the mean lattice Q, the displacement u and the place r₀.
//! φ₀ is such that the three first waves meet at r₀: their phases are x, −x and x with `3x = γ`, where γ is what no shift
//! changes (0 for a bright node, π for a dark one). Where waves add up most strongly, bright or dark, is the node.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use heterostrain::lattice::{Nm, Waves};
use nalgebra::{Matrix2, Vector2};

use crate::map::nodes::{Grid, LatticeNode};
use crate::window::mask::Mask;

/// What displacements count from.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Gauge {
    /// The mean lattice of the good nodes: q₁, q₂ as columns, rad/nm.
    pub waves: Matrix2<f64>,
    /// Its moiré vectors L₁, L₂ as columns, named as in the analysis of the image, nm.
    pub vectors: Matrix2<f64>,
    /// Where a node of that lattice is, near the middle of the map, nm.
    pub node: Vector2<f64>,
    /// Whether the nodes are bright: maxima of the three first waves, which are higher than the minima are deep.
    pub bright: bool,
}

impl Gauge {
    /// Of nodes with phases and displacements against the mean lattice `waves`; `None` where there are none.
    pub(crate) fn of(grid: &Grid, waves: Matrix2<f64>, nodes: &[LatticeNode]) -> Option<Self> {
        let mut sums = [Vector2::<f64>::zeros(); 3];
        for (n, node) in nodes.iter().enumerate() {
            let known = node.displacement.iter().all(|u| u.is_finite());
            if node.mask != Mask::Good || !known {
                continue;
            }
            let way = waves.tr_mul(&(grid.place(n) - node.displacement));
            let phases = [node.phases.x - way.x, node.phases.y - way.y, node.phases.z];
            for (sum, phase) in sums.iter_mut().zip(phases) {
                *sum += Vector2::new(phase.cos(), phase.sin());
            }
        }
        if sums
            .iter()
            .any(|s| !s.iter().all(|x| x.is_finite()) || s.norm() == 0.0)
        {
            return None;
        }
        let [first, second, third] = sums.map(|s| s.y.atan2(s.x));
        let bright = third.abs() <= FRAC_PI_2;
        let meet = if bright {
            third / 3.0
        } else {
            PI + wrapped(third - PI) / 3.0
        };
        // Qᵀ r₀ = φ₀ − φ(0).
        let back = waves.transpose().try_inverse()?;
        let node = back * Vector2::new(meet - first, -meet - second);
        let [x, y] = grid.extent();
        let middle = Vector2::new(f64::midpoint(x[0], x[1]), f64::midpoint(y[0], y[1]));
        let vectors = Waves::<Nm>::exact(waves).lattice_named_alike()?.basis;
        let turns = (vectors.try_inverse()? * (middle - node)).map(f64::round);
        Some(Self {
            waves,
            vectors,
            node: node + vectors * turns,
            bright,
        })
    }
}

fn wrapped(angle: f64) -> f64 {
    (angle + PI).rem_euclid(TAU) - PI
}
