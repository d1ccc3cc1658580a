//! The noise that is left: its power around each harmonic, and what else stands out of it.
//!
//! The residual is Hann-windowed and transformed. The fit has emptied it where the harmonics are, and
//! with few periods that is nearly everywhere; so the power found is divided by the power that white
//! noise of unit variance would have left in the same bins, `Σw² − vᴴ G⁻¹ v` with v the transform
//! of the window times each fitted function and G their normal matrix. What that says about the wave
//! vectors is worked out in [`local`](crate::lattice::fit::local).

use std::f64::consts::PI;
use std::ops::RangeInclusive;
use std::sync::OnceLock;

use nalgebra::{DMatrix, DVector, Vector2};
use serde::{Deserialize, Serialize};

use crate::lattice::fit::frame::{Basis, Frame, wave};
use crate::lattice::fit::left::LeftOver;
use crate::lattice::fit::levelled::Levelled;
use crate::lattice::fit::local::{Bin, acting_on};
use crate::lattice::fit::model::Model;
use crate::numbers::exact;
use crate::numbers::median::median;
use crate::spectrum::fourier::wide;
use crate::spectrum::select::{BLOCK_WIDTH, NoiseMap};
use crate::spectrum::transform::{Spectrum, hann};

/// Power over noise of the highest bin at a place that is worth a look: a third of what a wave needs to earn its place.
const PROMISING: f64 = 4.0;
/// Bins (cycles per frame) on either side of a harmonic that count, along the lines: few, since noise in time is a
/// function of kx, ...
pub(super) const ALONG: i64 = 4;
/// ... and across, where it is the same: 300 bins, four of which count as one, tell it to about a tenth.
const ACROSS: i64 = 16;
/// On small frames at most one in this many of all lines' frequencies counts on either side.
const SHARE: usize = 6;
/// The same across where nothing but a wave is looked for: half.
const NEAR: i64 = 8;
/// Frequencies of which less than this share is left without the ground say nothing of the noise.
const FLAT: f64 = 0.3;
/// Bins nearer to zero frequency belong to the background: a plane fills the first.
const BACKGROUND: i64 = 2;
/// The first column that the window keeps free of what whole lines do.
pub(super) const BESIDE: i64 = 2;
/// A wave reaches no farther through the window (bins): beyond, 10⁻⁴ of its power is left.
const SPREAD: f64 = 4.0;
/// Farther than this from a point of the lattice (cycles per frame) a wave is none of its: nearer, it may be that of
/// a lattice that changes. Chosen by eye; see docs/constants.md.
const FOREIGN: f64 = 3.0;
/// Up to this order that holds ...
const LOW_ORDER: f64 = 4.0;
/// ... and beyond, where a lattice has more points than it has strong waves, a wave has to lie on the point itself:
/// the main lobe of the window. Sharp walls make harmonics of any order.
const HARMONIC: f64 = 2.0;

/// The periodogram of a residual.
pub(crate) struct ResidualNoise {
    /// In single precision: noise is known to a few per cent.
    spectrum: Spectrum<f32>,
    /// Its noise in blocks, once it is asked for.
    blocks: OnceLock<NoiseMap>,
    /// `Σ w²` over the pixels that count.
    window_power: f64,
    pub(super) free_lines: bool,
    /// How ground was taken off the image.
    levelled: Option<Levelled>,
}

/// The strongest wave in the residual that is none of the lattice's.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ForeignWave {
    /// Its wave vector, rad per pixel.
    #[serde(with = "exact")]
    pub wave_vector: Vector2<f64>,
    /// Its power over the noise power around it.
    #[serde(with = "exact")]
    pub significance: f64,
    /// The significance that chance exceeds once in some ten thousand images of this size.
    #[serde(with = "exact")]
    pub threshold: f64,
}

impl ForeignWave {
    /// Whether it is more than chance.
    pub fn stands_out(&self) -> bool {
        self.significance > self.threshold
    }
}

