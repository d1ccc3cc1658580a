//! Times as they are typed: `2s`, `0.5 s`, `500ms`, `1min`.

use std::time::Duration;

/// From a thirtieth of a second, where looking begins to cost, to a day.
const RANGE_S: [f64; 2] = [0.03, 86_400.0];

/// A time; without a unit, seconds.
pub(super) fn parse(text: &str) -> Result<Duration, String> {
    let text = text.trim();
    let end = text
        .find(|c: char| !(c.is_ascii_digit() || c == '.'))
        .unwrap_or(text.len());
    let (number, unit) = text.split_at(end);
    let seconds = match unit.trim() {
        "ms" => 1e-3,
        "" | "s" => 1.0,
        "min" | "m" => 60.0,
        "h" => 3600.0,
        _ => f64::NAN,
    };
    let all = number.parse::<f64>().unwrap_or(f64::NAN) * seconds;
    let [low, high] = RANGE_S;
    if (low..=high).contains(&all) {
        Ok(Duration::from_secs_f64(all))
    } else {
        Err("expected a time from 30ms to 24h, as in 2s, 500ms or 1min".to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_have_units() {
        for (text, milliseconds) in [
            ("2s", 2000),
            ("0.5 s", 500),
            ("500ms", 500),
            ("3", 3000),
            ("1min", 60_000),
        ] {
            assert_eq!(
                parse(text),
                Ok(Duration::from_millis(milliseconds)),
                "{text}"
            );
        }
        for wrong in ["", "s", "-1s", "0s", "2 weeks", "1e9s", "nan"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }
}
