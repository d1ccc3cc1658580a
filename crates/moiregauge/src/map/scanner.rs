//! Maps of a scanner that its sensors say is bent → those of a straight one.
//!
//! A pixel n sees what a straight scanner has at `n + U(n)`. A lattice of p per pixel of the straight grid so has the local wave vector
//! `(1 + dU/dn)ᵀ p`, and the phase of a node is ahead by `p·U`. Each node has its own `dU/dn`, averaged as its window weighs.

use std::borrow::Cow;

use heterostrain::lattice::both;
use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;

use crate::frame::geometry::Geometry;
use crate::window::types::{WaveMap, WaveNode};

/// The same map on a straight grid.
pub(crate) fn straight<'a>(map: &'a WaveMap, geometry: &Geometry) -> Cow<'a, WaveMap> {
    let Some(displacement) = geometry.displacement() else {
        return Cow::Borrowed(map);
    };
    let width = Vector2::from(map.reference.in_pixels(map.window_nm));
    let of = |(n, node): (usize, &WaveNode)| {
        let at = map.place(n);
        let slopes = displacement.mean_slopes(at, width, geometry.size);
        let to_straight = (Matrix2::identity() + slopes).transpose().try_inverse()?;
        let pair = to_straight * node.pair;
        let of_both = both(&to_straight);
        // A node without a lattice of its own has phases all the same.
        let known = pair.iter().all(|q| q.is_finite());
        let wave = if known { pair } else { map.reference.pair };
        let turned = wave.tr_mul(&displacement.at(at));
        let [a, b, c] = node.phases;
        Some(WaveNode {
            pair,
            covariance: of_both * node.covariance * of_both.transpose(),
            phases: [a - turned.x, b - turned.y, c - (turned.y - turned.x)],
            ..*node
        })
    };
    let nodes = map.nodes.par_iter().enumerate();
    let nodes = nodes.map(|(n, node)| of((n, node)).unwrap_or(*node));
    Cow::Owned(WaveMap {
        nodes: nodes.collect(),
        ..map.clone()
    })
}
