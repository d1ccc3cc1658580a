//! The calibration of a scanner by a lattice that is known.
//!
//! A scanner (its position sensors, or its nominal coordinates where there are none) shows `F r` in place
//! of the true r. An image of a known lattice tells F up to a turn: the lattice shown, free of drift, is
//! `L = F R(α) A⁰`, four numbers for the three of a symmetric F and the orientation α of the sample. So F is
//! symmetric by definition,
//!   `F = [[1 + s + g/2, γ/2], [γ/2, 1 + s − g/2]]`,
//! with the common gain s, the mismatch g of x against y and the deviation γ from a right angle (positive
//! where the axes shown enclose less than 90°). In the complex form `L A⁰⁻¹ ↔ (p, q)`: `s = |p| − 1`,
//! `g + iγ = 2 q p/|p|`, `α = arg p`. Measured vectors are corrected with `F⁻¹`.
//!
//! What an isotropic or uniaxial strain of the known lattice does is not told from s, g and γ.

use heterostrain::lattice::{Lattice, renamings, shortest_pair};
use heterostrain::material::Material;
use heterostrain::{ComplexPair, Estimate};
use nalgebra::{Matrix2, Matrix3, Matrix3x4, Vector3};
use serde::{Deserialize, Serialize};

use crate::frame::geometry::Geometry;

/// A lattice whose cell is known.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct KnownLattice {
    /// Name, as in `graphite` or `Si(111) 7×7`.
    pub name: String,
    /// Length of the first vector, nm.
    pub a_nm: f64,
    /// Length of the second vector, nm.
    pub b_nm: f64,
    /// Angle between the two, degrees.
    pub angle_deg: f64,
    /// Relative standard uncertainty of both lengths, per cent.
    pub sigma_percent: f64,
    /// Where the numbers come from.
    pub source: String,
}

/// Name, a (nm), σ of a (nm), source. Hexagonal surfaces that are used for calibration.
const SURFACES: [(&str, f64, f64, &str); 5] = [
    (
        "graphite",
        0.246,
        0.0001,
        "that of graphene, Blakslee et al. 1970; 0.2459 to 0.2462 nm are in use",
    ),
    (
        "mica",
        0.5195,
        0.002,
        "muscovite: about 0.519 nm × 0.901 nm, hexagonal within 0.4 %",
    ),
    (
        "si111-7x7",
        2.688,
        0.001,
        "7 × 0.3840 nm, from the lattice parameter of silicon, 0.5431 nm",
    ),
    (
        "si111",
        0.3840,
        0.0001,
        "0.5431 nm/√2, lattice parameter of silicon",
    ),
    (
        "au111",
        0.2884,
        0.0003,
        "0.4078 nm/√2, lattice parameter of gold; the herringbone shortens it by 4 % along one direction",
    ),
];

/// Lengths that the vectors of a known lattice can have, nm: from below any bond of atoms to the coarsest grating.
const LENGTHS: std::ops::RangeInclusive<f64> = 0.05..=1e5;

impl KnownLattice {
    /// A hexagonal lattice.
    pub fn hexagonal(name: &str, a_nm: f64, sigma_percent: f64, source: &str) -> Self {
        Self {
            name: name.to_owned(),
            a_nm,
            b_nm: a_nm,
            angle_deg: 60.0,
            sigma_percent,
            source: source.to_owned(),
        }
    }

    /// The lattice of a layer, hexagonal or not.
    pub fn of_layer(layer: &Material) -> Self {
        let a = layer.lattice_constant_nm;
        let (b_nm, angle_deg) = match (layer.lattice_constant_b_nm, layer.cell_angle_deg) {
            (Some(b), Some(angle)) => (b, angle),
            _ => (a, 60.0),
        };
        Self {
            name: layer.name.clone(),
            a_nm: a,
            b_nm,
            angle_deg,
            sigma_percent: 100.0 * layer.lattice_constant_sigma_nm / a,
            source: layer.source.clone(),
        }
    }

    /// The surfaces known by name.
    pub fn all() -> Vec<Self> {
        SURFACES
            .iter()
            .map(|(name, a, sigma, source)| Self::hexagonal(name, *a, 100.0 * sigma / a, source))
            .collect()
    }

    /// The surface of that name, upper or lower case.
    pub fn named(name: &str) -> Option<Self> {
        Self::all()
            .into_iter()
            .find(|known| known.name.eq_ignore_ascii_case(name.trim()))
    }

