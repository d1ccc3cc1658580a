//! Images that are a few perfect waves: a lattice and stripes, and nothing else.
//!
//! In: an image without its background. Out: the wave vectors of its strong waves, each to a small share of a cycle of the frame, if they are
//! all there is. A wave beside a lattice that is as strong as those of the lattice makes another "lattice" with two of them, or beats with one
//! of them, so that the lattice seems to cover parts of the frame. Waves that are fitted together (Gauss–Newton, from the highest
//! bins of what is left) are told apart from two bins of the spectrum on, and only those of a lattice add up:
//! `k₁ + k₂ = k₃` to within their errors.

use std::f64::consts::{PI, TAU};

use nalgebra::{Matrix2, Vector2};

use crate::frame::image::Image;
use crate::lattice::fit::frame::Frame;
use crate::lattice::fit::joint::Joint;
use crate::lattice::fit::noise::{BESIDE, ResidualNoise};
use crate::numbers::three::three;

/// Fewest cycles of a wave in the frame: slower ones are background.
const SLOWEST: f64 = 2.0;
/// Waves at most: a lattice with a few harmonics, and stripes with overtones.
const MOST: usize = 9;
/// A wave with less than this share of the power of the strongest may be left. Chosen by eye.
const NEGLIGIBLE: f64 = 0.01;
/// Bins in the shortest period of a strong wave, at least.
const BINS_PER_PERIOD: f64 = 5.0;
/// Steps on the way.
const SOME_STEPS: usize = 8;
/// Steps until all waves have to stand still.
const STEPS: usize = 25;
/// Largest closure error of three waves, cycles per frame: three waves of noise 0.03 each.
const ADDS_UP: f64 = 0.15;
/// The same for a harmonic of a lattice: up to the fourth order.
const HARMONIC: f64 = 0.4;
/// Points of a lattice that count, by their order.
const ORDER: f64 = 4.0;
/// Distance from a lattice point (cycles per frame) beyond which a wave is not a harmonic: a varying lattice spreads less.
pub(super) const SKIRT: f64 = 3.0;
/// Distance from its point that holds nearly all power of a harmonic that is not fitted, cycles per frame.
const LOBE: f64 = 1.5;
/// Periods of the first waves of a lattice across the frame, at least: fewer are ground, and their harmonics would be everywhere.
const FEWEST: f64 = 5.0;
/// Square of the highest order that a harmonic may have: the fifth shell.
const HIGHEST: f64 = 9.0;
/// Sine of the angle between two waves of a lattice, at least.
const OPEN: f64 = 0.4;

/// The strong waves of an image.
pub(crate) struct FewWaves {
    /// Their wave vectors, rad per pixel, strongest first found.
    waves: Vec<Vector2<f64>>,
    amplitudes: Vec<f64>,
    /// (columns, rows) of the image.
    size: [usize; 2],
}

impl FewWaves {
    /// `None` where they are not all there is.
    pub(crate) fn of(image: &Image) -> Option<Self> {
        let bins = bins_for(image)?;
        let small = image.binned(bins);
        let frame = Frame::new(&small);
        let mut model = Joint::default();
        let mut strongest = None;
        loop {
            let left = model.left(&frame);
            let seen = spectrum(&frame, &left);
            let (k, power) = highest(&frame, &seen)?;
            if strongest.is_none() && are_many(&frame, &seen, power) {
                return None;
            }
            let first = *strongest.get_or_insert(power);
            if power < NEGLIGIBLE * first || power < seen.threshold() * seen.level_near(k) {
                break;
            }
            if model.waves.len() == MOST {
                return None;
            }
            model.add(k * PI);
            model.converge(&frame, SOME_STEPS)?;
            if model.has_skirts() {
                return None;
            }
        }
        model.converge(&frame, STEPS)?;
        let edge = frame.edge() * bins as f64;
        Some(Self {
            waves: model.waves.iter().map(|p| p.component_div(&edge)).collect(),
            amplitudes: (model.amplitudes.iter().map(|[a, b]| a.hypot(*b))).collect(),
            size: [image.columns, image.rows],
        })
    }

