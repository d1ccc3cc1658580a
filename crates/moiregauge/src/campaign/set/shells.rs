//! Lattices of a scan of which one holds the other: where noise hides the first waves, a harmonic shell is a lattice, too.

use crate::campaign::group::Group;
use crate::caveat::lattices::LineDifference;
use crate::scan::measured::MeasuredLine;

/// A harmonic shell has so many cells for each of the lattice: 3 (the second shell), 4 (the third), 2 (every other row).
const CELLS: std::ops::RangeInclusive<i32> = 2..=4;
/// Lattices of trace and retrace agree to this share of a vector: creep and lag are smaller. Chosen by eye.
const AGREE: f64 = 0.1;

/// How many times the cell of one line direction is that of the other, in a scan that shows both, or of other scans beside these.
pub(crate) fn of_other_shell(group: &Group) -> Option<i32> {
    group.other_shell.or_else(|| of_lines(group))
}

/// How many times the cell of one image is that of the other, if one lattice holds the other.
pub(crate) fn of_each_other(one: &MeasuredLine, other: &MeasuredLine) -> Option<i32> {
    times(one, other).or_else(|| times(other, one))
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

/// The cells of `small` in one of `large`, if all of its points are points of `small`.
fn times(large: &MeasuredLine, small: &MeasuredLine) -> Option<i32> {
    let vectors = |line: &MeasuredLine| line.geometry.pixel_to_nm * line.lattice.pixels.basis;
    let names = vectors(small).try_inverse()? * vectors(large);
    let whole = names.map(f64::round);
    let cells = whole.determinant().abs().round() as i32;
    ((names - whole).amax() < AGREE && CELLS.contains(&cells)).then_some(cells)
}
