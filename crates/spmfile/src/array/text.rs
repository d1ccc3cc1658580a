//! Matrices of numbers as text: a line of numbers per line of the image, the top one first.
//!
//! Numbers are separated by `;`, tabs, commas or blanks, whichever of these comes first in that
//! order in the first line; with `;` and tabs a comma within a number is a decimal comma. An empty
//! field and `nan` are missing. Lines that begin with `#` are comments; of these the ones that
//! Gwyddion writes (`Channel`, `Width`, `Height`, `Value units`) are understood, and the
//! `key = value` of files written here.

use super::plane::{Plane, Told, turn};
use crate::error::ReadError;
use crate::labels;
use crate::scan::Samples;
use crate::stored::{Failure, Stored, Unpacked};
use crate::units::{clean, nm_per};

pub(super) const FORMAT: &str = "text matrix";

/// Finds the size of a matrix and what its comments tell; its numbers are not looked at.
pub(super) fn open(bytes: &[u8]) -> Result<(Told, Plane<'_>), String> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut told = Told::default();
    let mut size = [None, None];
    let mut carried = Vec::new();
    let (mut rows, mut columns) = (0, 0);
    for (_, line) in lines(bytes) {
        match line {
            Line::Comment(comment) if comment.contains('=') => {
                carried.extend(labels::lines(&comment));
            }
            Line::Comment(comment) => tell(&comment, &mut told, &mut size),
            Line::Numbers(line) => {
                if rows == 0 {
                    let line = String::from_utf8_lossy(line);
                    columns = fields(line.trim_matches(EDGES), separator_of(&line)).count();
                }
                rows += 1;
            }
        }
    }
    if columns == 0 {
        return Err("expected numbers, found none".to_owned());
    }
    if let [Some(width), Some(height)] = size {
        told.size_nm = Some([width, height]);
    }
    let fits = labels::fits(&carried, [rows, columns]);
    let samples = move || {
        let damaged = |reason| Failure::File(ReadError::damaged(FORMAT, reason));
        let values = values(bytes, columns).map_err(damaged)?;
        Ok(Unpacked::measured(Samples::F64(values)))
    };
    let plane = Plane {
        rows,
        columns,
        samples: Stored::Packed(Box::new(samples)),
        carried: if fits { carried } else { Vec::new() },
    };
    Ok((told, plane))
}

/// The numbers, the bottom line first.
fn values(bytes: &[u8], columns: usize) -> Result<Vec<f64>, String> {
    let mut separator = None;
    let mut values = Vec::new();
    for (number, line) in lines(bytes) {
        let Line::Numbers(line) = line else {
            continue;
        };
        let line = String::from_utf8_lossy(line);
        let line = line.trim_matches(EDGES);
        let separator = *separator.get_or_insert_with(|| separator_of(line));
        let before = values.len();
        for field in fields(line, separator) {
            let value = parse(field, separator)
                .ok_or_else(|| format!("line {number}: expected a number, found {field:?}"))?;
            values.push(value);
        }
        let found = values.len() - before;
        if found != columns {
            return Err(format!(
                "line {number}: expected {columns} numbers as in the first line, found {found}"
            ));
        }
    }
    turn(&mut values, columns);
    Ok(values)
}

/// What may stand at the ends of a line.
const EDGES: [char; 2] = ['\r', ' '];

enum Line<'a> {
    /// What stands behind the `#`.
    Comment(String),
    Numbers(&'a [u8]),
}

/// The lines that are not empty, with their numbers from 1.
fn lines(bytes: &[u8]) -> impl Iterator<Item = (usize, Line<'_>)> {
    let lines = bytes.split(|&b| b == b'\n').enumerate();
    lines.filter_map(|(index, line)| {
        let text = line.trim_ascii();
        let line = match text.strip_prefix(b"#") {
            Some(comment) => Line::Comment(String::from_utf8_lossy(comment).into_owned()),
            None if text.is_empty() => return None,
            None => Line::Numbers(line),
        };
        Some((index + 1, line))
    })
}

