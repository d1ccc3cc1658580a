//! Numbers and names as people read them.

use spmfile::LineDirection;

use crate::estimate::Estimate;

/// A number with `decimals` decimals and a true minus sign; never `−0`.
pub fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let digits = text.trim_start_matches('-');
    if digits.len() < text.len() && digits.bytes().any(|b| (b'1'..=b'9').contains(&b)) {
        format!("\u{2212}{digits}")
    } else {
        digits.to_owned()
    }
}

/// `value ± sigma` with two significant digits of sigma and as many decimals of the value.
///
/// Where sigma is unknown the value is printed with four decimals and a question mark, so that
/// nobody takes it for exact.
pub fn plus_minus(estimate: Estimate) -> String {
    let Estimate { value, sigma } = estimate;
    if !value.is_finite() {
        return "\u{2013}".to_owned();
    }
    if sigma == 0.0 {
        return format!("{} ± 0", fixed(value, 4));
    }
    if !sigma.is_finite() || sigma < 0.0 {
        return format!("{} ± ?", fixed(value, 4));
    }
    let decimals = decimals(sigma);
    format!("{} ± {}", fixed(value, decimals), fixed(sigma, decimals))
}

/// Two significant digits, written out.
pub fn two_digits(value: f64) -> String {
    if !value.is_finite() {
        return "\u{2013}".to_owned();
    }
    if value.abs() < 1e-9 {
        return "0".to_owned();
    }
    fixed(value, decimals(value.abs()))
}

/// Decimals that show two significant digits of `sigma`.
fn decimals(sigma: f64) -> usize {
    // 0.0996 becomes 0.10: rounding to two digits may add one before them.
    let carried = sigma * (1.0 + 0.05 / 9.95);
    (1.0 - carried.log10().floor()).clamp(0.0, 12.0) as usize
}

/// `trace` or `retrace`.
pub fn line_name(line: LineDirection) -> &'static str {
    match line {
        LineDirection::Trace => "trace",
        LineDirection::Retrace => "retrace",
    }
}