    /// What is wrong with the numbers; `None` where they describe a lattice.
    pub fn problem(&self) -> Option<String> {
        for (what, length) in [("a_nm", self.a_nm), ("b_nm", self.b_nm)] {
            if !LENGTHS.contains(&length) {
                return Some(format!(
                    "{what} of the known lattice: expected {} to {} nm, found {length}",
                    LENGTHS.start(),
                    LENGTHS.end()
                ));
            }
        }
        if !(5.0..=175.0).contains(&self.angle_deg) {
            return Some(format!(
                "angle_deg of the known lattice: expected 5° to 175°, found {}",
                self.angle_deg
            ));
        }
        (!(0.0..=10.0).contains(&self.sigma_percent)).then(|| {
            format!(
                "sigma_percent of the known lattice: expected 0 to 10 %, found {}",
                self.sigma_percent
            )
        })
    }

    /// The shortest two vectors that stand at 60° to 90°, as columns, nm; `None` without an area.
    pub fn cell(&self) -> Option<Matrix2<f64>> {
        let angle = self.angle_deg.to_radians();
        let pair = Matrix2::new(
            self.a_nm,
            self.b_nm * angle.cos(),
            0.0,
            self.b_nm * angle.sin(),
        );
        Some(pair * shortest_pair(&pair)?)
    }
}

/// Which positions a calibration is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Coordinates {
    /// Those of the position sensors.
    Sensors,
    /// Nominal ones: what the voltages of the scanner were meant to do.
    Nominal,
}

/// A measured calibration: lengths in the image are `F` times the true ones, see [`crate::calibration`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// s: by how much lengths in the image are too long, mean of x and y, per cent.
    pub gain_percent: f64,
    /// g: by how much lengths along x are too long compared with y, per cent.
    pub mismatch_percent: f64,
    /// γ: a right angle minus the angle between the axes in the image, mrad.
    pub orthogonality_mrad: f64,
    /// Covariance of the three, in their units.
    pub covariance: [[f64; 3]; 3],
    /// Whether it is that of position sensors.
    pub coordinates: Coordinates,
    /// How position sensors bend; `None` where no bend was seen.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub curvature: Option<Curvature>,
    /// Sizes of the frames it was measured with, nm (fast, slow).
    #[serde(default)]
    pub sizes_nm: Vec<[f64; 2]>,
    /// Line rates of those frames, Hz.
    #[serde(default)]
    pub line_rates_hz: Vec<f64>,
}

/// Gain (per cent), mismatch (per cent) and deviation from a right angle (mrad) that no position sensors have: they
/// are calibrated, if badly. Twenty or more times what is assumed without a calibration.
const WORST_SENSORS: [f64; 3] = [20.0, 10.0, 100.0];
/// The same for nominal coordinates: an open piezo tube makes a frame of 55 nm where 70 nm are asked for.
const WORST_NOMINAL: [f64; 3] = [40.0, 25.0, 200.0];
/// Standard uncertainties beyond which a calibration tells less than none: five times (gain) and twenty times what is
/// assumed without one.
const MOST_UNCERTAIN: [f64; 3] = [5.0, 10.0, 100.0];
/// What the three numbers are called, and their units, for words about wrong settings.
const NAMES: [(&str, &str); 3] = [
    ("the common gain", "%"),
    ("the mismatch of x and y", "%"),
    ("the deviation from a right angle", "mrad"),
];
/// Units of a calibration: per cent, per cent, mrad, as scanners are specified.
const UNITS: [f64; 3] = [100.0, 100.0, 1000.0];

/// What common gain, mismatch and deviation from a right angle are as matrices: F − 1 per unit.
pub(crate) fn distortions() -> [Matrix2<f64>; 3] {
    [
        Matrix2::identity(),
        Matrix2::new(0.5, 0.0, 0.0, -0.5),
        Matrix2::new(0.0, 0.5, 0.5, 0.0),
    ]
}

impl Calibration {
    /// From (s, g, γ) and their covariance, without units.
    pub(crate) fn new(
        values: &Vector3<f64>,
        covariance: &Matrix3<f64>,
        coordinates: Coordinates,
    ) -> Self {
        Self {
            gain_percent: values[0] * UNITS[0],
            mismatch_percent: values[1] * UNITS[1],
            orthogonality_mrad: values[2] * UNITS[2],
            covariance: [0, 1, 2]
                .map(|i| [0, 1, 2].map(|j| covariance[(i, j)] * UNITS[i] * UNITS[j])),
            coordinates,
            curvature: None,
            sizes_nm: Vec::new(),
            line_rates_hz: Vec::new(),
        }
    }

    /// (s, g, γ), without units.
    fn values(&self) -> Vector3<f64> {
        Vector3::new(
            self.gain_percent / UNITS[0],
            self.mismatch_percent / UNITS[1],
            self.orthogonality_mrad / UNITS[2],
        )
    }

