//! Seconds of the simulated clock → a calendar date.

use spmfile::DateTime;

/// Days from 1970-01-01 to the day on which the simulated clock starts, at ten in the morning:
/// 15 January 2024.
const FIRST_DAY: i64 = 19_737;
/// Seconds of that day before it.
const FIRST_SECOND: i64 = 10 * 3600;

/// The date `seconds` after the start of the clock, in whole seconds.
pub(crate) fn date_after(seconds: f64) -> DateTime {
    let total = FIRST_DAY * 86_400 + FIRST_SECOND + seconds.round() as i64;
    let (year, month, day) = civil(total.div_euclid(86_400));
    let second = total.rem_euclid(86_400);
    DateTime {
        year,
        month,
        day,
        hour: (second / 3600) as u8,
        minute: (second / 60 % 60) as u8,
        second: (second % 60) as u8,
    }
}

/// Year, month and day of a number of days after 1970-01-01 (Gregorian; years begin in March, so
/// that the day added in leap years is the last one).
fn civil(days: i64) -> (i32, u8, u8) {
    let shifted = days + 719_468;
    let era = shifted.div_euclid(146_097);
    let day_of_era = shifted.rem_euclid(146_097);
    let year_of_era =
        (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month_from_march = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = (month_from_march + 2) % 12 + 1;
    let year = era * 400 + year_of_era + i64::from(month <= 2);
    (year as i32, month as u8, day as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_dates() {
        assert_eq!(civil(0), (1970, 1, 1));
        assert_eq!(civil(FIRST_DAY), (2024, 1, 15));
        assert_eq!(civil(19_782), (2024, 2, 29));
        assert_eq!(civil(19_783), (2024, 3, 1));
        assert_eq!(civil(11_016), (2000, 2, 29));
        let date = date_after(14.0 * 3600.0 + 61.4);
        let expected = DateTime {
            year: 2024,
            month: 1,
            day: 16,
            hour: 0,
            minute: 1,
            second: 1,
        };
        assert_eq!(date, expected);
    }
}
