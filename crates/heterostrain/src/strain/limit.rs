//! Upper limit of the length of a two-component vector measured with Gaussian noise.
//!
//! In units of the noise σ per component: the measured length r of a vector of true length t has
//! `r²` distributed as non-central χ² with two degrees of freedom and non-centrality `t²`.

use std::f64::consts::{PI, TAU};

/// The probability that a vector of true length `t` is measured no longer than `r` (both in σ).
///
/// That is the mass of a unit Gaussian at distance `t` from the centre of a disc of radius `r`.
/// By Stokes' theorem it is an integral around the rim, `(1/2π) ∮ (1 − e^{−ρ²/2}) dχ`, χ the angle
/// seen from the Gaussian's centre and ρ the distance from it. The integrand is smooth and periodic
/// for all r and t, so equal steps converge faster than any power.
pub(crate) fn probability_within(r: f64, t: f64) -> f64 {
    // The narrowest feature is 1/r wide; half the rim suffices by symmetry.
    let steps = 32 + (8.0 * r.max(t)) as usize;
    let integrand = |angle: f64| {
        let cosine = angle.cos();
        let half_square = (r * r + t * t - 2.0 * r * t * cosine) / 2.0;
        let density = if half_square > 1e-8 {
            -(-half_square).exp_m1() / half_square
        } else {
            1.0 - half_square / 2.0
        };
        density * (r * r - r * t * cosine) / 2.0
    };
    let inner: f64 = (1..steps)
        .map(|k| integrand(PI * k as f64 / steps as f64))
        .sum();
    let ends = f64::midpoint(integrand(0.0), integrand(PI));
    (inner + ends) * (2.0 * PI / steps as f64) / TAU
}

/// The true length, in σ, that is excluded at 95 % by a measured length `r` (in σ).
pub(crate) fn upper_limit_95(r: f64) -> f64 {
    upper_limit(r, 0.05)
}

/// The length interval, in σ, that holds the true one with 95 % confidence or more, `r` measured.
///
/// Each end excludes 2.5 %: below the lower one a result as long as r is rarer than that, above the
/// upper one ([`upper_limit`]) a result as short. It begins at zero where noise alone explains r.
pub(crate) fn interval_95(r: f64) -> [f64; 2] {
    [lower_limit(r, 0.025), upper_limit(r, 0.025)]
}

/// The length t at which a result as short as r has a probability of `tail` of that at t = 0.
///
/// Dividing by the latter keeps the limit honest when noise happens to cancel: it never falls below
/// that for r = 0, 2.45 for 5 %.
fn upper_limit(r: f64, tail: f64) -> f64 {
    if !r.is_finite() {
        return r;
    }
    if r > FAR {
        return far_out(r, -one_sided(tail));
    }
    let without = -(-r * r / 2.0).exp_m1();
    if without < 1e-12 {
        // The ratio tends to e^{−t²/2}.
        return (-2.0 * tail.ln()).sqrt();
    }
    bisect(0.0, r + 6.0, |t| probability_within(r, t) > tail * without)
}

/// The length t at which a result as long as r has a probability of `tail`; 0 where it is commoner
/// than that without any.
fn lower_limit(r: f64, tail: f64) -> f64 {
    if !r.is_finite() {
        return r;
    }
    if r > FAR {
        return far_out(r, one_sided(tail));
    }
    if (-r * r / 2.0).exp() > tail {
        return 0.0;
    }
    bisect(0.0, r, |t| 1.0 - probability_within(r, t) < tail)
}

/// Beyond this many σ a length is as good as normal: its bias is 0.01 σ.
const FAR: f64 = 50.0;

/// Where r lies `z` deviations above its mean: r is normal about t + 1/2t with the deviation 1 − 1/4t².
fn far_out(r: f64, z: f64) -> f64 {
    let t = r - z;
    t - 0.5 / t + z / (4.0 * t * t)
}

/// Deviations of a normal distribution beyond which `tail` of it lies.
fn one_sided(tail: f64) -> f64 {
    if tail < 0.04 {
        1.959_963_984_540
    } else {
        1.644_853_626_951
    }
}

