//! An analysis made up from formulas: two good sets and one poor scan, with a known truth.
//!
//! Shared by the tests and the gallery, none of which needs all of it.
//!
//! Twist 1.126°, strain 0.05 % along 35°, drift (0.50, −0.15) nm/min. Nothing here is measured.

#![allow(dead_code, reason = "each user takes what it needs")]

use std::f64::consts::TAU;

use moiregauge::analysis::{
    Analysis, Axis, Combined, Consistency, Drift, DriftFit, DriftMonteCarlo, Illustration,
    LineAnalysis, ScanAnalysis, SetAnalysis, SetMean,
};
use moiregauge::budget::{Budget, Statistical};
use moiregauge::caveat::Caveat;
use moiregauge::estimate::Estimate;
use moiregauge::image::Image;
use moiregauge::lattice::LatticeVectors;
use moiregauge::settings::{Settings, StrainConvention};
use moiregauge::strain;
use moiregauge_report::{FailedInput, InputFile, Provenance};
use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};
use spmfile::{DateTime, FrameDirection, LineDirection};

/// Twist of the sample, degrees.
pub(crate) const TWIST_DEG: f64 = 1.126;
/// Heterostrain of the sample, per cent.
pub(crate) const STRAIN_PERCENT: f64 = 0.05;
/// Axis of the strain in the laboratory, degrees.
pub(crate) const AXIS_LAB_DEG: f64 = 35.0;
/// Drift, nm/min.
pub(crate) const DRIFT_NM_PER_MIN: [f64; 2] = [0.50, -0.15];

const PIXELS: usize = 256;
const SIZE_NM: f64 = 55.0;

/// Normal deviates from a fixed sequence.
struct Noise(u64);

impl Noise {
    fn uniform(&mut self) -> f64 {
        // xorshift64*, Vigna 2016.
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * self.uniform().max(1e-300).ln()).sqrt();
        radius * (TAU * self.uniform()).cos()
    }

    fn pair(&mut self) -> Vector2<f64> {
        Vector2::new(self.normal(), self.normal())
    }
}

fn truth(settings: &Settings) -> Matrix2<f64> {
    strain::moire_lattice(
        TWIST_DEG.to_radians(),
        STRAIN_PERCENT / 100.0,
        (AXIS_LAB_DEG - 12.0 - TWIST_DEG).to_radians(),
        12.0_f64.to_radians(),
        &settings.material,
        StrainConvention::RealSpace,
    )
    .expect("a lattice")
}

fn lattice(basis: Matrix2<f64>, sigma: f64) -> LatticeVectors {
    LatticeVectors {
        basis,
        covariance: Matrix4::identity() * sigma * sigma,
    }
}

fn measured(basis: &Matrix2<f64>, sigma: f64, noise: &mut Noise) -> LatticeVectors {
    let flat = Vector4::from_fn(|_, _| sigma * noise.normal());
    lattice(basis + Matrix2::from_column_slice(flat.as_slice()), sigma)
}

fn drift_nm_per_s() -> Vector2<f64> {
    Vector2::from(DRIFT_NM_PER_MIN) / 60.0
}

/// Time gradient of a scan, s/nm: only the slow part.
fn time_gradient(axis: Axis, up: bool, rate: f64) -> Vector2<f64> {
    let slow = (PIXELS - 1) as f64 / rate / SIZE_NM * if up { 1.0 } else { -1.0 };
    match axis {
        Axis::X => Vector2::new(slow, 0.0),
        Axis::Y => Vector2::new(0.0, slow),
    }
}

/// A slightly sheared frame, nm per pixel.
fn frame() -> Matrix2<f64> {
    let pitch = SIZE_NM / (PIXELS - 1) as f64;
    Matrix2::new(pitch * 0.985, pitch * 0.012, pitch * -0.008, pitch * 1.012)
}

