//! The images of a set say together whether their lattice is the second shell of another.
//!
//! A weak first shell stands out of the noise in some images and not in others, and those measure a lattice of a third of the cell. What each has
//! at the places of the first shell is known; all together tell what no image can.

use crate::campaign::group::Group;
use crate::caveat::files::FileDoubt;
use crate::caveat::lattices::LineDifference;
use crate::caveat::sets::SetDoubt;
use crate::caveat::{Caveat, Doubt};
use crate::explain::cells::BETTER;
use crate::lattice::fit::hidden::Hidden;
use crate::lattice::measure::hidden;
use crate::scan::doubts::lines_disagree;
use crate::scan::measure::{about_lattice, share_noise};
use crate::scan::measured::{MeasuredLine, MeasuredScan};
use crate::scan::shells::{CONFIRMED, cells};

/// Ratio of the numbers of lines from which a lattice is the second shell of another: lines that show the other cannot all be wrong about the same waves.
const OUTVOTED: usize = 3;

/// Takes the lattice of which that which was measured is the second shell in all images of a set that say so together.
pub(crate) fn agree(groups: &mut [Group], caveats: &mut Vec<Caveat>) {
    for group in groups {
        let second = second_shells(&group.scans);
        for (scan, second) in group.scans.iter_mut().zip(second) {
            if second.contains(&true) {
                caveats.extend(take_first_shells(scan, &second));
            }
        }
    }
}

/// Whether a scan is one that only its lines may have put out.
fn counts(scan: &MeasuredScan) -> bool {
    let other = |reason: &String| reason != LineDifference::OTHER_LATTICES;
    scan.repeats.is_none() && !scan.excluded.as_ref().is_some_and(other)
}

/// A lattice that lines of a set show.
struct Seen<'a> {
    /// One that shows it, ...
    line: &'a MeasuredLine,
    /// ... how many do, ...
    lines: usize,
    /// ... what all say together, ...
    told: Hidden,
    /// ... and what waves of the first shell predict of each, standard errors.
    predicts: Vec<f64>,
}

/// What the first shell of a line that may show the second predicts, standard errors.
fn predicts(line: &MeasuredLine) -> Option<f64> {
    line.first_shell.as_ref()?.evidence.as_ref()?.predicts
}

/// What first shells predict in several images together, standard errors.
fn together(predicts: &[f64]) -> f64 {
    predicts.iter().sum::<f64>() / (predicts.len().max(1) as f64).sqrt()
}

/// Whether the first shells that lines may hide predict next to nothing.
pub(crate) fn are_refuted<'a>(lines: impl Iterator<Item = &'a MeasuredLine>) -> bool {
    let predicts: Vec<f64> = lines.filter_map(predicts).collect();
    !predicts.is_empty() && together(&predicts) < BETTER / 2.0
}

fn lattices<'a>(all: &[&'a MeasuredLine]) -> Vec<Seen<'a>> {
    let mut found: Vec<Seen> = Vec::new();
    for line in all {
        let told = hidden(&line.lattice);
        match found.iter_mut().find(|f| cells(f.line, line) == Some(1)) {
            Some(seen) => {
                seen.told = Hidden::of_all([seen.told, told].into_iter());
                seen.lines += 1;
                seen.predicts.extend(predicts(line));
            }
            None => found.push(Seen {
                line,
                lines: 1,
                told,
                predicts: predicts(line).into_iter().collect(),
            }),
        }
    }
    found
}

/// Which lines of each scan show the second shell of their lattice.
fn second_shells(scans: &[MeasuredScan]) -> Vec<Vec<bool>> {
    let all: Vec<&MeasuredLine> = scans
        .iter()
        .filter(|scan| counts(scan))
        .flat_map(|scan| &scan.lines)
        .collect();
    let suspected = all.iter().any(|line| line.first_shell.is_some());
    let lattices = lattices(&all);
    let is_second = |seen: &Seen| {
        let is_larger = |other: &&Seen| cells(other.line, seen.line) == Some(3);
        let larger: usize = lattices.iter().filter(is_larger).map(|l| l.lines).sum();
        let told = seen.told.is_first_shell() || (seen.told.chance() < CONFIRMED && larger > 0);
        (suspected && told && together(&seen.predicts) > BETTER) || larger >= OUTVOTED * seen.lines
    };
    let second: Vec<&MeasuredLine> = lattices
        .iter()
        .filter(|lattice| is_second(lattice))
        .map(|lattice| lattice.line)
        .collect();
    let shows_it = |line: &MeasuredLine| second.iter().any(|other| cells(other, line) == Some(1));
    let of_scan = |scan: &MeasuredScan| {
        let asked = counts(scan);
        scan.lines
            .iter()
            .map(|line| asked && shows_it(line))
            .collect()
    };
    scans.iter().map(of_scan).collect()
}

/// Takes the first shell where the second was measured; lines that do not know it are left out. What there is to say of a scan without any.
fn take_first_shells(scan: &mut MeasuredScan, second: &[bool]) -> Option<Caveat> {
    let reason = || "noise hides the first waves of its lattice".to_owned();
    let (mut lines, mut left_out) = (Vec::new(), false);
    for (line, second) in scan.lines.iter().zip(second) {
        let mut line = line.clone();
        if *second {
            let Some(first) = line.first_shell.take() else {
                left_out = true;
                continue;
            };
            line.lattice = *first;
        }
        lines.push(line);
    }
    if lines.is_empty() {
        let reason = reason();
        scan.excluded = Some(reason.clone());
        return Some(Caveat::new(SetDoubt::ScanLeftOut { reason }, &scan.file));
    }
    if left_out {
        let doubt = FileDoubt::LineLeftOut { reason: reason() };
        scan.caveats.push(Caveat::new(doubt, &scan.file));
    }
    share_noise(&mut lines);
    scan.caveats
        .retain(|caveat| !matches!(caveat.doubt, Doubt::Lattice(_)));
    for line in &lines {
        about_lattice(&scan.file, &line.lattice, &line.geometry, &mut scan.caveats);
    }
    scan.excluded = lines_disagree(&scan.file, &lines, &mut scan.caveats);
    scan.lines = lines.into();
    None
}
