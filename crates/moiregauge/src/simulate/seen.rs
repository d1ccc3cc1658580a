//! What of the sample the frames see: the share with moiré, the mean twist and strain there, each grain.

use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

use crate::simulate::local::{Local, local};
use crate::simulate::motion::Motion;
use crate::simulate::raster::FramePlan;
use crate::simulate::settings::Simulation;
use crate::simulate::surface::Surface;

/// The truth about a sample that is not the same everywhere.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[non_exhaustive]
pub struct SampleTruth {
    /// Share of the pixels of all frames with moiré (at least half of its contrast).
    pub share_covered: f64,
    /// Over the part with moiré; nothing where there is none.
    pub mean: Option<MeanTruth>,
    /// Each lattice that the frames see, in the order of the settings.
    pub grains: Vec<GrainTruth>,
    /// Place to place on the part that the frames see in the mean, rows from below, where there is moiré.
    pub places: Vec<PlaceTruth>,
}

/// Area means of the local twist and strain: what the uniaxial solution of the local lattice gives.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[non_exhaustive]
pub struct MeanTruth {
    /// Degrees.
    pub twist_deg: f64,
    /// Smallest and largest, degrees.
    pub twist_range_deg: [f64; 2],
    /// Length of the mean strain vector, per cent.
    pub strain_percent: f64,
    /// Its axis, degrees in [0, 180).
    pub strain_axis_lab_deg: f64,
    /// The mean strain vector `ε (cos 2φ, sin 2φ)`, φ in the laboratory, per cent.
    pub strain_lab_percent: [f64; 2],
    /// Smallest and largest length of the local strain vector, per cent.
    pub strain_range_percent: [f64; 2],
}

/// One lattice.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[non_exhaustive]
pub struct GrainTruth {
    /// Share of the pixels of all frames.
    pub share: f64,
    /// Over its part.
    pub mean: Option<MeanTruth>,
    /// α, degrees in [0, 60).
    pub lattice_angle_deg: f64,
    /// Its moiré where nothing is bent: first, second, second − first.
    pub lattice_vectors_nm: [[f64; 2]; 3],
}

/// One place.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[non_exhaustive]
pub struct PlaceTruth {
    /// In the frame of the sample: where the drift is zero.
    pub place_nm: [f64; 2],
    /// Number of the lattice, from 0.
    pub grain: usize,
    /// Degrees.
    pub twist_deg: f64,
    /// As above.
    pub strain_lab_percent: [f64; 2],
}

/// Sums of local values.
#[derive(Clone, Copy, Debug)]
struct Sum {
    count: f64,
    twist: f64,
    strain: Vector2<f64>,
    twists: [f64; 2],
    strains: [f64; 2],
}

impl Sum {
    fn new() -> Self {
        let none = [f64::INFINITY, f64::NEG_INFINITY];
        Self {
            count: 0.0,
            twist: 0.0,
            strain: Vector2::zeros(),
            twists: none,
            strains: none,
        }
    }

    fn add(&mut self, local: Local) {
        self.count += 1.0;
        self.twist += local.twist;
        self.strain += local.strain;
        let widen = |[low, high]: [f64; 2], value: f64| [low.min(value), high.max(value)];
        self.twists = widen(self.twists, local.twist);
        self.strains = widen(self.strains, local.strain.norm());
    }

    fn mean(&self) -> Option<MeanTruth> {
        if self.count == 0.0 {
            return None;
        }
        let strain = self.strain / self.count * 100.0;
        let axis = strain.y.atan2(strain.x).to_degrees() / 2.0;
        Some(MeanTruth {
            twist_deg: (self.twist / self.count).to_degrees(),
            twist_range_deg: self.twists.map(f64::to_degrees),
            strain_percent: strain.norm(),
            strain_axis_lab_deg: axis.rem_euclid(180.0),
            strain_lab_percent: strain.into(),
            strain_range_percent: self.strains.map(|strain| 100.0 * strain),
        })
    }
}

/// Pixels in each direction at which the local lattice is taken: means of smooth fields are right to 10⁻⁴ of their spread.
const SAMPLED: usize = 40;
/// Places of the table in each direction.
const TABLE: usize = 17;

/// Share of the pixels of a frame (trace) with moiré.
pub(crate) fn share_covered(settings: &Simulation, surface: &Surface, plan: &FramePlan) -> f64 {
    let [columns, rows] = settings.raster.pixels;
    let motion = Motion::new(&settings.drift);
    let mut covered = 0usize;
    for row in 0..rows {
        for column in 0..columns {
            let at = plan.place(motion, spmfile::LineDirection::Trace, [column, row]);
            covered += usize::from(surface.is_covered(at));
        }
    }
    covered as f64 / (columns * rows) as f64
}

/// The truth over all frames, given the share of each.
pub(crate) fn seen(settings: &Simulation, surface: &Surface, shares: &[f64]) -> SampleTruth {
    let [columns, rows] = settings.raster.pixels;
    let motion = Motion::new(&settings.drift);
    let mut all = Sum::new();
    let mut each = vec![Sum::new(); surface.grains.len()];
    let mut pixels = 0.0;
    for index in 0..settings.raster.scans {
        let plan = FramePlan::new(settings, index);
        let grid = |count: usize| (0..SAMPLED).map(move |i| (2 * i + 1) * count / (2 * SAMPLED));
        for row in grid(rows) {
            for column in grid(columns) {
                pixels += 1.0;
                let at = plan.place(motion, spmfile::LineDirection::Trace, [column, row]);
                let Some(found) = at_place(surface, at) else {
                    continue;
                };
                all.add(found);
                each[surface.grain_at(at)].add(found);
            }
        }
    }
    let grains = surface.grains.iter().zip(&each).map(|(grain, sum)| {
        let vector = |k: usize| grain.scene.basis.column(k).into_owned();
        let period = grain.sample.bilayer().reference.rotation_period();
        GrainTruth {
            share: sum.count / pixels,
            mean: sum.mean(),
            lattice_angle_deg: (grain.sample.lattice_angle_deg)
                .rem_euclid(period.to_degrees().round()),
            lattice_vectors_nm: [vector(0), vector(1), vector(1) - vector(0)].map(Into::into),
        }
    });
    let places = surface.reference.grid(TABLE).filter_map(|at| {
        let found = at_place(surface, at)?;
        Some(PlaceTruth {
            place_nm: at.into(),
            grain: surface.grain_at(at),
            twist_deg: found.twist.to_degrees(),
            strain_lab_percent: (found.strain * 100.0).into(),
        })
    });
    SampleTruth {
        share_covered: shares.iter().sum::<f64>() / shares.len() as f64,
        mean: all.mean(),
        grains: grains.collect(),
        places: places.collect(),
    }
}

/// Twist and strain where there is moiré.
fn at_place(surface: &Surface, at: Vector2<f64>) -> Option<Local> {
    if !surface.is_covered(at) {
        return None;
    }
    let sample = &surface.grains[surface.grain_at(at)].sample;
    if surface.bends.is_empty() {
        return Some(Local::uniform(sample));
    }
    local(sample, &surface.waves(at))
}
