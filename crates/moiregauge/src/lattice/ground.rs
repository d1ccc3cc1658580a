//! A lattice that is hidden by what is stronger than its waves: spikes, steps, bumps, slopes, line offsets, a tip whose contrast turns around.
//!
//! The ground is a running median, which follows a step without spreading it. How wide its window has to be only the lattice would tell, so
//! that several are tried; what a window that the frame cuts off sees of the lattice bends the waves at the edges a little. That serves for
//! a start: once a lattice is fitted, it is taken off, and the ground of what is left knows nothing of it.

use std::f64::consts::TAU;
use std::sync::Arc;

use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;

use crate::coverage::find::same;
use crate::coverage::patch::LatticeRegion;
use crate::frame::artefacts::{signs, turned, without_line_offsets, without_spikes};
use crate::frame::background::Background;
use crate::frame::clip::cut_off;
use crate::frame::geometry::Geometry;
use crate::frame::image::{Image, without};
use crate::frame::median_ground::running_median;
use crate::lattice::fit::fitted::LatticeFit;
use crate::lattice::measured::MeasuredLattice;
use crate::lattice::predicted::accepted;
use crate::lattice::start::{Start, measure_pair};
use crate::numbers::interrupt;
use crate::numbers::three::three;
use crate::spectrum::method::Method;

/// Sides of the windows that are tried, as shares of the shorter side of the frame: one to three periods of most lattices that hide.
const SHARES: [f64; 2] = [0.3, 0.15];
/// The smallest window, pixels: two periods that are sampled well.
const SMALLEST: f64 = 12.0;
/// The window of the ground below a known lattice, in periods: a hidden first shell, longer by √3, is left.
const PERIODS: f64 = 2.0;
/// The widest window, as a share of the shorter side of the frame. A lattice of fewer than four periods is wider: its ground is not taken off.
const WIDEST: f64 = 0.5;
/// Rounds of lattice and ground: the second changes the waves by less than a tenth of their errors.
const ROUNDS: usize = 2;

/// The lattice of an image without its background, if it shows one beside spikes, ground and line offsets that are taken off. `find`: the lattice of an
/// even image, by the side of the window, pixels.
pub(crate) fn below(
    image: &Image,
    geometry: &Geometry,
    background: Background,
    find: &dyn Fn(&Arc<Image>, f64) -> Option<MeasuredLattice>,
) -> Option<MeasuredLattice> {
    let shorter = image.columns.min(image.rows) as f64;
    let calm = without_spikes(image);
    let level = without_line_offsets(&calm);
    let sides = SHARES.map(|share| share * shorter).into_iter();
    let sides = sides.filter(|side| *side >= SMALLEST);
    let mut tries = sides.flat_map(|side| [(&calm, side), (&level, side)]);
    tries.find_map(|(calm, side)| {
        interrupt::check();
        let even = cut_off(&without(calm, &running_median(calm, side as usize)));
        let signs = signs(&even);
        let mut found = find(&Arc::new(turned(&even, &signs)), side)?;
        found.ground = Some(side);
        // A fit to the pixels knows neither grains nor the mean of a lattice that changes.
        let plain = found.change.is_none() && found.grains.is_empty();
        let again = || on_even_ground(calm, &signs, &found, geometry, background);
        let fine = plain.then(again).flatten();
        accepted(fine.unwrap_or(found), geometry).ok()
    })
}

/// A lattice that was measured before, measured anew in an image without the ground below it.
fn on_even_ground(
    image: &Image,
    signs: &[f64],
    before: &MeasuredLattice,
    geometry: &Geometry,
    background: Background,
) -> Option<MeasuredLattice> {
    let size = [image.columns, image.rows];
    let mut found = before.clone();
    for _ in 0..ROUNDS {
        let waves = found.fit.as_ref()?.wave_vectors.basis;
        let part = found.patch.as_ref();
        let side = window(&waves);
        let is_told = side as f64 <= WIDEST * size[0].min(size[1]) as f64;
        let even = if is_told {
            evened(image, signs, found.fit.as_ref()?, part)
        } else {
            turned(image, signs)
        };
        let mut again = measure_pair(&waves, part, &even, geometry, background, Method::Lattice)?;
        if !same(size, &again.reciprocal, &waves) {
            return None;
        }
        again.ground = is_told.then_some(side as f64);
        again.evidence.clone_from(&before.evidence);
        again.larger = before.larger;
        found = again;
    }
    Some(found)
}

/// The image without the ground below a lattice (rad per pixel) that it shows; `None` where that lattice cannot be fitted.
pub(crate) fn even_image(
    image: &Image,
    pair: &Matrix2<f64>,
    geometry: &Geometry,
    background: Background,
) -> Option<Image> {
    let even = without(image, &running_median(image, window(pair)));
    let start = Start::at(&even, geometry, background, pair)?;
    let found = start.measure(Method::Lattice).ok()?;
    let signs = vec![1.0; image.rows];
    let found = on_even_ground(image, &signs, &found, geometry, background)?;
    let fit = found.ground.and(found.fit)?;
    Some(evened(image, &signs, &fit, None))
}

