//! The noise that is left: its power around each harmonic, and what else stands out of it.
//!
//! The residual is Hann-windowed and transformed. The fit has emptied it where the harmonics are, and
//! with few periods that is nearly everywhere; so the power found is divided by the power that white
//! noise of unit variance would have left in the same bins, `Σw² − vᴴ G⁻¹ v` with v the transform
//! of the window times each fitted function and G their normal matrix. What that says about the wave
//! vectors is worked out in [`local`](crate::lattice::fit::local).

use nalgebra::{DMatrix, DVector, Vector2};
use rustfft::num_complex::Complex64;
use serde::{Deserialize, Serialize};

use crate::lattice::fit::frame::{Basis, Frame, wave};
use crate::lattice::fit::local::{Bin, acting_on};
use crate::lattice::fit::model::Model;
use crate::numbers::exact;
use crate::numbers::median::median;
use crate::spectrum::harmonics::hann_transform;
use crate::spectrum::select::{BLOCK_WIDTH, NoiseMap};
use crate::spectrum::transform::{Spectrum, hann};

/// Power over noise of the highest bin at a place that is worth a look: a third of what a wave needs to earn its place.
const PROMISING: f64 = 4.0;
/// Bins (cycles per frame) on either side of a harmonic that count, along the lines: few, since noise in time is a
/// function of kx, ...
const ALONG: i64 = 4;
/// ... and across, where it is the same: 300 bins, four of which count as one, tell it to about a tenth.
const ACROSS: i64 = 16;
/// On small frames at most one in this many of all lines' frequencies counts on either side.
const SHARE: usize = 6;
/// The same across where nothing but a wave is looked for: half.
const NEAR: i64 = 8;
/// Bins nearer to zero frequency belong to the background: a plane fills the first.
const BACKGROUND: i64 = 2;
/// The first column that the window keeps free of what whole lines do.
const BESIDE: i64 = 2;
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
    spectrum: Spectrum,
    /// `Σ w²` over the pixels that count.
    window_power: f64,
    free_lines: bool,
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
    /// `residual` writes a line, 0 where pixels do not count. `free_lines`: line means are gone.
    pub(crate) fn new(
        frame: &Frame,
        free_lines: bool,
        residual: impl FnMut(usize, &mut [f64]),
    ) -> Self {
        let (columns, rows) = (frame.image.columns, frame.image.rows);
        let spectrum = Spectrum::of_lines([columns, rows], residual);
        let squares = |n: usize| hann(n).iter().map(|w| w * w).collect::<Vec<_>>();
        let (x, y) = (squares(columns), squares(rows));
        let lines: f64 = y
            .iter()
            .zip(&frame.present)
            .filter(|(_, n)| **n > 0)
            .map(|(w, _)| w)
            .sum();
        let missing: f64 = frame.missing.iter().map(|&[r, c]| y[r] * x[c]).sum();
        Self {
            window_power: x.iter().sum::<f64>() * lines - missing,
            spectrum,
            free_lines,
        }
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
        acting_on(p / std::f64::consts::PI, lambda, &bins)
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
        let centre = (p / std::f64::consts::PI).map(|c| c.round() as i64);
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
        let centre = (p / std::f64::consts::PI).map(|c| c.round() as i64);
        let taps = leverage.taps(centre);
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
                let white = 1.0 - leverage.at(&taps, dx, dy) / self.window_power;
                if white > 0.02 {
                    each(Vector2::new(x, y), self.power(x, y), white);
                }
            }
        }
    }

    /// Power per pixel at (x, y) cycles per frame.
    fn power(&self, x: i64, y: i64) -> f64 {
        let (rows, columns) = (self.spectrum.rows as i64, self.spectrum.columns as i64);
        let x = x.rem_euclid(columns);
        let (x, y) = if x > columns / 2 {
            (columns - x, -y)
        } else {
            (x, y)
        };
        self.spectrum.power(x as usize, y.rem_euclid(rows) as usize) / self.window_power
    }

    /// The transform of the residual across the lines from a harmonic: (columns, rows) in cycles per frame, and
    /// value. `offsets`: offsets take up what whole lines do, so that it is no part of the harmonic's noise.
    pub(crate) fn samples(&self, p: Vector2<f64>, offsets: bool) -> Vec<([i64; 2], Complex64)> {
        let centre = (p / std::f64::consts::PI).map(|c| c.round() as i64);
        // Noise of whole lines stands at kx = 0 alone, and beside it through the window: what lies at another kx
        // says nothing of it.
        let columns = if offsets && centre.x.abs() < BESIDE {
            vec![-BESIDE, BESIDE]
        } else {
            vec![centre.x]
        };
        let rows = || (-ACROSS..=ACROSS).map(|dy| centre.y + dy);
        columns
            .into_iter()
            .flat_map(|x| rows().map(move |y| [x, y]))
            .map(|[x, y]| ([x, y], self.value(x, y)))
            .collect()
    }

    fn value(&self, x: i64, y: i64) -> Complex64 {
        let (rows, columns) = (self.spectrum.rows as i64, self.spectrum.columns as i64);
        let x = x.rem_euclid(columns);
        if x > columns / 2 {
            let (x, y) = ((columns - x) as usize, (-y).rem_euclid(rows) as usize);
            self.spectrum.value(x, y).conj()
        } else {
            self.spectrum.value(x as usize, y.rem_euclid(rows) as usize)
        }
    }

    /// Noise power per pixel over all frequencies, by the median.
    pub(crate) fn level(&self) -> f64 {
        let stride = (self.spectrum.values.len() / 65_536).max(1);
        let powers = self
            .spectrum
            .values
            .iter()
            .step_by(stride)
            .map(rustfft::num_complex::Complex64::norm_sqr);
        let mut powers: Vec<f64> = powers.collect();
        median(&mut powers) / (std::f64::consts::LN_2 * self.window_power)
    }

    /// The strongest wave away from the lattice, from slow waves and from the line ridge.
    pub(crate) fn foreign_wave(&self, frame: &Frame, model: &Model) -> Option<ForeignWave> {
        let noise = NoiseMap::new(&self.spectrum);
        let rows = self.spectrum.rows;
        let cycles = model.pair / std::f64::consts::PI;
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
                    if value.norm_sqr() > most * noise && (b > 0 || i > 1) {
                        let k = Vector2::new((b * BLOCK_WIDTH + i) as f64, signed);
                        if !ours(k) {
                            most = value.norm_sqr() / noise;
                            best = Some(k);
                        }
                    }
                }
            }
        }
        let k = best?;
        let bins = self.spectrum.values.len() as f64;
        Some(ForeignWave {
            wave_vector: (k * std::f64::consts::PI).component_div(&frame.edge()),
            significance: most,
            // The local noise is known to a fifth or so, hence the factor.
            threshold: 1.3 * (bins.ln() + 9.0),
        })
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
    /// The part of the inverse that belongs to these functions.
    inverse: DMatrix<f64>,
    /// Position of a harmonic's cosine in that part.
    places: Vec<Option<usize>>,
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
        let mut used = Vec::new();
        for (i, &index) in self.basis.indices.iter().enumerate() {
            for sign in [1.0, -1.0] {
                let p = sign * wave(&self.model.pair, index);
                let cycles = p / std::f64::consts::PI;
                let apart = |axis: usize| (cycles[axis] - centre[axis] as f64).abs();
                let reaches = |axis: usize| apart(axis) < half[axis] as f64 + SPREAD;
                if !(reaches(0) && reaches(1)) {
                    continue;
                }
                let transform = [0, 1].map(|axis| {
                    let at = |d: i64| {
                        let bin = std::f64::consts::PI * (centre[axis] + d) as f64;
                        window_transform(p[axis] - bin, self.size[axis])
                    };
                    (-half[axis]..=half[axis]).map(at).collect()
                });
                waves.push(Tap {
                    harmonic: i,
                    sign,
                    transform,
                });
                if places[i].is_none() {
                    places[i] = Some(used.len());
                    used.extend([2 * i, 2 * i + 1]);
                }
            }
        }
        used.extend(2 * count..2 * count + 4);
        Taps {
            waves,
            inverse: self.inverse.select_rows(&used).select_columns(&used),
            places,
        }
    }

    /// `vᴴ G⁻¹ v` for the bin at (dx, dy) from the centre of the taps.
    fn at(&self, taps: &Taps, dx: i64, dy: i64) -> f64 {
        let n = taps.inverse.nrows();
        let mut re = DVector::zeros(n);
        let mut im = DVector::zeros(n);
        for tap in &taps.waves {
            let (i, sign, [along, across]) = (tap.harmonic, tap.sign, &tap.transform);
            let [x, slope_x] = along[(dx + ALONG) as usize];
            let [y, slope_y] = across[(dy + self.across) as usize];
            if let Some(place) = taps.places[i] {
                re[place] += 0.5 * x * y;
                im[place + 1] -= 0.5 * sign * x * y;
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
        let form = |v: &DVector<f64>| {
            let rows = taps.inverse.column_iter().zip(v.iter());
            rows.map(|(column, value)| value * column.dot(v))
                .sum::<f64>()
        };
        form(&re) + form(&im)
    }
}

/// `Σ w cos(p X)` over the Hann window and its slope.
fn window_transform(p: f64, n: usize) -> [f64; 2] {
    const STEP: f64 = 1e-4;
    let at = |p: f64| hann_transform(p * 2.0 / n as f64, n);
    [at(p), (at(p + STEP) - at(p - STEP)) / (2.0 * STEP)]
}
