//! Which nodes are to be believed, and why others are not.

use nalgebra::{Matrix2, Vector2, Vector4};

use crate::map::waves::{LocalLattice, Nothing};
use crate::numbers::median::median;
use crate::window::mask::Mask;
use crate::window::smooth::Smoothed;
use crate::window::widths::of_difference;

/// χ² of four numbers that is more than chance (p < 0.01) enlarges the errors of a node: a convention.
const MORE_THAN_CHANCE: f64 = 13.3;
/// A good χ² exceeds the limit once in some 10⁵ nodes.
const IMPROBABLE: f64 = 4.26;
/// Phase (rad) by which a wave may bend over one window width: what is lost of the amplitude is 0.35²/2 = 6 %.
const STRAIGHT: f64 = 0.35;
/// Nodes this near to a winding point, to contradicting harmonics and to lost signal (window widths) see them:
/// farther off the window has less than e⁻² of its height.
const NEAR: f64 = 2.0;
/// Nodes this near to a bent one are bent: farther off the window has less than 60 % of its height.
const BESIDE: f64 = 1.0;
/// Signal is lost, and not just hidden by noise, where its power is below this share of the usual: half of the
/// amplitude, as at the edge of what has none.
const LOST: f64 = 0.25;
/// Blur that matters: a window wider by √2 changes a wave vector by this share of itself. Chosen by eye; see
/// docs/constants.md.
const BLURRED: f64 = 0.004;
/// Less of a window than this is too little: at a straight edge half would be left, and slopes lean.
const SHARE: f64 = 0.6;
/// A wave winds only where it usually stands out by so many noise units. Chosen by eye; see docs/constants.md.
const CLEAR: f64 = 6.0;

/// What the masks need to know of the nodes.
pub(crate) struct Setting<'a> {
    pub(crate) smoothed: &'a Smoothed,
    /// Place of every node, pixels.
    pub(crate) places: &'a [Vector2<f64>],
    /// Width of the window and margin, pixels.
    pub(crate) width: [f64; 2],
    pub(crate) margin: [f64; 2],
    /// First and last pixel of the frame.
    pub(crate) frame: [Vector2<f64>; 2],
    /// Noise amplitude over signal amplitude of each wave, typical of the frame; waves that wind count only
    /// where this is small.
    pub(crate) noise_share: &'a [f64],
    /// What a wider window changes at each node.
    pub(crate) blurs: &'a [Blur],
}

/// What a window wider by √2 changes at a node.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Blur {
    /// χ² of the four components of the change, noise alone being 4.
    pub(crate) chi2: f64,
    /// The change as a share of the wave vectors.
    pub(crate) share: f64,
    /// Variance that noise gives the change, in units of that of the node.
    of_noise: f64,
}

impl Blur {
    /// The change from one lattice to that under a wider window.
    pub(crate) fn between(narrow: &LocalLattice, wide: &LocalLattice) -> Self {
        let change = wide.pair - narrow.pair;
        let share = |i: usize| {
            let (a, b) = (narrow.covariance[(i, i)], wide.covariance[(i, i)]);
            of_difference(a, b) / a
        };
        // Scaled so that each variance is that of its change.
        let scaled = Vector4::from_fn(|i, _| change[(i % 2, i / 2)] / share(i).sqrt());
        let inverse = narrow.covariance.try_inverse().unwrap_or_default();
        Self {
            chi2: (scaled.transpose() * inverse * scaled)[0],
            share: change.norm() / narrow.pair.norm(),
            of_noise: (0..4).map(share).sum::<f64>() / 4.0,
        }
    }

    /// Factor on the variances of a node for what the window blurs, where that is more than chance (p < 0.01).
    pub(crate) fn factor(self) -> f64 {
        if self.chi2 > MORE_THAN_CHANCE {
            1.0 + (self.chi2 / 4.0 - 1.0) * self.of_noise
        } else {
            1.0
        }
    }
}

