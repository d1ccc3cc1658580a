//! Atomically resolved images → the orientation of a layer.
//!
//! In: scans of the layer, measured like any others, in the frame of the moiré scans. Out: the
//! orientation of its reciprocal vectors (rad) with σ.
//!
//! Frames up and down give the lattice L and the drift by the same linear least squares as a moiré. With
//! the atomic vectors A⁰ at orientation zero, `F = L A⁰⁻¹` is a turn and a small distortion, and the turn
//! of its polar decomposition, the angle of its complex part p, is the orientation; what scanner and
//! strain distort symmetrically does not change it.
//!
//! Frames of one direction do not tell the drift, which at atomic magnification turns a lattice by
//! degrees. But with the lattice constant known, `(I − D uᵀ) F = R(α)`: the vector v with `uᵀF v = 0`, along
//! which no time passes (the fast axis), is turned by exactly α, whatever the drift. There orientation
//! rests on one direction, which errors of the calibration turn: by half the mismatch and half the error
//! of the right angle.

use heterostrain::lattice::{Lattice, renamings};
use heterostrain::material::Material;
use heterostrain::strain::named_like;
use heterostrain::{ComplexPair, Estimate};
use nalgebra::{Matrix2, Matrix4, RowVector4, Vector2};

use crate::campaign::alike::{Alike, alike};
use crate::campaign::analysis::AtomicOrientation;
use crate::campaign::identity::once;
use crate::caveat::Caveat;
use crate::caveat::kinds::each_kind_once;
use crate::caveat::orientation::OrientationDoubt;
use crate::drift::linear::{Observation, solve};
use crate::numbers::chi2::enlargement;
use crate::scan::measured::MeasuredScan;
use crate::settings::knobs::Calibration;

/// A lattice whose size differs from that of the material by more is another one. On the scenes of docs/constants.md half and double change no
/// result.
const LARGEST_ERROR: f64 = 0.15;
/// A lattice free of drift that is further from the shape of the material's (`|q|/|p|`) is another one: one axis stretched by a fifth. On the scenes
/// of docs/constants.md half and double change no result.
const LARGEST_DISTORTION: f64 = 0.1;
/// Frames up and down that a constant drift does not make of one another to this share contradict each other. Half and
/// twice as much change no result of docs/constants.md.
const LARGEST_MISFIT: f64 = 0.05;
/// With frames of one direction, another orientation with a distortion that is larger by less than this is as good.
/// Half and twice as much change no result of docs/constants.md.
pub(crate) const AMBIGUOUS: f64 = 0.1;
/// Orientations that differ by less are the same, rad: two names of one lattice agree to rounding.
const SAME_ANGLE: f64 = 1e-3;
/// χ²/dof beyond which the scatter of the images deserves a word: errors wrong by 1.4.
const LARGE_SCATTER: f64 = 2.0;
/// A size off by more than this many per cent of the priors deserves a word: standard deviations, 3 as everywhere.
const CLEARLY: f64 = 3.0;

/// Why atomic images give no orientation.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AtomicError {
    /// No image.
    #[error("no atomic image could be used")]
    Nothing,
    /// Frames without a time gradient.
    #[error("{0}: the file gives no line rate or no frame direction, so its drift is unknown")]
    NoTiming(String),
    /// Another lattice.
    #[error(
        "expected the lattice of {material} in the atomic images, found one {percent:+.0} % larger: another \
         layer, a superstructure or a scanner that is far off"
    )]
    OtherLattice {
        /// The layer that was expected.
        material: String,
        /// By how much the lattice that was found is larger.
        percent: f64,
    },
    /// Another lattice, by its shape.
    #[error(
        "expected the lattice of {material} in the atomic images, found one that is {percent:.0} % longer along one \
         direction than along another: another layer, another lattice in one of the frames, or drift that changes. Faster \
         lines and smaller frames make the drift matter less"
    )]
    OtherShape {
        /// The layer that was expected.
        material: String,
        /// How much longer one direction is than the one across it, per cent.
        percent: f64,
    },
    /// Frames up and down that contradict each other.
    #[error(
        "with no constant drift do the atomic frames up and down show the same lattice (they differ by \
         {misfit_percent:.0} %). Either one of them shows another lattice, or the drift changed or was too large \
         within a frame. Scan faster lines or smaller frames"
    )]
    Drift {
        /// What the best drift leaves, as a share of the lattice vectors, per cent.
        misfit_percent: f64,
    },
    /// Frames of one direction, too distorted.
    #[error(
        "all atomic images have the same frame direction, and drift distorts them so much that orientations of \
         {first_deg:.1}° and {second_deg:.1}° explain them equally well. Take frames up and down, or faster lines and \
         smaller frames"
    )]
    Ambiguous {
        /// The orientation with the least distortion, degrees.
        first_deg: f64,
        /// The next one.
        second_deg: f64,
    },
    /// No area, or a time gradient along both axes.
    #[error("the lattice of the atomic images cannot be used")]
    Degenerate,
}