    /// Covariance of (s, g, γ), without units.
    fn parameter_covariance(&self) -> Matrix3<f64> {
        Matrix3::from_fn(|i, j| self.covariance[i][j] / (UNITS[i] * UNITS[j]))
    }

    /// F: true → shown.
    pub fn distortion(&self) -> Matrix2<f64> {
        let values = self.values();
        let parts = distortions();
        Matrix2::identity() + parts[0] * values[0] + parts[1] * values[1] + parts[2] * values[2]
    }

    /// `F⁻¹`: shown → true. `None` for numbers that are no distortion.
    pub fn map(&self) -> Option<Matrix2<f64>> {
        self.nonsense()
            .is_none()
            .then(|| self.distortion().try_inverse())?
    }

    /// Positions as the sensors show them, freed of what the sensors bend.
    pub(crate) fn unbent(&self, recorded: &Geometry) -> Geometry {
        let of_these = recorded.from_sensors && self.coordinates == Coordinates::Sensors;
        let curvature = self.curvature.as_ref().filter(|_| of_these);
        curvature.map_or_else(|| recorded.clone(), |bent| bent.without(recorded))
    }

    /// What is wrong with the numbers, or why they can be those of no scanner; `None` where they can be used.
    pub fn problem(&self) -> Option<String> {
        let curvature = self.curvature.as_ref().and_then(Curvature::problem);
        self.nonsense().or(curvature).or_else(|| self.implausible())
    }

    /// Why these can be the numbers of no scanner, or are too uncertain to correct anything with.
    fn implausible(&self) -> Option<String> {
        let (of, worst) = self.worst();
        let named = NAMES.iter().zip(self.estimates());
        for (((name, unit), found), worst) in named.clone().zip(worst) {
            if found.value.abs() > worst {
                return Some(format!(
                    "{name}: expected between −{worst} and {worst} {unit} for the {of} of a scanner, found {:.1} ± {:.1} \
                     {unit}; the images show another lattice than the one they were compared with, their size is wrong, \
                     or it is their drift",
                    found.value, found.sigma
                ));
            }
        }
        for (((name, unit), found), worst) in named.zip(MOST_UNCERTAIN) {
            if found.sigma > worst {
                return Some(format!(
                    "{name}: expected a standard uncertainty of {worst} {unit} or less, found {:.1} ± {:.1} {unit}; frames \
                     up and down, faster lines and smaller frames tell more",
                    found.value, found.sigma
                ));
            }
        }
        None
    }

    /// Numbers that a scanner can have but rarely has: more than half of what none can have, at two standard
    /// uncertainties.
    pub(crate) fn unusual(&self) -> Option<String> {
        let (of, worst) = self.worst();
        let named = NAMES.iter().zip(self.estimates()).zip(worst);
        let mut unusual = named.filter_map(|(((name, unit), found), worst)| {
            let clearly = found.value.abs() - 2.0 * found.sigma > worst / 2.0;
            clearly.then(|| {
                format!(
                    "{name} of {:.1} ± {:.1} {unit} for the {of}",
                    found.value, found.sigma
                )
            })
        });
        unusual.next()
    }

    /// What it is a calibration of, and the numbers that no such scanner has (per cent, per cent, mrad).
    fn worst(&self) -> (&'static str, [f64; 3]) {
        match self.coordinates {
            Coordinates::Sensors => ("position sensors", WORST_SENSORS),
            Coordinates::Nominal => ("nominal coordinates", WORST_NOMINAL),
        }
    }

    /// What is wrong with the numbers as numbers.
    fn nonsense(&self) -> Option<String> {
        let covariance = self.parameter_covariance();
        let finite = self
            .values()
            .iter()
            .chain(covariance.iter())
            .all(|v| v.is_finite());
        if !finite {
            return Some("expected finite numbers".to_owned());
        }
        let conditions = self.sizes_nm.iter().flatten().chain(&self.line_rates_hz);
        if let Some(value) = conditions.copied().find(|v| !(*v > 0.0 && v.is_finite())) {
            return Some(format!(
                "expected sizes and line rates greater than 0, found {value}"
            ));
        }
        let own = self.distortion().symmetric_eigenvalues();
        if !(own.min() > 0.1 && own.max() < 10.0) {
            return Some(format!(
                "expected a distortion between 0.1 and 10, found {:.3} and {:.3} along its axes",
                own.min(),
                own.max()
            ));
        }
        let symmetric = (covariance - covariance.transpose()).amax() <= 1e-9 * covariance.amax();
        let least = covariance.symmetric_eigenvalues().min();
        (!symmetric || least < -1e-9 * covariance.amax())
            .then(|| "expected a covariance that is symmetric and not negative".to_owned())
    }

