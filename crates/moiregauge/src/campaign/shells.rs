//! Lattices of a set of which one holds the other: an image that does not show the first waves of a lattice shows a harmonic shell as a lattice.

use crate::campaign::group::Group;
use crate::caveat::files::FileDoubt;
use crate::caveat::lattices::LineDifference;
use crate::caveat::sets::SetDoubt;
use crate::caveat::{Caveat, Doubt};
use crate::explain::evidence::BETTER;
use crate::scan::doubts::lines_disagree;
use crate::scan::measure::{about_lattice, share_noise};
use crate::scan::measured::{MeasuredLine, MeasuredScan};

/// Cells of a harmonic shell for each of the lattice: 3 (the second shell), 4 (the third), 2 (every other row).
const CELLS: [i32; 3] = [2, 3, 4];
/// Lattices of trace and retrace agree to this share of a vector: creep and lag are smaller. Half and twice as much
/// change no result of docs/constants.md.
const AGREE: f64 = 0.1;
/// Ratio of the numbers of lines from which a lattice is a harmonic shell of another: lines that show the other cannot all be wrong about the same waves.
const OUTVOTED: usize = 3;

/// How many times the cell of one image is that of the other, if one lattice holds the other.
pub(crate) fn of_each_other(one: &MeasuredLine, other: &MeasuredLine) -> Option<i32> {
    times(one, other).or_else(|| times(other, one))
}

/// The cells of `small` in one of `large`, several, if all of its points are points of `small`.
fn times(large: &MeasuredLine, small: &MeasuredLine) -> Option<i32> {
    cells(large, small).filter(|cells| CELLS.contains(cells))
}

/// The cells of `small` in one of `large`, if all of its points are points of `small`: 1 where they are one lattice.
fn cells(large: &MeasuredLine, small: &MeasuredLine) -> Option<i32> {
    let vectors = |line: &MeasuredLine| line.geometry.pixel_to_nm * line.lattice.pixels.basis;
    let names = vectors(small).try_inverse()? * vectors(large);
    let whole = names.map(f64::round);
    let cells = whole.determinant().abs().round() as i32;
    ((names - whole).amax() < AGREE && cells > 0).then_some(cells)
}

/// Leaves out the lines that show a harmonic shell of the lattice of most.
pub(crate) fn agree(groups: &mut [Group], caveats: &mut Vec<Caveat>) {
    for group in groups {
        let outvoted = outvoted(&group.scans);
        for (scan, outvoted) in group.scans.iter_mut().zip(outvoted) {
            if outvoted.contains(&true) {
                caveats.extend(leave_out(scan, &outvoted));
            }
        }
    }
}

/// Whether a scan is one that only its lines may have put out.
pub(crate) fn counts(scan: &MeasuredScan) -> bool {
    let other = |reason: &String| reason != LineDifference::OTHER_LATTICES;
    scan.repeats.is_none() && !scan.excluded.as_ref().is_some_and(other)
}

/// Which lines of each scan show a harmonic shell of the lattice that several times as many lines show, or any where the larger cell predicts
/// better in sum.
fn outvoted(scans: &[MeasuredScan]) -> Vec<Vec<bool>> {
    let all = || {
        scans
            .iter()
            .filter(|scan| counts(scan))
            .flat_map(|scan| &scan.lines)
    };
    let is_shell = |line: &MeasuredLine| {
        let alike = || all().filter(|other| cells(other, line) == Some(1));
        CELLS.into_iter().enumerate().any(|(place, cells)| {
            let larger = all().filter(|other| times(other, line) == Some(cells));
            let larger = larger.count();
            let outvoted = larger >= OUTVOTED * alike().count();
            larger > 0 && (outvoted || together(alike(), place) > BETTER)
        })
    };
    let of_scan = |scan: &MeasuredScan| {
        let each = scan.lines.iter();
        each.map(|line| counts(scan) && is_shell(line)).collect()
    };
    scans.iter().map(of_scan).collect()
}

/// By how many standard errors lattices with more of their cells in one predict better, in several images together. `place`: that of their number in
/// [`CELLS`].
fn together<'a>(lines: impl Iterator<Item = &'a MeasuredLine>, place: usize) -> f64 {
    let evidence = lines.filter_map(|line| line.lattice.evidence.as_ref());
    let all: Vec<f64> = evidence.map(|evidence| evidence.larger[place]).collect();
    all.iter().sum::<f64>() / (all.len().max(1) as f64).sqrt()
}

/// Leaves lines of a scan out. What there is to say of a scan without any.
fn leave_out(scan: &mut MeasuredScan, outvoted: &[bool]) -> Option<Caveat> {
    let reason = "it shows a harmonic shell of the lattice of the others".to_owned();
    let lines = scan.lines.iter().zip(outvoted);
    let mut lines: Vec<MeasuredLine> = lines
        .filter(|(_, outvoted)| !**outvoted)
        .map(|(line, _)| line.clone())
        .collect();
    scan.caveats
        .retain(|caveat| !matches!(caveat.doubt, Doubt::Lattice(_)));
    if lines.is_empty() {
        scan.excluded = Some(reason.clone());
        return Some(Caveat::new(SetDoubt::ScanLeftOut { reason }, &scan.file));
    }
    let doubt = FileDoubt::LineLeftOut { reason };
    scan.caveats.push(Caveat::new(doubt, &scan.file));
    share_noise(&mut lines);
    for line in &lines {
        about_lattice(&scan.file, &line.lattice, &line.geometry, &mut scan.caveats);
    }
    scan.excluded = lines_disagree(&scan.file, &lines, &mut scan.caveats);
    scan.lines = lines.into();
    None
}

/// How many times the cell of one line direction is that of the other, in a scan that shows both, or of other scans beside these.
pub(crate) fn of_other_shell(group: &Group) -> Option<i32> {
    group.other_shell.or_else(|| of_lines(group))
}

fn of_lines(group: &Group) -> Option<i32> {
    let differs = |reason: &String| reason == LineDifference::OTHER_LATTICES;
    let scans = group.scans.iter();
    let mut differing = scans.filter(|scan| scan.excluded.as_ref().is_some_and(differs));
    differing.find_map(|scan| match &*scan.lines {
        [one, other] => of_each_other(one, other),
        _ => None,
    })
}
