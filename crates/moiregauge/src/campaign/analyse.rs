//! The whole chain: scans → sets → drift → lattice → twist and strain.
//!
//! [`measure_scan`] does what needs the pixels, one scan at a time; [`analyse`] does the rest from
//! the few numbers that remain. [`illustrate`] goes back to the pixels of one scan for the figures.

use heterostrain::lattice::canonical;
use nalgebra::Matrix2;

use crate::campaign::analysis::{Analysis, SetAnalysis};
use crate::campaign::naming::Named;
use crate::campaign::set::analyse as set;
use crate::campaign::{combine, grains, group, identity, samples, shells};
use crate::caveat::files::FileDoubt;
use crate::caveat::lattices::LatticeDoubt;
use crate::caveat::moires::MoireDoubt;
use crate::caveat::sets::SetDoubt;
use crate::caveat::{Caveat, Doubt};
use crate::drift::joint::path::DriftPath;
use crate::frame::background::Background;
use crate::scan::grains::each;
use crate::scan::measured::MeasuredScan;
use crate::settings::knobs::Settings;
use crate::spectrum::method::Method;

/// Groups measured scans into sets and finds their drift, lattice, twist and strain.
///
/// Sets and scans come out in order of time. Nothing here fails: what cannot be determined is left
/// out, and a caveat says why.
pub fn analyse(scans: Vec<MeasuredScan>, settings: &Settings) -> Analysis {
    let mut caveats = about_settings(settings);
    let mut scans = scans;
    exclude(&mut scans, settings, &mut caveats);
    caveats.extend(nothing_left(&scans));
    identity::mark_repeats(&mut scans, &mut caveats);
    each(&mut scans);
    let mut groups = group::groups(scans, settings.grouping);
    // What is told by hand is known to be there.
    if !settings.by_hand.says_which() {
        shells::agree(&mut groups, &mut caveats);
    }
    let (groups, separated) = samples::separated(groups, settings, &mut caveats);
    let used: Vec<&MeasuredScan> = groups.iter().flat_map(|group| &group.scans).collect();
    let named = Named::new(&used, settings);
    let mut reference: Option<Matrix2<f64>> = None;
    let mut sets = Vec::with_capacity(groups.len());
    let mut joint_scans = Vec::new();
    let mut index = 0;
    for mut group in groups {
        let line = group.scans.first().and_then(|s| s.lines.first());
        reference = reference.or_else(|| Some(canonical(&line?.in_sensor_coordinates()).basis));
        caveats.extend(group.caveats());
        let Some(reference) = reference else { continue };
        // Repeated scans come last and take no random numbers from those that follow.
        let count = group.scans.iter().filter(|s| s.repeats.is_none()).count() as u64;
        sets.push(set::analyse_set(
            &mut group,
            &reference,
            &named.settings,
            &named.strengths,
            index,
            &mut caveats,
        ));
        index += count;
        if settings.method.is_joint() && settings.drift.is_none() {
            joint_scans.extend(group.scans.into_iter().filter(|s| s.excluded.is_none()));
        }
    }
    grains::agree_on_drift(&mut sets, &mut caveats);
    let all: Vec<&MeasuredScan> = joint_scans.iter().collect();
    let joint = reference.map(|reference| (all.as_slice(), reference));
    // Samples have no mean.
    let combined = (!separated)
        .then(|| {
            let (settings, strengths) = (&named.settings, &named.strengths);
            combine::combine(&sets, joint, settings, strengths, &mut caveats)
        })
        .flatten();
    if let Some(path) = combined.as_ref().and_then(|c| c.path) {
        follow(&mut sets, path);
    }
    Analysis {
        settings: settings.clone(),
        sets,
        combined,
        atomic: None,
        survey: None,
        caveats,
    }
}

/// All scans moved on the path that all sets have in common.
fn follow(sets: &mut [SetAnalysis], path: DriftPath) {
    let scans = sets.iter_mut().flat_map(|set| &mut set.scans);
    for motion in scans.filter_map(|scan| scan.motion.as_mut()) {
        motion.path = path;
    }
}

