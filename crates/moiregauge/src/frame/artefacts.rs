//! Artefacts of tip and electronics: spikes, steps from line to line, a contrast that turns around in the middle of a frame.

use crate::frame::image::{Image, without};
use crate::frame::median_ground::running_median;
use crate::numbers::median::median;

/// A pixel is a spike if it is farther than this from the median of the nine around, standard deviations: one in 500 million of Gaussian noise is.
const SPIKE: f64 = 6.0;
/// Lines below and above a line are compared over this share of a frame: a fifth of a period of a lattice of 16 periods.
const NEAR: f64 = 0.012;
/// The contrast turns around where their correlation is below this.
const TURNED: f64 = -0.3;

/// The image with its spikes replaced by the median of the nine pixels around.
pub(crate) fn without_spikes(image: &Image) -> Image {
    let middle = running_median(image, 3);
    let off = without(image, &middle);
    let mut sizes: Vec<f64> = off.finite().into_iter().map(f64::abs).collect();
    let most = SPIKE * 1.4826 * median(&mut sizes);
    let each = image.values.iter().zip(&middle.values);
    let calm = |(value, middle): (&f64, &f64)| {
        let is_spike = (value - middle).abs() > most;
        if is_spike { *middle } else { *value }
    };
    Image::new(image.rows, image.columns, each.map(calm).collect())
}

/// The image without the steps from line to line, each the median of the differences of pixels.
pub(crate) fn without_line_offsets(image: &Image) -> Image {
    let (mut level, mut offset) = (image.clone(), 0.0);
    for row in 1..image.rows {
        let pairs = image.row(row - 1).iter().zip(image.row(row));
        let steps = pairs.map(|(below, above)| above - below);
        let mut steps: Vec<f64> = steps.filter(|step| step.is_finite()).collect();
        if !steps.is_empty() {
            offset += median(&mut steps);
        }
        let line = &mut level.values[row * image.columns..][..image.columns];
        for value in line {
            *value -= offset;
        }
    }
    level
}

/// The sign of the contrast of each line, in an image without its ground: a tip that changes may turn it around.
pub(crate) fn signs(even: &Image) -> Vec<f64> {
    let mut signs = vec![1.0; even.rows];
    let near = (NEAR * even.rows as f64) as usize + 1;
    let sum = |values: &[f64]| values.iter().filter(|v| v.is_finite()).sum::<f64>();
    let lines: Vec<Vec<f64>> = (0..even.rows)
        .map(|row| even.row(row).chunks(near).map(sum).collect())
        .collect();
    // Sums over `near` lines from each.
    let sums: Vec<Vec<f64>> = lines
        .windows(near)
        .map(|some| {
            let column = |c: usize| some.iter().map(|line| line[c]).sum();
            (0..some[0].len()).map(column).collect()
        })
        .collect();
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    // Those that end below a line and those that begin at it: the last have none above.
    let pairs = sums.iter().zip(sums.iter().skip(near));
    let alike = pairs.map(|(below, above)| {
        let norm = product(below, below) * product(above, above);
        product(below, above) / norm.sqrt().max(f64::MIN_POSITIVE)
    });
    let alike: Vec<f64> = alike.collect();
    // A line that is nowhere alike has no contrast that could turn around.
    if median(&mut alike.clone()) < -TURNED {
        return signs;
    }
    let mut from = 0;
    while let Some(low) = alike[from..].iter().position(|alike| *alike < TURNED) {
        let dip = &alike[from + low..(from + low + 2 * near).min(alike.len())];
        let least = dip.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1));
        let line = from + low + least.map_or(0, |(at, _)| at) + near;
        signs[line..].iter_mut().for_each(|sign| *sign = -*sign);
        from = (line + near).min(alike.len());
    }
    signs
}

/// The image with the contrast of each line multiplied by its sign.
pub(crate) fn turned(image: &Image, signs: &[f64]) -> Image {
    let lines = image.values.chunks(image.columns).zip(signs);
    let values = lines.flat_map(|(line, sign)| line.iter().map(move |value| sign * value));
    Image::new(image.rows, image.columns, values.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A slope along the lines with offsets from line to line is that slope; a spike is the median of its neighbours, and a missing pixel stays missing.
    #[test]
    fn offsets_and_spikes_leave_the_image() {
        let (rows, columns) = (12, 20);
        let slope = |i: usize| 0.5 * (i % columns) as f64;
        let offset = |row: usize| [0.0, 7.0, -3.0, 11.0][row % 4];
        let values = (0..rows * columns).map(|i| slope(i) + offset(i / columns));
        let mut image = Image::new(rows, columns, values.collect());
        image.values[5 * columns + 9] = f64::NAN;
        let level = without_line_offsets(&image);
        for (i, value) in level.values.iter().enumerate() {
            assert!(value.is_nan() || (value - slope(i)).abs() < 1e-12, "{i}");
        }
        assert!(level.values[5 * columns + 9].is_nan());
        let mut spiked = level.clone();
        spiked.values[7 * columns + 3] = 1e3;
        let calm = without_spikes(&spiked);
        assert!((calm.values[7 * columns + 3] - slope(3)).abs() <= 0.5);
        assert!(calm.values[5 * columns + 9].is_nan());
        let signs = [vec![1.0; 4], vec![-1.0; 8]].concat();
        let turned = turned(&level, &signs);
        assert_eq!(
            turned.values[4 * columns + 8],
            -level.values[4 * columns + 8]
        );
        assert_eq!(
            turned.values[3 * columns + 8],
            level.values[3 * columns + 8]
        );
    }
}
