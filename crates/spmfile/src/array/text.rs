//! Matrices of numbers as text: a line of numbers per line of the image, the top one first.
//!
//! Numbers are separated by `;`, tabs, commas or blanks, whichever of these comes first in that
//! order in the first line; with `;` and tabs a comma within a number is a decimal comma. An empty
//! field and `nan` are missing. Lines that begin with `#` are comments; of these the ones that
//! Gwyddion writes (`Channel`, `Width`, `Height`, `Value units`) are understood, and the
//! `key = value` of files written here.
//!
//! Lines and columns of labels are left out ([`super::table`]). Evenly spaced positions of columns and lines give the
//! size, where their unit of length stands in the corner, in the lines of words or in a comment.

use super::plane::{Plane, Told, turn};
use super::table::{Table, fields, lines, parse};
use crate::error::ReadError;
use crate::labels;
use crate::scan::Samples;
use crate::stored::{Failure, Stored, Unpacked};
use crate::units::{clean, length_nm, nm_per};
use crate::words::{self, Unread};

pub(super) const FORMAT: &str = "text matrix";

fn damaged(reason: String) -> ReadError {
    ReadError::damaged(FORMAT, reason)
}

/// Finds the size of a matrix and what its comments tell; most of its numbers are not looked at.
pub(super) fn open(bytes: &[u8]) -> Result<(Told, Plane<'_>), ReadError> {
    let text = words::decode(bytes);
    let Comments {
        mut told,
        carried,
        unit,
    } = Comments::of(&text);
    let nothing = || damaged("expected numbers, found none".to_owned());
    let plain = Table::of(&text, true).ok_or_else(nothing)?;
    let fits = labels::fits(&carried, [plain.rows, plain.columns]);
    let table = if fits {
        plain
    } else {
        Table::of(&text, false).ok_or_else(nothing)?
    };
    if let Some(reason) = table.no_image().filter(|_| !fits) {
        return Err(ReadError::unsupported(FORMAT, reason));
    }
    if table.columns == 0 || table.rows == 0 {
        return Err(nothing());
    }
    tell(&table, unit, &mut told);
    let (rows, columns) = (table.rows, table.columns);
    let samples = move || {
        let values = values(&text, &table).map_err(|reason| Failure::File(damaged(reason)))?;
        Ok(Unpacked::measured(Samples::F64(values)))
    };
    let plane = Plane {
        rows,
        columns,
        samples: Stored::Packed(Box::new(samples)),
        carried: if fits { carried } else { Vec::new() },
        size_nm: None,
    };
    Ok((told, plane))
}

/// The numbers, the bottom line first.
fn values(text: &str, table: &Table) -> Result<Vec<f64>, String> {
    // Each number and each separator is a byte at least.
    let most = table.rows.saturating_mul(table.columns);
    let mut values = Vec::with_capacity(most.min(text.len()));
    for (number, line) in lines(text).skip(table.labels) {
        let before = values.len();
        for field in fields(line, table.separator).skip(table.index) {
            let value = parse(field, table.separator)
                .ok_or_else(|| format!("line {number}: expected a number, found {field:?}"))?;
            values.push(value);
        }
        let (found, expected) = (values.len() - before, table.columns);
        if found != expected {
            return Err(format!(
                "line {number}: expected {expected} numbers as in the first line, found {found}"
            ));
        }
    }
    turn(&mut values, table.columns);
    Ok(values)
}

/// What labels tell: the size where they are positions in a unit, and that they were left out.
fn tell(table: &Table, unit: Option<f64>, told: &mut Told) {
    if let [Some(x), Some(y)] = table.axes
        && let Some(nm) = unit.or_else(|| unit_within(&table.words))
        && told.size_nm.is_none()
    {
        told.size_nm = Some([x, y].map(|axis| axis.length() * nm));
        if x.last < x.first || y.last > y.first {
            told.notes.push(format!(
                "the first line of the table is taken as the top one and its first column as the left one, though \
                 positions run from {} to {} in x and from {} to {} in y",
                x.first, x.last, y.first, y.last
            ));
        }
    }
    if table.by_spacing {
        let of = match (table.labels, table.index) {
            (0, _) => "first column",
            (_, 0) => "first line",
            _ => "first line and first column",
        };
        told.notes.push(format!(
            "the evenly spaced numbers of the {of} are taken as labels and left out"
        ));
    }
}

/// The unit of length that stands among words, as in `y/x (nm)`.
fn unit_within(words: &str) -> Option<f64> {
    let sign = |c: char| c.is_alphanumeric() || matches!(c, '~' | '\u{212b}');
    words.split(|c: char| !sign(c)).find_map(nm_per)
}

/// What comments tell.
#[derive(Default)]
struct Comments {
    told: Told,
    /// The lines `key = value` of files written here.
    carried: Vec<(String, String)>,
    /// The unit of the positions of columns and lines, in nm.
    unit: Option<f64>,
}

impl Comments {
    fn of(text: &str) -> Self {
        let mut comments = Self::default();
        let unread = Unread::default();
        let mut size = [None, None];
        for comment in text
            .lines()
            .filter_map(|line| line.trim().strip_prefix('#'))
        {
            if comment.contains('=') {
                comments.carried.extend(labels::lines(comment));
            } else if let Some((key, value)) = comment.split_once(':') {
                comments.tell(key.trim(), value.trim(), &mut size, &unread);
            } else if of_positions(comment) {
                comments.unit = comments.unit.or_else(|| unit_within(comment));
            }
        }
        if let [Some(width), Some(height)] = size {
            comments.told.size_nm = Some([width, height]);
        }
        comments.told.notes = unread.notes();
        comments
    }

    /// A comment such as `Width: 10.0 µm`.
    fn tell(&mut self, key: &str, value: &str, size: &mut [Option<f64>; 2], unread: &Unread) {
        let length = || {
            let length = |text| length_nm(text).filter(|&nm| nm > 0.0 && nm.is_finite());
            unread.entry(key, Some(value), length)
        };
        match key {
            "Channel" if !value.is_empty() => self.told.name = Some(value.to_owned()),
            "Value units" if !value.is_empty() => self.told.unit = Some(clean(value)),
            "Width" => size[0] = length(),
            "Height" => size[1] = length(),
            _ if of_positions(key) => self.unit = self.unit.or_else(|| unit_within(value)),
            _ => {}
        }
    }
}

/// Whether words are about the positions of pixels.
fn of_positions(words: &str) -> bool {
    const POSITIONS: [&str; 8] = [
        "x",
        "y",
        "xy",
        "xyunits",
        "axis",
        "axes",
        "lateral",
        "positions",
    ];
    let words = words.split(|c: char| !c.is_alphanumeric());
    words
        .into_iter()
        .any(|word| POSITIONS.contains(&&*word.to_ascii_lowercase()))
}

#[cfg(test)]
mod tests;
