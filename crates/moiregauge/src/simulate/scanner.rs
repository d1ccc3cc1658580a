//! What a scanner does beside the raster: hysteresis, creep, and ringing after each turn-around.

use nalgebra::Vector2;
use spmfile::{FrameDirection, LineDirection};

use crate::simulate::feature::SampleFeature;
use crate::simulate::raster::{FramePlan, PixelTime};
use crate::simulate::settings::Simulation;

/// The scanner of one line direction of one frame.
#[derive(Clone, Debug)]
pub(crate) struct Scanner {
    bends: Vec<SampleFeature>,
    /// From the first to the last pixel of a line, and of a column, nm.
    sides: [Vector2<f64>; 2],
    pixels: [f64; 2],
    time: PixelTime,
    start: f64,
    run_up: f64,
    /// Which way it goes along the lines and across them.
    ways: [f64; 2],
}

impl Scanner {
    /// `None` of one that follows the raster.
    pub(crate) fn new(
        settings: &Simulation,
        plan: &FramePlan,
        direction: LineDirection,
    ) -> Option<Self> {
        let of_scanner =
            |f: &&SampleFeature| matches!(f.class.as_str(), "hysteresis" | "creep" | "ringing");
        let bends: Vec<SampleFeature> = settings
            .features
            .iter()
            .filter(of_scanner)
            .cloned()
            .collect();
        let pixels = settings.raster.pixels.map(|n| n as f64 - 1.0);
        let raster = &settings.raster;
        (!bends.is_empty()).then(|| Self {
            bends,
            sides: [0, 1].map(|i| plan.pixel_to_nm.column(i) * pixels[i]),
            pixels,
            time: plan.time(direction),
            start: plan.start,
            run_up: 0.5 / raster.line_rate_hz * raster.rounding / (2.0 * (1.0 + raster.rounding)),
            ways: [
                if direction == LineDirection::Trace {
                    1.0
                } else {
                    -1.0
                },
                if plan.direction == FrameDirection::Up {
                    1.0
                } else {
                    -1.0
                },
            ],
        })
    }

    /// How far from the raster it is at a pixel (column, row), nm, and what of that the sensors record.
    pub(crate) fn off(&self, pixel: [usize; 2]) -> [Vector2<f64>; 2] {
        let (mut all, mut recorded) = (Vector2::zeros(), Vector2::zeros());
        for bend in &self.bends {
            let off = self.by(bend, pixel);
            all += off;
            recorded += off * bend.value("recorded");
        }
        [all, recorded]
    }

    fn by(&self, bend: &SampleFeature, pixel: [usize; 2]) -> Vector2<f64> {
        let shares = |of: [f64; 2]| (self.sides[0] * of[0] + self.sides[1] * of[1]) / 100.0;
        let sizes = ["fast", "slow"].map(|key| bend.value(key));
        match bend.class.as_str() {
            "hysteresis" => shares([0, 1].map(|i| {
                let u = 2.0 * pixel[i] as f64 / self.pixels[i] - 1.0;
                let bow = (1.0 - u * u) * (1.0 + bend.value("skew") * u);
                self.ways[i] * sizes[i] / 2.0 * bow
            })),
            "creep" => {
                let since = self.time.at(pixel) - self.start;
                let decades = (1.0 + since / bend.value("begin")).log10();
                shares(sizes.map(|size| size * decades))
            }
            _ => {
                let column = pixel[0] as f64;
                let passed = if self.ways[0] > 0.0 {
                    column
                } else {
                    self.pixels[0] - column
                };
                let since = passed * self.time.step.x.abs() + self.run_up;
                let left = (-since / (bend.value("time") / 1000.0)).exp();
                let turn = std::f64::consts::TAU * bend.value("frequency") * since;
                shares([self.ways[0] * bend.value("size") * left * turn.cos(), 0.0])
            }
        }
    }
}
