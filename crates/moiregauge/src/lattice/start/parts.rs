//! The lattices of parts of a frame, and which of them has the most evidence.

use std::sync::Arc;

use nalgebra::Matrix2;

use crate::coverage::find::patches;
use crate::coverage::patch::WHOLE;
use crate::coverage::settle::Settled;
use crate::frame::background::{Background, remove_background};
use crate::frame::clip::cut_off;
use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::lattice::start::{FEWEST_CELLS, HANN, Start, evidence};

impl Start {
    /// Looks for the lattices of parts of the frame, that near `first` among them, of those that are meant, and takes the one with the most
    /// evidence. Where much of the frame is missing the lattice is one of a part.
    pub(crate) fn find_meant(
        image: &Image,
        geometry: &Geometry,
        background: Background,
        first: Option<Matrix2<f64>>,
        is_meant: &dyn Fn(&Matrix2<f64>) -> bool,
    ) -> Option<Self> {
        let flat = cut_off(&remove_background(image, background));
        let there = image.values.iter().filter(|v| v.is_finite()).count();
        let recorded = there as f64 / image.values.len() as f64;
        let mut best: Option<(f64, Settled, Self)> = None;
        for mut settled in patches(&flat, geometry, first, is_meant) {
            settled.patch.share *= recorded;
            let patch = &settled.patch;
            // Outliers hide the waves; the fit to the pixels deals with them by itself.
            let part = patch.of(&flat);
            let near = Self::near(&part, geometry, background, &patch.pair);
            let Some(start) = near else { continue };
            // Straight waves that all of the patch does not show are not those of one lattice.
            if !start.is_significant() && settled.is_plain() && settled.is_straight() {
                continue;
            }
            // A part of the frame is chosen by its waves: they have to be plain to see in it.
            let is_shown = patch.share > WHOLE || settled.is_plain();
            let coherent = if is_shown && start.is_significant() {
                evidence(&start.prepared.harmonics)
            } else {
                0.0
            };
            let plain = settled.is_plain() && patch.unit_cells > FEWEST_CELLS;
            let local = if plain {
                HANN * settled.evidence()
            } else {
                0.0
            };
            let evidence = f64::max(coherent, local);
            if evidence > best.as_ref().map_or(0.0, |(most, _, _)| *most) {
                best = Some((evidence, settled, start));
            }
        }
        let (_, settled, mut start) = best?;
        let flat = remove_background(&settled.patch.of(image), background);
        start.prepared.image = Arc::new(flat);
        start.on_patch(image, settled)
    }
}
