//! Several lattices side by side: grains.
//!
//! Where two grains meet, the slopes of the phases take two values and hardly any between them. The nodes of a patch are split in two by
//! their slopes, and both parts are described by themselves. Two lattices it is if no smooth change of one describes the phases,
//! and if the data pay for two (BIC) against the best of these.

use nalgebra::Vector4;
use rustfft::num_complex::Complex64;

use crate::coverage::bend::{described, described_as_straight};
use crate::coverage::cells::Cells;
use crate::coverage::nodes::{Node, View, information, neighbours, nodes};
use crate::coverage::patch::Patch;
use crate::coverage::phases::{Fit, fit, powers, price, rows, value};
use crate::numbers::median::median;

/// Rounds of means and nearest means. Chosen by eye.
const ROUNDS: usize = 20;
/// A part with fewer nodes than this is a defect and no grain.
const FEWEST_NODES: usize = 6;
/// By how much the evidence (BIC) of two lattices has to be better than that of one that changes: chance does that once in e¹⁰.
const BETTER: f64 = 20.0;

/// A smooth change describes phases whose χ² is below this share of their information: those of waves of twist and strain
/// were below 0.9 of it, those of two grains above 2.
const MISFIT: f64 = 1.5;

/// Rounds of fits to both grains and of nodes given to the nearer one. Chosen by eye.
const REFINED: usize = 4;

/// Phases that are off by more than this from both lattices (rad, root mean square of three) are of neither: by chance those of
/// three waves that have nothing to do with a lattice are nearer once in ten.
const NEITHER: f64 = 0.8;

/// The patches of two grains, the larger first; `None` where one lattice describes all of the patch as well.
pub(crate) fn split(view: &View, patch: &Patch) -> Option<[Patch; 2]> {
    let all = nodes(view, patch);
    if all.len() < 2 * FEWEST_NODES {
        return None;
    }
    let mut owner: Vec<Option<usize>> = halves(&all)?
        .into_iter()
        .map(|second| Some(usize::from(second)))
        .collect();
    for _ in 0..REFINED {
        let parts = [0, 1].map(|which| part(&all, &owner, Some(which)));
        if parts.iter().any(|p| p.len() < FEWEST_NODES) {
            return None;
        }
        let fits = parts.map(|part| fit(powers(patch, 1), &part));
        let [Some(a), Some(b)] = fits else {
            return None;
        };
        owner = all.iter().map(|node| nearer(node, [&a, &b])).collect();
    }
    let parts = [0, 1].map(|which| part(&all, &owner, Some(which)));
    if parts.iter().any(|p| p.len() < FEWEST_NODES) {
        return None;
    }
    let one = described(view, patch, &part(&all, &owner, None))?;
    if one[0] < MISFIT * information(&all) {
        return None;
    }
    let [a, b] = [0, 1].map(|i| described_as_straight(patch, &parts[i]));
    let (a, b) = (a?, b?);
    // Where the boundary runs costs about as many numbers as it is nodes long.
    let boundary = one[2].sqrt() * one[2].ln() / 2.0;
    let two = price(a[0] + b[0], a[1] + b[1], a[2] + b[2]) + boundary;
    if price(one[0], one[1], one[2]) - two < BETTER {
        return None;
    }
    let mut patches = [0, 1].map(|which| grain(view.cells, patch, &all, &owner, which));
    if patches[1].unit_cells > patches[0].unit_cells {
        patches.swap(0, 1);
    }
    Some(patches)
}

/// The nodes of one grain, or of both, but for those beside a node of another or of none: their windows see both.
fn part(all: &[Node], owner: &[Option<usize>], which: Option<usize>) -> Vec<Node> {
    let mut apart = vec![true; all.len()];
    for (a, b) in neighbours(all) {
        if owner[a] != owner[b] {
            apart[a] = false;
            apart[b] = false;
        }
    }
    let wanted = |i: &usize| {
        apart[*i] && owner[*i].is_some_and(|own| which.is_none_or(|which| which == own))
    };
    let chosen = (0..all.len()).filter(wanted);
    chosen.map(|i| all[i].clone()).collect()
}

/// To which of two lattices the phases at a node belong; `None` where they are neither's.
fn nearer(node: &Node, fits: [&Fit; 2]) -> Option<usize> {
    let misses = fits.map(|fit| {
        let rows = rows(&fit.basis, node.at).into_iter().enumerate();
        let squares = rows.map(|(wave, row)| {
            let turn = Complex64::cis(-value(&row, &fit.coefficients));
            (node.envelopes[wave] * turn).arg().powi(2)
        });
        (squares.sum::<f64>() / 3.0).sqrt()
    });
    let which = usize::from(misses[1] < misses[0]);
    (misses[which] < NEITHER).then_some(which)
}

