//! An image → places of its nodes with covariances.
//!
//! The image is binned to some 40 pixels per period and smoothed at the size of a node less the size of a cell;
//! peaks of that are candidates. The mean image about the best of them is the template; every node is where it
//! fits best (least squares), twice over. Errors: residuals in each node's own patch, correlated as
//! residuals of neighbours are on average.

use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;

use crate::domains::patch::{Fit, Template};
use crate::frame::blur::blurred;
use crate::frame::image::Image;
use crate::numbers::interrupt;
use crate::numbers::median::median;
use crate::numbers::three::three;

/// Bins per period: a node of a tenth of a period is four bins wide, which an interpolation follows.
const FINE: f64 = 40.0;
/// Widths of the Gaussians of the search in periods: that of a sharp node, ...
const NODE: f64 = 0.1;
/// ... and one that leaves 4 % of the first harmonics, for the background.
const CELL: f64 = 0.35;
/// The smallest distance of candidates, periods: well below that of nodes. Chosen by eye.
const APART: f64 = 0.45;
/// Radius of the fitted patch, periods: less than half of the way to the next node, whose slope would pull. On the scenes of docs/constants.md half
/// and double change results by at most 0.64 σ.
const RADIUS: f64 = 0.36;
/// Height of a candidate or node over the typical one below which it is rejected. On the scenes of docs/constants.md half and double change results
/// by at most 0.36 σ.
const WEAK: f64 = 0.4;
/// Nodes stand out of their noise by this: below, places jump to peaks of the noise. See docs/constants.md.
const CLEAR: f64 = 7.0;
/// What noise in the curvature of a node adds to the variance of its place, over the squared signal to noise: to second
/// order `3 (var X_xx + var X_xy)` with X the noise of the curvature over the curvature, 3/S² and 1/S² for a Gaussian.
const CURVATURE: f64 = 12.0;
/// So much of a patch has to lie in the frame: with less the cut node is fitted by its flank. On the scenes of docs/constants.md half and double
/// change results by at most 0.04 σ.
const SHARE: f64 = 0.8;
/// Below this skewness the image does not tell whether nodes are bright or dark. Half and twice as much change no
/// result of docs/constants.md.
const TELLING: f64 = 0.2;
/// Residual means of lines beyond this multiple of white noise are offsets of lines. On the scenes of docs/constants.md half and double change
/// results by at most 0.1 σ.
const LINES: f64 = 2.0;

/// How nodes look.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Contrast {
    /// The rarer extreme: bright where the image has a tail of bright values.
    #[default]
    Auto,
    /// Higher than their surroundings.
    Bright,
    /// Lower.
    Dark,
}

/// A node in the image.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct FoundNode {
    /// Where (column, row), pixels.
    pub place: Vector2<f64>,
    /// Covariance of the place, pixels².
    pub covariance: Matrix2<f64>,
    /// Height against the mean node.
    pub amplitude: f64,
}

/// The nodes of an image. All places share one offset, that of the mean node: edges do not know it.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct FoundNodes {
    /// From the bottom to the top, from left to right.
    pub nodes: Vec<FoundNode>,
    /// `Bright` or `Dark`, as given or as found.
    pub contrast: Contrast,
    /// Skewness of the smoothed image: positive for bright nodes.
    pub skewness: f64,
    /// Whether the image tells the contrast by itself.
    pub contrast_is_clear: bool,
    /// Whether lines have offsets of their own.
    pub line_offsets: bool,
}

