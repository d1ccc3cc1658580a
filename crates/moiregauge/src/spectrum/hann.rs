//! The Hann window.

/// Hann window sampled at pixel centres.
pub(crate) fn hann(n: usize) -> Vec<f64> {
    (0..n).map(|i| hann_at(i as f64, n)).collect()
}

/// The Hann window of `n` pixels at the position `x` (pixels; zero outside).
pub(crate) fn hann_at(x: f64, n: usize) -> f64 {
    let t = (x + 0.5) / n as f64;
    if (0.0..=1.0).contains(&t) {
        (std::f64::consts::PI * t).sin().powi(2)
    } else {
        0.0
    }
}

/// `Σ w(n) cos(q (n − centre))` of the Hann window of `n` pixels: three Dirichlet kernels.
pub(crate) fn hann_transform(q: f64, n: usize) -> f64 {
    /// Nearer to a peak of a kernel both of its sines are calculated there: their ratio is exact then.
    const NEAR: f64 = 1e-3;
    let n = n as f64;
    let step = std::f64::consts::TAU / n;
    // Half a turn from kernel to kernel.
    let sin = (n * q / 2.0).sin();
    let dirichlet = |q: f64, sin: f64| {
        let half = (q / 2.0).sin();
        if half.abs() < 1e-9 {
            // At multiples of 2π every cosine is ±1; the sign of an even n alternates with them.
            n * (n * q / 2.0).cos() / (q / 2.0).cos()
        } else if half.abs() < NEAR {
            (n * q / 2.0).sin() / half
        } else {
            sin / half
        }
    };
    0.5 * dirichlet(q, sin) + 0.25 * (dirichlet(q + step, -sin) + dirichlet(q - step, -sin))
}
