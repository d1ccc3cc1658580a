//! Lattices of a scan of which one holds the other: where noise hides the first waves, a harmonic shell is a lattice, too.

use crate::campaign::group::Group;
use crate::campaign::shells::are_refuted;
use crate::caveat::lattices::LineDifference;
use crate::lattice::fit::hidden::Hidden;
use crate::lattice::measure::hidden;
use crate::scan::measured::MeasuredScan;
use crate::scan::shells::of_each_other;

/// How many times the cell of one line direction is that of the other, in a scan that shows both, or of other scans beside these.
pub(crate) fn of_other_shell(group: &Group) -> Option<i32> {
    group.other_shell.or_else(|| of_lines(group))
}

/// How many times the cell of the lattice is that of the one that was measured, if the images of a set say together that this is the
/// second shell of another.
pub(crate) fn of_second_shell(used: &[&MeasuredScan]) -> Option<i32> {
    let lines = || used.iter().flat_map(|scan| &scan.lines);
    let all = Hidden::of_all(lines().map(|line| hidden(&line.lattice)));
    (all.is_first_shell() && !are_refuted(lines())).then_some(3)
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
