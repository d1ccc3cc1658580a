//! Sets of scans and what is common to them.

use std::f64::consts::TAU;

use heterostrain::lattice::Lattice;
use heterostrain::strain;
use moiregauge::campaign::{Drift, DriftFit, ScanAnalysis, SetAnalysis, SetMean};
use moiregauge::drift::DriftMonteCarlo;
use moiregauge::drift::Statistical;
use moiregauge::frame::Axis;
use moiregauge::frame::Image;
use moiregauge::meaning::Budget;
use moiregauge::meaning::{Readings, WaveStrengths};
use moiregauge::scan::{Companion, Illustration};
use moiregauge::settings::Settings;
use nalgebra::{Matrix2, Vector2};

use super::scan::{Noise, PIXELS, SIZE_NM, drift_nm_per_s, scan};

pub(super) fn mean(
    lattices: &[Lattice],
    settings: &Settings,
    chi2_per_dof: Option<f64>,
    drift_known: bool,
) -> Option<SetMean> {
    let n = lattices.len() as f64;
    let basis = lattices.iter().map(|l| l.basis).sum::<Matrix2<f64>>() / n;
    let covariance = lattices.first()?.covariance / n;
    let lattice = Lattice::new(basis, covariance);
    let of =
        |l: &Lattice| strain::twist_strain(l, settings.bilayer(), settings.strain_convention).ok();
    let all: Vec<_> = lattices.iter().filter_map(of).collect();
    let twist_strain = of(&lattice)?;
    let scatter = |square: f64| {
        if all.len() > 1 {
            (square / (n - 1.0)).sqrt()
        } else {
            f64::NAN
        }
    };
    // Six tenths of the variance from the images, three from the drift, one from the sensors.
    let statistical = Statistical {
        image: covariance * 0.6,
        drift: covariance * if drift_known { 0.3 } else { f64::NAN },
        sensor: covariance * 0.1,
    };
    let budget = Budget::new(&lattice, &twist_strain, &statistical, settings);
    Some(SetMean {
        readings: Readings::new(
            &lattice,
            &twist_strain,
            &budget,
            &WaveStrengths::default(),
            settings,
        ),
        budget,
        assumed: None,
        lattice,
        twist_strain,
        twist_scatter: scatter(
            all.iter()
                .map(|t| (t.twist - twist_strain.twist).powi(2))
                .sum(),
        ),
        strain_scatter: scatter(
            all.iter()
                .map(|t| (t.strain_vector - twist_strain.strain_vector).norm_squared() / 2.0)
                .sum(),
        ),
        chi2_per_dof,
        enlargement: chi2_per_dof.unwrap_or(1.0).max(1.0),
        within_one_percent: true,
    })
}

pub(super) fn monte_carlo(noise: &mut Noise, centre: Vector2<f64>, sigma: f64) -> DriftMonteCarlo {
    let draws: Vec<Vector2<f64>> = (0..10_000)
        .map(|_| {
            let z = noise.pair();
            centre + Vector2::new(sigma * z.x, sigma * (0.4 * z.x + 0.9 * z.y))
        })
        .collect();
    let n = draws.len() as f64;
    let mean = draws.iter().sum::<Vector2<f64>>() / n;
    let covariance = draws
        .iter()
        .map(|d| (d - mean) * (d - mean).transpose())
        .sum::<Matrix2<f64>>()
        / (n - 1.0);
    DriftMonteCarlo {
        losses: draws
            .iter()
            .map(|_| (0.012 + 0.002 * noise.normal()).abs())
            .collect(),
        draws,
        mean,
        covariance,
    }
}

pub(super) fn image(f: impl Fn(f64, f64) -> f64) -> Image {
    let values = (0..PIXELS * PIXELS)
        .map(|i| f((i % PIXELS) as f64, (i / PIXELS) as f64))
        .collect();
    Image::new(PIXELS, PIXELS, values)
}

