//! Calendar dates of instruments: parsing and shifting, by the proleptic Gregorian calendar.

use crate::scan::DateTime;

const SECONDS_PER_DAY: i64 = 86_400;
/// A cycle of the Gregorian calendar: 400 years.
const DAYS_PER_CYCLE: i64 = 146_097;

/// A date if it is possible; seconds may have a fraction, which is cut off.
pub(crate) fn date(ymd: [i64; 3], hms: [i64; 3]) -> Option<DateTime> {
    let [year, month, day] = ymd;
    let [hour, minute, second] = hms;
    let possible = (1..=9999).contains(&year)
        && (1..=12).contains(&month)
        && (1..=31).contains(&day)
        && (0..24).contains(&hour)
        && (0..60).contains(&minute)
        && (0..=60).contains(&second);
    possible.then_some(DateTime {
        year: i32::try_from(year).ok()?,
        month: month as u8,
        day: day as u8,
        hour: hour as u8,
        minute: minute as u8,
        second: second as u8,
    })
}

/// `19:20:07` or `19:20:07.25` as three numbers; `PM` behind it is understood.
pub(crate) fn clock(text: &str) -> Option<[i64; 3]> {
    let lower = text.trim().to_ascii_lowercase();
    let (digits, half) = match lower.strip_suffix("pm") {
        Some(rest) => (rest, Some(12)),
        None => match lower.strip_suffix("am") {
            Some(rest) => (rest, Some(0)),
            None => (&*lower, None),
        },
    };
    let mut parts = digits.trim().split(':').map(|part| {
        let whole = part.split(['.', ',']).next().unwrap_or("");
        whole.trim().parse::<i64>().ok()
    });
    let hour = parts.next()??;
    let minute = parts.next()??;
    let second = parts.next().unwrap_or(Some(0))?;
    let hour = half.map_or(hour, |half| hour % 12 + half);
    Some([hour, minute, second])
}

/// The date and time `seconds` later.
pub(crate) fn later(start: DateTime, seconds: f64) -> DateTime {
    // A century and more is no time of a scan.
    if !(seconds.abs() < 4e9) {
        return start;
    }
    let time =
        i64::from(start.hour) * 3600 + i64::from(start.minute) * 60 + i64::from(start.second);
    let total = days(start) * SECONDS_PER_DAY + time + seconds.round() as i64;
    from_days(
        total.div_euclid(SECONDS_PER_DAY),
        total.rem_euclid(SECONDS_PER_DAY),
    )
}

/// Days since 1 March of year 0: years begin in March, so that the leap day is their last.
fn days(date: DateTime) -> i64 {
    let before_march = i64::from(date.month < 3);
    let year = i64::from(date.year) - before_march;
    let month = (i64::from(date.month) + 9) % 12;
    let leaps = year.div_euclid(4) - year.div_euclid(100) + year.div_euclid(400);
    365 * year + leaps + (153 * month + 2) / 5 + i64::from(date.day) - 1
}

/// The inverse of [`days`], with the seconds of the day.
fn from_days(days: i64, seconds: i64) -> DateTime {
    let cycle = days.div_euclid(DAYS_PER_CYCLE);
    let day = days.rem_euclid(DAYS_PER_CYCLE);
    // Leap days up to `day`: one in 4 years, none in 100, one in 400.
    let year = (day - day / 1460 + day / 36_524 - day / (DAYS_PER_CYCLE - 1)) / 365;
    let day = day - (365 * year + year / 4 - year / 100);
    let month = (5 * day + 2) / 153;
    DateTime {
        year: (400 * cycle + year + i64::from(month >= 10)) as i32,
        month: ((month + 2) % 12 + 1) as u8,
        day: (day - (153 * month + 2) / 5 + 1) as u8,
        hour: (seconds / 3600) as u8,
        minute: (seconds / 60 % 60) as u8,
        second: (seconds % 60) as u8,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(ymd: [i64; 3], hms: [i64; 3]) -> DateTime {
        date(ymd, hms).expect("a date")
    }

    #[test]
    fn shifting_crosses_days_and_leap_years() {
        let eve = at([2019, 12, 31], [23, 59, 30]);
        assert_eq!(later(eve, 45.2), at([2020, 1, 1], [0, 0, 15]));
        let leap = at([2024, 2, 28], [12, 0, 0]);
        assert_eq!(later(leap, 86_400.0), at([2024, 2, 29], [12, 0, 0]));
        assert_eq!(later(leap, 2.0 * 86_400.0), at([2024, 3, 1], [12, 0, 0]));
        let no_leap = at([2100, 2, 28], [12, 0, 0]);
        assert_eq!(later(no_leap, 86_400.0), at([2100, 3, 1], [12, 0, 0]));
        let mut day = at([1999, 1, 1], [6, 0, 0]);
        for _ in 0..1461 {
            let next = later(day, 86_400.0);
            assert_eq!(later(next, -86_400.0), day);
            day = next;
        }
        assert_eq!(day, at([2003, 1, 1], [6, 0, 0]));
        assert_eq!(later(day, f64::NAN), day);
    }

    #[test]
    fn clocks() {
        assert_eq!(clock("19:20:07"), Some([19, 20, 7]));
        assert_eq!(clock("7:20:07.5 PM"), Some([19, 20, 7]));
        assert_eq!(clock("12:01 am"), Some([0, 1, 0]));
        assert_eq!(clock("noon"), None);
        assert_eq!(date([2024, 13, 1], [0, 0, 0]), None);
        assert_eq!(date([2024, 1, 1], [24, 0, 0]), None);
    }
}
