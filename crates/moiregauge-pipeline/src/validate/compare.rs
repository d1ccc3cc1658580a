//! One simulated set against its truth.

use moiregauge::campaign::analyse;
use moiregauge::plan::{Bound, cramer_rao};
use moiregauge::scan::measure_scan;
use moiregauge::settings::Settings;
use moiregauge::simulate::{Simulation, Simulator};
use moiregauge::spectrum::Method;

/// What is compared, with its unit.
pub(super) const QUANTITIES: [(&str, &str); 5] = [
    ("drift x", "nm/min"),
    ("drift y", "nm/min"),
    ("twist", "°"),
    ("strain E₁", "%"),
    ("strain E₂", "%"),
];

/// One quantity of one set, in its unit.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Compared {
    /// Found minus true.
    pub error: f64,
    /// The stated σ.
    pub sigma: f64,
    /// The Cramér–Rao bound; NaN where there is none.
    pub bound: f64,
}

/// All quantities of one set: both components of the drift (nm/min), twist (degrees), both components of the strain
/// vector (per cent).
pub type Comparison = [Compared; 5];

/// One set with noise and orientation of its own; `None` where nothing could be determined.
pub(super) fn compare(
    conditions: &Simulation,
    method: Method,
    seed: u64,
    index: u32,
) -> Option<Comparison> {
    let mut simulation = conditions.clone();
    simulation.seed = seed.wrapping_mul(1_000_003).wrapping_add(u64::from(index));
    // The golden angle spreads any number of orientations evenly.
    simulation.sample.lattice_angle_deg += 137.507_764 * f64::from(index);
    let settings = Settings {
        method,
        material: simulation.sample.material.clone(),
        substrate: simulation.sample.substrate.clone(),
        strain_convention: simulation.sample.strain_convention,
        drift_draws: 0,
        strain_draws: 0,
        ..Settings::default()
    };
    let simulator = Simulator::new(simulation).ok()?;
    let measured = (0..simulator.frames())
        .filter_map(|i| {
            let name = Simulator::file_name(i);
            measure_scan(&name, &simulator.frame(i), &settings, None).ok()
        })
        .collect();
    let analysis = analyse(measured, &settings);
    let set = analysis.sets.first()?;
    let (drift, found) = (set.drift.as_ref()?, &set.mean.as_ref()?.twist_strain);
    let truth = simulator.truth();
    let sample = &simulator.settings().sample;
    let axis = 2.0 * truth.strain_axis_lab_deg.to_radians();
    let strain = [axis.cos(), axis.sin()].map(|part| sample.strain_percent * part);
    let phases = drift.joint.as_ref().is_some_and(|joint| joint.phases);
    let bound = cramer_rao(&simulator, settings.frame_time_sigma_s, phases);
    let of = |error: f64, sigma: f64, least: fn(&Bound) -> f64, unit: f64| Compared {
        error,
        sigma,
        bound: bound.as_ref().map_or(f64::NAN, |b| unit * least(b)),
    };
    let twist = found.twist().scaled(1f64.to_degrees());
    let percent = found.strain_vector * 100.0;
    let strain_sigma = found.strain().covariance.map(|v| 100.0 * v.max(0.0).sqrt());
    let drift_error = |i: usize| 60.0 * drift.velocity[i] - truth.mean_drift_nm_per_min[i];
    let drift_sigma = |i: usize| 60.0 * drift.covariance[(i, i)].sqrt();
    Some([
        of(drift_error(0), drift_sigma(0), |b| b.drift[0], 60.0),
        of(drift_error(1), drift_sigma(1), |b| b.drift[1], 60.0),
        of(
            twist.value - sample.twist_deg,
            twist.sigma,
            |b| b.twist,
            1f64.to_degrees(),
        ),
        of(
            percent[0] - strain[0],
            strain_sigma.m11,
            |b| b.strain[0],
            100.0,
        ),
        of(
            percent[1] - strain[1],
            strain_sigma.m22,
            |b| b.strain[1],
            100.0,
        ),
    ])
}
