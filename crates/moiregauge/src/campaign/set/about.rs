//! What has to be said of a set: scatter, significance, scans that do not fit, readings.

use crate::campaign::analysis::{Checks, Drift, Residual, SetMean};
use crate::caveat::Caveat;
use crate::meaning::about::caveats;
use crate::settings::knobs::Settings;

/// χ²/dof beyond which the scatter of the scans deserves a word.
const LARGE_CHI2: f64 = 2.0;
/// The scatter of fewer scans is too uncertain itself to doubt the errors.
const FEWEST_TO_DOUBT: usize = 6;

pub(crate) fn about_readings(name: &str, mean: &SetMean, settings: &Settings) -> Vec<Caveat> {
    let SetMean {
        lattice,
        twist_strain,
        readings,
        ..
    } = mean;
    caveats(name, lattice, twist_strain, readings, settings)
}

pub(crate) fn about_mean(name: &str, mean: Option<&SetMean>, caveats: &mut Vec<Caveat>) {
    let Some(mean) = mean else { return };
    if mean.chi2_per_dof > LARGE_CHI2 {
        caveats.push(Caveat::new(
            "scatter",
            name,
            format!(
                "the scans scatter {:.1} times more than their errors say (χ²/dof = {:.1}): drift that \
                 changes, an inhomogeneous lattice or sensor errors; errors of the set are enlarged to match",
                mean.chi2_per_dof.sqrt(),
                mean.chi2_per_dof
            ),
        ));
    }
    if !mean.within_one_percent {
        caveats.push(Caveat::new(
            "outside-one-percent",
            name,
            "a wavelength of a single scan differs by more than 1 % from that of the set",
        ));
    }
    let found = &mean.twist_strain;
    let in_all = mean.budget.applied_to(found);
    if found.axis_lab().is_none() {
        caveats.push(Caveat::new(
            "strain-not-significant",
            name,
            format!(
                "the heterostrain is not significant (p = {:.2}); it is below {:.4} % with 95 % \
                 confidence and has no axis",
                found.strain_p_value(),
                found.strain_upper_limit_95() * 100.0
            ),
        ));
    } else if in_all.axis_lab().is_none() {
        caveats.push(Caveat::new(
            "strain-within-calibration",
            name,
            format!(
                "the heterostrain stands out of the noise of the scans but not of the calibration of the \
                 scanner (p = {:.2}): with everything in the budget it is below {:.4} % with 95 % \
                 confidence; scans of the sample turned by 90° would tell",
                in_all.strain_p_value(),
                in_all.strain_upper_limit_95() * 100.0
            ),
        ));
    }
}

pub(crate) fn about_residual(
    file: &str,
    residual: &Residual,
    settings: &Settings,
    caveats: &mut Vec<Caveat>,
) {
    if !residual.outlying {
        return;
    }
    let place = residual.displacement.map_or(String::new(), |d| {
        format!(", {:.3} nm from where the others have it", d.norm())
    });
    let then = if settings.exclude_outliers {
        "more than a fifth of the scans are never left out by rule"
    } else {
        "it is used all the same; --exclude NAME or --exclude-outliers leaves it out"
    };
    caveats.push(Caveat::new(
        "outlying-scan",
        file,
        format!(
            "the scan does not fit the others (χ² = {:.0} for {} degrees of freedom, p = {:.0e}{place}); {then}",
            residual.chi2, residual.degrees_of_freedom, residual.p_value
        ),
    ));
}

/// Says where the scatter of `n` scans makes clearly larger errors than those stated: by more than four
/// times the scatter of such a comparison, 1/√(2(n − 1)).
pub(crate) fn about_checks(
    name: &str,
    (checks, drift, mean): (Option<&Checks>, Option<&Drift>, Option<&SetMean>),
    n: usize,
    caveats: &mut Vec<Caveat>,
) {
    if n < FEWEST_TO_DOUBT {
        return;
    }
    let (Some(found), Some(drift), Some(mean)) =
        (checks.and_then(|c| c.leave_one_out), drift, mean)
    else {
        return;
    };
    let strain = mean.twist_strain.strain_covariance();
    let stated = [
        ("drift x", found.drift[0], drift.covariance.m11.sqrt()),
        ("drift y", found.drift[1], drift.covariance.m22.sqrt()),
        ("twist", found.twist, mean.twist_strain.twist().sigma),
        ("strain along x and y", found.strain[0], strain.m11.sqrt()),
        (
            "strain along the diagonals",
            found.strain[1],
            strain.m22.sqrt(),
        ),
    ];
    let limit = 1.0 + 4.0 / (2.0 * (n as f64 - 1.0)).sqrt();
    let large: Vec<String> = stated
        .iter()
        .filter(|(_, found, stated)| *found > limit * stated)
        .map(|(what, found, stated)| format!("{what} {:.1} times", found / stated))
        .collect();
    if !large.is_empty() {
        caveats.push(Caveat::new(
            "scatter-of-scans",
            name,
            format!(
                "leaving out one scan at a time makes larger errors than those stated: {}; trust the \
                 larger ones",
                large.join(", ")
            ),
        ));
    }
}
