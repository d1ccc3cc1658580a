//! Simulated sets with biaxial strain, and atomic images of one layer in the same frame of the scanner.

use heterostrain::material::Material;
use heterostrain::strain::StrainTensor;
use moiregauge::campaign::Analysis;
use moiregauge::campaign::{AtomicOrientation, analyse, atomic_orientation};
use moiregauge::caveat::Caveat;
use moiregauge::scan::{MeasuredScan, measure_scan};
use moiregauge::settings::Settings;
use moiregauge::simulate::{Pattern, Simulation, Simulator};
use nalgebra::Vector2;

/// What was put in and what came out.
pub(crate) struct Outcome {
    pub(crate) simulation: Simulation,
    pub(crate) atomic: AtomicOrientation,
    pub(crate) analysis: Analysis,
}

/// Four frames of 128 × 128 pixels of a sample whose orientation, axis and biaxial strain go with the seed.
pub(crate) fn moire(seed: u64) -> Simulation {
    let mut set = Simulation {
        seed,
        ..Simulation::default()
    };
    set.raster.pixels = [128, 128];
    set.raster.scans = 4;
    let turn = seed as f64;
    set.sample.lattice_angle_deg = 137.507_764 * turn;
    set.sample.strain_axis_deg = 52.3 * turn;
    // Evenly between −0.2 and 0.2 %.
    set.sample.biaxial_percent = 0.4 * (0.618_034 * turn).fract() - 0.2;
    set
}

/// Graphene on hBN near 1°: the moiré is 10 nm.
pub(crate) fn on_hbn(mut set: Simulation) -> Simulation {
    set.sample.substrate = Material::named("hBN");
    set.sample.twist_deg = 0.8;
    set
}

/// Frames of the atoms of one layer of the same sample: 5 nm wide (nominal), with a drift of its own.
pub(crate) fn atoms(of: &Simulation, layer: u8, frames: usize) -> Simulation {
    let mut set = of.clone();
    set.seed = of.seed.wrapping_mul(7919).wrapping_add(13);
    set.raster.nominal_size_nm = [5.0, 5.0];
    set.raster.scans = frames;
    set.raster.start_s = 1000.0;
    set.drift.velocity_nm_per_min = [-0.31, 0.42];
    set.noise.sensor_nm = 0.05;
    set.sample.pattern = if layer == 1 {
        Pattern::Layer1
    } else {
        Pattern::Layer2
    };
    set
}

pub(crate) fn settings(of: &Simulation) -> Settings {
    Settings {
        material: of.sample.material.clone(),
        substrate: of.sample.substrate.clone(),
        strain_convention: of.sample.strain_convention,
        drift_draws: 0,
        strain_draws: 0,
        ..Settings::default()
    }
}

pub(crate) fn measured(simulation: &Simulation, settings: &Settings) -> Vec<MeasuredScan> {
    let simulator = Simulator::new(simulation.clone()).expect("a simulation");
    (0..simulator.frames())
        .map(|i| {
            let name = Simulator::file_name(i);
            measure_scan(&name, &simulator.frame(i), settings, None).expect("a lattice")
        })
        .collect()
}

/// The whole chain: atomic images, orientation, moiré, tensor.
pub(crate) fn run(simulation: Simulation, layer: u8, frames: usize) -> Outcome {
    let mut settings = settings(&simulation);
    let images = measured(&atoms(&simulation, layer, frames), &settings);
    let layers = settings.bilayer();
    let material = if layer == 1 {
        layers.reference
    } else {
        layers.stretched
    };
    let atomic = atomic_orientation(&images, material, layer, &settings.calibration)
        .expect("an orientation");
    settings.lattice_angle = Some(atomic.known());
    let analysis = analyse(measured(&simulation, &settings), &settings);
    Outcome {
        simulation,
        atomic,
        analysis,
    }
}

/// Twist, mean strain, shear vector, uniaxial and biaxial part as they were put in.
pub(crate) fn truth(simulation: &Simulation) -> [f64; 6] {
    let sample = &simulation.sample;
    let (strain, biaxial) = (
        sample.strain_percent / 100.0,
        sample.biaxial_percent / 100.0,
    );
    let scale = 1.0 + biaxial;
    let (along, across) = (
        scale * (1.0 + strain) - 1.0,
        scale * (1.0 - sample.material.poisson_ratio * strain) - 1.0,
    );
    let lab = sample.strain_axis_deg + sample.lattice_angle_deg + sample.twist_deg;
    let double = 2.0 * lab.to_radians();
    let shear = (along - across) / 2.0 * Vector2::new(double.cos(), double.sin());
    [
        sample.twist_deg.to_radians(),
        f64::midpoint(along, across),
        shear.x,
        shear.y,
        strain,
        biaxial,
    ]
}

impl Outcome {
    /// The strain tensor of the set. An orientation is known modulo 60°, and different layers may then have two solutions of
    /// little strain: the one that was put in, whichever comes first, if the ambiguity is told.
    pub(crate) fn tensor(&self) -> StrainTensor {
        let mean = self.analysis.sets[0].mean.as_ref().expect("a mean");
        let found = mean.readings.tensor.as_ref().expect("a tensor");
        if !self.is_ambiguous() {
            return found.best;
        }
        let twist = truth(&self.simulation)[0];
        let others = found.alternatives.iter().map(|other| &other.found);
        let all = std::iter::once(&found.best).chain(others);
        let off = |t: &&StrainTensor| (t.twist - twist).abs();
        *all.min_by(|a, b| off(a).total_cmp(&off(b)))
            .expect("a tensor")
    }

    /// Whether different layers have more than one solution, and the analysis says so.
    pub(crate) fn is_ambiguous(&self) -> bool {
        let told = |c: &Caveat| c.code() == "orientation-ambiguous";
        self.simulation.sample.substrate.is_some() && self.analysis.caveats.iter().any(told)
    }

    /// Errors in units of σ: twist, mean strain, both components of the shear part, uniaxial and biaxial part.
    pub(crate) fn pulls(&self) -> [f64; 6] {
        let (found, truth) = (self.tensor(), truth(&self.simulation));
        let sigma = |i: usize| found.covariance[(i, i)].sqrt();
        let [split, _] = found.splits(self.simulation.sample.material.poisson_ratio);
        [
            (found.twist - truth[0]) / sigma(0),
            (found.mean - truth[1]) / sigma(2),
            (found.shear.x - truth[2]) / sigma(3),
            (found.shear.y - truth[3]) / sigma(4),
            (split.uniaxial.value - truth[4]) / split.uniaxial.sigma,
            (split.biaxial.value - truth[5]) / split.biaxial.sigma,
        ]
    }
}