fn separator_of(line: &str) -> char {
    let found = [';', '\t', ','].into_iter().find(|&c| line.contains(c));
    found.unwrap_or(' ')
}

/// The fields of a line; a separator at its end begins no further one.
fn fields(line: &str, separator: char) -> impl Iterator<Item = &str> {
    let blanks = (separator == ' ').then(|| line.split_whitespace());
    let ended = line.strip_suffix(separator).unwrap_or(line);
    let others = (separator != ' ').then(|| ended.split(separator).map(str::trim));
    blanks
        .into_iter()
        .flatten()
        .chain(others.into_iter().flatten())
}

fn parse(field: &str, separator: char) -> Option<f64> {
    if field.is_empty() {
        return Some(f64::NAN);
    }
    if let Ok(value) = field.parse() {
        return Some(value);
    }
    let decimal_comma = matches!(separator, ';' | '\t') && !field.contains('.');
    let point = decimal_comma.then(|| field.replacen(',', ".", 1))?;
    point.parse().ok()
}

/// A comment such as `Width: 10.0 µm`.
fn tell(comment: &str, told: &mut Told, size: &mut [Option<f64>; 2]) {
    let Some((key, value)) = comment.split_once(':') else {
        return;
    };
    let value = value.trim();
    let length = || {
        let (number, unit) = value.split_once(char::is_whitespace)?;
        let nm = number.parse::<f64>().ok()? * nm_per(&clean(unit))?;
        (nm > 0.0 && nm.is_finite()).then_some(nm)
    };
    match key.trim() {
        "Channel" if !value.is_empty() => told.name = Some(value.to_owned()),
        "Value units" if !value.is_empty() => told.unit = Some(clean(value)),
        "Width" => size[0] = length(),
        "Height" => size[1] = length(),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(text: &str) -> Vec<f64> {
        let (_, plane) = open(text.as_bytes()).expect("a matrix");
        let bytes = text.trim_start_matches('\u{feff}').as_bytes();
        super::values(bytes, plane.columns).expect("numbers")
    }

    #[test]
    fn separators() {
        let expected = [3.0, 4.5, 1.0, -2.0];
        for text in [
            "1 -2\n3 4.5\n",
            "  1\t-2\r\n3\t4.5",
            "1,-2\n3,4.5\n\n",
            "1, -2,\n3, 4.5,\n",
            "1;-2\n3;4,5\n",
            "1,0\t-2,0\n3,0\t4,5\n",
            "\u{feff}# x\n1e0 -2\n3 45e-1\n",
        ] {
            assert_eq!(values(text), expected, "{text:?}");
        }
        let missing = values("1,,3\nnan,5,6\n");
        assert!(missing[0].is_nan() && missing[4].is_nan());
    }

    #[test]
    fn comments_tell_size_and_unit() {
        let text =
            "# Channel: Topography\n# Width: 1.5 µm\n# Height: 20 nm\n# Value units: m\n1 2\n";
        let (told, plane) = open(text.as_bytes()).expect("a matrix");
        assert_eq!(told.name.as_deref(), Some("Topography"));
        assert_eq!(told.unit.as_deref(), Some("m"));
        assert_eq!(told.size_nm, Some([1500.0, 20.0]));
        assert_eq!((plane.rows, plane.columns), (1, 2));
        let (told, _) = open(b"# Width: 5 V\n# Height: 20 nm\n1 2\n").expect("a matrix");
        assert_eq!(told.size_nm, None);
    }

    #[test]
    fn what_is_wrong_is_said() {
        let error = |text: &str| {
            let opened = open(text.as_bytes());
            let read = opened.and_then(|(_, plane)| super::values(text.as_bytes(), plane.columns));
            read.expect_err("no matrix")
        };
        assert!(error("1 2\n3\n").contains("line 2"));
        assert!(error("1 2\n3 x\n").contains("\"x\""));
        // Whether this comma is a decimal one is not known.
        assert!(error("1,5 2,5\n").contains("number"));
        assert!(error("# nothing\n\n").contains("none"));
    }
}