/// Why an analysis has no result that could be used: every scan was left out, or the layers cannot make the lattices.
/// `None` where a set has twist and strain, and for other reasons, which are no refusal.
pub fn refusal(analysis: &Analysis) -> Option<&Caveat> {
    let mut sets = analysis.sets.iter();
    if sets.any(|set| set.mean.is_some() || set.uncorrected.is_some()) {
        return None;
    }
    let all = || analysis.caveats.iter();
    all()
        .find(|c| is_nothing_left(&c.doubt))
        .or_else(|| all().find(|c| is_impossible(&c.doubt)))
        .or_else(|| all().find(|c| is_doubtful(&c.doubt)))
}

/// Whether a doubt says that every scan was left out.
pub fn is_nothing_left(doubt: &Doubt) -> bool {
    matches!(doubt, Doubt::Files(FileDoubt::EverythingExcluded { .. }))
}

/// Whether a doubt says that the lattice may be none, or another one.
fn is_doubtful(doubt: &Doubt) -> bool {
    matches!(
        doubt,
        Doubt::Sets(
            SetDoubt::ShellForLattice { .. }
                | SetDoubt::DriftOutrunsScan { .. }
                | SetDoubt::GrainsContradict { .. }
        )
    )
}

/// Whether a doubt says that the layers cannot make the lattice.
fn is_impossible(doubt: &Doubt) -> bool {
    matches!(doubt, Doubt::Moire(MoireDoubt::LayersCannotMakeIt(_)))
}

fn nothing_left(scans: &[MeasuredScan]) -> Option<Caveat> {
    let by_user = |scan: &MeasuredScan| scan.excluded.as_deref() == Some(EXCLUDED);
    let all = !scans.is_empty() && scans.iter().all(by_user);
    let doubt = FileDoubt::EverythingExcluded { scans: scans.len() };
    all.then(|| Caveat::new(doubt, "analysis"))
}

/// Why a scan is left out that the user does not want.
const EXCLUDED: &str = "the user excluded it";

/// Marks the scans that the user does not want; a name that fits none of them deserves a word.
fn exclude(scans: &mut [MeasuredScan], settings: &Settings, caveats: &mut Vec<Caveat>) {
    for pattern in &settings.exclude {
        let mut found = false;
        for scan in scans.iter_mut().filter(|s| names(pattern, &s.file)) {
            scan.excluded = Some(EXCLUDED.to_owned());
            found = true;
        }
        if !found {
            let pattern = pattern.clone();
            caveats.push(Caveat::new(
                FileDoubt::NothingExcluded { pattern },
                "analysis",
            ));
        }
    }
}

/// Whether a pattern names a file: by its whole path or by its last part; `*` is any characters.
fn names(pattern: &str, file: &str) -> bool {
    let last = file.rfind(['/', '\\']).map_or(file, |i| &file[i + 1..]);
    matches(pattern, last) || matches(pattern, file)
}

fn matches(pattern: &str, text: &str) -> bool {
    let Some((start, rest)) = pattern.split_once('*') else {
        return pattern == text;
    };
    let Some(text) = text.strip_prefix(start) else {
        return false;
    };
    (0..=text.len())
        .filter(|&i| text.is_char_boundary(i))
        .any(|i| matches(rest, &text[i..]))
}

/// What the choice of settings does to the numbers.
fn about_settings(settings: &Settings) -> Vec<Caveat> {
    let mut caveats = Vec::new();
    let mut add = |doubt: LatticeDoubt| caveats.push(Caveat::new(doubt, "analysis"));
    if settings.method == Method::Paper {
        add(LatticeDoubt::MethodPaperBias);
    }
    if settings.background == Background::LineMean {
        add(LatticeDoubt::LineLevelling);
    }
    caveats
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_name_files() {
        assert!(names("b.spm", "a/b.spm"));
        assert!(names("a/b.spm", "a/b.spm"));
        assert!(names("*.00?", "x.00?"));
        assert!(names("tbg*3.spm", "C:\\data\\tbg.0_00003.spm"));
        assert!(names("µ*", "µm scan"));
        assert!(!names("b", "a/b.spm"));
        assert!(!names("*.spm", "a/b.sxm"));
    }
}
