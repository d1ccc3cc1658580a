//! A lattice that a few faint images show may be none.
//!
//! The spectrum of rough terrain has peaks of its own, and of many frames some have three that add up to zero. Such lattices are
//! faint. All frames of a set show the same terrain, so that a few agree; but their weakest wave hardly exceeds the noise, and many images of the set
//! do not have it.

use crate::caveat::files::FileDoubt;
use crate::caveat::{Caveat, Doubt};
use crate::lattice::measured::MeasuredLattice;
use crate::scan::measured::MeasuredScan;

/// Amplitude over noise of the weakest first wave; a lattice with more is none of terrain, whose two in 96
/// simulated images had 4 and 6.
const FAINT: f64 = 8.0;
/// Power over noise of all waves but the strongest together: more are not faint, though the first ones be. Two waves of [`FAINT`] have 128. One
/// strong wave is no lattice: terrain has some with a power of 300.
const TOTAL: f64 = 200.0;
/// The same for a lattice with more strain than is known: one of terrain had 320, silicon 7 × 7, which has it as a moiré of graphene, has above 1000.
const OF_STRAINED: f64 = 500.0;
/// So many frames that show one lattice do not agree by chance. They may agree on terrain, which all of them show.
const FRAMES: usize = 3;
/// Trace and retrace pass over the same terrain. A lattice that most scans show in one of them only is none unless its weakest first wave has this amplitude
/// over noise: two in 200 sets of terrain had up to 8. A retrace may be bad throughout.
const CONTRADICTED: f64 = 12.0;

/// The signal-to-noise ratio of the plainest image, if all of these scans are faint and too few to confirm each other, or if most of them contradict
/// themselves.
pub(crate) fn too_faint(scans: &[&MeasuredScan]) -> Option<f64> {
    let contradicted = || {
        let plainest = plainest(scans);
        let most = 2 * in_all_directions(scans) < scans.len();
        (most && plainest < CONTRADICTED).then_some(plainest)
    };
    few_and_weak(scans, TOTAL).or_else(contradicted)
}

/// The same if the lattice would have more strain than is known: terrain has a few strong waves.
pub(crate) fn weak_for_its_strain(scans: &[&MeasuredScan]) -> Option<f64> {
    few_and_weak(scans, OF_STRAINED)
}

fn few_and_weak(scans: &[&MeasuredScan], total: f64) -> Option<f64> {
    let plainest = plainest(scans);
    let mut images = scans.iter().flat_map(|scan| &scan.lines);
    let weak = plainest < FAINT && images.all(|line| others(&line.lattice) < total);
    (scans.len() < FRAMES && weak).then_some(plainest)
}

/// How many of the scans show the lattice in every line direction that was recorded.
pub(crate) fn in_all_directions(scans: &[&MeasuredScan]) -> usize {
    let is_left_out =
        |caveat: &Caveat| matches!(caveat.doubt, Doubt::Files(FileDoubt::LineLeftOut { .. }));
    let whole = |scan: &&&MeasuredScan| !scan.caveats.iter().any(is_left_out);
    scans.iter().filter(whole).count()
}

/// Amplitude over noise of the weakest first wave, in the image where it is largest.
fn plainest(scans: &[&MeasuredScan]) -> f64 {
    let images = scans.iter().flat_map(|scan| &scan.lines);
    images.fold(0.0, |most, line| line.lattice.signal_to_noise.max(most))
}

/// Power over noise of all waves but the strongest.
fn others(lattice: &MeasuredLattice) -> f64 {
    let waves = lattice.fit.iter().flat_map(|fit| &fit.harmonics);
    let powers = waves.map(|wave| wave.signal_to_noise.powi(2));
    let [sum, strongest] = powers.fold([0.0, 0.0], |[sum, most], power| {
        [sum + power, f64::max(most, power)]
    });
    sum - strongest
}
