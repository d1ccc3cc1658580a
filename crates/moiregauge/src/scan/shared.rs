//! Noise that two images have in common.
//!
//! What a line does slowly, and what the sample shows beside its lattice, is in trace and retrace. Their errors
//! are then correlated, and the mean of the two is less accurate than if they were independent. The
//! coherence of what the fits leave around each harmonic,
//! `ρ = Re Σ a b* e^{−iΔφ} / √(Σ|a|² Σ|b|²)` with Δφ the phase of the harmonic in one against the other,
//! is the correlation of the errors; enlarging both variances by 1 + ρ gives their mean the error that it
//! has: `v(1 + ρ)/2`.
//!
//! What the sample shows beside its lattice (rough ground, stripes) is in every frame of it as well. Frames are shifted against each other:
//! a shift of f frames along the slow axis turns the bin that is δ cycles from the harmonic by `e^{2πiδf}`. The shift
//! with the highest coherence is taken.

use std::f64::consts::TAU;

use rustfft::num_complex::Complex64;

use crate::lattice::fit::fitted::LatticeFit;

/// A harmonic of the other image is the same one if it is nearer than this share of it: below half, where the next is as near.
const SAME: f64 = 0.2;
/// Neighbouring frequencies are correlated by their weights, the distance from the middle: Σ R² e^{iπX} is 0.3 of Σ R²; this number counts as one.
const CORRELATED: f64 = 1.5;
/// Coherence that chance exceeds in one case of two hundred counts, in units of its scatter.
const SIGNIFICANT: f64 = 2.6;
/// The same for the highest coherence at any shift, which some 16 independent ones are: once in a thousand.
const SEARCHED: f64 = 4.0;
/// Frames are shifted against each other in steps of a frame over this: half of what 33 rows resolve.
const TURN: usize = 64;
/// Steps that are tried on either side, a quarter of a frame: farther, frames show little of the same sample.
const SHIFTS: i64 = 16;

/// The correlation of the errors that two images of one scan have at the three first harmonics of the
/// first one; 0 where chance would do.
pub(crate) fn correlation(first: &LatticeFit, second: &LatticeFit) -> [f64; 3] {
    [0, 1, 2].map(|h| {
        let Some(partner) = Partner::of(first, second, h) else {
            return 0.0;
        };
        let mut sums = Sums::default();
        for (bin, a) in first.residual[h].bins() {
            let at = if partner.opposite {
                bin.map(|k| -k)
            } else {
                bin
            };
            let Some(b) = second.residual[partner.number].at(at) else {
                continue;
            };
            sums.add(a * partner.turned(b).conj(), [a, b]);
        }
        let (coherence, scatter) = (sums.coherence(sums.common), sums.scatter());
        if coherence > SIGNIFICANT * scatter {
            coherence.min(1.0)
        } else {
            0.0
        }
    })
}

/// The correlation of the errors that two frames of one sample have, by all three harmonics; 0 where chance would do.
pub(crate) fn correlation_of_frames(first: &LatticeFit, second: &LatticeFit) -> f64 {
    let mut sums = Sums::default();
    // The sums of the products, by bins from the harmonic across the lines modulo a turn of the smallest shift.
    let mut products = [Complex64::default(); TURN];
    for h in 0..3 {
        let Some(partner) = Partner::of(first, second, h) else {
            continue;
        };
        let (ours, others) = (&first.residual[h], &second.residual[partner.number]);
        if ours.columns.len() != others.columns.len() {
            continue;
        }
        for ([x, y], a) in ours.bins() {
            let column = ours.columns.iter().position(|column| *column == x);
            let (column, off) = (column.unwrap_or_default(), y - ours.middle());
            let (column, off_there) = if partner.opposite {
                (ours.columns.len() - 1 - column, -off)
            } else {
                (column, off)
            };
            let Some(b) = others.within(column, others.middle() + off_there) else {
                continue;
            };
            let product = a * partner.turned(b).conj();
            sums.add(product, [a, b]);
            products[off.rem_euclid(TURN as i64) as usize] += product;
        }
    }
    let turns =
        std::array::from_fn::<_, TURN, _>(|n| Complex64::cis(-TAU * n as f64 / TURN as f64));
    let shifted = |n: i64| {
        let all = products.iter().zip(0_i64..);
        let turned =
            all.map(|(product, off)| product * turns[(off * n).rem_euclid(TURN as i64) as usize]);
        sums.coherence(turned.sum())
    };
    let coherence = (-SHIFTS..=SHIFTS).map(shifted).fold(0.0, f64::max);
    if coherence > SEARCHED * sums.scatter() {
        coherence.min(1.0)
    } else {
        0.0
    }
}

/// Products of two images in some bins.
#[derive(Default)]
struct Sums {
    common: Complex64,
    squares: [f64; 2],
    count: f64,
}

impl Sums {
    fn add(&mut self, product: Complex64, values: [Complex64; 2]) {
        self.common += product;
        for (sum, value) in self.squares.iter_mut().zip(values) {
            *sum += value.norm_sqr();
        }
        self.count += 1.0;
    }

    /// 0 where there is nothing.
    fn coherence(&self, common: Complex64) -> f64 {
        let most = (self.squares[0] * self.squares[1]).sqrt();
        if most > 0.0 { common.re / most } else { 0.0 }
    }

    /// What chance makes of the coherence, standard deviation.
    fn scatter(&self) -> f64 {
        (CORRELATED / (2.0 * self.count)).sqrt()
    }
}

/// The same harmonic in another image, where it may have another name and the opposite sign.
struct Partner {
    number: usize,
    opposite: bool,
    /// The phase factor of the harmonic in the first against the second image.
    turn: Complex64,
}

impl Partner {
    /// That of the harmonic `h` of the first image.
    fn of(first: &LatticeFit, second: &LatticeFit, h: usize) -> Option<Self> {
        let wave = |fit: &LatticeFit, h: usize| {
            let [a, b] = fit.harmonics[h].index.map(f64::from);
            fit.wave_vectors.basis * nalgebra::Vector2::new(a, b)
        };
        let wanted = wave(first, h);
        let (number, sign) = (0..3).flat_map(|k| [(k, 1.0), (k, -1.0)]).min_by(|a, b| {
            let miss = |(k, sign): &(usize, f64)| (wave(second, *k) * *sign - wanted).norm();
            miss(a).total_cmp(&miss(b))
        })?;
        if (wave(second, number) * sign - wanted).norm() > SAME * wanted.norm() {
            return None;
        }
        let turn = first.harmonics[h].phase - sign * second.harmonics[number].phase;
        Some(Self {
            number,
            opposite: sign < 0.0,
            turn: Complex64::cis(turn),
        })
    }

    /// A value of the second image as the first one would have it.
    fn turned(&self, value: Complex64) -> Complex64 {
        let value = if self.opposite { value.conj() } else { value };
        value * self.turn
    }
}
