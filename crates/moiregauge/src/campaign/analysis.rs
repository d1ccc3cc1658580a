//! What an analysis finds: sets of scans, their drift, lattices, twist and strain.
//!
//! Plain values in nm, s and rad; the surface units (degrees, %, nm/min) belong to the report.

use heterostrain::Estimate;
use heterostrain::lattice::{Lattice, Px};
use heterostrain::strain::{
    KnownOrientation, LatticeDirection, Ruler, StrainDraw, StrainTensor, TwistStrain,
};
use nalgebra::{Matrix2, Vector2};
use spmfile::{DateTime, FrameDirection, LineDirection};

use crate::campaign::means::{Checks, Combined, Residual, SetLattice, SetMean};
use crate::campaign::motion::{Drift, Motion};
use crate::caveat::Caveat;
use crate::coverage::{Change, LatticeRegion};
use crate::frame::axis::Axis;
use crate::lattice::Evidence;
use crate::meaning::readings::Readings;
use crate::meaning::tensor::SenseReading;
use crate::scan::picture::{Illustration, Picture};
use crate::settings::knobs::Settings;

/// Everything found in a number of scans.
#[derive(Clone, Debug)]
pub struct Analysis {
    /// The settings as they were used.
    pub settings: Settings,
    /// The sets, in order of time.
    pub sets: Vec<SetAnalysis>,
    /// All sets taken together; `None` where no set gave a drift-corrected lattice.
    pub combined: Option<Combined>,
    /// The orientation of a layer, where atomically resolved images gave it.
    pub atomic: Option<AtomicOrientation>,
    /// An image of a larger area, to show where the scans were made.
    pub survey: Option<Picture>,
    /// Doubts, in the order in which they came up.
    pub caveats: Vec<Caveat>,
}

impl Analysis {
    /// The settings with the waves of the lattice that the numbers go with, for what is made from the same scans: maps
    /// have to read the lattice under the same name.
    pub fn named_settings(&self) -> Settings {
        let all = self.combined.as_ref();
        let all = all.map(|all| (all.lattice, all.readings.clone()));
        let sets: Vec<usize> = (0..self.sets.len()).collect();
        self.named_by(all.or_else(|| self.first_of(&sets)))
    }

    /// The same for scans of some of the sets, those of a grain.
    pub fn named_settings_of(&self, sets: &[usize]) -> Settings {
        self.named_by(self.first_of(sets))
    }

    /// The lattice of the first of some sets that has one.
    fn first_of(&self, sets: &[usize]) -> Option<(Lattice, Readings)> {
        let of_set = |set: &SetAnalysis| set.mean.clone().or(set.uncorrected.clone());
        let mean = sets.iter().find_map(|&i| of_set(&self.sets[i]))?;
        Some((mean.lattice, mean.readings))
    }

    fn named_by(&self, found: Option<(Lattice, Readings)>) -> Settings {
        let waves = found.and_then(|(lattice, readings)| {
            let naming = readings.naming?;
            let least = naming.names.iter().map(|n| n.strain);
            let least = least.fold(f64::INFINITY, f64::min);
            let reported = naming.names.first().filter(|n| n.strain > least)?;
            reported.name.waves(&lattice.basis)
        });
        let mut settings = self.settings.clone();
        if let Some(waves) = waves {
            settings.moire_waves = Some([0, 1].map(|i| [waves[(0, i)], waves[(1, i)]]));
        }
        settings
    }
}

