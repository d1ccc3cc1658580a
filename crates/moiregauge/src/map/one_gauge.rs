//! Displacements of several maps against the mean lattice of one of them.
//!
//! The phases of a place are the same in all maps that are put on each other: `Q'ᵀ(r − u' − r₀') = Qᵀ(r − u − r₀)`, up to whole
//! periods, which the nodes that maps share tell.

use nalgebra::Vector2;

use crate::map::gauge::Gauge;
use crate::map::sample::LatticeMap;
use crate::map::view::View;
use crate::window::mask::Mask;

/// Nodes that two maps have to share before displacements of one are put on the other: three by three.
const FEWEST: usize = 9;

/// Puts the displacements of all maps on the mean lattice of the first that has one. Maps that share too few nodes with
/// others lose theirs: how many periods lie between them is not known.
pub(crate) fn in_one_gauge(maps: &mut [&mut LatticeMap]) {
    let first = maps.iter().position(|map| map.gauge.is_some());
    let Some((first, gauge)) = first.and_then(|n| Some((n, maps[n].gauge?))) else {
        return;
    };
    let mut done = vec![first];
    for i in (0..maps.len()).filter(|&i| i != first) {
        let moved = maps[i].gauge.and_then(|own| {
            let moved = displacements_in(maps[i], &own, &gauge)?;
            let of = |&other: &usize| turns_against(maps[other], maps[i], &moved, &gauge);
            let (turns, _) = done
                .iter()
                .filter_map(of)
                .max_by_key(|(_, shared)| *shared)?;
            Some((moved, turns))
        });
        if let Some((moved, turns)) = moved {
            for (node, moved) in maps[i].nodes.iter_mut().zip(moved) {
                node.displacement = moved + gauge.vectors * turns;
            }
            maps[i].gauge = Some(gauge);
            done.push(i);
        } else {
            for node in &mut maps[i].nodes {
                node.displacement.fill(f64::NAN);
                node.displacement_covariance.fill(f64::NAN);
            }
            maps[i].gauge = None;
        }
    }
}

/// The displacements of a map against another mean lattice, up to a vector of that.
fn displacements_in(map: &LatticeMap, own: &Gauge, gauge: &Gauge) -> Option<Vec<Vector2<f64>>> {
    // The same phases: Q'ᵀ(r − u' − r₀') = Qᵀ(r − u − r₀).
    let change = gauge.waves.transpose().try_inverse()? * own.waves.transpose();
    let nodes = map.nodes.iter().enumerate();
    let moved = nodes.map(|(n, node)| {
        let place = map.grid.place(n);
        place - gauge.node - change * (place - node.displacement - own.node)
    });
    Some(moved.collect())
}

/// By how many vectors the displacements `moved` of `map` lie short of those of `fixed`, and how many nodes say so.
fn turns_against(
    fixed: &LatticeMap,
    map: &LatticeMap,
    moved: &[Vector2<f64>],
    gauge: &Gauge,
) -> Option<(Vector2<f64>, usize)> {
    let view = View::new(fixed)?;
    let (mut sum, mut shared) = (Vector2::zeros(), 0);
    for (n, (node, moved)) in map.nodes.iter().zip(moved).enumerate() {
        let there = view.at(map.grid.place(n));
        let Some(there) = there.filter(|t| t.mask == Mask::Good && node.mask == Mask::Good) else {
            continue;
        };
        let short = there.displacement - moved;
        if short.iter().all(|x| x.is_finite()) {
            sum += short;
            shared += 1;
        }
    }
    let mean = sum / f64::from(u32::try_from(shared).ok()?);
    let turns = (gauge.vectors.try_inverse()? * mean).map(f64::round);
    (shared >= FEWEST).then_some((turns, shared))
}
