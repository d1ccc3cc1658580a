//! The conditions of the user's own scans, as settings of the simulator.

use std::path::PathBuf;

use moiregauge::campaign::SetAnalysis;
use moiregauge::campaign::analyse;
use moiregauge::numbers::interrupt;
use moiregauge::scan::{MeasuredLine, MeasuredScan};
use moiregauge::settings::Settings;
use moiregauge::simulate::{Drift, FirstDirection, Noise, Raster, Sample, Simulation, Window};
use spmfile::FrameDirection;

use crate::campaign::measure_file;
use crate::job::{Cancelled, Job};
use crate::known::Known;
use crate::opened::InputError;
use crate::twice::distinct;

/// Contrast of the simulated image, degrees of phase; the noise is scaled along.
const CONTRAST: f64 = 1.0;

/// Why scans cannot be described.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LikeError {
    /// It was stopped.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// One of them.
    #[error("{}", file.display())]
    File {
        /// Which.
        file: PathBuf,
        /// Why not.
        source: InputError,
    },
    /// They do not belong together.
    #[error(
        "expected the scans of one set, found {0} sets (slow axis, line rate, size and channel have to agree)"
    )]
    Sets(usize),
    /// What they do not tell.
    #[error("{0}")]
    Unknown(&'static str),
}

/// Instrument and sample of the user's own scans of one set, as settings of the simulator: size, rate, contrast, noise,
/// drift, lattice.
///
/// # Errors
/// [`LikeError`].
pub fn conditions_like(
    files: &[PathBuf],
    known: &Known,
    job: &Job,
) -> Result<Simulation, LikeError> {
    let (files, _) = distinct(files);
    let stage = job.stage("measuring", "scans", files.len());
    let mut scans = Vec::new();
    let settings = Settings {
        drift_draws: 0,
        strain_draws: 0,
        ..Settings::default()
    };
    for file in files {
        let measured = job.run(|| {
            interrupt::check();
            measure_file(&file, &settings, known)
        })?;
        let (mut moires, _) = measured.map_err(|source| LikeError::File { file, source })?;
        scans.push(moires.swap_remove(0));
        stage.step();
    }
    drop(stage);
    job.run(|| described(&scans, &settings))?
}

fn described(scans: &[MeasuredScan], settings: &Settings) -> Result<Simulation, LikeError> {
    let analysis = analyse(scans.to_vec(), settings);
    let [set] = analysis.sets.as_slice() else {
        return Err(LikeError::Sets(analysis.sets.len()));
    };
    conditions_of(set, &scans.iter().collect::<Vec<_>>(), settings)
}

/// Instrument and sample of a set that was analysed, by the measured scans that it has among these.
///
/// # Errors
/// [`LikeError::Unknown`].
pub(crate) fn conditions_of(
    set: &SetAnalysis,
    scans: &[&MeasuredScan],
    settings: &Settings,
) -> Result<Simulation, LikeError> {
    let scans: Vec<&MeasuredScan> = set
        .scans
        .iter()
        .filter(|s| s.excluded.is_none())
        .filter_map(|s| scans.iter().find(|m| m.file == s.file).copied())
        .collect();
    let lines: Vec<&MeasuredLine> = scans.iter().flat_map(|s| &s.lines).collect();
    Ok(Simulation {
        name: "like".to_owned(),
        seed: 1,
        sample: sample(settings, set, &lines)?,
        drift: drift(set),
        raster: raster(set, &scans, &lines)?,
        window: window(set),
        noise: noise(&lines)?,
        features: Vec::new(),
    })
}

fn sample(
    settings: &Settings,
    set: &SetAnalysis,
    lines: &[&MeasuredLine],
) -> Result<Sample, LikeError> {
    let mean = set.mean.as_ref().or(set.uncorrected.as_ref());
    let found = &mean
        .ok_or(LikeError::Unknown(
            "no twist and strain explain the lattice of these scans",
        ))?
        .twist_strain;
    let e = found.strain_vector;
    let axis_lab = e.y.atan2(e.x) / 2.0;
    // Second over first shell: s² for Gaussian spots.
    let ratio = median(lines.iter().filter_map(|line| {
        let fit = line.lattice.fit.as_ref()?;
        let shell = |first: bool| {
            let all = fit
                .harmonics
                .iter()
                .filter(move |h| order(h.index) == if first { 1 } else { 3 });
            let squares: Vec<f64> = all.map(|h| h.amplitude * h.amplitude).collect();
            (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / 3.0).sqrt())
        };
        Some(shell(false).unwrap_or(0.0) / shell(true)?)
    }));
    Ok(Sample {
        material: settings.material.clone(),
        substrate: settings.substrate.clone(),
        strain_convention: settings.strain_convention,
        twist_deg: found.twist.to_degrees(),
        strain_percent: 100.0 * e.norm(),
        strain_axis_deg: (axis_lab - found.lattice_angle - found.twist).to_degrees(),
        lattice_angle_deg: found.lattice_angle.to_degrees(),
        contrast_deg: CONTRAST,
        sharpness: ratio.unwrap_or(0.0).max(0.0).sqrt().min(0.9),
        ..Sample::default()
    })
}

/// |h q₁ + k q₂|² in units of the first shell, q₁ and q₂ at 60°.
fn order([h, k]: [i32; 2]) -> i32 {
    h * h + h * k + k * k
}

