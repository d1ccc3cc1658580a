//! Samples of a position sensor that are far off: bits that flip, spikes of the electronics.
//!
//! A tip moves smoothly. A sample that lies far from its neighbours along the line and far from those at the same place of
//! the lines before and after is not where the tip was. Both are asked for: the bend of a lag or of a turn-around comes
//! again in every line, and a jump of the scanner stays for the rest of a line. Far is far beyond the noise and some
//! pixels, so that nothing of a sound sensor is left out.
//!
//! In: the image of one sensor. Out: the same without these samples, or nothing where there are none.

use crate::frame::image::Image;
use crate::numbers::median::median;

/// Neighbours on either side whose median a sample is compared with: up to three of seven may be off themselves.
const REACH: usize = 3;
/// Three quarters of the second differences are smaller than this share of the limit. Of white noise three quarters are
/// below 2.8 σ, so that the limit is 11 σ: none in 10²⁰; one sample that is off spoils three, so that 8 % may be off.
const SHARE_OF_LIMIT: f64 = 0.25;
/// What is off by fewer pixels, or counts of a coarse converter, moves no plane: a per cent of such samples adds a third of
/// a pixel to the noise of a sample.
const PIXELS: f64 = 3.0;
/// Second differences that the scale is read from: it is then known to a per cent.
const SAMPLED: usize = 32_768;
/// Rounds; what hides behind its neighbours shows when these are gone.
const ROUNDS: usize = 3;

/// A sensor without the samples that are far off (missing in their place), and how many those are; `None` where all are
/// sound. `pitch` is the longer step from pixel to pixel, nm.
pub(crate) fn dropped(sensor: &Image, pitch: f64) -> Option<(Image, usize)> {
    let limit = limit(sensor, pitch)?;
    let mut places = off(sensor, limit);
    if places.is_empty() {
        return None;
    }
    let mut left = sensor.clone();
    let mut count = 0;
    for _ in 0..ROUNDS {
        count += places.len();
        for place in places {
            left.values[place] = f64::NAN;
        }
        places = off(&left, limit);
        if places.is_empty() {
            break;
        }
    }
    Some((left, count))
}

/// From how far on a sample is off, nm.
fn limit(sensor: &Image, pitch: f64) -> Option<f64> {
    let step = 1 + sensor.values.len() / SAMPLED;
    let mut sizes: Vec<f64> = (0..sensor.values.len())
        .step_by(step)
        .filter_map(|place| {
            let column = place % sensor.columns;
            let inside = (1..sensor.columns - 1).contains(&column);
            let change =
                inside.then(|| second_difference(&sensor.values[place - 1..=place + 1]))?;
            change.is_finite().then_some(change)
        })
        .collect();
    let most = sizes.len() * 3 / 4;
    if most == 0 {
        return None;
    }
    let usual = *sizes.select_nth_unstable_by(most, f64::total_cmp).1;
    Some((usual / SHARE_OF_LIMIT).max(PIXELS * pitch.max(resolution(sensor))))
}

/// The smallest difference of neighbours, nm: a count of a coarse converter.
fn resolution(sensor: &Image) -> f64 {
    let step = 1 + sensor.values.len() / SAMPLED;
    let pairs = sensor.values.windows(2).step_by(step);
    let sizes = pairs.map(|pair| (pair[1] - pair[0]).abs());
    let smallest = sizes
        .filter(|size| *size > 0.0)
        .fold(f64::INFINITY, f64::min);
    if smallest.is_finite() { smallest } else { 0.0 }
}

fn second_difference(three: &[f64]) -> f64 {
    (three[0] - 2.0 * three[1] + three[2]).abs()
}

/// The places of samples that are off.
fn off(sensor: &Image, limit: f64) -> Vec<usize> {
    let (rows, columns) = (sensor.rows, sensor.columns);
    let mut found = Vec::new();
    for row in 0..rows {
        let line = sensor.row(row);
        // Only near a kink can there be one: few lines have any.
        let mut suspects = vec![false; columns];
        let mut any = false;
        for (n, three) in line.windows(3).enumerate() {
            let kink = second_difference(three) > limit || three.iter().any(|v| v.is_nan());
            if kink {
                any = true;
                let last = (n + 1 + REACH).min(columns - 1);
                suspects[(n + 1).saturating_sub(REACH)..=last].fill(true);
            }
        }
        if !any {
            continue;
        }
        for column in (0..columns).filter(|&column| suspects[column]) {
            let along = |c: usize| line[c];
            let across = |r: usize| sensor.row(r)[column];
            let far = |place: usize, count: usize, value: &dyn Fn(usize) -> f64| {
                from_neighbours(place, count, value).is_none_or(|distance| distance > limit)
            };
            if line[column].is_finite() && far(column, columns, &along) && far(row, rows, &across) {
                found.push(row * columns + column);
            }
        }
    }
    found
}

