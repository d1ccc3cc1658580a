//! Sums over every column of an image, read once: planes through any of its columns, the slopes and the means of the columns
//! follow from them.

use std::ops::Range;

use crate::frame::image::Image;
use crate::frame::plane::{FLAT, Plain, PlaneFit, PlaneSums, roughly};
use crate::numbers::interrupt;
use crate::numbers::widest::widest;

/// Approximate number of lines for the first plane: sums of what it leaves keep their digits.
const GUESSED_FROM: usize = 16;
/// A column with fewer values has no slope.
const FEWEST: f64 = 3.0;

/// Sums over the pixels of each column that are there: y is the line from the middle of the image, v what a guessed plane leaves.
pub(crate) struct ColumnSums {
    guess: PlaneFit,
    rows: usize,
    /// Number of pixels, Σy and Σy².
    there: [Vec<f64>; 3],
    /// Σv, Σyv and Σv².
    left: [Vec<f64>; 3],
    /// The largest |v|.
    largest: Vec<f64>,
}

impl ColumnSums {
    pub(crate) fn of(image: &Image) -> Self {
        let step = (image.rows / GUESSED_FROM).max(1);
        let guess = roughly(image, step).unwrap_or(FLAT);
        let zeros = || vec![0.0; image.columns];
        let mut sums = Self {
            guess,
            rows: image.rows,
            there: [zeros(), zeros(), zeros()],
            left: [zeros(), zeros(), zeros()],
            largest: zeros(),
        };
        let slope = (0..image.columns).map(|c| guess.per_column * c as f64);
        let slope: Vec<f64> = slope.collect();
        let mut whole = [0.0; 3];
        for row in 0..image.rows {
            interrupt::check();
            let y = row as f64 - sums.rows as f64 / 2.0;
            let start = guess.origin + guess.per_row * row as f64;
            if sums.add_line(image.row(row), &slope, start, y) {
                for (sum, term) in whole.iter_mut().zip([1.0, y, y * y]) {
                    *sum += term;
                }
            }
        }
        for (sums, whole) in sums.there.iter_mut().zip(whole) {
            for sum in sums {
                *sum += whole;
            }
        }
        sums
    }

    /// Adds a line; whether it is whole. What is there of a whole line is not counted yet.
    fn add_line(&mut self, values: &[f64], slope: &[f64], start: f64, y: f64) -> bool {
        let [v_sums, yv_sums, vv_sums] = &mut self.left;
        let largest = &mut self.largest;
        let whole = widest(
            #[inline(always)]
            || {
                let missing = values.iter().map(|v| u64::from(!v.is_finite()));
                let whole = missing.sum::<u64>() == 0;
                let sums = v_sums.iter_mut().zip(yv_sums).zip(vv_sums).zip(largest);
                let pixels = values.iter().zip(slope);
                for ((value, slope), (((v_sum, yv_sum), vv_sum), largest)) in pixels.zip(sums) {
                    let v = value - slope - start;
                    let v = if v.abs() < f64::INFINITY { v } else { 0.0 };
                    *v_sum += v;
                    *yv_sum += y * v;
                    *vv_sum += v * v;
                    *largest = if v.abs() > *largest {
                        v.abs()
                    } else {
                        *largest
                    };
                }
                whole
            },
        );
        if !whole {
            let there = (0..values.len()).filter(|&c| values[c].is_finite());
            for column in there {
                for (sums, term) in self.there.iter_mut().zip([1.0, y, y * y]) {
                    sums[column] += term;
                }
            }
        }
        whole
    }

    /// The plane through all pixels of some columns.
    pub(crate) fn least_squares(&self, columns: Range<usize>) -> Option<PlaneFit> {
        let mut sums = PlaneSums::new(&self.guess, columns.clone(), self.rows);
        for column in columns {
            let [_, y, yy] = [0, 1, 2].map(|i| self.there[i][column]);
            sums.add_column(column, self.plain(column), [y, yy, self.left[1][column]]);
        }
        sums.plane()
    }

    fn plain(&self, column: usize) -> Plain {
        Plain {
            count: self.there[0][column],
            v: self.left[0][column],
            vv: self.left[2][column],
        }
    }

