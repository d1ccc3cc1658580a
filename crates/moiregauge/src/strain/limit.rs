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
pub(super) fn probability_within(r: f64, t: f64) -> f64 {
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
///
/// The length t at which a result as short as r has a probability of 5 % of that at t = 0. Dividing
/// by the latter keeps the limit honest when noise happens to cancel: it is never below 2.45.
pub(super) fn upper_limit_95(r: f64) -> f64 {
    if !r.is_finite() {
        return r;
    }
    // Far out r is normal about t + 1/2t with the deviation 1 − 1/4t².
    if r > 50.0 {
        let one_sided = 1.644_853_626_951;
        let t = r + one_sided;
        return t - 0.5 / t - one_sided / (4.0 * t * t);
    }
    let without = -(-r * r / 2.0).exp_m1();
    if without < 1e-12 {
        // The ratio tends to e^{−t²/2}.
        return (2.0 * 20.0_f64.ln()).sqrt();
    }
    let (mut low, mut high) = (0.0, r + 6.0);
    while high - low > 1e-9 {
        let t = f64::midpoint(low, high);
        if probability_within(r, t) > 0.05 * without {
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
}