    /// Whether a wave is a harmonic of a lattice (both rad per pixel).
    fn is_harmonic(&self, q: &Vector2<f64>, pair: &Matrix2<f64>) -> bool {
        pair.try_inverse().is_some_and(|inverse| {
            let index = (inverse * q).map(|i| i.round().clamp(-ORDER, ORDER));
            self.cycles(&(q - pair * index)).norm() < HARMONIC
        })
    }

    /// The pair of waves that makes a lattice with a third: of all such, that whose weakest wave is strongest.
    pub(crate) fn pair(&self) -> Option<Matrix2<f64>> {
        let n = self.waves.len();
        let triples =
            (0..n).flat_map(|i| (i + 1..n).flat_map(move |j| (j + 1..n).map(move |l| [i, j, l])));
        let weakest = |t: &[usize; 3]| {
            t.iter()
                .map(|&i| self.amplitudes[i])
                .fold(f64::INFINITY, f64::min)
        };
        let lattices = triples.filter_map(|t| Some((weakest(&t), self.lattice(t)?)));
        let best = lattices.max_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(best.1)
    }

    /// The pair of three waves that add up.
    fn lattice(&self, triple: [usize; 3]) -> Option<Matrix2<f64>> {
        let [a, b, c] = triple.map(|i| self.waves[i]);
        let sign = [1.0, -1.0].into_iter().find(|sign| {
            let sum = a + b * *sign;
            self.cycles(&(sum - c))
                .norm()
                .min(self.cycles(&(sum + c)).norm())
                < ADDS_UP
        })?;
        let open = a.perp(&b).abs() > OPEN * a.norm() * b.norm();
        // The third is the difference of the two.
        open.then(|| Matrix2::from_columns(&[a, -b * sign]))
    }

    /// The image without the waves that are not harmonics of a lattice (rad per pixel); `None` where there is none.
    pub(crate) fn taken_off(&self, image: &Image, pair: &Matrix2<f64>) -> Option<Image> {
        let beside: Vec<usize> = (0..self.waves.len())
            .filter(|&i| !self.is_harmonic(&self.waves[i], pair))
            .collect();
        if !self.are_stripes(&beside) {
            return None;
        }
        let frame = Frame::new(image);
        let edge = frame.edge();
        let mut model = Joint::of(self.waves.iter().map(|q| q.component_mul(&edge)).collect());
        model.fit_amplitudes(&frame)?;
        let seen = spectrum(&frame, &model.left(&frame));
        if !self.are_all(&frame, &seen, &model, pair) {
            return None;
        }
        let mut rest = image.clone();
        for i in beside {
            model.take_off(&frame, i, &mut rest.values);
        }
        Some(rest)
    }

    /// Whether nothing is left but noise and higher harmonics, compared with the weakest of the first waves of a lattice: holes and edges leave skirts
    /// beside them.
    fn are_all(
        &self,
        frame: &Frame,
        seen: &ResidualNoise,
        model: &Joint,
        pair: &Matrix2<f64>,
    ) -> bool {
        let three = three(pair);
        let first = |q: &Vector2<f64>| {
            let is = |w: &Vector2<f64>| self.cycles(&(w - q)).norm() < HARMONIC;
            three.iter().any(|w| is(w) || is(&-w))
        };
        let amplitudes = self.waves.iter().zip(&model.amplitudes);
        let amplitudes = amplitudes.filter(|(q, _)| first(q));
        let weakest = amplitudes.map(|(_, [a, b])| a * a + b * b);
        let weakest = weakest.fold(f64::INFINITY, f64::min) * frame.pixels() as f64 / 9.0;
        let cycles = three.map(|q| self.cycles(&q));
        let Some(inverse) = Matrix2::from_columns(&[cycles[0], cycles[1]]).try_inverse() else {
            return false;
        };
        let is_higher = |k: &Vector2<f64>| {
            let index = (inverse * k).map(f64::round);
            let point = cycles[0] * index.x + cycles[1] * index.y;
            let order = index.x * index.x + index.x * index.y + index.y * index.y;
            (1.5..=HIGHEST).contains(&order) && (k - point).norm() < LOBE
        };
        let mut all = cycles.iter().all(|k| k.norm() > FEWEST);
        each_bin(frame, BESIDE, |[x, y]| {
            let (k, power) = (Vector2::new(x as f64, y as f64), seen.power(x, y));
            if power > NEGLIGIBLE * weakest && !is_higher(&k) {
                all &= power < seen.threshold() * seen.level_near(k);
            }
        });
        all
    }

