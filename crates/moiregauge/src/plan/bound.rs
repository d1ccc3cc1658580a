//! The Cramér–Rao bound of a simulated set: the errors below which nobody gets.
//!
//! One harmonic `A cos(q·n + φ)` in N pixels of white noise σ (amplitude, phase and background free)
//! tells q, in each direction of n columns or rows, with the information `A² N (n² − 1)/24σ²`, and its
//! phase at the middle of the frame with `A² N/2σ²`, independent of q. The harmonics of one lattice add
//! up; frames and line directions add up in the joint fit, whose covariance for exact sightings is the
//! bound.
//!
//! Line noise, tip events and harmonics that overlap on a small frame raise it; they are left out. A plan
//! ([`crate::plan::predict`]) asks for line noise: lines of n pixels that have offsets of their own, with the variance `σ_l²`, lose
//! the share `λ = n σ_l²/(σ² + n σ_l²)` of their means, and with it what a wave of m cycles per line has there: `s² =
//! sinc²(πm)` of itself and t of its slope along the line (`Lines`). Offsets are taken for white from line to line.
//!
//! # References
//! Rife and Boorstyn, Bell Syst. Tech. J. 55, 1389 (1976), for one wave.

use heterostrain::lattice::{Waves, reciprocal};
use heterostrain::strain::twist_strain;
use nalgebra::{Matrix2, Matrix4, Vector2};

use crate::drift::joint::choose::fit;
use crate::drift::joint::sighting::Detection;
use crate::numbers::three::three;
use crate::simulate::settings::Simulation;
use crate::simulate::simulator::Simulator;
use crate::simulate::truth::FrameTruth;
use crate::spectrum::phases::Phases;

/// The smallest possible standard errors of a set.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Bound {
    /// Of the drift along x and y, nm/s.
    pub drift: [f64; 2],
    /// Of the twist, rad.
    pub twist: f64,
    /// Of the components of the strain vector.
    pub strain: [f64; 2],
    /// Whether the phases of successive frames can be linked under these conditions.
    pub linked: bool,
}

/// The bound for the frames of `simulator`, with frame times known to `time_sigma` (s) and, if `linked`,
/// with their phases.
///
/// `None` without pixel noise, or where the frames do not determine drift and lattice.
pub fn cramer_rao(simulator: &Simulator, time_sigma: f64, linked: bool) -> Option<Bound> {
    let settings = simulator.settings();
    let (sightings, pair, drift) = ideal_sightings(simulator, linked, false)?;
    let found = fit(&sightings, &pair, &drift, time_sigma)?;
    let lattice = found.waves.lattice()?;
    let sample = &settings.sample;
    let strain = twist_strain(&lattice, sample.bilayer(), sample.strain_convention).ok()?;
    let root = |variance: f64| variance.max(0.0).sqrt();
    let (c, e) = (found.velocity_covariance, strain.strain().covariance);
    Some(Bound {
        drift: [root(c.m11), root(c.m22)],
        twist: strain.twist().sigma,
        strain: [root(e.m11), root(e.m22)],
        linked: found.terms.phases,
    })
}

/// What every line of every frame of a set shows exactly, with the errors that noise of the pixels, and with
/// `line_noise` that of the lines, makes inevitable; the reciprocal pair (rad/nm) and the drift (nm/s).
pub(crate) fn ideal_sightings(
    simulator: &Simulator,
    linked: bool,
    line_noise: bool,
) -> Option<(Vec<Detection>, Matrix2<f64>, Vector2<f64>)> {
    let settings = simulator.settings();
    let offsets = if line_noise {
        Lines::of(settings)
    } else {
        Lines { lambda: 0.0 }
    };
    let truth = simulator.truth();
    let [first, second, _] = truth.lattice_vectors_nm.map(Vector2::from);
    // Two of the shortest wave vectors that stand at 60°: their difference is the third.
    let dual = reciprocal(&Matrix2::from_columns(&[first, second]))?;
    let (k1, k2) = (dual.column(0).into_owned(), dual.column(1).into_owned());
    let second = if k1.dot(&k2) > 0.0 { k2 } else { k1 + k2 };
    let pair = Matrix2::from_columns(&[k1, second]);
    let drift = Vector2::from(truth.mean_drift_nm_per_min) / 60.0;
    let mut sightings = Vec::new();
    for (scan, frame) in truth.frames.iter().enumerate() {
        let lines = [Some(0), settings.raster.retrace.then_some(1)];
        for class in lines.into_iter().flatten() {
            let image = ideal(simulator, frame, &pair, &drift, class, &offsets)?;
            sightings.push(Detection {
                scan,
                phases: image.phases.filter(|_| linked),
                ..image
            });
        }
    }
    Some((sightings, pair, drift))
}

