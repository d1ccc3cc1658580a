//! Caveats of a set: scatter, significance, scans that do not fit, readings.

use crate::campaign::analysis::{ScanAnalysis, SetAnalysis};
use crate::campaign::means::SetMean;
use crate::campaign::set::mean::{ONE_PERCENT, counted};
use crate::campaign::set::moire;
use crate::campaign::set::ruler::is_contradicted;
use crate::caveat::Caveat;
use crate::caveat::moires::MoireDoubt;
use crate::caveat::orientation::{OrientationDoubt, SenseNumbers};
use crate::caveat::sets::{Scattered, SetDoubt};
use crate::meaning::about::caveats;
use crate::meaning::budget::Source;
use crate::settings::knobs::{RulerLayer, Settings};

/// χ²/dof beyond which the scatter of the scans deserves a word: errors wrong by 1.4.
const LARGE_CHI2: f64 = 2.0;
/// The scatter of fewer scans is too uncertain itself to doubt the errors.
const FEWEST_TO_DOUBT: usize = 6;

/// Caveats of a set of which `used` scans count.
pub(crate) fn about_set(
    set: &SetAnalysis,
    used: usize,
    settings: &Settings,
    caveats: &mut Vec<Caveat>,
) {
    about_scatter(set, caveats);
    about_mean(&set.name, set.mean.as_ref(), caveats);
    let shown = set.mean.as_ref().or(set.uncorrected.as_ref());
    about_twist(&set.name, shown, caveats);
    let ruler = set.ruler.as_ref();
    let of_several = settings.moires > 1 && settings.ruler == RulerLayer::Auto;
    if ruler.is_some() && of_several {
        caveats.push(Caveat::new(OrientationDoubt::RulerMoire, &set.name));
    } else if ruler.is_some_and(|ruler| ruler.other_layer.is_some()) {
        caveats.push(Caveat::new(OrientationDoubt::RulerLayer, &set.name));
    } else if let Some(ruler) = ruler.filter(|ruler| ruler.others().next().is_some())
        && let Some(tensor) = &ruler.mean.readings.tensor
    {
        let readings = std::iter::once(tensor.in_all()).chain(ruler.others());
        let doubt = OrientationDoubt::RulerReadings {
            readings: readings.map(SenseNumbers::from).collect(),
        };
        caveats.push(Caveat::new(doubt, &set.name));
    }
    if let Some(ruler) = ruler.filter(|ruler| is_contradicted(ruler, settings)) {
        let doubt = OrientationDoubt::RulerSize {
            gain: ruler.fast_gain.value - 1.0,
            used: ruler.used,
        };
        caveats.push(Caveat::new(doubt, &set.name));
    }
    if let Some(mean) = shown {
        caveats.extend(about_readings(&set.name, mean, settings));
    }
    // The prior of a drift makes no strain less suspect.
    let judged = set.with_drift().or(set.uncorrected.as_ref()).or(shown);
    moire::doubts(&set.name, judged, set.lattice.as_ref(), settings, caveats);
    about_checks(set, used, caveats);
    about_bends(set, settings, caveats);
}

/// Says where a scanner without sensors may make the change that the lattice shows.
fn about_bends(set: &SetAnalysis, settings: &Settings, caveats: &mut Vec<Caveat>) {
    let counted = set.scans.iter().filter(|s| s.excluded.is_none());
    let lines = counted.flat_map(|s| &s.lines).filter(|l| !l.from_sensors);
    let changes = lines.filter_map(|l| l.change);
    let change = changes
        .map(|c| c.wavelength.max(c.angle))
        .fold(0.0, f64::max);
    // Stretches of 8sx/R, x over R.
    let bends = settings.calibration.scanner_bend_percent / 100.0 * 8.0 / 12f64.sqrt();
    if change > 0.0 && change < 2.0 * bends {
        let doubt = SetDoubt::ChangeOfScanner { change, bends };
        caveats.push(Caveat::new(doubt, &set.name));
    }
}

fn about_readings(name: &str, mean: &SetMean, settings: &Settings) -> Vec<Caveat> {
    let SetMean {
        lattice,
        twist_strain,
        readings,
        ..
    } = mean;
    caveats(name, lattice, twist_strain, readings, settings)
}

/// Says where the scans scatter by more than their errors, and by how much.
fn about_scatter(set: &SetAnalysis, caveats: &mut Vec<Caveat>) {
    let moires = set
        .mean
        .as_ref()
        .map(|mean| (mean.chi2_per_dof, Scattered::Moires));
    let bare = set.lattice.as_ref();
    let bare = bare.map(|found| (found.chi2_per_dof, Scattered::KnownLattice));
    let Some((Some(chi2_per_dof), of)) = moires.or(bare) else {
        return;
    };
    let lengths = |i: usize| {
        let of = |scan: &ScanAnalysis| {
            scan.drift_corrected
                .unwrap_or(scan.sensor)
                .wavelength(i)
                .value
        };
        let all = || counted(&set.scans).map(of);
        let [least, most] = [
            all().fold(f64::INFINITY, f64::min),
            all().fold(0.0, f64::max),
        ];
        most / least - 1.0
    };
    let doubt = SetDoubt::Scatter {
        of,
        chi2_per_dof,
        share: Some((0..3).map(lengths).fold(0.0, f64::max)),
    };
    if chi2_per_dof > LARGE_CHI2 {
        caveats.push(Caveat::new(doubt, &set.name));
    }
}

fn about_mean(name: &str, mean: Option<&SetMean>, caveats: &mut Vec<Caveat>) {
    let Some(mean) = mean else { return };
    if !mean.within_one_percent {
        caveats.push(Caveat::new(SetDoubt::OutsideOnePercent, name));
    }
    let found = &mean.twist_strain;
    let in_all = mean.budget.applied_to(found);
    if found.axis_lab().is_none() {
        caveats.push(Caveat::new(
            MoireDoubt::StrainNotSignificant {
                p_value: found.strain().p_value(),
                below: found.strain().upper_limit_95(),
            },
            name,
        ));
    } else if in_all.axis_lab().is_none() {
        caveats.push(Caveat::new(
            MoireDoubt::StrainWithinCalibration {
                p_value: in_all.strain().p_value(),
                below: in_all.strain().upper_limit_95(),
            },
            name,
        ));
    }
}

/// Says where the images, at a known drift, leave much of the twist open.
fn about_twist(name: &str, shown: Option<&SetMean>, caveats: &mut Vec<Caveat>) {
    let open = |mean: &SetMean| {
        let images = |source| matches!(source, Source::Image | Source::Sensor);
        let variance = mean.budget.sum(images).covariance.m11;
        variance.sqrt() / mean.twist_strain.twist.abs()
    };
    if let Some(share) = shown.map(open).filter(|share| *share > ONE_PERCENT) {
        caveats.push(Caveat::new(MoireDoubt::TwistImprecise { share }, name));
    }
}

/// Says where the scatter of `n` scans makes clearly larger errors than those stated: by more than four
/// times the scatter of such a comparison, 1/√(2(n − 1)).
fn about_checks(set: &SetAnalysis, n: usize, caveats: &mut Vec<Caveat>) {
    let found = set.checks.as_ref().and_then(|c| c.leave_one_out);
    let (Some(found), Some(drift), Some(mean)) = (found, &set.drift, set.with_drift()) else {
        return;
    };
    if n < FEWEST_TO_DOUBT {
        return;
    }
    let strain = mean.twist_strain.strain().covariance;
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
            SetDoubt::ScatterOfScans {
                larger: large.join(", "),
            },
            &set.name,
        ));
    }
}
