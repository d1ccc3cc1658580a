//! Maps of a scanner that its sensors say is bent → those of a straight one.
//!
//! A pixel n sees what a straight scanner has at `n + U(n)`. A lattice of p per pixel of the straight grid so has the local wave vector
//! `(1 + dU/dn)ᵀ p`, and the phase of a node is ahead by `p·U`. Each node has its own `dU/dn`, averaged as its window weighs.

use std::borrow::Cow;

use heterostrain::lattice::both;
use nalgebra::{Matrix2, Matrix4, Vector2};
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
        // δq = −(δ dU/dn)ᵀ p.
        let of_axis = |(axis, slopes): (Vector2<f64>, Matrix2<f64>)| {
            let along = wave.tr_mul(&axis);
            (along * along.transpose()).kronecker(&slopes)
        };
        let noise: Matrix4<f64> = displacement.noise_at(at).into_iter().map(of_axis).sum();
        Some(WaveNode {
            pair,
            covariance: of_both * node.covariance * of_both.transpose() + noise,
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

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::frame::departure::{Across, Departure, Term};
    use crate::frame::image::Image;
    use crate::map::local::local_lattices;
    use crate::map::sample::LatticeMap;
    use crate::numbers::rng::normals;
    use crate::window::mask::Mask;
    use crate::window::types::{Reference, Resolution};

    /// A uniform lattice on a scanner with bows of 2 % of the frame: the mean of the map is that of the lattice, nodes scatter as their errors say,
    /// and displacements are nothing. On the plane they are bent by several errors.
    #[test]
    fn bent_scanners_have_flat_maps() {
        const SIZE: [usize; 2] = [330, 300];
        let term = |along, across, x, y| Term {
            along,
            across: Across::Power(across),
            size: Vector2::new(x, y),
        };
        let terms = vec![
            term(2, 0, 1.6, 0.3),
            term(3, 0, -0.5, 0.2),
            term(0, 2, 0.4, -1.5),
            term(1, 2, 0.2, 0.3),
        ];
        let straight = Geometry::of_pitch(SIZE, [0.5; 2], 0.3, Vector2::new(4.0, -2.0)).unwrap();
        let departure = Departure::new(terms, [0, SIZE[0] - 1], [0, SIZE[1] - 1]);
        let bent = Geometry {
            departure: Some(Arc::new(departure)),
            ..straight.clone()
        };
        let displacement = bent.displacement().unwrap();
        let pair = Matrix2::new(0.24, -0.02, 0.12, 0.27);
        let mut normal = normals(40, "bent maps", 0);
        let value = |i: usize| {
            let at = Vector2::new((i % SIZE[0]) as f64, (i / SIZE[0]) as f64);
            let at = at + displacement.at(at);
            let [a, b] = [0, 1].map(|j| pair.column(j).dot(&at));
            a.cos() + b.cos() + (b - a).cos() + 0.5 * normal()
        };
        let values = (0..SIZE[0] * SIZE[1]).map(value).collect();
        let image = Image::new(SIZE[1], SIZE[0], values);
        let reference = Reference {
            pair,
            pitch: [0.5; 2],
        };
        let resolution = Resolution {
            window_nm: Some(12.0),
            ..Resolution::default()
        };
        let waves = local_lattices(&image, &reference, &resolution).unwrap();
        let truth = straight.pixel_to_nm.try_inverse().unwrap().transpose() * pair;
        let pull = |geometry: &Geometry| {
            let map = LatticeMap::new(&waves, geometry).unwrap();
            let good: Vec<_> = map.nodes.iter().filter(|n| n.mask == Mask::Good).collect();
            assert!(good.len() > 30, "{}", good.len());
            let squares = good.iter().flat_map(|n| {
                let off = n.waves.basis - truth;
                (0..4).map(move |i| off[i] * off[i] / n.waves.covariance[(i, i)])
            });
            let moved = good.iter().map(|n| n.displacement.norm());
            let far = moved.fold(0.0, f64::max);
            (
                (squares.sum::<f64>() / (4 * good.len()) as f64).sqrt(),
                far,
                (map.mean().unwrap() - truth).norm() / truth.norm(),
            )
        };
        let (rms, far, off) = pull(&bent);
        assert!((0.7..1.3).contains(&rms), "{rms}");
        assert!(far < 0.2 && off < 2e-4, "{far} nm, {off}");
        let (rms, far, _) = pull(&straight);
        assert!(rms > 3.0 && far > 0.5, "{rms}, {far} nm");
    }
}