impl ResidualNoise {
    /// `residual` writes a line, 0 where pixels do not count, and says something of it. `free_lines`: line means are gone.
    pub(crate) fn new<S, R: Send>(
        frame: &Frame,
        free_lines: bool,
        room: impl Fn() -> S + Sync,
        residual: impl Fn(&mut S, usize, &mut [f64]) -> R + Sync,
    ) -> (Self, Vec<R>) {
        let (columns, rows) = (frame.image.columns, frame.image.rows);
        let (spectrum, said) = Spectrum::of_lines([columns, rows], room, residual);
        let squares = |n: usize| hann(n).iter().map(|w| w * w).collect::<Vec<_>>();
        let (x, y) = (squares(columns), squares(rows));
        let lines: f64 = y
            .iter()
            .zip(&frame.present)
            .filter(|(_, n)| **n > 0)
            .map(|(w, _)| w)
            .sum();
        let missing: f64 = frame.missing.iter().map(|&[r, c]| y[r] * x[c]).sum();
        let noise = Self {
            window_power: x.iter().sum::<f64>() * lines - missing,
            spectrum,
            blocks: OnceLock::new(),
            free_lines,
            levelled: frame.levelled,
        };
        (noise, said)
    }

    /// Noise power around a harmonic as it acts on the x and on the y component of its wave vector and on
    /// its phase; white noise of variance σ² gives σ². `lambda` is the share of line means that offsets
    /// take up. `None` where the fit has left nothing.
    pub(crate) fn around(
        &self,
        p: Vector2<f64>,
        lambda: f64,
        leverage: &Leverage,
    ) -> Option<[f64; 3]> {
        let mut bins = Vec::new();
        self.bins(p, leverage, |k, power, white| {
            bins.push(Bin { k, power, white });
        });
        acting_on(p / PI, lambda, &bins)
    }

    /// The same by the median: waves that are not fitted yet do not matter.
    pub(crate) fn median_around(&self, p: Vector2<f64>, leverage: &Leverage) -> Option<f64> {
        let mut all = Vec::new();
        self.bins(p, leverage, |_, found, white| {
            if white > 0.3 {
                all.push(found / white);
            }
        });
        (!all.is_empty()).then(|| median(&mut all) / std::f64::consts::LN_2)
    }

    /// Whether there is a bit more than noise at a place. A wave that is worth its place stands there
    /// at 12 times the noise or more, of which window and grid leave a quarter at worst.
    pub(crate) fn is_promising(&self, p: Vector2<f64>) -> bool {
        let centre = (p / PI).map(|c| c.round() as i64);
        let mut near = 0.0f64;
        let mut around = Vec::new();
        for dy in -NEAR..=NEAR {
            for dx in -ALONG..=ALONG {
                let power = self.power(centre.x + dx, centre.y + dy);
                if dx.abs().max(dy.abs()) <= 1 {
                    near = near.max(power);
                } else {
                    around.push(power);
                }
            }
        }
        near > PROMISING * median(&mut around) / std::f64::consts::LN_2
    }

    /// Calls `each` with the frequency, the power found and that of white noise.
    fn bins(
        &self,
        p: Vector2<f64>,
        leverage: &Leverage,
        mut each: impl FnMut(Vector2<i64>, f64, f64),
    ) {
        let centre = (p / PI).map(|c| c.round() as i64);
        let mut taps = leverage.taps(centre);
        let across = leverage.across;
        for dx in -ALONG..=ALONG {
            let x = centre.x + dx;
            if self.free_lines && x.abs() < 2 {
                continue;
            }
            for dy in -across..=across {
                let y = centre.y + dy;
                if x.abs() < BACKGROUND && y.abs() < BACKGROUND {
                    continue;
                }
                let left = self.left_of_ground([x, y]);
                if left < FLAT {
                    continue;
                }
                let white = left * (1.0 - leverage.at(&mut taps, dx, dy) / self.window_power);
                if white > 0.02 {
                    each(Vector2::new(x, y), self.power(x, y), white);
                }
            }
        }
    }

    /// The share of noise power at (x, y) cycles per frame that is left without the ground.
    fn left_of_ground(&self, bin: [i64; 2]) -> f64 {
        let Some(levelled) = self.levelled else {
            return 1.0;
        };
        let turn = |axis: usize, n: usize| 2.0 * PI * bin[axis] as f64 / n as f64;
        levelled.left(Vector2::new(
            turn(0, self.spectrum.columns),
            turn(1, self.spectrum.rows),
        ))
    }

    /// Power per pixel at (x, y) cycles per frame.
    pub(super) fn power(&self, x: i64, y: i64) -> f64 {
        self.spectrum.at(x, y).norm_sqr() / self.window_power
    }