/// Finds the nodes of an image without background. `lattice`: two primitive vectors as columns, pixels;
/// `pitch`: size of a pixel along columns and rows, nm. `None` where there are fewer than seven.
pub fn find_nodes(
    image: &Image,
    lattice: &Matrix2<f64>,
    pitch: [f64; 2],
    contrast: Contrast,
) -> Option<FoundNodes> {
    let metric = Matrix2::new(pitch[0], 0.0, 0.0, pitch[1]);
    let lengths = three(&(metric * lattice)).map(|vector| vector.norm());
    let period = lengths.iter().sum::<f64>() / 3.0;
    let in_pixels = pitch.map(|p| period / p);
    if !in_pixels.iter().all(|p| p.is_finite() && *p > 4.0) {
        return None;
    }
    let bin = (in_pixels[0].min(in_pixels[1]) / FINE).floor().max(1.0);
    let binned = image.binned(bin as usize);
    let period = in_pixels.map(|p| p / bin);
    let band = band(&binned, period);
    let skewness = skewness(&band.values);
    let bright = match contrast {
        Contrast::Auto => skewness >= 0.0,
        Contrast::Bright => true,
        Contrast::Dark => false,
    };
    let sign = if bright { 1.0 } else { -1.0 };
    let cell = (lattice.determinant() / (bin * bin)).abs();
    let expected = (binned.values.len() as f64 / cell).max(1.0);
    let starts = peaks(&band, sign, period, expected as usize);
    let radius = period.map(|p| RADIUS * p);
    let (fits, line_offsets) = refined(&binned, &starts, radius)?;
    let inflation = inflation(&fits);
    let kept = believable(fits, period, inflation);
    if kept.len() < 7 {
        return None;
    }
    // Each node is 1/N of the template that it is fitted to.
    let inflation = inflation * (1.0 + 1.0 / kept.len() as f64);
    let mut nodes: Vec<FoundNode> = kept.iter().map(|f| f.found(inflation, bin)).collect();
    let order = |n: &FoundNode| [n.place.y, n.place.x];
    nodes.sort_by(|a, b| {
        order(a)
            .partial_cmp(&order(b))
            .unwrap_or(std::cmp::Ordering::Equal)
    });
    Some(FoundNodes {
        nodes,
        contrast: if bright {
            Contrast::Bright
        } else {
            Contrast::Dark
        },
        skewness,
        contrast_is_clear: skewness.abs() > TELLING,
        line_offsets,
    })
}

/// What is as large as nodes and smaller than cells; `period` in pixels.
fn band(image: &Image, period: [f64; 2]) -> Image {
    let smooth = |share: f64| blurred(image, period.map(|p| share * p));
    let (fine, coarse) = (smooth(NODE), smooth(CELL));
    let values = fine.iter().zip(coarse).map(|(a, b)| a - b);
    Image::new(image.rows, image.columns, values.collect())
}

impl Fit {
    /// The node in the image, whose pixels were binned by `bin`.
    fn found(&self, inflation: f64, bin: f64) -> FoundNode {
        let noise = self.variance * inflation;
        let weak = CURVATURE * self.inverse[(0, 0)] * noise / self.amplitude.powi(2);
        let covariance = self.inverse.fixed_view::<2, 2>(1, 1) * (noise * (1.0 + weak));
        FoundNode {
            place: self.place * bin + Vector2::repeat((bin - 1.0) / 2.0),
            covariance: covariance * (bin * bin),
            amplitude: self.amplitude,
        }
    }
}

/// Fits all nodes to their mean, three times, the mean being made anew of what was found.
fn refined(image: &Image, starts: &[Vector2<f64>], radius: [f64; 2]) -> Option<(Vec<Fit>, bool)> {
    let mut places = starts.to_vec();
    let mut lines = false;
    let mut fits = Vec::new();
    for round in 0..3 {
        let mut template = Template::mean(image, &places, radius)?;
        template.lines = lines;
        let found: Vec<Option<Fit>> = starts
            .par_iter()
            .map(|start| {
                interrupt::check();
                template.fit(image, *start)
            })
            .collect();
        fits = found.into_iter().flatten().collect();
        if round == 0 {
            let mut excess: Vec<f64> = fits.iter().map(|f| f.line_excess).collect();
            lines = median(&mut excess) > LINES;
        }
        let mut heights: Vec<f64> = fits.iter().map(|f| f.amplitude).collect();
        let usual = median(&mut heights);
        let good = fits
            .iter()
            .filter(|f| f.share > 0.99 && f.amplitude > 0.7 * usual);
        places = good.map(|f| f.place).collect();
    }
    Some((fits, lines))
}

