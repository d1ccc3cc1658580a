//! All sets taken together, and how well they agree.

use heterostrain::lattice::Lattice;
use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};

use crate::campaign::analysis::{Ruled, SetAnalysis};
use crate::campaign::means::{Checks, Combined, Consistency, SetMean};
use crate::campaign::motion::{Drift, JointTerms};
use crate::campaign::set::common::common;
use crate::campaign::set::joint::{checks as set_checks, joint_fit, lattice_of, terms};
use crate::campaign::set::moire::moire;
use crate::campaign::sightings::middle_of_frame;
use crate::caveat::Caveat;
use crate::caveat::drifting::DriftDoubt;
use crate::caveat::sets::SetDoubt;
use crate::drift::joint::found::JointFit;
use crate::drift::joint::path::DriftPath;
use crate::drift::shares::Statistical;
use crate::frame::grid_errors::GridErrors;
use crate::meaning::about::caveats as about_readings;
use crate::meaning::budget::Budget;
use crate::meaning::readings::Readings;
use crate::meaning::ruler::ByRuler;
use crate::meaning::strengths::WaveStrengths;
use crate::numbers::chi2::enlargement;
use crate::scan::measured::MeasuredScan;
use crate::settings::knobs::Settings;

/// Wavelengths that differ by more than this are not of the same lattice: five times the calibration that is assumed,
/// …
pub(crate) const SAME_LATTICE: f64 = 0.05;
/// … nor are those that differ by more than this if their errors do not explain it: χ² of four components beyond
/// `NO_CHANCE`. Twice the calibration that is assumed.
const NEARLY_SAME: f64 = 0.02;
/// χ² of four components that is no chance: p = 4·10⁻¹⁰, since errors may be too small.
const NO_CHANCE: f64 = 50.0;
/// χ² of two components beyond which the drift of a set is not that of all sets: p = 10⁻⁴.
const CONTRADICTION: f64 = 18.4;
/// χ²/dof of all sets over that of the single ones beyond which they have no drift in common: errors wrong by 1.7. On the scenes of docs/constants.md
/// half and double change no result.
const WORSE: f64 = 3.0;
/// Sets this many σ apart deserve a word: 3 as everywhere.
const APART: f64 = 3.0;

/// Weighted mean lattice of all sets whose drift is known; `None` where there is none, or where the sets show different lattices. The
/// error of an assumed drift is the same in all sets and does not average out: such a set is combined with no other.
pub(crate) fn combine(
    sets: &[SetAnalysis],
    joint: Option<(&[&MeasuredScan], Matrix2<f64>)>,
    settings: &Settings,
    strengths: &WaveStrengths,
    caveats: &mut Vec<Caveat>,
) -> Option<Combined> {
    let ruled: Vec<&Ruled> = sets.iter().filter_map(|s| s.ruler.as_ref()).collect();
    let ruled: Vec<&Ruled> = ruled.into_iter().filter(|ruler| ruler.used).collect();
    if !ruled.is_empty() {
        return by_rulers(&ruled, sets, settings, strengths);
    }
    let means: Vec<&SetMean> = match sets {
        [one] => one.mean.iter().collect(),
        all => all.iter().filter_map(SetAnalysis::with_drift).collect(),
    };
    if let Some(share) = difference(&means) {
        let doubt = SetDoubt::DifferentLattices { share };
        caveats.push(Caveat::new(doubt, "analysis"));
        return None;
    }
    let Together {
        lattice,
        statistical,
        joint,
        drift,
        path,
        checks,
    } = together(sets, &means, joint, settings, caveats)?;
    let consistency = consistency(sets);
    caveats.extend(consistency.iter().filter_map(about_consistency));
    let twist_strain = moire(&lattice, settings)?;
    let grid = GridErrors::mean(means.iter().map(|m| m.budget.grid));
    let mut budget = Budget::with_grid(&lattice, &twist_strain, &statistical, &grid, settings);
    budget.drift_assumed = means.iter().any(|mean| mean.assumed.is_some());
    let readings = Readings::new(&lattice, &twist_strain, &budget, strengths, settings);
    if sets.len() > 1 {
        let found = about_readings("analysis", &lattice, &twist_strain, &readings, settings);
        caveats.extend(found);
    }
    Some(Combined {
        lattice,
        twist_strain,
        budget,
        readings,
        joint,
        drift,
        path,
        checks,
        consistency,
    })
}

