//! Noise of the residual: its power around each harmonic.
//!
//! The residual is Hann-windowed and transformed. The fit removes power near each harmonic, and with few periods
//! that is nearly everywhere. So the measured power is divided by the power that white noise of unit variance would leave in the same
//! bins ([`leverage`](crate::lattice::fit::leverage)). The errors of the wave vectors follow from it in
//! [`local`](crate::lattice::fit::local).

use std::f64::consts::PI;

use nalgebra::Vector2;

use crate::lattice::fit::frame::Frame;
use crate::lattice::fit::leverage::{ALONG, Leverage};
use crate::lattice::fit::local::{Bin, acting_on};
use crate::numbers::median::median;
use crate::spectrum::fourier::wide;
use crate::spectrum::hann::hann;
use crate::spectrum::transform::Spectrum;

/// Bins nearer to zero frequency than this belong to the background: a plane fills the first.
const BACKGROUND: i64 = 2;
/// The first column of the spectrum without power of line offsets, which the window spreads over two columns.
pub(super) const BESIDE: i64 = 2;

/// The periodogram of a residual.
pub(crate) struct ResidualNoise {
    /// In single precision: noise is known to a few per cent.
    spectrum: Spectrum<f32>,
    /// `Σ w²` of the window over the pixels that are used.
    window_power: f64,
    pub(super) free_lines: bool,
}

impl ResidualNoise {
    /// `residual` writes one line, 0 at masked pixels, and returns a value for it; the values are returned in order. `free_lines`: the
    /// fit removed the mean of each line.
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
            free_lines,
        };
        (noise, said)
    }

    /// Noise power around a harmonic as it acts on the x and on the y component of its wave vector and on
    /// its phase; white noise of variance σ² gives σ². `lambda` is the fraction of the line means that line
    /// offsets absorb. `None` if the fit leaves no power.
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

    /// Noise power around a harmonic by the median, which harmonics that are not fitted yet do not bias.
    pub(crate) fn median_around(&self, p: Vector2<f64>, leverage: &Leverage) -> Option<f64> {
        let mut all = Vec::new();
        self.bins(p, leverage, |_, found, white| {
            if white > 0.3 {
                all.push(found / white);
            }
        });
        (!all.is_empty()).then(|| median(&mut all) / std::f64::consts::LN_2)
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
                let white = 1.0 - leverage.at(&mut taps, dx, dy) / self.window_power;
                if white > 0.02 {
                    each(Vector2::new(x, y), self.power(x, y), white);
                }
            }
        }
    }

    /// Power per pixel at (x, y) cycles per frame.
    pub(super) fn power(&self, x: i64, y: i64) -> f64 {
        self.spectrum.at(x, y).norm_sqr() / self.window_power
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
}
