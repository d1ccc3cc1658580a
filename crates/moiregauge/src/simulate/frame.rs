//! One frame: the pattern, seen through drift, time and noise, as the instrument's channels.
//!
//! The phase of a harmonic along a line is a quadratic in the column, as time is linear in it and
//! the drift quadratic in time. Its values follow from two complex multiplications per pixel.

use nalgebra::Complex;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use spmfile::{Channel, LineDirection, Samples, Scan};

use crate::numbers::interrupt;
use crate::numbers::rng;
use crate::simulate::calendar::date_after;
use crate::simulate::instrument::{Disturbances, glitch_stream};
use crate::simulate::motion::Motion;
use crate::simulate::raster::{FramePlan, PixelTime};
use crate::simulate::scanner::Scanner;
use crate::simulate::scene::{Harmonic, Scene};
use crate::simulate::settings::Simulation;
use crate::simulate::surface::Surface;

/// A detector of the instrument.
struct Detector {
    name: &'static str,
    internal_name: &'static str,
    unit: &'static str,
    /// Its full range; a count is 2⁻³² of it.
    range: f64,
}

const COUNTS: f64 = 4_294_967_296.0;
const PHASE: Detector = Detector {
    name: "TR Phase",
    internal_name: "TRPhase",
    unit: "°",
    range: 360.0,
};
const AMPLITUDE: Detector = Detector {
    name: "TR Amplitude",
    internal_name: "TRAmplitude",
    unit: "mV",
    range: 4000.0,
};
const X_SENSOR: Detector = Detector {
    name: "Xsensor",
    internal_name: "Xsensor",
    unit: "nm",
    range: 24.576 * 3410.089,
};
const Y_SENSOR: Detector = Detector {
    name: "Ysensor",
    internal_name: "Ysensor",
    unit: "nm",
    range: 24.576 * 3641.009,
};

/// The amplitude image: where the phase is high the amplitude is low. A usual amplitude, mV, ...
const MEAN_AMPLITUDE_MV: f64 = 180.0;
/// ... and a usual slope.
const MV_PER_DEG: f64 = -2.5;

/// The channels of one line direction, as counts.
struct Line {
    phase: Vec<i32>,
    amplitude: Vec<i32>,
    x: Vec<i32>,
    y: Vec<i32>,
}

/// The frame as the instrument would have written it.
pub(crate) fn record(
    settings: &Simulation,
    scene: &Scene,
    surface: Option<&Surface>,
    plan: &FramePlan,
) -> Scan {
    let raster = &settings.raster;
    let mut directions = vec![LineDirection::Trace];
    if raster.retrace {
        directions.push(LineDirection::Retrace);
    }
    let lines: Vec<(LineDirection, Line)> = directions
        .into_iter()
        .map(|direction| {
            let sample = Sample { scene, surface };
            (direction, record_line(settings, sample, plan, direction))
        })
        .collect();

    let mut phase = Vec::new();
    let mut amplitude = Vec::new();
    let mut x = Vec::new();
    let mut y = Vec::new();
    for (direction, line) in lines {
        phase.push(channel(settings, direction, &PHASE, line.phase));
        amplitude.push(channel(settings, direction, &AMPLITUDE, line.amplitude));
        if raster.sensors {
            x.push(channel(settings, direction, &X_SENSOR, line.x));
            y.push(channel(settings, direction, &Y_SENSOR, line.y));
        }
    }
    Scan {
        format: "simulated".to_owned(),
        instrument: Some("moiregauge simulator".to_owned()),
        acquired: Some(date_after(plan.end + delay(settings, plan))),
        frame_direction: Some(plan.direction),
        line_rate_hz: Some(raster.line_rate_hz),
        rounding: Some(raster.rounding),
        rotation_rad: raster.rotation_deg.to_radians(),
        offset_nm: [0.0, 0.0],
        size_nm: Some(raster.nominal_size_nm),
        closed_loop: Some(false),
        line_times_s: None,
        notes: Vec::new(),
        metadata: Vec::new(),
        channels: [phase, amplitude, x, y].concat(),
        unreadable: Vec::new(),
    }
}

/// Time from the end of a frame to that in its header, s.
fn delay(settings: &Simulation, plan: &FramePlan) -> f64 {
    let mut rng = rng::stream(settings.seed, "simulate clock", plan.index as u64);
    let normal: f64 = StandardNormal.sample(&mut rng);
    settings.noise.clock_s * normal
}

