//! How much of a map has a wanted twist.
//!
//! Noise moves nodes in and out of `θ₀ ± δ`, so that counting them gives a blurred answer. What is known of a
//! node is its value and its error; the map gives for all nodes their mean μ and their spread without
//! noise, √v. Together (normal distributions): the true twist of a node measured as x ± σ has the mean
//! `μ + (x − μ) v/(v + σ²)` and the variance `vσ²/(v + σ²)`. The area is the mean probability of the nodes.
//! The window draws twists towards their mean, too; how far that may move the answer is said beside it.

use std::f64::consts::SQRT_2;

use crate::map::quantities::TwistStrainMap;
use crate::region::smoothing::{Bends, Bent};
use crate::window::mask::Mask;

/// A twist that a device is to have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WantedTwist {
    /// θ₀, rad.
    pub twist: f64,
    /// δ, rad.
    pub within: f64,
}

/// Shares of an area, 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct WantedArea {
    /// Good nodes that it is about.
    pub nodes: usize,
    /// Share of the nodes whose measured twist is within the limits.
    pub measured: f64,
    /// Share expected without noise.
    pub corrected: f64,
    /// How far the window may have moved that, as the curvature of the map tells: it draws twists towards their mean.
    pub blur: f64,
    /// Share that is within the limits by two σ of its own.
    pub certain: f64,
    /// Share that is not beyond them by two σ.
    pub possible: f64,
}

impl WantedArea {
    /// Over the good ones of `nodes`; `None` where there are none.
    pub fn new(
        map: &TwistStrainMap,
        nodes: impl IntoIterator<Item = usize>,
        wanted: &WantedTwist,
    ) -> Option<Self> {
        let twist = |n: usize| [map.twist.at(n).value, map.twist.at(n).sigma];
        let nodes: Vec<usize> = nodes
            .into_iter()
            .filter(|&n| map.mask[n] == Mask::Good && twist(n).iter().all(|x| x.is_finite()))
            .collect();
        let found: Vec<[f64; 2]> = nodes.iter().map(|&n| twist(n)).collect();
        let count = found.len() as f64;
        if found.is_empty() {
            return None;
        }
        let mean = found.iter().map(|v| v[0]).sum::<f64>() / count;
        let variance = found
            .iter()
            .map(|v| (v[0] - mean).powi(2) - v[1].powi(2))
            .sum::<f64>();
        let variance = (variance / count).max(0.0);
        let share = |test: &dyn Fn(f64, f64) -> f64| {
            found.iter().map(|v| test(v[0], v[1])).sum::<f64>() / count
        };
        let off = |x: f64| (x - wanted.twist).abs();
        let one = |yes: bool| f64::from(u8::from(yes));
        // The share if all twists lie farther from their mean by a factor.
        let expected = |stretch: f64| {
            share(&|x, sigma| {
                let noise = sigma * sigma;
                let weight = if noise > 0.0 {
                    variance / (variance + noise)
                } else {
                    1.0
                };
                let best = mean + stretch * weight * (x - mean);
                let doubt = stretch * (weight * noise).sqrt();
                within(best - wanted.twist, doubt, wanted.within)
            })
        };
        let bends = Bends::new(map);
        let bent = nodes
            .iter()
            .fold(Bent::default(), |sums, &n| match bends.at(map, n, &twist) {
                Some(bend) => sums.and(1.0, twist(n)[0] - mean, bend),
                None => sums,
            });
        let corrected = expected(1.0);
        Some(Self {
            nodes: found.len(),
            measured: share(&|x, _| one(off(x) <= wanted.within)),
            corrected,
            // Doubt about a spread of many nodes is small.
            blur: (expected(bends.widening([variance, 0.0], 0.0, &bent)) - corrected).abs(),
            certain: share(&|x, sigma| one(off(x) + 2.0 * sigma <= wanted.within)),
            possible: share(&|x, sigma| one(off(x) - 2.0 * sigma <= wanted.within)),
        })
    }
}

/// Probability that a normal variable about `offset` lies within ± `limit`.
fn within(offset: f64, sigma: f64, limit: f64) -> f64 {
    if !(sigma > 0.0) {
        return f64::from(u8::from(offset.abs() <= limit));
    }
    let below = |x: f64| 0.5 * libm::erfc(-x / (sigma * SQRT_2));
    below(limit - offset) - below(-limit - offset)
}
