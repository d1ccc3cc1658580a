//! Offsets of whole lines, taken off before the image is demodulated.
//!
//! An offset per line is a ridge of noise at kx = 0. A narrow window reaches it: for a harmonic g and a window w the
//! slope along x takes up `gₓ² e^{−gₓ²w²}` of it, that across half of `e^{−gₓ²w²}/w²`. The offsets are read
//! off as means of the lines under a Hann window, which holds nothing of waves that turn often along a line. Harmonics that
//! hardly turn stand on the ridge: around their ky nothing is taken off, and what is left there is their noise.

use nalgebra::Vector2;
use rayon::prelude::*;
use rustfft::FftPlanner;
use rustfft::num_complex::Complex64;

use crate::frame::image::Image;
use crate::numbers::interrupt;
use crate::numbers::median::median;
use crate::spectrum::hann::hann;
use crate::spectrum::shells::SHELLS;
use crate::window::types::Reference;

/// Powers of noise, or nodes with powers, that a level needs at least: it is good to a third then.
pub(crate) const TELLING: usize = 8;
/// Offsets matter beyond this over the root of the number of lines: as in the fit of a whole image.
const OFFSETS: f64 = 8.0;

/// An image and what is taken off each of its lines.
pub(crate) struct Levelled<'a> {
    pub(crate) image: &'a Image,
    /// One for each line; empty where lines have no offsets.
    pub(crate) offsets: Vec<f64>,
    /// The ridges that were left.
    ridges: Vec<Ridge>,
}

/// Noise at kx = 0 around a harmonic that stands there.
#[derive(Clone, Copy, Debug)]
struct Ridge {
    /// Its ky, rad per pixel, positive.
    at: f64,
    /// Variance of an offset per line with the power that is found there.
    power: f64,
}

/// A harmonic hardly turns along x where its kx is below this share of itself, ...
const ON_RIDGE: f64 = 0.15;
/// ... and cycles per line: the nearer wave of `BESIDE`.
const CYCLES: f64 = 3.0;
/// Around the ky of such a harmonic, half of what is found is left at this distance, in lengths of q₁. On the scenes of docs/constants.md half and
/// double change results by at most 0.13 σ.
const KEPT: f64 = 0.35;
/// The waves per line with which the offsets are compared, cycles: the window spreads offsets to 1.
const BESIDE: [f64; 2] = [3.0, 5.0];
/// Lines of which less is there have no offset of their own: half. On the scenes of docs/constants.md half and double change no result.
const LEAST: f64 = 0.5;
/// Euler's γ.
const EULER: f64 = 0.577_215_664_901_532_9;

impl<'a> Levelled<'a> {
    /// Nothing is taken off.
    pub(crate) fn as_is(image: &'a Image) -> Self {
        Self {
            image,
            offsets: Vec::new(),
            ridges: Vec::new(),
        }
    }

    /// Looks for offsets; harmonics stand where the mean lattice has them.
    pub(crate) fn new(image: &'a Image, reference: &Reference) -> Self {
        let plain = Self::as_is(image);
        let sums = line_sums(image);
        // Rad per line, whatever the shape of the pixels.
        let length = on_sample(reference, reference.wave([1, 0])).norm() * reference.pitch[1];
        let standing = standing(reference, image.columns);
        let [offsets, beside_a, beside_b] =
            [0, 1, 2].map(|i| Periodogram::new(sums.iter().map(|line| line[i])));
        let apart = |ky: f64| {
            let distance = standing.iter().map(|at| (ky - at).abs());
            distance.fold(f64::INFINITY, f64::min) > KEPT * length
        };
        let within = |ky: f64| ky > 0.1 * length && apart(ky);
        let [ridge, beside @ ..] =
            [&offsets, &beside_a, &beside_b].map(|p| p.level(within).unwrap_or_default());
        let beside = 0.5 * (beside[0] + beside[1]);
        let limit = 1.0 + OFFSETS / (image.rows as f64).sqrt();
        if ridge <= limit * beside {
            return plain;
        }
        let law = offsets.power_law(|ky| ky > 0.2 * length && ky < 3.0 * length && apart(ky));
        let ridges = standing.iter().map(|&at| Ridge {
            at,
            power: (law.map_or(ridge, |[a, b]| (a + b * at.ln()).exp()) - beside).max(0.0),
        });
        let ridges: Vec<Ridge> = ridges.collect();
        let mut kept: Vec<f64> = sums.iter().map(|line| line[0].re).collect();
        for ridge in &ridges {
            let band = band(&kept, ridge.at, KEPT * length);
            kept.iter_mut().zip(band).for_each(|(v, b)| *v -= b);
        }
        Self {
            image,
            offsets: kept,
            ridges,
        }
    }

