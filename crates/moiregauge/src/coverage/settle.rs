//! From a rough pair of waves to the part of the frame that carries them, and their mean over it.
//!
//! The envelopes of the three first waves are compared with what is typical of them where they are: the cells where
//! their weighted sum is more than half of that are the patch. Over the patch the phases of the envelopes say how
//! far the pair is off; a few rounds of both settle. The skirts that an edge gives to a wave are this wave with a
//! slope of its phase: they settle on the wave itself.

use std::cell::OnceCell;

use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;
use rustfft::num_complex::Complex64;

use crate::coverage::bend::{Mean, mean, refined, refined_change};
use crate::coverage::cells::{Cells, Window};
use crate::coverage::grains::{Grains, split};
use crate::coverage::look::{Frame, Seen};
use crate::coverage::nodes::View;
use crate::coverage::patch::{LatticeRegion, WHOLE};
use crate::coverage::sides::without_tails;
use crate::coverage::tidy::{area, is_broad, shrunk, tidy};
use crate::frame::departure::Departure;
use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::numbers::MOST_ROUNDS;
use crate::numbers::three::three;

/// Windows that are tried, mean periods: the narrowest that keeps waves a wave vector apart, and wider ones for
/// noisy images.
const WIDTHS: [f64; 4] = [0.8, 1.2, 1.8, 2.7];

/// Bins per shortest period; pixels are averaged where there are twice as many: harmonics need not be resolved.
const BINS_PER_PERIOD: f64 = 8.0;

/// The pair stands still when it moves by less than this over the patch, cycles.
const STILL: f64 = 0.02;

/// The smallest patch, unit cells of the lattice: fewer make no lattice. Half and twice as much change no result of
/// docs/constants.md.
const FEWEST_CELLS: f64 = 5.0;

/// A Gaussian window makes a strip of this many of its widths (standard deviations) of a line, where it sees half: √(8 ln 2).
const LINE: f64 = 2.354_820_045_030_949;

/// Settles a pair of waves (rad per pixel) on the lattice near it. `pitch`: distance of pixels along columns and rows.
///
/// `None` where no part of the frame carries the three waves, or where noise hides where they are.
pub(crate) fn settle(image: &Image, pair: &Matrix2<f64>, pitch: [f64; 2]) -> Option<Settled> {
    settle_in_bins(image, 1, pair, pitch)
}

/// The same for a lattice that is `wanted` by where its waves settle, rad per pixel.
pub(crate) fn settle_if(
    image: &Image,
    pair: &Matrix2<f64>,
    pitch: [f64; 2],
    wanted: &dyn Fn(&Matrix2<f64>) -> bool,
) -> Option<Settled> {
    settle_binned(image, 1, pair, pitch, wanted)
}

/// The same in an image that has been averaged over `bins` pixels along each axis.
pub(crate) fn settle_in_bins(
    image: &Image,
    bins: usize,
    pair: &Matrix2<f64>,
    pitch: [f64; 2],
) -> Option<Settled> {
    settle_binned(image, bins, pair, pitch, &|_| true)
}

fn settle_binned(
    image: &Image,
    bins: usize,
    pair: &Matrix2<f64>,
    pitch: [f64; 2],
    wanted: &dyn Fn(&Matrix2<f64>) -> bool,
) -> Option<Settled> {
    let shortest = three(pair).map(|q| std::f64::consts::TAU / (q.amax() * bins as f64));
    let shortest = shortest.into_iter().fold(f64::INFINITY, f64::min);
    let more = ((shortest / BINS_PER_PERIOD) as usize).max(1);
    let bins = bins * more;
    let (pair, pitch) = (pair * bins as f64, pitch.map(|p| p * bins as f64));
    match more {
        1 => settle_bins(image, &pair, pitch, bins, wanted),
        _ => settle_bins(&image.binned(more), &pair, pitch, bins, wanted),
    }
}

