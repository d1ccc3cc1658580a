//! Lattices of which one holds the other: where noise hides the first waves, a harmonic shell is a lattice, too.

use spmfile::Channel;

use crate::caveat::Caveat;
use crate::lattice::fit::hidden::Hidden;
use crate::lattice::measure::hidden;
use crate::lattice::measured::MeasuredLattice;
use crate::scan::measured::{MeasureError, MeasuredLine};

/// Cells of a harmonic shell for each of the lattice: 3 (the second shell), 4 (the third), 2 (every other row).
const CELLS: std::ops::RangeInclusive<i32> = 2..=4;
/// Lattices of trace and retrace agree to this share of a vector: creep and lag are smaller. Half and twice as much
/// change no result of docs/constants.md.
const AGREE: f64 = 0.1;

/// One line direction shows the first shell, the other the second: noise alone has as much power in the latter, where the first
/// shell is, less often than this.
pub(crate) const CONFIRMED: f64 = 0.01;

/// Where noise alone has as much power less often than this, both lattices are kept, and the images of the set decide.
const SUSPECTED: f64 = 0.2;

/// How many times the cell of one image is that of the other, if one lattice holds the other.
pub(crate) fn of_each_other(one: &MeasuredLine, other: &MeasuredLine) -> Option<i32> {
    times(one, other).or_else(|| times(other, one))
}

/// The cells of `small` in one of `large`, several, if all of its points are points of `small`.
fn times(large: &MeasuredLine, small: &MeasuredLine) -> Option<i32> {
    cells(large, small).filter(|cells| CELLS.contains(cells))
}

/// The cells of `small` in one of `large`, if all of its points are points of `small`: 1 where they are one lattice.
pub(crate) fn cells(large: &MeasuredLine, small: &MeasuredLine) -> Option<i32> {
    let vectors = |line: &MeasuredLine| line.geometry.pixel_to_nm * line.lattice.pixels.basis;
    let names = vectors(small).try_inverse()? * vectors(large);
    let whole = names.map(f64::round);
    let cells = whole.determinant().abs().round() as i32;
    ((names - whole).amax() < AGREE && cells > 0).then_some(cells)
}

/// The lines of one direction and what there is to say of them.
pub(crate) type Told = (Vec<MeasuredLine>, Vec<Caveat>);

/// Measures the lattice as well of which that which a line shows may be the second shell, where the line alone cannot tell.
pub(crate) fn keep_first_shells(
    found: &mut [(&Channel, Told)],
    again: &dyn Fn(&Channel, &MeasuredLattice) -> Result<Told, MeasureError>,
) {
    for (channel, (lines, _)) in found {
        let [line] = lines.as_mut_slice() else {
            continue;
        };
        if hidden(&line.lattice).chance() < SUSPECTED
            && let Ok((mut first, _)) = again(channel, &line.lattice)
        {
            line.first_shell = first.pop().map(|first| Box::new(first.lattice));
        }
    }
}

/// Measures lines again that show but the second shell of their lattice: since the other direction shows the first, or since both
/// directions together do.
///
/// `again` measures the lattice of which that which was found is the second shell.
pub(crate) fn of_first_shells(
    found: &mut [(&Channel, Told)],
    again: &dyn Fn(&Channel, &MeasuredLattice) -> Result<Told, MeasureError>,
) {
    let [(_, (one, _)), (_, (other, _))] = &*found else {
        return;
    };
    let ([one], [other]) = (one.as_slice(), other.as_slice()) else {
        return;
    };
    let shells = [one, other].map(|line| hidden(&line.lattice));
    let confirms = |i: usize| shells[i].chance() < CONFIRMED;
    let second = match (times(one, other), times(other, one)) {
        (Some(3), _) => [false, confirms(1)],
        (_, Some(3)) => [confirms(0), false],
        (None, None) => [Hidden::of_all(shells.into_iter()).is_first_shell(); 2],
        _ => return,
    };
    for ((channel, told), _) in found.iter_mut().zip(second).filter(|(_, second)| *second) {
        if let Ok(first) = again(channel, &told.0[0].lattice) {
            *told = first;
        }
    }
}