/// Scans of one slow axis, line rate, size and channel, in order of time.
#[derive(Clone, Debug)]
pub struct SetAnalysis {
    /// Name for people, unique within the analysis, as in `slow y, 4 Hz`.
    pub name: String,
    /// The laboratory axis along which lines follow each other.
    pub slow_axis: Axis,
    /// Lines per second (trace and retrace together).
    pub line_rate_hz: f64,
    /// Name of the analysed channel.
    pub channel: String,
    /// The scans in order of time.
    pub scans: Vec<ScanAnalysis>,
    /// The drift, measured or given; `None` where the scans cannot determine it.
    pub drift: Option<Drift>,
    /// Lattice, twist and strain from all scans together, corrected for drift, or with an assumed one in their errors.
    pub mean: Option<SetMean>,
    /// The plain mean over the scans in sensor coordinates, not corrected for drift.
    pub uncorrected: Option<SetMean>,
    /// The lattice alone, where no twist and strain explain it; `None` of sets that have them, and where the lattice may be another one.
    pub lattice: Option<SetLattice>,
    /// By the atoms of a layer that the scans show beside the moiré; `None` where they do not.
    pub ruler: Option<Ruled>,
    /// `mean` by the scanner alone, where it is by the atoms.
    pub by_scanner: Option<SetMean>,
    /// Twist and strain from the mean reciprocal lattice of up and down scans, which is free of
    /// constant drift without knowing it; `None` where there is only one direction.
    pub forward_backward: Option<TwistStrain>,
    /// What the scans themselves say of the errors; `None` for other methods than the joint fit.
    pub checks: Option<Checks>,
    /// One scan in detail, for the figures.
    pub illustration: Option<Illustration>,
}

impl SetAnalysis {
    /// The mean of scans whose drift was measured or given.
    pub fn with_drift(&self) -> Option<&SetMean> {
        self.mean.as_ref().filter(|mean| mean.assumed.is_none())
    }
}

/// A set measured by the atoms of one of its layers.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Ruled {
    /// Layer 1, the reference, or layer 2.
    pub layer: u8,
    /// Those of the traces and retraces that show them, by file; they have the same orientation.
    pub rulers: Vec<(String, LineDirection, LineRuler)>,
    /// Whether the mean of the set is this.
    pub used: bool,
    /// The layer whose size the atoms have as well, as far as the calibration tells, where nobody said which layer it is; `None` for
    /// equal layers.
    pub other_layer: Option<u8>,
    /// Lattice (nm of the ruler), twist and strain: free of drift and of the calibration of the scanner.
    pub mean: SetMean,
    /// What the scanner shows over what it is, along the fast axis.
    pub fast_gain: Estimate,
    /// The drift that this goes with if both axes have the same gain and stand at a right angle, nm/s along x and y; `None` without timing.
    pub drift: Option<[Estimate; 2]>,
    /// Gain (per cent), mismatch (per cent) and deviation from a right angle (mrad) of the scanner that go with the drift of the set, which
    /// is given, measured or assumed: see [`crate::calibration`]; `None` without timing.
    pub calibration: Option<[Estimate; 3]>,
}

/// The atoms of a layer in one line.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct LineRuler {
    /// Layer 1, the reference, or layer 2.
    pub layer: u8,
    /// What they make of the positions of the scanner.
    pub ruler: Ruler,
    /// Their lattice in pixels (columns, rows).
    pub atoms: Lattice<Px>,
    /// Twist of the set, rad: which reading of a lattice is meant.
    pub twist: f64,
}

/// Readings of different layers with less mean strain than this are all possible: several times what layers on each other have.
const POSSIBLE: f64 = 0.005;

impl Ruled {
    /// The other readings that are possible, with everything in the budget for their covariance: the ruler does not tell them from that
    /// of `mean`, which has the least strain.
    pub fn others(&self) -> impl Iterator<Item = StrainTensor> {
        let tensor = self.mean.readings.tensor.iter();
        let others = tensor.flat_map(|tensor| &tensor.alternatives);
        others
            .map(SenseReading::in_all)
            .filter(|t| t.mean.abs() < POSSIBLE)
    }
}