/// The image without the running median of what the fitted lattice leaves. `part`: where the lattice is.
fn evened(image: &Image, signs: &[f64], fit: &LatticeFit, part: Option<&LatticeRegion>) -> Image {
    let lattice = turned(&picture(fit, [image.columns, image.rows], part), signs);
    let side = window(&fit.wave_vectors.basis);
    let ground = running_median(&without(image, &lattice), side);
    turned(&without(image, &ground), signs)
}

/// A window in periods of the longest of three waves, pixels.
fn window(pair: &Matrix2<f64>) -> usize {
    let longest = three(pair).map(|q| TAU / q.norm());
    (PERIODS * longest.into_iter().fold(0.0, f64::max)).ceil() as usize
}

/// The fitted lattice at the pixels of a frame of `size` (columns, rows).
fn picture(fit: &LatticeFit, [columns, rows]: [usize; 2], part: Option<&LatticeRegion>) -> Image {
    let mut values = vec![0.0; columns * rows];
    let lines = values.par_chunks_mut(columns).enumerate();
    lines.for_each(|(row, line)| {
        for harmonic in &fit.harmonics {
            let [h, k] = harmonic.index.map(f64::from);
            let q = fit.wave_vectors.basis * Vector2::new(h, k);
            let is_inside = |column: usize| part.is_none_or(|part| part.holds([column, row]));
            let line = line.iter_mut().enumerate();
            for (column, value) in line.filter(|(column, _)| is_inside(*column)) {
                let at = Vector2::new(column as f64, row as f64) - fit.centre;
                *value += harmonic.amplitude * (q.dot(&at) + harmonic.phase).cos();
            }
        }
    });
    Image::new(rows, columns, values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::find::measure;
    use crate::numbers::rng::normals;
    use crate::numbers::spread::mean_and_spread;

    /// (columns, rows)
    const SIZE: [usize; 2] = [176, 144];
    const SEEDS: u64 = 10;

    /// Waves of 26 to 29 pixels: five periods across the frame.
    fn pair(seed: u64) -> Matrix2<f64> {
        let (sin, cos) = (0.37 * seed as f64).sin_cos();
        Matrix2::new(cos, -sin, sin, cos) * Matrix2::new(0.25, 0.115, -0.01, 0.21)
    }

    /// A lattice of waves of this amplitude, a step, a bump and noise.
    fn image(seed: u64, amplitude: f64) -> Image {
        let mut normal = normals(seed, "ground", 0);
        let turn = 0.9 * seed as f64;
        let (sin, cos) = turn.sin_cos();
        let value = |i: usize| {
            let at = Vector2::new((i % SIZE[0]) as f64, (i / SIZE[0]) as f64);
            let [a, b] = [0, 1].map(|j| pair(seed).column(j).dot(&at));
            let lattice = amplitude * (a.cos() + b.cos() + (b - a).cos());
            let off = at - Vector2::new(80.0, 70.0);
            let step = 4.0 * (0.5 * (cos * off.x + sin * off.y)).tanh();
            let beside = (off - 45.0 * Vector2::new(-sin, cos)).norm() / 18.0;
            let bump = 8.0 * (1.0 - beside * beside).max(0.0);
            lattice + step + bump + 0.3 * normal()
        };
        Image::new(
            SIZE[1],
            SIZE[0],
            (0..SIZE[0] * SIZE[1]).map(value).collect(),
        )
    }

    fn measured(image: &Image) -> Option<MeasuredLattice> {
        let geometry = Geometry::of_pitch(SIZE, [0.25, 0.25], 0.0, Vector2::zeros()).unwrap();
        measure(image, &geometry, Background::Plane, Method::Lattice).ok()
    }

    /// Of a step and a bump of eight times the amplitude of a wave less than a third is left, noise included: the bump is smaller than the window.
    #[test]
    fn an_even_image_is_the_lattice() {
        let geometry = Geometry::of_pitch(SIZE, [0.25, 0.25], 0.0, Vector2::zeros()).unwrap();
        for seed in 0..SEEDS {
            let image = image(seed, 1.0);
            let lattice = |i: usize| {
                let at = Vector2::new((i % SIZE[0]) as f64, (i / SIZE[0]) as f64);
                let [a, b] = [0, 1].map(|j| pair(seed).column(j).dot(&at));
                a.cos() + b.cos() + (b - a).cos()
            };
            let even = even_image(&image, &pair(seed), &geometry, Background::Plane).unwrap();
            let left = |image: &Image| {
                let rest = image.values.iter().enumerate().map(|(i, v)| v - lattice(i));
                mean_and_spread(&rest.collect::<Vec<f64>>()).sigma
            };
            let [before, after] = [left(&image), left(&even)];
            assert!(after < before / 3.0, "seed {seed}: {before}, {after}");
        }
    }

    /// Steps and bumps of many times its amplitude do not move the waves of a lattice by more than the errors say.
    #[test]
    fn a_lattice_is_found_below_steps_and_bumps() {
        let (mut sum, mut answered) = (0.0, 0);
        for seed in 0..SEEDS {
            let Some(found) = measured(&image(seed, 1.0)) else {
                continue;
            };
            let names = pair(seed).try_inverse().unwrap() * found.reciprocal;
            let whole = names.map(f64::round);
            assert_eq!(whole.determinant().abs(), 1.0, "{seed}: {names}");
            let off = (names - whole).norm();
            assert!(off < 0.02, "{seed}: {off}");
            let fit = found.fit.unwrap();
            let error = fit.wave_vectors.basis - pair(seed) * whole;
            sum += error.norm_squared() / fit.wave_vectors.covariance.trace();
            answered += 1;
        }
        assert!(10 * answered >= 9 * SEEDS, "{answered}");
        let pull = (sum / answered as f64).sqrt();
        assert!((0.4..1.6).contains(&pull), "{pull}");
    }

    /// Spikes in one pixel of a hundred, offsets of lines, a tip that inverts the contrast: the waves are right. The line where the contrast turns around
    /// is found to within one, and where it does not no sign changes.
    #[test]
    fn artefacts_of_the_tip_move_no_wave() {
        let line = 80;
        let even = |made: &Image| cut_off(&without(made, &running_median(made, 43)));
        let (mut sum, mut answered) = (0.0, 0);
        for (seed, kind) in (0..SEEDS).flat_map(|seed| (0..3).map(move |kind| (seed, kind))) {
            let mut normal = normals(seed, "tip", kind);
            let mut made = image(seed, 1.0);
            for row in made.values.chunks_mut(SIZE[0]).filter(|_| kind == 0) {
                let offset = 3.0 * normal();
                for value in row {
                    *value += offset;
                }
            }
            for value in made.values.iter_mut().filter(|_| kind == 1) {
                *value += if normal() > 2.3 { 60.0 } else { 0.0 };
            }
            if kind == 2 {
                assert!(!signs(&even(&made)).contains(&-1.0), "{seed}");
                let above = made.values[line * SIZE[0]..].iter_mut();
                above.for_each(|value| *value = 4.0 - *value);
                let found = signs(&even(&made));
                let turned = found.iter().position(|sign| *sign < 0.0).unwrap();
                assert!(turned.abs_diff(line) <= 1, "{seed}: {turned}");
                assert!(found[turned..].iter().all(|sign| *sign < 0.0), "{seed}");
            }
            let Some(found) = measured(&made) else {
                continue;
            };
            let names = pair(seed).try_inverse().unwrap() * found.reciprocal;
            let whole = names.map(f64::round);
            assert_eq!(whole.determinant().abs(), 1.0, "{seed} {kind}: {names}");
            let fit = found.fit.unwrap();
            let error = fit.wave_vectors.basis - pair(seed) * whole;
            sum += error.norm_squared() / fit.wave_vectors.covariance.trace();
            answered += 1;
        }
        assert!(10 * answered >= 9 * 3 * SEEDS, "{answered}");
        let pull = (sum / answered as f64).sqrt();
        assert!((0.4..1.6).contains(&pull), "{pull}");
    }

    /// A window of a lattice of fewer than four periods is wider than half of the frame: none is taken off, and the waves are those of the lattice.
    #[test]
    fn few_periods_keep_their_ground() {
        let geometry = Geometry::of_pitch(SIZE, [0.25, 0.25], 0.0, Vector2::zeros()).unwrap();
        let background = Background::Plane;
        for (stretch, is_taken) in [(1.0, true), (0.55, false)] {
            let waves = stretch * pair(0);
            let mut normal = normals(3, "few", 0);
            let value = |i: usize| {
                let at = Vector2::new((i % SIZE[0]) as f64, (i / SIZE[0]) as f64);
                three(&waves).map(|q| q.dot(&at).cos()).iter().sum::<f64>() + 0.3 * normal()
            };
            let image = Image::new(
                SIZE[1],
                SIZE[0],
                (0..SIZE[0] * SIZE[1]).map(value).collect(),
            );
            let start = Start::at(&image, &geometry, background, &waves).unwrap();
            let found = start.measure(Method::Lattice).unwrap();
            let signs = vec![1.0; SIZE[1]];
            let found = on_even_ground(&image, &signs, &found, &geometry, background).unwrap();
            assert_eq!(found.ground.is_some(), is_taken, "{stretch}");
            let fit = found.fit.unwrap();
            let names = (waves.try_inverse().unwrap() * fit.wave_vectors.basis).map(f64::round);
            let error = fit.wave_vectors.basis - waves * names;
            let pull = (error.norm_squared() / fit.wave_vectors.covariance.trace()).sqrt();
            assert!(pull < 2.5, "{stretch}: {pull}");
        }
    }

    /// What is taken off makes no lattice of steps, bumps and noise.
    #[test]
    fn ground_alone_is_no_lattice() {
        for seed in 0..SEEDS {
            assert!(measured(&image(seed, 0.0)).is_none(), "{seed}");
        }
    }
}
