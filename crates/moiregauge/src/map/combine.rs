//! Several maps of one place → one: on a common grid, compared and averaged node by node.
//!
//! Averages are those of wave vectors, weighted by their inverse covariance. χ² of the n maps about the
//! average says whether they agree: node by node (mask), and over all nodes, where it either enlarges the
//! errors (scatter beyond them) or shows how much of their noise the maps share:
//! `χ²/dof = 1 − ρ`, `σ² → σ²(1 + (n − 1)ρ)`. What trace and retrace share they share with each other, what the sample
//! carries (contamination) is in all frames: the lines of a frame are averaged first, then the frames.

use std::borrow::Cow;
use std::f64::consts::PI;

use heterostrain::lattice::Waves;
use nalgebra::{Matrix2, Matrix4, Vector2, Vector3, Vector4};
use rayon::prelude::*;

use crate::frame::grid_errors::Bends;
use crate::map::nodes::{Grid, LatticeNode};
use crate::map::one_gauge::in_one_gauge;
use crate::map::sample::LatticeMap;
use crate::map::view::View;
use crate::numbers::chi2::enlargement;
use crate::numbers::interrupt;
use crate::window::blur::is_improbable;
use crate::window::mask::Mask;

/// How well maps agree.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Agreement {
    /// χ² per degree of freedom of the single maps about their average, over all nodes that two or more cover.
    pub chi2_per_dof: f64,
    /// Factor on all variances that follows from it, where all maps are there.
    pub factor: f64,
    /// Nodes that two maps or more cover.
    pub nodes: usize,
}

/// What is done about noise that maps share.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Shared {
    /// It is in the errors of the average.
    Counted,
    /// It is left out where it is common to all frames: it cancels in differences.
    Cancels,
}

/// The average of maps of one place; `None` of none. One map alone is returned as it is.
pub fn combine(maps: &[&LatticeMap]) -> Option<(LatticeMap, Option<Agreement>)> {
    let frames: Vec<Vec<&LatticeMap>> = maps.iter().map(|map| vec![*map]).collect();
    combine_frames(&frames)
}

/// The same of the maps of several frames, those of the lines of a frame (trace and retrace) together.
pub fn combine_frames(frames: &[Vec<&LatticeMap>]) -> Option<(LatticeMap, Option<Agreement>)> {
    combine_with(frames, Shared::Counted)
}

/// [`combine_frames`] with a choice of what noise common to all frames is to the errors.
pub(crate) fn combine_with(
    frames: &[Vec<&LatticeMap>],
    shared: Shared,
) -> Option<(LatticeMap, Option<Agreement>)> {
    let all: Vec<&LatticeMap> = frames.iter().flatten().copied().collect();
    if let [alone] = all[..] {
        return Some((alone.clone(), None));
    }
    let grid = common_grid(&all)?;
    let own = |lines: &Vec<&LatticeMap>| lines.iter().map(|map| (*map).clone()).collect();
    let mut owned: Vec<Vec<LatticeMap>> = frames.iter().map(own).collect();
    in_one_gauge(&mut owned.iter_mut().flatten().collect::<Vec<_>>());
    let frames: Vec<Vec<&LatticeMap>> = owned.iter().map(|lines| lines.iter().collect()).collect();
    let frames: Vec<(Cow<LatticeMap>, Option<Agreement>)> = frames
        .iter()
        .filter_map(|lines| match lines[..] {
            [] => None,
            [line] => Some((Cow::Borrowed(line), None)),
            _ => {
                let (map, agreement) = average_of(&grid, lines, Shared::Counted);
                Some((Cow::Owned(map), agreement))
            }
        })
        .collect();
    if let [(map, agreement)] = &frames[..] {
        return Some((map.clone().into_owned(), *agreement));
    }
    let maps: Vec<&LatticeMap> = frames.iter().map(|(map, _)| map.as_ref()).collect();
    Some(average_of(&grid, &maps, shared))
}

