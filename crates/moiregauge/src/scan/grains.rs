//! The grains of a scan: each is a scan of its own once it is measured.

use heterostrain::lattice::labelled_like;

use crate::caveat::Caveat;
use crate::scan::doubts::about_coverage;
use crate::scan::measured::{MeasuredLine, MeasuredScan};

/// Trace and retrace show the same grain if their vectors differ by less than this share: grains that differ by less are not told apart.
const SAME: f64 = 0.01;

/// The grains that the lines of a scan show, each with its lines; the first is that of the first line, which was the largest there.
pub(crate) fn grains(lines: Vec<MeasuredLine>) -> Vec<Vec<MeasuredLine>> {
    let largest = lines.len();
    let mut found: Vec<Vec<MeasuredLine>> = Vec::new();
    let mut put = |line: MeasuredLine| {
        let same = |grain: &&mut Vec<MeasuredLine>| {
            grain.iter().all(|other| other.line != line.line) && are_same(&grain[0], &line)
        };
        match found.iter_mut().find(same) {
            Some(grain) => grain.push(line),
            None => found.push(vec![line]),
        }
    };
    for mut line in lines {
        let beside = std::mem::take(&mut line.lattice.beside);
        let others: Vec<MeasuredLine> = beside
            .into_iter()
            .map(|lattice| MeasuredLine {
                lattice,
                ..line.clone()
            })
            .collect();
        put(line);
        others.into_iter().for_each(&mut put);
    }
    // Without a grain in common the largest ones stay together, so that it is said that trace and retrace disagree.
    let alone = largest == 2 && found[0].len() == 1;
    let other = (1..found.len()).find(|&i| found[i][0].line != found[0][0].line);
    if let Some(i) = other.filter(|_| alone) {
        let mut second = found.remove(i);
        found[0].append(&mut second);
    }
    found
}

fn are_same(a: &MeasuredLine, b: &MeasuredLine) -> bool {
    let a = a.in_sensor_coordinates().basis;
    let b = labelled_like(&b.in_sensor_coordinates(), &a).basis;
    (b - a).norm() < SAME * a.norm()
}

/// A scan of another grain of `scan`.
pub(crate) fn beside(scan: &MeasuredScan, lines: Vec<MeasuredLine>) -> MeasuredScan {
    let mut caveats: Vec<Caveat> = Vec::new();
    for line in &lines {
        about_coverage(&scan.file, &line.lattice, &line.geometry, &mut caveats);
    }
    MeasuredScan {
        lines: lines.into(),
        caveats,
        grains: Vec::new(),
        ..scan.clone()
    }
}

/// All grains of some scans: the others come after the largest ones, those of scans that are not used not at all, and where sets were
/// named by hand neither, since each is one lattice then.
pub(crate) fn each(scans: &mut Vec<MeasuredScan>) {
    let mut others = Vec::new();
    for scan in scans.iter_mut() {
        let beside = std::mem::take(&mut scan.grains);
        if scan.excluded.is_none() && scan.repeats.is_none() && scan.set.is_none() {
            others.extend(beside.into_iter().map(|grain| MeasuredScan {
                digest: scan.digest.clone(),
                ..grain
            }));
        }
    }
    scans.append(&mut others);
}
