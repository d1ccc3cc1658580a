//! One scan as the document holds it.

use heterostrain::material::Bilayer;
use moiregauge::campaign::{LineAnalysis, ScanAnalysis};
use moiregauge::coverage::ChangeModel;
use moiregauge::frame::Axis;
use moiregauge::lattice::Candidate;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use spmfile::{DateTime, FrameDirection, LineDirection};

use super::checks::ResidualResult;
use super::convert::{estimate, number, pair, square};
use super::estimate::ResultEstimate;
use super::lattice::{LatticeVector, NAMES, StrainMonteCarlo, TwistStrainResult};

/// One frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ScanResult {
    /// The file as the user named it.
    pub file: String,
    /// When it was saved, by the instrument's clock, as in `2024-05-17T14:03:09`.
    pub acquired: Option<String>,
    /// `up`: the bottom line was acquired first; `down`: the top line; `unknown`.
    pub frame_direction: String,
    /// Where the tip was.
    pub window: Window,
    /// Speed of the tip, nm/s; σ is the spread over the lines.
    pub tip_velocity_nm_per_s: TipVelocity,
    /// The three lattice vectors.
    pub vectors: [ScanVector; 3],
    /// Twist and strain before and after the drift was removed.
    pub twist_strain: ScanTwistStrain,
    /// Mean and spread of the Monte Carlo draws behind the best of `twist_strain`.
    pub monte_carlo: Option<StrainMonteCarlo>,
    /// How it agrees with the other scans; `null` without a joint fit.
    pub residual: Option<ResidualResult>,
    /// Why it was not used for the results of its set; `null` where it was.
    pub excluded: Option<String>,
    /// The line directions that were used.
    pub lines: Vec<LineResult>,
}

/// The scanned window.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Window {
    /// Its centre (x, y), sensor coordinates, nm.
    pub centre_nm: [Option<f64>; 2],
    /// Lengths of its sides, the one nearer to x first, first to last pixel, nm.
    pub extent_nm: [Option<f64>; 2],
}

/// Tip velocities.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TipVelocity {
    /// Along a line.
    pub fast: ResultEstimate,
    /// From line to line.
    pub slow: ResultEstimate,
}

/// One lattice vector in three kinds of coordinates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ScanVector {
    /// `L1`, `L2` or `L3`.
    pub name: String,
    /// Direction by the best coordinates there are, degrees counter-clockwise from x.
    pub polar_angle_deg: Option<f64>,
    /// By the nominal size of the scan.
    pub nominal: Option<LatticeVector>,
    /// By the position sensors.
    pub sensor: LatticeVector,
    /// By the position sensors, the drift removed.
    pub drift_corrected: Option<LatticeVector>,
}

/// Twist and strain of a scan.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ScanTwistStrain {
    /// From sensor coordinates.
    pub sensor: Option<TwistStrainResult>,
    /// With the drift removed.
    pub drift_corrected: Option<TwistStrainResult>,
}

/// A lattice that an image may show.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CandidateResult {
    /// Lengths of its three shortest vectors by the geometry of the scan, drift included, shortest first.
    pub wavelengths_nm: [Option<f64>; 3],
    /// The same of a second lattice on top of it, where the two are described together: share and comparison are those of both.
    #[serde(default)]
    pub second_wavelengths_nm: Option<[Option<f64>; 3]>,
    /// How many of its cells the lattice that was measured has in one: 3 or 4 for a lattice that is made of harmonics of that.
    pub cells: usize,
    /// Share of the variance of parts of the frame that were held out, without slow background, that it predicts.
    pub predicted_share: Option<f64>,
    /// By how many standard errors the lattice that was measured predicts better.
    pub behind_by: Option<f64>,
}

/// What one line direction of a frame gave.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LineResult {
    /// `trace` or `retrace`.
    pub line: String,
    /// Whether position sensors placed the pixels.
    pub from_sensors: bool,
    /// Lattice periods across the shorter side.
    pub periods: Option<f64>,
    /// Amplitude of the weakest first harmonic over its noise.
    pub signal_to_noise: Option<f64>,
    /// By how many standard errors the weakest of the three waves improves the prediction of parts of the frame that were held out.
    pub predicted_by: Option<f64>,
    /// How many waves of about the same period beside the lattice are as strong as its weakest one; three could make another lattice.
    pub rivals: Option<usize>,
    /// Of a second lattice on top of it, which was measured with it: lengths of its three shortest vectors as those of `candidates`.
    #[serde(default)]
    pub second_wavelengths_nm: Option<[Option<f64>; 3]>,
    /// The lattices that were compared: the one that was measured, then the others, those that predict most first.
    pub candidates: Vec<CandidateResult>,
    /// Share of the frame that carries the lattice and was measured.
    pub share_covered: Option<f64>,
    /// What describes the lattice there: `constant`, or a mean of one that changes: `even` (wave vectors change in
    /// proportion to the place), `cubic` (phases are cubic polynomials) or `smooth`.
    pub lattice_model: String,
    /// Linear part of the map (column, row) → (x, y), nm per pixel, row by row.
    pub pixel_to_nm: [[Option<f64>; 2]; 2],
    /// Position of pixel (0, 0), the bottom left one, nm.
    pub origin_nm: [Option<f64>; 2],
    /// The three vectors in sensor coordinates.
    pub vectors: [LatticeVector; 3],
    /// The same by the other estimator.
    pub comparison: Option<[LatticeVector; 3]>,
    /// The published shortcut 4π/(√3|K|) of the three first wave vectors, nm: right only for
    /// undistorted hexagons, for comparison.
    pub shortcut_wavelengths_nm: Option<[Option<f64>; 3]>,
}

