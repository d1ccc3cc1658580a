//! What scans will tell before they are made: the errors of a set that is still to be recorded.
//!
//! In: the settings of a simulation, which describe sample, raster and noise, one for each slow axis, and the
//! settings of the analysis, which say what is known of scanner and layers. Out: the standard errors of twist,
//! strain and drift, and what each source contributes. The Fisher information of pixels with white noise and of lines with
//! offsets ([`crate::plan::bound`]) and of noise of the position sensors goes through the covariance of the joint fit, frame
//! times being as uncertain as the settings say; what no scan shows comes from the budget.
//!
//! The lattice may lie at any angle: variances are means over orientations.
//!
//! Left out: drift that changes, and positions that are less stable than their sensors say.

use heterostrain::lattice::{Lattice, Waves};
use heterostrain::strain::twist_strain;
use nalgebra::{Matrix2, Matrix4};

use crate::drift::joint::choose::foreseen;
use crate::drift::joint::found::JointFit;
use crate::drift::joint::sighting::Detection;
use crate::drift::shares::Statistical;
use crate::meaning::budget::{Budget, Source};
use crate::plan::bound::ideal_sightings;
use crate::settings::knobs::Settings;
use crate::simulate::settings::Simulation;
use crate::simulate::simulator::Simulator;

/// A harmonic has to stand out of the noise of its frame by this much (amplitude over noise amplitude in one
/// resolution cell) to be found: 25 in power, a little more than the 20 that the search asks for.
pub const FOUND: f64 = 5.0;
/// The golden angle spreads any number of orientations evenly.
const GOLDEN_ANGLE: f64 = 137.507_764;

/// What a campaign will tell.
#[derive(Clone, Debug)]
pub struct Prediction {
    /// Variance of each drift component, mean of x and y, (nm/s)².
    drift: f64,
    /// The same if the times of the frames were known exactly.
    drift_with_clock: f64,
    /// Variances of twist (rad²) and of a component of the strain vector (mean of both), source by source.
    parts: [[f64; 2]; 13],
    /// Whether the phases of successive frames can be linked.
    pub linked: bool,
    /// Amplitude over noise amplitude in one resolution cell, of a first harmonic in one image.
    pub signal_to_noise: f64,
    /// Lattice periods across the shorter side of a frame.
    pub periods: f64,
}

/// What is wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// θ.
    Twist,
    /// A component of the strain vector.
    Strain,
}

impl Prediction {
    /// Standard error of a drift component, nm/s.
    pub fn drift_sigma(&self) -> f64 {
        self.drift.sqrt()
    }

    /// The same with frame times known exactly.
    pub fn drift_sigma_with_clock(&self) -> f64 {
        self.drift_with_clock.sqrt()
    }

    /// What the chosen sources together make of twist (rad) or strain, as a standard error.
    pub fn sigma(&self, quantity: Quantity, chosen: impl Fn(Source) -> bool) -> f64 {
        let index = match quantity {
            Quantity::Twist => 0,
            Quantity::Strain => 1,
        };
        Source::ALL
            .iter()
            .zip(&self.parts)
            .filter(|(source, _)| chosen(**source))
            .map(|(_, part)| part[index])
            .sum::<f64>()
            .max(0.0)
            .sqrt()
    }

    /// The statistical standard error of twist (rad) or strain.
    pub fn statistical(&self, quantity: Quantity) -> f64 {
        self.sigma(quantity, Source::is_statistical)
    }

    /// The source that contributes most.
    pub fn largest(&self, quantity: Quantity) -> Source {
        let of = |source: &Source| self.sigma(quantity, |s| s == *source);
        Source::ALL
            .into_iter()
            .max_by(|a, b| of(a).total_cmp(&of(b)))
            .unwrap_or(Source::Image)
    }
}

/// Predicts what `sets` of one sample will tell together, for `orientations` of its lattice.
///
/// `None` without noise of the pixels, where the frames do not determine drift and lattice, or where a
/// simulation makes no sense.
pub fn predict(
    sets: &[Simulation],
    settings: &Settings,
    orientations: usize,
) -> Option<Prediction> {
    let mut sum: Option<Prediction> = None;
    for index in 0..orientations.max(1) {
        let turned: Vec<Simulation> = sets
            .iter()
            .map(|set| {
                let mut set = set.clone();
                set.sample.lattice_angle_deg += GOLDEN_ANGLE * index as f64;
                set
            })
            .collect();
        let one = at_one_orientation(&turned, settings)?;
        sum = Some(match sum {
            None => one,
            Some(sum) => added(&sum, &one),
        });
    }
    let n = orientations.max(1) as f64;
    sum.map(|sum| Prediction {
        drift: sum.drift / n,
        drift_with_clock: sum.drift_with_clock / n,
        parts: sum.parts.map(|part| part.map(|v| v / n)),
        ..sum
    })
}