/// The mask of every node.
pub(crate) fn masks(setting: &Setting, lattices: &[Result<LocalLattice, Nothing>]) -> Vec<Mask> {
    let nodes = setting.smoothed.nodes;
    let winding = windings(setting);
    let improbable = |node: usize| {
        let lattice = lattices[node].as_ref();
        lattice.is_ok_and(|l| is_improbable(l.chi2, l.freedom))
    };
    let outside = |node: usize| {
        let (at, [low, high]) = (setting.places[node], setting.frame);
        (0..2).any(|i| (at - low)[i].min((high - at)[i]) < setting.margin[i])
    };
    let lost = lost(setting, lattices);
    let spoilt = near(setting, NEAR, |n| !outside(n) && (improbable(n) || lost[n]));
    let pair = |n: usize| lattices[n].as_ref().ok().map(|l| l.pair);
    let bent = near(setting, BESIDE, |n| {
        let blur = setting.blurs[n];
        let blurred = is_improbable(blur.chi2, 4) && blur.share > BLURRED;
        !outside(n) && (blurred || bend(setting, pair, n) > STRAIGHT)
    });
    (0..nodes.len())
        .map(|node| {
            if outside(node) {
                return Mask::Margin;
            }
            if setting.smoothed.support[node].is_none_or(|s| s.share < SHARE) {
                return Mask::Missing;
            }
            match &lattices[node] {
                Err(Nothing::NoPixels) => return Mask::Missing,
                Err(Nothing::Weak) => return Mask::Weak,
                Ok(_) if lost[node] => return Mask::Weak,
                Ok(_) => {}
            }
            if spoilt[node] || winding[node] {
                Mask::Defect
            } else if bent[node] {
                Mask::Bent
            } else {
                Mask::Good
            }
        })
        .collect()
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

/// Nodes no farther than so many window widths from one for which `is_core` holds.
pub(crate) fn near(setting: &Setting, widths: f64, is_core: impl Fn(usize) -> bool) -> Vec<bool> {
    let [columns, rows] = setting.smoothed.nodes.size;
    let step = |axis: usize, next: usize| {
        let places = (setting.places.get(next), setting.places.first());
        match places {
            (Some(a), Some(b)) => (a - b)[axis],
            _ => 1.0,
        }
    };
    let reach = [
        widths * setting.width[0] / step(0, 1),
        widths * setting.width[1] / step(1, columns),
    ];
    let mut out = vec![false; columns * rows];
    for core in (0..columns * rows).filter(|&n| is_core(n)) {
        let (column, row) = ((core % columns) as f64, (core / columns) as f64);
        let span = |at: f64, reach: f64, count: usize| {
            (at - reach).max(0.0).ceil() as usize..=((at + reach) as usize).min(count - 1)
        };
        for r in span(row, reach[1], rows) {
            for c in span(column, reach[0], columns) {
                let (x, y) = ((c as f64 - column) / reach[0], (r as f64 - row) / reach[1]);
                out[r * columns + c] |= x * x + y * y <= 1.0;
            }
        }
    }
    out
}

/// Whether χ² is beyond chance: Wilson and Hilferty, PNAS 17, 684 (1931).
pub(crate) fn is_improbable(chi2: f64, freedom: usize) -> bool {
    if freedom == 0 {
        return false;
    }
    let n = freedom as f64;
    let a = 2.0 / (9.0 * n);
    chi2 > n * (1.0 - a + IMPROBABLE * a.sqrt()).powi(3)
}

/// How far the phase of the first waves (`pair` of a node) bends over a window width, from differences to the neighbours.
pub(crate) fn bend(
    setting: &Setting,
    pair: impl Fn(usize) -> Option<Matrix2<f64>>,
    node: usize,
) -> f64 {
    let [columns, rows] = setting.smoothed.nodes.size;
    let (column, row) = (node % columns, node / columns);
    let mut most = 0.0f64;
    for axis in 0..2 {
        let (low, high) = match axis {
            0 => (
                column.checked_sub(1).map(|_| node - 1),
                (column + 1 < columns).then(|| node + 1),
            ),
            _ => (
                row.checked_sub(1).map(|_| node - columns),
                (row + 1 < rows).then(|| node + columns),
            ),
        };
        let of = |n: Option<usize>| n.and_then(|n| Some((n, pair(n)?)));
        let here = pair(node).map(|l| (node, l));
        let (Some((a, first)), Some((b, second))) = (of(low).or(here), of(high).or(here)) else {
            continue;
        };
        let distance = (setting.places[b] - setting.places[a]).norm();
        if distance > 0.0 {
            let slope = (second - first) / distance;
            for wave in [slope.column(0).into_owned(), slope.column(1).into_owned()] {
                let across = Vector2::new(wave.x * setting.width[0], wave.y * setting.width[1]);
                most = most.max(across.norm() * setting.width[axis]);
            }
        }
    }
    most
}

/// Nodes near a point around which the phase of a first wave winds.
fn windings(setting: &Setting) -> Vec<bool> {
    let nodes = setting.smoothed.nodes;
    let [columns, rows] = nodes.size;
    let mut cores = vec![false; nodes.len()];
    let clear = |i: &usize| setting.noise_share[*i] * CLEAR < 1.0;
    for i in (0..setting.smoothed.envelopes.len().min(3)).filter(clear) {
        let amplitude = &setting.smoothed.envelopes[i].amplitude;
        let turn = |a: usize, b: usize| f64::from((amplitude[b] * amplitude[a].conj()).arg());
        for row in 1..rows {
            for column in 1..columns {
                let corner = row * columns + column;
                let around = [corner, corner - 1, corner - 1 - columns, corner - columns];
                if around
                    .iter()
                    .any(|&n| setting.smoothed.support[n].is_none())
                {
                    continue;
                }
                let turns: f64 = (0..4).map(|k| turn(around[k], around[(k + 1) % 4])).sum();
                if turns.abs() > std::f64::consts::PI {
                    cores[corner] = true;
                }
            }
        }
    }
    near(setting, NEAR, |n| cores[n])
}
