//! One set: drift, and every scan before and after correction.

use nalgebra::Matrix2;

use crate::campaign::analysis::{Ruled, SetAnalysis};
use crate::campaign::group::Group;
use crate::campaign::means::SetMean;
use crate::campaign::set::about::about_set;
use crate::campaign::set::assumed::assumed;
use crate::campaign::set::bare::bare;
use crate::campaign::set::common::common;
use crate::campaign::set::drift::{constant_drift, outruns, unknown};
use crate::campaign::set::mean::{at_drift, forward_backward, without_drift};
use crate::campaign::set::moire::{breaks, draw};
use crate::campaign::set::ruler::{is_contradicted, ruled, tell};
use crate::campaign::set::scan::scans_at_drift;
use crate::campaign::set::{joint, published};
use crate::campaign::shells::of_other_shell;
use crate::caveat::Caveat;
use crate::caveat::drifting::{DriftDoubt, DriftShare};
use crate::caveat::sets::SetDoubt;
use crate::drift::linear::Observation;
use crate::frame::grid_errors::GridErrors;
use crate::meaning::strengths::WaveStrengths;
use crate::scan::measured::MeasuredScan;
use crate::settings::knobs::{RulerLayer, Settings};
use crate::spectrum::method::Method;

/// Everything about one set but its illustration; the settings name the waves of the lattice. `first_index` numbers its scans for the draws.
/// Scans that are left out by rule are marked in the group.
pub(crate) fn analyse_set(
    group: &mut Group,
    reference: &Matrix2<f64>,
    settings: &Settings,
    strengths: &WaveStrengths,
    first_index: u64,
    caveats: &mut Vec<Caveat>,
) -> SetAnalysis {
    let in_all = group.scans.iter();
    let seen: Vec<_> = in_all.map(|scan| observations(scan, reference)).collect();
    let joint = settings.method.is_joint() && settings.drift.is_none();
    if joint && settings.exclude_outliers {
        leave_out(group, &seen, reference, settings, caveats);
    }
    let kept = kept(group);
    let used: Vec<&MeasuredScan> = kept.iter().map(|&i| &group.scans[i]).collect();
    let all: Vec<Observation> = kept.iter().flat_map(|&i| &seen[i]).copied().collect();
    let name = &group.name;
    let mut open = None;
    let (solved, fit) = match constant_drift(name, &used, &all, settings, caveats) {
        Ok(linear) if joint => {
            let (solved, fit) = joint::refined(name, linear, &used, reference, settings, caveats);
            (Some(solved), fit)
        }
        Ok(linear) => (Some(linear), None),
        Err(why) => {
            open = why;
            (None, None)
        }
    };
    let of_set = solved.as_ref().map(|solved| &solved.drift);
    let fitted = fit.as_ref();
    let mut scans = scans_at_drift(&group.scans, &seen, reference, of_set, fitted, settings);
    let checks = fit
        .as_ref()
        .map(|fit| joint::checked(fit, &mut scans, &used, name, settings, caveats));
    draw(&mut scans, settings, first_index);
    if let (Method::Paper, Some(drift)) = (settings.method, of_set) {
        let measured = &group.scans;
        published::draw_all(&mut scans, measured, &seen, drift, settings, first_index);
    }
    let grid = grid_errors(&used, settings);
    // What is told by hand is known to be there.
    let doubt = no_result(group).filter(|_| !settings.by_hand.says_which());
    let outruns = of_set.and_then(|drift| outruns(drift, &all));
    let doubt = doubt.or_else(|| outruns.map(|share| SetDoubt::DriftOutrunsScan { share }));
    let (mut uncorrected, mut mean, mut lattice, mut ruler) = (None, None, None, None);
    if let Some(doubt) = doubt {
        caveats.push(Caveat::new(doubt, name));
    } else {
        let shared = common(&used, reference);
        let alone = kept.len() == 1;
        uncorrected = without_drift(&all, &scans, alone, &shared, &grid, settings, strengths);
        let poor = solved.as_ref().and_then(|solved| unknown(&solved.lattice));
        if let Some(share) = poor {
            open = Some(DriftDoubt::undetermined(format!(
                "the scans tell the drift so poorly that it leaves {:.0} % of a moiré vector open",
                100.0 * share
            )));
        }
        let assumed = open.as_ref().and_then(|_| assumed(&used, &all, settings));
        let known = solved.as_ref().filter(|_| open.is_none());
        let known = known.or(assumed.as_ref());
        let of = |solved| at_drift(solved, &scans, &shared, &grid, settings, strengths);
        // What contradicts itself by so much is no lattice of which one would have a twist.
        mean = known.filter(|_| poor.is_none()).and_then(of);
        if let Some(doubt) = mean.as_ref().and_then(|mean| breaks(mean, settings)) {
            caveats.push(Caveat::new(doubt, name));
            (uncorrected, mean) = (None, None);
        }
        if mean.is_none() && uncorrected.is_none() {
            lattice = known.map(|solved| bare(solved, &scans, &shared, &grid, settings));
        }
        let drift = known.map(|solved| &solved.drift);
        ruler = ruled(&used, reference, &shared, drift, settings, strengths);
    }
    let mut by_scanner = None;
    if let Some(ruler) = &mut ruler
        && is_better(ruler, mean.as_ref(), settings)
    {
        ruler.used = true;
        tell(&mut scans, ruler);
        by_scanner = mean.replace(ruler.mean.clone());
        lattice = None;
    }
    let share = mean.as_ref().and_then(DriftShare::of_mean);
    let share = share.or_else(|| lattice.as_ref().and_then(DriftShare::of_lattice));
    let open = open.filter(|_| !ruler.as_ref().is_some_and(|ruler| ruler.used));
    caveats.extend(open.map(|doubt| Caveat::new(doubt.with(share), name)));
    let set = SetAnalysis {
        name: name.clone(),
        slow_axis: group.slow_axis,
        line_rate_hz: group.line_rate_hz,
        channel: group.channel.clone(),
        forward_backward: forward_backward(&scans, settings),
        scans,
        drift: solved.map(|s| s.drift),
        mean,
        uncorrected,
        lattice,
        ruler,
        by_scanner,
        checks,
        illustration: None,
    };
    about_set(&set, kept.len(), settings, caveats);
    set
}