fn channel(
    settings: &Simulation,
    direction: LineDirection,
    detector: &Detector,
    counts: Vec<i32>,
) -> Channel {
    let [columns, rows] = settings.raster.pixels;
    let [width, height] = settings.raster.nominal_size_nm;
    let &Detector {
        name,
        internal_name,
        unit,
        range,
    } = detector;
    Channel {
        name: name.to_owned(),
        internal_name: internal_name.to_owned(),
        unit: unit.to_owned(),
        line_direction: Some(direction),
        scan_line: Some("Main".to_owned()),
        rows,
        columns,
        width_nm: Some(width),
        height_nm: Some(height),
        span: spmfile::Span::Frame,
        scale: range / COUNTS,
        offset: 0.0,
        scaling: format!("count × {range} {unit} / 2³²"),
        plane_fit: None,
        samples: Samples::I32(counts),
    }
}

/// All channels of one line direction; lines in parallel, each with random numbers of its own.
fn record_line(
    settings: &Simulation,
    sample: Sample,
    plan: &FramePlan,
    direction: LineDirection,
) -> Line {
    let [columns, rows] = settings.raster.pixels;
    let empty = || vec![0_i32; columns * rows];
    let mut line = Line {
        phase: empty(),
        amplitude: empty(),
        x: empty(),
        y: empty(),
    };
    let offsets = line_offsets(settings, plan, direction);
    let recorder = Recorder {
        settings,
        sample,
        plan,
        direction,
        time: plan.time(direction),
        disturbances: (!settings.features.is_empty())
            .then(|| Disturbances::new(settings, plan, direction)),
        scanner: Scanner::new(settings, plan, direction),
        motion: Motion::new(&settings.drift),
    };
    (
        line.phase.par_chunks_mut(columns),
        line.amplitude.par_chunks_mut(columns),
        line.x.par_chunks_mut(columns),
        line.y.par_chunks_mut(columns),
    )
        .into_par_iter()
        .enumerate()
        .for_each(|(row, (phase, amplitude, x, y))| {
            interrupt::check();
            recorder.image(row, offsets[row], phase, amplitude);
            if settings.raster.sensors {
                recorder.sensors(row, x, y);
            }
        });
    line
}

/// The sample: a lattice, or a surface with all that it has.
#[derive(Clone, Copy)]
struct Sample<'a> {
    scene: &'a Scene,
    surface: Option<&'a Surface>,
}

/// What does not change from line to line.
struct Recorder<'a> {
    settings: &'a Simulation,
    sample: Sample<'a>,
    plan: &'a FramePlan,
    direction: LineDirection,
    time: PixelTime,
    motion: Motion,
    disturbances: Option<Disturbances>,
    scanner: Option<Scanner>,
}

impl Recorder<'_> {
    fn image(&self, row: usize, offset: f64, phase: &mut [i32], amplitude: &mut [i32]) {
        let [columns, rows] = self.settings.raster.pixels.map(|n| n as f64 - 1.0);
        let noise = &self.settings.noise;
        let mut pattern = vec![0.0; phase.len()];
        let waves = match self.sample.surface {
            Some(surface) => {
                for (column, value) in pattern.iter_mut().enumerate() {
                    let at = self.plan.place(self.motion, self.direction, [column, row]);
                    let off = self.scanner.as_ref().map(|s| s.off([column, row])[0]);
                    let at = at + off.unwrap_or_default();
                    *value = surface.value(at);
                    if self.scanner.is_some() {
                        *value += surface
                            .ground
                            .iter()
                            .map(|wave| wave.amplitude * (wave.wave.dot(&at) + wave.phase).cos())
                            .sum::<f64>();
                    }
                }
                match self.scanner {
                    Some(_) => &[],
                    None => surface.ground.as_slice(),
                }
            }
            None => self.sample.scene.harmonics.as_slice(),
        };
        for harmonic in waves {
            self.add_harmonic(row, harmonic, &mut pattern);
        }
        if let Some(disturbances) = &self.disturbances {
            for (column, value) in pattern.iter_mut().enumerate() {
                let time = self.time.at([column, row]);
                *value += disturbances.on_image(row, column as f64 / columns, time);
            }
        }
        let mut normal = normals(self.settings.seed, "image", self.plan, self.direction, row);
        let slow = noise.plane_deg[1] * (row as f64 / rows - 0.5) + offset;
        for (column, value) in pattern.iter().enumerate() {
            let background = slow + noise.plane_deg[0] * (column as f64 / columns - 0.5);
            let degrees = value + background + noise.pixel_deg * normal();
            let millivolts =
                MEAN_AMPLITUDE_MV + MV_PER_DEG * (value + background + noise.pixel_deg * normal());
            phase[column] = count(degrees, PHASE.range);
            amplitude[column] = count(millivolts, AMPLITUDE.range);
        }
    }

    /// Adds `A cos(G·(r − d(t)) + φ)` along a line: phase a + b c + g c² in the column c.
    fn add_harmonic(&self, row: usize, harmonic: &Harmonic, pattern: &mut [f64]) {
        let row = row as f64;
        let step = self.plan.pixel_to_nm;
        let start = self.plan.origin + step.column(1) * row;
        let time = self.time.first + self.time.step.y * row;
        let pixel = self.time.step.x;
        let Motion {
            velocity,
            acceleration,
        } = self.motion;
        let wave = &harmonic.wave;

        let constant = wave.dot(&(start - self.motion.at(time))) + harmonic.phase;
        let speed = velocity + acceleration * time;
        let linear = wave.dot(&(step.column(0) - speed * pixel));
        let quadratic = -wave.dot(&acceleration) * pixel * pixel / 2.0;

        let mut value = Complex::cis(constant) * harmonic.amplitude;
        let mut turn = Complex::cis(linear + quadratic);
        let further = Complex::cis(2.0 * quadratic);
        for pixel in pattern {
            *pixel += value.re;
            value *= turn;
            turn *= further;
        }
    }

    fn sensors(&self, row: usize, x: &mut [i32], y: &mut [i32]) {
        let sigma = self.settings.noise.sensor_nm;
        let step = self.plan.pixel_to_nm;
        let start = self.plan.origin + step.column(1) * row as f64;
        let mut normal = normals(
            self.settings.seed,
            "sensors",
            self.plan,
            self.direction,
            row,
        );
        let mut glitches = glitch_stream(self.settings, self.plan, self.direction, row);
        let last = x.len() - 1;
        for (column, (x, y)) in x.iter_mut().zip(y).enumerate() {
            let mut position = start + step.column(0) * column as f64;
            if let Some(scanner) = &self.scanner {
                position += scanner.off([column, row])[1];
            }
            if let Some(disturbances) = &self.disturbances {
                let passed = match self.direction {
                    LineDirection::Trace => column,
                    LineDirection::Retrace => last - column,
                };
                let since_start = passed as f64 * self.time.step.x.abs();
                position -= disturbances.behind(self.plan, self.direction, since_start);
                position.x += disturbances.glitch(&mut glitches);
                position.y += disturbances.glitch(&mut glitches);
            }
            *x = count(position.x + sigma * normal(), X_SENSOR.range);
            *y = count(position.y + sigma * normal(), Y_SENSOR.range);
        }
    }
}