/// How far a value is from the median of those around it, each moved along the mean step between the neighbours, which
/// takes out the slope at the rim where they lie on one side; `None` where there are no neighbours.
fn from_neighbours(place: usize, count: usize, value: &dyn Fn(usize) -> f64) -> Option<f64> {
    let first = place.saturating_sub(REACH);
    let last = (place + REACH).min(count - 1);
    let mut steps: Vec<f64> = (first..last)
        .map(|n| value(n + 1) - value(n))
        .filter(|step| step.is_finite())
        .collect();
    let step = if steps.is_empty() {
        0.0
    } else {
        median(&mut steps)
    };
    let mut others: Vec<f64> = (first..=last)
        .filter(|&n| n != place)
        .map(|n| value(n) + step * (place as f64 - n as f64))
        .filter(|v| v.is_finite())
        .collect();
    (!others.is_empty()).then(|| (value(place) - median(&mut others)).abs())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numbers::rng::stream;
    use rand::RngExt as _;
    use rand_distr::{Distribution, StandardNormal};

    const COLUMNS: usize = 120;
    const ROWS: usize = 90;

    /// A sensor along the fast axis with white noise, nm, and a shape of its lines.
    fn sensor(noise: f64, seed: u64, shape: impl Fn(usize, usize) -> f64) -> Image {
        let mut rng = stream(seed, "glitches", 0);
        let values = (0..ROWS * COLUMNS).map(|i| {
            let white: f64 = StandardNormal.sample(&mut rng);
            let (row, column) = (i / COLUMNS, i % COLUMNS);
            0.2 * column as f64 + shape(row, column) + noise * white
        });
        Image::new(ROWS, COLUMNS, values.collect())
    }

    /// What was put in is found, all of it, and nothing else: single samples, at the rims, and neighbours.
    #[test]
    fn glitches_are_found() {
        for (share, size) in [(0.0002, 5.0), (0.01, 1000.0), (0.05, 30.0)] {
            for seed in 0..10 {
                let mut image = sensor(0.1, seed, |_, _| 0.0);
                let mut rng = stream(seed, "glitches", 1);
                let mut put = Vec::new();
                for place in 0..image.values.len() {
                    if rng.random::<f64>() < share {
                        let up = rng.random::<bool>();
                        image.values[place] += if up { size } else { -size };
                        put.push(place);
                    }
                }
                for place in [0, COLUMNS - 1, COLUMNS * ROWS - 1] {
                    if !put.contains(&place) {
                        image.values[place] -= size;
                        put.push(place);
                    }
                }
                let (left, count) = dropped(&image, 0.2).unwrap();
                let missing: Vec<usize> = (0..left.values.len())
                    .filter(|&n| left.values[n].is_nan())
                    .collect();
                let wrong = missing.iter().filter(|n| !put.contains(n)).count();
                assert_eq!((wrong, count), (0, missing.len()), "{share} {seed}");
                let kept = put.len() - missing.len();
                // Of one sample in twenty, four of seven neighbours come together now and then.
                assert!(
                    kept as f64 <= 0.01 * put.len() as f64,
                    "{share} {seed}: {kept}"
                );
            }
        }
    }

    /// Noise, lag, turn-around, jumps of the scanner, lines apart and coarse counts are no glitches.
    #[test]
    fn sound_sensors_are_left_as_they_are() {
        for seed in 0..10 {
            let bend = |_: usize, c: usize| 6.0 * (-(c as f64) / 3.5).exp();
            assert!(dropped(&sensor(0.2, seed, bend), 0.2).is_none());
            assert!(dropped(&sensor(0.0, seed, bend), 0.2).is_none());
            let jump = |r: usize, c: usize| if r == 40 && c > 30 { 50.0 } else { 0.0 };
            assert!(dropped(&sensor(0.1, seed, jump), 0.2).is_none());
            let apart = |r: usize, _: usize| if r.is_multiple_of(7) { 20.0 } else { 0.0 };
            assert!(dropped(&sensor(0.1, seed, apart), 0.2).is_none());
            for count in [1.5, 6.0] {
                let mut coarse = sensor(0.1, seed, |_, _| 0.0);
                for value in &mut coarse.values {
                    *value = (*value / count).round() * count;
                }
                assert!(dropped(&coarse, 0.2).is_none(), "{count}");
            }
        }
    }
}
