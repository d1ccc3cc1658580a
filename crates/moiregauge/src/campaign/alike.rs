//! Frames up and down of a lattice with few nanometres a cell: which vectors are the same ones?
//!
//! At atomic magnification a drift of 1 nm/min shears and stretches a frame by tens of per cent, one way in a frame
//! upwards and the other way in one downwards. Vectors that are nearest to each other need not be the same then. In:
//! measured lines, the cell that they show. Out: their lattices under names that one constant drift explains, and how
//! well it does: of all names `(I − D u₀ᵀ) L₀ = (I − D u₁ᵀ) L₁` takes those with the least misfit, the least drift, and the
//! least distorted cell.

use heterostrain::ComplexPair;
use heterostrain::lattice::{canonical, renamings};
use nalgebra::{Matrix2, Vector2};

use crate::drift::linear::Observation;
use crate::scan::measured::MeasuredLine;

/// What counts as much as one unit of cost, all four by eye: a misfit of the vectors, ...
const MISFIT: f64 = 0.01;
/// ... a drift over the speed of the slow axis, ...
const DRIFT: f64 = 0.5;
/// ... a distortion of the cell, ...
const DISTORTION: f64 = 0.1;
/// ... a wrong size (logarithm).
const SIZE: f64 = 0.2;
/// Names with a larger misfit are not compared with the cell: thirty units of cost.
const HOPELESS: f64 = 0.3;

/// Lattices under names that one drift explains.
pub(crate) struct Alike {
    /// One for each line.
    pub(crate) observations: Vec<Observation>,
    /// What the drift leaves between a frame up and a frame down, as a share of the vectors.
    pub(crate) misfit: f64,
    /// Drift over the speed of the slow axis; zero where frames of one direction do not tell it.
    pub(crate) drift: f64,
}

/// The lines of a set under one name of the lattice, whose cell is `cell` (nm). `None` of none.
pub(crate) fn alike<'a>(
    lines: impl Iterator<Item = &'a MeasuredLine> + Clone,
    cell: &Matrix2<f64>,
) -> Option<Alike> {
    let first = lines.clone().next()?;
    let reference = canonical(&first.in_sensor_coordinates()).basis;
    let nearest: Vec<Observation> = lines.clone().map(|l| l.observation(&reference)).collect();
    let along = nearest[0].time_gradient;
    let opposed = |o: &Observation| o.time_gradient.dot(&along) < 0.0;
    let pair = nearest.iter().find(|o| opposed(o)).and_then(|other| {
        let found = best_name(&nearest[0], other, cell)?;
        let other = other.lattice.basis * found.name;
        Some((found, other))
    });
    let Some((found, other)) = pair else {
        return Some(Alike {
            observations: nearest,
            misfit: 0.0,
            drift: 0.0,
        });
    };
    let observations = lines
        .zip(&nearest)
        .map(|(line, o)| {
            if opposed(o) {
                line.observation(&other)
            } else {
                *o
            }
        })
        .collect();
    Some(Alike {
        observations,
        misfit: found.misfit,
        drift: found.drift,
    })
}

/// One way of naming the vectors of the second of two lattices.
struct Named {
    name: Matrix2<f64>,
    misfit: f64,
    drift: f64,
    cost: f64,
}

fn best_name(first: &Observation, second: &Observation, cell: &Matrix2<f64>) -> Option<Named> {
    let inverse = cell.try_inverse()?;
    let all: Vec<Matrix2<f64>> = renamings(1).collect();
    let twice = all.iter().flat_map(|a| all.iter().map(move |b| a * b));
    twice
        .filter_map(|name| named(first, second, name, &inverse))
        .min_by(|a, b| a.cost.total_cmp(&b.cost))
}

/// `None` for mirror images and what no drift explains.
fn named(
    first: &Observation,
    second: &Observation,
    name: Matrix2<f64>,
    inverse: &Matrix2<f64>,
) -> Option<Named> {
    let (a, b) = (first.lattice.basis, second.lattice.basis * name);
    if !(a.determinant() * b.determinant() > 0.0) {
        return None;
    }
    // (I − D uₐᵀ) A = (I − D u_bᵀ) B: least squares for D.
    let elapsed: Vector2<f64> =
        a.transpose() * first.time_gradient - b.transpose() * second.time_gradient;
    let velocity = (a - b) * elapsed / elapsed.norm_squared();
    let misfit = (a - b - velocity * elapsed.transpose()).norm() / a.norm();
    if !(misfit < HOPELESS) {
        return None;
    }
    let drift = velocity.norm() * first.time_gradient.norm();
    let free = (Matrix2::identity() - velocity * first.time_gradient.transpose()) * a;
    let (distortion, size) = renamings(1)
        .map(|name| {
            let shape = ComplexPair::from(free * name * inverse);
            (shape.distortion(), shape.p.norm())
        })
        .min_by(|a, b| a.0.total_cmp(&b.0))?;
    let parts = [
        misfit / MISFIT,
        drift / DRIFT,
        distortion / DISTORTION,
        size.ln() / SIZE,
    ];
    Some(Named {
        name,
        misfit,
        drift,
        cost: parts.iter().map(|p| p * p).sum(),
    })
}
