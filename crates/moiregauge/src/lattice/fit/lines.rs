//! What whole lines do: offsets of their own, and lines that went wrong.

use crate::lattice::fit::frame::Frame;
use crate::lattice::fit::model::{Model, residuals};
use crate::lattice::fit::tables::{Tables, sum};
use crate::numbers::dot::dot;
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
        let mut rms = vec![0.0; frame.image.rows];
        let stride = (frame.lines() / LOOKED_AT).max(1);
        let mut count_lines = 0;
        let (mut means, mut near) = (Vec::new(), Vec::new());
        residuals(frame, model, &tables, |row, line| {
            let count = frame.present[row] as f64;
            if frame.present[row] < columns {
                let mean = line.iter().filter(|v| v.is_finite()).sum::<f64>() / count;
                for value in line.iter_mut().filter(|v| v.is_nan()) {
                    *value = mean;
                }
            }
            let mean = sum(line) / columns as f64;
            for value in line.iter_mut() {
                *value -= mean;
            }
            means.push(count * mean * mean);
            rms[row] = (dot(line, line) / count).sqrt();
            count_lines += 1;
            if count_lines % stride == 0 {
                for [cos, sin] in &waves {
                    near.push((dot(line, cos).powi(2) + dot(line, sin).powi(2)) / count);
                }
            }
        });
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
