//! The places of a patch at which the phases of its waves are read.

use nalgebra::Vector2;
use rustfft::num_complex::Complex64;

use crate::coverage::cells::Cells;
use crate::coverage::local::{Local, local};
use crate::coverage::patch::LatticeRegion;
use crate::frame::departure::Departure;
use crate::frame::image::Image;
use crate::numbers::three::three;

/// Distance of nodes in widths of the window: small patches need every place, ...
pub(crate) const CLOSE: f64 = 1.0;

/// ... and large ones, of more unit cells than this, few nodes. Information is kept by both.
pub(crate) const LARGE: f64 = 400.0;

/// Distance of nodes in large patches.
pub(crate) const STRIDE: f64 = 2.0;

/// What the phases of a patch are read from, all in bins.
pub(crate) struct View<'a> {
    pub(crate) image: &'a Image,
    pub(crate) cells: &'a Cells,
    /// The window, mean periods.
    pub(crate) width: f64,
    /// Noise power per pixel at each wave.
    pub(crate) noise: [f64; 3],
    pub(crate) signal_to_noise: f64,
    /// How far from its own place each pixel is on a straight grid, pixels; `None` of a straight scanner.
    pub(crate) displacement: Option<&'a Departure>,
}

impl View<'_> {
    /// By how much a bent scanner turns the phases of some waves at a place.
    pub(crate) fn turned<const N: usize>(
        &self,
        at: Vector2<f64>,
        waves: [Vector2<f64>; N],
    ) -> [f64; N] {
        match self.displacement {
            Some(displacement) => {
                let off = displacement.at(at);
                waves.map(|q| q.dot(&off))
            }
            None => [0.0; N],
        }
    }
}

/// One place where the phases are read.
#[derive(Clone)]
pub(crate) struct Node {
    /// Where the phases hold: the middle of what the window sees, pixels.
    pub(crate) at: Vector2<f64>,
    /// Position on the grid of nodes.
    pub(crate) place: [usize; 2],
    pub(crate) envelopes: [Complex64; 3],
    /// Information on the phase of each wave, 1/rad²: that of the pixels that belong to this node alone.
    pub(crate) weights: [f64; 3],
    /// Pixels that belong to this node over those of its window.
    pub(crate) share: f64,
    /// Standard deviation of the phases; that of nodes beside each other is correlated.
    pub(crate) errors: [f64; 3],
    /// Variance that white noise gives the envelope of the first wave: larger where an edge cuts the window off.
    pub(crate) gain: f64,
}

/// The nodes of a patch at which the three waves can be told apart.
pub(crate) fn nodes(view: &View, patch: &LatticeRegion) -> Vec<Node> {
    let cells = view.cells;
    let width = [0, 1].map(|axis| view.width * cells.period[axis]);
    let apart = if patch.unit_cells > LARGE {
        STRIDE
    } else {
        CLOSE
    };
    let stride = [0, 1]
        .map(|axis| ((apart * width[axis] / cells.pixels[axis] as f64).round() as usize).max(1));
    let pixels = [0, 1].map(|axis| (stride[axis] * cells.pixels[axis]) as f64);
    let share = pixels[0] * pixels[1] / (4.0 * std::f64::consts::PI * width[0] * width[1]);
    let mut places = Vec::new();
    for (j, y) in (stride[1] / 2..cells.size[1])
        .step_by(stride[1])
        .enumerate()
    {
        for (i, x) in (stride[0] / 2..cells.size[0])
            .step_by(stride[0])
            .enumerate()
        {
            if patch.inside[y * cells.size[0] + x] {
                places.push(([i, j], [x, y]));
            }
        }
    }
    let at: Vec<usize> = places
        .iter()
        .map(|(_, [x, y])| y * cells.size[0] + x)
        .collect();
    let seen = local(cells, &patch.of(view.image), &patch.pair, view.width, &at);
    let all = places.into_iter().zip(seen);
    all.filter_map(|((place, _), local)| {
        let Local {
            at,
            envelopes,
            noise,
        } = local?;
        // The phases are those of a straight scanner.
        let turned = view.turned(at, three(&patch.pair));
        let envelopes = [0, 1, 2].map(|i| match turned[i] {
            0.0 => envelopes[i],
            turned => envelopes[i] * Complex64::cis(-turned),
        });
        let errors =
            [0, 1, 2].map(|i| (view.noise[i] * noise[i] / (2.0 * envelopes[i].norm_sqr())).sqrt());
        Some(Node {
            at,
            place,
            envelopes,
            weights: errors.map(|e| share / (e * e)),
            share,
            errors,
            gain: noise[0],
        })
    })
    .collect()
}

/// How many independent phases the pixels of some nodes tell, each pixel counted once: what χ² is without a description.
pub(crate) fn information(nodes: &[Node]) -> f64 {
    nodes.iter().map(|node| 3.0 * node.share).sum()
}

/// Pairs of nodes beside each other.
pub(crate) fn neighbours(nodes: &[Node]) -> Vec<(usize, usize)> {
    let at: std::collections::HashMap<[usize; 2], usize> = nodes
        .iter()
        .enumerate()
        .map(|(i, n)| (n.place, i))
        .collect();
    let mut pairs = Vec::new();
    for (i, node) in nodes.iter().enumerate() {
        let [x, y] = node.place;
        for next in [[x + 1, y], [x, y + 1]] {
            pairs.extend(at.get(&next).map(|&j| (i, j)));
        }
    }
    pairs
}