    /// The transform of the residual across the lines from a harmonic. `offsets`: offsets take up what whole lines do, so that it is no
    /// part of the harmonic's noise.
    pub(crate) fn samples(&self, p: Vector2<f64>, offsets: bool) -> LeftOver {
        let centre = (p / PI).map(|c| c.round() as i64);
        // Noise of whole lines stands at kx = 0 alone, and beside it through the window: what lies at another kx
        // says nothing of it.
        let columns = if offsets && centre.x.abs() < BESIDE {
            vec![-BESIDE, BESIDE]
        } else {
            vec![centre.x]
        };
        let rows = centre.y - ACROSS..=centre.y + ACROSS;
        LeftOver::new(columns, rows, |x, y| self.spectrum.at(x, y))
    }

    /// Noise power per pixel over all frequencies, by the median.
    pub(crate) fn level(&self) -> f64 {
        let stride = (self.spectrum.values.len() / 65_536).max(1);
        let powers = self
            .spectrum
            .values
            .iter()
            .step_by(stride)
            .map(|value| wide(*value).norm_sqr());
        let mut powers: Vec<f64> = powers.collect();
        median(&mut powers) / (std::f64::consts::LN_2 * self.window_power)
    }

    /// Power of the bins within two of a frequency (cycles per frame): all of a wave that is there, under the window.
    pub(crate) fn power_near(&self, k: Vector2<f64>) -> f64 {
        let centre = k.map(|c| c.round() as i64);
        let bins = (-2..=2).flat_map(|y| (-2..=2).map(move |x| [x, y]));
        bins.map(|[x, y]| self.power(centre.x + x, centre.y + y))
            .sum()
    }

    /// Noise power around a frequency (cycles per frame), in the units of a power over noise.
    pub(crate) fn noise_near(&self, k: Vector2<f64>) -> f64 {
        // Waves of opposite sign are one.
        let k = if k.x < 0.0 { -k } else { k }.map(|c| c.round() as i64);
        let rows = self.spectrum.rows as i64;
        let row = self.blocks().row(k.y.rem_euclid(rows) as usize);
        let block = k.x as usize / BLOCK_WIDTH;
        row.get(block).copied().unwrap_or(1.0)
    }

    fn blocks(&self) -> &NoiseMap {
        self.blocks.get_or_init(|| NoiseMap::new(&self.spectrum))
    }

    /// The same per pixel.
    pub(super) fn level_near(&self, k: Vector2<f64>) -> f64 {
        self.noise_near(k) / self.window_power
    }

    /// The strongest wave away from the lattice, from slow waves and from the line ridge.
    pub(crate) fn foreign_wave(&self, frame: &Frame, model: &Model) -> Option<ForeignWave> {
        let noise = self.blocks();
        let rows = self.spectrum.rows;
        let cycles = model.pair / PI;
        let inverse = cycles.try_inverse()?;
        let on = |k: Vector2<f64>| {
            let index = (inverse * k).map(f64::round);
            let near = if index.amax() <= LOW_ORDER {
                FOREIGN
            } else {
                HARMONIC
            };
            (k - cycles * index).norm() < near
        };
        // Waves beyond the Nyquist frequency are seen a whole turn a pixel away.
        let turn = Vector2::new(self.spectrum.columns as f64, rows as f64);
        let ours = |k: Vector2<f64>| {
            let turns = (-1..=1).flat_map(|x| (-1..=1).map(move |y| Vector2::new(x, y)));
            turns
                .map(|t| t.map(f64::from))
                .any(|t| on(k + t.component_mul(&turn)))
        };
        let half = self.spectrum.half();
        let (mut most, mut best) = (0.0, None);
        for (y, line) in self.spectrum.values.chunks_exact(half).enumerate() {
            let signed = if 2 * y <= rows {
                y as f64
            } else {
                y as f64 - rows as f64
            };
            for (b, (block, noise)) in line.chunks(BLOCK_WIDTH).zip(noise.row(y)).enumerate() {
                for (i, value) in block.iter().enumerate() {
                    let power = wide(*value).norm_sqr();
                    if power > most * noise && (b > 0 || i > 1) {
                        let k = Vector2::new((b * BLOCK_WIDTH + i) as f64, signed);
                        if !ours(k) {
                            most = power / noise;
                            best = Some(k);
                        }
                    }
                }
            }
        }
        let k = best?;
        Some(ForeignWave {
            wave_vector: (k * PI).component_div(&frame.edge()),
            significance: most,
            threshold: self.threshold(),
        })
    }

