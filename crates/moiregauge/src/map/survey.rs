//! Images too large for memory: bands of lines, each mapped by itself, that go on where others end.
//!
//! A band holds its lines and a halo of six windows on either side. Nodes lie at the same steps in all
//! bands, and phases count from the middle of the whole image.

use std::ops::Range;

use nalgebra::Vector2;

use crate::frame::image::Image;
use crate::map::demodulate::demodulate;
use crate::window::blocks::{Place, block_of, step_of, stride_of};
use crate::window::types::{Reference, Resolution, WaveMap};

/// Windows of halo on either side of a band: the reach of the widest kernel, √2 · 4.5.
const HALO: f64 = 6.5;

/// How an image is cut into bands.
#[derive(Clone, Copy, Debug)]
pub struct Survey {
    size: [usize; 2],
    reference: Reference,
    resolution: Resolution,
    /// Lines from node to node.
    step: usize,
    /// Lines of a band and of its halo; both are whole numbers of steps.
    lines: usize,
    halo: usize,
}

impl Survey {
    /// Bands of about `lines` lines for an image of `size` (columns, rows), with a window of `window_nm`.
    pub fn new(
        size: [usize; 2],
        reference: Reference,
        resolution: Resolution,
        window_nm: f64,
        lines: usize,
    ) -> Self {
        let block = block_of(&reference);
        let apart = step_of(&resolution, &reference, window_nm);
        let step = block[1] * stride_of(&reference, block, apart)[1];
        let halo = (HALO * reference.in_pixels(window_nm)[1] / step as f64).ceil() as usize;
        Self {
            size,
            reference,
            resolution: Resolution {
                window_nm: Some(window_nm),
                ..resolution
            },
            step,
            lines: (lines / step).max(1) * step,
            halo: halo * step,
        }
    }

    /// Number of bands.
    pub fn bands(&self) -> usize {
        self.size[1].div_ceil(self.lines)
    }

    /// The lines that a band needs, halo and all.
    pub fn rows(&self, band: usize) -> Range<usize> {
        let first = band * self.lines;
        first.saturating_sub(self.halo)..(first + self.lines + self.halo).min(self.size[1])
    }

    /// The map of a band from its lines ([`Survey::rows`]), the background gone; nodes of the halo are left out.
    ///
    /// `None` where the lines show nothing.
    pub fn map(&self, band: usize, lines: &Image) -> Option<WaveMap> {
        let rows = self.rows(band);
        let centre = Vector2::new(self.size[0] as f64 - 1.0, self.size[1] as f64 - 1.0) / 2.0;
        let place = Place {
            row: rows.start,
            rows: Some(self.size[1]),
            centre,
        };
        let mut map = demodulate(lines, place, &self.reference, &self.resolution)?;
        let skipped = (band * self.lines - rows.start) / self.step;
        let wanted = self.lines / self.step;
        let columns = map.size[0];
        let last = (skipped + wanted).min(map.size[1]);
        map.nodes = map.nodes[skipped.min(last) * columns..last * columns].to_vec();
        map.size[1] = last - skipped.min(last);
        map.first.y += (skipped * self.step) as f64;
        Some(map)
    }
}