/// Offset of every row: white noise, and noise with a 1/f spectrum over the time of the frame.
fn line_offsets(settings: &Simulation, plan: &FramePlan, direction: LineDirection) -> Vec<f64> {
    let rows = settings.raster.pixels[1];
    let noise = &settings.noise;
    let index = plan.index as u64;
    // Trace and retrace take turns; both are drawn so that they share one slow fluctuation.
    let flicker = flicker(rows * 2, settings.seed, index);
    let own = match direction {
        LineDirection::Trace => 0,
        LineDirection::Retrace => 1,
    };
    let mut rng = rng::stream(settings.seed, "simulate lines", index * 2 + own);
    let in_time: Vec<f64> = (0..rows)
        .map(|line| {
            let white: f64 = StandardNormal.sample(&mut rng);
            noise.line_deg * white + noise.flicker_deg * flicker[2 * line + own as usize]
        })
        .collect();
    match plan.direction {
        spmfile::FrameDirection::Up => in_time,
        spmfile::FrameDirection::Down => in_time.into_iter().rev().collect(),
    }
}

/// Unit variance and a 1/f spectrum: a sum of relaxations whose times double.
fn flicker(length: usize, seed: u64, index: u64) -> Vec<f64> {
    let octaves = length.ilog2() + 1;
    let weight = f64::from(octaves).sqrt().recip();
    let mut sum = vec![0.0; length];
    let mut rng = rng::stream(seed, "simulate flicker", index);
    for octave in 0..octaves {
        let memory = (-0.5_f64.powf(f64::from(octave))).exp();
        let fresh = (1.0 - memory * memory).sqrt();
        let mut state: f64 = StandardNormal.sample(&mut rng);
        for value in &mut sum {
            *value += weight * state;
            let normal: f64 = StandardNormal.sample(&mut rng);
            state = memory * state + fresh * normal;
        }
    }
    sum
}

/// Normal deviates for one line of one detector.
fn normals(
    seed: u64,
    detector: &str,
    plan: &FramePlan,
    direction: LineDirection,
    row: usize,
) -> impl FnMut() -> f64 {
    let line = match direction {
        LineDirection::Trace => "trace",
        LineDirection::Retrace => "retrace",
    };
    let index = ((plan.index as u64) << 32) | row as u64;
    let mut rng = rng::stream(seed, &format!("simulate {detector} {line}"), index);
    move || StandardNormal.sample(&mut rng)
}

/// Nearest count; beyond the range the detector saturates.
fn count(value: f64, range: f64) -> i32 {
    (value * (COUNTS / range)).round() as i32
}