fn scan(
    set: usize,
    index: usize,
    axis: Axis,
    rate: f64,
    settings: &Settings,
    noise: &mut Noise,
) -> ScanAnalysis {
    let up = index.is_multiple_of(2);
    let (truth, sigma) = (truth(settings), 0.012 + 0.004 * set as f64);
    let u = time_gradient(axis, up, rate);
    let d = drift_nm_per_s();
    // R = (I − D uᵀ) r, so r = (I − D uᵀ)⁻¹ R.
    let seen = (Matrix2::identity() - d * u.transpose())
        .try_inverse()
        .expect("slow drift")
        * truth;
    let sensor = measured(&seen, sigma, noise);
    let corrected = LatticeVectors {
        basis: (Matrix2::identity() - d * u.transpose()) * sensor.basis,
        covariance: sensor.covariance * 1.2,
    };
    let frame = frame();
    let to_pixels = frame.try_inverse().expect("a frame");
    let nominal = sensor.mapped(&(Matrix2::identity() * SIZE_NM / (PIXELS - 1) as f64 * to_pixels));
    let twist_strain = |l: &LatticeVectors| {
        strain::twist_strain(l, &settings.material, settings.strain_convention).ok()
    };
    let creep = index as f64 * 0.9;
    let line = |line| LineAnalysis {
        line,
        pixels: sensor.mapped(&to_pixels),
        sensor,
        comparison: Some(measured(&sensor.basis, sigma * 0.8, noise_of(set, index))),
        shortcut_wavelengths: Some([12.46, 12.52, 12.61]),
        pixel_to_nm: frame,
        origin: Vector2::new(10.0 + creep, -20.0),
        from_sensors: true,
        periods: 4.5,
        signal_to_noise: 11.0,
    };
    ScanAnalysis {
        file: format!("Messung 3 ü/tbg µ-scan_{}.{:03}", set + 1, index + 1),
        acquired: Some(DateTime {
            year: 2024,
            month: 5,
            day: 17,
            hour: 14,
            minute: (3 + 2 * index) as u8,
            second: 9,
        }),
        frame_direction: if up {
            FrameDirection::Up
        } else {
            FrameDirection::Down
        },
        lines: vec![line(LineDirection::Trace), line(LineDirection::Retrace)],
        window_centre: Vector2::new(
            1240.0 + creep + 0.3 * noise.normal(),
            -380.0 + 2.0 * (creep + 1.0).ln(),
        ),
        window_extent: [54.2, 55.7],
        fast_velocity: Estimate::new(2.0 * rate * SIZE_NM, 1.7),
        slow_velocity: Estimate::new(rate * SIZE_NM / PIXELS as f64, 0.021),
        nominal: Some(nominal),
        sensor,
        drift_corrected: Some(corrected),
        drift: Some(Vector2::new(0.0086, -0.0026)),
        twist_strain_sensor: twist_strain(&sensor),
        twist_strain: twist_strain(&corrected),
        draws: strain::draws(
            &corrected,
            &settings.material,
            settings.strain_convention,
            1000,
            settings.seed,
            (set * 100 + index) as u64,
        ),
        residual: None,
        excluded: None,
    }
}

fn noise_of(set: usize, index: usize) -> &'static mut Noise {
    Box::leak(Box::new(Noise((set * 31 + index + 7) as u64)))
}

fn mean(
    lattices: &[LatticeVectors],
    settings: &Settings,
    chi2_per_dof: f64,
    drift_known: bool,
) -> Option<SetMean> {
    let n = lattices.len() as f64;
    let basis = lattices.iter().map(|l| l.basis).sum::<Matrix2<f64>>() / n;
    let covariance = lattices.first()?.covariance / n;
    let lattice = LatticeVectors { basis, covariance };
    let of = |l: &LatticeVectors| {
        strain::twist_strain(l, &settings.material, settings.strain_convention).ok()
    };
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
    Some(SetMean {
        budget: Budget::new(&lattice, &twist_strain, &statistical, settings),
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
        enlargement: chi2_per_dof.max(1.0),
        within_one_percent: true,
    })
}

fn monte_carlo(noise: &mut Noise, centre: Vector2<f64>, sigma: f64) -> DriftMonteCarlo {
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

fn image(f: impl Fn(f64, f64) -> f64) -> Image {
    let values = (0..PIXELS * PIXELS)
        .map(|i| f((i % PIXELS) as f64, (i / PIXELS) as f64))
        .collect();
    Image::new(PIXELS, PIXELS, values)
}

fn illustration(scan: &ScanAnalysis, noise: &mut Noise) -> Option<Illustration> {
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
    })
}

fn good_set(index: usize, axis: Axis, rate: f64, count: usize, settings: &Settings) -> SetAnalysis {
    let mut noise = Noise(0x1234_5678 + index as u64);
    let scans: Vec<ScanAnalysis> = (0..count)
        .map(|i| scan(index, i, axis, rate, settings, &mut noise))
        .collect();
    let corrected: Vec<_> = scans.iter().filter_map(|s| s.drift_corrected).collect();
    let sensor: Vec<_> = scans.iter().map(|s| s.sensor).collect();
    let sigma = 0.014 / 60.0;
    let found = drift_nm_per_s() + sigma * noise.pair();
    let mean = mean(&corrected, settings, 1.3, true);
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
        uncorrected: self::mean(&sensor, settings, f64::NAN, false),
        checks: None,
        illustration: scans.first().and_then(|s| illustration(s, &mut noise)),
        scans,
    }
}

/// One scan without sensors: no drift, no nominal size, nothing corrected.
fn poor_set(settings: &Settings) -> SetAnalysis {
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
        uncorrected: mean(&[scan.sensor], settings, f64::NAN, false),
        forward_backward: None,
        checks: None,
        illustration: None,
        scans: vec![scan],
    }
}

