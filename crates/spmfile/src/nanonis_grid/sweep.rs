//! The sweep of a grid: which of its points become images, and what these are called.

use std::collections::HashSet;

use super::grid::Grid;
use super::header::Header;
use super::name_and_unit;
use crate::words;

/// Largest number of points of a sweep that become images; of longer ones every second, third and so on.
const MOST_POINTS: usize = 512;
/// Largest number of images in all.
const MOST_IMAGES: usize = 2048;

impl Header {
    /// The values of the sweep, if they are told.
    pub(super) fn sweep(&self, grid: &Grid<'_>, notes: &mut Vec<String>) -> Option<Vec<f64>> {
        if self
            .get("Filetype")
            .is_some_and(|kind| kind.eq_ignore_ascii_case("MLS"))
        {
            let key = "Segment Start";
            return self
                .unread
                .entry(key, self.get(key), |text| segments(text, grid.points));
        }
        let [start, end] = ["Sweep Start", "Sweep End"].map(|name| grid.parameter(name));
        let ends = |point: usize| {
            start
                .zip(end)
                .map(|(start, end)| [start, end].map(|n| f64::from(grid.value(point, n))))
        };
        let [start, end] = ends(0).filter(|ends| ends.iter().all(|n| n.is_finite()))?;
        let [from, to] = ends(grid.recorded - 1)?;
        if [from, to] != [start, end] {
            notes.push(format!(
                "the sweep goes from {start} to {end} at the first point and from {from} to {to} at the last one: \
                 its images are named by the first"
            ));
        }
        Some(ramp(start, end, grid.points).collect())
    }

    /// The points of the sweep that become images, and what these are called: by the value of the sweep, or by number.
    pub(super) fn points(
        &self,
        grid: &Grid<'_>,
        values: Option<Vec<f64>>,
        notes: &mut Vec<String>,
    ) -> Vec<(usize, String)> {
        let images = grid.points.saturating_mul(grid.channels.len());
        let step = grid
            .points
            .div_ceil(MOST_POINTS)
            .max(images.div_ceil(MOST_IMAGES));
        if step > 1 {
            notes.push(format!(
                "of the {} points of its sweep, the first and every {step}th behind it are images",
                grid.points
            ));
        }
        let chosen = (0..grid.points).step_by(step);
        let number = |point: usize| format!("point {}", point + 1);
        let Some(values) = values else {
            notes.push("the values of its sweep are not told: its images are named by the number of the point".to_owned());
            return chosen.map(|point| (point, number(point))).collect();
        };
        let (_, unit) = name_and_unit(self.get("Sweep Signal").unwrap_or(""));
        // One digit more than neighbours need to differ.
        let steps = values.windows(2).map(|pair| (pair[1] - pair[0]).abs());
        let least = steps
            .filter(|&step| step > 0.0)
            .fold(f64::INFINITY, f64::min);
        let digits = if least.is_finite() {
            (1.0 - least.log10()).ceil().clamp(0.0, 15.0)
        } else {
            6.0
        };
        let tens = 10f64.powf(digits);
        let mut taken = HashSet::new();
        let mut label = |point: usize| {
            // No sign of a zero.
            let value = (values[point] * tens).round() / tens + 0.0;
            let value = if value != 0.0 && value.abs() < 1e-6 {
                format!("{value:e}")
            } else {
                value.to_string()
            };
            let label = format!("{value} {unit}").trim().to_owned();
            // Sweeps there and back pass a value twice.
            if taken.insert(label.clone()) {
                label
            } else {
                format!("{label}, {}", number(point))
            }
        };
        chosen.map(|point| (point, label(point))).collect()
    }
}

/// Values from start to end.
fn ramp(start: f64, end: f64, count: usize) -> impl Iterator<Item = f64> {
    let steps = count.saturating_sub(1).max(1) as f64;
    (0..count).map(move |n| start + (end - start) * (n as f64 / steps))
}

/// The values of segments `start,end,settling,integration,steps,…`, if there are as many as points: neighbours share
/// the value between them, or each has its own.
fn segments(text: &str, points: usize) -> Option<Vec<f64>> {
    let segment = |text: &str| {
        let parts: Vec<&str> = text.split(',').collect();
        let number = |n: usize| words::number(parts.get(n)?);
        let steps = parts
            .get(4)?
            .trim()
            .parse()
            .ok()
            .filter(|steps| (1..=points).contains(steps))?;
        Some((number(0)?, number(1)?, steps))
    };
    let all: Vec<(f64, f64, usize)> = text.split(';').map(segment).collect::<Option<_>>()?;
    let sum = all
        .iter()
        .try_fold(0, |sum: usize, &(.., steps)| sum.checked_add(steps))?;
    let shared = sum.checked_sub(all.len() - 1) == Some(points);
    if !shared && sum != points {
        return None;
    }
    let values = all
        .iter()
        .enumerate()
        .flat_map(|(n, &(start, end, steps))| {
            ramp(start, end, steps).skip(usize::from(shared && n > 0))
        });
    Some(values.collect())
}