/// Where `below` turns from true to false.
fn bisect(mut low: f64, mut high: f64, below: impl Fn(f64) -> bool) -> f64 {
    while high - low > 1e-9 {
        let t = f64::midpoint(low, high);
        if below(t) {
            low = t;
        } else {
            high = t;
        }
    }
    low
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A central Gaussian: 1 − e^{−r²/2} exactly.
    #[test]
    fn centred_disc_is_rayleigh() {
        for r in [0.1, 1.0, 2.448, 5.0] {
            let exact = 1.0 - (-r * r / 2.0_f64).exp();
            assert!(
                (probability_within(r, 0.0) - exact).abs() < 1e-14,
                "r = {r}"
            );
        }
    }

    /// The Poisson mixture of central χ² distributions, the textbook definition.
    #[test]
    fn agrees_with_the_poisson_mixture() {
        let mixture = |r: f64, t: f64| {
            let (x, y) = (t * t / 2.0, r * r / 2.0);
            let (mut weight, mut term, mut tail, mut sum) = ((-x).exp(), (-y).exp(), 0.0, 0.0);
            for j in 0..400 {
                tail += term;
                sum += weight * (1.0 - tail);
                weight *= x / f64::from(j + 1);
                term *= y / f64::from(j + 1);
            }
            sum
        };
        for (r, t) in [
            (0.3, 2.0),
            (1.0, 1.0),
            (2.0, 3.5),
            (5.0, 4.9),
            (8.0, 9.6),
            (10.0, 10.0),
        ] {
            let difference = probability_within(r, t) - mixture(r, t);
            assert!(difference.abs() < 1e-12, "r {r}, t {t}: {difference}");
        }
    }

    /// At r = 0 the limit is that of a Rayleigh distribution; far out it is one-sided normal.
    #[test]
    fn limit_has_the_right_ends() {
        assert!((upper_limit_95(0.0) - 2.447_746_83).abs() < 1e-8);
        assert!((upper_limit_95(1e-7) - 2.447_746_83).abs() < 1e-6);
        assert!((upper_limit_95(1e-3) - 2.447_746_83).abs() < 1e-3);
        let (below, above) = (upper_limit_95(49.999), upper_limit_95(50.001));
        assert!((above - below - 0.002).abs() < 2e-5, "{below} {above}");
        let limit = upper_limit_95(4.0);
        assert!(
            (probability_within(4.0, limit) - 0.05).abs() < 1e-4,
            "{limit}"
        );
    }

    /// The interval covers true lengths as often as it says: the measured lengths whose interval holds
    /// t lie between two ends, and the probability between them is that of the textbook disc integral.
    #[test]
    fn interval_covers_95_percent() {
        for t in [0.0, 0.3, 1.0, 2.0, 2.7, 3.5, 5.0, 10.0] {
            let edge = |outside: &dyn Fn(f64) -> bool, (mut a, mut b): (f64, f64)| {
                for _ in 0..40 {
                    let r = f64::midpoint(a, b);
                    if outside(r) { a = r } else { b = r }
                }
                a
            };
            // Too short: the upper end is below t; too long: the lower one above it.
            let short = if interval_95(0.0)[1] >= t {
                0.0
            } else {
                edge(&|r| interval_95(r)[1] < t, (0.0, t))
            };
            let long = edge(&|r| interval_95(r)[0] > t, (t + 8.0, t));
            let covered = probability_within(long, t) - probability_within(short, t);
            assert!(covered > 0.95 - 1e-6, "t = {t}: {covered}");
            assert!(covered < 0.9751, "t = {t}: {covered}");
            // Far from zero nothing is wasted.
            if t > 4.0 {
                assert!(covered < 0.9502, "t = {t}: {covered}");
            }
        }
    }

    /// Both ends pass into those of a normal distribution without a step.
    #[test]
    fn interval_far_out_is_normal() {
        let (below, above) = (interval_95(49.999), interval_95(50.001));
        for end in 0..2 {
            assert!((above[end] - below[end] - 0.002).abs() < 2e-5, "{above:?}");
        }
        assert!(
            (above[1] - above[0] - 2.0 * 1.959_964).abs() < 1e-3,
            "{above:?}"
        );
        assert_eq!(interval_95(2.7)[0], 0.0);
        assert!(interval_95(2.8)[0] > 0.0);
    }
}
