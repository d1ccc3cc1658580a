//! What an analysis of simulated frames ought to find. Units in the names, conventions beside them.

use nalgebra::{Matrix2, Vector2};
use serde::{Deserialize, Serialize};
use spmfile::FrameDirection;

use crate::simulate::raster::{FramePlan, file_name};
use crate::simulate::scene::Scene;
use crate::simulate::seen::{SampleTruth, seen, share_covered};
use crate::simulate::settings::Simulation;
use crate::simulate::surface::Surface;

/// The truth about a simulated set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Truth {
    /// Name and version of this layout.
    pub schema: String,
    /// How angles, directions and the strain are counted.
    pub conventions: Vec<String>,
    /// θ, degrees.
    pub twist_deg: f64,
    /// ε, per cent.
    pub strain_percent: f64,
    /// `ε_b`, the same in all directions, per cent.
    #[serde(default)]
    pub biaxial_percent: f64,
    /// φ, degrees in [0, 180).
    pub strain_axis_lattice_deg: f64,
    /// φ + α + θ, degrees in [0, 180).
    pub strain_axis_lab_deg: f64,
    /// α, degrees in [0, 60).
    pub lattice_angle_deg: f64,
    /// The three moiré vectors of the hexagon's half: first, second, second − first.
    pub lattice_vectors_nm: [[f64; 2]; 3],
    /// Their lengths.
    pub wavelengths_nm: [f64; 3],
    /// Two reciprocal vectors, `G_i · a_j = 2π δ_ij`.
    pub reciprocal_vectors_rad_per_nm: [[f64; 2]; 2],
    /// Velocity at the start of the clock.
    pub drift_nm_per_min: [f64; 2],
    /// Mean velocity from the start of the first frame to the end of the last one.
    pub mean_drift_nm_per_min: [f64; 2],
    /// Where the sample is not the same everywhere; what stands above is then that of the first lattice before it is bent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sample: Option<SampleTruth>,
    /// The frames, in order of time.
    pub frames: Vec<FrameTruth>,
    /// Everything that was set.
    pub settings: Simulation,
}

/// The truth about one frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[non_exhaustive]
pub struct FrameTruth {
    /// Name of the file.
    pub file: String,
    /// `up` or `down`.
    pub frame_direction: String,
    /// On the clock of the drift.
    pub start_s: f64,
    /// On the clock of the drift.
    pub end_s: f64,
    /// Centre of the window.
    pub window_centre_nm: [f64; 2],
    /// Position of pixel (0, 0).
    pub origin_nm: [f64; 2],
    /// Rows of the matrix from (column, row) to (x, y).
    pub pixel_to_nm: [[f64; 2]; 2],
    /// Time of pixel (0, 0), trace.
    pub trace_first_pixel_s: f64,
    /// Time from column to column and from row to row, trace.
    pub trace_time_per_pixel_s: [f64; 2],
    /// Time of pixel (0, 0), retrace.
    pub retrace_first_pixel_s: f64,
    /// Time from column to column and from row to row, retrace.
    pub retrace_time_per_pixel_s: [f64; 2],
    /// Share of its pixels with moiré, where the sample is not the same everywhere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub share_covered: Option<f64>,
}

const CONVENTIONS: [&str; 6] = [
    "x to the right, y up, angles counter-clockwise; row 0 is the bottom line of the frame",
    "layer 2 is layer 1 stretched by the strain along its axis, then turned by the twist",
    "lattice_angle: orientation of the reciprocal vectors of layer 1, modulo 60 degrees; its atomic vectors lie 30 degrees further",
    "strain_axis_lattice is counted from layer 1; strain_axis_lab = strain_axis_lattice + lattice_angle + twist",
    "strain > 0 is tension in the real-space form and compression in the k-space form (settings.sample.strain_convention)",
    "drift: motion of the sample in the frame of the sensors; a feature at R is found at R + d(t)",
];

pub(crate) fn truth(settings: &Simulation, scene: &Scene, surface: Option<&Surface>) -> Truth {
    let sample = &settings.sample;
    // α is reduced modulo 60° (the symmetry of layer 1), φ takes up what α loses.
    let period = sample
        .bilayer()
        .reference
        .rotation_period()
        .to_degrees()
        .round();
    let lattice_angle = sample.lattice_angle_deg.rem_euclid(period);
    let axis = sample.strain_axis_deg + sample.lattice_angle_deg - lattice_angle;
    let column = |m: &Matrix2<f64>, k: usize| -> Vector2<f64> { m.column(k).into() };
    let (first, second) = (column(&scene.basis, 0), column(&scene.basis, 1));
    let vectors = [first, second, second - first];
    let frames: Vec<FrameTruth> = (0..settings.raster.scans)
        .map(|index| frame_truth(settings, surface, index))
        .collect();
    let shares: Vec<f64> = frames.iter().filter_map(|f| f.share_covered).collect();
    Truth {
        schema: "moiregauge/truth/1".to_owned(),
        conventions: CONVENTIONS.map(str::to_owned).to_vec(),
        twist_deg: sample.twist_deg,
        strain_percent: sample.strain_percent,
        biaxial_percent: sample.biaxial_percent,
        strain_axis_lattice_deg: axis.rem_euclid(180.0),
        strain_axis_lab_deg: (axis + lattice_angle + sample.twist_deg).rem_euclid(180.0),
        lattice_angle_deg: lattice_angle,
        lattice_vectors_nm: vectors.map(Into::into),
        wavelengths_nm: vectors.map(|v| v.norm()),
        reciprocal_vectors_rad_per_nm: [0, 1].map(|k| column(&scene.reciprocal, k).into()),
        drift_nm_per_min: settings.drift.velocity_nm_per_min,
        mean_drift_nm_per_min: mean_drift(settings, &frames),
        sample: surface.map(|surface| seen(settings, surface, &shares)),
        frames,
        settings: settings.clone(),
    }
}

/// Of a quadratic path, the velocity in the middle.
fn mean_drift(settings: &Simulation, frames: &[FrameTruth]) -> [f64; 2] {
    let start = frames.first().map_or(0.0, |f| f.start_s);
    let end = frames.last().map_or(0.0, |f| f.end_s);
    let middle_min = f64::midpoint(start, end) / 60.0;
    let drift = &settings.drift;
    [0, 1].map(|k| drift.velocity_nm_per_min[k] + drift.acceleration_nm_per_min2[k] * middle_min)
}

fn frame_truth(settings: &Simulation, surface: Option<&Surface>, index: usize) -> FrameTruth {
    let plan = FramePlan::new(settings, index);
    let j = plan.pixel_to_nm;
    FrameTruth {
        file: file_name(index),
        frame_direction: match plan.direction {
            FrameDirection::Up => "up".to_owned(),
            FrameDirection::Down => "down".to_owned(),
        },
        start_s: plan.start,
        end_s: plan.end,
        window_centre_nm: plan.centre.into(),
        origin_nm: plan.origin.into(),
        pixel_to_nm: [[j.m11, j.m12], [j.m21, j.m22]],
        trace_first_pixel_s: plan.trace.first,
        trace_time_per_pixel_s: plan.trace.step.into(),
        retrace_first_pixel_s: plan.retrace.first,
        retrace_time_per_pixel_s: plan.retrace.step.into(),
        share_covered: surface.map(|surface| share_covered(settings, surface, &plan)),
    }
}