impl ScanResult {
    pub(crate) fn of(scan: &ScanAnalysis, slow: Axis, bilayer: Bilayer<'_>) -> Self {
        let [fast_side, slow_side] = scan.window_extent;
        let extent = match slow {
            Axis::X => [slow_side, fast_side],
            Axis::Y => [fast_side, slow_side],
        };
        Self {
            file: scan.file.clone(),
            acquired: scan.acquired.map(iso),
            frame_direction: direction_name(scan.frame_direction).to_owned(),
            window: Window {
                centre_nm: pair(scan.window_centre, 1.0),
                extent_nm: extent.map(number),
            },
            tip_velocity_nm_per_s: TipVelocity {
                fast: estimate(scan.fast_velocity, 1.0),
                slow: estimate(scan.slow_velocity, 1.0),
            },
            vectors: [0, 1, 2].map(|index| vector(scan, index, bilayer)),
            twist_strain: ScanTwistStrain {
                sensor: scan.twist_strain_sensor.as_ref().map(Into::into),
                drift_corrected: scan.twist_strain.as_ref().map(Into::into),
            },
            monte_carlo: StrainMonteCarlo::of(&scan.draws),
            residual: scan.residual.as_ref().map(Into::into),
            excluded: scan.excluded.clone(),
            lines: scan
                .lines
                .iter()
                .map(|line| line_result(line, bilayer))
                .collect(),
        }
    }
}

fn vector(scan: &ScanAnalysis, index: usize, bilayer: Bilayer<'_>) -> ScanVector {
    let sensor = LatticeVector::of(&scan.sensor, index, bilayer);
    let drift_corrected = scan
        .drift_corrected
        .map(|l| LatticeVector::of(&l, index, bilayer));
    ScanVector {
        name: NAMES[index].to_owned(),
        polar_angle_deg: drift_corrected.unwrap_or(sensor).polar_angle_deg,
        nominal: scan.nominal.map(|l| LatticeVector::of(&l, index, bilayer)),
        sensor,
        drift_corrected,
    }
}

fn candidate(candidate: &Candidate) -> CandidateResult {
    CandidateResult {
        wavelengths_nm: candidate.wavelengths.map(number),
        second_wavelengths_nm: candidate.second.map(|lengths| lengths.map(number)),
        cells: candidate.cells,
        predicted_share: number(candidate.share),
        behind_by: number(candidate.behind),
    }
}

fn line_result(line: &LineAnalysis, bilayer: Bilayer<'_>) -> LineResult {
    let evidence = line.evidence.as_ref();
    LineResult {
        line: match line.line {
            LineDirection::Trace => "trace",
            LineDirection::Retrace => "retrace",
        }
        .to_owned(),
        from_sensors: line.from_sensors,
        periods: number(line.periods),
        signal_to_noise: number(line.signal_to_noise),
        predicted_by: evidence.and_then(|e| e.predicts).and_then(number),
        rivals: evidence.map(|e| e.rivals),
        second_wavelengths_nm: evidence
            .and_then(|evidence| evidence.second)
            .map(|lengths| lengths.map(number)),
        candidates: evidence
            .map_or_else(Vec::new, |e| e.candidates.iter().map(candidate).collect()),
        share_covered: number(line.patch.as_ref().map_or(1.0, |patch| patch.share)),
        lattice_model: match line.change.map(|change| change.model) {
            None => "constant",
            Some(ChangeModel::Even) => "even",
            Some(ChangeModel::Cubic) => "cubic",
            Some(_) => "smooth",
        }
        .to_owned(),
        pixel_to_nm: square(&line.pixel_to_nm, 1.0),
        origin_nm: pair(line.origin, 1.0),
        vectors: LatticeVector::all(&line.sensor, bilayer),
        comparison: line.comparison.map(|l| LatticeVector::all(&l, bilayer)),
        shortcut_wavelengths_nm: line.shortcut_wavelengths.map(|l| l.map(number)),
    }
}

fn direction_name(direction: Option<FrameDirection>) -> &'static str {
    match direction {
        Some(FrameDirection::Up) => "up",
        Some(FrameDirection::Down) => "down",
        None => "unknown",
    }
}

/// ISO 8601 without a time zone, as the clock had none.
fn iso(t: DateTime) -> String {
    format!(
        "{:04}-{:02}-{:02}T{:02}:{:02}:{:02}",
        t.year, t.month, t.day, t.hour, t.minute, t.second
    )
}