    /// Variance of the offset per line that has the power of the noise left at wave vector `g` (rad per pixel).
    pub(crate) fn ridge(&self, g: Vector2<f64>) -> f64 {
        let near = self.ridges.iter().filter_map(|ridge| {
            let distance = (g.y.abs() - ridge.at).abs();
            (distance < 0.5 * ridge.at).then_some((distance, ridge.power))
        });
        near.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(0.0, |r| r.1)
    }

    /// Mean square of what is left.
    pub(crate) fn variance(&self) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0f64);
        for row in 0..self.image.rows {
            interrupt::check();
            let offset = self.offset(row);
            for value in self.image.row(row).iter().filter(|v| v.is_finite()) {
                sum += (value - offset).powi(2);
                count += 1.0;
            }
        }
        sum / count.max(1.0)
    }

    /// What is taken off a line.
    pub(crate) fn offset(&self, row: usize) -> f64 {
        self.offsets.get(row).copied().unwrap_or(0.0)
    }
}

/// A wave vector in rad/nm: pixels need not be square.
fn on_sample(reference: &Reference, g: Vector2<f64>) -> Vector2<f64> {
    g.component_div(&Vector2::from(reference.pitch))
}

/// The ky (positive, rad per pixel) of harmonics that hardly turn along the lines.
fn standing(reference: &Reference, columns: usize) -> Vec<f64> {
    let cycle = std::f64::consts::TAU / columns as f64;
    let found = SHELLS.into_iter().filter_map(|index| {
        let g = reference.wave(index);
        let least = ON_RIDGE * on_sample(reference, g).norm() * reference.pitch[0];
        let stands = g.x.abs() < least + CYCLES * cycle;
        (stands && g.y.abs() < std::f64::consts::PI).then_some(g.y.abs())
    });
    found.collect()
}

/// Means of every line under a Hann window, times waves of 0 and a few cycles.
fn line_sums(image: &Image) -> Vec<[Complex64; 3]> {
    let weights = hann(image.columns);
    let turn = std::f64::consts::TAU / image.columns as f64;
    let waves = BESIDE.map(|cycles| {
        let weights = weights.iter().enumerate();
        let turned = weights.map(|(i, w)| Complex64::from_polar(*w, turn * cycles * i as f64));
        turned.collect::<Vec<_>>()
    });
    let all: f64 = weights.iter().sum();
    let of_line = |row: usize| {
        let mut sums = [Complex64::default(); 3];
        let mut there = 0.0;
        for (i, value) in image.row(row).iter().enumerate() {
            if value.is_finite() {
                there += weights[i];
                sums[0] += weights[i] * value;
                sums[1] += waves[0][i] * value;
                sums[2] += waves[1][i] * value;
            }
        }
        if there < LEAST * all {
            return [Complex64::default(); 3];
        }
        sums.map(|s| s / there)
    };
    let checked = |row| {
        interrupt::check();
        of_line(row)
    };
    (0..image.rows).into_par_iter().map(checked).collect()
}

/// Powers of a series over ky, those of white noise being its variance.
struct Periodogram(Vec<f64>);

impl Periodogram {
    fn new(series: impl Iterator<Item = Complex64>) -> Self {
        let mut values: Vec<Complex64> = series.collect();
        let weights = hann(values.len());
        for (value, weight) in values.iter_mut().zip(&weights) {
            *value *= weight;
        }
        let norm: f64 = weights.iter().map(|w| w * w).sum();
        FftPlanner::new()
            .plan_fft_forward(values.len())
            .process(&mut values);
        Self(values.iter().map(|v| v.norm_sqr() / norm).collect())
    }

    /// The level where `within` holds of |ky|; `None` where that is next to nowhere. Powers of noise are exponentially
    /// distributed; the median minds no peaks.
    fn level(&self, within: impl Fn(f64) -> bool) -> Option<f64> {
        let count = self.0.len();
        let step = std::f64::consts::TAU / count as f64;
        let of_bin = |(bin, power): (usize, &f64)| {
            let ky = step * bin.min(count - bin) as f64;
            within(ky).then_some(*power)
        };
        let mut powers: Vec<f64> = self.0.iter().enumerate().filter_map(of_bin).collect();
        (powers.len() >= TELLING).then(|| median(&mut powers) / std::f64::consts::LN_2)
    }

