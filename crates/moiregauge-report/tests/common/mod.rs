//! An analysis made up from formulas: two good sets and one poor scan, with a known truth.
//!
//! Shared by the tests and the gallery, none of which needs all of it.
//!
//! Twist 1.126°, strain 0.05 % along 35°, drift (0.50, −0.15) nm/min. Nothing here is measured.

#![allow(dead_code, reason = "each user takes what it needs")]

use heterostrain::lattice::Lattice;
use heterostrain::strain;
use moiregauge::campaign::{Analysis, Combined, Consistency};
use moiregauge::caveat::{Caveat, DriftDoubt, LatticeDoubt};
use moiregauge::frame::{Axis, Image};
use moiregauge::meaning::Budget;
use moiregauge::scan::Picture;
use moiregauge::settings::Settings;
use moiregauge_report::{FailedInput, InputFile, Provenance};
use nalgebra::{Matrix2, Matrix4, Vector2};
use sets::{good_set, mean, poor_set};

mod scan;
mod sets;

/// Twist of the sample, degrees.
pub(crate) const TWIST_DEG: f64 = 1.126;
/// Heterostrain of the sample, per cent.
pub(crate) const STRAIN_PERCENT: f64 = 0.05;
/// Axis of the strain in the laboratory, degrees.
pub(crate) const AXIS_LAB_DEG: f64 = 35.0;
/// Drift, nm/min.
pub(crate) const DRIFT_NM_PER_MIN: [f64; 2] = [0.50, -0.15];

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
    let combined = mean(&both, &settings, None, true).map(|m| Combined {
        budget: m.budget,
        readings: m.readings,
        lattice: m.lattice,
        twist_strain: m.twist_strain,
        joint: None,
        drift: None,
        path: None,
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
        survey: Some(survey()),
        atomic: None,
        caveats: vec![
            Caveat::new(
                LatticeDoubt::FewPeriods {
                    periods: 2.5,
                    enough: 3.0,
                },
                "slow y, 8 Hz",
            ),
            Caveat::new(
                DriftDoubt::Undetermined {
                    assumed: None,
                    reason: "One direction only: the scans cannot tell drift from strain."
                        .to_owned(),
                },
                "slow y, 2 Hz",
            ),
        ],
    }
}

/// An image of 400 nm × 300 nm around the scans.
fn survey() -> Picture {
    let (columns, rows) = (160, 120);
    let values = (0..rows * columns)
        .map(|n| ((n % columns) as f64 / 9.0).sin() + ((n / columns) as f64 / 14.0).cos())
        .collect();
    Picture {
        file: "survey.000".to_owned(),
        channel: "Height Sensor".to_owned(),
        unit: "nm".to_owned(),
        image: Image::new(rows, columns, values),
        pixel_to_nm: Matrix2::identity() * 2.5,
        origin: Vector2::new(-180.0, -140.0),
        from_sensors: true,
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
        run: None,
    }
}

/// Every number of `analysis` replaced by NaN, every image by one without pixels.
pub(crate) fn spoil(analysis: &mut Analysis) {
    let settings = analysis.settings.clone();
    let nan = Lattice::new(
        Matrix2::from_element(f64::NAN),
        Matrix4::from_element(f64::NAN),
    );
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
            mean.chi2_per_dof = Some(f64::NAN);
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