/// The average of maps on a grid.
fn average_of(
    grid: &Grid,
    maps: &[&LatticeMap],
    shared: Shared,
) -> (LatticeMap, Option<Agreement>) {
    let bends = Bends::mean(maps.iter().map(|map| map.bends)).unwrap_or(maps[0].bends);
    let views: Vec<View> = maps.iter().filter_map(|map| View::new(map)).collect();
    let mut found: Vec<(LatticeNode, f64, usize)> = (0..grid.len())
        .into_par_iter()
        .map(|node| {
            interrupt::check();
            average(&views, grid.place(node))
        })
        .collect();
    let window_nm = maps.iter().map(|m| m.window_nm).fold(0.0, f64::max);
    let scatter = Scatter::of(&found, grid, window_nm, shared);
    if let Some(scatter) = &scatter {
        for (node, chi2, dof) in &mut found {
            if *dof > 0 {
                let factor = scatter.factor(1 + *dof / COMPONENTS);
                node.waves.covariance *= factor;
                node.displacement_covariance *= factor;
                let scaled = *chi2 / scatter.reduced.max(1.0);
                if node.mask == Mask::Good && is_improbable(scaled, *dof) {
                    node.mask = Mask::Contradiction;
                }
            }
        }
    }
    let map = LatticeMap {
        grid: *grid,
        window_nm,
        gauge: maps.iter().find_map(|map| map.gauge),
        bends,
        nodes: found.into_iter().map(|(node, _, _)| node).collect(),
    };
    let agreement = scatter.map(|scatter| Agreement {
        chi2_per_dof: scatter.reduced,
        factor: scatter.factor(maps.len()),
        nodes: scatter.nodes,
    });
    (map, agreement)
}

/// Numbers that a node has: two wave vectors.
const COMPONENTS: usize = 4;

/// How maps scatter about their average.
struct Scatter {
    /// χ²/dof.
    reduced: f64,
    /// What that does to variances if it is too much for chance, else 1.
    enlargement: f64,
    /// Correlation ρ of the noise of two maps.
    correlation: f64,
    nodes: usize,
}

impl Scatter {
    /// From averages with their χ² and degrees of freedom.
    fn of(
        found: &[(LatticeNode, f64, usize)],
        grid: &Grid,
        window_nm: f64,
        shared: Shared,
    ) -> Option<Self> {
        let (mut sum, mut freedom, mut nodes) = (0.0, 0, 0);
        for (node, chi2, dof) in found {
            if node.mask == Mask::Good && *dof > 0 {
                sum += chi2;
                freedom += dof;
                nodes += 1;
            }
        }
        if freedom == 0 {
            return None;
        }
        let reduced = sum / freedom as f64;
        // Nodes under one window share their noise.
        let cell = grid.step.determinant().abs();
        let together = (4.0 * PI * window_nm * window_nm / cell).max(1.0);
        let independent = (freedom as f64 / together).ceil();
        Some(Self {
            reduced,
            enlargement: enlargement(reduced * independent, independent as usize),
            // No test for chance here: with many maps the little that it would let pass is much of their mean.
            correlation: match shared {
                Shared::Counted => (1.0 - reduced).max(0.0),
                Shared::Cancels => 0.0,
            },
            nodes,
        })
    }

    /// On the variances of the average of a number of maps.
    fn factor(&self, maps: usize) -> f64 {
        self.enlargement
            .max(1.0 + (maps as f64 - 1.0) * self.correlation)
    }
}

