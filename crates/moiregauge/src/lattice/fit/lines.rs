//! What whole lines do: offsets of their own, and lines that went wrong.

use rayon::prelude::*;

use crate::lattice::fit::frame::Frame;
use crate::lattice::fit::model::{AT_ONCE, Model, residual};
use crate::lattice::fit::tables::{Tables, sum};
use crate::numbers::dot::dot;
use crate::numbers::interrupt;
use crate::numbers::median::median;

/// Offsets of lines matter beyond this over the root of the number of lines: 3.5 times the scatter of the ratio, 2.3.
const OFFSETS: f64 = 8.0;
/// Whole cycles per line next to zero, where the noise is the same but for the offsets: the window spreads these to
/// one.
const NEAR: std::ops::RangeInclusive<usize> = 2..=6;
/// Lines at which these are looked at; the median of their five times as many numbers is known better
/// than that of the line means.
const LOOKED_AT: usize = 128;
/// Median of χ² with one degree of freedom.
const MEDIAN_CHI2: f64 = 0.454_936_423_119_572_8;
/// A line is bad if its residual exceeds the median one by this many standard deviations of such residuals (none is
/// so by chance), and by half.
const BAD: f64 = 6.0;
/// At most this share of the lines is left out; where more are bad the noise is just like that. Chosen by eye.
const MOST_BAD: f64 = 0.2;

/// Residuals line by line.
pub(crate) struct LineStatistics {
    /// Power of the line means over that of the waves of two to six cycles per line; 1 where
    /// lines have no offsets of their own.
    pub(crate) ratio: f64,
    /// Standard deviation of the offsets.
    pub(crate) sigma: f64,
    /// Residual of each line about its own mean, root mean square.
    rms: Vec<f64>,
}

/// What the residual of a line says.
struct OfLine {
    /// Power of its mean, times its pixels.
    mean: f64,
    /// Root mean square about the mean.
    rms: f64,
    /// Powers of the waves near zero; empty for a line at which these are not looked at.
    near: Vec<f64>,
}

impl OfLine {
    /// Of a line with a number of valid pixels.
    fn new(line: &mut [f64], present: usize, waves: Option<&Vec<[Vec<f64>; 2]>>) -> Self {
        let (columns, count) = (line.len(), present as f64);
        if present < columns {
            let mean = line.iter().filter(|v| v.is_finite()).sum::<f64>() / count;
            for value in line.iter_mut().filter(|v| v.is_nan()) {
                *value = mean;
            }
        }
        let mean = sum(line) / columns as f64;
        for value in line.iter_mut() {
            *value -= mean;
        }
        let power =
            |[cos, sin]: &[Vec<f64>; 2]| (dot(line, cos).powi(2) + dot(line, sin).powi(2)) / count;
        Self {
            mean: count * mean * mean,
            rms: (dot(line, line) / count).sqrt(),
            near: waves.into_iter().flatten().map(power).collect(),
        }
    }
}

impl LineStatistics {
    /// Reads the residuals of `model`. Medians: a few lines that went wrong do not matter.
    pub(crate) fn new(frame: &Frame, model: &Model) -> Self {
        let tables = Tables::new(frame, &model.pair, &model.basis.indices);
        let columns = frame.image.columns;
        let step = std::f64::consts::TAU / columns as f64;
        let waves: Vec<[Vec<f64>; 2]> = NEAR
            .map(|m| {
                let angle = |c: usize| (step * m as f64 * c as f64).sin_cos();
                let (sin, cos) = (0..columns).map(angle).unzip();
                [cos, sin]
            })
            .collect();
        let stride = (frame.lines() / LOOKED_AT).max(1);
        let used = (0..frame.image.rows).filter(|&row| frame.present[row] > 0);
        let used: Vec<usize> = used.collect();
        let seen = used.par_iter().enumerate().with_min_len(AT_ONCE).map_init(
            || vec![0.0; columns],
            |line, (number, &row)| {
                interrupt::check();
                residual(frame, model, &tables, row, line);
                let looked_at = (number + 1) % stride == 0;
                OfLine::new(line, frame.present[row], looked_at.then_some(&waves))
            },
        );
        let seen: Vec<OfLine> = seen.collect();
        let mut rms = vec![0.0; frame.image.rows];
        for (row, line) in used.into_iter().zip(&seen) {
            rms[row] = line.rms;
        }
        let mut means: Vec<f64> = seen.iter().map(|line| line.mean).collect();
        let mut near: Vec<f64> = seen.into_iter().flat_map(|line| line.near).collect();
        let ridge = median(&mut means) / MEDIAN_CHI2;
        let adjacent = median(&mut near) / std::f64::consts::LN_2;
        Self {
            ratio: ridge / adjacent,
            sigma: ((ridge - adjacent).max(0.0) / columns as f64).sqrt(),
            rms,
        }
    }

    /// Whether offsets explain more than chance does. The median of n squares of means scatters by
    /// 2.3/√n; three and a half times that.
    pub(crate) fn offsets_matter(&self, frame: &Frame) -> bool {
        self.ratio > 1.0 + OFFSETS / (frame.lines() as f64).sqrt()
    }

    /// λ of each line: `n σ_l²/(σ² + n σ_l²)`.
    pub(crate) fn lambda(&self, frame: &Frame) -> Vec<f64> {
        let columns = frame.image.columns as f64;
        let share = |&n: &usize| {
            let excess = (self.ratio - 1.0) * n as f64 / columns;
            excess / (1.0 + excess)
        };
        frame.present.iter().map(share).collect()
    }

    /// The lines that went wrong.
    pub(crate) fn bad(&self, frame: &Frame) -> Vec<usize> {
        let used = |row: &usize| frame.present[*row] > 0;
        let rows = || (0..self.rms.len()).filter(used);
        let mut sizes: Vec<f64> = rows().map(|r| self.rms[r]).collect();
        let typical = median(&mut sizes);
        // Lines with fewer pixels scatter more.
        let whole = frame.image.columns as f64;
        let scatter = |r: usize| (frame.present[r] as f64 / whole).sqrt();
        let mut off: Vec<f64> = rows()
            .map(|r| (self.rms[r] - typical).abs() * scatter(r))
            .collect();
        let spread = 1.4826 * median(&mut off);
        let most = |r: usize| typical + (BAD * spread / scatter(r)).max(0.5 * typical);
        let bad: Vec<usize> = rows().filter(|&r| self.rms[r] > most(r)).collect();
        if bad.len() as f64 > MOST_BAD * frame.lines() as f64 {
            Vec::new()
        } else {
            bad
        }
    }
}
