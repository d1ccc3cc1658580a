//! What a fit leaves around a harmonic: a few bins of the transform of its residual. Two images tell by it what noise they share.

use rustfft::num_complex::{Complex32, Complex64};
use serde::{Deserialize, Serialize};

use crate::numbers::bits;

/// Bins across the lines from a harmonic, in one column of the transform, or in two where whole lines have offsets.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Written", into = "Written")]
pub(crate) struct LeftOver {
    /// Cycles per frame along the lines.
    pub(crate) columns: Vec<i64>,
    /// The first row, cycles per frame.
    pub(crate) first: i64,
    /// Column by column.
    values: Vec<Complex32>,
}

impl LeftOver {
    /// `value` is asked for every bin of `rows` in each of the columns.
    pub(crate) fn new(
        columns: Vec<i64>,
        rows: std::ops::RangeInclusive<i64>,
        value: impl Fn(i64, i64) -> Complex64,
    ) -> Self {
        let bins = columns
            .iter()
            .flat_map(|&x| rows.clone().map(move |y| [x, y]));
        let single = |v: Complex64| Complex32::new(v.re as f32, v.im as f32);
        Self {
            values: bins.map(|[x, y]| single(value(x, y))).collect(),
            first: *rows.start(),
            columns,
        }
    }

    /// How many rows there are.
    pub(crate) fn rows(&self) -> usize {
        self.values.len() / self.columns.len().max(1)
    }

    /// The row of the harmonic.
    pub(crate) fn middle(&self) -> i64 {
        self.first + (self.rows() / 2) as i64
    }

    /// The value at a frequency, where it is kept.
    pub(crate) fn at(&self, [x, y]: [i64; 2]) -> Option<Complex64> {
        let column = self.columns.iter().position(|column| *column == x)?;
        self.within(column, y)
    }

    /// The same in a column by its number.
    pub(crate) fn within(&self, column: usize, y: i64) -> Option<Complex64> {
        let row = usize::try_from(y - self.first).ok()?;
        if row >= self.rows() || column >= self.columns.len() {
            return None;
        }
        let value = self.values.get(column * self.rows() + row)?;
        Some(Complex64::new(f64::from(value.re), f64::from(value.im)))
    }

    /// All of it: frequency (columns, rows) and value.
    pub(crate) fn bins(&self) -> impl Iterator<Item = ([i64; 2], Complex64)> + '_ {
        let rows = self.rows() as i64;
        let all = self.columns.iter().enumerate();
        all.flat_map(move |(column, &x)| {
            (self.first..self.first + rows)
                .filter_map(move |y| Some(([x, y], self.within(column, y)?)))
        })
    }
}

/// As it is written: real and imaginary parts by the bits of their single precision.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    columns: Vec<i64>,
    first: i64,
    values: String,
}

impl From<LeftOver> for Written {
    fn from(left: LeftOver) -> Self {
        Self {
            columns: left.columns,
            first: left.first,
            values: bits::to_text(left.values.iter().flat_map(|v| [v.re, v.im])),
        }
    }
}

impl TryFrom<Written> for LeftOver {
    type Error = &'static str;

    fn try_from(written: Written) -> Result<Self, Self::Error> {
        let parts = bits::from_text(&written.values)
            .ok_or("expected eight hexadecimal digits for each part of a value")?;
        let (pairs, rest) = parts.as_chunks::<2>();
        let columns = written.columns.len().max(1);
        if !rest.is_empty() || pairs.len() % columns != 0 {
            return Err("expected as many values in each column");
        }
        Ok(Self {
            columns: written.columns,
            first: written.first,
            values: pairs
                .iter()
                .map(|[re, im]| Complex32::new(*re, *im))
                .collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_are_found_and_read_back() {
        let value = |x: i64, y: i64| Complex64::new(x as f64, 0.5 * y as f64);
        let left = LeftOver::new(vec![-2, 2], -3..=5, value);
        assert_eq!((left.rows(), left.middle()), (9, 1));
        assert_eq!(left.bins().count(), 18);
        for (bin @ [x, y], found) in left.bins() {
            assert_eq!(found, value(x, y));
            assert_eq!(left.at(bin), Some(found));
        }
        assert_eq!(left.at([0, 0]), None);
        assert_eq!(left.at([2, 6]), None);
        assert_eq!(left.at([2, -4]), None);
        let text = serde_json::to_string(&left).unwrap();
        assert_eq!(serde_json::from_str::<LeftOver>(&text).unwrap(), left);
        assert_eq!(LeftOver::default().bins().count(), 0);
        assert!(serde_json::from_str::<LeftOver>(&text.replace("[-2,2]", "[1,2,3,4]")).is_err());
    }
}
