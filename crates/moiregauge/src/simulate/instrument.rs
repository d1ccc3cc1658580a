//! What an instrument adds that is no white noise: hum, scars, sensors that lag or glitch.

use nalgebra::Vector2;
use rand::RngExt as _;
use spmfile::LineDirection;

use crate::numbers::rng;
use crate::simulate::feature::SampleFeature;
use crate::simulate::raster::FramePlan;
use crate::simulate::settings::Simulation;

/// All that one line direction of one frame is disturbed by.
#[derive(Clone, Debug)]
pub(crate) struct Disturbances {
    /// Amplitude and rad/s.
    hum: Vec<(f64, f64)>,
    scars: Vec<Scar>,
    /// Share of the samples, and nm.
    glitches: Vec<(f64, f64)>,
    /// Time constants, s.
    lags: Vec<f64>,
    /// s.
    half_line: f64,
    run_up: f64,
}

/// A part of a line that lies too high.
#[derive(Clone, Copy, Debug)]
struct Scar {
    row: usize,
    from: f64,
    to: f64,
    height: f64,
}

impl Disturbances {
    pub(crate) fn new(settings: &Simulation, plan: &FramePlan, direction: LineDirection) -> Self {
        let of = |class: &'static str| settings.features.iter().filter(move |f| f.class == class);
        let raster = &settings.raster;
        let half_line = 0.5 / raster.line_rate_hz;
        let turn = |f: &SampleFeature| std::f64::consts::TAU * f.value("frequency");
        Self {
            hum: of("hum").map(|f| (f.value("amplitude"), turn(f))).collect(),
            scars: of("scars")
                .zip(0..)
                .flat_map(|(f, n)| scars(f, n, settings, plan, direction))
                .collect(),
            glitches: of("glitches")
                .map(|f| (f.value("share"), f.value("size")))
                .collect(),
            lags: of("lag").map(|f| f.value("time") / 1000.0).collect(),
            half_line,
            run_up: half_line * raster.rounding / (2.0 * (1.0 + raster.rounding)),
        }
    }

    /// Degrees of phase on top of what is at a pixel.
    pub(crate) fn on_image(&self, row: usize, share: f64, time: f64) -> f64 {
        let hum = self.hum.iter().map(|(a, turn)| a * (turn * time).sin());
        let here = |s: &&Scar| s.row == row && (s.from..s.to).contains(&share);
        let scars = self.scars.iter().filter(here).map(|s| s.height);
        hum.chain(scars).sum()
    }

    /// By how much sensors of the first order are behind, nm: `V T` at constant speed, while after each turn-around
    /// they are ahead by as much, `V T (1 − 2 e^{−t/T} / (1 + e^{−H/T}))` with H the time of half a line.
    pub(crate) fn behind(
        &self,
        plan: &FramePlan,
        direction: LineDirection,
        since_start: f64,
    ) -> Vector2<f64> {
        let step = plan.time(direction).step;
        let fast = plan.pixel_to_nm.column(0) / step.x;
        let slow = plan.pixel_to_nm.column(1) / step.y;
        let mut behind = Vector2::zeros();
        for &lag in self.lags.iter().filter(|lag| **lag > 0.0) {
            let passed = (-(since_start + self.run_up) / lag).exp();
            let whole = (-self.half_line / lag).exp();
            behind += lag * (fast * (1.0 - 2.0 * passed / (1.0 + whole)) + slow);
        }
        behind
    }

    /// The glitch of one sample of a sensor, nm; 0 for nearly all.
    pub(crate) fn glitch(&self, rng: &mut impl rand::Rng) -> f64 {
        let mut sum = 0.0;
        for (share, size) in &self.glitches {
            if rng.random::<f64>() < *share {
                sum += if rng.random::<bool>() { *size } else { -size };
            }
        }
        sum
    }
}

/// As many as are asked for, of random lengths and heights, anywhere.
fn scars(
    feature: &SampleFeature,
    number: u64,
    settings: &Simulation,
    plan: &FramePlan,
    direction: LineDirection,
) -> Vec<Scar> {
    let rows = settings.raster.pixels[1];
    let own = u64::from(direction == LineDirection::Retrace);
    let mut rng = rng::stream(
        settings.seed,
        "simulate scars",
        (number << 32) | (plan.index as u64 * 2 + own),
    );
    let mut share = || rng.random::<f64>();
    let count = feature.value("count").round() as usize;
    (0..count)
        .map(|_| {
            let from = share();
            // Exponential lengths.
            let length = -feature.value("length") * (1.0 - share()).ln();
            Scar {
                row: ((share() * rows as f64) as usize).min(rows - 1),
                from,
                to: from + length,
                height: feature.value("height") * (0.5 + share()),
            }
        })
        .collect()
}

/// The stream of the glitches of one line of a frame.
pub(crate) fn glitch_stream(
    settings: &Simulation,
    plan: &FramePlan,
    direction: LineDirection,
    row: usize,
) -> impl rand::Rng {
    let name = match direction {
        LineDirection::Trace => "simulate glitches trace",
        LineDirection::Retrace => "simulate glitches retrace",
    };
    let index = ((plan.index as u64) << 32) | row as u64;
    rng::stream(settings.seed, name, index)
}
