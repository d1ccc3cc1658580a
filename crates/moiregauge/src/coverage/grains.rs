//! Several lattices side by side: grains.
//!
//! Where two grains meet, the phases run along one plane in each of them. A lattice is followed from many nodes into its surroundings as
//! far as these are of it; the two that describe most nodes together are fitted to theirs. Two lattices it is if no smooth change of one describes the phases,
//! and if the data pay for two (BIC) against the best of these.

use rustfft::num_complex::Complex64;

use crate::coverage::bend::{described, described_as_straight};
use crate::coverage::cells::Cells;
use crate::coverage::nodes::{Node, View, information, neighbours, nodes};
use crate::coverage::patch::LatticeRegion;
use crate::coverage::phases::{Fit, fit, freedom, powers, price, rows, value};
use crate::numbers::MOST_ROUNDS;

/// Nodes from which lattices are followed, about.
const SEEDS: f64 = 36.0;
/// How far a lattice is followed from its node, in nodes: a slope that eight neighbours tell holds for a few more.
const REACHES: [usize; 5] = [2, 3, 5, 9, usize::MAX];
/// A part with fewer nodes than this is a defect and no grain.
const FEWEST_NODES: usize = 6;
/// By how much the evidence (BIC) of two lattices has to be better than that of one that changes: chance does that once in e¹⁰.
const BETTER: f64 = 20.0;

/// A smooth change describes phases whose χ² is below this, times its degrees of freedom: those of waves of twist and strain
/// were below 0.6 of them, those of two grains above 3.
const MISFIT: f64 = 1.5;

/// Phases that are off by less than this from a lattice (rad, root mean square of three) may be of it when two are chosen: half of what is
/// asked of a neighbour, so that no lattice between two is taken for either.
const NEAR: f64 = 0.4;

/// Phases that are off by more than this from both lattices (rad, root mean square of three) are of neither: by chance those of
/// three waves that have nothing to do with a lattice are nearer once in ten.
const NEITHER: f64 = 0.8;

/// Two lattices side by side.
pub(crate) struct Grains {
    /// Where windows see one of them alone; the larger first.
    pub(crate) patches: [LatticeRegion; 2],
    /// Shares of the pixels that there are, as far as the boundary.
    pub(crate) shares: [f64; 2],
    /// Length of the boundary between them along columns and along rows, pixels: the legs of a straight line.
    pub(crate) boundary: [f64; 2],
}

