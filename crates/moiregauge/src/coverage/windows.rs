//! What windows make of waves that bend under them.
//!
//! The phase of an envelope is not that of the wave in the middle of its window where the wave bends: a wave of twist ten moiré periods
//! long loses a tenth of its swing. So the waves that a description says are drawn, read under the same windows, and what comes
//! out beside what was drawn is taken off the phases that were read (indirect inference).

use nalgebra::Vector2;
use rustfft::num_complex::Complex64;

use crate::coverage::nodes::{Node, View, nodes};
use crate::coverage::patch::LatticeRegion;
use crate::coverage::phases::{Fit, rows, value};
use crate::frame::image::Image;
use crate::numbers::three::three;

/// The nodes without what their windows do to waves that run as `fit` says; `read`: what was read at them.
pub(crate) fn straightened(
    view: &View,
    patch: &LatticeRegion,
    read: &[Node],
    fit: &Fit,
) -> Vec<Node> {
    let image = drawn(view, patch, read, fit);
    let seen = nodes(
        &View {
            image: &image,
            ..*view
        },
        patch,
    );
    let of = |node: &Node| {
        let Some(seen) = seen.iter().find(|seen| seen.place == node.place) else {
            return node.clone();
        };
        let rows = rows(&fit.basis, seen.at);
        let envelopes = [0, 1, 2].map(|i| {
            let off = seen.envelopes[i] * Complex64::cis(-value(&rows[i], &fit.coefficients));
            node.envelopes[i] * Complex64::cis(-off.arg())
        });
        Node {
            envelopes,
            ..node.clone()
        }
    };
    read.iter().map(of).collect()
}

/// Three waves with the phases of a description and the mean amplitudes of some nodes; missing where the image is.
fn drawn(view: &View, patch: &LatticeRegion, nodes: &[Node], fit: &Fit) -> Image {
    let image = view.image;
    let amplitudes = [0, 1, 2].map(|i| nodes.iter().map(|n| n.envelopes[i].norm()).sum::<f64>());
    let waves = three(&patch.pair);
    let values = image.values.iter().enumerate().map(|(pixel, value_here)| {
        let place = [pixel % image.columns, pixel / image.columns];
        if !value_here.is_finite() || !patch.holds(place) {
            return f64::NAN;
        }
        let at = Vector2::new(place[0] as f64, place[1] as f64);
        let rows = rows(&fit.basis, at);
        let turned = view.turned(at, waves);
        let wave = |i: usize| {
            let phase = waves[i].dot(&at) + turned[i] + value(&rows[i], &fit.coefficients);
            amplitudes[i] * phase.cos()
        };
        (0..3).map(wave).sum()
    });
    Image::new(image.rows, image.columns, values.collect())
}
