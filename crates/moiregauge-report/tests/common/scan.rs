//! Single scans, from formulas and a fixed sequence of deviates.

use std::f64::consts::TAU;

use heterostrain::Estimate;
use heterostrain::lattice::Lattice;
use heterostrain::strain;
use heterostrain::strain::StrainConvention;
use moiregauge::campaign::{LineAnalysis, ScanAnalysis};
use moiregauge::frame::Axis;
use moiregauge::numbers::normals;
use moiregauge::settings::Settings;
use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};
use spmfile::{DateTime, FrameDirection, LineDirection};

use super::{AXIS_LAB_DEG, DRIFT_NM_PER_MIN, STRAIN_PERCENT, TWIST_DEG};

pub(super) const PIXELS: usize = 256;
pub(super) const SIZE_NM: f64 = 55.0;

/// Normal deviates from a fixed sequence.
pub(super) struct Noise(pub(super) u64);

impl Noise {
    pub(super) fn uniform(&mut self) -> f64 {
        // xorshift64*, Vigna 2016.
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(super) fn normal(&mut self) -> f64 {
        let radius = (-2.0 * self.uniform().max(1e-300).ln()).sqrt();
        radius * (TAU * self.uniform()).cos()
    }

    pub(super) fn pair(&mut self) -> Vector2<f64> {
        Vector2::new(self.normal(), self.normal())
    }
}

pub(super) fn truth(settings: &Settings) -> Matrix2<f64> {
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

pub(super) fn lattice(basis: Matrix2<f64>, sigma: f64) -> Lattice {
    Lattice::new(basis, Matrix4::identity() * sigma * sigma)
}

pub(super) fn measured(basis: &Matrix2<f64>, sigma: f64, noise: &mut Noise) -> Lattice {
    let flat = Vector4::from_fn(|_, _| sigma * noise.normal());
    lattice(basis + Matrix2::from_column_slice(flat.as_slice()), sigma)
}

pub(super) fn drift_nm_per_s() -> Vector2<f64> {
    Vector2::from(DRIFT_NM_PER_MIN) / 60.0
}

/// Time gradient of a scan, s/nm: only the slow part.
pub(super) fn time_gradient(axis: Axis, up: bool, rate: f64) -> Vector2<f64> {
    let slow = (PIXELS - 1) as f64 / rate / SIZE_NM * if up { 1.0 } else { -1.0 };
    match axis {
        Axis::X => Vector2::new(slow, 0.0),
        Axis::Y => Vector2::new(0.0, slow),
    }
}

/// A slightly sheared frame, nm per pixel.
pub(super) fn frame() -> Matrix2<f64> {
    let pitch = SIZE_NM / (PIXELS - 1) as f64;
    Matrix2::new(pitch * 0.985, pitch * 0.012, pitch * -0.008, pitch * 1.012)
}

pub(super) fn scan(
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
    let corrected = Lattice::new(
        (Matrix2::identity() - d * u.transpose()) * sensor.basis,
        sensor.covariance * 1.2,
    );
    let frame = frame();
    let to_pixels = frame.try_inverse().expect("a frame");
    let nominal = sensor.mapped(&(Matrix2::identity() * SIZE_NM / (PIXELS - 1) as f64 * to_pixels));
    let twist_strain =
        |l: &Lattice| strain::twist_strain(l, settings.bilayer(), settings.strain_convention).ok();
    let creep = index as f64 * 0.9;
    let line = |line| LineAnalysis {
        line,
        pixels: sensor.in_pixels(&to_pixels),
        sensor,
        comparison: Some(measured(&sensor.basis, sigma * 0.8, noise_of(set, index))),
        shortcut_wavelengths: Some([12.46, 12.52, 12.61]),
        pixel_to_nm: frame,
        origin: Vector2::new(10.0 + creep, -20.0),
        displacement: Vec::new(),
        from_sensors: true,
        periods: 4.5,
        signal_to_noise: 11.0,
        evidence: None,
        patch: None,
        change: None,
        on_ground: false,
        ruler: None,
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
        frame_direction: Some(if up {
            FrameDirection::Up
        } else {
            FrameDirection::Down
        }),
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
        motion: None,
        twist_strain_sensor: twist_strain(&sensor),
        twist_strain: twist_strain(&corrected),
        draws: strain::draws(
            &corrected,
            settings.bilayer(),
            settings.strain_convention,
            1000,
            normals(settings.seed, "strain", (set * 100 + index) as u64),
        ),
        residual: None,
        excluded: None,
    }
}

pub(super) fn noise_of(set: usize, index: usize) -> &'static mut Noise {
    Box::leak(Box::new(Noise((set * 31 + index + 7) as u64)))
}