/// The mean of the sets that the atoms of a layer measure: the scanner alone measures others far worse.
fn by_rulers(
    ruled: &[&Ruled],
    sets: &[SetAnalysis],
    settings: &Settings,
    strengths: &WaveStrengths,
) -> Option<Combined> {
    let means: Vec<&SetMean> = ruled.iter().map(|ruler| &ruler.mean).collect();
    let (lattice, _) = weighted_mean(&means)?;
    let first = ruled.first()?;
    let (_, _, ruler) = first.rulers.first()?;
    let all = ByRuler::new(&ruler.ruler, ruler.layer, &lattice, settings)?;
    Some(Combined {
        readings: all.readings(&lattice, strengths, settings),
        lattice,
        twist_strain: all.twist_strain,
        budget: all.budget,
        joint: None,
        drift: None,
        path: None,
        checks: None,
        consistency: consistency(sets),
    })
}

/// The lattice of all sets, with what their joint fit tells where there is one.
struct Together {
    lattice: Lattice,
    statistical: Statistical,
    joint: Option<JointTerms>,
    drift: Option<Drift>,
    path: Option<DriftPath>,
    checks: Option<Checks>,
}

/// By the joint fit of the scans of all sets and their reference, or else the mean of the sets.
fn together(
    sets: &[SetAnalysis],
    means: &[&SetMean],
    joint: Option<(&[&MeasuredScan], Matrix2<f64>)>,
    settings: &Settings,
    caveats: &mut Vec<Caveat>,
) -> Option<Together> {
    let (lattice, statistical) = weighted_mean(means)?;
    let mean = Together {
        lattice,
        statistical,
        joint: None,
        drift: None,
        path: None,
        checks: None,
    };
    if let ([set], [mean]) = (sets, means) {
        return Some(of_one(set, mean));
    }
    let joint = joint.filter(|(scans, _)| !scans.is_empty());
    let start = sets.iter().find_map(|s| s.drift.as_ref());
    let (Some((scans, reference)), Some(start)) = (joint, start) else {
        return Some(mean);
    };
    let fit = match joined(sets, scans, &reference, &lattice, &start.velocity, settings) {
        Ok(fit) => fit,
        Err(reason) => {
            caveats.push(Caveat::new(DriftDoubt::NotJoined { reason }, "analysis"));
            return Some(mean);
        }
    };
    let (mut lattice, mut statistical) =
        lattice_of(&fit, &reference).unwrap_or((lattice, statistical));
    let shared = common(scans, &reference);
    lattice.covariance += shared;
    statistical.image += shared;
    let joint = Some(terms(&fit));
    let left_out = fit.leave_one_out();
    Some(Together {
        lattice,
        statistical,
        joint: joint.clone(),
        drift: Some(Drift {
            velocity: fit.velocity,
            covariance: fit.velocity_covariance,
            given: false,
            fit: None,
            monte_carlo: None,
            joint,
        }),
        path: Some(fit.path()),
        checks: Some(set_checks(&fit, &left_out, scans, "all sets", settings)),
    })
}

/// Where there is nothing to combine: the set has it all.
fn of_one(set: &SetAnalysis, mean: &SetMean) -> Together {
    let drift = set.drift.clone().filter(|drift| drift.joint.is_some());
    Together {
        lattice: mean.lattice,
        statistical: mean.budget.statistical,
        joint: drift.as_ref().and_then(|drift| drift.joint.clone()),
        drift,
        path: None,
        checks: set.checks.clone(),
    }
}

/// By what share the lattices of sets differ at most; `None` where they are of one sample and place.
fn difference(means: &[&SetMean]) -> Option<f64> {
    let first = means.first()?.lattice;
    means
        .iter()
        .filter(|other| are_different(&first, &other.lattice))
        .map(|other| (other.lattice.basis - first.basis).norm() / first.basis.norm())
        .reduce(f64::max)
}

/// Whether two lattices are of different samples or places.
fn are_different(a: &Lattice, b: &Lattice) -> bool {
    let share = (b.basis - a.basis).norm() / a.basis.norm();
    let difference = b.flat() - a.flat();
    let inverse = (a.covariance + b.covariance).try_inverse();
    let chi2 = inverse.map_or(0.0, |inverse| difference.dot(&(inverse * difference)));
    share > SAME_LATTICE || (share > NEARLY_SAME && chi2 > NO_CHANCE)
}

/// The joint fit of all sets, or why it does not describe them.
fn joined(
    sets: &[SetAnalysis],
    scans: &[&MeasuredScan],
    reference: &Matrix2<f64>,
    lattice: &Lattice,
    velocity: &Vector2<f64>,
    settings: &Settings,
) -> Result<JointFit, String> {
    let fit = joint_fit(scans, reference, lattice, velocity, settings)
        .ok_or("their drift cannot be determined together")?;
    let reduced = fit.chi2 / fit.degrees_of_freedom.max(1) as f64;
    let means = sets.iter().filter_map(SetAnalysis::with_drift);
    let usual = means.filter_map(|m| m.chi2_per_dof).fold(1.0, f64::max);
    if reduced > WORSE * usual {
        return Err(format!(
            "together they scatter {:.0} times more than alone",
            (reduced / usual).sqrt()
        ));
    }
    match contradiction(sets, scans, &fit) {
        Some(set) => Err(format!("this drift contradicts that of {set}")),
        None => Ok(fit),
    }
}