/// Nodes that stand out, lie within the frame and are no other's double.
fn believable(fits: Vec<Fit>, period: [f64; 2], inflation: f64) -> Vec<Fit> {
    let mut heights: Vec<f64> = fits.iter().map(|f| f.amplitude).collect();
    let usual = median(&mut heights);
    let mut kept: Vec<Fit> = Vec::new();
    for fit in fits {
        let sigma = (fit.inverse[(0, 0)] * fit.variance * inflation).sqrt();
        let clear = fit.amplitude > WEAK * usual && fit.amplitude > CLEAR * sigma;
        let near = |other: &Fit| distance(other.place - fit.place, period) < APART;
        if clear && fit.share >= SHARE && !kept.iter().any(near) {
            kept.push(fit);
        }
    }
    kept
}

/// By how much correlated noise enlarges variances: `Π (1 + ρ)/(1 − ρ)` along both axes, ρ of neighbours.
fn inflation(fits: &[Fit]) -> f64 {
    let along = |axis: usize| {
        let mut all: Vec<f64> = fits.iter().map(|f| f.correlation[axis]).collect();
        let rho = median(&mut all).clamp(0.0, 0.9);
        (1.0 + rho) / (1.0 - rho)
    };
    along(0) * along(1)
}

fn distance(way: Vector2<f64>, period: [f64; 2]) -> f64 {
    (way.x / period[0]).hypot(way.y / period[1])
}

/// Local maxima, highest first, none within [`APART`] of a higher one, and none far below the usual one.
fn peaks(band: &Image, sign: f64, period: [f64; 2], expected: usize) -> Vec<Vector2<f64>> {
    let (columns, rows) = (band.columns, band.rows);
    let value = |column: usize, row: usize| sign * band.values[row * columns + column];
    let mut all: Vec<(f64, Vector2<f64>)> = Vec::new();
    for row in 1..rows.saturating_sub(1) {
        for column in 1..columns.saturating_sub(1) {
            let here = value(column, row);
            let higher = (0..9).filter(|i| *i != 4).all(|i| {
                let other = value(column + i % 3 - 1, row + i / 3 - 1);
                if i < 4 { here > other } else { here >= other }
            });
            if higher && here > 0.0 {
                let bend = |a: f64, b: f64| {
                    let curvature = a + b - 2.0 * here;
                    if curvature < 0.0 {
                        (0.5 * (a - b) / curvature).clamp(-0.5, 0.5)
                    } else {
                        0.0
                    }
                };
                let x = bend(value(column - 1, row), value(column + 1, row));
                let y = bend(value(column, row - 1), value(column, row + 1));
                all.push((here, Vector2::new(column as f64 + x, row as f64 + y)));
            }
        }
    }
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut kept: Vec<(f64, Vector2<f64>)> = Vec::new();
    // Squares of the size of the smallest distance, so that only neighbours are compared.
    let mut squares = std::collections::HashMap::<[i64; 2], Vec<Vector2<f64>>>::new();
    for (height, place) in all {
        let square = [0, 1].map(|i| (place[i] / (APART * period[i])).floor() as i64);
        let crowded = (0..9).any(|i| {
            let key = [square[0] + i % 3 - 1, square[1] + i / 3 - 1];
            squares.get(&key).is_some_and(|there| {
                there
                    .iter()
                    .any(|other| distance(other - place, period) < APART)
            })
        });
        if !crowded {
            squares.entry(square).or_default().push(place);
            kept.push((height, place));
        }
    }
    let usual = kept.get(kept.len().min(expected) / 2).map_or(0.0, |k| k.0);
    kept.retain(|k| k.0 > WEAK * usual);
    kept.truncate(4 * expected + 16);
    kept.into_iter().map(|k| k.1).collect()
}

fn skewness(values: &[f64]) -> f64 {
    let count = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / count;
    let power = |n: i32| values.iter().map(|v| (v - mean).powi(n)).sum::<f64>() / count;
    let variance = power(2);
    if variance > 0.0 {
        power(3) / variance.powf(1.5)
    } else {
        0.0
    }
}