fn drift(set: &SetAnalysis) -> Drift {
    let Some(drift) = &set.drift else {
        return Drift::default();
    };
    let acceleration = drift.joint.as_ref().and_then(|j| j.acceleration);
    Drift {
        velocity_nm_per_min: [0, 1].map(|i| 60.0 * drift.velocity[i]),
        acceleration_nm_per_min2: [0, 1].map(|i| acceleration.map_or(0.0, |a| 3600.0 * a[i])),
    }
}

fn raster(
    set: &SetAnalysis,
    scans: &[&MeasuredScan],
    lines: &[&MeasuredLine],
) -> Result<Raster, LikeError> {
    let line = lines
        .first()
        .ok_or(LikeError::Unknown("no line of these scans can be used"))?;
    let rate = scans[0].line_rate_hz.ok_or(LikeError::Unknown(
        "the files give no line rate: the scans cannot be simulated",
    ))?;
    let [columns, rows] = line.geometry.size;
    let timing = line
        .timing
        .ok_or(LikeError::Unknown("the files have no frame direction"))?;
    let half_line = 0.5 / rate;
    let rounding = half_line / (timing.per_pixel.x.abs() * (columns as f64 - 1.0)) - 1.0;
    let fast = line.geometry.fast_step();
    let directions: Vec<_> = scans.iter().filter_map(|s| s.frame_direction).collect();
    let frame = rows as f64 / rate;
    let starts: Vec<f64> = scans
        .iter()
        .filter_map(|s| s.acquired.map(seconds_of_day))
        .collect();
    let gaps = starts
        .windows(2)
        .map(|w| (w[1] - w[0]).rem_euclid(86_400.0) - frame);
    Ok(Raster {
        scans: scans.len(),
        pixels: [columns, rows],
        line_rate_hz: rate,
        rounding: rounding.clamp(0.0, 1.0),
        rotation_deg: fast.y.atan2(fast.x).to_degrees(),
        first_direction: match directions.first() {
            Some(FrameDirection::Down) => FirstDirection::Down,
            _ => FirstDirection::Up,
        },
        alternating: directions.windows(2).any(|w| w[0] != w[1]),
        nominal_size_nm: line.geometry.extent(),
        start_s: 0.0,
        gap_s: median(gaps).unwrap_or(1.0).max(0.0),
        retrace: set.scans.iter().any(|s| s.lines.len() > 1),
        sensors: line.geometry.from_sensors,
    })
}

fn seconds_of_day(t: spmfile::DateTime) -> f64 {
    f64::from(3600 * u32::from(t.hour) + 60 * u32::from(t.minute) + u32::from(t.second))
}

/// The scanned window: the size is the measured one, so that the gains are 1.
fn window(set: &SetAnalysis) -> Window {
    let centre = |i: usize| set.scans[i].window_centre;
    let mean = |up: bool| {
        let all: Vec<_> = set
            .scans
            .iter()
            .filter(|s| (s.frame_direction == Some(FrameDirection::Up)) == up)
            .map(|s| s.window_centre)
            .collect();
        let n = all.len() as f64;
        (n > 0.0).then(|| all.iter().sum::<nalgebra::Vector2<f64>>() / n)
    };
    let alternation = match (mean(true), mean(false)) {
        (Some(up), Some(down)) => up - down,
        _ => nalgebra::Vector2::zeros(),
    };
    Window {
        gain: [1.0; 2],
        shear_mrad: 0.0,
        centre_nm: centre(0).into(),
        creep_nm_per_min: [0.0; 2],
        alternation_nm: alternation.into(),
    }
}

/// Noise at the harmonics, as white noise of the pixels would make it, in units of the contrast.
fn noise(lines: &[&MeasuredLine]) -> Result<Noise, LikeError> {
    let fits = || {
        lines
            .iter()
            .filter_map(|l| Some((l, l.lattice.fit.as_ref()?)))
    };
    let first = |fit: &moiregauge::lattice::LatticeFit| {
        let of: Vec<f64> = fit
            .harmonics
            .iter()
            .filter(|h| order(h.index) == 1)
            .map(|h| h.amplitude)
            .collect();
        of.iter().sum::<f64>() / of.len() as f64
    };
    let pixel = median(fits().flat_map(|(line, fit)| {
        let pixels = (line.geometry.size[0] * line.geometry.size[1]) as f64;
        let contrast = first(fit);
        // σ(phase) = 1/(√2 snr) = √(2/N) σ/A.
        fit.harmonics
            .iter()
            .filter(|h| order(h.index) == 1)
            .map(|h| h.amplitude * pixels.sqrt() / (2.0 * h.signal_to_noise) / contrast)
            .collect::<Vec<_>>()
    }));
    let offsets = median(fits().map(|(_, fit)| fit.line_offsets.unwrap_or(0.0) / first(fit)));
    let sensor = median(
        lines
            .iter()
            .filter(|l| l.geometry.from_sensors)
            .map(|line| {
                let [columns, rows] = line.geometry.size.map(|n| n as f64);
                let variance = line.geometry.covariance.m11;
                (variance * columns * rows * (columns * columns - 1.0) / 12.0).sqrt()
            }),
    );
    Ok(Noise {
        sensor_nm: sensor.unwrap_or(0.0),
        pixel_deg: CONTRAST
            * pixel.ok_or(LikeError::Unknown("the lattice fit gave no harmonics"))?,
        line_deg: CONTRAST * offsets.unwrap_or(0.0),
        flicker_deg: 0.0,
        plane_deg: [0.0; 2],
        ..Noise::default()
    })
}

fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut all: Vec<f64> = values.filter(|v| v.is_finite()).collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied()
}