/// The same in an image of bins, in pixels along each axis.
fn settle_bins(
    image: &Image,
    pair: &Matrix2<f64>,
    pitch: [f64; 2],
    bins: usize,
    wanted: &dyn Fn(&Matrix2<f64>) -> bool,
) -> Option<Settled> {
    let cells = Cells::new(image, pair, pitch)?;
    if cells.size.iter().any(|n| *n < 4) {
        return None;
    }
    let windows = Windows::new(&cells);
    let frame = Frame::new(&cells, image);
    let mut pair = *pair;
    let mut narrowest = 0;
    let mut settled = None;
    let mut before = f64::INFINITY;
    for _ in 0..MOST_ROUNDS {
        let waves = frame.waves(&pair);
        let seen = (narrowest..WIDTHS.len())
            .find_map(|i| Some((i, frame.look(&waves, windows.at(i), WIDTHS[i])?)));
        let (width, seen) = seen?;
        narrowest = width;
        let patch = patch(&cells, &seen.inside, &pair)?;
        let (step, turn) = slope(&cells, &seen, &patch.inside)?;
        settled = Some((waves, seen, pair));
        // A turn that grows does not end.
        if turn < STILL || turn > before {
            break;
        }
        before = turn;
        pair += step;
    }
    let (waves, mut seen, pair) = settled?;
    if !wanted(&(pair / bins as f64)) {
        return None;
    }
    seen.inside = without_tails(&frame, &waves, windows.at(narrowest), &seen);
    let inner = patch(&cells, &seen.inside, &pair)?;
    if inner.share < WHOLE && !is_broad(&cells, &inner.inside, LINE * seen.width) {
        return None;
    }
    Some(Settled {
        patch: inner.in_pixels(bins),
        image: image.clone(),
        cells,
        seen,
        inner,
        bins,
        displacement: None,
    })
}

/// The windows of [`WIDTHS`] at some cells, each made when it is first looked through: mostly the narrowest will do.
struct Windows<'a> {
    cells: &'a Cells,
    made: [OnceCell<Window>; WIDTHS.len()],
}

impl<'a> Windows<'a> {
    fn new(cells: &'a Cells) -> Self {
        let made = Default::default();
        Self { cells, made }
    }

    fn at(&self, i: usize) -> &Window {
        self.made[i].get_or_init(|| self.cells.window(WIDTHS[i]))
    }
}

/// The patch of the cells that show the waves of a pair; `None` where they are too few.
fn patch(cells: &Cells, inside: &[bool], pair: &Matrix2<f64>) -> Option<LatticeRegion> {
    let mut inside = shrunk(cells, &tidy(cells, inside, pair));
    for (inside, count) in inside.iter_mut().zip(cells.counts()) {
        *inside &= *count > 0.0;
    }
    let unit_cells = area(cells, &inside, pair);
    if unit_cells < FEWEST_CELLS {
        return None;
    }
    let there = inside.iter().zip(cells.counts()).filter(|(i, _)| **i);
    let share = there.map(|(_, n)| n).sum::<f64>() / cells.counts().iter().sum::<f64>();
    Some(LatticeRegion {
        // That of the envelopes.
        pair: *pair,
        size: cells.size,
        pixels: cells.pixels,
        inside,
        share,
        unit_cells,
    })
}

/// A patch and what was seen of it.
pub(crate) struct Settled {
    /// In bins.
    image: Image,
    cells: Cells,
    seen: Seen,
    /// The patch in bins.
    inner: LatticeRegion,
    /// Pixels of a bin along each axis.
    bins: usize,
    /// The patch in pixels.
    pub(crate) patch: LatticeRegion,
    /// How far from its own place each bin is on a straight grid, bins; `None` of a straight scanner.
    displacement: Option<Departure>,
}

impl Settled {
    /// The same of an image with this geometry of its pixels.
    pub(crate) fn on(mut self, geometry: &Geometry) -> Self {
        self.displacement = geometry.in_bins(self.bins).displacement();
        self
    }

