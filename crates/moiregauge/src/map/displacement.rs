//! Where the pattern stands against a perfect lattice: phases followed from node to node.
//!
//! Only for showing: nothing is measured from unwrapped phases. From good node to good neighbour the change
//! of each phase is known from the wave vectors to well within π, strongest signal first. A displacement u
//! of the pattern changes the phase of harmonic G by −G·u.

use std::collections::BinaryHeap;

use nalgebra::{Matrix2, Vector2};

use crate::window::mask::Mask;
use crate::window::types::WaveMap;

/// (h, k) of the three phases.
const FIRST: [[f64; 2]; 3] = [[1.0, 0.0], [0.0, 1.0], [-1.0, 1.0]];

/// ψ₁ and ψ₂ of every node against the mean lattice of the good ones, rad, and the covariance of a node's.
/// `None` where the phase could not be followed: beyond masks, and in parts that they cut off.
pub(crate) fn phases(map: &WaveMap) -> Vec<Option<(Vector2<f64>, Matrix2<f64>)>> {
    let nothing = || vec![None; map.nodes.len()];
    let Some(mean) = mean(map) else {
        return nothing();
    };
    let unwrapped = unwrap(map, &mean);
    let found: Vec<usize> = (0..unwrapped.len())
        .filter(|&n| unwrapped[n].is_some())
        .collect();
    let sum = found
        .iter()
        .filter_map(|&n| unwrapped[n])
        .fold([0.0; 3], |mut sum, phases| {
            sum.iter_mut().zip(phases).for_each(|(s, p)| *s += p);
            sum
        });
    let offset = sum.map(|s| s / found.len().max(1) as f64);
    let node = |n: usize| {
        let phases = unwrapped[n]?;
        let [a, b, c] = [0, 1, 2].map(|i| phases[i] - offset[i]);
        // Least squares of (ψ₁, ψ₂, ψ₂ − ψ₁).
        let [u, v, w] = map.nodes[n].phase_weights;
        let covariance = Matrix2::new(u + w, -w, -w, v + w).try_inverse()?;
        let both = covariance * Vector2::new(u * a - w * c, v * b + w * c);
        Some((both, covariance))
    };
    (0..map.nodes.len()).map(node).collect()
}

fn mean(map: &WaveMap) -> Option<Matrix2<f64>> {
    let good = map.nodes.iter().filter(|n| n.mask == Mask::Good);
    let (sum, count) = good.fold((Matrix2::zeros(), 0.0), |(s, n), node| {
        (s + node.pair, n + 1.0)
    });
    (count > 0.0).then(|| sum / count)
}

/// A step to a neighbour, by the strength of the weaker one of the two.
struct Step {
    strength: f64,
    from: usize,
    to: usize,
}

impl PartialEq for Step {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Step {}

impl PartialOrd for Step {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Step {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        let by_strength = self.strength.total_cmp(&other.strength);
        by_strength.then_with(|| (other.to, other.from).cmp(&(self.to, self.from)))
    }
}

/// The phases against the mean lattice, followed through the largest connected part of the good nodes.
fn unwrap(map: &WaveMap, mean: &Matrix2<f64>) -> Vec<Option<[f64; 3]>> {
    let mut all: Vec<Option<[f64; 3]>> = vec![None; map.nodes.len()];
    let mut largest = Vec::new();
    for seed in 0..map.nodes.len() {
        if all[seed].is_none() && map.nodes[seed].mask == Mask::Good {
            let part = follow(map, mean, seed, &mut all);
            if part.len() > largest.len() {
                largest = part;
            }
        }
    }
    let mut kept = vec![None; all.len()];
    for node in largest {
        kept[node] = all[node];
    }
    kept
}

/// Follows the phases from `seed` as far as good nodes reach; returns the nodes.
fn follow(
    map: &WaveMap,
    mean: &Matrix2<f64>,
    seed: usize,
    all: &mut [Option<[f64; 3]>],
) -> Vec<usize> {
    let [columns, rows] = map.size;
    let place = |n: usize| {
        let (column, row) = ((n % columns) as f64, (n / columns) as f64);
        Vector2::new(column * map.step[0], row * map.step[1])
    };
    // Against the mean lattice instead of the reference; still modulo 2π.
    let wrapped = |n: usize, i: usize| {
        let change = (mean - map.reference.pair) * Vector2::from(FIRST[i]);
        map.nodes[n].phases[i] - change.dot(&place(n))
    };
    let neighbours = |n: usize| {
        let (column, row) = (n % columns, n / columns);
        [
            (column > 0).then(|| n - 1),
            (column + 1 < columns).then_some(n + 1),
            (row > 0).then(|| n - columns),
            (row + 1 < rows).then_some(n + columns),
        ]
    };
    let mut part = Vec::new();
    let mut queue = BinaryHeap::from([Step {
        strength: f64::INFINITY,
        from: seed,
        to: seed,
    }]);
    while let Some(Step { from, to, .. }) = queue.pop() {
        if all[to].is_some() {
            continue;
        }
        let before = all[from];
        let way = place(to) - place(from);
        let waves = 0.5 * (map.nodes[from].pair + map.nodes[to].pair) - mean;
        all[to] = Some([0, 1, 2].map(|i| {
            let found = wrapped(to, i);
            let Some(before) = before else { return found };
            let expected = before[i] + (waves * Vector2::from(FIRST[i])).dot(&way);
            let turns = ((expected - found) / std::f64::consts::TAU).round();
            found + turns * std::f64::consts::TAU
        }));
        part.push(to);
        for next in neighbours(to).into_iter().flatten() {
            if map.nodes[next].mask == Mask::Good && all[next].is_none() {
                let [a, b] = [to, next].map(|n| map.nodes[n].signal_to_noise);
                queue.push(Step {
                    strength: a.min(b),
                    from: to,
                    to: next,
                });
            }
        }
    }
    part
}
