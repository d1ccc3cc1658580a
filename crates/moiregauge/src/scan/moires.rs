//! Which of several moirés is which: in trace and retrace of a scan, and from scan to scan.

use heterostrain::lattice::{Lattice, labelled_like};
use nalgebra::Matrix2;

use crate::scan::measured::{MeasuredLine, MeasuredScan};

/// The moirés of a series, each with all scans, from the moirés of every scan; they are in the order of the
/// first scan, whose largest cell comes first.
///
/// A moiré is the same in two scans if its lattice is nearest; drift changes lattices by a per cent or less.
pub fn sorted_moires(scans: Vec<Vec<MeasuredScan>>) -> Vec<Vec<MeasuredScan>> {
    let first: Vec<Lattice> = match scans.first() {
        Some(scan) => scan.iter().filter_map(lattice).collect(),
        None => return Vec::new(),
    };
    let mut sorted: Vec<Vec<MeasuredScan>> = first.iter().map(|_| Vec::new()).collect();
    for scan in scans {
        let found = in_order(&first, scan, lattice);
        for (all, scan) in sorted.iter_mut().zip(found) {
            all.push(scan);
        }
    }
    sorted
}

/// Lattice of the first line of a scan, nm.
fn lattice(scan: &MeasuredScan) -> Option<Lattice> {
    scan.lines.first().map(MeasuredLine::in_sensor_coordinates)
}

/// The `found` in the order of the `wanted` lattices to which they are nearest.
pub(crate) fn in_order<T>(
    wanted: &[Lattice],
    found: Vec<T>,
    lattice: impl Fn(&T) -> Option<Lattice>,
) -> Vec<T> {
    let mut found: Vec<Option<T>> = found.into_iter().map(Some).collect();
    let mut sorted = Vec::new();
    for wanted in wanted {
        let miss = |t: &T| {
            lattice(t).map_or(f64::INFINITY, |l| {
                distance(&labelled_like(&l, &wanted.basis).basis, &wanted.basis)
            })
        };
        let nearest = found
            .iter()
            .enumerate()
            .filter_map(|(i, t)| Some((i, miss(t.as_ref()?))))
            .min_by(|a, b| a.1.total_cmp(&b.1));
        sorted.extend(nearest.and_then(|(i, _)| found[i].take()));
    }
    sorted
}

fn distance(a: &Matrix2<f64>, b: &Matrix2<f64>) -> f64 {
    (a - b).norm()
}