    /// Whether some of the waves are one and its overtones.
    fn are_stripes(&self, some: &[usize]) -> bool {
        let waves = || some.iter().map(|&i| self.waves[i]);
        let Some(slowest) = waves().min_by(|a, b| a.norm().total_cmp(&b.norm())) else {
            return false;
        };
        waves().all(|q| {
            let n = (q.dot(&slowest) / slowest.norm_squared()).round();
            self.cycles(&(q - slowest * n)).norm() < HARMONIC
        })
    }

    /// Cycles of the frame of a wave vector, rad per pixel.
    fn cycles(&self, q: &Vector2<f64>) -> Vector2<f64> {
        q.component_mul(&Vector2::from(self.size.map(|n| n as f64 / TAU)))
    }
}

/// Pixels that are averaged along each axis before waves are fitted: `None` where there is no wave.
fn bins_for(image: &Image) -> Option<usize> {
    let frame = Frame::new(image);
    let mut left = image.values.clone();
    clear(&frame, &mut left);
    let seen = spectrum(&frame, &left);
    let (_, most) = highest(&frame, &seen)?;
    let size = [image.columns, image.rows];
    let mut fastest = 0.0f64;
    each_bin(&frame, 0, |k| {
        if seen.power(k[0], k[1]) > NEGLIGIBLE * most {
            let per_pixel = |axis: usize| k[axis].abs() as f64 / size[axis] as f64;
            fastest = fastest.max(per_pixel(0)).max(per_pixel(1));
        }
    });
    Some(((1.0 / (fastest * BINS_PER_PERIOD)) as usize).max(1))
}

/// Calls `f` with (x, y) of each bin that is no ground, cycles per frame, from an x on: what whole lines do is below [`BESIDE`].
fn each_bin(frame: &Frame, from: i64, mut f: impl FnMut([i64; 2])) {
    let [columns, rows] = [frame.image.columns as i64 / 2, frame.image.rows as i64 / 2];
    for y in -rows..=rows {
        for x in from..=columns {
            if ((x * x + y * y) as f64).sqrt() > SLOWEST {
                f([x, y]);
            }
        }
    }
}

/// Whether more bins than there may be waves stand out, each farther from the others than one wave reaches.
fn are_many(frame: &Frame, seen: &ResidualNoise, strongest: f64) -> bool {
    let mut all: Vec<(f64, Vector2<f64>)> = Vec::new();
    each_bin(frame, 0, |[x, y]| {
        let (k, power) = (Vector2::new(x as f64, y as f64), seen.power(x, y));
        if power >= NEGLIGIBLE * strongest && power >= seen.threshold() * seen.level_near(k) {
            all.push((power, k));
        }
    });
    all.sort_by(|(a, _), (b, _)| b.total_cmp(a));
    let mut apart: Vec<Vector2<f64>> = Vec::new();
    for (_, k) in all {
        // Waves of opposite sign are one.
        if apart
            .iter()
            .all(|q| (q - k).norm().min((q + k).norm()) > SKIRT)
        {
            apart.push(k);
            if apart.len() > MOST {
                return true;
            }
        }
    }
    false
}

/// Cycles per frame of the strongest bin, and its power.
fn highest(frame: &Frame, seen: &ResidualNoise) -> Option<(Vector2<f64>, f64)> {
    let mut best = None;
    each_bin(frame, 0, |[x, y]| {
        let power = seen.power(x, y);
        if power > best.map_or(0.0, |(_, most)| most) {
            best = Some((Vector2::new(x as f64, y as f64), power));
        }
    });
    best
}

/// The transform of what is left of the pixels, 0 where they do not count.
fn spectrum(frame: &Frame, left: &[f64]) -> ResidualNoise {
    let columns = frame.image.columns;
    let line = |(): &mut (), row: usize, out: &mut [f64]| {
        out.copy_from_slice(&left[row * columns..][..columns]);
    };
    ResidualNoise::new(frame, false, || (), line).0
}