/// The orientation of the layer `material`, number `layer` of the two, by atomic images of it.
///
/// # Errors
/// [`AtomicError`]: nothing to measure, no timing, or not the lattice of the material.
pub fn atomic_orientation(
    scans: &[MeasuredScan],
    material: &Material,
    layer: u8,
    calibration: &Calibration,
) -> Result<AtomicOrientation, AtomicError> {
    let (scans, repeats) = once(scans.to_vec());
    let timeless = |scan: &&MeasuredScan| scan.lines.iter().any(|line| line.timing.is_none());
    if let Some(scan) = scans.iter().find(timeless) {
        return Err(AtomicError::NoTiming(scan.file.clone()));
    }
    let atoms = material.atomic_pair();
    let lines = scans.iter().flat_map(|scan| &scan.lines);
    let Alike {
        observations,
        misfit,
        ..
    } = alike(lines, &atoms).ok_or(AtomicError::Nothing)?;
    if misfit > LARGEST_MISFIT {
        return Err(AtomicError::Drift {
            misfit_percent: 100.0 * misfit,
        });
    }
    let files: Vec<String> = scans.iter().map(|s| s.file.clone()).collect();
    let place = files.join(", ");
    let mut caveats = each_kind_once(&place, scans.iter().map(|s| &s.caveats));
    caveats.extend(repeats);
    let found = if let Ok(solution) = solve(&observations) {
        let scale = enlargement(solution.chi2, solution.degrees_of_freedom);
        if scale > LARGE_SCATTER {
            let times = scale.sqrt();
            let doubt = OrientationDoubt::AtomicScatter { times };
            caveats.push(Caveat::new(doubt, &place));
        }
        let lattice = Lattice::new(solution.lattice.basis, solution.lattice.covariance * scale);
        let (shape, angle) = turned(&lattice, &atoms)?;
        Found {
            shape,
            angle,
            drift: Some(solution.velocity),
        }
    } else {
        caveats.push(Caveat::new(OrientationDoubt::AtomicDriftAssumed, &place));
        one_direction(&observations, material, calibration)?
    };
    let doubt = about_shape(&found, material, calibration)?;
    caveats.extend(doubt.map(|doubt| Caveat::new(doubt, &place)));
    Ok(AtomicOrientation {
        files,
        layer,
        angle: Estimate::new(
            found.angle.value.rem_euclid(material.rotation_period()),
            found.angle.sigma,
        ),
        size: found.shape.0,
        distortion: found.shape.1,
        drift: found.drift,
        caveats,
    })
}

struct Found {
    /// Size and distortion of F.
    shape: (f64, f64),
    angle: Estimate,
    drift: Option<Vector2<f64>>,
}

/// Whether a lattice can be that of the material: an error where it cannot, a word where its size is off.
fn about_shape(
    found: &Found,
    material: &Material,
    calibration: &Calibration,
) -> Result<Option<OrientationDoubt>, AtomicError> {
    let (off, distortion) = (found.shape.0 - 1.0, found.shape.1);
    let material = material.name.clone();
    if found.drift.is_some() && distortion > LARGEST_DISTORTION {
        let percent = 200.0 * distortion;
        return Err(AtomicError::OtherShape { material, percent });
    }
    if off.abs() > LARGEST_ERROR {
        let percent = 100.0 * off;
        return Err(AtomicError::OtherLattice { material, percent });
    }
    let allowed = calibration.gain_percent / 100.0;
    let doubt = OrientationDoubt::AtomicSize {
        larger: off,
        material,
    };
    Ok((off.abs() > CLEARLY * allowed.max(0.01)).then_some(doubt))
}

/// `F = L U A⁰⁻¹` for the name L U of the lattice that distorts the material's least.
fn deformation(lattice: &Lattice, atoms: &Matrix2<f64>) -> Option<(Lattice, Matrix2<f64>)> {
    let named = named_like(lattice, atoms)?;
    Some((named, named.basis * atoms.try_inverse()?))
}

/// Size, distortion and turn of a lattice that is free of drift.
fn turned(lattice: &Lattice, atoms: &Matrix2<f64>) -> Result<((f64, f64), Estimate), AtomicError> {
    let (lattice, f) = deformation(lattice, atoms).ok_or(AtomicError::Degenerate)?;
    let inverse = atoms.try_inverse().ok_or(AtomicError::Degenerate)?;
    let ComplexPair { p, q } = f.into();
    let slopes = RowVector4::from_fn(|_, component| {
        let mut unit = Matrix2::zeros();
        unit[component] = 1.0;
        (p.conj() * ComplexPair::from(unit * inverse).p).im / p.norm_sqr()
    });
    let variance = (slopes * lattice.covariance * slopes.transpose())[0];
    Ok((
        (p.norm(), q.norm() / p.norm()),
        Estimate::from_variance(p.arg(), variance),
    ))
}

