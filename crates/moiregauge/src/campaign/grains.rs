//! Grains of one frame drift together: sets of the same scans whose drifts contradict each other do not all show a lattice. Which sets
//! show the same grain.

use std::collections::{BTreeMap, BTreeSet};

use heterostrain::lattice::{Lattice, labelled_like};

use crate::campaign::analysis::{Analysis, SetAnalysis};
use crate::campaign::combine::SAME_LATTICE;
use crate::campaign::motion::Drift;
use crate::caveat::lattices::LatticeDoubt;
use crate::caveat::sets::SetDoubt;
use crate::caveat::{Caveat, Doubt};
use crate::numbers::chi2;

/// Drifts contradict each other where chance separates them as far less often than this.
const CONTRADICTED: f64 = 1e-6;
/// Ratio of variances from which the drift of one set is believed against that of another; else neither is.
const BETTER_KNOWN: f64 = 9.0;
/// nm/s → nm/min.
const PER_MINUTE: f64 = 60.0;

/// Takes the twist and strain from grains whose drift contradicts that of another grain of the same scans.
pub(crate) fn agree_on_drift(sets: &mut [SetAnalysis], caveats: &mut Vec<Caveat>) {
    let mut contradicted = vec![None; sets.len()];
    for [i, j] in sharing_a_scan(sets) {
        let (Some(a), Some(b)) = (&sets[i].drift, &sets[j].drift) else {
            continue;
        };
        let Some(apart) = contradiction(a, b) else {
            continue;
        };
        let doubted = doubted([a, b].map(|drift| drift.covariance.trace()));
        for (doubted, one, other) in [(doubted[0], i, j), (doubted[1], j, i)] {
            if doubted {
                contradicted[one] = Some((apart, sets[other].name.clone()));
            }
        }
    }
    for (set, doubt) in sets.iter_mut().zip(contradicted) {
        let Some((nm_per_min, other)) = doubt else {
            continue;
        };
        (set.mean, set.uncorrected, set.lattice) = (None, None, None);
        let doubt = SetDoubt::GrainsContradict { nm_per_min, other };
        caveats.push(Caveat::new(doubt, &set.name));
    }
}

/// The grains that lie side by side in the frames, in the order of their names, each with the numbers of its sets that have a result; a grain without
/// any keeps its place. `None` where the frames show one lattice.
///
/// Sets of one scan are different grains; a set of other scans shows the grain whose lattice is the nearest.
pub fn grains(analysis: &Analysis) -> Option<Vec<Vec<usize>>> {
    let sets = &analysis.sets;
    let is_several = |caveat: &Caveat| {
        matches!(
            caveat.doubt,
            Doubt::Lattice(LatticeDoubt::SeveralGrains { .. })
        )
    };
    let shared = sharing_a_scan(sets);
    let told = analysis.settings.grain.is_some() || analysis.caveats.iter().any(is_several);
    if shared.is_empty() && !told {
        return None;
    }
    let with_result = |set: &usize| sets[*set].mean.is_some() || sets[*set].uncorrected.is_some();
    if shared.is_empty() {
        return Some(vec![(0..sets.len()).filter(with_result).collect()]);
    }
    let lattices: Vec<Option<Lattice>> = sets.iter().map(lattice_of).collect();
    let mut found: Vec<Vec<usize>> = Vec::new();
    for (set, lattice) in lattices.iter().enumerate() {
        let Some(lattice) = lattice else { continue };
        let apart = |grain: &Vec<usize>| {
            let beside = grain.iter().any(|other| shared.contains(&[*other, set]));
            let first = lattices[grain[0]].as_ref().filter(|_| !beside)?;
            let (a, b) = (first.basis, labelled_like(lattice, &first.basis).basis);
            let apart = (b - a).norm() / a.norm();
            (apart < SAME_LATTICE).then_some(apart)
        };
        let known = found.iter().enumerate();
        let known = known.filter_map(|(i, grain)| Some((i, apart(grain)?)));
        match known.min_by(|a, b| a.1.total_cmp(&b.1)) {
            Some((nearest, _)) => found[nearest].push(set),
            None => found.push(vec![set]),
        }
    }
    for grain in &mut found {
        grain.retain(with_result);
    }
    Some(found)
}

/// The lattice of a set, that of its first scan where it has no result.
fn lattice_of(set: &SetAnalysis) -> Option<Lattice> {
    let mean = set.mean.as_ref().or(set.uncorrected.as_ref());
    let alone = || set.lattice.as_ref().map(|found| found.lattice);
    let scan = || set.scans.first().map(|scan| scan.sensor);
    mean.map(|mean| mean.lattice).or_else(alone).or_else(scan)
}

/// By how much two drifts differ, nm/min, where that is no chance. What the user gave is no measurement.
fn contradiction(one: &Drift, other: &Drift) -> Option<f64> {
    if one.given || other.given {
        return None;
    }
    let apart = one.velocity - other.velocity;
    let information = (one.covariance + other.covariance).try_inverse()?;
    let chance = chi2::tail(apart.dot(&(information * apart)), 2);
    (chance < CONTRADICTED).then(|| PER_MINUTE * apart.norm())
}

/// Which of two drifts that contradict each other, with these variances, are not believed.
fn doubted([a, b]: [f64; 2]) -> [bool; 2] {
    [a * BETTER_KNOWN > b, b * BETTER_KNOWN > a]
}

/// The pairs of sets with a scan in common. A campaign has thousands of sets, and few of them are grains.
fn sharing_a_scan(sets: &[SetAnalysis]) -> BTreeSet<[usize; 2]> {
    let mut of_file: BTreeMap<&str, BTreeSet<usize>> = BTreeMap::new();
    for (i, set) in sets.iter().enumerate() {
        for scan in &set.scans {
            of_file.entry(&scan.file).or_default().insert(i);
        }
    }
    let pairs = |sets: BTreeSet<usize>| {
        let firsts = sets.clone().into_iter();
        firsts.flat_map(move |i| {
            sets.clone()
                .into_iter()
                .filter(move |j| i < *j)
                .map(move |j| [i, j])
        })
    };
    of_file.into_values().flat_map(pairs).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Vector2};

    fn drift(x: f64, sigma: f64) -> Drift {
        Drift {
            velocity: Vector2::new(x, 0.0) / PER_MINUTE,
            covariance: Matrix2::identity() * (sigma / PER_MINUTE).powi(2),
            given: false,
            fit: None,
            monte_carlo: None,
            joint: None,
        }
    }

    /// χ² of two degrees of freedom has a tail of e^(−χ²/2): one in a million at 5.26 σ.
    #[test]
    fn drifts_contradict_beyond_one_in_a_million() {
        let apart = |sigmas: f64| contradiction(&drift(sigmas * 5.0, 3.0), &drift(0.0, 4.0));
        assert_eq!(apart(5.2), None);
        let told = apart(5.3).expect("a contradiction");
        assert!((told - 26.5).abs() < 1e-9, "{told}");
        let given = Drift {
            given: true,
            ..drift(100.0, 1.0)
        };
        assert_eq!(contradiction(&given, &drift(0.0, 1.0)), None);
    }

    /// Three times the error is nine times the variance: the other is believed; what is known alike is both doubted.
    #[test]
    fn the_better_known_drift_is_believed() {
        assert_eq!(doubted([1.0, 10.0]), [false, true]);
        assert_eq!(doubted([10.0, 1.0]), [true, false]);
        assert_eq!(doubted([1.0, 8.0]), [true, true]);
    }
}