/// What one line direction (class 0 trace, 1 retrace) of a frame shows exactly, with the errors that it
/// has to have.
fn ideal(
    simulator: &Simulator,
    frame: &FrameTruth,
    pair: &Matrix2<f64>,
    drift: &Vector2<f64>,
    class: usize,
    lines: &Lines,
) -> Option<Detection> {
    let [[a, b], [c, d]] = frame.pixel_to_nm;
    let j = Matrix2::new(a, b, c, d);
    let tau = Vector2::from(if class == 0 {
        frame.trace_time_per_pixel_s
    } else {
        frame.retrace_time_per_pixel_s
    });
    let u = j.try_inverse()?.transpose() * tau;
    let (information, variances) = information(simulator, pair, &j, lines)?;
    let map = Matrix2::identity() - u * drift.transpose();
    let time = f64::midpoint(frame.start_s, frame.end_s);
    let last = Vector2::from(simulator.settings().raster.pixels.map(|n| n as f64 - 1.0));
    let middle = Vector2::from(frame.origin_nm) + j * last / 2.0;
    let place = middle - drift * time;
    let phases = Phases::independent(three(pair).map(|g| g.dot(&place)), variances);
    Some(Detection {
        scan: 0,
        class,
        block: 0,
        waves: Waves::new(map * pair, information.try_inverse()?),
        sensor: Matrix4::zeros(),
        time_gradient: u,
        fast_gain: Matrix2::zeros(),
        time,
        position: middle,
        phases: Some(phases).filter(|_| variances.iter().all(|v| v.is_finite())),
    })
}

/// What the pixels of a frame with the steps `j` (nm) tell of the pair, and the variances of its three phases. `None`
/// without noise.
fn information(
    simulator: &Simulator,
    pair: &Matrix2<f64>,
    j: &Matrix2<f64>,
    lines: &Lines,
) -> Option<(Matrix4<f64>, [f64; 3])> {
    let settings = simulator.settings();
    let noise = settings.noise.pixel_deg;
    if !(noise > 0.0) {
        return None;
    }
    let [columns, rows] = settings.raster.pixels.map(|n| n as f64);
    let pixels = columns * rows;
    let indices = pair.try_inverse()?;
    let mut information = Matrix4::<f64>::zeros();
    let mut variances = [f64::NAN; 3];
    for (wave, amplitude) in simulator.harmonics() {
        let ratio = (amplitude / noise).powi(2);
        let index = indices * wave;
        let cycles = columns * (j.transpose() * wave).x / std::f64::consts::TAU;
        let [along, across] = lines.left(cycles);
        // Of (q_x, q_y), per squared amplitude over noise.
        let spread = Matrix2::new(
            along * (columns * columns - 1.0),
            0.0,
            0.0,
            across * (rows * rows - 1.0),
        );
        let of_wave = j * spread * j.transpose() * (pixels / 24.0);
        for k in 0..2 {
            for l in 0..2 {
                let mut block = information.fixed_view_mut::<2, 2>(2 * k, 2 * l);
                block += of_wave * (index[k] * index[l] * ratio);
            }
        }
        let firsts = [(1.0, 0.0), (0.0, 1.0), (-1.0, 1.0)];
        for (variance, (h, k)) in variances.iter_mut().zip(firsts) {
            let first = Vector2::new(h, k);
            if (index - first).norm() < 1e-6 || (index + first).norm() < 1e-6 {
                *variance = 2.0 / (ratio * pixels * across);
            }
        }
    }
    Some((information, variances))
}

/// What random offsets of the lines do to the information of a wave.
struct Lines {
    /// Share of its mean that a line loses.
    lambda: f64,
}

impl Lines {
    fn of(settings: &Simulation) -> Self {
        let noise = &settings.noise;
        let offsets = noise.line_deg.powi(2) + noise.flicker_deg.powi(2);
        let means = settings.raster.pixels[0] as f64 * offsets;
        Self {
            lambda: means / (noise.pixel_deg.powi(2) + means),
        }
    }