/// The turn of the direction along which no time passes, and by how much it is longer.
fn turn_of_fast_axis(f: &Matrix2<f64>, time_gradient: &Vector2<f64>) -> (f64, f64) {
    let w = f.transpose() * time_gradient;
    let along = Vector2::new(w.y, -w.x);
    let image = f * along;
    (
        (along.perp(&image)).atan2(along.dot(&image)),
        image.norm() / along.norm(),
    )
}

/// Refuses a lattice that another orientation of the material explains with nearly as little distortion.
fn unambiguous(
    lattice: &Lattice,
    atoms: &Matrix2<f64>,
    time_gradient: &Vector2<f64>,
    period: f64,
) -> Result<(), AtomicError> {
    let inverse = atoms.try_inverse().ok_or(AtomicError::Degenerate)?;
    let of = |f: &Matrix2<f64>| {
        (
            ComplexPair::from(*f).distortion(),
            turn_of_fast_axis(f, time_gradient),
        )
    };
    let (least, (angle, _)) = of(&(lattice.basis * inverse));
    let apart = |other: f64| {
        let turns = (other - angle) / period;
        (turns - turns.round()).abs() * period
    };
    let others = renamings(1)
        .map(|name| lattice.basis * name * inverse)
        .filter(|f| f.determinant() > 0.0)
        .map(|f| of(&f))
        .filter(|(distortion, _)| *distortion < least + AMBIGUOUS)
        .find(|(_, (other, length))| {
            apart(*other) > SAME_ANGLE && (length - 1.0).abs() < LARGEST_ERROR
        });
    others.map_or(Ok(()), |(_, (other, _))| {
        Err(AtomicError::Ambiguous {
            first_deg: angle.rem_euclid(period).to_degrees(),
            second_deg: other.rem_euclid(period).to_degrees(),
        })
    })
}

/// The turn of the direction along which no time passes, averaged over the images.
fn one_direction(
    observations: &[Observation],
    material: &Material,
    calibration: &Calibration,
) -> Result<Found, AtomicError> {
    let atoms = material.atomic_pair();
    let inverse = atoms.try_inverse().ok_or(AtomicError::Degenerate)?;
    let (mut weights, mut sum, mut size, mut distortion) = (0.0, 0.0, 0.0, 0.0);
    let (mut reference, mut fast) = (None, Vector2::x());
    for seen in observations {
        let (lattice, f) = deformation(&seen.lattice, &atoms).ok_or(AtomicError::Degenerate)?;
        let u = seen.time_gradient;
        if !(u.norm() > 0.0) {
            return Err(AtomicError::Degenerate);
        }
        let turn = |f: &Matrix2<f64>| turn_of_fast_axis(f, &u);
        let (angle, length) = turn(&f);
        unambiguous(&lattice, &atoms, &u, material.rotation_period())?;
        let step = 1e-6;
        let slopes = RowVector4::from_fn(|_, component| {
            let side = |sign: f64| {
                let mut basis = lattice.basis;
                basis[component] += sign * step * atoms.norm();
                turn(&(basis * inverse)).0
            };
            let difference = side(1.0) - side(-1.0);
            difference.sin().atan2(difference.cos()) / (2.0 * step * atoms.norm())
        });
        let covariance: &Matrix4<f64> = &lattice.covariance;
        let variance = (slopes * covariance * slopes.transpose())[0].max(f64::MIN_POSITIVE);
        let start = *reference.get_or_insert(angle);
        let turns = angle - start;
        // Labels of vectors may differ by a rotation that maps the lattice onto itself.
        let period = material.rotation_period();
        let near = turns - period * (turns / period).round();
        let ComplexPair { p, q } = f.into();
        weights += variance.recip();
        sum += near / variance;
        size += length / observations.len() as f64;
        distortion += q.norm() / p.norm() / observations.len() as f64;
        fast = Vector2::new(u.y, -u.x) / u.norm();
    }
    let start = reference.ok_or(AtomicError::Nothing)?;
    // Half the mismatch turns what lies along a diagonal, half the shear what lies along an axis.
    let (sine, cosine) = (2.0 * fast.x * fast.y, fast.x * fast.x - fast.y * fast.y);
    let mismatch = 0.5 * sine * calibration.mismatch_percent / 100.0;
    let shear = 0.5 * cosine * calibration.orthogonality_mrad / 1000.0;
    let variance = weights.recip() + mismatch * mismatch + shear * shear;
    Ok(Found {
        shape: (size, distortion),
        angle: Estimate::from_variance(start + sum / weights, variance),
        drift: None,
    })
}