    /// `[a, b]` of the level `e^a |ky|^b` where `within` holds of |ky|, by least squares of the logarithms; their mean is
    /// −γ below that of the level. Levels of offsets fall with ky, by its square at most.
    fn power_law(&self, within: impl Fn(f64) -> bool) -> Option<[f64; 2]> {
        let count = self.0.len();
        let step = std::f64::consts::TAU / count as f64;
        let mut sums = [0.0; 5];
        for (bin, power) in self.0.iter().enumerate().take(count / 2).skip(1) {
            let ky = step * bin as f64;
            if !within(ky) || *power <= 0.0 {
                continue;
            }
            let (x, y) = (ky.ln(), power.ln() + EULER);
            for (sum, term) in sums.iter_mut().zip([1.0, x, y, x * x, x * y]) {
                *sum += term;
            }
        }
        let [n, x, y, xx, xy] = sums;
        if n < TELLING as f64 {
            return None;
        }
        let slope = ((n * xy - x * y) / (n * xx - x * x)).clamp(-2.0, 0.0);
        Some([(y - slope * x) / n, slope])
    }
}

/// The part of a series around ±`at`, half of it at the distance `half`: `2G − G²` of a Gaussian G of ky.
fn band(series: &[f64], at: f64, half: f64) -> Vec<f64> {
    // 2g − g² = ½.
    let g = 1.0 - std::f64::consts::FRAC_1_SQRT_2;
    let width = (-2.0 * g.ln()).sqrt() / half;
    let normal =
        |y: f64, s: f64| (-0.5 * (y / s).powi(2)).exp() / (s * (std::f64::consts::TAU).sqrt());
    let reach = (4.5 * std::f64::consts::SQRT_2 * width).ceil() as isize;
    let kernel: Vec<f64> = (-reach..=reach)
        .map(|i| {
            let y = i as f64;
            let wide = normal(y, std::f64::consts::SQRT_2 * width);
            2.0 * (at * y).cos() * (2.0 * normal(y, width) - wide)
        })
        .collect();
    let count = series.len() as isize;
    let sum = |row: isize| {
        let taps = (-reach..=reach).zip(&kernel);
        let there = taps.filter(|(i, _)| (0..count).contains(&(row + i)));
        there.map(|(i, k)| k * series[(row + i) as usize]).sum()
    };
    (0..count).map(sum).collect()
}

#[cfg(test)]
mod tests {
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::map::local::local_lattices;
    use crate::map::tests::{map_of, map_of_image, pulls, rms};
    use crate::numbers::rng;
    use crate::simulate::field::FieldScene;
    use crate::window::mask::Mask;
    use crate::window::types::Resolution;

    /// A perfect lattice of 25 pixels, rotated by degrees; at 30 one of its waves stands on the ridge, at 25 and 28
    /// it is near, at 17 one of the second shell, at 0 one of the second shell stands.
    fn scene(degrees: f64, seed: u64) -> FieldScene {
        let mut scene = FieldScene::hexagonal([512, 512], 25.0, degrees.to_radians());
        scene.seed = seed;
        scene
    }

    /// Offsets as large as the signal or half as large as the noise, whatever the direction of the lattice: nodes scatter as
    /// stated in both components of both waves, and nothing is a defect.
    #[test]
    fn offsets_of_lines_are_in_the_errors() {
        let mut all = Vec::new();
        for degrees in [30.0, 28.0, 25.0, 17.0, 0.0] {
            for (line, window) in [(0.3, None), (1.0, None), (1.0, Some(15.0))] {
                let mut of_setting = Vec::new();
                for seed in 1..=3 {
                    let mut scene = scene(degrees, seed);
                    (scene.white, scene.line) = (0.6, line);
                    let map = map_of(&scene, window);
                    let flagged = map.nodes.iter().filter(|n| n.mask > Mask::Margin);
                    assert_eq!(flagged.count(), 0, "{degrees}°, {line}, {window:?}");
                    of_setting.extend(pulls(&scene, &map, 1.0)[0].iter().copied());
                }
                for component in 0..4 {
                    let of_one = of_setting.iter().skip(component).step_by(4);
                    let spread = rms(&of_one.copied().collect::<Vec<f64>>());
                    // Three maps of some 50 independent nodes.
                    assert!(
                        (0.75..1.25).contains(&spread),
                        "{degrees}°, {line}: {spread}"
                    );
                }
                all.extend(of_setting);
            }
        }
        let inside = all.iter().filter(|p| p.abs() < 1.0).count() as f64 / all.len() as f64;
        assert!((inside - 0.683).abs() < 0.04, "{inside}");
    }