    /// Whether every pixel of some columns is nearer than `limit` to a plane.
    pub(crate) fn all_within(&self, columns: Range<usize>, plane: &PlaneFit, limit: f64) -> bool {
        let apart = |column: usize, row: usize| {
            let place = (column as f64, row as f64);
            (plane.at(place.0, place.1) - self.guess.at(place.0, place.1)).abs()
        };
        let (last_column, last_row) = (columns.end.max(1) - 1, self.rows.max(1) - 1);
        let corners = [columns.start, last_column].map(|c| [0, last_row].map(|r| apart(c, r)));
        let apart = corners.as_flattened().iter().copied().fold(0.0, f64::max);
        let largest = self.largest[columns].iter().copied().fold(0.0, f64::max);
        largest + apart < limit
    }

    /// The mean of a column about a plane and the standard deviation of one of its values; `None` of a column without any.
    pub(crate) fn about(&self, column: usize, plane: &PlaneFit) -> Option<[f64; 2]> {
        let Plain { count, v, vv } = self.plain(column);
        if count == 0.0 {
            return None;
        }
        let row = self.there[1][column] / count + self.rows as f64 / 2.0;
        let place = (column as f64, row);
        let mean = v / count;
        let apart = self.guess.at(place.0, place.1) - plane.at(place.0, place.1);
        let variance = (vv / count - mean * mean).max(0.0);
        Some([mean + apart, variance.sqrt()])
    }

    /// Step from line to line of a column.
    pub(crate) fn slope(&self, column: usize) -> Option<f64> {
        let [count, y, yy] = [0, 1, 2].map(|i| self.there[i][column]);
        let [v, yv, _] = [0, 1, 2].map(|i| self.left[i][column]);
        let spread = count * yy - y * y;
        let known = count >= FEWEST && spread > 0.0;
        known.then(|| self.guess.per_row + (count * yv - y * v) / spread)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numbers::rng::normals;

    const ROWS: usize = 40;
    const COLUMNS: usize = 50;

    /// A tilted image with noise, of which some pixels are missing, and a whole line.
    fn image() -> Image {
        let mut noise = normals(1, "column sums", 0);
        let values = (0..ROWS * COLUMNS).map(|i| {
            let (row, column) = (i / COLUMNS, i % COLUMNS);
            let value = 400.0 + 0.3 * column as f64 - 0.2 * row as f64 + 0.1 * noise();
            let missing = row == 7 || i % 31 == 3;
            if missing { f64::NAN } else { value }
        });
        Image::new(ROWS, COLUMNS, values.collect())
    }

    /// Slopes, means and standard deviations of columns equal their definitions.
    #[test]
    fn columns_are_what_they_are_defined_as() {
        let image = image();
        let sums = ColumnSums::of(&image);
        let plane = PlaneFit {
            origin: 399.0,
            per_column: 0.31,
            per_row: -0.19,
            residual: 0.0,
        };
        for column in [0, 3, 49] {
            let rows = (0..ROWS).filter(|&row| image.row(row)[column].is_finite());
            let rows: Vec<usize> = rows.collect();
            let n = rows.len() as f64;
            let left = |row: usize| image.row(row)[column] - plane.at(column as f64, row as f64);
            let middle = rows.iter().map(|&r| r as f64).sum::<f64>() / n;
            let mean = rows.iter().map(|&r| left(r)).sum::<f64>() / n;
            let across = rows
                .iter()
                .map(|&r| (r as f64 - middle).powi(2))
                .sum::<f64>();
            let slope = rows
                .iter()
                .map(|&r| (r as f64 - middle) * left(r))
                .sum::<f64>()
                / across;
            let [found, sigma] = sums.about(column, &plane).expect("a column");
            assert!((found - mean).abs() < 1e-10, "{column}: {found} {mean}");
            assert!((0.05..0.2).contains(&sigma), "{column}: {sigma}");
            let found = sums.slope(column).expect("a column");
            assert!(
                (found - slope - plane.per_row).abs() < 1e-10,
                "{column}: {found}"
            );
        }
    }

    /// The plane through some columns is that of those columns alone, and an outlier is seen where it is.
    #[test]
    fn planes_of_some_columns_are_those_of_a_part() {
        let mut image = image();
        image.values[20 * COLUMNS + 30] += 5.0;
        let sums = ColumnSums::of(&image);
        let part = image.cropped([10, 0], [15, ROWS]);
        let alone = ColumnSums::of(&part).least_squares(0..15).expect("a plane");
        let found = sums.least_squares(10..25).expect("a plane");
        assert!((found.per_column - alone.per_column).abs() < 1e-12);
        assert!((found.per_row - alone.per_row).abs() < 1e-12);
        assert!((found.residual - alone.residual).abs() < 1e-9);
        assert!(sums.all_within(10..25, &found, 0.6));
        assert!(!sums.all_within(10..40, &found, 4.0));
    }
}
