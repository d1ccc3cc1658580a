//! What the images of one scan make doubtful.

use heterostrain::lattice::labelled_like;

use crate::caveat::Caveat;
use crate::frame::geometry::Geometry;
use crate::lattice::fit::bend::Inhomogeneity;
use crate::lattice::fit::closure::Closure;
use crate::lattice::fit::fit_pixels::LatticeFit;
use crate::lattice::fit::noise::ForeignWave;
use crate::lattice::measured::MeasuredLattice;
use crate::numbers::chi2;
use crate::scan::measured::MeasuredLine;

/// Fewer periods than this across the shorter side deserve a warning.
const FEW_PERIODS: f64 = 3.0;
/// Trace and retrace whose lattices differ by more than this share do not show the same one.
const ANOTHER_LATTICE: f64 = 0.1;
/// Differences that chance makes less often deserve a word, if they are larger than `NOTABLE`.
const NO_CHANCE: f64 = 1e-4;
const NOTABLE: f64 = 1e-3;

/// Says that a frame without sensors was turned back by the angle that the file states.
pub(crate) fn turned(file: &str, rotation_rad: f64, caveats: &mut Vec<Caveat>) {
    if rotation_rad != 0.0 {
        caveats.push(Caveat::new(
            "frame-turned",
            file,
            format!(
                "the frame is turned by {:.4}° against the laboratory axes, in which vectors and angles are given; \
                 in the axes of the image, which --rotation 0 gives, all angles are smaller by that",
                rotation_rad.to_degrees()
            ),
        ));
    }
}

/// Says where the lattice is measured on few periods.
pub(crate) fn few_periods(file: &str, lattice: &MeasuredLattice, caveats: &mut Vec<Caveat>) {
    if lattice.periods < FEW_PERIODS {
        caveats.push(Caveat::new(
            "few-periods",
            file,
            format!(
                "only {:.1} lattice periods fit across the frame; vectors from fewer than {FEW_PERIODS} \
                 are less accurate than their errors say",
                lattice.periods
            ),
        ));
    }
}

/// Compares trace and retrace, and says where they do not show the same; a reason not to use the scan where
/// they show different lattices.
///
/// Drift within a line makes a difference of drift over tip speed, which is small but for the slowest scans.
pub(crate) fn lines_disagree(
    file: &str,
    lines: &[MeasuredLine],
    caveats: &mut Vec<Caveat>,
) -> Option<String> {
    let [first, second] = lines else { return None };
    let first = first.in_sensor_coordinates();
    let second = labelled_like(&second.in_sensor_coordinates(), &first.basis);
    let share = (second.basis - first.basis).norm() / first.basis.norm();
    let lengths = |l: &heterostrain::lattice::LatticeVectors| {
        let [a, b, c] = [0, 1, 2].map(|i| l.wavelength(i).value);
        format!("{a:.4}, {b:.4}, {c:.4} nm")
    };
    let both = format!(
        "{} in trace, {} in retrace",
        lengths(&first),
        lengths(&second)
    );
    if share > ANOTHER_LATTICE {
        let reason = "trace and retrace show different lattices".to_owned();
        caveats.push(Caveat::new(
            "lines-disagree",
            file,
            format!(
                "{reason} ({both}): one of them is none of the sample's; the scan is not used, --line says \
                 which to believe"
            ),
        ));
        return Some(reason);
    }
    let difference = second.flat() - first.flat();
    let inverse = (first.covariance + second.covariance).try_inverse()?;
    let chi2 = difference.dot(&(inverse * difference));
    if chi2::tail(chi2, 4) < NO_CHANCE && share > NOTABLE {
        caveats.push(Caveat::new(
            "lines-disagree",
            file,
            format!(
                "trace and retrace differ by {:.2} %, more than their errors say (χ² {chi2:.0} for 4 numbers; \
                 {both}): creep or hysteresis of the scanner, sensors that lag behind, or a drift that is not \
                 small against the tip's speed",
                100.0 * share
            ),
        ));
    }
    None
}

/// What the fit to the pixels found beside the lattice.
pub(crate) fn about_fit(
    file: &str,
    fit: &LatticeFit,
    geometry: &Geometry,
    caveats: &mut Vec<Caveat>,
) {
    if let Some(change) = fit.inhomogeneity.filter(Inhomogeneity::stands_out) {
        caveats.push(Caveat::new(
            "inhomogeneous-lattice",
            file,
            format!(
                "the lattice is not the same everywhere in the frame: from corner to corner its wavelength \
                 changes by up to {:.2} % and its direction by up to {:.2}° (χ² {:.0} for 6 numbers; {:.0} can \
                 be chance). Results are means over the frame. Drift that got faster or slower, and creep, \
                 look like this along the slow axis",
                100.0 * change.wavelength,
                change.angle.to_degrees(),
                change.chi_squared,
                change.threshold
            ),
        ));
    }
    if let Some(closure) = fit.closure.filter(|c: &Closure| c.enlargement() > 1.0) {
        caveats.push(Caveat::new(
            "harmonics-disagree",
            file,
            format!(
                "the harmonics of the image do not agree on one lattice (χ² {:.0} for {} degrees of \
                 freedom): each of them is the mean over another part of a lattice that is not the same \
                 everywhere; the errors of the vectors are enlarged {:.1} times",
                closure.chi_squared,
                closure.degrees_of_freedom,
                closure.enlargement().sqrt()
            ),
        ));
    }
    let Some(wave) = fit.foreign_wave.filter(ForeignWave::stands_out) else {
        return;
    };
    let Some(inverse) = geometry.pixel_to_nm.try_inverse() else {
        return;
    };
    let period = std::f64::consts::TAU / (inverse.transpose() * wave.wave_vector).norm();
    caveats.push(Caveat::new(
        "second-lattice",
        file,
        format!(
            "beside the lattice a wave with a period of {period:.2} nm stands out of what the fit leaves \
             ({:.0} times the noise around it; {:.0} can be chance): a second lattice, interference, or a \
             lattice that is not the same everywhere in the frame",
            wave.significance, wave.threshold
        ),
    ));
}