/// Which nodes belong to the second of two lattices, by their slopes.
fn halves(nodes: &[Node]) -> Option<Vec<bool>> {
    let slopes = filtered(nodes, &slopes(nodes));
    let known: Vec<&Vector4<f64>> = slopes.iter().flatten().collect();
    let mean = known.iter().copied().sum::<Vector4<f64>>() / known.len() as f64;
    // Starts at the ends of the direction in which they differ most.
    let spread: nalgebra::Matrix4<f64> = known
        .iter()
        .map(|s| (*s - mean) * (*s - mean).transpose())
        .sum();
    let eigen = spread.symmetric_eigen();
    let along = eigen
        .eigenvectors
        .column(eigen.eigenvalues.imax())
        .into_owned();
    let deviation = (eigen.eigenvalues.max() / known.len() as f64).sqrt();
    let mut means = [mean - along * deviation, mean + along * deviation];
    let nearer = |s: &Vector4<f64>, means: &[Vector4<f64>; 2]| {
        (s - means[1]).norm_squared() < (s - means[0]).norm_squared()
    };
    for _ in 0..ROUNDS {
        let mut sums = [Vector4::zeros(); 2];
        let mut counts = [0.0; 2];
        for s in &known {
            let i = usize::from(nearer(s, &means));
            sums[i] += **s;
            counts[i] += 1.0;
        }
        if counts.contains(&0.0) {
            return None;
        }
        means = [sums[0] / counts[0], sums[1] / counts[1]];
    }
    let raw: Vec<bool> = slopes
        .iter()
        .map(|s| s.as_ref().is_some_and(|s| nearer(s, &means)))
        .collect();
    // As most of the neighbours say: noise makes single nodes differ.
    let mut votes: Vec<i32> = raw.iter().map(|r| if *r { 1 } else { -1 }).collect();
    for (a, b) in neighbours(nodes) {
        votes[a] += if raw[b] { 1 } else { -1 };
        votes[b] += if raw[a] { 1 } else { -1 };
    }
    Some(votes.into_iter().map(|v| v > 0).collect())
}

/// Slopes of the phases of the first two waves at each node, turned from node to node, along columns and rows.
fn slopes(nodes: &[Node]) -> Vec<Option<Vector4<f64>>> {
    let mut sums = vec![(Vector4::<f64>::zeros(), [0.0; 2]); nodes.len()];
    for (a, b) in neighbours(nodes) {
        let apart = nodes[b].at - nodes[a].at;
        let axis = usize::from(apart.x.abs() < apart.y.abs());
        let turn = |wave: usize| (nodes[a].envelopes[wave].conj() * nodes[b].envelopes[wave]).arg();
        // All three waves: what they say of the first two, by least squares.
        let turns = [turn(0), turn(1), turn(2)];
        let first = (2.0 * turns[0] + turns[1] - turns[2]) / 3.0;
        let second = (turns[0] + 2.0 * turns[1] + turns[2]) / 3.0;
        for node in [a, b] {
            sums[node].0[axis] += first / apart[axis];
            sums[node].0[2 + axis] += second / apart[axis];
            sums[node].1[axis] += 1.0;
        }
    }
    let of = |(sum, counts): (Vector4<f64>, [f64; 2])| {
        let [x, y] = counts;
        (x > 0.0 && y > 0.0).then(|| sum.component_div(&Vector4::new(x, y, x, y)))
    };
    sums.into_iter().map(of).collect()
}

/// Each slope as the median of its neighbours has it: windows on a boundary see both grains, which makes a line of slopes that
/// are neither's.
fn filtered(nodes: &[Node], slopes: &[Option<Vector4<f64>>]) -> Vec<Option<Vector4<f64>>> {
    let near = |a: &Node, b: &Node| {
        let apart = |axis: usize| a.place[axis].abs_diff(b.place[axis]);
        apart(0).max(apart(1)) <= 1
    };
    let of = |node: &Node| {
        let around = nodes
            .iter()
            .zip(slopes)
            .filter(|(other, _)| near(node, other));
        let around: Vec<Vector4<f64>> = around.filter_map(|(_, slope)| *slope).collect();
        let middle = |i: usize| median(&mut around.iter().map(|s| s[i]).collect::<Vec<f64>>());
        (!around.is_empty()).then(|| Vector4::from_fn(|i, _| middle(i)))
    };
    nodes.iter().map(of).collect()
}

/// The cells whose nearest nodes all belong to one grain.
fn grain(
    cells: &Cells,
    patch: &Patch,
    nodes: &[Node],
    owner: &[Option<usize>],
    which: usize,
) -> Patch {
    let mut inside = vec![false; patch.inside.len()];
    let scale = cells.period;
    for cell in (0..inside.len()).filter(|&c| patch.inside[c]) {
        let at = cells.middle_of(cell);
        let distance = |node: &Node| {
            let d = node.at - at;
            (d.x / scale[0]).hypot(d.y / scale[1])
        };
        let (mut own, mut other) = (f64::INFINITY, f64::INFINITY);
        for (node, owner) in nodes.iter().zip(owner) {
            let least = if *owner == Some(which) {
                &mut own
            } else {
                &mut other
            };
            *least = least.min(distance(node));
        }
        // Two periods off the middle between nodes of both: windows see one grain alone there.
        inside[cell] = own < other && other > 2.0;
    }
    let counts = cells.counts();
    let there: f64 = inside
        .iter()
        .zip(counts)
        .filter(|(i, _)| **i)
        .map(|(_, n)| n)
        .sum();
    let share = there / counts.iter().sum::<f64>();
    Patch {
        unit_cells: there * patch.pair.determinant().abs() / std::f64::consts::TAU.powi(2),
        share,
        inside,
        ..patch.clone()
    }
}
