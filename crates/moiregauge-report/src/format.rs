//! Numbers as people read them: rounded to their uncertainty.

use moiregauge::estimate::TotalEstimate;
pub use moiregauge::words::{plus_minus, two_digits};

/// `value ± total unit (statistical ± part unit)`: the total is what may be published.
pub fn with_statistical(found: TotalEstimate, unit: &str) -> String {
    let total = plus_minus(found.total());
    if !found.value.is_finite() {
        return total;
    }
    let part = two_digits(found.statistical);
    format!("{total}{unit} (statistical ± {part}{unit})")
}

#[cfg(test)]
mod tests {
    use moiregauge::estimate::Estimate;

    use super::*;

    fn shown(value: f64, sigma: f64) -> String {
        plus_minus(Estimate::new(value, sigma))
    }

    #[test]
    fn two_digits_of_sigma() {
        assert_eq!(shown(1.126_34, 0.000_83), "1.12634 ± 0.00083");
        assert_eq!(shown(-0.27, 0.05), "−0.270 ± 0.050");
        assert_eq!(shown(0.5, 0.0996), "0.50 ± 0.10");
        assert_eq!(shown(1234.6, 250.0), "1235 ± 250");
    }

    #[test]
    fn the_total_comes_first() {
        let found = TotalEstimate {
            value: 1.130_004,
            statistical: 0.000_014,
            total: 0.011,
        };
        let shown = with_statistical(found, "°");
        assert_eq!(shown, "1.130 ± 0.011° (statistical ± 0.000014°)");
        let unknown = TotalEstimate {
            total: f64::NAN,
            ..found
        };
        let shown = with_statistical(unknown, "°");
        assert_eq!(shown, "1.1300 ± ?° (statistical ± 0.000014°)");
    }

    #[test]
    fn numbers_have_two_digits() {
        let shown = [0.0111, 0.0996, 1.04e-5, 23.4, 0.0].map(two_digits);
        assert_eq!(shown, ["0.011", "0.10", "0.000010", "23", "0"]);
    }

    #[test]
    fn an_unknown_sigma_does_not_look_exact() {
        assert_eq!(shown(1.5, f64::NAN), "1.5000 ± ?");
        assert_eq!(shown(f64::NAN, 1.0), "–");
    }
}