/// Puts 0 where pixels do not count.
fn clear(frame: &Frame, values: &mut [f64]) {
    let columns = frame.image.columns;
    let lines = values.chunks_exact_mut(columns).zip(&frame.present);
    for (line, _) in lines.filter(|(_, present)| **present == 0) {
        line.fill(0.0);
    }
    for &[row, column] in &frame.missing {
        values[row * columns + column] = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numbers::rng::normals;

    const SIZE: usize = 128;
    const NOISE: f64 = 0.3;

    /// Eight to ten periods of a lattice.
    fn pair() -> Matrix2<f64> {
        Matrix2::new(0.45, -0.02, 0.21, 0.52)
    }

    /// A wave by its phase at a place; its wave vector in rad per pixel.
    fn image(seed: u64, value: impl Fn(Vector2<f64>) -> f64) -> Image {
        let mut normal = normals(seed, "few", 0);
        let values = (0..SIZE * SIZE).map(|i| {
            let at = Vector2::new((i % SIZE) as f64, (i / SIZE) as f64);
            value(at) + NOISE * normal()
        });
        Image::new(SIZE, SIZE, values.collect())
    }

    fn lattice(at: Vector2<f64>) -> f64 {
        three(&pair())
            .iter()
            .map(|q| (q.dot(&at) + 0.7).cos())
            .sum()
    }

    /// A wave one and a half times as strong as those of a lattice and two cycles of the frame from one of them, with an overtone, is told
    /// from them: three waves that add up are left, and of the wave less than the noise in one pixel of a hundred.
    #[test]
    fn stripes_close_to_a_lattice_are_told_from_it() {
        for seed in 0..12 {
            let turn = seed as f64 * 0.5;
            let away = Vector2::new(turn.cos(), turn.sin()) * (2.0 * TAU / SIZE as f64);
            let q = three(&pair())[seed as usize % 3] + away;
            let stripes = |at: Vector2<f64>| {
                let theta = q.dot(&at) + turn;
                1.5 * theta.cos() + 0.4 * (2.0 * theta).cos()
            };
            let striped = image(seed, |at| lattice(at) + stripes(at));
            let waves = FewWaves::of(&striped).unwrap();
            let found = waves.pair().unwrap();
            let names = pair().try_inverse().unwrap() * found;
            let whole = names.map(f64::round);
            assert!(
                (whole.determinant().abs() - 1.0).abs() < 1e-9,
                "{seed}: {names}"
            );
            assert!((names - whole).amax() < 0.01, "{seed}: {names}");
            let rest = waves.taken_off(&striped, &found).unwrap();
            let bare = image(seed, lattice);
            let left = rest
                .values
                .iter()
                .zip(&bare.values)
                .map(|(a, b)| (a - b).powi(2));
            let left = left.sum::<f64>() / (SIZE * SIZE) as f64;
            assert!(left < (0.1 * NOISE).powi(2), "{seed}: {}", left.sqrt());
        }
    }

    /// Nothing is taken off a lattice that is alone, covers a part of the frame, or changes across it.
    #[test]
    fn what_a_lattice_does_is_no_stripes() {
        let taken =
            |image: &Image| FewWaves::of(image).and_then(|w| w.taken_off(image, &w.pair()?));
        for seed in 0..12 {
            assert!(taken(&image(seed, lattice)).is_none(), "alone, {seed}");
            let turn = seed as f64 * 0.5;
            let across = Vector2::new(turn.cos(), turn.sin());
            let from_middle = |at: Vector2<f64>| (at - Vector2::repeat(64.0)).dot(&across);
            let half = |at| {
                if from_middle(at) < 10.0 {
                    lattice(at)
                } else {
                    0.0
                }
            };
            assert!(taken(&image(seed, half)).is_none(), "half, {seed}");
            let bent =
                |at: Vector2<f64>| lattice(at + across * (from_middle(at) / 64.0).powi(2) * 4.0);
            assert!(taken(&image(seed, bent)).is_none(), "bent, {seed}");
        }
    }
}
