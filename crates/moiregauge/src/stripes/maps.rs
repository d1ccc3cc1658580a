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
use crate::window::smooth::Nodes;
use crate::window::types::{Reference, Resolution};

/// Nodes per width of the window: nearer ones tell the same.
const NODES: f64 = 3.0;
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
    let mut found = find_stripes(images, pitch);
    if found.is_empty() {
        return Err(NoStripes::Nothing);
    }
    let mut references: Vec<Reference> = found.iter().map(|p| reference(p.0, pitch)).collect();
    let (mut block, mut all_waves) = ([1; 2], Vec::new());
    // Windows that a boundary cuts bear no beat: the second time with the mean wave.
    for round in 0..2 {
        let shortest = references
            .iter()
            .map(|r| 0.75f64.sqrt() * r.period())
            .fold(f64::INFINITY, f64::min);
        block = pitch.map(|p| ((shortest / BLOCKS / p + 1e-9) as usize).max(1));
        let of = |image: &Image| -> Vec<Wave> { all_of(image, &references, block) };
        if round == 0 {
            // What a boundary spreads about a wave comes back to it.
            let mut means: Vec<Vector2<f64>> = Vec::new();
            for (wave, pattern) in of(images[0]).iter().zip(std::mem::take(&mut found)) {
                let mean = wave.mean();
                if !means.iter().any(|known| is_harmonic(mean, *known, pitch)) {
                    means.push(mean);
                    found.push((mean, pattern.1));
                }
            }
            references = means
                .into_iter()
                .map(|mean| reference(mean, pitch))
                .collect();
        } else {
            all_waves = images.iter().map(|image| of(image)).collect();
        }
    }
    let narrowest = references
        .iter()
        .map(|r| crate::window::widths::NARROWEST * r.period())
        .fold(0.0, f64::max);
    let window = match resolution.window_nm {
        Some(window) => window.max(narrowest),
        None => all_waves[0][0].choose_window().max(narrowest),
    };
    let sides = [images[0].columns, images[0].rows];
    let sides = [0, 1].map(|i| sides[i] as f64 * pitch[i]);
    let step = resolution.step_nm.unwrap_or(window / NODES);
    let stride = [0, 1].map(|i| ((step / pitch[i] / block[i] as f64).round() as usize).max(1));
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
