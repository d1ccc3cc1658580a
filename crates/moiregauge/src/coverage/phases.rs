//! Smooth functions fitted to the phases of three waves: powers of the place, or splines.
//!
//! Differences of phases over a window come first, which need no unwrapping, then the phases themselves.

use std::collections::HashMap;

use nalgebra::{DMatrix, DVector, Vector2};
use rayon::prelude::*;
use rustfft::num_complex::Complex64;

use crate::coverage::basis::Basis;
use crate::coverage::equations::{Functions, Sums};
use crate::coverage::nodes::{Node, information, neighbours};
use crate::coverage::patch::LatticeRegion;
use crate::numbers::normal_equations::NormalEquations;

/// Independent phases in a node of one window: nodes closer than a window are correlated.
pub(crate) const INDEPENDENT: f64 = 2.5;

/// The least degrees of freedom, as a share of the information. Chosen by eye.
pub(crate) const LEAST_FREEDOM: f64 = 0.25;

/// The least degrees of freedom by which an error is enlarged: fewer say nothing of the noise.
pub(crate) const FREEDOM: f64 = 4.0;

/// Rounds of differences and of phases. On the scenes of docs/constants.md half and double change results by at most 0.38 σ.
pub(crate) const ROUNDS: [usize; 2] = [2, 3];

/// Phases that are off by more than this are not followed: a dislocation, or nothing, rad.
pub(crate) const LOST: f64 = 2.0;

/// Nodes whose errors are correlated by less than this are independent.
pub(crate) const UNCORRELATED: f64 = 1e-3;

/// A fitted description: coefficients of ψ₁, of ψ₂, and what φ₃ has beside ψ₂ − ψ₁.
pub(crate) struct Fit {
    pub(crate) basis: Basis,
    pub(crate) coefficients: DVector<f64>,
    /// The normal equations of the last round.
    equations: NormalEquations,
    /// BIC.
    pub(crate) price: f64,
    /// χ².
    pub(crate) chi2: f64,
    /// Independent phases.
    pub(crate) independent: f64,
    /// By how much variances are enlarged, since χ² is larger than its degrees of freedom.
    pub(crate) enlarged: f64,
    /// What is left of the phases, rad, root mean square.
    pub(crate) left: f64,
}

impl Fit {
    /// Covariance of sums over the coefficients (a row each): what the errors of all nodes, correlated as they are under the
    /// window, do to them.
    pub(crate) fn covariance(
        &self,
        sums: &DMatrix<f64>,
        nodes: &[Node],
        reach: Vector2<f64>,
    ) -> DMatrix<f64> {
        let mut gains = DMatrix::zeros(sums.nrows(), sums.ncols());
        for (mut gain, sum) in gains.row_iter_mut().zip(sums.row_iter()) {
            gain.tr_copy_from(&self.equations.solve(&sum.transpose()));
        }
        let count = sums.nrows();
        let all = self.of_phases(&gains, nodes);
        let of = |node: usize, wave: usize| &all[(3 * node + wave) * count..][..count];
        let near = Near::new(nodes, reach);
        let near: Vec<Vec<(usize, f64)>> = (0..nodes.len())
            .into_par_iter()
            .map(|i| near.correlated(i, nodes, reach))
            .collect();
        let mut covariance = DMatrix::zeros(count, count);
        for (i, near) in near.iter().enumerate() {
            for &(j, correlation) in near {
                for wave in 0..3 {
                    let (first, second) = (of(i, wave), of(j, wave));
                    add_outer(&mut covariance, |a, b| correlation * first[a] * second[b]);
                    if i != j {
                        add_outer(&mut covariance, |a, b| correlation * first[b] * second[a]);
                    }
                }
            }
        }
        covariance * self.enlarged
    }

    /// What each phase of each node does to some sums, times its error: the sums of each phase side by side.
    fn of_phases(&self, gains: &DMatrix<f64>, nodes: &[Node]) -> Vec<f64> {
        let count = gains.nrows();
        let mut all = vec![0.0; 3 * nodes.len() * count];
        let of_nodes = all.par_chunks_exact_mut(3 * count).zip(nodes);
        of_nodes.with_min_len(AT_ONCE).for_each(|(all, node)| {
            let rows = rows(&self.basis, node.at);
            for (wave, (all, row)) in all.chunks_exact_mut(count).zip(rows).enumerate() {
                for (i, x) in row {
                    for (sum, gain) in all.iter_mut().zip(&gains.column(i)) {
                        *sum += gain * x;
                    }
                }
                let error = node.weights[wave] * node.errors[wave];
                for sum in all {
                    *sum *= error;
                }
            }
        });
        all
    }
}

/// Nodes that a thread takes at once, at least.
const AT_ONCE: usize = 64;

