//! Where nodes lie in their frame, and what their neighbours say of them.

use nalgebra::{Matrix2, Vector2};
use rustfft::num_complex::Complex32;

use crate::window::blur::Blur;
use crate::window::smooth::{Nodes, Smoothed};

/// Phase (rad) by which a wave may bend over one window width: what is lost of the amplitude is 0.35²/2 = 6 %.
const STRAIGHT: f64 = 0.35;
/// Nodes this near to a winding point, to contradicting harmonics and to lost signal (window widths) see them:
/// farther off the window has less than e⁻² of its height.
pub(crate) const NEAR: f64 = 2.0;
/// Nodes this near to a bent one are bent: farther off the window has less than 60 % of its height.
const BESIDE: f64 = 1.0;
/// Signal is lost, and not just hidden by noise, where its power is below this share of the usual: half of the
/// amplitude, as at the edge of what has none.
pub(crate) const LOST: f64 = 0.25;
/// Less of a window than this is too little: at a straight edge half would be left, and slopes lean.
pub(crate) const SHARE: f64 = 0.6;

/// What the masks need to know of the nodes.
pub(crate) struct Setting<'a> {
    pub(crate) smoothed: &'a Smoothed,
    /// Place of every node, pixels.
    pub(crate) places: &'a [Vector2<f64>],
    /// Width of the window and margin, pixels.
    pub(crate) width: [f64; 2],
    pub(crate) margin: [f64; 2],
    /// First and last pixel of the frame.
    pub(crate) frame: [Vector2<f64>; 2],
}

impl Setting<'_> {
    /// Whether a node is in the margin.
    pub(crate) fn is_outside(&self, node: usize) -> bool {
        let (at, [low, high]) = (self.places[node], self.frame);
        (0..2).any(|i| (at - low)[i].min((high - at)[i]) < self.margin[i])
    }

    /// Whether too much of the window of a node is missing.
    pub(crate) fn is_missing(&self, node: usize) -> bool {
        self.smoothed.support[node].is_none_or(|s| s.share < SHARE)
    }

    /// Nodes within a number of window widths of one for which `is_core` holds.
    pub(crate) fn near(&self, widths: f64, is_core: impl Fn(usize) -> bool) -> Vec<bool> {
        let [columns, rows] = self.smoothed.nodes.size;
        let step = |axis: usize, next: usize| {
            let places = (self.places.get(next), self.places.first());
            match places {
                (Some(a), Some(b)) => (a - b)[axis],
                _ => 1.0,
            }
        };
        let reach = [
            widths * self.width[0] / step(0, 1),
            widths * self.width[1] / step(1, columns),
        ];
        let mut out = vec![false; columns * rows];
        for core in (0..columns * rows).filter(|&n| is_core(n)) {
            let (column, row) = ((core % columns) as f64, (core / columns) as f64);
            let span = |at: f64, reach: f64, count: usize| {
                (at - reach).max(0.0).ceil() as usize..=((at + reach) as usize).min(count - 1)
            };
            for r in span(row, reach[1], rows) {
                for c in span(column, reach[0], columns) {
                    let (x, y) = ((c as f64 - column) / reach[0], (r as f64 - row) / reach[1]);
                    out[r * columns + c] |= x * x + y * y <= 1.0;
                }
            }
        }
        out
    }

    /// Nodes that are bent, or beside one. `pair` gives the first waves at its second argument, seen from the first;
    /// `blur` that of a node, `None` where nothing is known of it.
    pub(crate) fn bent(
        &self,
        pair: impl Fn(usize, usize) -> Option<Matrix2<f64>>,
        blur: impl Fn(usize) -> Option<Blur>,
    ) -> Vec<bool> {
        self.near(BESIDE, |n| {
            let Some(blur) = blur(n).filter(|_| !self.is_outside(n)) else {
                return false;
            };
            blur.matters() || self.bend(|other| pair(n, other), n) > STRAIGHT
        })
    }

    /// How far the phase of the first waves (`pair` of a node) bends over a window width, from differences to the
    /// neighbours.
    fn bend(&self, pair: impl Fn(usize) -> Option<Matrix2<f64>>, node: usize) -> f64 {
        let [columns, rows] = self.smoothed.nodes.size;
        let (column, row) = (node % columns, node / columns);
        let mut most = 0.0f64;
        for axis in 0..2 {
            let (low, high) = match axis {
                0 => (
                    column.checked_sub(1).map(|_| node - 1),
                    (column + 1 < columns).then(|| node + 1),
                ),
                _ => (
                    row.checked_sub(1).map(|_| node - columns),
                    (row + 1 < rows).then(|| node + columns),
                ),
            };
            let of = |n: Option<usize>| n.and_then(|n| Some((n, pair(n)?)));
            let here = pair(node).map(|l| (node, l));
            let (Some((a, first)), Some((b, second))) = (of(low).or(here), of(high).or(here))
            else {
                continue;
            };
            let distance = (self.places[b] - self.places[a]).norm();
            if distance > 0.0 {
                let slope = (second - first) / distance;
                for wave in slope.column_iter() {
                    let across = wave.component_mul(&Vector2::from(self.width));
                    most = most.max(across.norm() * self.width[axis]);
                }
            }
        }
        most
    }
}

/// The upper right one of four neighbouring nodes, and the four in their order around.
pub(crate) fn fours(nodes: Nodes) -> impl Iterator<Item = (usize, [usize; 4])> {
    let [columns, rows] = nodes.size;
    let all = (1..rows).flat_map(move |row| (1..columns).map(move |c| row * columns + c));
    all.map(move |n| (n, [n, n - 1, n - 1 - columns, n - columns]))
}

/// Whether a phase winds on the way around.
pub(crate) fn winds(amplitude: &[Complex32], around: [usize; 4]) -> bool {
    let turn = |a: usize, b: usize| f64::from((amplitude[b] * amplitude[a].conj()).arg());
    let turns: f64 = (0..4).map(|k| turn(around[k], around[(k + 1) % 4])).sum();
    turns.abs() > std::f64::consts::PI
}