/// A square grid along the axes of the laboratory that covers all maps, as fine as the finest.
fn common_grid(maps: &[&LatticeMap]) -> Option<Grid> {
    let corners = maps.iter().flat_map(|map| {
        let [columns, rows] = map.grid.size.map(|n| n as f64 - 1.0);
        [(0.0, 0.0), (columns, 0.0), (0.0, rows), (columns, rows)]
            .map(|(c, r)| map.grid.origin + map.grid.step * Vector2::new(c, r))
    });
    let (low, high) = corners.fold(
        (
            Vector2::repeat(f64::INFINITY),
            Vector2::repeat(f64::NEG_INFINITY),
        ),
        |(low, high): (Vector2<f64>, Vector2<f64>), c| (low.inf(&c), high.sup(&c)),
    );
    let steps = maps
        .iter()
        .flat_map(|m| [m.grid.step.column(0).norm(), m.grid.step.column(1).norm()]);
    let step = steps.fold(f64::INFINITY, f64::min);
    if !(step > 0.0 && step.is_finite()) {
        return None;
    }
    let count = |length: f64| (length / step + 1e-6).floor() as usize + 1;
    let extent = high - low;
    let size = [count(extent.x), count(extent.y)];
    let used = Vector2::new(size[0] as f64 - 1.0, size[1] as f64 - 1.0) * step;
    Some(Grid {
        size,
        origin: low + 0.5 * (extent - used),
        step: Matrix2::identity() * step,
    })
}

/// The weighted mean at a place, χ² of the maps about it and its degrees of freedom.
fn average(views: &[View], place: Vector2<f64>) -> (LatticeNode, f64, usize) {
    let seen: Vec<LatticeNode> = views.iter().filter_map(|view| view.at(place)).collect();
    let good: Vec<&LatticeNode> = seen.iter().filter(|n| n.mask == Mask::Good).collect();
    if good.is_empty() {
        // The least bad reason, with its values if it has any.
        let best = seen.iter().min_by_key(|n| n.mask);
        return (
            best.copied().unwrap_or(LatticeNode::nothing(Mask::Margin)),
            0.0,
            0,
        );
    }
    let (mut normal, mut right) = (Matrix4::zeros(), Vector4::zeros());
    let mut weights = Vec::with_capacity(good.len());
    for node in &good {
        let Some(weight) = node.waves.covariance.try_inverse() else {
            return (LatticeNode::nothing(Mask::Weak), 0.0, 0);
        };
        normal += weight;
        right += weight * node.waves.flat();
        weights.push(weight);
    }
    let Some(covariance) = normal.try_inverse() else {
        return (LatticeNode::nothing(Mask::Weak), 0.0, 0);
    };
    let mean = covariance * right;
    let chi2 = good.iter().zip(&weights).map(|(node, weight)| {
        let miss = node.waves.flat() - mean;
        (miss.transpose() * weight * miss)[0]
    });
    let (displacement, displacement_covariance) = mean_displacement(&good);
    let node = LatticeNode {
        mask: Mask::Good,
        waves: Waves::new(Matrix2::from_column_slice(mean.as_slice()), covariance),
        chi2: good.iter().map(|n| n.chi2).sum(),
        freedom: good.iter().map(|n| n.freedom).sum(),
        signal_to_noise: good.iter().map(|n| n.signal_to_noise).sum(),
        phases: Vector3::repeat(f64::NAN),
        displacement,
        displacement_covariance,
    };
    (node, chi2.sum(), COMPONENTS * (good.len() - 1))
}

/// The weighted mean of the displacements, all against one mean lattice, of those maps that have one; NaN where none has.
fn mean_displacement(good: &[&LatticeNode]) -> (Vector2<f64>, Matrix2<f64>) {
    let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
    for node in good {
        let weight = node.displacement_covariance.try_inverse();
        let weight = weight.filter(|w| w.iter().all(|x| x.is_finite()));
        if let Some(weight) = weight.filter(|_| node.displacement.iter().all(|u| u.is_finite())) {
            normal += weight;
            right += weight * node.displacement;
        }
    }
    normal.try_inverse().map_or(
        (Vector2::repeat(f64::NAN), Matrix2::repeat(f64::NAN)),
        |covariance| (covariance * right, covariance),
    )
}

#[cfg(test)]
mod tests;