    /// Power over noise that chance exceeds once in some ten thousand images of this size.
    pub(super) fn threshold(&self) -> f64 {
        let bins = self.spectrum.values.len() as f64;
        // The local noise is known to a fifth or so, hence the factor.
        1.3 * (bins.ln() + 9.0)
    }
}

/// Which part of white noise the fitted functions take up.
pub(crate) struct Leverage<'a> {
    basis: &'a Basis,
    model: &'a Model,
    /// Inverse of the normal matrix of (cos, sin) of each harmonic and the four derivatives.
    inverse: DMatrix<f64>,
    size: [usize; 2],
    /// Bins on either side that count, across the lines.
    across: i64,
}

/// What the fitted functions take up around one place: those of the waves near by, and the four
/// derivatives.
pub(crate) struct Taps {
    waves: Vec<Tap>,
    /// The transform of a cosine is real, that of a sine imaginary: the parts of the inverse that belong to the cosines and to
    /// the sines near by, each with the four derivatives, which have both.
    inverse: [DMatrix<f64>; 2],
    /// Position of a harmonic in these parts.
    places: Vec<Option<usize>>,
    /// The transform of the window times each of these functions, real and imaginary part: room for it.
    seen: [DVector<f64>; 2],
}

/// One of the two waves of a harmonic.
struct Tap {
    harmonic: usize,
    /// Of its wave vector.
    sign: f64,
    /// Transform of the window along x and along y: value and slope at each bin.
    transform: [Vec<[f64; 2]>; 2],
}

impl<'a> Leverage<'a> {
    /// `normal` is that of the whole model: background, cosines and sines, derivatives.
    pub(crate) fn new(frame: &Frame, model: &'a Model, normal: &DMatrix<f64>) -> Option<Self> {
        let terms = model.basis.terms.len();
        let rest = normal.nrows() - terms;
        let inverse = crate::lattice::fit::solve::inverse(normal)?;
        // The block of the inverse is the inverse with the background projected out.
        let inverse = inverse.view((terms, terms), (rest, rest)).into_owned();
        Some(Self {
            basis: &model.basis,
            model,
            inverse,
            size: [frame.image.columns, frame.image.rows],
            across: ACROSS.min((frame.image.rows / SHARE) as i64),
        })
    }

    fn taps(&self, centre: Vector2<i64>) -> Taps {
        let half = [ALONG, self.across];
        let count = self.basis.indices.len();
        let mut waves = Vec::new();
        let mut places = vec![None; count];
        let mut near = Vec::new();
        for (i, &index) in self.basis.indices.iter().enumerate() {
            for sign in [1.0, -1.0] {
                let p = sign * wave(&self.model.pair, index);
                let cycles = p / PI;
                let apart = |axis: usize| (cycles[axis] - centre[axis] as f64).abs();
                let reaches = |axis: usize| apart(axis) < half[axis] as f64 + SPREAD;
                if !(reaches(0) && reaches(1)) {
                    continue;
                }
                let transform = [0, 1].map(|axis| {
                    let bins = centre[axis] - half[axis]..=centre[axis] + half[axis];
                    window_transforms(p[axis], bins, self.size[axis])
                });
                waves.push(Tap {
                    harmonic: i,
                    sign,
                    transform,
                });
                if places[i].is_none() {
                    places[i] = Some(near.len());
                    near.push(i);
                }
            }
        }
        let room = || DVector::zeros(near.len() + 4);
        let part = |first: usize| {
            let waves = near.iter().map(|i| 2 * i + first);
            let used: Vec<usize> = waves.chain(2 * count..2 * count + 4).collect();
            self.inverse.select_rows(&used).select_columns(&used)
        };
        Taps {
            waves,
            seen: [room(), room()],
            inverse: [part(0), part(1)],
            places,
        }
    }

