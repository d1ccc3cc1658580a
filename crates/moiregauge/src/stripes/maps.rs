//! Stripes: maps of patterns with one wave vector and its overtones.
//!
//! Herringbone reconstructions, one-dimensional moirés of heterostrain and domain walls have one wave vector in each
//! domain; twist and strain would need two. In: the trace and the retrace of one frame. Out: which patterns there are
//! and how sure that is, one wave with overtones fitted to the pixels of each, and local wave vectors on nodes with
//! covariance and mask (pixels). Each node belongs to the pattern that is strongest there.

use nalgebra::Vector2;

use crate::frame::image::Image;
use crate::stripes::find;
use crate::stripes::nodes::Work;
use crate::stripes::types::{NoStripes, StripeMap};
use crate::stripes::wave::{BLOCKS, Wave, reference};
use crate::window::blocks::{NODES, block_within, stride_of};
use crate::window::smooth::Nodes;
use crate::window::types::{Reference, Resolution};
use crate::window::widths::NARROWEST;

/// Waves nearer to each other than this share of the shorter one are one: 14° of direction, as in the search.
const SAME: f64 = 0.25;

/// The patterns of an image and of its other line direction, as wave vectors (rad per pixel) and log₁₀ of the chance
/// that noise makes them; none where there is nothing. Backgrounds are gone.
pub fn find_stripes(images: &[&Image], pitch: [f64; 2]) -> Vec<(Vector2<f64>, f64)> {
    let found = find::find(images, pitch).into_iter();
    found.map(|p| (p.wave, p.log_chance)).collect()
}

/// Maps the stripes of images of one frame (trace, retrace), backgrounds gone, on the same nodes. `pitch`: nm per
/// pixel along columns and rows.
///
/// # Errors
/// [`NoStripes`]: there are none, or a lattice.
pub fn stripe_maps(
    images: &[&Image],
    pitch: [f64; 2],
    resolution: &Resolution,
) -> Result<Vec<StripeMap>, NoStripes> {
    let found = find_stripes(images, pitch);
    if found.is_empty() {
        return Err(NoStripes::Nothing);
    }
    // Windows that a boundary cuts bear no beat: the second time with the mean wave, for what a boundary spreads about a
    // wave comes back to it.
    let mut means: Vec<(Vector2<f64>, f64)> = Vec::new();
    let (references, block) = references_of(&found, pitch);
    for (wave, pattern) in all_of(images[0], &references, block).iter().zip(found) {
        let mean = wave.mean();
        let known = |known: &(Vector2<f64>, f64)| is_harmonic(mean, known.0, pitch);
        if !means.iter().any(known) {
            means.push((mean, pattern.1));
        }
    }
    let found = means;
    let (references, block) = references_of(&found, pitch);
    let of = |image: &&Image| all_of(image, &references, block);
    let all_waves: Vec<Vec<Wave>> = images.iter().map(of).collect();
    let narrowest = references
        .iter()
        .map(|r| NARROWEST * r.period())
        .fold(0.0, f64::max);
    let window = match resolution.window_nm {
        Some(window) => window.max(narrowest),
        None => all_waves[0][0].choose_window().max(narrowest),
    };
    let sides = [images[0].columns, images[0].rows];
    let sides = [0, 1].map(|i| sides[i] as f64 * pitch[i]);
    // Nodes may be as near as blocks are; those of lattices are two pixels apart at least.
    let step = resolution.step_nm.unwrap_or(window / NODES);
    let stride = stride_of(&references[0], block, step);
    let mut maps = Vec::with_capacity(images.len());
    for (image, waves) in images.iter().zip(all_waves) {
        let mut work = Work {
            image,
            waves,
            window,
            nodes: Nodes::filling([image.columns / block[0], image.rows / block[1]], stride),
            margin: resolution.margin_of(window, sides),
        };
        maps.push(work.map(&found)?);
    }
    Ok(maps)
}

/// The references of patterns, and the pixels of a block for the shortest wave of them.
fn references_of(found: &[(Vector2<f64>, f64)], pitch: [f64; 2]) -> (Vec<Reference>, [usize; 2]) {
    let references: Vec<Reference> = found.iter().map(|p| reference(p.0, pitch)).collect();
    let wavelengths = references.iter().map(|r| 0.75f64.sqrt() * r.period());
    let shortest = wavelengths.fold(f64::INFINITY, f64::min);
    (references, block_within(shortest / BLOCKS, pitch))
}

/// Whether a wave is a harmonic of another, or that one of it.
fn is_harmonic(a: Vector2<f64>, b: Vector2<f64>, pitch: [f64; 2]) -> bool {
    let length = |v: Vector2<f64>| (v.x / pitch[0]).hypot(v.y / pitch[1]);
    let shorter = length(a).min(length(b));
    let is = |a: Vector2<f64>, b: Vector2<f64>| {
        (-4..=4).any(|n| n != 0 && length(a - b * f64::from(n)) < SAME * shorter)
    };
    is(a, b) || is(b, a)
}

/// The waves of all patterns in an image.
fn all_of(image: &Image, references: &[Reference], block: [usize; 2]) -> Vec<Wave> {
    let of = |i: usize| {
        let others = references.iter().enumerate().filter(|(j, _)| *j != i);
        let others: Vec<Vector2<f64>> = others.map(|(_, r)| r.wave([1, 0])).collect();
        Wave::new(image, references[i], &others, block)
    };
    (0..references.len()).map(of).collect()
}

#[cfg(test)]
mod tests;