/// The whole made-up analysis.
pub(crate) fn analysis() -> Analysis {
    let settings = Settings::default();
    let sets = vec![
        good_set(0, Axis::Y, 8.0, 10, &settings),
        good_set(1, Axis::X, 4.0, 6, &settings),
        poor_set(&settings),
    ];
    let both: Vec<_> = sets
        .iter()
        .filter_map(|s| s.mean.as_ref())
        .map(|m| m.lattice)
        .collect();
    let combined = mean(&both, &settings, f64::NAN, true).map(|m| Combined {
        budget: m.budget,
        lattice: m.lattice,
        twist_strain: m.twist_strain,
        joint: None,
        drift: None,
        checks: None,
        consistency: vec![Consistency {
            sets: [sets[0].name.clone(), sets[1].name.clone()],
            drift_sigmas: Some(1.2),
            twist_sigmas: 0.7,
            strain_sigmas: 1.9,
        }],
    });
    Analysis {
        settings,
        sets,
        combined,
        caveats: vec![
            Caveat::new(
                "few-periods",
                "slow y, 8 Hz",
                "Only 4.5 moiré periods across the frame.",
            ),
            Caveat::new(
                "drift-not-determined",
                "slow y, 2 Hz",
                "One direction only: the scans cannot tell drift from strain.",
            ),
        ],
    }
}

/// Provenance to go with [`analysis`].
pub(crate) fn provenance() -> Provenance {
    let inputs = analysis()
        .sets
        .iter()
        .flat_map(|set| &set.scans)
        .enumerate()
        .map(|(i, scan)| InputFile {
            file: scan.file.clone(),
            sha256: format!("{:064x}", 0x00c0_ffee_u64 + i as u64),
            bytes: 2_113_536,
        })
        .collect();
    Provenance {
        version: "0.1.0".to_owned(),
        seed: 1,
        inputs,
        failed: vec![FailedInput {
            file: "Messung 3 ü/tbg µ-scan_1.011".to_owned(),
            error: "channel \"X Sensor\" is 524288 bytes long but its header promises 1048576"
                .to_owned(),
        }],
    }
}

/// Every number of `analysis` replaced by NaN, every image by one without pixels.
pub(crate) fn spoil(analysis: &mut Analysis) {
    let settings = analysis.settings.clone();
    let nan = LatticeVectors {
        basis: Matrix2::from_element(f64::NAN),
        covariance: Matrix4::from_element(f64::NAN),
    };
    let nothing = Vector2::new(f64::NAN, f64::NAN);
    let spoil_result = |result: &mut strain::TwistStrain| {
        *result = strain::TwistStrain {
            twist: f64::NAN,
            lattice_angle: f64::NAN,
            strain_vector: nothing,
            covariance: Matrix4::from_element(f64::NAN),
        };
    };
    for set in &mut analysis.sets {
        set.line_rate_hz = f64::NAN;
        for mean in set.mean.iter_mut().chain(&mut set.uncorrected) {
            mean.lattice = nan;
            spoil_result(&mut mean.twist_strain);
            mean.chi2_per_dof = f64::NAN;
            let statistical = mean.budget.statistical;
            mean.budget = Budget::new(&nan, &mean.twist_strain, &statistical, &settings);
        }
        if let Some(drift) = &mut set.drift {
            drift.velocity = nothing;
            drift.covariance = Matrix2::from_element(f64::NAN);
            if let Some(draws) = &mut drift.monte_carlo {
                draws.mean = nothing;
                draws.covariance = Matrix2::from_element(f64::NAN);
                draws.losses.fill(f64::NAN);
                draws.draws.truncate(3);
            }
        }
        for scan in &mut set.scans {
            scan.window_centre = nothing;
            scan.window_extent = [f64::NAN; 2];
            scan.sensor = nan;
            for lattice in scan.nominal.iter_mut().chain(&mut scan.drift_corrected) {
                *lattice = nan;
            }
            for result in scan
                .twist_strain
                .iter_mut()
                .chain(&mut scan.twist_strain_sensor)
            {
                spoil_result(result);
            }
            for line in &mut scan.lines {
                line.sensor = nan;
                line.pixel_to_nm = Matrix2::from_element(f64::NAN);
                line.signal_to_noise = f64::INFINITY;
            }
        }
        if let Some(shown) = &mut set.illustration {
            shown.image = Image::new(0, 0, Vec::new());
            shown.autocorrelation = Image::new(1, 1, vec![f64::NAN]);
            shown.sensor_line = vec![[0.0, f64::NAN, f64::NAN]];
            shown.fast_velocities.fill(f64::NAN);
        }
    }
}