    /// Gain, mismatch (per cent) and deviation from a right angle (mrad) with their σ.
    pub fn estimates(&self) -> [Estimate; 3] {
        let values = [
            self.gain_percent,
            self.mismatch_percent,
            self.orthogonality_mrad,
        ];
        [0, 1, 2].map(|i| Estimate::from_variance(values[i], self.covariance[i][i]))
    }

    /// Independent errors that together have the covariance, as changes of F: what is in the first of gain,
    /// mismatch and orthogonality, what the second adds to it, what the third adds to both.
    pub(crate) fn independent_errors(&self) -> [Matrix2<f64>; 3] {
        let lower = root(&self.parameter_covariance());
        let parts = distortions();
        [0, 1, 2]
            .map(|k| parts[0] * lower[(0, k)] + parts[1] * lower[(1, k)] + parts[2] * lower[(2, k)])
    }
}

/// Lower triangle L with `L Lᵀ = c`; a direction without variance gets none.
fn root(c: &Matrix3<f64>) -> Matrix3<f64> {
    let mut lower = Matrix3::zeros();
    for k in 0..3 {
        let known = |i: usize, lower: &Matrix3<f64>| -> f64 {
            (0..k).map(|j| lower[(i, j)] * lower[(k, j)]).sum()
        };
        let pivot = c[(k, k)] - known(k, &lower);
        if pivot <= 1e-12 * c[(k, k)] {
            continue;
        }
        for i in k..3 {
            lower[(i, k)] = (c[(i, k)] - known(i, &lower)) / pivot.sqrt();
        }
    }
    lower
}

/// What a lattice shows of the scanner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shown {
    /// (s, g, γ), without units.
    pub values: Vector3<f64>,
    /// Their covariance.
    pub covariance: Matrix3<f64>,
    /// α, orientation of the known cell's first vector, rad.
    pub orientation: Estimate,
    /// `|q|/|p|`: how far the lattice shown is from the shape of the known one.
    pub distortion: f64,
    /// The same for the next best way of naming its vectors that gives another F.
    pub next_distortion: f64,
}

/// Compares a lattice, free of drift, with the known `cell` (reduced, nm), under the names of its vectors
/// that make the distortion smallest. `None` where either has no area.
pub fn shown(lattice: &Lattice, cell: &Matrix2<f64>) -> Option<Shown> {
    // The surface may lie either face up.
    let mirror = Matrix2::new(1.0, 0.0, 0.0, -1.0);
    let mut found: Vec<Shown> = Vec::new();
    for known in [*cell, mirror * cell] {
        let inverse = known.try_inverse()?;
        let same_face = |l: &Lattice| l.basis.determinant() * known.determinant() > 0.0;
        let named = renamings(1).map(|name| lattice.relabelled(&name));
        found.extend(named.filter(same_face).map(|l| by_name(&l, &inverse)));
    }
    // Of names that a symmetry of the cell makes equal, the one that turns it least.
    let rank = |s: &Shown| ((s.distortion * 1e9).round(), s.orientation.value.abs());
    found.sort_by(|a, b| {
        let (a, b) = (rank(a), rank(b));
        a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1))
    });
    let best = *found.first()?;
    let other = found
        .iter()
        .find(|f| (f.values - best.values).norm() > 1e-6)
        .map_or(f64::INFINITY, |f| f.distortion);
    Some(Shown {
        next_distortion: other,
        ..best
    })
}

fn by_name(lattice: &Lattice, inverse: &Matrix2<f64>) -> Shown {
    let shape = ComplexPair::from(lattice.basis * inverse);
    let ComplexPair { p, q } = shape;
    let turn = p / p.norm();
    let stretch = 2.0 * q * turn;
    let mut jacobian = Matrix3x4::zeros();
    let mut of_turn = nalgebra::Vector4::zeros();
    for component in 0..4 {
        let mut unit = Matrix2::zeros();
        unit[component] = 1.0;
        let ComplexPair { p: dp, q: dq } = (unit * inverse).into();
        let along = p.conj() * dp / p.norm();
        of_turn[component] = along.im / p.norm();
        let change = 2.0 * turn * (dq + q * nalgebra::Complex::i() * of_turn[component]);
        jacobian.set_column(component, &Vector3::new(along.re, change.re, change.im));
    }
    let variance = (of_turn.transpose() * lattice.covariance * of_turn)[0];
    Shown {
        values: Vector3::new(p.norm() - 1.0, stretch.re, stretch.im),
        covariance: jacobian * lattice.covariance * jacobian.transpose(),
        orientation: Estimate::from_variance(p.arg(), variance),
        distortion: shape.distortion(),
        next_distortion: f64::INFINITY,
    }
}

pub(crate) mod curvature;
#[cfg(test)]
mod tests;

pub use curvature::Curvature;
