//! A plain matrix of pixel values.

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
}