    fn view(&self) -> View<'_> {
        View {
            image: &self.image,
            cells: &self.cells,
            width: self.seen.width,
            noise: self.seen.noise,
            signal_to_noise: self.seen.signal_to_noise(&self.cells, &self.inner),
            displacement: self.displacement.as_ref(),
        }
    }

    /// Whether its waves are plain to see everywhere in it, whatever their phases do.
    pub(crate) fn is_plain(&self) -> bool {
        self.seen.is_plain()
    }

    /// Whether its phases are those of a lattice that is the same everywhere.
    pub(crate) fn is_straight(&self) -> bool {
        let mean = self.mean();
        mean.is_some_and(|mean| mean.change.is_none() && !mean.is_poor())
    }

    /// Power over noise of its waves in one resolution cell, in sum.
    pub(crate) fn evidence(&self) -> f64 {
        self.seen.evidence(&self.cells, &self.inner)
    }

    /// Two grains where it is no single lattice.
    pub(crate) fn grains(&self) -> Option<Grains> {
        let Grains {
            patches,
            shares,
            boundary,
        } = split(&self.view(), &self.inner)?;
        Some(Grains {
            patches: patches.map(|grain| grain.in_pixels(self.bins)),
            shares,
            boundary: boundary.map(|length| length * self.bins as f64),
        })
    }

    /// The mean of its lattice; `None` where its phases cannot be described.
    pub(crate) fn mean(&self) -> Option<Mean> {
        Some(mean(&self.view(), &self.inner)?.in_pixels(self.bins))
    }

    /// The same without what higher harmonics put into the windows.
    pub(crate) fn refined(&self) -> Option<Mean> {
        Some(refined(&self.view(), &self.inner)?.in_pixels(self.bins))
    }

    /// The same for a lattice that is known to change.
    pub(crate) fn refined_change(&self) -> Option<Mean> {
        Some(refined_change(&self.view(), &self.inner)?.in_pixels(self.bins))
    }
}

/// By how much the phases of the envelopes say that the pair is off, and by how many cycles that turns them over the
/// patch.
fn slope(cells: &Cells, seen: &Seen, inside: &[bool]) -> Option<(Matrix2<f64>, f64)> {
    let extent = extent(cells, inside);
    let along = |envelope: &[Complex64], axis: usize| {
        let window = (seen.width * cells.period[axis] / cells.pixels[axis] as f64).ceil() as usize;
        let mut step = 0.0;
        // Far enough apart that noise is not the same, and as far as the patch allows once that is small.
        let mut lag = window.max(1);
        for _ in 0..3 {
            let apart = (lag * cells.pixels[axis]) as f64;
            let by = if axis == 0 { [lag, 0] } else { [0, lag] };
            let sum = turned(cells.size, envelope, inside, by) * Complex64::cis(-step * apart);
            if sum.norm() > 0.0 {
                step += sum.arg() / apart;
            }
            lag = (2 * lag).min((extent[axis] / 2).max(window)).max(1);
        }
        step
    };
    let steps = (0..6).into_par_iter();
    let steps = steps.map(|i| along(&seen.envelopes[i / 2], i % 2));
    let steps: Vec<f64> = steps.collect();
    let steps = [0, 2, 4].map(|i| Vector2::new(steps[i], steps[i + 1]));
    // K₁, K₂ by least squares with K₃ = K₂ − K₁.
    let w = seen.weights;
    let normal = Matrix2::new(w[0] + w[2], -w[2], -w[2], w[1] + w[2]);
    let inverse = normal.try_inverse()?;
    let right = Matrix2::from_columns(&[
        steps[0] * w[0] - steps[2] * w[2],
        steps[1] * w[1] + steps[2] * w[2],
    ]);
    let step = right * inverse.transpose();
    let size = Vector2::new(
        (extent[0] * cells.pixels[0]) as f64,
        (extent[1] * cells.pixels[1]) as f64,
    );
    let turn = three(&step)
        .iter()
        .map(|q| q.component_mul(&size).abs().max())
        .fold(0.0, f64::max)
        / std::f64::consts::TAU;
    step.iter().all(|s| s.is_finite()).then_some((step, turn))
}

