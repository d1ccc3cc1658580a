//! Size, place and time of the frame.
//!
//! Lengths come out in nm, angles in rad (`Rotate Ang.` is in radians already).

use super::header::{Section, leading_number, lookup};
use crate::scan::DateTime;
use crate::units;
use crate::words::{self, Unread};

const SCAN_LIST: &str = "Ciao scan list";

/// A value of the scan list.
pub(super) fn scan_value<'a>(sections: &[Section<'a>], key: &str) -> Option<&'a str> {
    lookup(sections, SCAN_LIST, key)
}

/// A plain number of the scan list.
pub(super) fn scan_number(sections: &[Section<'_>], key: &str, unread: &Unread) -> Option<f64> {
    unread.entry(key, scan_value(sections, key), |text| {
        leading_number(text).map(|(n, _)| n)
    })
}

/// A length of the scan list; without a unit it is in nm, as the software writes it there.
pub(super) fn scan_length(sections: &[Section<'_>], key: &str, unread: &Unread) -> Option<f64> {
    unread.entry(key, scan_value(sections, key), |text| {
        let (n, unit) = leading_number(text)?;
        let unit = if unit.is_empty() { "nm" } else { unit };
        Some(n * units::nm_per(unit)?)
    })
}

/// `1 1 ~m` or `1000 nm` → the two lengths in nm (the second may be absent).
fn lengths(text: &str) -> Option<(f64, Option<f64>)> {
    let (first, rest) = leading_number(text)?;
    let (second, unit) = match leading_number(rest) {
        Some((second, unit)) => (Some(second), unit),
        None => (None, rest),
    };
    let nm = units::nm_per(unit)?;
    let positive = |n: f64| Some(n * nm).filter(|&n| n > 0.0);
    Some((positive(first)?, second.and_then(positive)))
}

/// Size of the full frame along the fast and slow axis, nm, as the image section `image` tells it.
///
/// The image list gives `Scan Size: W H unit`, with H = W even where the frame is not square
/// in some versions; the scan list knows better (`Slow Axis Size`, `Aspect Ratio: a:b`).
pub(super) fn full_size(
    image: Option<&Section<'_>>,
    sections: &[Section<'_>],
    unread: &Unread,
) -> Option<[f64; 2]> {
    let size = |text| unread.entry("Scan size", text, lengths);
    let (width, height) = image
        .and_then(|s| s.get("Scan size").and_then(lengths))
        .or_else(|| size(scan_value(sections, "Scan size")))
        .or_else(|| size(image.and_then(|s| s.get("Scan size"))))?;
    let by_aspect = || {
        let ratio = |text: &str| {
            let (a, b) = text.split_once(':')?;
            Some((words::number(a)?, words::number(b)?)).filter(|&(a, b)| a > 0.0 && b > 0.0)
        };
        let ratio = unread.entry("Aspect ratio", scan_value(sections, "Aspect ratio"), ratio);
        ratio.filter(|(a, b)| a != b).map(|(a, b)| width * b / a)
    };
    let slow = scan_length(sections, "Slow Axis Size", unread)
        .filter(|&n| n > 0.0)
        .or_else(by_aspect)
        .or(height)
        .unwrap_or(width);
    (width.is_finite() && slow.is_finite()).then_some([width, slow])
}

/// Height of `rows` recorded lines, edge to edge.
///
/// An unfinished frame has fewer lines than the scan list's `Lines`; each line keeps its share of
/// the full frame. With square pixels this is `width · rows / columns`. Up leaves the bottom lines
/// of the frame, Down the top ones; either way the first stored row is the lowest one recorded.
pub(super) fn recorded_height(full: f64, rows: usize, sections: &[Section<'_>]) -> f64 {
    match scan_number(sections, "Lines", &Unread::default()) {
        Some(lines) if lines > rows as f64 => full * rows as f64 / lines,
        _ => full,
    }
}

/// `11:38:13 AM Wed Jun 30 2021`, with or without AM/PM.
pub(super) fn date_time(text: &str) -> Option<DateTime> {
    const MONTHS: [&str; 12] = [
        "jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec",
    ];
    let words: Vec<&str> = text.split_whitespace().collect();
    let (clock, half, [_weekday, month, day, year]) = match words[..] {
        [clock, half, a, b, c, d] => (clock, Some(half), [a, b, c, d]),
        [clock, a, b, c, d] => (clock, None, [a, b, c, d]),
        _ => return None,
    };
    let mut parts = clock.split(':').map(str::parse::<u8>);
    let mut part = || parts.next()?.ok();
    let (mut hour, minute, second) = (part()?, part()?, part()?);
    if let Some(half) = half {
        let afternoon = half.eq_ignore_ascii_case("PM");
        if !(afternoon || half.eq_ignore_ascii_case("AM")) || hour == 0 || hour > 12 {
            return None;
        }
        hour = hour % 12 + if afternoon { 12 } else { 0 };
    }
    let month = MONTHS
        .iter()
        .position(|m| month.to_ascii_lowercase().starts_with(m))?;
    let date = DateTime {
        year: year.parse().ok()?,
        month: month as u8 + 1,
        day: day.parse().ok()?,
        hour,
        minute,
        second,
    };
    let possible = (1..=31).contains(&date.day) && hour < 24 && minute < 60 && second < 61;
    possible.then_some(date)
}

/// `0x09700105` → `9.70`.
pub(super) fn version(text: &str) -> Option<String> {
    let digits = text.trim().strip_prefix("0x")?;
    let major: u32 = digits.get(..2)?.parse().ok()?;
    let minor = digits.get(2..4)?;
    Some(format!("{major}.{minor}"))
}

#[cfg(test)]
mod tests {
    use super::super::header::sections;
    use super::*;

    #[test]
    fn dates() {
        let at = |h, m, s| {
            Some(DateTime {
                year: 2024,
                month: 3,
                day: 5,
                hour: h,
                minute: m,
                second: s,
            })
        };
        assert_eq!(date_time("07:37:34 PM Tue Mar 05 2024"), at(19, 37, 34));
        assert_eq!(date_time("12:00:00 AM Tue Mar 05 2024"), at(0, 0, 0));
        assert_eq!(date_time("12:00:01 PM Tue Mar 5 2024"), at(12, 0, 1));
        assert_eq!(date_time("19:37:34 Tue Mar 05 2024"), at(19, 37, 34));
        for wrong in [
            "",
            "07:37:34",
            "25:00:00 Tue Mar 05 2024",
            "1:2:3 XM Tue Mar 05 2024",
        ] {
            assert_eq!(date_time(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn versions() {
        assert_eq!(version("0x10000102").as_deref(), Some("10.00"));
        assert_eq!(version("0x05120130").as_deref(), Some("5.12"));
        assert_eq!(version("0x0é20130"), None);
        assert_eq!(version("unknown"), None);
    }

    #[test]
    fn sizes() {
        let size = |scan: &str, image: &str| {
            let text =
                format!("\\*Ciao scan list\n{scan}\\*Ciao image list\n\\Scan Size: {image}\n");
            let all = sections(&text);
            full_size(all.last(), &all, &Unread::default())
        };
        assert_eq!(size("", "1 1 ~m"), Some([1000.0, 1000.0]));
        assert_eq!(size("\\Scan size: 250 nm\n", "?"), Some([250.0, 250.0]));
        assert_eq!(size("", "300 150 nm"), Some([300.0, 150.0]));
        assert_eq!(
            size("\\Aspect ratio: 4:1\n", "300 300 nm"),
            Some([300.0, 75.0])
        );
        assert_eq!(
            size("\\Slow Axis Size: 75 nm\n", "300 300 nm"),
            Some([300.0, 75.0])
        );
        assert_eq!(size("", "300 300 V"), None);
        assert_eq!(size("", "0 0 nm"), None);
    }
}
