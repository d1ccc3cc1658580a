//! Measured scans → what the joint fit wants of them.

use heterostrain::lattice::{labelled_like, reciprocal};
use nalgebra::{Matrix2, Vector2};
use spmfile::{DateTime, LineDirection};

use crate::drift::joint::sighting::Detection;
use crate::frame::axis::Axis;
use crate::numbers::three::three;
use crate::scan::measured::{MeasuredLine, MeasuredScan};
use crate::spectrum::phases::Phases;

/// A harmonic belongs to a wave vector of the reference if it is nearer than this share of it: below half, where the
/// next is as near.
const SAME_HARMONIC: f64 = 0.2;

/// One sighting for every line of every scan, in order; `reference` is the real-space pair (nm) after
/// which all lattices are labelled. `None` where a scan has no timing.
pub(crate) fn sightings(
    scans: &[&MeasuredScan],
    reference: &Matrix2<f64>,
) -> Option<Vec<Detection>> {
    let reference = reciprocal(reference)?;
    let mut classes: Vec<(Axis, LineDirection)> = Vec::new();
    let mut all = Vec::new();
    for (index, scan) in scans.iter().enumerate() {
        for line in &scan.lines {
            let key = (line.geometry.slow_axis(), line.line);
            let class = classes.iter().position(|c| *c == key).unwrap_or_else(|| {
                classes.push(key);
                classes.len() - 1
            });
            let waves = line.in_sensor_coordinates().waves()?;
            let sensor = line.sensor_part().waves()?;
            let j = line.geometry.pixel_to_nm;
            let dual = j.try_inverse()?.transpose();
            let time_gradient = line.geometry.time_gradient(&line.timing?)?;
            let middle = line.geometry.size.map(|n| 0.5 * (n as f64 - 1.0));
            let off = j * (line.lattice.middle - Vector2::from(middle));
            // What was used of the frame may lie early or late in it.
            let time = middle_of_frame(scan).map(|time| time + time_gradient.dot(&off));
            all.push(Detection {
                scan: index,
                class,
                block: 0,
                waves: labelled_like(&waves, &reference),
                sensor: labelled_like(&sensor, &reference).covariance,
                time_gradient,
                fast_gain: dual * Matrix2::new(1.0, 0.0, 0.0, 0.0) * j.transpose(),
                time: time.unwrap_or(0.0),
                position: line.geometry.origin + j * line.lattice.middle,
                // Without sensors a window that creeps would pass for drift of the sample.
                phases: time
                    .filter(|_| line.geometry.from_sensors)
                    .and_then(|_| phases(line, &dual, &reference)),
            });
        }
    }
    Some(all)
}

/// Time of the middle of what was used of a frame, s from an arbitrary day. The header's time is that of
/// the frame's end.
pub(crate) fn middle_of_frame(scan: &MeasuredScan) -> Option<f64> {
    let line = scan.lines.first()?;
    let lines = line.lines_after as f64 + 0.5 * line.geometry.size[1] as f64;
    Some(seconds(scan.acquired?) - lines / scan.line_rate_hz?)
}

/// Seconds since the first of March of the year 0 (proleptic Gregorian calendar).
pub(crate) fn seconds(t: DateTime) -> f64 {
    // Years that start in March have their leap day at the end.
    let (year, month) = if t.month > 2 {
        (i64::from(t.year), i64::from(t.month) - 3)
    } else {
        (i64::from(t.year) - 1, i64::from(t.month) + 9)
    };
    let days = 365 * year + year.div_euclid(4) - year.div_euclid(100)
        + year.div_euclid(400)
        + (153 * month + 2) / 5
        + i64::from(t.day);
    let of_day = 3600 * i64::from(t.hour) + 60 * i64::from(t.minute) + i64::from(t.second);
    (86_400 * days + of_day) as f64
}

/// The phases of the reference's harmonics: those measured, in another order and sign.
fn phases(line: &MeasuredLine, dual: &Matrix2<f64>, reference: &Matrix2<f64>) -> Option<Phases> {
    let measured = three(&(dual * line.lattice.reciprocal));
    let mut places = [(0, 0.0); 3];
    for (place, wanted) in places.iter_mut().zip(three(reference)) {
        let signs = [1.0, -1.0];
        let (h, sign) = (0..3).flat_map(|h| signs.map(|s| (h, s))).min_by(|a, b| {
            let miss = |(h, s): &(usize, f64)| (measured[*h] * *s - wanted).norm();
            miss(a).total_cmp(&miss(b))
        })?;
        let miss: Vector2<f64> = measured[h] * sign - wanted;
        if miss.norm() > SAME_HARMONIC * wanted.norm() {
            return None;
        }
        *place = (h, sign);
    }
    Some(line.lattice.phases.relabelled(places))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(year: i32, month: u8, day: u8, second: u8) -> f64 {
        seconds(DateTime {
            year,
            month,
            day,
            hour: 23,
            minute: 59,
            second,
        })
    }

    /// Days between dates known from a calendar: leap years, centuries, year ends.
    #[test]
    fn seconds_follow_the_calendar() {
        let days = |a: f64, b: f64| (b - a) / 86_400.0;
        assert_eq!(days(at(2024, 2, 28, 0), at(2024, 3, 1, 0)), 2.0);
        assert_eq!(days(at(2023, 2, 28, 0), at(2023, 3, 1, 0)), 1.0);
        assert_eq!(days(at(1900, 2, 28, 0), at(1900, 3, 1, 0)), 1.0);
        assert_eq!(days(at(2000, 1, 1, 0), at(2001, 1, 1, 0)), 366.0);
        assert_eq!(days(at(1970, 1, 1, 0), at(2026, 11, 21, 0)), 20_778.0);
        assert_eq!(at(2024, 12, 31, 7) - at(2024, 12, 31, 0), 7.0);
    }
}