/// Adds a value for each row and column.
fn add_outer(sum: &mut DMatrix<f64>, value: impl Fn(usize, usize) -> f64) {
    for column in 0..sum.ncols() {
        for row in 0..sum.nrows() {
            sum[(row, column)] += value(row, column);
        }
    }
}

/// Which nodes are so near each other that their errors may be correlated.
struct Near {
    /// The square of each node, a reach beyond which nothing is correlated wide.
    squares: Vec<[i64; 2]>,
    /// The nodes in each square, in order.
    members: HashMap<[i64; 2], Vec<usize>>,
}

impl Near {
    fn new(nodes: &[Node], reach: Vector2<f64>) -> Self {
        let side = reach * (-4.0 * UNCORRELATED.ln()).sqrt();
        let square = |node: &Node| {
            let at = node.at.component_div(&side);
            [at.x.floor() as i64, at.y.floor() as i64]
        };
        let squares: Vec<[i64; 2]> = nodes.iter().map(square).collect();
        let mut members: HashMap<[i64; 2], Vec<usize>> = HashMap::new();
        for (i, square) in squares.iter().enumerate() {
            members.entry(*square).or_default().push(i);
        }
        Self { squares, members }
    }

    /// A node and those after it whose errors are correlated with its own, in order, and how much.
    fn correlated(&self, i: usize, nodes: &[Node], reach: Vector2<f64>) -> Vec<(usize, f64)> {
        let [x, y] = self.squares[i];
        let around = (y - 1..=y + 1).flat_map(|y| (x - 1..=x + 1).map(move |x| [x, y]));
        let members = around.filter_map(|square| self.members.get(&square));
        let near = members.flatten().copied().filter(|&j| j >= i);
        let near = near.map(|j| {
            let d = (nodes[j].at - nodes[i].at).component_div(&reach);
            (j, (-0.25 * d.norm_squared()).exp())
        });
        // Not the same as what is at least that where a correlation is not a number.
        let mut near: Vec<_> = near.filter(|(_, c)| !(*c < UNCORRELATED)).collect();
        near.sort_unstable_by_key(|(j, _)| *j);
        near
    }
}

/// Powers of x and y up to a degree, on the extent of a patch.
pub(crate) fn powers(patch: &LatticeRegion, degree: usize) -> Basis {
    let [low, high] = patch.corners();
    Basis::Powers {
        degree,
        middle: (low + high) / 2.0,
        half: (high - low) / 2.0,
    }
}

/// ψ of the three waves as sums over the coefficients: those of ψ₁, of ψ₂ and the last.
pub(crate) fn rows(basis: &Basis, at: Vector2<f64>) -> [Vec<(usize, f64)>; 3] {
    let n = basis.len();
    let functions = basis.at(at);
    let of = |first: usize, sign: f64| functions.iter().map(move |(i, f)| (first + i, sign * f[0]));
    [
        of(0, 1.0).collect(),
        of(n, 1.0).collect(),
        of(0, -1.0)
            .chain(of(n, 1.0))
            .chain([(2 * n, 1.0)])
            .collect(),
    ]
}

pub(crate) fn value(row: &[(usize, f64)], coefficients: &DVector<f64>) -> f64 {
    row.iter().map(|(i, x)| coefficients[*i] * x).sum()
}

/// The coefficients by what changes from node to node, which needs no unwrapping.
fn by_differences(basis: &Basis, nodes: &[Node], functions: &[Functions]) -> Option<DVector<f64>> {
    let mut sums = Sums::new(basis.len());
    let mut coefficients = DVector::zeros(sums.right.len());
    let neighbours = neighbours(nodes);
    let weights = |a: usize, b: usize| {
        [0, 1, 2].map(|wave| f64::min(nodes[a].weights[wave], nodes[b].weights[wave]))
    };
    let mut differences = Vec::with_capacity(neighbours.len());
    for &(a, b) in &neighbours {
        let difference = functions[b].less(&functions[a]);
        sums.add(&difference, weights(a, b), 0.0);
        differences.push(difference);
    }
    let equations = sums.equations(basis)?;
    for _ in 0..ROUNDS[0] {
        sums.right.fill(0.0);
        for (&(a, b), difference) in neighbours.iter().zip(&differences) {
            let phases = difference.phases(&coefficients, basis.len());
            let left = [0, 1, 2].map(|wave| {
                let turn = nodes[a].envelopes[wave].conj() * nodes[b].envelopes[wave];
                (turn * Complex64::cis(-phases[wave])).arg()
            });
            sums.add_right(difference, left, weights(a, b), 0.0);
        }
        coefficients += equations.solve(&sums.right);
    }
    Some(coefficients)
}

