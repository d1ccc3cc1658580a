//! A lattice on ground that hides it: steps, bumps and slopes that are stronger than its waves.
//!
//! The ground is a running median, which follows a step without spreading it. How wide its window has to be only the lattice would tell, so
//! that several are tried; what a window that the frame cuts off sees of the lattice bends the waves at the edges a little. That serves for
//! a start: once a lattice is fitted, it is taken off, and the ground of what is left knows nothing of it.

use std::f64::consts::TAU;
use std::sync::Arc;

use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;

use crate::coverage::find::same;
use crate::frame::background::Background;
use crate::frame::clip::cut_off;
use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::frame::median_ground::running_median;
use crate::lattice::fit::fitted::LatticeFit;
use crate::lattice::measure::{SECOND_SHELL, hidden, is_hollow, of_first_shell};
use crate::lattice::measured::MeasuredLattice;
use crate::lattice::start::Start;
use crate::numbers::interrupt;
use crate::numbers::three::three;
use crate::spectrum::method::Method;

/// Sides of the windows that are tried, as shares of the shorter side of the frame: one to three periods of most lattices that hide.
const SHARES: [f64; 4] = [0.22, 0.14, 0.34, 0.08];
/// The smallest window, pixels: two periods that are sampled well.
const SMALLEST: f64 = 12.0;
/// The window of the ground below a known lattice, in periods: a hidden first shell, longer by √3, is left.
const PERIODS: f64 = 2.0;
/// Rounds of lattice and ground: the second changes the waves by less than a tenth of their errors.
const ROUNDS: usize = 2;

/// The lattice of an image without its background, if it shows one beside ground that is taken off. `find`: the lattice of an even image.
pub(crate) fn below(
    image: &Image,
    geometry: &Geometry,
    background: Background,
    find: &dyn Fn(&Arc<Image>) -> Option<MeasuredLattice>,
) -> Option<MeasuredLattice> {
    let shorter = image.columns.min(image.rows) as f64;
    let sides = SHARES.map(|share| share * shorter);
    let mut sides = sides.into_iter().filter(|side| *side >= SMALLEST);
    sides.find_map(|side| {
        interrupt::check();
        let even = without(image, &running_median(image, side as usize));
        let found = find(&Arc::new(cut_off(&even)))?;
        on_even_ground(image, found, geometry, background)
    })
}

/// A lattice measured anew in an image without the ground below it.
fn on_even_ground(
    image: &Image,
    mut found: MeasuredLattice,
    geometry: &Geometry,
    background: Background,
) -> Option<MeasuredLattice> {
    let size = [image.columns, image.rows];
    for _ in 0..ROUNDS {
        let fit = found.fit.as_ref()?;
        let waves = &fit.wave_vectors.basis;
        let rest = without(image, &picture(fit, size));
        let even = without(image, &running_median(&rest, window(waves)));
        let start = Start::at(&even, geometry, background, waves)?;
        let mut again = start.measure(Method::Lattice).ok()?;
        if hidden(&again).chance() < SECOND_SHELL {
            again = of_first_shell(&again, &even, geometry, background, Method::Lattice)?;
        } else if is_hollow(&again) || !same(size, &again.reciprocal, &found.reciprocal) {
            return None;
        }
        found = again;
    }
    Some(found)
}

/// A window of so many periods of the longest of three waves, pixels.
fn window(pair: &Matrix2<f64>) -> usize {
    let longest = three(pair).map(|q| TAU / q.norm());
    (PERIODS * longest.into_iter().fold(0.0, f64::max)).ceil() as usize
}

/// The fitted lattice at the pixels of a frame of `size` (columns, rows).
fn picture(fit: &LatticeFit, [columns, rows]: [usize; 2]) -> Image {
    let mut values = vec![0.0; columns * rows];
    let lines = values.par_chunks_mut(columns).enumerate();
    lines.for_each(|(row, line)| {
        for harmonic in &fit.harmonics {
            let [h, k] = harmonic.index.map(f64::from);
            let q = fit.wave_vectors.basis * Vector2::new(h, k);
            for (column, value) in line.iter_mut().enumerate() {
                let at = Vector2::new(column as f64, row as f64) - fit.centre;
                *value += harmonic.amplitude * (q.dot(&at) + harmonic.phase).cos();
            }
        }
    });
    Image::new(rows, columns, values)
}

fn without(image: &Image, other: &Image) -> Image {
    let both = image.values.iter().zip(&other.values);
    let values = both.map(|(value, other)| value - other);
    Image::new(image.rows, image.columns, values.collect())
}
