//! A lattice that a few faint images show may be none.
//!
//! The spectrum of rough terrain has peaks of its own, and of many frames some have three that add up to zero. Such lattices are
//! faint, and other frames show others.

use crate::lattice::measured::MeasuredLattice;
use crate::scan::measured::MeasuredScan;

/// Amplitude over noise of the weakest first wave; a lattice with more is none of terrain, whose two in 96
/// simulated images had 4 and 6.
const FAINT: f64 = 8.0;
/// Power over noise of all waves together: more are not faint, though the first ones be. Three waves of [`FAINT`] have 192.
const TOTAL: f64 = 300.0;
/// So many frames that show one lattice do not agree by chance.
const FRAMES: usize = 3;

/// The signal-to-noise ratio of the plainest image, if all of these scans are faint and too few to confirm each other.
pub(crate) fn too_faint(scans: &[&MeasuredScan]) -> Option<f64> {
    let mut images = scans.iter().flat_map(|scan| &scan.lines);
    if scans.len() >= FRAMES || !images.all(|line| is_faint(&line.lattice)) {
        return None;
    }
    let images = scans.iter().flat_map(|scan| &scan.lines);
    Some(images.fold(0.0, |most, line| line.lattice.signal_to_noise.max(most)))
}

fn is_faint(lattice: &MeasuredLattice) -> bool {
    let waves = lattice.fit.iter().flat_map(|fit| &fit.harmonics);
    let total: f64 = waves.map(|wave| wave.signal_to_noise.powi(2)).sum();
    lattice.signal_to_noise < FAINT && total < TOTAL
}
