//! A plain matrix of pixel values.

use rayon::prelude::*;

/// Pixel values row by row; row 0 is the bottom line, column 0 the left one. NaN marks missing pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Number of lines.
    pub rows: usize,
    /// Number of samples in a line.
    pub columns: usize,
    /// `values[row · columns + column]`.
    pub values: Vec<f64>,
}

impl Image {
    /// An image of the given shape.
    ///
    /// # Panics
    /// If the number of values is not `rows · columns`.
    pub fn new(rows: usize, columns: usize, values: Vec<f64>) -> Self {
        assert_eq!(rows * columns, values.len(), "shape and number of values");
        Self {
            rows,
            columns,
            values,
        }
    }

    /// The values of one line.
    pub fn row(&self, row: usize) -> &[f64] {
        &self.values[row * self.columns..(row + 1) * self.columns]
    }

    /// The values that are there.
    pub fn finite(&self) -> Vec<f64> {
        let values = self.values.iter().copied();
        values.filter(|v| v.is_finite()).collect()
    }

    /// The block of `size` (columns, rows) that starts at `first` (column, row).
    ///
    /// # Panics
    /// If the block does not lie within the image.
    #[must_use]
    pub fn cropped(&self, first: [usize; 2], size: [usize; 2]) -> Self {
        let values = (first[1]..first[1] + size[1])
            .flat_map(|row| &self.row(row)[first[0]..first[0] + size[0]])
            .copied()
            .collect();
        Self::new(size[1], size[0], values)
    }

    /// Means over blocks of `factor × factor` pixels. A block of which less than half is there is
    /// missing; rows and columns that fill no block are left out.
    #[must_use]
    pub fn binned(&self, factor: usize) -> Self {
        let (rows, columns) = (self.rows / factor, self.columns / factor);
        let mut values = vec![0.0; rows * columns];
        let lines = values.par_chunks_exact_mut(columns.max(1)).enumerate();
        lines.for_each(|(row, sums)| {
            let mut counts = vec![0usize; columns];
            for line in row * factor..(row + 1) * factor {
                let blocks = self.row(line).chunks_exact(factor);
                for ((block, sum), count) in blocks.zip(&mut *sums).zip(&mut counts) {
                    for v in block.iter().filter(|v| v.is_finite()) {
                        *sum += v;
                        *count += 1;
                    }
                }
            }
            for (sum, &count) in sums.iter_mut().zip(&counts) {
                let is_there = 2 * count >= factor * factor;
                *sum = if is_there {
                    *sum / count as f64
                } else {
                    f64::NAN
                };
            }
        });
        Self::new(rows, columns, values)
    }
}

/// The differences of two images of one size.
pub(crate) fn without(image: &Image, other: &Image) -> Image {
    let both = image.values.iter().zip(&other.values);
    let values = both.map(|(value, other)| value - other);
    Image::new(image.rows, image.columns, values.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_and_bins() {
        let n = f64::NAN;
        let image = Image::new(
            3,
            5,
            vec![
                1.0, 2.0, 3.0, n, 9.0, //
                3.0, 4.0, n, n, 9.0, //
                9.0, 9.0, 9.0, 9.0, 9.0,
            ],
        );
        let binned = image.binned(2);
        assert_eq!((binned.rows, binned.columns), (1, 2));
        assert_eq!(binned.values[0], 2.5);
        assert!(binned.values[1].is_nan());
        let block = image.cropped([1, 0], [2, 2]);
        assert_eq!(block.row(0), [2.0, 3.0]);
        assert_eq!(block.row(1)[0], 4.0);
    }
}