/// One frame: its geometry, lattice, twist and strain.
#[derive(Clone, Debug)]
pub struct ScanAnalysis {
    /// The file as the user named it.
    pub file: String,
    /// When it was saved, by the instrument's clock.
    pub acquired: Option<DateTime>,
    /// Sense of the slow motion; `None` where the file does not tell.
    pub frame_direction: Option<FrameDirection>,
    /// The lines that were used, trace and retrace.
    pub lines: Vec<LineAnalysis>,
    /// Centre of the scanned window, sensor coordinates, nm.
    pub window_centre: Vector2<f64>,
    /// Extent of the window along its fast and slow sides, first to last pixel, nm.
    pub window_extent: [f64; 2],
    /// Fast tip velocity, nm/s; σ is the spread over the lines.
    pub fast_velocity: Estimate,
    /// Slow tip velocity, nm/s; σ is the spread over the lines.
    pub slow_velocity: Estimate,
    /// Lattice vectors in nominal coordinates, nm; `None` where the file gives no size.
    pub nominal: Option<Lattice>,
    /// Lattice vectors in sensor coordinates, nm (nominal ones where there are no sensors).
    pub sensor: Lattice,
    /// Lattice vectors corrected for drift, nm.
    pub drift_corrected: Option<Lattice>,
    /// The drift that was taken off, nm/s: that of its set at its time.
    pub drift: Option<Vector2<f64>>,
    /// Its time and the way of the sample; `None` where either is not known.
    pub motion: Option<Motion>,
    /// Twist and strain from `sensor`.
    pub twist_strain_sensor: Option<TwistStrain>,
    /// Twist and strain from `drift_corrected`.
    pub twist_strain: Option<TwistStrain>,
    /// Monte Carlo draws of twist and strain behind `twist_strain` (or `twist_strain_sensor`).
    pub draws: Vec<StrainDraw>,
    /// How it lies against the other scans; `None` without a joint fit of at least three scans.
    pub residual: Option<Residual>,
    /// Why it was not used for the results of its set; `None` where it was.
    pub excluded: Option<String>,
}

/// What one line direction of a frame gave.
#[derive(Clone, Debug)]
pub struct LineAnalysis {
    /// Trace or retrace.
    pub line: LineDirection,
    /// Lattice vectors in pixels (columns, rows).
    pub pixels: Lattice<Px>,
    /// Lattice vectors in sensor coordinates, nm.
    pub sensor: Lattice,
    /// The other estimator's vectors in sensor coordinates, nm, for comparison.
    pub comparison: Option<Lattice>,
    /// The published shortcut `4π/(√3|K|)` for the three first wave vectors, nm: right only for
    /// undistorted hexagons, printed for comparison.
    pub shortcut_wavelengths: Option<[f64; 3]>,
    /// Affine map pixel (column, row) → nm, the linear part.
    pub pixel_to_nm: Matrix2<f64>,
    /// Position of pixel (0, 0), nm.
    pub origin: Vector2<f64>,
    /// How far from its own place a pixel is on a straight grid, columns and rows: at 9 × 9 places of the frame from edge to edge, row by row;
    /// empty of a straight grid.
    pub displacement: Vec<[f64; 2]>,
    /// Whether position sensors were used.
    pub from_sensors: bool,
    /// Number of lattice periods across the shorter side of the frame.
    pub periods: f64,
    /// Signal-to-noise ratio of the weakest of the three first harmonics (amplitude).
    pub signal_to_noise: f64,
    /// What speaks for the lattice; `None` with the other methods, and where it was told by hand.
    pub evidence: Option<Evidence>,
    /// The part of the frame that carries the lattice; `None` for all of it.
    pub patch: Option<LatticeRegion>,
    /// How the lattice changes across that part; `None` where it is the same everywhere, as far as can be seen.
    pub change: Option<Change>,
    /// Whether ground was taken off before it was measured.
    pub on_ground: bool,
    /// The atoms that it shows, where they are the ruler of the set.
    pub ruler: Option<LineRuler>,
}

/// The orientation of a layer by its atomic lattice.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct AtomicOrientation {
    /// The files.
    pub files: Vec<String>,
    /// Layer 1, the reference, or layer 2.
    pub layer: u8,
    /// Of a reciprocal vector, rad, modulo the symmetry of the layer.
    pub angle: Estimate,
    /// Mean lattice constant that was found over that of the material.
    pub size: f64,
    /// How far the lattice found is from the shape of the material's: `|q|/|p|` of F.
    pub distortion: f64,
    /// Velocity of the drift, nm/s; `None` where the frames do not tell.
    pub drift: Option<Vector2<f64>>,
    /// Doubts.
    pub caveats: Vec<Caveat>,
}

impl AtomicOrientation {
    /// As the user would have given it.
    pub fn known(&self) -> KnownOrientation {
        KnownOrientation {
            angle_deg: self.angle.value.to_degrees(),
            sigma_deg: self.angle.sigma.to_degrees(),
            layer: self.layer,
            of: LatticeDirection::Reciprocal,
        }
    }
}
