//! Waves of an image that are as strong as those of a proposed lattice.
//!
//! Rough ground, edges and noise have many waves, and of many some three add up to zero by chance. What is a lattice is not one of many: no other wave
//! of about its period is as strong as its weakest one. That needs no model of the noise, only the rank of a peak.

use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;
use rustfft::num_complex::Complex64;

use crate::numbers::interrupt;
use crate::numbers::three::three;
use crate::spectrum::shells::{FIRST_SHELL, shells};
use crate::spectrum::transform::Spectrum;

/// Number of rivals that refuse a lattice: three waves can make another one.
pub(crate) const ENOUGH: usize = 3;
/// Largest ratio of the periods of a rival and a lattice. Of some 400 images of 30 kinds that were right none had a rival at
/// ratios of 1.3 to 1.8 but for a second moiré and stripes (one or two), and 22 lattices that chance had made of rough ground had 3 to 31 at 1.3.
const LIKE: f64 = 1.5;
/// Peaks this close to a point of the lattice, as a share of its shortest wave vector, are its own: bends and edges widen them.
const OWN: f64 = 0.25;
/// Shells of which one has to stand out: a cell of many atoms scatters into the third to fifth.
const SHELLS: usize = 5;
/// Half of the main lobe of the window, cycles per frame: what lies nearer to a point is its peak, and what lies nearer to kx = 0 is noise of whole lines.
pub(crate) const LOBE: f64 = 1.6;

/// The peaks of a spectrum, however small.
pub(crate) struct Rivals<'a> {
    spectrum: &'a Spectrum,
    /// Wave vectors, rad per pixel, and powers.
    peaks: Vec<(Vector2<f64>, f64)>,
}

impl<'a> Rivals<'a> {
    pub(crate) fn new(spectrum: &'a Spectrum) -> Self {
        let (half, rows) = (spectrum.half(), spectrum.rows as i64);
        let step = spectrum.step();
        let lines =
            (LOBE * spectrum.columns as f64 / spectrum.image_size[0] as f64).ceil() as usize;
        let of_line = |y: i64| {
            interrupt::check();
            let powers = |y: i64| {
                let line = &spectrum.values[y.rem_euclid(rows) as usize * half..][..half];
                line.iter().map(Complex64::norm_sqr)
            };
            let own: Vec<f64> = powers(y).collect();
            let beside = powers(y - 1).zip(powers(y + 1)).zip(&own);
            let highest: Vec<f64> = beside.map(|((a, b), own)| a.max(b).max(*own)).collect();
            (lines..half - 1).filter_map(move |x| {
                let is_peak = highest[x - 1..=x + 1].iter().all(|other| *other <= own[x]);
                let q = || step.component_mul(&Vector2::new(x as f64, y as f64));
                is_peak.then(|| (q(), own[x]))
            })
        };
        let all = (-rows / 2..(rows + 1) / 2).into_par_iter();
        let peaks = all.flat_map_iter(of_line).collect();
        Self { spectrum, peaks }
    }

    /// How many peaks beside a lattice (reciprocal pair, rad per pixel) have about the period of one of its first five shells and at least the power
    /// of the weakest wave of that: those of the shell that has the fewest, of each shell no more than `most`. `to_physical`: the metric of wave vectors.
    pub(crate) fn of(&self, pair: &Matrix2<f64>, to_physical: &Matrix2<f64>, most: usize) -> usize {
        let Some(inverse) = pair.try_inverse() else {
            return 0;
        };
        let wave = |[h, k]: [i32; 2]| pair * Vector2::new(f64::from(h), f64::from(k));
        let length = |q: Vector2<f64>| (to_physical * q).norm();
        let shortest = FIRST_SHELL.map(|index| length(wave(index)));
        let shortest = shortest.into_iter().fold(f64::INFINITY, f64::min);
        let is_own = |q: &Vector2<f64>| {
            let off = pair * (inverse * q).map(f64::round) - q;
            off.component_mul(&self.frame()).norm() < LOBE || length(off) < OWN * shortest
        };
        let of_shell = |shell: &[[i32; 2]]| {
            let waves = || shell.iter().map(|index| wave(*index));
            let weakest = waves().map(|q| self.near(q)).fold(f64::INFINITY, f64::min);
            let least = waves().map(length).fold(f64::INFINITY, f64::min) / LIKE;
            let longest = waves().map(length).fold(0.0, f64::max) * LIKE;
            let stronger = self.peaks.iter().filter(|(_, power)| *power >= weakest);
            let like = stronger.filter(|(q, _)| (least..longest).contains(&length(*q)));
            like.filter(|(q, _)| !is_own(q)).take(most).count()
        };
        let fewest = (1..=SHELLS).try_fold(usize::MAX, |fewest, n| {
            let shell = &shells(n)[shells(n - 1).len()..];
            (fewest > 0).then(|| fewest.min(of_shell(shell)))
        });
        fewest.unwrap_or(0)
    }

