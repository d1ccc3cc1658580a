//! One image of an array or a picture, with the entries of its file.

use crate::error::ReadError;
use crate::labels;
use crate::stored::Stored;

/// One image.
pub(super) struct Plane<'a> {
    pub(super) rows: usize,
    pub(super) columns: usize,
    /// Where its samples are.
    pub(super) samples: Stored<'a>,
    /// The entries of the file about it; only files written here have them.
    pub(super) carried: Vec<(String, String)>,
    /// Its size by what other programs write.
    pub(super) size_nm: Option<[f64; 2]>,
}

/// Why there is no image.
#[derive(Debug)]
pub(super) enum Trouble {
    /// The bytes contradict each other.
    Damaged(String),
    /// The file is whole, and of a kind that is not read.
    NotRead(String),
}

impl Trouble {
    pub(super) fn of(self, format: &'static str) -> ReadError {
        match self {
            Self::Damaged(reason) => ReadError::damaged(format, reason),
            Self::NotRead(reason) => ReadError::unsupported(format, reason),
        }
    }

    pub(super) fn reason(self) -> String {
        match self {
            Self::Damaged(reason) | Self::NotRead(reason) => reason,
        }
    }
}

impl From<String> for Trouble {
    fn from(reason: String) -> Self {
        Self::Damaged(reason)
    }
}

impl From<&str> for Trouble {
    fn from(reason: &str) -> Self {
        Self::Damaged(reason.to_owned())
    }
}

/// What a file says beside its numbers; only text files do.
#[derive(Debug, Default)]
pub(super) struct Told {
    pub(super) name: Option<String>,
    pub(super) unit: Option<String>,
    pub(super) size_nm: Option<[f64; 2]>,
    /// How the frame was scanned, as [`labels::describe`] has it.
    pub(super) lines: Vec<(String, String)>,
    /// What was doubtful.
    pub(super) notes: Vec<String>,
    /// Of the channel: as [`labels::describe_channel`] has it.
    pub(super) channel: Vec<(String, String)>,
}

impl Told {
    /// What a plane carries along.
    pub(super) fn by(plane: &mut Plane<'_>) -> Self {
        let (lines, channel) = labels::carried(std::mem::take(&mut plane.carried));
        let value = |key: &str| labels::value(&channel, key).map(str::to_owned);
        let length = |key: &str| {
            let nm: f64 = labels::value(&channel, key)?.parse().ok()?;
            (nm > 0.0 && nm.is_finite()).then_some(nm)
        };
        Self {
            name: value("name"),
            unit: value("unit"),
            size_nm: length("width (nm)")
                .zip(length("height (nm)"))
                .map(|(width, height)| [width, height])
                .or(plane.size_nm),
            notes: Vec::new(),
            lines,
            channel,
        }
    }

    /// What is told twice is taken from `self`.
    pub(super) fn or(self, other: Self) -> Self {
        Self {
            name: other.name.or(self.name),
            unit: other.unit.or(self.unit),
            size_nm: other.size_nm.or(self.size_nm),
            notes: self.notes,
            ..other
        }
    }
}

/// Turns lines from the top down into lines from the bottom up, in place.
pub(super) fn turn<T>(values: &mut [T], columns: usize) {
    if columns == 0 {
        return;
    }
    let rows = values.len() / columns;
    let (lower, upper) = values.split_at_mut(rows / 2 * columns);
    for (low, high) in lower
        .chunks_exact_mut(columns)
        .zip(upper.rchunks_exact_mut(columns))
    {
        low.swap_with_slice(high);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_turned() {
        for rows in 0..6 {
            let mut values: Vec<usize> = (0..3 * rows).collect();
            turn(&mut values, 3);
            let expected: Vec<usize> = (0..rows)
                .rev()
                .flat_map(|row| 3 * row..3 * row + 3)
                .collect();
            assert_eq!(values, expected);
        }
        turn::<u8>(&mut [], 0);
    }
}