/// The two grains of a patch; `None` where one lattice describes all of the patch as well.
pub(crate) fn split(view: &View, patch: &LatticeRegion) -> Option<Grains> {
    let all = nodes(view, patch);
    if all.len() < 2 * FEWEST_NODES {
        return None;
    }
    let mut owner = halves(patch, &all)?;
    for _ in 0..MOST_ROUNDS {
        let parts = [0, 1].map(|which| part(&all, &owner, Some(which)));
        if parts.iter().any(|p| p.len() < FEWEST_NODES) {
            return None;
        }
        let fits = parts.map(|part| fit(powers(patch, 1), &part));
        let [Some(a), Some(b)] = fits else {
            return None;
        };
        let before = owner;
        owner = all.iter().map(|node| nearer(node, [&a, &b])).collect();
        if owner == before {
            break;
        }
    }
    let parts = [0, 1].map(|which| part(&all, &owner, Some(which)));
    if parts.iter().any(|p| p.len() < FEWEST_NODES) {
        return None;
    }
    let one = described(view, patch, &part(&all, &owner, None))?;
    if one[0] < MISFIT * freedom(information(&all), one[1]) {
        return None;
    }
    let [a, b] = [0, 1].map(|i| described_as_straight(patch, &parts[i]));
    let (a, b) = (a?, b?);
    // Where the boundary runs costs about as many numbers as it is nodes long.
    let shape = one[2].sqrt() * one[2].ln() / 2.0;
    let two = price(a[0] + b[0], a[1] + b[1], a[2] + b[2]) + shape;
    if price(one[0], one[1], one[2]) - two < BETTER {
        return None;
    }
    let mut patches = [0, 1].map(|which| grain(view.cells, patch, &all, &owner, which));
    let nearest = nearest(view.cells, patch, &all, &owner);
    let mut shares = shares(view.cells, &nearest);
    if patches[1].unit_cells > patches[0].unit_cells {
        patches.swap(0, 1);
        shares.swap(0, 1);
    }
    Some(Grains {
        patches,
        shares,
        boundary: boundary(view.cells, &nearest),
    })
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

/// By how much the phases at a node are off a lattice, rad, root mean square of the three.
fn miss(node: &Node, fit: &Fit) -> f64 {
    let rows = rows(&fit.basis, node.at).into_iter().enumerate();
    let squares = rows.map(|(wave, row)| {
        let turn = Complex64::cis(-value(&row, &fit.coefficients));
        (node.envelopes[wave] * turn).arg().powi(2)
    });
    (squares.sum::<f64>() / 3.0).sqrt()
}

/// To which of two lattices the phases at a node belong; `None` where they are neither's.
fn nearer(node: &Node, fits: [&Fit; 2]) -> Option<usize> {
    let misses = fits.map(|fit| miss(node, fit));
    let which = usize::from(misses[1] < misses[0]);
    (misses[which] < NEITHER).then_some(which)
}

/// To which of two lattices each node belongs: of all that are found from nodes, the two that describe most nodes together.
fn halves(patch: &LatticeRegion, nodes: &[Node]) -> Option<Vec<Option<usize>>> {
    let stride = ((nodes.len() as f64 / SEEDS).sqrt().round() as usize).max(1);
    let seeds = nodes
        .iter()
        .filter(|node| node.place.iter().all(|place| place % stride == 0));
    let found: Vec<Fit> = seeds
        .filter_map(|seed| grown(patch, nodes, seed.place))
        .collect();
    // A node counts the more the better a lattice describes it.
    let near = |fit: &Fit| {
        let miss = |node| (1.0 - (miss(node, fit) / NEAR).powi(2)).max(0.0);
        nodes.iter().map(miss).collect::<Vec<f64>>()
    };
    let near: Vec<Vec<f64>> = found.iter().map(near).collect();
    let described = |[a, b]: [usize; 2]| {
        let both = near[a].iter().zip(&near[b]);
        both.map(|(a, b)| a.max(*b)).sum::<f64>()
    };
    let pairs = (0..found.len()).flat_map(|a| (0..a).map(move |b| [a, b]));
    let [first, second] = pairs.max_by(|a, b| described(*a).total_cmp(&described(*b)))?;
    let fits = [&found[first], &found[second]];
    Some(nodes.iter().map(|node| nearer(node, fits)).collect())
}

/// The lattice at a node, from ever wider surroundings as far as they are of it.
fn grown(patch: &LatticeRegion, nodes: &[Node], seed: [usize; 2]) -> Option<Fit> {
    let far = |node: &Node| (0..2).map(|i| node.place[i].abs_diff(seed[i])).max();
    let within = |reach: usize| nodes.iter().filter(move |node| far(node) <= Some(reach));
    let around: Vec<Node> = within(1).cloned().collect();
    if around.len() < FEWEST_NODES {
        return None;
    }
    let mut found = fit(powers(patch, 1), &around)?;
    for reach in REACHES {
        let near = within(reach).filter(|node| miss(node, &found) < NEITHER);
        let near: Vec<Node> = near.cloned().collect();
        if near.len() < FEWEST_NODES {
            return None;
        }
        found = fit(powers(patch, 1), &near)?;
    }
    Some(found)
}

/// The grain to whose nodes each cell of a patch is nearest.
fn nearest(
    cells: &Cells,
    patch: &LatticeRegion,
    nodes: &[Node],
    owner: &[Option<usize>],
) -> Vec<Option<usize>> {
    let nearest = |cell: usize| {
        let at = cells.middle_of(cell);
        let owned = nodes
            .iter()
            .zip(owner)
            .filter_map(|(n, o)| Some((n, (*o)?)));
        let distance = |node: &Node| {
            let d = node.at - at;
            (d.x / cells.period[0]).hypot(d.y / cells.period[1])
        };
        let nearest = owned.min_by(|a, b| distance(a.0).total_cmp(&distance(b.0)));
        nearest.map(|(_, owner)| owner)
    };
    (0..cells.len())
        .map(|cell| patch.inside[cell].then(|| nearest(cell)).flatten())
        .collect()
}

/// Shares of the pixels that there are.
fn shares(cells: &Cells, of: &[Option<usize>]) -> [f64; 2] {
    let counts = || of.iter().zip(cells.counts());
    let all: f64 = cells.counts().iter().sum();
    [0, 1].map(|which| {
        let own = counts().filter(|(owner, _)| **owner == Some(which));
        own.map(|(_, count)| count).sum::<f64>() / all
    })
}

/// Length of the sides of cells (along columns, along rows; pixels) between those of one and of the other grain.
fn boundary(cells: &Cells, of: &[Option<usize>]) -> [f64; 2] {
    let [across, up] = cells.size;
    let differ = |a: usize, b: usize| of[a].is_some() && of[b].is_some() && of[a] != of[b];
    let mut lengths = [0.0; 2];
    for (x, y) in (0..cells.len()).map(|i| (i % across, i / across)) {
        let here = y * across + x;
        if x + 1 < across && differ(here, here + 1) {
            lengths[1] += cells.pixels[1] as f64;
        }
        if y + 1 < up && differ(here, here + across) {
            lengths[0] += cells.pixels[0] as f64;
        }
    }
    lengths
}

/// The cells whose nearest nodes all belong to one grain.
fn grain(
    cells: &Cells,
    patch: &LatticeRegion,
    nodes: &[Node],
    owner: &[Option<usize>],
    which: usize,
) -> LatticeRegion {
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
    LatticeRegion {
        unit_cells: there * patch.pair.determinant().abs() / std::f64::consts::TAU.powi(2),
        share,
        inside,
        ..patch.clone()
    }
}