    /// The peaks outside a lattice's first order (reciprocal pair, rad per pixel).
    pub(crate) fn beside(mut self, pair: &Matrix2<f64>) -> Self {
        let (waves, frame) = (three(pair), self.frame());
        let is_own = |q: Vector2<f64>| q.component_mul(&frame).norm() < LOBE;
        self.peaks.retain(|(q, _)| {
            !waves
                .iter()
                .any(|wave| is_own(q - wave) || is_own(q + wave))
        });
        self
    }

    /// rad per pixel → cycles per frame.
    fn frame(&self) -> Vector2<f64> {
        Vector2::from(self.spectrum.image_size.map(|n| n as f64)) / std::f64::consts::TAU
    }

    /// The largest power near a wave vector.
    fn near(&self, q: Vector2<f64>) -> f64 {
        let bin = q.component_div(&self.spectrum.step()).map(f64::round);
        let around = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy)));
        let powers =
            around.map(|(dx, dy)| power(self.spectrum, bin.x as i64 + dx, bin.y as i64 + dy));
        powers.fold(0.0, f64::max)
    }
}

fn power(spectrum: &Spectrum, x: i64, y: i64) -> f64 {
    spectrum.at(x, y).norm_sqr()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::image::Image;
    use crate::numbers::rng::normals;

    /// (columns, rows)
    const SIZE: [usize; 2] = [160, 120];

    /// A lattice of some nine pixels a period.
    fn pair() -> Matrix2<f64> {
        Matrix2::new(0.70, 0.24, 0.05, 0.63)
    }

    /// How many rivals the lattice has with waves beside it, of one amplitude, in noise.
    fn rivals(waves: &[Vector2<f64>], amplitude: f64, noise: f64) -> usize {
        let mut normal = normals(5, "rivals", 0);
        let value = |i: usize| {
            let at = Vector2::new((i % SIZE[0]) as f64, (i / SIZE[0]) as f64);
            let lattice: f64 = three(&pair()).iter().map(|q| q.dot(&at).cos()).sum();
            let beside: f64 = waves.iter().map(|q| (q.dot(&at) + 1.0).cos()).sum();
            lattice + amplitude * beside + noise * normal()
        };
        let values = (0..SIZE[0] * SIZE[1]).map(value).collect();
        let spectrum = Spectrum::new(&Image::new(SIZE[1], SIZE[0], values));
        Rivals::new(&spectrum).of(&pair(), &Matrix2::identity(), usize::MAX)
    }

    fn turned(degrees: f64) -> Vector2<f64> {
        let (sin, cos) = degrees.to_radians().sin_cos();
        Vector2::new(0.7 * cos, 0.7 * sin)
    }

    /// Waves of its period count if they are stronger, whatever noise there is that does not hide the lattice.
    #[test]
    fn stronger_waves_of_its_period_are_counted() {
        let beside = [-24.0, 36.0, 99.0].map(turned);
        for noise in [0.0, 2.0] {
            assert_eq!(rivals(&[], 0.0, noise), 0);
            for count in 0..=beside.len() {
                assert_eq!(rivals(&beside[..count], 1.4, noise), count, "{noise}");
            }
            assert_eq!(rivals(&beside, 0.6, noise), 0);
        }
        // Ground and atoms are no rivals, and neither is noise of whole lines.
        let far = [
            turned(-24.0) / 2.0,
            turned(-24.0) * 2.9,
            Vector2::new(0.0, 0.9),
        ];
        assert_eq!(rivals(&far, 3.0, 0.5), 0);
    }

    /// Where noise hides the lattice, the peaks of noise are its rivals.
    #[test]
    fn noise_is_a_crowd() {
        assert!(rivals(&[], 0.0, 60.0) >= ENOUGH);
    }
}
