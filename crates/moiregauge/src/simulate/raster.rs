//! Where each pixel of a frame is and when it is recorded.
//!
//! Position `r = r₀ + J n` and time `t = t₀ + τ·n` of the pixel n = (column, row): nm, s. With the
//! line rate f and the overscan ρ a half line of 1/2f covers (1+ρ) of the width, so that
//! `τ_fast = ±1 / [2f (1+ρ)(N−1)]` and `τ_slow = ±1/f`.

use nalgebra::{Matrix2, Rotation2, Vector2};
use spmfile::{FrameDirection, LineDirection};

use crate::simulate::motion::Motion;
use crate::simulate::settings::{FirstDirection, Simulation};

/// Time of the pixels of one line direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PixelTime {
    /// Of pixel (0, 0), s.
    pub(crate) first: f64,
    /// From column to column and from row to row, s.
    pub(crate) step: Vector2<f64>,
}

impl PixelTime {
    /// Of a pixel (column, row), s.
    pub(crate) fn at(&self, [column, row]: [usize; 2]) -> f64 {
        self.first + self.step.x * column as f64 + self.step.y * row as f64
    }
}

/// One frame before it is recorded.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FramePlan {
    pub(crate) index: usize,
    pub(crate) direction: FrameDirection,
    /// Start and end, s.
    pub(crate) start: f64,
    pub(crate) end: f64,
    /// J, nm per pixel.
    pub(crate) pixel_to_nm: Matrix2<f64>,
    /// Position of pixel (0, 0), nm.
    pub(crate) origin: Vector2<f64>,
    pub(crate) centre: Vector2<f64>,
    pub(crate) trace: PixelTime,
    pub(crate) retrace: PixelTime,
}

impl FramePlan {
    pub(crate) fn new(settings: &Simulation, index: usize) -> Self {
        let raster = &settings.raster;
        let [columns, rows] = raster.pixels.map(|n| n as f64);
        let duration = rows / raster.line_rate_hz;
        let start = raster.start_s + index as f64 * (duration + raster.gap_s);
        let first_up = raster.first_direction == FirstDirection::Up;
        let turned = raster.alternating && index % 2 == 1;
        let direction = if first_up == turned {
            FrameDirection::Down
        } else {
            FrameDirection::Up
        };

        let pixel_to_nm = pixel_to_nm(settings);
        let centre = window_centre(settings, start + duration / 2.0, direction);
        let middle = Vector2::new(columns - 1.0, rows - 1.0) / 2.0;

        let half_line = 0.5 / raster.line_rate_hz;
        let pixel = half_line / ((1.0 + raster.rounding) * (columns - 1.0));
        let run_up = half_line * raster.rounding / (2.0 * (1.0 + raster.rounding));
        let (line, bottom) = match direction {
            FrameDirection::Up => (1.0 / raster.line_rate_hz, 0.0),
            FrameDirection::Down => (-1.0 / raster.line_rate_hz, duration - 2.0 * half_line),
        };
        let trace = PixelTime {
            first: start + bottom + run_up,
            step: Vector2::new(pixel, line),
        };
        let retrace = PixelTime {
            first: trace.first + half_line + pixel * (columns - 1.0),
            step: Vector2::new(-pixel, line),
        };
        Self {
            index,
            direction,
            start,
            end: start + duration,
            pixel_to_nm,
            origin: centre - pixel_to_nm * middle,
            centre,
            trace,
            retrace,
        }
    }

    pub(crate) fn time(&self, line: LineDirection) -> PixelTime {
        match line {
            LineDirection::Trace => self.trace,
            LineDirection::Retrace => self.retrace,
        }
    }

    /// The place of the sample that a pixel (column, row) shows, nm.
    pub(crate) fn place(
        &self,
        motion: Motion,
        line: LineDirection,
        pixel: [usize; 2],
    ) -> Vector2<f64> {
        let [column, row] = pixel.map(|n| n as f64);
        let time = self.time(line).at(pixel);
        self.origin + self.pixel_to_nm * Vector2::new(column, row) - motion.at(time)
    }
}

/// J: the nominal raster, rotated, through the scanner's gains and shear.
fn pixel_to_nm(settings: &Simulation) -> Matrix2<f64> {
    let raster = &settings.raster;
    let [columns, rows] = raster.pixels.map(|n| n as f64);
    let [width, height] = raster.nominal_size_nm;
    let pitch = Matrix2::new(width / (columns - 1.0), 0.0, 0.0, height / (rows - 1.0));
    let rotation = Rotation2::new(raster.rotation_deg.to_radians()).into_inner();
    let [gain_x, gain_y] = settings.window.gain;
    let (sine, cosine) = (settings.window.shear_mrad * 1e-3).sin_cos();
    let scanner = Matrix2::new(gain_x, gain_y * sine, 0.0, gain_y * cosine);
    scanner * rotation * pitch
}

fn window_centre(settings: &Simulation, time: f64, direction: FrameDirection) -> Vector2<f64> {
    let window = &settings.window;
    let side = match direction {
        FrameDirection::Up => 0.5,
        FrameDirection::Down => -0.5,
    };
    Vector2::from(window.centre_nm)
        + Vector2::from(window.creep_nm_per_min) * (time / 60.0)
        + Vector2::from(window.alternation_nm) * side
}

/// The name of the file for frame `index`, as in `scan.003.spm`.
pub(crate) fn file_name(index: usize) -> String {
    format!("scan.{index:03}.spm")
}