fn added(a: &Prediction, b: &Prediction) -> Prediction {
    let mut parts = a.parts;
    for (part, more) in parts.iter_mut().zip(&b.parts) {
        part[0] += more[0];
        part[1] += more[1];
    }
    Prediction {
        drift: a.drift + b.drift,
        drift_with_clock: a.drift_with_clock + b.drift_with_clock,
        parts,
        linked: a.linked && b.linked,
        signal_to_noise: a.signal_to_noise.min(b.signal_to_noise),
        periods: a.periods.min(b.periods),
    }
}

fn at_one_orientation(sets: &[Simulation], settings: &Settings) -> Option<Prediction> {
    let mut sightings: Vec<Detection> = Vec::new();
    let mut start = None;
    let (mut signal_to_noise, mut periods) = (f64::INFINITY, f64::INFINITY);
    for set in sets {
        let simulator = Simulator::new(set.clone()).ok()?;
        let (scan, class) = (
            sightings.iter().map(|s| s.scan + 1).max().unwrap_or(0),
            sightings.iter().map(|s| s.class + 1).max().unwrap_or(0),
        );
        let (images, pair, drift) = ideal_sightings(&simulator, set.raster.sensors, true)?;
        let step = Matrix2::from(simulator.truth().frames.first()?.pixel_to_nm).transpose();
        for image in images {
            let sensor = of_sensors(&image, set, &step)?;
            sightings.push(Detection {
                scan: image.scan + scan,
                class: image.class + class,
                waves: Waves::new(image.waves.basis, image.waves.covariance + sensor),
                sensor,
                ..image
            });
        }
        start = Some((pair, drift));
        let [columns, rows] = set.raster.pixels.map(|n| n as f64);
        let sample = &set.sample;
        let one = 0.5 * sample.contrast_deg * (columns * rows).sqrt() / set.noise.pixel_deg;
        signal_to_noise = signal_to_noise.min(one);
        let shortest = (columns * step.column(0).norm()).min(rows * step.column(1).norm());
        let lengths = simulator.truth().wavelengths_nm;
        periods = periods.min(shortest / lengths.iter().copied().fold(0.0, f64::max));
    }
    let (pair, drift) = start?;
    let fit = |time_sigma: f64| foreseen(&sightings, &pair, &drift, time_sigma);
    let found = fit(settings.frame_time_sigma_s)?;
    let exact = fit(0.0)?;
    let (lattice, statistical) = real(&found)?;
    let strained = twist_strain(&lattice, settings.bilayer(), settings.strain_convention).ok()?;
    let budget = Budget::new(&lattice, &strained, &statistical, settings);
    let component = |fit: &JointFit| fit.velocity_covariance.trace() / 2.0;
    Some(Prediction {
        drift: component(&found),
        drift_with_clock: component(&exact),
        parts: Source::ALL.map(|source| {
            let c = budget.of(source).covariance;
            [c[(0, 0)], f64::midpoint(c[(2, 2)], c[(3, 3)])]
        }),
        linked: found.terms.phases,
        signal_to_noise,
        periods,
    })
}

/// The lattice of a fit in real space, and where its covariance comes from.
fn real(fit: &JointFit) -> Option<(Lattice, Statistical)> {
    let with = |covariance| Waves::new(fit.waves.basis, covariance).lattice();
    let parts = fit.statistical()?;
    let statistical = Statistical {
        image: with(parts.image)?.covariance,
        drift: with(parts.drift)?.covariance,
        sensor: with(parts.sensor)?.covariance,
    };
    Some((with(fit.waves.covariance)?, statistical))
}

/// What noise of the sensors does to wave vectors. The planes through both have steps with the variances
/// `12 σ²/(N (n² − 1))` along columns and rows, and `K = J⁻ᵀ q` changes by `−J⁻ᵀ dJᵀ K`.
fn of_sensors(image: &Detection, set: &Simulation, step: &Matrix2<f64>) -> Option<Matrix4<f64>> {
    let mut covariance = Matrix4::zeros();
    if !set.raster.sensors {
        return Some(covariance);
    }
    let [columns, rows] = set.raster.pixels.map(|n| n as f64);
    let noise = 12.0 * set.noise.sensor_nm.powi(2) / (columns * rows);
    let steps = Matrix2::new(
        noise / (columns * columns - 1.0),
        0.0,
        0.0,
        noise / (rows * rows - 1.0),
    );
    let inverse = step.try_inverse()?;
    let shape = inverse.transpose() * steps * inverse;
    for k in 0..2 {
        for l in 0..2 {
            let (a, b) = (image.waves.basis.column(k), image.waves.basis.column(l));
            let mut block = covariance.fixed_view_mut::<2, 2>(2 * k, 2 * l);
            block += shape * a.dot(&b);
        }
    }
    Some(covariance)
}