    /// Lines twice as far apart as columns: what stands on the ridge and how wide it is are those of the sample.
    #[test]
    fn pixels_need_not_be_square() {
        let mut all = Vec::new();
        for (seed, degrees) in [(1, 30.0), (2, 26.0), (3, 17.0), (4, 0.0)] {
            let mut scene = scene(degrees, seed);
            scene.pair.row_mut(1).scale_mut(2.0);
            (scene.white, scene.line) = (0.6, 1.0);
            let reference = Reference {
                pair: scene.pair,
                pitch: [1.0, 2.0],
            };
            let resolution = Resolution {
                window_nm: Some(20.0),
                ..Resolution::default()
            };
            let map = local_lattices(&scene.image(), &reference, &resolution).unwrap();
            let flagged = map.nodes.iter().filter(|n| n.mask > Mask::Margin);
            assert_eq!(flagged.count(), 0, "{degrees}°");
            let [stated, _] = pulls(&scene, &map, 1.0);
            assert!(
                (0.75..1.25).contains(&rms(&stated)),
                "{degrees}°: {}",
                rms(&stated)
            );
            all.extend(stated);
        }
        assert!((0.88..1.12).contains(&rms(&all)), "{}", rms(&all));
    }

    /// A weak harmonic on the ridge, in wide windows: its own noisy slope must not say how far from the ridge it stands.
    #[test]
    fn weak_harmonics_on_the_ridge_are_no_defects() {
        for seed in 1..=4 {
            let mut scene = FieldScene::hexagonal([512, 512], 32.0, -7.66f64.to_radians());
            (scene.white, scene.line, scene.seed) = (0.53, 0.6, seed);
            for index in [[1, 1], [-1, 2], [-2, 1]] {
                scene.harmonics.push((index, 0.09));
            }
            let map = map_of(&scene, Some(26.0));
            let flagged = map.nodes.iter().filter(|n| n.mask > Mask::Margin);
            assert_eq!(flagged.count(), 0, "{seed}");
            let [stated, _] = pulls(&scene, &map, 1.0);
            assert!((0.75..1.3).contains(&rms(&stated)), "{}", rms(&stated));
        }
    }

    /// A line of noise whose power is `level² (1 + q/|kx|)`.
    fn one_over_f(level: f64, q: f64, seed: u64, row: u64) -> Vec<f64> {
        let count = 2048;
        let mut rng = rng::stream(seed, "noise in time", row);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let white = (0..count).map(|_| Complex64::from(normal()));
        let mut values: Vec<Complex64> = white.collect();
        let mut planner = FftPlanner::new();
        planner.plan_fft_forward(count).process(&mut values);
        for (i, value) in values.iter_mut().enumerate() {
            let cycles = (i.min(count - i) as f64).max(0.5);
            let k = std::f64::consts::TAU * cycles / count as f64;
            *value *= level * (1.0 + q / k).sqrt() / count as f64;
        }
        planner.plan_fft_inverse(count).process(&mut values);
        values[700..1212].iter().map(|v| v.re).collect()
    }

    /// The same for noise that is 1/f in time, within lines as from line to line.
    #[test]
    fn noise_in_time_is_in_the_errors() {
        let mut all = Vec::new();
        for degrees in [30.0, 25.0, 17.0, 0.0] {
            for (window, seed) in [(None, 1), (Some(15.0), 2), (Some(30.0), 3)] {
                let scene = scene(degrees, seed);
                let q = scene.pair.column(0).norm();
                let mut image = scene.image();
                for (row, line) in image.values.chunks_exact_mut(512).enumerate() {
                    let noise = one_over_f(0.4, q, seed, row as u64);
                    line.iter_mut().zip(noise).for_each(|(v, n)| *v += n);
                }
                let map = map_of_image(&image, &scene.pair, window);
                let [stated, _] = pulls(&scene, &map, 1.0);
                assert!(
                    rms(&stated) < 1.3,
                    "{degrees}°, {window:?}: {}",
                    rms(&stated)
                );
                all.extend(stated);
            }
        }
        let spread = rms(&all);
        assert!((0.9..1.1).contains(&spread), "{spread}");
    }

    /// Of three waves the band holds the one in its middle, half of the one at its side and nothing of the far one.
    #[test]
    fn the_band_is_where_it_should_be() {
        let (at, half) = (0.4, 0.1);
        for (ky, share) in [
            (at, 1.0),
            (at + half, 0.5),
            (at - half, 0.5),
            (at + 0.5, 0.0),
        ] {
            let series: Vec<f64> = (0..600).map(|i| (ky * f64::from(i)).cos()).collect();
            let found = band(&series, at, half);
            for i in 200..400 {
                assert!((found[i] - share * series[i]).abs() < 2e-3, "{ky}: {i}");
            }
        }
    }
}