/// The phases of the three waves at a place.
fn phases(functions: &Functions, coefficients: &DVector<f64>) -> [f64; 3] {
    let last = coefficients.len() - 1;
    let [first, second, third] = functions.phases(coefficients, last / 2);
    [first, second, third + coefficients[last]]
}

/// Improves the coefficients by the phases themselves; the equations and χ² of the last round.
fn by_phases(
    basis: &Basis,
    nodes: &[Node],
    functions: &[Functions],
    coefficients: &mut DVector<f64>,
) -> Option<(NormalEquations, f64)> {
    let mut chi2 = 0.0;
    // What is followed, and the equations for that.
    let mut last: Option<(Vec<[bool; 3]>, NormalEquations)> = None;
    for _ in 0..ROUNDS[1] {
        let mut sums = Sums::new(basis.len());
        let mut followed = Vec::with_capacity(nodes.len());
        chi2 = 0.0;
        for (node, functions) in nodes.iter().zip(functions) {
            let phases = phases(functions, coefficients);
            let (mut measured, mut weights) = ([0.0; 3], [0.0; 3]);
            followed.push([0, 1, 2].map(|wave| {
                let left = (node.envelopes[wave] * Complex64::cis(-phases[wave])).arg();
                let weight = node.weights[wave];
                // What is lost counts as if it were at the limit, and moves nothing.
                chi2 += weight * left.clamp(-LOST, LOST).powi(2);
                let follows = left.abs() < LOST;
                if follows {
                    (measured[wave], weights[wave]) = (left, weight);
                }
                follows
            }));
            sums.add_right(functions, measured, weights, 1.0);
        }
        let known = last.take().filter(|(before, _)| *before == followed);
        let (followed, equations) = if let Some(known) = known {
            known
        } else {
            for ((node, functions), follows) in nodes.iter().zip(functions).zip(&followed) {
                let weight = |wave: usize| {
                    if follows[wave] {
                        node.weights[wave]
                    } else {
                        0.0
                    }
                };
                sums.add(functions, [0, 1, 2].map(weight), 1.0);
            }
            let equations = sums.equations(basis)?;
            (followed, equations)
        };
        *coefficients += equations.solve(&sums.right);
        last = Some((followed, equations));
    }
    last.map(|(_, equations)| (equations, chi2))
}

pub(crate) fn fit(basis: Basis, nodes: &[Node]) -> Option<Fit> {
    let size = 2 * basis.len() + 1;
    let functions = nodes.iter().map(|node| Functions::at(&basis, node.at));
    let functions: Vec<Functions> = functions.collect();
    let mut coefficients = by_differences(&basis, nodes, &functions)?;
    align(&basis, nodes, &functions, &mut coefficients);
    let (equations, chi2) = by_phases(&basis, nodes, &functions, &mut coefficients)?;
    let all: f64 = nodes.iter().flat_map(|node| node.weights).sum();
    let count = 3.0 * nodes.len() as f64;
    let share = nodes.first()?.share;
    let independent = count * (INDEPENDENT * share).min(1.0);
    let freedom = freedom(information(nodes), size as f64);
    Some(Fit {
        equations,
        coefficients,
        price: price(chi2, size as f64, independent),
        chi2,
        left: (chi2 / all).sqrt(),
        independent,
        enlarged: if freedom > FREEDOM {
            (chi2 / freedom).max(1.0)
        } else {
            1.0
        },
        basis,
    })
}

/// Degrees of freedom: smooth functions of more numbers than there are windows leave a part all the same.
pub(crate) fn freedom(information: f64, parameters: f64) -> f64 {
    (information - parameters).max(LEAST_FREEDOM * information)
}

/// BIC of χ² (in units that do not matter), parameters and independent data.
pub(crate) fn price(chi2: f64, parameters: f64, independent: f64) -> f64 {
    independent * (chi2 / independent).ln() + parameters * independent.ln()
}

/// Sets the constants to the mean phases.
fn align(basis: &Basis, nodes: &[Node], functions: &[Functions], coefficients: &mut DVector<f64>) {
    let mean = |wave: usize, coefficients: &DVector<f64>| {
        let sum = nodes.iter().zip(functions).map(|(node, functions)| {
            node.envelopes[wave] * Complex64::cis(-phases(functions, coefficients)[wave])
        });
        sum.sum::<Complex64>().arg()
    };
    let n = basis.len();
    for wave in 0..2 {
        let constant = mean(wave, coefficients);
        match basis {
            Basis::Powers { .. } => coefficients[wave * n] += constant,
            // The splines add up to one everywhere.
            Basis::Splines(_) => (0..n).for_each(|i| coefficients[wave * n + i] += constant),
        }
    }
    let third = mean(2, coefficients);
    coefficients[2 * n] += third;
}
