//! The χ² distribution: how probable a scatter is, and what it does to errors.

/// Scatter that chance makes less often than this enlarges the errors: convention, one of twenty good sets is
/// enlarged a little.
const SIGNIFICANT: f64 = 0.05;
/// The same for tests that are made once for each image: there are many of them, and none looks at them together.
const RARE: f64 = 1e-3;

/// The factor by which variances are enlarged where scans scatter significantly more than their errors
/// say: `χ²/dof` if chance makes so large a χ² in fewer than 5 % of cases, else 1. To enlarge for every
/// χ²/dof above 1 would make errors too large by 5 % on average where nothing is wrong.
///
/// This is the rule for all errors. One does not follow it: [`enlargement_by_estimated_noise`].
pub(crate) fn enlargement(chi2: f64, freedom: usize) -> f64 {
    if is_significant(chi2, freedom) {
        chi2 / freedom as f64
    } else {
        1.0
    }
}

/// The same where the errors come from noise that was read off the data and is known to the share `known_to`, as a
/// variance: the excess has to be one for the largest such noise. There is one such test for each image and none looks at
/// them together, so that what counts is what chance makes in one of a thousand.
pub(crate) fn enlargement_by_estimated_noise(chi2: f64, freedom: usize, known_to: f64) -> f64 {
    if freedom > 0 && tail(chi2 / known_to, freedom) < RARE {
        chi2 / freedom as f64
    } else {
        1.0
    }
}

/// Whether chance makes so large a χ² in fewer than 5 % of cases.
pub(crate) fn is_significant(chi2: f64, freedom: usize) -> bool {
    freedom > 0 && tail(chi2, freedom) < SIGNIFICANT
}

/// The probability of a χ² of `freedom` degrees beyond `chi2`, by the recurrence
/// `Q(a + 1, x) = Q(a, x) + xᵃ e⁻ˣ / Γ(a + 1)` from `Q(½, x) = erfc √x` or `Q(1, x) = e⁻ˣ`, x = χ²/2.
pub(crate) fn tail(chi2: f64, freedom: usize) -> f64 {
    let x = chi2.max(0.0) / 2.0;
    if x == 0.0 || freedom == 0 {
        return 1.0;
    }
    let (mut a, mut tail) = if freedom % 2 == 1 {
        (0.5, libm::erfc(x.sqrt()))
    } else {
        (1.0, (-x).exp())
    };
    while a < freedom as f64 / 2.0 - 0.25 {
        tail += (a * x.ln() - x - libm::lgamma(a + 1.0)).exp();
        a += 1.0;
    }
    tail.min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Quantiles of the χ² distribution from tables (Abramowitz and Stegun, table 26.8).
    #[test]
    fn tails_of_chi_squared() {
        let table = [
            (3.841_459, 1, 0.05),
            (5.991_465, 2, 0.05),
            (7.814_728, 3, 0.05),
            (23.684_79, 14, 0.05),
            (36.123_27, 14, 0.001),
            (37.697_30, 15, 0.001),
            (7.260_94, 15, 0.95),
        ];
        for (chi2, freedom, expected) in table {
            let found = tail(chi2, freedom);
            assert!((found / expected - 1.0).abs() < 1e-5, "{freedom}: {found}");
        }
    }

    #[test]
    fn only_significant_scatter_enlarges() {
        assert_eq!(enlargement(23.0, 14), 1.0);
        assert_eq!(enlargement(24.0, 14), 24.0 / 14.0);
        assert_eq!(enlargement(5.0, 14), 1.0);
        assert_eq!(enlargement(5.0, 0), 1.0);
    }

    /// 36.12 is what chance exceeds once in a thousand times with 14 degrees of freedom.
    #[test]
    fn noise_that_is_estimated_needs_more() {
        assert_eq!(enlargement_by_estimated_noise(45.0, 14, 1.25), 1.0);
        assert_eq!(enlargement_by_estimated_noise(45.4, 14, 1.25), 45.4 / 14.0);
        assert_eq!(enlargement_by_estimated_noise(1e3, 0, 1.25), 1.0);
    }
}