/// The first set whose own drift is not that of the joint fit at its time: χ² of two components beyond
/// 18.4 (p = 10⁻⁴).
fn contradiction<'a>(
    sets: &'a [SetAnalysis],
    scans: &[&MeasuredScan],
    fit: &JointFit,
) -> Option<&'a str> {
    sets.iter()
        .find(|set| {
            let times: Vec<f64> = scans
                .iter()
                .filter(|scan| set.scans.iter().any(|s| s.file == scan.file))
                .filter_map(|scan| middle_of_frame(scan))
                .collect();
            let Some(drift) = set.drift.as_ref().filter(|_| !times.is_empty()) else {
                return false;
            };
            let first = times.iter().copied().fold(f64::INFINITY, f64::min);
            let last = times.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let (velocity, covariance) = fit.velocity_at(f64::midpoint(first, last));
            let apart = sigmas(
                &(drift.velocity - velocity),
                &(drift.covariance + covariance),
            );
            apart.is_some_and(|s| s * s > CONTRADICTION)
        })
        .map(|set| set.name.as_str())
}

/// Generalised mean of the four components, its covariance enlarged where the sets scatter.
fn weighted_mean(means: &[&SetMean]) -> Option<(Lattice, Statistical)> {
    let (mut normal, mut right) = (Matrix4::zeros(), Vector4::zeros());
    let mut weights = Vec::with_capacity(means.len());
    for mean in means {
        let w = mean.lattice.covariance.try_inverse()?;
        normal += w;
        right += w * mean.lattice.flat();
        weights.push(w);
    }
    let covariance = normal.try_inverse()?;
    let flat = covariance * right;
    let chi2: f64 = means
        .iter()
        .zip(&weights)
        .map(|(mean, w)| {
            let d = mean.lattice.flat() - flat;
            (d.transpose() * w * d)[0]
        })
        .sum();
    let freedom = 4 * (means.len() - 1);
    let scale = enlargement(chi2, freedom);
    let parts: Vec<Statistical> = means.iter().map(|m| m.budget.statistical).collect();
    let lattice = Lattice::new(
        Matrix2::new(flat[0], flat[2], flat[1], flat[3]),
        covariance * scale,
    );
    Some((lattice, Statistical::of_mean(&parts, scale)?))
}

fn consistency(sets: &[SetAnalysis]) -> Vec<Consistency> {
    let mut all = Vec::new();
    for (i, a) in sets.iter().enumerate() {
        for b in &sets[i + 1..] {
            let (Some(ma), Some(mb)) = (a.with_drift(), b.with_drift()) else {
                continue;
            };
            let (ta, tb) = (&ma.twist_strain, &mb.twist_strain);
            let twist = ta.twist().value - tb.twist().value;
            let drift_sigmas = match (&a.drift, &b.drift) {
                (Some(da), Some(db)) if !da.given && !db.given => sigmas(
                    &(da.velocity - db.velocity),
                    &(da.covariance + db.covariance),
                ),
                _ => None,
            };
            let strain = sigmas(
                &(ta.strain_vector - tb.strain_vector),
                &(ta.strain().covariance + tb.strain().covariance),
            );
            all.push(Consistency {
                sets: [a.name.clone(), b.name.clone()],
                drift_sigmas,
                twist_sigmas: twist.abs() / ta.twist().sigma.hypot(tb.twist().sigma),
                strain_sigmas: strain.unwrap_or(f64::INFINITY),
            });
        }
    }
    all
}

/// Says where two sets are too far apart.
fn about_consistency(pair: &Consistency) -> Option<Caveat> {
    let drift = pair.drift_sigmas.unwrap_or(0.0);
    let (twist, strain) = (pair.twist_sigmas, pair.strain_sigmas);
    let doubt = SetDoubt::SetsDisagree {
        drift,
        twist,
        strain,
    };
    (drift.max(twist).max(strain) > APART).then(|| Caveat::new(doubt, pair.sets.join(" / ")))
}

/// `√(dᵀ C⁻¹ d)`.
fn sigmas(d: &Vector2<f64>, covariance: &Matrix2<f64>) -> Option<f64> {
    let inverse = covariance.try_inverse()?;
    Some((d.transpose() * inverse * d)[0].max(0.0).sqrt())
}