pub(super) fn illustration(scan: &ScanAnalysis, noise: &mut Noise) -> Option<Illustration> {
    let line = scan.lines.first()?;
    let reciprocal = line.pixels.basis.try_inverse()?.transpose();
    let waves = [
        reciprocal.column(0).into_owned(),
        reciprocal.column(1).into_owned(),
        reciprocal.column(0) + reciprocal.column(1),
    ]
    .map(|w| Vector2::new(w[0], w[1]));
    let picture = |x: f64, y: f64| {
        waves
            .iter()
            .map(|w| (TAU * w.dot(&Vector2::new(x, y))).cos())
            .sum::<f64>()
    };
    let grains: Vec<f64> = (0..PIXELS * PIXELS).map(|_| noise.normal()).collect();
    let half = (PIXELS / 2) as f64;
    let step = 0.25 / PIXELS as f64;
    let frame = line.pixel_to_nm;
    let velocity = scan.fast_velocity.value;
    Some(Illustration {
        file: scan.file.clone(),
        line: line.line,
        unit: "mV".to_owned(),
        image: image(|x, y| {
            3.0 * picture(x, y) + 1.5 * grains[x as usize + PIXELS * y as usize] + 0.01 * y
        }),
        pixel_to_nm: frame,
        origin: line.origin,
        nominal_pixel_to_nm: Some(Matrix2::identity() * SIZE_NM / (PIXELS - 1) as f64),
        autocorrelation: image(|x, y| {
            let white = if x == half && y == half { 0.6 } else { 0.0 };
            picture(x - half, y - half) / 3.0 + white
        }),
        spectrum: image(|x, y| {
            let at = Vector2::new(x - half, y - half) * step;
            let peak = |w: Vector2<f64>| {
                (-(at - w).norm_squared() / (2.0 * (1.2 / PIXELS as f64).powi(2))).exp()
            };
            let power: f64 = waves.iter().map(|&w| peak(w) + peak(-w)).sum();
            (power + 1e-4 * (1.0 + 0.5 * grains[x as usize + PIXELS * y as usize].abs())).ln()
        }),
        spectrum_step: [step, step],
        lattice: line.pixels,
        patch: None,
        sensor_line: (0..PIXELS)
            .map(|i| {
                let (c, fitted) = (i as f64, line.origin.x + frame[(0, 0)] * i as f64);
                [
                    c,
                    fitted + 0.12 * noise.normal() + 0.1 * (c / 40.0).sin(),
                    fitted,
                ]
            })
            .collect(),
        fast_velocities: (0..PIXELS)
            .map(|_| velocity + 1.7 * noise.normal())
            .collect(),
        slow_velocities: (0..PIXELS)
            .map(|_| scan.slow_velocity.value + 0.02 * noise.normal())
            .collect(),
        sensor_residuals: Some([0.1, 0.07].map(|a| image(|x, y| a * (x / 40.0 + y / 90.0).sin()))),
        residual_block: 1,
        bent: Vec::new(),
        amplitude: Some(Companion {
            channel: "TR Amplitude".to_owned(),
            unit: "mV".to_owned(),
            image: image(|x, y| 2.0 - picture(x, y)),
        }),
    })
}

pub(super) fn good_set(
    index: usize,
    axis: Axis,
    rate: f64,
    count: usize,
    settings: &Settings,
) -> SetAnalysis {
    let mut noise = Noise(0x1234_5678 + index as u64);
    let scans: Vec<ScanAnalysis> = (0..count)
        .map(|i| scan(index, i, axis, rate, settings, &mut noise))
        .collect();
    let corrected: Vec<_> = scans.iter().filter_map(|s| s.drift_corrected).collect();
    let sensor: Vec<_> = scans.iter().map(|s| s.sensor).collect();
    let sigma = 0.014 / 60.0;
    let found = drift_nm_per_s() + sigma * noise.pair();
    let mean = mean(&corrected, settings, Some(1.3), true);
    SetAnalysis {
        name: format!(
            "slow {}, {rate} Hz",
            if axis == Axis::X { "x" } else { "y" }
        ),
        slow_axis: axis,
        line_rate_hz: rate,
        channel: "TR Phase".to_owned(),
        drift: Some(Drift {
            velocity: found,
            covariance: Matrix2::new(1.0, 0.3, 0.3, 1.0) * sigma * sigma,
            given: false,
            fit: Some(DriftFit {
                rank: 6,
                condition: 1.7,
                chi2: 41.0,
                degrees_of_freedom: 4 * count - 6,
                paper_velocity: Some(found + Vector2::new(0.4, -0.2) / 60.0 * 0.05),
            }),
            monte_carlo: Some(monte_carlo(&mut noise, found, sigma)),
            joint: None,
        }),
        forward_backward: mean.as_ref().map(|m| m.twist_strain),
        mean,
        uncorrected: self::mean(&sensor, settings, None, false),
        lattice: None,
        ruler: None,
        by_scanner: None,
        checks: None,
        illustration: scans.first().and_then(|s| illustration(s, &mut noise)),
        scans,
    }
}

/// One scan without sensors: no drift, no nominal size, nothing corrected.
pub(super) fn poor_set(settings: &Settings) -> SetAnalysis {
    let mut noise = Noise(99);
    let mut scan = scan(2, 0, Axis::Y, 2.0, settings, &mut noise);
    scan.acquired = None;
    scan.nominal = None;
    scan.drift_corrected = None;
    scan.twist_strain = None;
    scan.draws = Vec::new();
    scan.fast_velocity.sigma = f64::NAN;
    for line in &mut scan.lines {
        line.from_sensors = false;
        line.comparison = None;
    }
    SetAnalysis {
        name: "slow y, 2 Hz".to_owned(),
        slow_axis: Axis::Y,
        line_rate_hz: 2.0,
        channel: "TR Amplitude".to_owned(),
        drift: None,
        mean: None,
        uncorrected: mean(&[scan.sensor], settings, None, false),
        forward_backward: None,
        lattice: None,
        ruler: None,
        by_scanner: None,
        checks: None,
        illustration: None,
        scans: vec![scan],
    }
}
