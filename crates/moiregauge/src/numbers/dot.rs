//! Sums of products.

use crate::numbers::widest::widest;

/// Sum of products in eight independent partial sums, which the compiler can keep in registers.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    widest(
        #[inline(always)]
        || {
            let mut sums = [0.0; 8];
            let ((a8, a_rest), (b8, b_rest)) = (a.as_chunks::<8>(), b.as_chunks::<8>());
            let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
            for (a, b) in a8.iter().zip(b8) {
                for i in 0..8 {
                    sums[i] += a[i] * b[i];
                }
            }
            sums.iter().sum::<f64>() + rest
        },
    )
}