/// `Σ a* b` over the cells `a` of a patch and those `b` that lie a number of columns and rows beyond.
fn turned(
    [across, up]: [usize; 2],
    envelope: &[Complex64],
    inside: &[bool],
    [w, h]: [usize; 2],
) -> Complex64 {
    let mut sum = Complex64::default();
    for y in 0..up.saturating_sub(h) {
        for a in y * across..y * across + across.saturating_sub(w) {
            let b = a + h * across + w;
            if inside[a] && inside[b] {
                sum += envelope[a].conj() * envelope[b];
            }
        }
    }
    sum
}

/// Cells from the first to the last of the patch, along columns and rows.
fn extent(cells: &Cells, inside: &[bool]) -> [usize; 2] {
    let (mut low, mut high) = ([usize::MAX; 2], [0; 2]);
    for i in (0..inside.len()).filter(|&i| inside[i]) {
        for (axis, at) in [i % cells.size[0], i / cells.size[0]]
            .into_iter()
            .enumerate()
        {
            low[axis] = low[axis].min(at);
            high[axis] = high[axis].max(at);
        }
    }
    [0, 1].map(|axis| (high[axis] + 1).saturating_sub(low[axis]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::image::Image;

    /// Cells of a lattice of `period` pixels in a frame of 240 × 200, and those of them near which `holds` is true.
    fn cells(
        period: f64,
        holds: impl Fn(Vector2<f64>) -> bool,
    ) -> (Cells, Matrix2<f64>, Vec<bool>) {
        let g = std::f64::consts::TAU / (period * 0.75f64.sqrt());
        let pair = Matrix2::new(g, g / 2.0, 0.0, g * 0.75f64.sqrt());
        let image = Image::new(200, 240, vec![0.0; 240 * 200]);
        let cells = Cells::new(&image, &pair, [1.0, 1.0]).unwrap();
        let inside = (0..cells.len())
            .map(|i| holds(cells.middle_of(i)))
            .collect();
        (cells, pair, inside)
    }

    /// A window sees a line over √(8 ln 2) of its widths, wherever the line runs: this is no patch. The smallest round patch is one.
    #[test]
    fn what_a_window_makes_of_a_line_is_no_patch() {
        let period = 16.0;
        for (degrees, width) in [0.0f64, 17.0, 56.0, 90.0, 131.0]
            .into_iter()
            .flat_map(|a| WIDTHS.map(|w| (a, w)))
        {
            let across = Vector2::new(-degrees.to_radians().sin(), degrees.to_radians().cos());
            let seen = |at: Vector2<f64>| {
                let far = across.dot(&(at - Vector2::new(120.0, 100.0)));
                (-0.5 * (far / (width * period)).powi(2)).exp() > 0.5
            };
            let (cells, pair, inside) = cells(period, seen);
            let Some(patch) = patch(&cells, &inside, &pair) else {
                continue;
            };
            assert!(
                !is_broad(&cells, &patch.inside, LINE * width),
                "{degrees}° {width}"
            );
        }
        let cell = period * period * 0.75f64.sqrt();
        let radius = (1.3 * FEWEST_CELLS * cell / std::f64::consts::PI).sqrt() + period / 4.0;
        let round = |at: Vector2<f64>| (at - Vector2::new(120.0, 100.0)).norm() < radius;
        let (cells, pair, inside) = cells(period, round);
        let patch = patch(&cells, &inside, &pair).expect("cells enough");
        assert!(is_broad(&cells, &patch.inside, LINE * WIDTHS[0]));
    }
}
