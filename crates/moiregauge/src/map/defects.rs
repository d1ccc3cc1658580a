//! Which nodes are to be believed, and why others are not.

use nalgebra::Vector4;

use crate::map::waves::{LocalLattice, Nothing};
use crate::numbers::median::median;
pub(crate) use crate::window::blur::{Blur, is_improbable};
use crate::window::mask::Mask;
pub(crate) use crate::window::setting::{LOST, NEAR, SHARE, Setting, fours, winds};
use crate::window::widths::of_difference;

/// Typical signal over noise from which a phase singularity counts. Half and twice as much change no result of
/// docs/constants.md.
const CLEAR: f64 = 6.0;

/// The change from one lattice to that under a window wider by √2.
pub(crate) fn blur(narrow: &LocalLattice, wide: &LocalLattice) -> Blur {
    let change = wide.pair - narrow.pair;
    let share = |i: usize| {
        let (a, b) = (narrow.covariance[(i, i)], wide.covariance[(i, i)]);
        of_difference(a, b) / a
    };
    // Scaled so that each variance is that of its change.
    let scaled = Vector4::from_fn(|i, _| change[(i % 2, i / 2)] / share(i).sqrt());
    let inverse = narrow.covariance.try_inverse().unwrap_or_default();
    Blur {
        chi2: (scaled.transpose() * inverse * scaled)[0],
        components: 4,
        share: change.norm() / narrow.pair.norm(),
        of_noise: (0..4).map(share).sum::<f64>() / 4.0,
    }
}

/// The mask of every node. `noise_share`: noise amplitude over signal amplitude of each wave, typical of the frame.
pub(crate) fn masks(
    setting: &Setting,
    lattices: &[Result<LocalLattice, Nothing>],
    blurs: &[Blur],
    noise_share: &[f64],
) -> Vec<Mask> {
    let winding = windings(setting, noise_share);
    let improbable = |node: usize| {
        let lattice = lattices[node].as_ref();
        lattice.is_ok_and(|l| is_improbable(l.chi2, l.freedom))
    };
    let lost = lost(setting, lattices);
    let spoilt = setting.near(NEAR, |n| {
        !setting.is_outside(n) && (improbable(n) || lost[n])
    });
    let pair = |_, n: usize| lattices[n].as_ref().ok().map(|l| l.pair);
    let bent = setting.bent(pair, |n| Some(blurs[n]));
    let of_node = |node: usize| match &lattices[node] {
        _ if setting.is_outside(node) => Mask::Margin,
        _ if setting.is_missing(node) => Mask::Missing,
        Err(Nothing::NoPixels) => Mask::Missing,
        Err(Nothing::Weak) => Mask::Weak,
        Ok(_) if lost[node] => Mask::Weak,
        Ok(_) if spoilt[node] || winding[node] => Mask::Defect,
        Ok(_) if bent[node] => Mask::Bent,
        Ok(_) => Mask::Good,
    };
    (0..lattices.len()).map(of_node).collect()
}

/// Where the signal is gone.
fn lost(setting: &Setting, lattices: &[Result<LocalLattice, Nothing>]) -> Vec<bool> {
    let envelopes = &setting.smoothed.envelopes;
    let power = |node: usize| {
        let first = envelopes.iter().take(3);
        let sum = first.map(|e| f64::from(e.amplitude[node].norm_sqr()));
        sum.sum::<f64>()
    };
    let mut all: Vec<f64> = (0..lattices.len())
        .filter(|&n| setting.smoothed.support[n].is_some_and(|s| s.share > SHARE))
        .map(power)
        .collect();
    let usual = median(&mut all);
    (0..lattices.len())
        .map(|n| setting.smoothed.support[n].is_some() && power(n) < LOST * usual)
        .collect()
}

/// Nodes near a point around which the phase of a first wave winds; waves count only where noise is small.
fn windings(setting: &Setting, noise_share: &[f64]) -> Vec<bool> {
    let smoothed = setting.smoothed;
    let mut cores = vec![false; smoothed.nodes.len()];
    let first = smoothed.envelopes.iter().zip(noise_share).take(3);
    for (envelope, _) in first.filter(|(_, share)| **share * CLEAR < 1.0) {
        for (corner, around) in fours(smoothed.nodes) {
            let there = around.iter().all(|&n| smoothed.support[n].is_some());
            cores[corner] |= there && winds(&envelope.amplitude, around);
        }
    }
    setting.near(NEAR, |n| cores[n])
}