    /// `vᴴ G⁻¹ v` for the bin at (dx, dy) from the centre of the taps.
    fn at(&self, taps: &mut Taps, dx: i64, dy: i64) -> f64 {
        let [re, im] = &mut taps.seen;
        let n = re.len();
        re.fill(0.0);
        im.fill(0.0);
        for tap in &taps.waves {
            let (i, sign, [along, across]) = (tap.harmonic, tap.sign, &tap.transform);
            let [x, slope_x] = along[(dx + ALONG) as usize];
            let [y, slope_y] = across[(dy + self.across) as usize];
            if let Some(place) = taps.places[i] {
                re[place] += 0.5 * x * y;
                im[place] -= 0.5 * sign * x * y;
            }
            let [alpha, beta] = self.model.waves[i];
            for (axis, slope) in [slope_x * y, x * slope_y].into_iter().enumerate() {
                // X e^{iθ} transforms into −i times the slope; the derivative of the model is
                // X (β cos θ − α sin θ).
                for (vector, index) in self.basis.indices[i].into_iter().enumerate() {
                    let j = n - 4 + 2 * vector + axis;
                    im[j] -= 0.5 * f64::from(index) * beta * slope;
                    re[j] += 0.5 * f64::from(index) * alpha * sign * slope;
                }
            }
        }
        let form = |inverse: &DMatrix<f64>, v: &DVector<f64>| {
            let columns = inverse.column_iter().zip(v.iter());
            columns
                .map(|(column, value)| value * column.dot(v))
                .sum::<f64>()
        };
        form(&taps.inverse[0], re) + form(&taps.inverse[1], im)
    }
}

/// `Σ w cos((p − π bin) X)` over the Hann window of `n` pixels and its slope, for a run of bins.
///
/// The window is three Dirichlet kernels, `sin u / sin(u/n)` at a bin and at its neighbours. From bin to bin u is π less, so that
/// one sine is that of all of them.
fn window_transforms(p: f64, bins: RangeInclusive<i64>, n: usize) -> Vec<[f64; 2]> {
    let nearest = (p / PI).round();
    let offset = p - PI * nearest;
    let (sin, cos) = offset.sin_cos();
    let kernel = |bin: i64| {
        let from_nearest = bin - nearest as i64;
        let sign = if from_nearest % 2 == 0 { 1.0 } else { -1.0 };
        dirichlet(
            offset - PI * from_nearest as f64,
            [sign * sin, sign * cos],
            n as f64,
        )
    };
    let (first, last) = (*bins.start(), *bins.end());
    let kernels: Vec<[f64; 2]> = (first - 1..=last + 1).map(kernel).collect();
    let window =
        |three: &[[f64; 2]]| [0, 1].map(|i| 0.5 * three[1][i] + 0.25 * (three[0][i] + three[2][i]));
    kernels.windows(3).map(window).collect()
}

/// `sin u / sin(u/n)` and its slope, from (sin u, cos u).
fn dirichlet(u: f64, [sin, cos]: [f64; 2], n: f64) -> [f64; 2] {
    /// Nearer to 0 the first terms of the series are exact.
    const SMALL: f64 = 1e-4;
    if u.abs() < SMALL {
        let curvature = (n * n - 1.0) / (3.0 * n);
        return [n - 0.5 * curvature * u * u, -curvature * u];
    }
    let (below, slope) = (u / n).sin_cos();
    [sin / below, (cos - sin * slope / (n * below)) / below]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::harmonics::hann_transform;

    /// The transforms of a run of bins are those by themselves, also at the bins, and slopes are their differences.
    #[test]
    fn bins_have_the_transform_of_the_window() {
        for (p, n) in [
            (40.3, 64),
            (7.0 * PI, 33),
            (7.0 * PI + 3e-5, 128),
            (-2.2, 16),
        ] {
            let centre = (p / PI).round() as i64;
            let found = window_transforms(p, centre - 4..=centre + 4, n);
            for (bin, [value, slope]) in (centre - 4..).zip(&found) {
                let at = |p: f64| hann_transform(2.0 * (p - PI * bin as f64) / n as f64, n);
                assert!((value - at(p)).abs() < 1e-9, "{p} {n} {bin}: {value}");
                let wanted = (at(p + 1e-4) - at(p - 1e-4)) / 2e-4;
                assert!(
                    (slope - wanted).abs() < 1e-6,
                    "{p} {n} {bin}: {slope} {wanted}"
                );
            }
            assert_eq!(found.len(), 9);
        }
    }
}