/// Whether the set is measured by its ruler: where its reading is decided and the user says so, or the layer is decided as well, the scanner does not
/// contradict it, and the total uncertainty of the twist is smaller. Which of several moirés have the layer whose atoms show is not decided.
fn is_better(ruler: &Ruled, mean: Option<&SetMean>, settings: &Settings) -> bool {
    let total = |mean: &SetMean| mean.twist().total;
    let smaller = |mean: &SetMean| !(total(mean) <= total(&ruler.mean));
    let told = settings.ruler != RulerLayer::Auto;
    let decided = settings.moires < 2 && ruler.other_layer.is_none();
    let decided = decided && !is_contradicted(ruler, settings);
    let layer = told || (decided && mean.is_none_or(smaller));
    layer && ruler.others().next().is_none()
}

/// Why the lattice of a set may be another one, so that the set has no result.
fn no_result(group: &Group) -> Option<SetDoubt> {
    of_other_shell(group).map(|times| SetDoubt::ShellForLattice { times })
}

/// The scans that are not left out, by their number.
fn kept(group: &Group) -> Vec<usize> {
    (0..group.scans.len())
        .filter(|&i| group.scans[i].excluded.is_none())
        .collect()
}

/// What errors of the grid do to the positions of these scans.
fn grid_errors(used: &[&MeasuredScan], settings: &Settings) -> GridErrors {
    let lines = used.iter().flat_map(|scan| &scan.lines);
    GridErrors::mean(lines.map(|line| line.grid_errors(settings)))
}

/// Marks the scans that do not fit the others.
fn leave_out(
    group: &mut Group,
    observations: &[Vec<Observation>],
    reference: &Matrix2<f64>,
    settings: &Settings,
    caveats: &mut Vec<Caveat>,
) {
    let kept = kept(group);
    let scans: Vec<&MeasuredScan> = kept.iter().map(|&i| &group.scans[i]).collect();
    let seen: Vec<&[Observation]> = kept.iter().map(|&i| observations[i].as_slice()).collect();
    for i in joint::outliers(&scans, &seen, reference, settings) {
        let scan = &mut group.scans[kept[i]];
        let reason = "it does not fit the others (leave-one-out χ², p < 0.001 divided by the number \
                      of scans)";
        scan.excluded = Some(reason.to_owned());
        caveats.push(Caveat::new(
            SetDoubt::ScanLeftOut {
                reason: reason.to_owned(),
            },
            &scan.file,
        ));
    }
}

fn observations(scan: &MeasuredScan, reference: &Matrix2<f64>) -> Vec<Observation> {
    scan.lines
        .iter()
        .map(|line| line.observation(reference))
        .collect()
}