    /// The share of the information that is left for a wave of m cycles per line: along the lines, and across
    /// (as for the phase). With `x` from −1 to 1 the line means of `e^{iπmx}` and `x e^{iπmx}` are s and it,
    /// `s = sin πm/πm`, `t = (s − cos πm)/πm`; λ of their squares is gone from 1 and from ⟨x²⟩ = ⅓, and the
    /// amplitude takes its part of what is left of the slope.
    fn left(&self, cycles: f64) -> [f64; 2] {
        let angle = std::f64::consts::PI * cycles;
        let (s, t) = if angle.abs() < 1e-3 {
            (1.0, angle / 3.0)
        } else {
            let s = angle.sin() / angle;
            (s, (s - angle.cos()) / angle)
        };
        let across = 1.0 - self.lambda * s * s;
        [1.0 - 3.0 * self.lambda * t * t / across.max(1e-6), across]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the normal matrix itself: amplitude, phase and both slopes of one wave on 48 × 48 pixels with the
    /// weight `1 − λ 11ᵀ/n` in each line, the amplitude and the phase projected out.
    #[test]
    fn line_offsets_take_what_waves_have_in_line_means() {
        let n = 48;
        for (lambda, cycles) in [(0.0, 0.4), (0.7, 0.3), (0.95, 0.8), (0.9, 1.6), (1.0, 3.3)] {
            let mut normal = Matrix4::<f64>::zeros();
            for row in 0..n {
                let place = |i: usize| (2.0 * i as f64 + 1.0) / n as f64 - 1.0;
                let y = place(row);
                let values: Vec<_> = (0..n)
                    .map(|column| {
                        let x = place(column);
                        let (sine, cosine) =
                            (std::f64::consts::PI * (cycles * x + 7.0 * y)).sin_cos();
                        nalgebra::Vector4::new(cosine, sine, x * sine, y * sine)
                    })
                    .collect();
                let mean = values.iter().sum::<nalgebra::Vector4<f64>>() / n as f64;
                for v in &values {
                    normal += v * v.transpose();
                }
                normal -= mean * mean.transpose() * (lambda * n as f64);
            }
            let inverse = normal.try_inverse().unwrap();
            let [along, across] = Lines { lambda }.left(cycles);
            let whole = (n * n) as f64 / 6.0 * (1.0 - 1.0 / (n * n) as f64);
            let found = [inverse.m33, inverse.m44].map(|v| 1.0 / (v * whole));
            assert!(
                (found[0] - along).abs() < 0.01,
                "{lambda} {cycles}: {found:?} {along}"
            );
            assert!(
                (found[1] - across).abs() < 0.01,
                "{lambda} {cycles}: {found:?} {across}"
            );
        }
    }

    /// The closed forms for three equal cosines in white noise on a square frame: twist
    /// `0.390 (a/L)(σ/A)/√N` and each strain component `2 σ_θ/(1 + ν)` (derived in the project's physics
    /// notes), for frames without drift error; and a drift from phases alone, a straight line through
    /// the positions `√(2/3)/|G| · σ_φ` of the frames.
    #[test]
    fn the_bound_is_that_of_three_cosines() {
        let mut settings = Simulation::default();
        settings.raster.pixels = [256; 2];
        settings.raster.scans = 10;
        settings.raster.retrace = false;
        settings.raster.nominal_size_nm = [55.0; 2];
        settings.window.gain = [1.0; 2];
        settings.window.shear_mrad = 0.0;
        settings.sample.sharpness = 0.0;
        settings.sample.strain_percent = 0.0;
        settings.drift.velocity_nm_per_min = [0.0; 2];
        settings.noise.pixel_deg = 2.0;
        let simulator = Simulator::new(settings.clone()).unwrap();
        let bound = cramer_rao(&simulator, 0.6, true).unwrap();
        let pixels = 256.0 * 256.0;
        let a = settings.sample.material.lattice_constant_nm;
        let twist = 0.390 * (a / 55.0) * 2.0 / f64::sqrt(pixels * 10.0);
        assert!((bound.twist / twist - 1.0).abs() < 0.01, "{bound:?}");
        let strain = 2.0 * twist / (1.0 + settings.sample.material.poisson_ratio);
        for found in bound.strain {
            assert!((found / strain - 1.0).abs() < 0.01, "{bound:?}");
        }
        let g =
            4.0 * std::f64::consts::PI / (3f64.sqrt() * a) * settings.sample.twist_deg.to_radians();
        let position = f64::sqrt(2.0 / 3.0) / g * f64::sqrt(2.0 / pixels) * 2.0;
        // Ten frames 33 s apart: Σ(t − t̄)² = 82.5 · 33².
        let slope = position / (82.5_f64.sqrt() * 33.0);
        for found in bound.drift {
            assert!((found / slope - 1.0).abs() < 0.02, "{bound:?} {slope}");
        }
    }
}
